"""A table of records as numbers, whatever was given, with the values that were set aside and the findings."""

from __future__ import annotations

from collections.abc import Collection, Hashable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import HUGE, Array, as_floats
from skthermo._core.frames import named_frame
from skthermo.preprocessing.checks._record_findings import ASIDE_KINDS, LEFT_OUT_KINDS, RecordFinding


class Reading:
    """A table as numbers in order of time, NaN where a value cannot be a measurement, and its findings.

    An argument that is no table has no column. ``order`` has the positions of the rows in the table that was given,
    ``useless`` the positions of columns with one value, or very few. Sentences write the ``unit`` after a value.
    """

    def __init__(self, table: Any, what: str, unit: str, beside: Any):
        self.given, self.what, self.unit = table, what, " °C" if what == "temperatures" else f" {unit}" if unit else ""
        self.findings: list[RecordFinding] = []
        self.useless: set[int] = set()
        self._aside: list[tuple[str, int, NDArray[np.bool_]]] = []
        self.values, self.columns = np.empty((0, 0)), list[Hashable]()
        is_series = isinstance(table, pd.Series)
        frame = table.to_frame("" if table.name is None else table.name) if is_series else table
        self.is_frame = isinstance(frame, pd.DataFrame)
        self.given_index = self.index = frame.index if self.is_frame else pd.RangeIndex(0)
        reason = self._read_frame(frame) if self.is_frame else self._read_array(table)
        n_rows = len(self.values)
        if not self.is_frame:  # the times of an array are those of the frame beside it
            is_beside = isinstance(beside, pd.DataFrame | pd.Series) and len(beside) == n_rows
            self.given_index, self.index = pd.RangeIndex(n_rows), beside.index if is_beside else pd.RangeIndex(n_rows)
        if reason or (is_series and what == "temperatures"):
            reason = reason or "are a Series, not a DataFrame"
            self.findings.append(RecordFinding("no-table", "", 0, None, None, f"the {what} {reason}"))
        elif not self.values.size:
            detail = f"the {what} have {n_rows} rows and {self.values.shape[1]} columns"
            self.findings.append(RecordFinding("no-rows", "", n_rows, None, None, detail))
        self.order = np.arange(n_rows)
        if isinstance(self.index, pd.DatetimeIndex) and not self.index.is_monotonic_increasing:
            self.order = self.order if self.index.hasnans else self.index.argsort(kind="stable")
            self.index, self.values = self.index[self.order], self.values[self.order]
        self.before = self.values.copy()
        with np.errstate(invalid="ignore"):
            too_large = np.abs(self.values) > HUGE
        for place in np.flatnonzero(too_large.any(axis=0)):
            self.put_aside("placeholders", int(place), too_large[:, place])

    def _read_frame(self, frame: pd.DataFrame) -> str:
        """Read a frame, NaN in columns that hold no numbers, and look at its names."""
        names, everywhere = frame.columns, np.ones(len(frame), dtype=bool)
        self.columns = list(names)
        try:
            self.values = np.array(as_floats(frame))
        except Exception:  # some column is no numbers: the others may be
            self.values = np.full(frame.shape, np.nan)
            for place, name in enumerate(names):
                try:
                    self.values[:, place] = np.ravel(as_floats(frame.iloc[:, [place]]))
                except Exception as error:  # objects of users may raise anything
                    detail = f"{str(error).partition(';')[0]:.150}"
                    self.found("no-table", name, everywhere, detail, period=False)
        kinds = set(map(type, names))
        if tuple in kinds or isinstance(names, pd.MultiIndex):
            self.found("no-table", "", everywhere, f"the {self.what} have tuples such as {names[0]!r}", period=False)
        if str in kinds and len(kinds) > 1:
            self.found("no-table", "", everywhere, "some names of columns are text, others are not", period=False)
        for name in names[names.duplicated()].unique():
            detail = f"{name!r} is the name of {np.sum(names == name)} columns"
            self.found("no-table", name, everywhere, detail, period=False)
        return ""

    def _read_array(self, table: Any) -> str:
        """Read whatever becomes an array; why it is none, else an empty text."""
        kind = type(table).__name__
        try:
            values, names = np.array(as_floats(table)), list(getattr(table, "columns", ()))
        except Exception as error:  # objects of users may raise anything
            return f"are a {kind} ({str(error).partition(';')[0]:.150})"
        if values.ndim in (1, 2):
            self.values = values[:, np.newaxis] if values.ndim == 1 else values
            prefix = "T" if self.what == "temperatures" else "f"
            self.columns = names or [f"{prefix}{place + 1}" for place in range(self.values.shape[1])]
        if values.ndim == 2 or (values.ndim == 1 and self.what == "frequencies"):
            return ""
        return f"are a {kind} of shape {values.shape}"

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

    def put_aside(self, what: str, place: int, wrong: NDArray[np.bool_]) -> bool:
        """Add a finding where values of a column are wrong; these, and single values between them, become NaN."""
        column = self.values[:, place]
        wrong = wrong & ~np.isnan(column)
        if not wrong.any():
            return False
        levels = np.unique(column[wrong])
        named = texts_of(levels) if len(levels) <= 3 else f"{levels[0]:.6g} to {levels[-1]:.6g}"
        self.found_in(what, place, f"is {named}{self.unit}", wrong)
        wrong[1:-1] |= wrong[:-2] & wrong[2:]
        self._aside.append((what, place, wrong))
        column[wrong] = np.nan
        return True

    def use(self, kinds: Collection[str]) -> None:
        """Use the values that were put aside for these kinds of findings as they were given."""
        self.values = self.before.copy()
        for kind, place, wrong in self._aside:
            if kind not in kinds:
                self.values[wrong, place] = np.nan

    def cleaned(self, exclude: Collection[str] = ()) -> tuple[Any, dict[Hashable, str]]:
        """The values as they were given, NaN where some are put aside, and columns that cannot be used, with reasons.

        These have no value or one, or most of their values were set aside.
        """
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
        values = np.empty_like(self.values)
        values[self.order] = self.values
        return named_frame(self.given, values), reasons


def texts_of(levels: Array) -> str:
    """Numbers as a sentence lists them."""
    return ", ".join(map("{:.6g}".format, levels))
