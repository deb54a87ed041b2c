"""Batches, late and repeated records: events and evaluations are those of one pass."""

import copy

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor

years = make_truss_campaign(2, samples_per_year=180, damage={"top": 0.2}, damage_from="2025-10-01", random_state=0)
records = years.frequencies
monitor = Monitor(MahalanobisDetector(), targets=list(records), random_state=0).fit(records[:180])
once, by_parts = copy.deepcopy(monitor), copy.deepcopy(monitor)
once.update(records[180:])
for start in range(180, 360, 45):
    part = records[start : start + 45]
    by_parts.update(part.drop(part.index[40]))
    by_parts.update(part[38:42])  # one late, three repeated
indices = [one.evaluations_["index"].to_numpy(float) for one in (once, by_parts)]
RESULTS = {
    "events": bool(once.events_["start"].equals(by_parts.events_["start"])),
    "indices": bool(np.allclose(*indices, equal_nan=True)),
    "counts": {name: by_parts.counts_[name] for name in ("n_records", "n_repeated", "n_late")},
    "found": bool((once.events_["start"] >= pd.Timestamp("2025-10-01")).any()),
}
