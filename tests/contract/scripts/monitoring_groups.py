"""A monitor with an FE model names the damaged group."""

import pandas as pd

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.monitoring import Monitor
from skthermo.surrogate import DataInformedFEM

year = make_truss_campaign(random_state=0)
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
monitor = Monitor(fem=fem, random_state=0).fit(year.temperatures.join(year.frequencies))
later = make_truss_campaign(damage={"bottom": 0.15}, random_state=1)
new = later.temperatures.join(later.frequencies)[:30]
monitor.update(new.set_index(new.index + pd.DateOffset(years=1)))
damage = monitor.events_[monitor.events_["kind"] == "damage"]
RESULTS = {
    "state": monitor.status(monitor.last_).state,
    "groups": "bottom" in damage["groups"].iloc[-1],
    "begins": (damage["start"].iloc[0] - pd.Timestamp("2026-01-01")).days,
    "drift": list(monitor.drift_.index),
}
TOLERANCES = {"begins": {"atol": 4}}
