"""State of objects that hold pandas' frames and times, as arrays, lists and numbers, which skops can save."""

import json
import operator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

SAVED_AS_ARRAYS = (np.dtype(float), np.dtype("int64"), np.dtype(bool))


class SavesFrames:
    """Objects whose files hold tables in place of frames; reading a file makes them frames again."""

    def __getstate__(self) -> dict[str, Any]:
        return {name: to_saved(value) for name, value in super().__getstate__().items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        restored = {name: from_saved(value) for name, value in state.items()}
        if hasattr(super(), "__setstate__"):
            super().__setstate__(restored)
        else:
            vars(self).update(restored)


@dataclass
class SavedLabels:
    """Labels of an index: a range, times as integers, an array of numbers, a text in JSON, or a list."""

    kind: str
    labels: Any
    dtype: str
    name: Any
    zone: str | None = None
    frequency: str | None = None


@dataclass
class SavedTime:
    """A time or a length of time of pandas as an integer of a unit."""

    kind: str
    count: int
    unit: str
    zone: str | None = None


@dataclass
class SavedTable:
    """Values and labels of a frame, or of a series where there are no columns; columns of several types are labels."""

    values: NDArray | list[SavedLabels]
    index: SavedLabels
    columns: SavedLabels | None
    name: Any = None


def to_saved(value: Any) -> Any:
    """A frame or series as a table, also within a tuple, if the table gives exactly the frame again; else unchanged.

    A time, or a length of time, becomes a number.
    """
    if isinstance(value, tuple) and type(value) is tuple:
        parts = tuple(to_saved(part) for part in value)
        return value if all(map(operator.is_, parts, value)) else parts  # what is shared is saved once
    if isinstance(value, pd.Timestamp | pd.Timedelta):
        return _to_time(value)
    if not isinstance(value, pd.DataFrame | pd.Series) or value.attrs:
        return value
    frame = value if isinstance(value, pd.DataFrame) else value.to_frame(0)
    index, columns = map(_to_labels, frame.axes)
    are_alike = len(dtypes := set(frame.dtypes)) == 1 and dtypes.issubset(SAVED_AS_ARRAYS)
    values = frame.to_numpy() if are_alike else [_to_labels(pd.Index(column)) for _, column in frame.items()]
    if index is None or columns is None or (isinstance(values, list) and None in values):
        return value
    return SavedTable(values, index, columns) if frame is value else SavedTable(values, index, None, value.name)


def from_saved(value: Any) -> Any:
    """The frame or series of a table, or the time of a number, also within a tuple; anything else unchanged."""
    if isinstance(value, tuple) and type(value) is tuple:
        return tuple(from_saved(part) for part in value)
    if isinstance(value, SavedTime):
        return _from_time(value)
    if not isinstance(value, SavedTable):
        return value
    index, values = _from_labels(value.index), value.values
    if isinstance(values, list):
        values = {place: pd.Series(one, dtype=one.dtype) for place, one in enumerate(map(_from_labels, values))}
    table = pd.DataFrame(values, pd.RangeIndex(len(index))).set_axis(index, axis=0)
    return table[0].rename(value.name) if value.columns is None else table.set_axis(_from_labels(value.columns), axis=1)


def _to_time(value: Any) -> Any:
    """A time as a number, or unchanged if the number would not give it again."""
    zone = str(value.tz) if isinstance(value, pd.Timestamp) and value.tz is not None else None
    saved = SavedTime(type(value).__name__, int(value.asm8.astype("int64")), value.unit, zone)
    try:
        same = _from_time(saved)
    except (TypeError, ValueError, LookupError):
        return value
    return saved if type(value) is type(same) and same == value and str(same) == str(value) else value


def _from_time(saved: SavedTime) -> Any:
    if saved.kind == "Timedelta":
        return pd.Timedelta(np.timedelta64(saved.count, saved.unit))
    time = pd.Timestamp(np.datetime64(saved.count, saved.unit))
    return time if saved.zone is None else time.tz_localize("UTC").tz_convert(saved.zone)


def _to_labels(index: pd.Index) -> SavedLabels | None:
    """None for an index that these labels would not give again."""
    if isinstance(index, pd.RangeIndex):
        saved = SavedLabels("range", [index.start, index.stop, index.step], "int64", index.name)
    elif isinstance(index, pd.DatetimeIndex):
        zone = None if index.tz is None else str(index.tz)
        saved = SavedLabels("times", index.asi8, f"M8[{index.unit}]", index.name, zone, index.freqstr)
    elif type(index) is pd.Index and index.dtype in SAVED_AS_ARRAYS:
        saved = SavedLabels("array", index.to_numpy(), str(index.dtype), index.name)
    elif type(index) is pd.Index:
        is_plain = all(isinstance(label, str | int | float | None) for label in index)
        labels = json.dumps(index.tolist()) if is_plain else index.tolist()
        saved = SavedLabels("text" if is_plain else "list", labels, str(index.dtype), index.name)
    else:
        return None
    try:
        same = _from_labels(saved)
    except (TypeError, ValueError, LookupError):
        return None
    return saved if same.identical(index) and getattr(same, "freq", 0) == getattr(index, "freq", 0) else None


def _from_labels(saved: SavedLabels) -> pd.Index:
    if saved.kind == "range":
        return pd.RangeIndex(*saved.labels, name=saved.name)
    if saved.kind != "times":
        labels = json.loads(saved.labels) if saved.kind == "text" else saved.labels
        return pd.Index(labels, dtype=saved.dtype, name=saved.name, tupleize_cols=False)
    times = pd.DatetimeIndex(saved.labels.view(saved.dtype), name=saved.name)
    if saved.zone is not None:
        times = times.tz_localize("UTC").tz_convert(saved.zone)
    times.freq = saved.frequency
    return times
