"""A slow trend of residuals is found, and noise is none."""

import numpy as np

from skthermo.preprocessing import residual_trend

noise = np.random.default_rng(0).normal(0, 0.01, (1000, 1))
found = residual_trend(noise + np.linspace(0, 0.02, 1000)[:, np.newaxis])
none = residual_trend(noise)
RESULTS = {
    "change": found["change"],
    "clear": bool((found["change"] > 4 * found["standard_error"]).all()),
    "noise": bool((none["change"].abs() < 4 * none["standard_error"]).all()),
}
TOLERANCES = {"change": {"atol": 0.003}}
