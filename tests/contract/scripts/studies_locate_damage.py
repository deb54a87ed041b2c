"""Which members of a group are damaged."""

from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM

year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
structure, model = truss_structure(), make_truss()
fem = DataInformedFEM(model, random_state=0).fit(year.temperatures, year.frequencies)
divided = structure.divide(model, {"diagonal": {"two bays": ["10", "22"]}})
healthy, damaged = (one.frequencies([[1.0] * 4]) for one in (divided, divided.damaged({"two bays": 0.4})))
F = later.frequencies * damaged / healthy
T, groups = later.temperatures, ["top", "diagonal"]
located = identify_damage(fem, T, F, groups, structure=structure, random_state=0)
RESULTS = {
    "members": sorted(located.likely_members()),
    "severity": located.table.loc[["10", "22"], "severity"],
    "damaged": bool(located.probability_of_damage > 0.9),
}
TOLERANCES = {"severity": {"atol": 0.12}}
