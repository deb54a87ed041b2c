"""Directions from a table, and a share of the false alarms for all others."""

import numpy as np
import pandas as pd

from skthermo.detection import DirectionalDetector

random = np.random.default_rng(0)
names = ["f1", "f2", "f3"]
baseline, later = (pd.DataFrame([4, 5, 7] * random.normal(1, 0.01, (400, 3)), columns=names) for _ in range(2))
directions = pd.DataFrame([[-0.5, -0.1, 0.0], [0.0, -0.4, -0.2]], ["deck", "pier"], names)
detectors = {share: DirectionalDetector(directions, omnibus=share).fit(baseline) for share in (0.0, 0.2, 1.0)}
fallen, risen = (later * (1 + 0.06 * sign * directions.loc["deck"]) for sign in (1, -1))
RESULTS = {
    "false alarms": {str(share): float((one.predict(later) == -1).mean()) for share, one in detectors.items()},
    "fallen": {str(share): float((one.predict(fallen) == -1).mean()) for share, one in detectors.items()},
    "risen": {str(share): float((one.predict(risen) == -1).mean()) for share, one in detectors.items()},
    "severities": detectors[0.2].severities(fallen).mean(),
    "smallest": detectors[0.2].minimum_detectable_damage(),
}
TOLERANCES = {"*": {"atol": 0.05}, "severities": {"rtol": 0.05}, "smallest": {"rtol": 0.08}}
