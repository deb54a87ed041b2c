"""Records in time: when each was taken, and how long they depend on those before."""

from datetime import timedelta
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from scipy.fft import irfft, next_fast_len, rfft

from skthermo._tables.arrays import Array
from skthermo._validation import _num_samples

YEAR, DAY = pd.Timedelta(days=365.25), pd.Timedelta(days=1)
DAY_NS = DAY.value  # nanoseconds


def row_times(T: Any) -> Array:
    """Time of every row since the first one in nanoseconds, or its number where T has no ``DatetimeIndex``."""
    if not has_stamps(T):
        return np.arange(_num_samples(T), dtype=float)
    stamps = T.index.as_unit("ns").asi8
    return (stamps - stamps[:1]).astype(float)


def time_of(T: Any, moment: Any, what: str) -> float:
    """A position counted from 0, or a time, on the scale of `row_times`; infinite for a position after the last."""
    times, is_timed = row_times(T), has_stamps(T)
    if isinstance(moment, int | np.integer) and not isinstance(moment, bool) and moment >= 0:
        if not is_timed:
            return float(moment)
        return float(times[moment]) if moment < len(times) else np.inf
    try:
        if is_timed and not isinstance(moment, Real | timedelta) and not pd.isna(moment):
            return float((pd.Timestamp(moment).as_unit("ns") - T.index[0].as_unit("ns")).value)
    except (TypeError, ValueError):
        pass
    zone = f" in the time zone {T.index.tz}" if is_timed and T.index.tz is not None else ""
    expected = f"a position from 0, or a time{zone}" if is_timed else "a position from 0"
    raise ValueError(f"{what} is {moment!r} for {len(times)} records; expected {expected}")


def has_stamps(T: Any) -> bool:
    """Whether rows have times: a frame on a ``DatetimeIndex``."""
    return isinstance(getattr(T, "index", None), pd.DatetimeIndex)


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


def correlation_times(columns: Array) -> Array:
    """The `correlation_time` of each column, (n_columns,)."""
    return np.array([correlation_time(column) for column in columns.T])


def independent_records(columns: Array) -> Array:
    """As many independent records as tell the mean of each column equally well, (n_columns,)."""
    return (~np.isnan(columns)).sum(axis=0) / correlation_times(columns)


def _products(values: Array) -> Array:
    """Sums of the products of values 1, 2, ... places apart, up to half of their number."""
    size = next_fast_len(2 * len(values), real=True)
    return irfft(np.abs(rfft(values, size)) ** 2, size)[1 : max(len(values) // 2, 1)]
