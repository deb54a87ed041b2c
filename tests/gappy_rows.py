"""Normally distributed rows of three modes, and gaps in them."""

import numpy as np

MEAN = np.array([4.0, 9.0, 12.0])
COVARIANCE = 0.01 * np.array([[1.0, 0.6, 0.2], [0.6, 2.0, 0.3], [0.2, 0.3, 0.5]])


def records(n_rows, seed=0):
    return np.random.default_rng(seed).multivariate_normal(MEAN, COVARIANCE, n_rows)


def with_gaps(rows, share=0.3, seed=0):
    """Rows without a share of their entries; each row keeps at least one."""
    gaps = np.random.default_rng(seed).random(rows.shape) < share
    gaps[np.arange(len(rows)), np.arange(len(rows)) % rows.shape[1]] = False
    return np.where(gaps, np.nan, rows)
