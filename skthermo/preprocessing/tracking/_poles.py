"""Reads the poles of many records, given as padded arrays or as ragged lists, into flat arrays."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import as_floats, real_array, shape_array
from skthermo._tables.frames import check_same_rows

FIELDS = ("frequencies", "damping", "shapes")


class Poles(NamedTuple):
    """The poles of all records, one after another; a pole's ``column`` is its position in its record."""

    record: NDArray[np.intp]
    column: NDArray[np.intp]
    frequencies: NDArray[np.float64]
    damping: NDArray[np.float64] | None
    shapes: NDArray | None
    index: pd.Index


def read_poles(X: Any, sensors: list | None, n_sensors: int | None) -> Poles:
    """The poles of records as `ModeTracker.transform` takes them; without ``n_sensors`` shapes are not read."""
    fields, given_sensors = _fields(X)
    if n_sensors is not None and fields["shapes"] is None:
        raise ValueError("X has no 'shapes'; expected mode shapes, as in the reference, or a reference without shapes")
    if n_sensors is None:
        fields["shapes"] = None
    poles = (_from_arrays if is_table(fields["frequencies"]) else _from_lists)(**fields)
    wrong = ~(np.isfinite(poles.frequencies) & (poles.frequencies > 0))
    if wrong.any():
        pole = np.flatnonzero(wrong)[0]
        raise ValueError(
            f"frequency {poles.column[pole]} of record {poles.record[pole]} is {poles.frequencies[pole]:g}; expected "
            "positive values in Hz, and NaN where there is no pole"
        )
    if poles.shapes is None:
        return poles
    shapes = _chosen_sensors(poles.shapes, given_sensors, sensors)
    if not len(shapes):
        shapes = np.empty((0, n_sensors or 0), dtype=shapes.dtype)
    if shapes.shape[1] != n_sensors:
        raise ValueError(f"shapes of X have {shapes.shape[1]} sensors; expected {n_sensors}, as in the reference")
    if np.isinf(shapes).any():
        raise ValueError("shapes of X have infinite components; expected NaN where a component is missing")
    return poles._replace(shapes=shapes)


def is_table(values: Any) -> bool:
    """Whether values are a frame or a two-dimensional array, not a list of arrays."""
    return isinstance(values, pd.DataFrame) or (
        isinstance(values, np.ndarray) and values.dtype != object and values.ndim == 2
    )


def _fields(X: Any) -> tuple[dict[str, Any], Any]:
    """Frequencies, damping ratios, shapes and index of all records, and the names of their sensors."""
    sensors = None
    if isinstance(X, Mapping):
        fields, sensors = {name: X.get(name) for name in FIELDS}, X.get("sensors")
        if fields["frequencies"] is None:
            raise ValueError(f"X has the fields {list(X)}; expected 'frequencies', and mostly 'shapes' and 'damping'")
    elif is_table(X):
        fields = {"frequencies": X, "damping": None, "shapes": None}
    elif isinstance(X, Sequence | pd.Series) and len(X) and all(isinstance(record, Mapping) for record in X):
        fields = {}
        for name in FIELDS:
            has = [record.get(name) is not None for record in X]
            if any(has) and not all(has):
                raise ValueError(f"record {has.index(False)} has no {name!r}, others have; expected all or none")
            fields[name] = [record[name] for record in X] if any(has) else None
        if fields["frequencies"] is None:
            raise ValueError(f"record 0 has the fields {list(next(iter(X)))}; expected 'frequencies'")
        names = {None if record.get("sensors") is None else tuple(record["sensors"]) for record in X}
        if len(names) > 1:
            raise ValueError(f"records name different sensors, such as {list(names)[:2]}; expected the same in all")
        sensors = names.pop()
    else:
        raise ValueError(
            f"X is of type {type(X).__name__}; expected a mapping with 'frequencies', 'shapes' and 'damping' of all "
            "records, or a sequence of such mappings, one for each record"
        )
    index = X.get("index") if isinstance(X, Mapping) else None
    frequencies = X if isinstance(X, pd.Series) else fields["frequencies"]
    if isinstance(frequencies, pd.DataFrame | pd.Series):
        index = frequencies.index
    if not isinstance(frequencies, Sequence | np.ndarray | pd.DataFrame | pd.Series):
        raise ValueError(f"frequencies are {frequencies!r:.200}; expected a table, or a vector for each record")
    fields["index"] = pd.RangeIndex(len(frequencies)) if index is None else pd.Index(index)
    if len(fields["index"]) != len(frequencies):
        raise ValueError(f"the index has {len(fields['index'])} entries; expected {len(frequencies)}, one a record")
    return fields, sensors


