"""What is drawn, as frames of columns over time or over the number of the record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.exceptions import NotFittedError

from skthermo._tables.arrays import as_columns, real_array

if TYPE_CHECKING:
    from skthermo.studies import DetectabilityStudy

LONG_GAP = 10  # usual steps of time from which on a line breaks between two records


def as_table(values: ArrayLike, what: str, prefix: str = "f") -> pd.DataFrame:
    """A frame of floats; the columns of an array are called f1, f2, ... and its rows by their numbers from 0."""
    if isinstance(values, pd.Series):
        values = values.to_frame(f"{prefix}1" if values.name is None else values.name)
    real_array(values, what)
    columns = as_columns(values)
    if columns.ndim != 2 or not columns.size:
        raise ValueError(f"{what} has shape {np.shape(values)}; expected one or more records (rows) and columns")
    if isinstance(values, pd.DataFrame):
        return pd.DataFrame(columns, values.index, values.columns)
    return pd.DataFrame(columns, columns=[f"{prefix}{i + 1}" for i in range(columns.shape[1])])


def in_time(table: pd.DataFrame) -> tuple[NDArray, NDArray]:
    """Place of each record on the horizontal axis, (n_records,), and the values, in order of time where it is known."""
    values, index = table.to_numpy(), table.index
    if isinstance(index, pd.PeriodIndex):
        index = index.to_timestamp()
    if isinstance(index, pd.DatetimeIndex):
        order = np.argsort(index.to_numpy(), kind="stable")
        return index.tz_localize(None).to_numpy()[order], values[order]
    is_numeric = pd.api.types.is_numeric_dtype(index)
    return (index.to_numpy() if is_numeric else np.arange(len(index))), values


def with_breaks(x: NDArray, values: NDArray) -> tuple[NDArray, NDArray]:
    """The same with NaN in long gaps of time, so that a line breaks there."""
    if not np.issubdtype(x.dtype, np.datetime64) or len(x) < 3:
        return x, values
    steps = np.diff(x)
    usual = np.median(steps)
    before = np.flatnonzero(steps > LONG_GAP * usual)
    return np.insert(x, before + 1, x[before] + usual), np.insert(values, before + 1, np.nan, axis=0)


def check_study(study: DetectabilityStudy) -> None:
    """Raise an error for what is no study, or one without results."""
    if not hasattr(study, "scenarios"):
        raise ValueError(f"study is {study!r:.200}; expected a DetectabilityStudy")
    if not hasattr(study, "results_"):
        raise NotFittedError("the study has no results yet; expected a call of run before")
