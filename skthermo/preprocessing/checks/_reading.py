"""Reads whatever is given as a table of records, and says what no table can be."""

from __future__ import annotations

from collections.abc import Collection, Hashable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import HUGE, Array, as_floats
from skthermo._tables.frames import as_stamps, midnight
from skthermo.preprocessing.checks._kinds import Finding

NUMBERED = pd.Timestamp("1970-03-01")  # before which numbers that are read as nanoseconds fall
SHORTEST_STEP = pd.Timedelta("1min")  # between records
DATES = (19500101, 21001231)  # dates written as one integer


@dataclass
class Reading:
    """A table of records as numbers in order of time, NaN where they cannot be used, and what was found on the way.

    Rows are row ``order`` of the table that was given. Columns that are ``useless`` have one value, or very few. The
    ``unit`` is what a sentence says after a value.
    """

    what: str
    values: Array
    columns: list[Hashable]
    index: pd.Index
    unit: str = ""
    findings: list[Finding] = field(default_factory=list)
    given_index: pd.Index = field(default_factory=lambda: pd.RangeIndex(0))
    were_known: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))
    is_frame: bool = False
    useless: set[int] = field(default_factory=set)
    order: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    aside: list[tuple[str, NDArray[np.intp], int, Array]] = field(default_factory=list)

    @classmethod
    def of(cls, table: Any, what: str, unit: str = "") -> Reading:
        """Read a frame, a Series or anything that is an array; whatever is none has no column."""
        is_series = isinstance(table, pd.Series)
        if is_series:
            table = table.to_frame("" if table.name is None else table.name)
        if isinstance(table, pd.DataFrame):
            reading = cls(what, np.empty((len(table), 0)), list(table.columns), table.index, is_frame=True)
            reading.values = _frame_values(table, reading)
            reading._check_names(table.columns)
            if is_series and what == "temperatures":
                reading._is_no_table("the temperatures are a Series, not a DataFrame")
        else:
            reading = cls(what, np.empty((0, 0)), [], pd.RangeIndex(0))
            reading._read_array(table)
        reading._check_size()
        reading.unit = " °C" if what == "temperatures" else f" {unit}" if unit else ""
        reading.given_index, reading.order = reading.index, np.arange(len(reading.values))
        reading.were_known = ~np.isnan(reading.values)
        return reading

    @property
    def is_table(self) -> bool:
        """Whether there are rows and columns."""
        return self.values.size > 0

    def sort(self, index: pd.Index) -> None:
        """Put rows in order of the times of an index."""
        self.index = index
        if isinstance(index, pd.DatetimeIndex) and not index.is_monotonic_increasing and not index.hasnans:
            self.order = index.argsort(kind="stable")
            self.index, self.values = index[self.order], self.values[self.order]
            self.were_known = self.were_known[self.order]

    def share(self, rows: NDArray[np.intp]) -> str:
        """How many of the rows these are, as a sentence says it."""
        n_rows = len(self.values)
        return f"{n_rows} rows" if len(rows) == n_rows else f"{len(rows)} of {n_rows} rows"

    @property
    def whole(self) -> NDArray[np.intp]:
        return np.arange(len(self.values))

    def finding(
        self, what: str, column: Hashable, rows: NDArray[np.intp], detail: str, *, period: bool = True
    ) -> Finding:
        """A finding in some rows, with their period."""
        where = f", {period_of(self.index, rows)}" if period and len(rows) else ""
        return finding(self.index, what, column, rows, detail + where)

    def found(self, *args: Any, **options: Any) -> None:
        self.findings.append(self.finding(*args, **options))

    def set_aside(self, what: str, rows: NDArray[np.intp], place: int) -> None:
        """Make values of a column NaN."""
        self.aside.append((what, rows, place, self.values[rows, place].copy()))
        self.values[rows, place] = np.nan

    def restore(self, kinds: Collection[str]) -> None:
        """Put values back that were set aside for other reasons than these."""
        for what, rows, place, values in reversed(self.aside):
            if what not in kinds:
                self.values[rows, place] = values

    def _read_array(self, table: Any) -> None:
        try:
            values = np.array(as_floats(table))
            names = list(getattr(table, "columns", ()))
        except Exception as error:  # objects of users may raise anything
            self._is_no_table(f"the {self.what} are a {type(table).__name__} ({_reason(error)})")
            return
        if values.ndim != 2 and not (values.ndim == 1 and self.what == "frequencies"):
            self._is_no_table(f"the {self.what} are a {type(table).__name__} of shape {values.shape}")
        if values.ndim not in (1, 2):
            return
        values = values[:, np.newaxis] if values.ndim == 1 else values
        prefix = "T" if self.what == "temperatures" else "f"
        self.values, self.index = values, pd.RangeIndex(len(values))
        self.columns = names or [f"{prefix}{place + 1}" for place in range(values.shape[1])]

    def _is_no_table(self, detail: str) -> None:
        self.findings.append(Finding("no-table", "", 0, None, None, detail))

    def _check_names(self, columns: pd.Index) -> None:
        if isinstance(columns, pd.MultiIndex) or any(isinstance(name, tuple) for name in columns):
            self.found(
                "column-names", "", self.whole, f"the {self.what} have tuples such as {columns[0]!r}", period=False
            )
        texts = [isinstance(name, str) for name in columns]
        if any(texts) and not all(texts):
            others = [name for name, is_text in zip(columns, texts, strict=True) if not is_text]
            self.found("column-names", "", self.whole, f"{others[0]!r} is no text beside others", period=False)
        for name in columns[columns.duplicated()].unique():
            number = int(np.sum(columns == name))
            self.found("column-names", name, self.whole, f"{name!r} is the name of {number} columns", period=False)

    def _check_size(self) -> None:
        if any(found.what == "no-table" for found in self.findings):
            return
        if not self.values.size:
            detail = f"the {self.what} have {self.values.shape[0]} rows and {self.values.shape[1]} columns"
            self.findings.append(Finding("no-rows", "", len(self.values), None, None, detail))

    def set_infinite_aside(self) -> None:
        """Make infinite values NaN, and those that are too large to be squared."""
        with np.errstate(invalid="ignore"):
            infinite = np.abs(self.values) > HUGE
        for column in np.flatnonzero(infinite.any(axis=0)):
            rows = np.flatnonzero(infinite[:, column])
            name, value = self.columns[column], self.values[rows[0], column]
            self.found("infinite-values", name, rows, f"{name!r} is {value:g} in {self.share(rows)}")
            self.set_aside("infinite-values", rows, int(column))


