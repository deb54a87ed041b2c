"""What is drawn, as frames of columns over time or over the number of the record."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.exceptions import NotFittedError

from skthermo._arrays import as_columns, real_array
from skthermo._frames import check_same_rows

LONG_GAP = 10  # usual steps of time from which on a line breaks between two records


def as_table(values: Any, what: str, prefix: str = "f") -> pd.DataFrame:
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


def check_like(first: Any, other: Any, names: tuple[str, str]) -> None:
    """Raise an error if two tables differ in shape or index."""
    check_same_rows(first, other, names)
    if np.shape(as_columns(first)) != np.shape(as_columns(other)):
        raise ValueError(
            f"{names[0]} has {as_columns(first).shape[1]} columns and {names[1]} {as_columns(other).shape[1]}; "
            "expected the same"
        )


def as_tables(histories: Any, what: str, prefix: str = "f") -> dict[str, pd.DataFrame]:
    """Labelled tables with the same number of columns, which may have different rows."""
    if not isinstance(histories, Mapping):
        histories = {"": histories}
    tables = {str(label): as_table(values, f"{what} {label!r}", prefix) for label, values in histories.items()}
    if not tables:
        raise ValueError(f"{what} is empty; expected a mapping of label to table")
    first_label, first = next(iter(tables.items()))
    for label, table in tables.items():
        if table.shape[1] != first.shape[1]:
            raise ValueError(
                f"{what} {label!r} has {table.shape[1]} columns and {first_label!r} {first.shape[1]}; expected the same"
            )
    return tables


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


def check_study(study: Any) -> None:
    """Raise an error for what is no study, or one without results."""
    if not hasattr(study, "scenarios"):
        raise ValueError(f"study is {study!r:.200}; expected a DetectabilityStudy")
    if not hasattr(study, "results_"):
        raise NotFittedError("the study has no results yet; expected a call of run before")


def names_from(chosen: Sequence[str] | None, known: Iterable[str], what: str) -> list[str]:
    """Names that are chosen, or all that are known."""
    names = list(known) if chosen is None else [chosen] if isinstance(chosen, str) else list(chosen)
    unknown = [name for name in names if name not in set(known)]
    if unknown or not names:
        raise ValueError(f"{what} are {unknown or names}; expected some of {list(known)}, which have results")
    return names
