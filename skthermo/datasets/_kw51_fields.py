"""Fields of the monitoring file of KW51: numbers, names and time stamps, and what they may be."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo._warnings import warn_user

MOST_LABELS = 1000
UNIX_EPOCH = 719529  # as a MATLAB date number
DATES = (730486, 767011)  # 2000-01-01 and 2100-01-01
POSSIBLE = {
    "f": (0.1, 100.0),
    "xi": (-1.0, 1.0),
    "tBD31A": (-60.0, 80.0),
    "tVL": (-60.0, 80.0),
}
STAND_FOR_MISSING = (-99, -999, -9999, -99999, 9999, 99999, 999999)


def numbers_of(value: Any, what: str, *, complex_too: bool = False) -> NDArray:
    """An array of numbers; real where all imaginary parts are zero."""
    if not isinstance(value, np.ndarray):
        kind = "of a type that is not read" if value is None else "text, a cell array or a struct"
        raise ValueError(f"{what} is {kind}; expected a full array of numbers")
    if np.iscomplexobj(value) and not value.imag.any():
        return value.real
    if np.iscomplexobj(value) and not complex_too:
        raise ValueError(f"{what} has complex numbers; expected real ones")
    return value


def labels_of(value: Any, what: str) -> list[str]:
    """Texts of a cell array, nested or not, or of the rows of a matrix of characters."""
    labels = [text.strip() for text in _texts(value, what)]
    are_names = all(label and label.isprintable() for label in labels)
    if not are_names or len(set(labels)) != len(labels) or not 0 < len(labels) <= MOST_LABELS:
        found = [label[:50] for label in labels[:50]]
        raise ValueError(f"{what} has {len(labels)} names, {found}; expected 1 to {MOST_LABELS} that differ")
    return labels


def _texts(value: Any, what: str) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, list):
        for part in value or [""]:  # MATLAB's empty text has no rows
            yield from _texts(part, what)
    else:
        raise ValueError(f"{what} holds something else than texts; expected a cell array of names")


def check_shape(values: NDArray, shape: tuple[int, ...], what: str) -> None:
    """Raise an error for another shape than expected; MATLAB leaves out last axes of length one."""
    if values.shape + (1,) * (len(shape) - values.ndim) != shape:
        raise ValueError(
            f"{what} has shape {values.shape}; expected {shape}, the records and modes of 'f' and the names in "
            "'labels_m' and 'labels_env'"
        )


def check_finite(values: Array, columns: list[str], what: str) -> None:
    """Raise an error for the first infinite value; warn of numbers that stand for missing ones, such as -999."""
    _refuse(np.isinf(values), values, columns, dict.fromkeys(columns), what)
    doubtful = np.isin(values, STAND_FOR_MISSING)
    if doubtful.any():
        row, column = np.argwhere(doubtful)[0]
        warn_user(
            f"{what} has {doubtful.sum()} values that may stand for missing ones, the first in row {row}, column "
            f"{columns[column]!r}: {values[row, column]:g}; expected measured values, or NaN",
            kind="stand-ins",
        )


def check_possible(values: Array, columns: list[str], kinds: list[str], what: str) -> None:
    """Raise an error for the first value that cannot be measured; some kinds of columns have limits."""
    wrong = np.isinf(values) | np.isin(values, STAND_FOR_MISSING)
    for column, kind in enumerate(kinds):
        if kind in POSSIBLE:
            lowest, highest = POSSIBLE[kind]
            wrong[:, column] |= (values[:, column] < lowest) | (values[:, column] > highest)
    _refuse(wrong, values, columns, dict(zip(columns, map(POSSIBLE.get, kinds), strict=True)), what)


def _refuse(wrong: NDArray[np.bool_], values: Array, columns: list[str], limits: dict[str, Any], what: str) -> None:
    if not wrong.any():
        return
    row, column = np.argwhere(wrong)[0]
    name = columns[column]
    expected = "{:g} to {:g}".format(*limits[name]) if limits[name] else "a measured value"
    place = f"{what}, row {row}, column {name!r}"
    raise ValueError(f"{place} is {values[row, column]:g}; expected {expected}, or NaN where it is missing")


def time_of(numbers: Array, what: str) -> pd.DatetimeIndex:
    """MATLAB date numbers as time stamps to the second; each may stand there once."""
    wrong = ~((numbers >= DATES[0]) & (numbers < DATES[1]))
    if wrong.any():
        row = np.flatnonzero(wrong)[0]
        raise ValueError(
            f"{what}, row {row} is {numbers[row]}; expected a MATLAB date number from {DATES[0]} (year 2000) to "
            f"{DATES[1]} (2100)"
        )
    seconds = np.rint((numbers - UNIX_EPOCH) * 86400).astype("datetime64[s]")
    time = pd.DatetimeIndex(seconds.astype("datetime64[ns]"), name="time")
    if time.has_duplicates:
        row = np.flatnonzero(time.duplicated())[0]
        raise ValueError(f"{what}, row {row} repeats {time[row]}; expected each time stamp once")
    return time
