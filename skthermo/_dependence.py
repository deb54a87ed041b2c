"""Serial dependence of records: correlation times and what they leave of a number of records."""

import numpy as np

from skthermo._arrays import Array


def correlation_time(series: Array) -> float:
    """1 + 2 * the sum of the autocorrelations up to the first that is not clearly above zero."""
    known = ~np.isnan(series)
    centred = np.where(known, series - series[known].mean(), 0.0) if known.any() else np.zeros(len(series))
    variance, time = (centred**2).sum() / max(known.sum(), 1), 1.0
    for lag in range(1, len(series) // 10 if variance > 0 else 1):
        pairs = max(np.count_nonzero(known[lag:] & known[:-lag]), 1)
        correlation = (centred[lag:] @ centred[:-lag]) / pairs / variance
        if correlation <= 2 / np.sqrt(pairs):
            break
        time += 2 * correlation
    return time


def independent_records(columns: Array) -> Array:
    """As many independent records as tell the mean of each column equally well, (n_columns,)."""
    n_known = (~np.isnan(columns)).sum(axis=0)
    return n_known / np.array([correlation_time(column) for column in columns.T])
