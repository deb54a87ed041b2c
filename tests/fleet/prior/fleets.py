"""Small fleets of known laws."""

import numpy as np
import pandas as pd

LAW = np.array([[-2.0, -0.5, 1.0], [-1.0, -1.5, 0.0]]) * 1e-3  # of T1, T2 and frost, for two modes


def slopes(seed, spread=0.1):
    """Coefficients of one bridge of the fleet."""
    random = np.random.default_rng(seed)
    return LAW * (1 + spread * random.standard_normal(LAW.shape)), random.uniform(2, 6, 2)


def records(seed, days=365, start=0, *, law=None, noise=0.002, year=0):
    """Temperatures, noisy and clean frequencies of a bridge."""
    coefficients, level = slopes(seed)
    coefficients = coefficients if law is None else law
    random = np.random.default_rng([seed, start, year])
    t = start + np.arange(days)
    T = 10 - 12 * np.cos(2 * np.pi * t / 365)[:, np.newaxis] + random.normal(0, 3, (days, 2))
    inputs = np.column_stack([T, np.maximum(-T[:, 0], 0)])
    clean = level * np.exp(inputs @ coefficients.T)
    names, modes = ["T1", "T2"], ["f1", "f2"]
    noisy = clean * np.exp(noise * random.standard_normal(clean.shape))
    index = pd.date_range("2025-01-01", periods=days) + pd.Timedelta(days=start)
    return pd.DataFrame(T, index, names), pd.DataFrame(noisy, index, modes), pd.DataFrame(clean, index, modes)
