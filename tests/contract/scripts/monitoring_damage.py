"""A monitor without an FE model: healthy until March, then a loss of a tenth of the bottom chord."""

import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.monitoring import Monitor


def next_year(damage):
    campaign = make_truss_campaign(damage=damage, random_state=1)
    records = campaign.temperatures.join(campaign.frequencies)
    return records.set_index(records.index + pd.DateOffset(years=1))


year = make_truss_campaign(random_state=0)
monitor = Monitor(targets=list(year.frequencies), units="Hz").fit(year.temperatures.join(year.frequencies))
healthy = monitor.update(next_year({})[:"2026-03-01"])
states = [monitor.status(monitor.last_).state]
damaged = monitor.update(next_year({"bottom": 0.1})["2026-03-02":"2026-03-31"])
states.append(monitor.status(monitor.last_).state)
damage = monitor.events_[monitor.events_["kind"] == "damage"]
RESULTS = {
    "states": states,
    "rows": [len(healthy), len(damaged)],
    "above": [float((one["index"] > one["threshold"]).mean()) for one in (healthy, damaged)],
    "begins": (damage["start"].iloc[-1] - pd.Timestamp("2026-03-02")).days,
    "open": bool(damage["end"].isna().iloc[-1]),
    "last": str(monitor.last_),
    "summary": "alarm" in str(monitor.status(monitor.last_)) or "alarm" in monitor.summary(),
}
TOLERANCES = {"above": {"atol": 0.2}, "begins": {"atol": 5}}
