"""The Mahalanobis distance of raw frequencies finds a loss of 30 %, and false alarms are near 2 %."""

import numpy as np
from scipy.spatial.distance import mahalanobis

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector

healthy, other = (make_truss_campaign(random_state=seed).frequencies for seed in (0, 1))
damaged = make_truss_campaign(damage={"bottom": 0.3}, random_state=1).frequencies
detectors = {name: MahalanobisDetector(threshold=name).fit(healthy) for name in ("conformal", "quantile", "chi2")}
index = detectors["quantile"].damage_index(other)
inverse = np.linalg.inv(np.cov(healthy.to_numpy(), rowvar=False))
distances = [mahalanobis(row, healthy.mean(), inverse) for row in other.to_numpy()]
RESULTS = {
    "false alarms": {name: float((one.predict(other) == -1).mean()) for name, one in detectors.items()},
    "found": {name: float((one.predict(damaged) == -1).mean()) for name, one in detectors.items()},
    "unsquared": float(np.median(index / distances)),
    "index": [type(index).__name__, len(index)],
    "signs": bool(((detectors["chi2"].decision_function(other) < 0) == (detectors["chi2"].predict(other) == -1)).all()),
}
TOLERANCES = {"false alarms": {"atol": 0.03}, "found": {"atol": 0.03}, "unsquared": {"atol": 0.02}}
