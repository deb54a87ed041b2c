"""The model of the bridge KW51, its sensors, and its calibrated state."""

from skthermo.datasets import kw51_sensors, kw51_structure, make_kw51

model = make_kw51(["E_arc", "M_a"], n_modes=2)
structure = kw51_structure()
RESULTS = {
    "frequencies": model.frequencies([[1.0, 1.0], [1.1, 1.0], [1.0, 1.1]]),
    "sensor": [str(part) for part in structure.dofs[kw51_sensors()["aBD17Az"]]],
    "dofs": len(structure.dofs),
    "braces": len(structure.groups["braces"]),
}
TOLERANCES = {"*": {"rtol": 1e-7}}
