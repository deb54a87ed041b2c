"""Batches, late and repeated records: events and evaluations are those of one pass."""

import copy

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor

years = make_truss_campaign(2, damage={"bottom": 0.4}, damage_from="2026-09-01", random_state=0)
records = years.frequencies
monitor = Monitor(MahalanobisDetector(), targets=list(records), random_state=0).fit(records[:"2025"])
once, by_parts = copy.deepcopy(monitor), copy.deepcopy(monitor)
once.update(records["2026":])
for start in range(365, 730, 73):
    part = records[start : start + 73]
    by_parts.update(part.drop(part.index[70]))
    by_parts.update(part[68:72])  # one late, three repeated
indices = [one.evaluations_["index"].to_numpy(float) for one in (once, by_parts)]
RESULTS = {
    "events": bool(once.events_["start"].equals(by_parts.events_["start"])),
    "indices": bool(np.allclose(*indices, equal_nan=True)),
    "counts": {name: by_parts.counts_[name] for name in ("n_records", "n_repeated", "n_late")},
    "found": bool((once.events_["start"] >= pd.Timestamp("2026-09-01")).any()),
}
