"""The model of the bridge Z24, and a settled pier."""

from skthermo.datasets import make_z24

model = make_z24()
RESULTS = {
    "parameters": list(model.parameter_names),
    "frequencies": model.frequencies([[1.0] * 4]),
    "softer soil": model.damaged({"soil": 0.3}).frequencies([[1.0] * 4]),
}
TOLERANCES = {"*": {"rtol": 1e-7}}
