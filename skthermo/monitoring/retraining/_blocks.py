"""Means of dependent records by blocks of time, with their standard errors."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array

WEEK = pd.Timedelta("7D")


def blocks_of(times: pd.DatetimeIndex, length: pd.Timedelta = WEEK) -> NDArray[np.intp]:
    """Number of the block of each record, counted without gaps."""
    numbers = (times - times[0]) // length
    return np.unique(numbers, return_inverse=True)[1]


def block_mean(values: Array, blocks: NDArray[np.intp]) -> tuple[float, float]:
    """Mean of the values that are there, and its standard error from the blocks' sums; NaN for fewer than three."""
    known = ~np.isnan(values)
    if not known.any():
        return np.nan, np.nan
    mean = float(values[known].mean())
    used, of_value = np.unique(blocks[known], return_inverse=True)
    n_blocks = len(used)
    if n_blocks < 3:
        return mean, np.nan
    sums = np.bincount(of_value, values[known] - mean)
    return mean, float(np.sqrt((sums**2).sum() * n_blocks / (n_blocks - 1)) / known.sum())
