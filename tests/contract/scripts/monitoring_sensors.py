"""A thermometer that sticks and a frequency that dies are faults, and no damage."""

import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.monitoring import Monitor

campaign = make_truss_campaign(2, random_state=0)
records = campaign.temperatures.join(campaign.frequencies)
records.loc["2026-02-10":"2026-04-20", "T2"] = 12.5
records.loc["2026-03-01":, "f4"] = float("nan")
monitor = Monitor(targets=list(campaign.frequencies)).fit(records[:"2025"])
monitor.update(records["2026-01":"2026-04"])
faults = monitor.faults_
since = {name: pd.Timestamp(faults.loc[faults["column"] == name, "since"].iloc[0]) for name in ("T2", "f4")}
RESULTS = {
    "columns": sorted(set(faults["column"])),
    "T2": (since["T2"] - pd.Timestamp("2026-02-10")).days,
    "f4": (since["f4"] - pd.Timestamp("2026-03-01")).days,
    "evaluated": float(monitor.evaluations_["index"].notna().mean()),
}
TOLERANCES = {"T2": {"atol": 3}, "f4": {"atol": 3}, "evaluated": {"atol": 0.1}}
