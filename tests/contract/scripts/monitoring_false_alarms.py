"""A healthy year has about as many false events as were asked for."""

from skthermo.datasets import make_truss_campaign
from skthermo.monitoring import Monitor

campaign = make_truss_campaign(3, random_state=3)
records = campaign.temperatures.join(campaign.frequencies)
monitor = Monitor(targets=list(campaign.frequencies), false_alarms_per_year=1).fit(records.loc[:"2026"])
monitor.update(records.loc["2027"])
RESULTS = {
    "events": int((monitor.events_["kind"] == "damage").sum()),
    "expected": monitor.false_alarm_estimate_.expected,
    "evaluated": float(monitor.evaluations_["index"].notna().mean()),
    "smallest": monitor.smallest_changes_.common,
}
TOLERANCES = {
    "events": {"atol": 2},
    "expected": {"atol": 0.3},
    "evaluated": {"atol": 0.05},
    "smallest": {"atol": 0.004},
}
