"""Which damage explains shifted frequencies: groups, probabilities, severities with bands."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM

year = make_truss_campaign(random_state=0)
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
groups, found = ["bottom", "top", "diagonal"], {}
for name, damage in {"bottom": {"bottom": 0.12}, "diagonal": {"diagonal": 0.1}, "healthy": None}.items():
    later = make_truss_campaign(damage=damage, random_state=2)
    T, F = later.temperatures[:90], later.frequencies[:90]
    found[name] = identify_damage(fem, T, F, groups, random_state=0)
lowest, highest = found["bottom"].table.loc["bottom", ["ci_low", "ci_high"]]
RESULTS = {name: {"causes": list(one.most_probable)} for name, one in found.items()}
RESULTS |= {
    "severities": {name: one.severities for name, one in found.items()},
    "errors": found["bottom"].table["standard_error"],
    "damaged": [bool(one.probability_of_damage > 0.9) for one in found.values()],
    "inside": bool(lowest < 0.12 < highest),
    "scenario": found["bottom"].scenario().name,
    "summary": "bottom" in found["bottom"].summary(),
}
TOLERANCES = {"severities": {"atol": 0.012}, "errors": {"atol": 0.005}}
