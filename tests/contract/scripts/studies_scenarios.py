"""Kinds of damage: sudden, growing, uncertain, and a series of severities."""

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies import ProgressiveDamage, Scenario, UncertainDamage, sweep
from skthermo.surrogate import DataInformedFEM

crack = ProgressiveDamage("growing crack", {"bottom": 0.2}, onset=2, end=4)
settled = UncertainDamage("settled pier", pd.DataFrame({"pier": [0.24, 0.31, 0.28]}))
chord = Scenario("lower chord, a fifth", {"bottom": 0.2})
year = make_truss_campaign(samples_per_year=120, random_state=0)
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
cracked = fem.simulate(year.temperatures, **crack.changes(year.temperatures)) / fem.predict(year.temperatures)
RESULTS = {
    "growth": crack.changes(np.zeros((6, 3)))["damage"]["bottom"],
    "draw": settled.changes(None, repeat=1),
    "chord": [chord.family, chord.severity, chord.is_healthy, Scenario("healthy").is_healthy],
    "names": [one.name for one in sweep(make_truss(), (0.1, 0.2), ["bottom", "top"])],
    "families": [one.family for one in sweep(make_truss(), (-0.1, 0.2), ["bottom"])],
    "falls": cracked["f1"].iloc[[0, 1, 3, 4, 60]].to_numpy(),
}
TOLERANCES = {"falls": {"rtol": 2e-3}}
