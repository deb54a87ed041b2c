"""Stamps and durations as users give them."""

import re
from typing import Any

import numpy as np
import pandas as pd

from skthermo._tables.arrays import is_real

LONE_CAPITALS = {"D", "W", "H", "T", "S", "L", "U", "N"}  # days, weeks, hours ... nanoseconds
ZERO = np.timedelta64(0, "ns")
DATE_AS_TEXT = re.compile(r"\s*\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}")


def as_stamps(index: pd.Index) -> pd.DatetimeIndex | None:
    """An index of stamps as a DatetimeIndex, periods by their start; None for an index of something else."""
    if isinstance(index, pd.DatetimeIndex):
        return index
    if isinstance(index, pd.PeriodIndex):
        return index.to_timestamp()
    if isinstance(index, pd.MultiIndex):
        if any(as_stamps(level) is not None for level in index.levels):
            raise ValueError(f"X has stamps on one of the index levels {list(index.names)}; expected a DatetimeIndex")
        return None
    kind = index.inferred_type
    if kind.startswith("timedelta"):
        raise ValueError(
            f"X has an index of durations, the first {index[0]}; expected a DatetimeIndex: add the time of the start"
        )
    if kind == "string" and DATE_AS_TEXT.match(str(index[0])):
        raise ValueError(
            f"X has stamps as text, the first {index[0]!r}; expected a DatetimeIndex, as pandas.to_datetime gives"
        )
    if kind not in ("datetime", "datetime64", "date"):
        return None
    try:
        return pd.DatetimeIndex(index)
    except (ValueError, TypeError) as error:
        raise ValueError(
            f"the index of X holds stamps with several offsets from UTC ({error}); expected a DatetimeIndex: convert "
            "them by pandas.to_datetime(..., utc=True)"
        ) from error


def as_duration(value: Any, name: str) -> np.timedelta64:
    """A positive duration of fixed length; that called "tolerance" may be zero."""
    units = re.findall("[A-Za-z]+", value) if isinstance(value, str) else None
    if any(unit.isupper() and unit not in LONE_CAPITALS for unit in units or ()):
        raise ValueError(
            f"{name} is {value!r}; expected a duration of fixed length with its unit, such as '10min', '1h' or '30D'"
        )
    try:
        if is_real(value) or isinstance(value, bool):  # nanoseconds for pandas
            raise TypeError
        numbered = f"1{value}" if isinstance(value, str) and value[:1].isalpha() else value
        duration = pd.Timedelta(numbered).as_unit("ns").to_timedelta64()
    except (ValueError, TypeError, AttributeError) as error:
        raise ValueError(f"{name} is {value!r}; expected a duration of fixed length, such as '1h'") from error
    if units == [] or not duration >= ZERO or (name != "tolerance" and duration == ZERO):
        raise ValueError(f"{name} is {value!r}; expected a positive duration with its unit, such as '1h'")
    return duration