def _from_arrays(frequencies: Any, damping: Any, shapes: Any, index: pd.Index) -> Poles:
    F = as_floats(frequencies)
    record, column = np.nonzero(~np.isnan(F))
    if damping is not None:
        check_same_rows(frequencies, damping, ("frequencies", "damping"))
        damping = as_floats(damping)
        if damping.shape != F.shape:
            raise ValueError(f"damping has shape {damping.shape}; expected {F.shape}, as frequencies")
        damping = damping[record, column]
    if shapes is not None:
        shapes = shape_array(shapes, "shapes of X", any_size=True)
        if shapes.ndim != 3 or shapes.shape[:2] != F.shape:
            raise ValueError(f"shapes have shape {shapes.shape}; expected {F.shape + ('n_sensors',)}")
        shapes = shapes[record, column]
    return Poles(record, column, F[record, column], damping, shapes, index)


def _from_lists(frequencies: Any, damping: Any, shapes: Any, index: pd.Index) -> Poles:
    rows = [real_array(row, f"frequencies of record {i}") for i, row in enumerate(frequencies)]
    for i, row in enumerate(rows):
        if row.ndim != 1:
            raise ValueError(f"frequencies of record {i} have shape {row.shape}; expected a vector for each record")
    lengths = np.array([len(row) for row in rows], dtype=int)
    record = np.repeat(np.arange(len(rows)), lengths)
    column = np.arange(len(record)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    F = np.concatenate([np.empty(0), *rows])
    is_pole = ~np.isnan(F)
    if damping is not None:
        damping = np.concatenate([np.empty(0), *_each(damping, lengths, "damping", 1)])[is_pole]
    if shapes is not None:
        parts = _each(shapes, lengths, "shapes", 2)
        widths = {part.shape[1] for part in parts if part.shape[0]}
        if len(widths) > 1:
            raise ValueError(f"shapes of X have {sorted(widths)} sensors in different records; expected one number")
        parts = [part for part in parts if part.shape[0]]
        shapes = np.concatenate(parts)[is_pole] if parts else np.empty((0, 0))
    return Poles(record[is_pole], column[is_pole], F[is_pole], damping, shapes, index)


def _each(values: Any, lengths: NDArray, what: str, ndim: int) -> list[NDArray]:
    """One array for each record, of as many entries as the record has frequencies."""
    if len(values) != len(lengths):
        raise ValueError(f"{what} has {len(values)} records and frequencies {len(lengths)}; expected the same number")
    rows = [as_floats(row) if what == "damping" else shape_array(row, f"{what} of X", any_size=True) for row in values]
    for i, (row, length) in enumerate(zip(rows, lengths, strict=True)):
        if length == 0 and row.size == 0:
            rows[i] = np.empty((0,) * ndim)
        elif row.ndim != ndim or len(row) != length:
            expected = (int(length),) if ndim == 1 else (int(length), "n_sensors")
            raise ValueError(f"{what} of record {i} have shape {row.shape}; expected {expected}")
    return rows


def _chosen_sensors(shapes: NDArray, given: Any, wanted: list | None) -> NDArray:
    """Shapes at the reference's sensors, by name where both have names."""
    if not shapes.shape[0] or given is None or wanted is None:
        return shapes
    given = list(given)
    if len(given) != shapes.shape[1]:
        raise ValueError(f"X names {len(given)} sensors; expected {shapes.shape[1]}, as its shapes have")
    unknown = [name for name in wanted if name not in given]
    if unknown:
        raise ValueError(f"X has no sensors {unknown} of the reference; expected them among {given}")
    return shapes[:, [given.index(name) for name in wanted]]
