"""Series with a memory, and residuals of a baseline."""

import numpy as np
from scipy.signal import lfilter

from skthermo.residuals.baseline import BaselineResiduals


def autoregressive(n_rows, correlation, seed=0, n_columns=1):
    """Of first order, with a standard deviation of 1."""
    noise = np.random.default_rng(seed).normal(size=(n_rows + 500, n_columns))
    return lfilter([np.sqrt(1 - correlation**2)], [1.0, -correlation], noise, axis=0)[500:]


def residuals(weather, values, n_folds=5):
    """Of a mapper that has learned nothing, by weather."""
    folds = np.arange(len(values)) * n_folds // len(values)
    values = np.reshape(values, (len(values), -1))
    return BaselineResiduals(np.reshape(weather, (len(values), -1)), values, values, folds)
