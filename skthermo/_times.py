"""When a record was taken: its time on a DatetimeIndex, else its number."""

from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from skthermo._arrays import Array
from skthermo._validation import _num_samples


def row_times(T: Any) -> Array:
    """Time of every row since the first one in nanoseconds, or its number where T has no ``DatetimeIndex``."""
    if not _has_stamps(T):
        return np.arange(_num_samples(T), dtype=float)
    stamps = T.index.as_unit("ns").asi8
    return (stamps - stamps[:1]).astype(float)


def time_of(T: Any, moment: Any, what: str) -> float:
    """A number of a record, or a time, on the scale of `row_times`.

    Raises
    ------
    ValueError
        If it is neither.
    """
    if isinstance(moment, Real) and not isinstance(moment, bool) and np.isfinite(float(moment)):
        times = row_times(T)
        return float(np.interp(float(moment), np.arange(len(times)), times)) if moment < len(times) else np.inf
    try:
        if _has_stamps(T):
            return float((pd.Timestamp(moment).as_unit("ns") - T.index[0].as_unit("ns")).value)
    except (TypeError, ValueError):
        pass
    zone = f" in the time zone {T.index.tz}" if _has_stamps(T) and T.index.tz is not None else ""
    expected = f"the number of a record, or a time{zone}" if _has_stamps(T) else "the number of a record"
    raise ValueError(f"{what} is {moment!r}; expected {expected}")


def _has_stamps(T: Any) -> bool:
    return isinstance(getattr(T, "index", None), pd.DatetimeIndex)
