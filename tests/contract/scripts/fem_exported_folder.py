"""A folder as Abaqus writes it: one job as built, and one with each spring doubled."""

import tempfile
from pathlib import Path

from skthermo.fem import load_affine

text = "1,1, 1,1, {}\n2,1, 1,1, {}\n2,1, 2,1, {}\n"
jobs = {"nominal": (800, -400, 400), "base": (1200, -400, 400), "top": (1200, -800, 800)}
with tempfile.TemporaryDirectory() as folder:
    for job, entries in jobs.items():
        Path(folder, f"{job}_STIF1.mtx").write_text(text.format(*entries))
    Path(folder, "nominal_MASS1.mtx").write_text(text.format(1, 0, 1))
    model = load_affine(folder, factor=2.0, n_modes=2)
RESULTS = {
    "parameters": list(model.parameter_names),
    "labels": [list(label) for label in model.dofs],
    "frequencies": model.frequencies([[1.0, 1.0], [1.2, 0.9]]),
}
TOLERANCES = {"*": {"rtol": 1e-8}}
