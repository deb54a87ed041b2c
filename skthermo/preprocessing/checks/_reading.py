"""A table of records as numbers, whatever was given, with the values that were set aside and the findings."""

from __future__ import annotations

from collections.abc import Collection, Hashable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import HUGE, Array, as_floats
from skthermo._core.frames import Table, named_frame
from skthermo.preprocessing.checks._record_findings import ASIDE_KINDS, LEFT_OUT_KINDS, RecordFinding


class Reading:
    """A table as numbers in order of time, NaN where a value cannot be a measurement, and its findings.

    An argument that is no table has no column. ``order`` has the positions of the rows in the table that was given,
    ``useless`` the positions of columns with one value, or very few. Sentences write the ``unit`` after a value.
    """

    def __init__(self, table: Any, what: str, unit: str):
        self.given, self.what, self.unit = table, what, " °C" if what == "temperatures" else f" {unit}" if unit else ""
        self.columns: list[Hashable] = []
        self.values, self.index = np.empty((0, 0)), pd.RangeIndex(0)
        self.findings: list[RecordFinding] = []
        self.useless: set[int] = set()
        self._aside: list[tuple[str, int, NDArray[np.bool_]]] = []
        is_series = isinstance(table, pd.Series)
        if is_series:
            table = table.to_frame("" if table.name is None else table.name)
        self.is_frame = isinstance(table, pd.DataFrame)
        reason = self._read_frame(table) if self.is_frame else self._read_array(table)
        if is_series and what == "temperatures":
            reason = "are a Series, not a DataFrame"
        n_rows, n_columns = self.values.shape
        if reason:
            self.findings.append(RecordFinding("no-table", "", 0, None, None, f"the {what} {reason}"))
        elif not self.values.size:
            detail = f"the {what} have {n_rows} rows and {n_columns} columns"
            self.findings.append(RecordFinding("no-rows", "", n_rows, None, None, detail))
        self.given_index, self.order, self.before = self.index, np.arange(n_rows), self.values.copy()

    def _read_frame(self, frame: pd.DataFrame) -> str:
        """Read a frame, NaN in columns that hold no numbers, and look at its names."""
        names = frame.columns
        self.columns, self.index, everywhere = list(names), frame.index, np.ones(len(frame), dtype=bool)
        try:
            self.values = np.array(as_floats(frame))
        except Exception:  # some column is no numbers: the others may be
            self.values = np.full(frame.shape, np.nan)
            for place, name in enumerate(self.columns):
                try:
                    self.values[:, place] = np.ravel(as_floats(frame.iloc[:, [place]]))
                except Exception as error:  # objects of users may raise anything
                    self.found("no-table", name, everywhere, _reason(error), period=False)
        others = [name for name in names if not isinstance(name, str)]
        if isinstance(names, pd.MultiIndex) or any(isinstance(name, tuple) for name in others):
            self.found("no-table", "", everywhere, f"the {self.what} have tuples such as {names[0]!r}", period=False)
        if 0 < len(others) < len(names):
            self.found("no-table", "", everywhere, f"{others[0]!r} is no text beside others", period=False)
        for name in names[names.duplicated()].unique():
            detail = f"{name!r} is the name of {np.sum(names == name)} columns"
            self.found("no-table", name, everywhere, detail, period=False)
        return ""

    def _read_array(self, table: Any) -> str:
        """Read whatever becomes an array; why it is none, else an empty text."""
        kind = type(table).__name__
        try:
            values = np.array(as_floats(table))
            names = list(getattr(table, "columns", ()))
        except Exception as error:  # objects of users may raise anything
            return f"are a {kind} ({_reason(error)})"
        if values.ndim in (1, 2):
            self.values = values[:, np.newaxis] if values.ndim == 1 else values
            self.index = pd.RangeIndex(len(values))
            prefix = "T" if self.what == "temperatures" else "f"
            self.columns = names or [f"{prefix}{place + 1}" for place in range(self.values.shape[1])]
        if values.ndim == 2 or (values.ndim == 1 and self.what == "frequencies"):
            return ""
        return f"are a {kind} of shape {values.shape}"

    def sort(self, index: pd.Index) -> None:
        """Put rows in order of the times of an index, and aside what is infinite or too large to be squared."""
        self.index = index
        if isinstance(index, pd.DatetimeIndex) and not index.is_monotonic_increasing and not index.hasnans:
            self.order = index.argsort(kind="stable")
            self.index, self.values = index[self.order], self.values[self.order]
            self.before = self.values.copy()
        with np.errstate(invalid="ignore"):
            infinite = np.abs(self.values) > HUGE
        for place in np.flatnonzero(infinite.any(axis=0)):
            self.put_aside("placeholders", int(place), infinite[:, place])

    def found(self, what: str, column: Hashable, rows: NDArray[np.bool_], detail: str, *, period: bool = True) -> None:
        """Add a finding in the rows of a mask."""
        found = RecordFinding.in_rows(self.index, what, column, np.flatnonzero(rows), detail, period=period)
        self.findings.append(found)

    def found_in(self, what: str, place: int, detail: str, rows: NDArray[np.bool_] | None = None) -> None:
        """Add a finding about a column, by default in all rows in which it has a value."""
        rows = ~np.isnan(self.values[:, place]) if rows is None else rows
        n_rows, n_found, name = len(rows), np.count_nonzero(rows), self.columns[place]
        share = f"{n_rows} rows" if n_found == n_rows else f"{n_found} of {n_rows} rows"
        self.found(what, name, rows, f"{name!r} {detail} in {share}")

    def put_aside(self, what: str, place: int, wrong: NDArray[np.bool_]) -> None:
        """Add a finding where values of a column are wrong; these, and single values between them, become NaN."""
        column = self.values[:, place]
        wrong = wrong & ~np.isnan(column)
        if not wrong.any():
            return
        levels = np.unique(column[wrong])
        named = texts_of(levels) if len(levels) <= 3 else f"{levels[0]:.6g} to {levels[-1]:.6g}"
        self.found_in(what, place, f"is {named}{self.unit}", wrong)
        between = np.zeros(len(wrong), dtype=bool)
        between[1:-1] = wrong[:-2] & wrong[2:]
        self._aside.append((what, place, wrong | between))
        column[wrong | between] = np.nan

    def use(self, kinds: Collection[str]) -> None:
        """Use the values that were put aside for these kinds of findings as they were given."""
        if any(kind in kinds for kind, _, _ in self._aside):
            self.values = self.before.copy()
            for kind, place, wrong in self._aside:
                if kind not in kinds:
                    self.values[wrong, place] = np.nan

    def left_out(self, exclude: Collection[str] = ()) -> dict[Hashable, str]:
        """Columns without a value or with one, and columns of which most values were set aside, with the reasons."""
        n_known = np.count_nonzero(~np.isnan(self.before), axis=0)
        n_left = np.count_nonzero(~np.isnan(self.values), axis=0)
        reasons: dict[Hashable, str] = {}
        for place, name in enumerate(self.columns):
            aside, useless, n_elsewhere = [], [], 0
            for found in self.findings:
                if found.column == name and found.what in ASIDE_KINDS:
                    aside.append(found.detail)
                    n_elsewhere += found.n_rows if found.what == "another-level" else 0
                elif found.column == name and found.what in LEFT_OUT_KINDS.difference(exclude):
                    useless.append(f"{found.detail} ({found.what})")
            # of two levels, it is not certain which one is right
            if n_left[place] < 0.5 * n_known[place] or n_elsewhere > 0.2 * n_known[place]:
                reasons[name] = "; ".join(aside)
            elif useless:
                reasons[name] = useless[0]
        return reasons

    def table(self) -> Table:
        """The values in the order of rows that was given, as a frame if one was given."""
        values = np.empty_like(self.values)
        values[self.order] = self.values
        return named_frame(self.given, values)


def texts_of(levels: Array) -> str:
    """Numbers as a sentence lists them."""
    return ", ".join(map("{:.6g}".format, levels))


def _reason(error: Exception) -> str:
    return f"{str(error).partition(';')[0]:.150}"
