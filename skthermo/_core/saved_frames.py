"""State of objects that hold pandas' frames and times, as arrays, lists and numbers, which skops can save."""

import json
import operator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray


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
    """Labels of an index: a range, times as integers, or a list."""

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
    """Values and labels of a frame, or of a series where there are no columns; texts are one text in JSON."""

    values: NDArray | list | str | SavedLabels
    index: SavedLabels
    columns: SavedLabels | None
    name: Any = None
    dtype: str | None = None


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
    is_frame = isinstance(value, pd.DataFrame)
    axes = [_to_labels(axis) for axis in value.axes]
    dtypes = set(value.dtypes) if is_frame else {value.dtype}
    if None in axes:
        return value
    if len(dtypes) != 1 or dtypes.pop() not in (np.dtype(float), np.dtype("int64"), np.dtype(bool)):
        return _of_columns(value, axes) if is_frame else _of_objects(value, axes)
    return SavedTable(value.to_numpy(), axes[0], axes[1] if is_frame else None, None if is_frame else value.name)


def from_saved(value: Any) -> Any:
    """The frame or series of a table, or the time of a number, also within a tuple; anything else unchanged."""
    if isinstance(value, tuple) and type(value) is tuple:
        return tuple(from_saved(part) for part in value)
    if isinstance(value, SavedTime):
        return _from_time(value)
    if not isinstance(value, SavedTable):
        return value
    index = _from_labels(value.index)
    if isinstance(value.values, SavedLabels):
        return pd.Series(_from_labels(value.values), index, name=value.name)
    if isinstance(value.values, str):
        return pd.Series(json.loads(value.values), index, name=value.name, dtype=value.dtype)
    if value.columns is None:
        return pd.Series(value.values, index, name=value.name, dtype=value.dtype)
    if isinstance(value.values, list):
        columns = dict(enumerate(map(from_saved, value.values)))
        table = pd.DataFrame(columns, pd.RangeIndex(len(index)))
        return table.set_axis(index, axis=0).set_axis(_from_labels(value.columns), axis=1)
    return pd.DataFrame(value.values, index, _from_labels(value.columns))


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


def _of_columns(frame: pd.DataFrame, axes: list[Any]) -> Any:
    """A frame with columns of several types as a table of tables, or unchanged."""
    numbered = frame.set_axis(pd.RangeIndex(len(frame)), axis=0)  # the index is saved once
    columns = [to_saved(numbered.iloc[:, place]) for place in range(frame.shape[1])]
    return SavedTable(columns, *axes) if all(isinstance(column, SavedTable) for column in columns) else frame


def _of_objects(series: pd.Series, axes: list[Any]) -> Any:
    """A series of texts and numbers as a table of a list, one of times as a table of labels, or unchanged."""
    if series.dtype.kind == "M":
        times = _to_labels(pd.DatetimeIndex(series))
        return series if times is None else SavedTable(times, axes[0], None, series.name)
    values = series.tolist()
    texts = series.dtype == object or str(series.dtype) == "str"
    plain = texts and all(isinstance(value, str | int | float | None) for value in values)
    return SavedTable(json.dumps(values), axes[0], None, series.name, str(series.dtype)) if plain else series


def _to_labels(index: pd.Index) -> SavedLabels | None:
    """None for an index that these labels would not give again."""
    if isinstance(index, pd.RangeIndex):
        saved = SavedLabels("range", [index.start, index.stop, index.step], "int64", index.name)
    elif isinstance(index, pd.DatetimeIndex):
        zone = None if index.tz is None else str(index.tz)
        saved = SavedLabels("times", index.asi8, f"M8[{index.unit}]", index.name, zone, index.freqstr)
    elif type(index) is pd.Index:
        saved = SavedLabels("list", index.tolist(), str(index.dtype), index.name)
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
    if saved.kind == "list":
        return pd.Index(saved.labels, dtype=saved.dtype, name=saved.name, tupleize_cols=False)
    times = pd.DatetimeIndex(saved.labels.view(saved.dtype), name=saved.name)
    if saved.zone is not None:
        times = times.tz_localize("UTC").tz_convert(saved.zone)
    times.freq = saved.frequency
    return times
