"""Causes that are no damage of a group: a stiffer part, one mode alone."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies import DamagePrior, identify_damage
from skthermo.surrogate import DataInformedFEM

year, later = make_truss_campaign(random_state=0), make_truss_campaign(random_state=2)
truss = make_truss()
fem = DataInformedFEM(truss, random_state=0).fit(year.temperatures, year.frequencies)
nominal = truss.frequencies([[1.0] * 4])
stiffer = truss.damaged({"bottom": -0.15}).frequencies([[1.0] * 4]) / nominal
T, F = later.temperatures[:120], later.frequencies[:120] * stiffer
gain = identify_damage(fem, T, F, ["bottom", "top"], stiffening=True, random_state=0)
other = identify_damage(fem, T, later.frequencies[:120] * [1, 1, 1, 1, 1, 0.93], ["bottom", "top"], random_state=0)
loss = identify_damage(fem, T, F, ["bottom", "top"], prior=DamagePrior(severity=0.2), random_state=0)
RESULTS = {
    "gain": float(gain.table.loc["bottom stiffer", "severity"]),
    "other": [bool(other.probability_other > 0.5), bool(loss.probability_other > 0.5)],
    "law": DamagePrior(severity=0.3).law,
}
TOLERANCES = {"gain": {"atol": 0.02}}
