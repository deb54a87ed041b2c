"""When a record was taken: its time on a DatetimeIndex, else its number."""

from datetime import timedelta
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from skthermo._arrays import Array
from skthermo._validation import _num_samples


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
