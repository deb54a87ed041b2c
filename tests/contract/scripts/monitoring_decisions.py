"""What an owner says: a harmless event, records taken back, a saved monitor that goes on."""

import tempfile

import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.monitoring import Monitor, load_monitor

year, later = make_truss_campaign(random_state=0), make_truss_campaign(damage={"bottom": 0.3}, random_state=1)
monitor = Monitor(targets=list(year.frequencies)).fit(year.temperatures.join(year.frequencies))
new = later.temperatures.join(later.frequencies)[:20]
new = new.set_index(new.index + pd.DateOffset(years=1))
monitor.update(new)
monitor.acknowledge(1, harmless=True, note="heavy transport")
with tempfile.TemporaryDirectory() as folder:
    monitor.save(f"{folder}/truss.joblib")
    again = load_monitor(f"{folder}/truss.joblib")
again.discard("2026-01-11")
RESULTS = {
    "event": [str(monitor.events_.loc[1, name]) for name in ("kind", "acknowledged", "harmless", "note")],
    "same": bool(again.threshold_ == monitor.threshold_),
    "left": [str(again.last_), len(again.evaluations_)],
    "transitions": len(list(monitor.transitions())) > 0,
    "status": sorted({"state", "reason", "now", "events", "faults"} & {*monitor.status(monitor.last_).as_dict()}),
}
