"""Serial dependence of records: correlation times and what they leave of a number of records."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from skthermo._arrays import Array


def correlation_time(series: Array) -> float:
    """1 + 2 * the sum of the autocorrelations up to the first that is not clearly above zero.

    That is the first within two standard errors of zero; lags reach half of the series, NaN is left out.
    """
    known = ~np.isnan(series)
    if not known.any() or np.ptp(series[known]) == 0:
        return 1.0
    centred = np.where(known, series - series[known].mean(), 0.0)
    variance = (centred**2).sum() / known.sum()
    pairs = np.maximum(np.rint(_products(known.astype(float))), 1)
    correlations = _products(centred) / pairs / variance
    n_clear = int(np.argmin(np.append(correlations > 2 / np.sqrt(pairs), False)))
    return float(1 + 2 * correlations[:n_clear].sum())


def independent_records(columns: Array) -> Array:
    """As many independent records as tell the mean of each column equally well, (n_columns,)."""
    n_known = (~np.isnan(columns)).sum(axis=0)
    return n_known / np.array([correlation_time(column) for column in columns.T])


def _products(values: Array) -> Array:
    """Sums of the products of values 1, 2, ... places apart, up to half of their number."""
    size = next_fast_len(2 * len(values), real=True)
    return irfft(np.abs(rfft(values, size)) ** 2, size)[1 : max(len(values) // 2, 1)]