def _frame_values(table: pd.DataFrame, reading: Reading) -> Array:
    """Values of a frame, NaN in columns that hold no numbers."""
    try:
        return np.array(as_floats(table))
    except Exception:  # some column is no numbers: the others may be
        values = np.full(table.shape, np.nan)
    for place, name in enumerate(table.columns):
        try:
            values[:, place] = np.ravel(as_floats(table.iloc[:, [place]]))
        except Exception as error:  # objects of users may raise anything
            reading.found("no-numbers", name, reading.whole, _reason(error), period=False)
    return values


def _reason(error: Exception) -> str:
    return f"{str(error).partition(';')[0]:.150}"


def finding(index: pd.Index, what: str, column: Hashable, rows: NDArray[np.intp], detail: str) -> Finding:
    """A finding in some rows of an index."""
    ends = (index[rows[0]], index[rows[-1]]) if len(rows) else (None, None)
    return Finding(what, column, len(rows), *ends, detail)


def period_of(index: pd.Index, rows: NDArray[np.intp]) -> str:
    """First and last of some rows, as a sentence names them."""
    first, last = (label_of(index[row]) for row in (rows[0], rows[-1]))
    return f"{first} to {last}" if len(rows) > 1 else first


def label_of(label: Any) -> str:
    """How a sentence names a row: by its date, by its time, or by its label."""
    if not isinstance(label, pd.Timestamp) or label is pd.NaT:
        return f"row {label}"
    return f"{label:%Y-%m-%d}" if label == midnight(label) else f"{label:%Y-%m-%d %H:%M}"


def stamp_findings(index: pd.Index) -> list[Finding]:
    """What is wrong with the times of rows."""
    everything = np.arange(len(index))

    def found(what: str, rows: NDArray[np.intp], detail: str) -> list[Finding]:
        return [finding(index, what, "", rows, detail)]

    if not isinstance(index, pd.DatetimeIndex):
        return _other_labels(index)
    missing = np.flatnonzero(index.isna())
    if len(missing):
        return found("missing-stamps", missing, f"{len(missing)} of {len(index)} rows, the first row {missing[0]}")
    try:
        stamps = index.as_unit("ns").asi8
    except ValueError:  # beyond the years that nanoseconds reach
        return found("stamps-from-numbers", everything, f"{index.min()} to {index.max()}")
    if len(index) > 1 and (stamps == stamps[0]).all():
        return found("equal-stamps", everything, f"{label_of(index[0])} in all {len(index)} rows")
    steps = np.diff(stamps)
    if len(index) > 1 and 0 <= stamps.max() < NUMBERED.value and np.median(np.abs(steps)) < SHORTEST_STEP.value:
        detail = f"{index[0]} to {index[-1]} in {len(index)} rows, all at the beginning of 1970"
        return found("stamps-from-numbers", everything, detail)
    findings = []
    if not index.is_unique:
        again = np.flatnonzero(index.duplicated())
        again = again[np.argsort(stamps[again], kind="stable")]
        detail = f"{len(again)} of {len(index)} rows have the time of another, {period_of(index, again)}"
        findings += found("repeated-stamps", again, detail)
    if (steps < 0).any():
        late = 1 + np.flatnonzero(steps < 0)
        detail = f"{len(late)} of {len(index)} rows are earlier than the row before, the first row {late[0]}"
        findings += found("unsorted-stamps", late, f"{detail} ({label_of(index[late[0]])})")
    return findings


def _other_labels(index: pd.Index) -> list[Finding]:
    """Labels that look like times although they are none."""
    everything = np.arange(len(index))
    if len(index) > 1 and pd.api.types.is_integer_dtype(index.dtype) and not isinstance(index, pd.MultiIndex):
        ends = index.min(), index.max()
        months = index.to_numpy() // 100 % 100
        if DATES[0] <= ends[0] < ends[1] <= DATES[1] and ((months >= 1) & (months <= 12)).all():
            detail = f"the index holds dates as integers, such as {index[0]}"
            return [finding(index, "stamps-as-text", "", everything, detail)]
    try:
        as_stamps(index)
    except Exception as error:  # labels of users may be anything
        detail = str(error).partition(";")[0].replace("X has", "the index has").replace("of X ", "")
        return [finding(index, "stamps-as-text", "", everything, f"{detail:.150}")]
    return []
