"""A tower of three storeys, of which a program has written the stiffness of each, divided into damage groups."""

import numpy as np

from skthermo.fem import AffineModel, ImportedStructure

stiffness = {("s1",): 400 * np.diag([1.0, 0, 0])}
for name, i in {"s2": 0, "s3": 1}.items():
    stiffness[name,] = np.zeros((3, 3))
    stiffness[name,][i : i + 2, i : i + 2] = [[400, -400], [-400, 400]]
heights = {storey: (0.0, 0.0, 3.0 * storey) for storey in range(4)}
members = {"s1": (0, 1), "s2": (1, 2), "s3": (2, 3)}
exported = AffineModel(stiffness, np.eye(3), n_modes=2)
tower = ImportedStructure(exported, heights, members, {"all": members, "upper": ["s2", "s3"]})
model = tower.assemble(["all"], groups=["upper"], n_modes=2)
divided = tower.divide(model, {"upper": {"top": ["s3"]}})
RESULTS = {
    "frequencies": model.frequencies([[1.0], [1.1]]),
    "groups": list(divided.groups),
    "damaged top": divided.damaged({"top": 0.5}).frequencies([[1.0]]),
    "local": exported.local_modes([1.0] * 3).frequencies,
}
TOLERANCES = {"*": {"rtol": 1e-8}}
