"""What counts as a number: not times, text, booleans, bytes or categories, which NumPy and pandas would convert."""

from collections.abc import Iterator
from datetime import date, time, timedelta
from numbers import Real
from typing import Any

import numpy as np

NO_NUMBERS = {
    "booleans": (bool, np.bool_),
    "text": (str,),
    "bytes": (bytes, bytearray, memoryview),
    "times": (date, time, timedelta, np.datetime64, np.timedelta64),
    "complex numbers": (complex, np.complexfloating),
}
KINDS = {"b": "booleans", "U": "text", "T": "text", "S": "bytes", "M": "times", "m": "times", "V": "records"}
HUGE = 1e150  # squares of larger numbers are infinite


def is_real(value: Any) -> bool:
    """Whether a value is a real number; True, False and durations are none."""
    return isinstance(value, Real) and not isinstance(value, bool | np.timedelta64)


def refuse_no_numbers(values: Any, what: str = "the input") -> None:
    """Raise an error for an array, a table or nested lists with values that are no numbers.

    NumPy and pandas would read "1.0" and True as 1, and a date as nanoseconds.
    """
    if isinstance(values, type) or callable(values):
        raise ValueError(f"{what} is {values!r:.100}; expected numbers")
    for name, part in _parts(values):
        what, example = _no_number(part)
        if what:
            where = f"column {name!r}" if name is not None else what
            hint = f", and times as the index of a pandas frame, as by frame.set_index({name!r})"
            raise ValueError(
                f"{where} holds {what}, such as {example!r:.60}; expected numbers"
                f"{hint if name is not None and what == 'times' else ''}"
            )


def refuse_huge(values: Any, what: str) -> None:
    """Raise an error for finite numbers that are too large to be squared."""
    array = np.asarray(values)
    if array.dtype == np.float64 and array.size and np.fmax.reduce(np.abs(array), axis=None) > HUGE:
        huge = array[np.isfinite(array) & (np.abs(array) > HUGE)]
        if huge.size:
            raise ValueError(f"{what} holds {huge[0]:g}; expected numbers from {-HUGE:g} to {HUGE:g}")


def _parts(values: Any) -> Iterator[tuple[Any, Any]]:
    """Columns of a frame that may hold no numbers, by name; of anything else the values themselves."""
    if not (hasattr(values, "columns") and hasattr(values, "dtypes")):
        yield None, values
        return
    for place, (name, dtype) in enumerate(zip(values.columns, values.dtypes, strict=True)):
        if not isinstance(dtype, np.dtype) or dtype.kind not in "fiuc":
            yield name, values.iloc[:, place] if hasattr(values, "iloc") else values[name].to_numpy()


def _no_number(values: Any) -> tuple[str, Any]:
    """What kind of values are no numbers, and the first of them; an empty text if all are numbers."""
    if isinstance(values, list | tuple):
        if len({len(row) for row in values if isinstance(row, list | tuple)}) > 1:
            return "rows of different lengths", values
        return next((found for found in map(_no_number, values) if found[0]), ("", None))
    dtype = getattr(values, "dtype", None)
    if dtype is None:
        return _kind_of(values), values
    kind = "categories" if str(dtype) == "category" else KINDS.get(getattr(dtype, "kind", ""), "")
    if kind:
        return kind, next(iter(np.ravel(np.asarray(values, dtype=object))), None)
    if getattr(dtype, "kind", "") == "O":
        objects = np.ravel(np.asarray(values, dtype=object))
        kinds = {kind: _kind_of_type(kind) for kind in set(map(type, objects))}
        if any(kinds.values()):
            example = next(value for value in objects if kinds[type(value)])
            return kinds[type(example)], example
    return "", None


def _kind_of(value: Any) -> str:
    return _kind_of_type(type(value))


def _kind_of_type(cls: type) -> str:
    return next((what for what, classes in NO_NUMBERS.items() if issubclass(cls, classes)), "")
