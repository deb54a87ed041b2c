"""Monitoring of a bridge that freezes by a known law, as a file for whoever has no data of Z24.

python -m tests.examples.frozen_bridge z24.csv
"""

import sys

import numpy as np
import pandas as pd

from skthermo.datasets import make_z24
from skthermo.fem import add_noise

SENSORS = ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"]
SEVERITY = 0.25


def frozen_bridge(n_healthy=300, n_damaged=80):
    """Records of a bridge whose stiffness rises below 0 °C, and whose piers and soil are damaged in the end."""
    random = np.random.default_rng(0)
    n = n_healthy + n_damaged
    air = 8 + 12 * np.sin(np.arange(n) / 15) + random.normal(0, 2, n)
    sensors = air[:, np.newaxis] + random.normal(0, 0.5, (n, 7))
    frost = np.clip(-sensors[:, 0], 0, None)[:, np.newaxis]
    theta = 1 + frost * [0.01, 0.02, 0.01, 0.03] - 0.001 * sensors[:, [0]]
    damaged = np.arange(n) >= n_healthy
    F = make_z24().frequencies(theta)
    F[damaged] = make_z24().damaged({"piers_soil": SEVERITY}).frequencies(theta[damaged])
    table = pd.DataFrame(
        np.hstack([add_noise(F, 0.003, random_state=0), sensors]), columns=["f1", "f2", "f3", "f4", *SENSORS]
    )
    table.insert(0, "record", np.arange(n))
    return table.assign(state=np.where(damaged, "damaged", "undamaged"))


if __name__ == "__main__":
    frozen_bridge().to_csv(sys.argv[1], index=False)
