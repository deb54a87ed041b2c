"""After a repair a new baseline begins; a detector learns anew from what has come."""

from skthermo.datasets import make_truss_campaign
from skthermo.monitoring import Monitor

campaign = make_truss_campaign(2, random_state=0)
records = campaign.temperatures.join(campaign.frequencies)
records.loc["2026-03-01":, list(campaign.frequencies)] *= 1.03
monitor = Monitor(targets=list(campaign.frequencies), random_state=0).fit(records[:"2025"])
monitor.update(records["2026-01":"2026-04"])
before = monitor.status(monitor.last_).state
done = monitor.rebaseline("2026-03-01", until="2026-04-30")
monitor.update(records["2026-05":"2026-06"])
index = monitor.evaluations_.loc["2026-05":, "index"]
RESULTS = {
    "before": before,
    "accepted": bool(done.accepted),
    "after": float((index > monitor.threshold_).mean()),
}
TOLERANCES = {"after": {"atol": 0.1}}
