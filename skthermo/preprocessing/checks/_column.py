"""One column of a table: its values in order, and which of them stand out."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from skthermo._tables.arrays import Array
from skthermo._tables.frames import MARKERS
from skthermo.preprocessing.checks._reading import Reading
from skthermo.preprocessing.checks._signs import equal_runs

LOGGED = (*MARKERS, 999.0, 9999.0, 99999.0, 999.9, -999.9, 9999.9, -9999.9, 999.99, 9999.99, 1e20, 1e30, -1e30)
APART, GAP = 8.0, 5.0  # standard deviations: from the middle of the usual values, and between two levels
EMPTY = 1 / 3  # share of all that a column spans, between two levels
FEW_LEVELS, MANY_VALUES = 3, 5  # different values that repeat, far from so many others
FEW_VALUES, LEAST_KNOWN = 4, 50  # different values of a column of so many
NARROWEST, SPAN = 0.4, 1.049  # share of the values of a column, and the standard deviations that it spans if normal
AMONG = np.ones(3)  # rows, of which the middle one is as doubtful as the two others


class Column:
    """One column of a table, its known values in order and how often each of them occurs."""

    def __init__(self, reading: Reading, place: int, name: Hashable):
        self.reading, self.place, self.name = reading, place, name
        self._sort()

    def _sort(self) -> None:
        column = self.reading.values[:, self.place]
        known = np.sort(column)[: len(column) - np.count_nonzero(np.isnan(column))]
        first, self.counts = equal_runs(known)
        self.ordered, self.levels = known, known[first]

    def quantile(self, share: float) -> float:
        """A value of the column that this share of the known values does not exceed."""
        return float(self.ordered[int(share * (len(self.ordered) - 1))])

    @property
    def span(self) -> str:
        """Smallest and largest value as a sentence gives them."""
        return f"lies between {self.levels[0]:.6g} and {self.levels[-1]:.6g}"

    def found(self, what: str, levels: Array, detail: str) -> None:
        """Add a finding in the rows that have one of these levels."""
        rows = self._rows(levels)
        self.reading.found(what, self.name, rows, f"{self.name!r} {detail} in {self.reading.share(rows)}")

    def put_aside(self, what: str, levels: Array) -> None:
        """Add a finding in the rows that have one of these levels; they, and single rows among them, become NaN."""
        if len(levels):
            named = texts_of(levels) if len(levels) <= FEW_LEVELS else f"{levels[0]:.6g} to {levels[-1]:.6g}"
            self.found(what, levels, f"is {named}{self.reading.unit}")
            wrong = np.isin(np.arange(len(self.reading.values)), self._rows(levels))
            self.reading.set_aside(what, np.flatnonzero(wrong | binary_closing(wrong, AMONG)), self.place)
            self._sort()

    def _rows(self, levels: Array) -> NDArray[np.intp]:
        column = self.reading.values[:, self.place]
        return np.flatnonzero(np.isin(column, levels) if len(levels) < len(self.levels) else ~np.isnan(column))

    def isolated_levels(self, jump: float) -> Array:
        """A few values at either end that repeat exactly, farther from all others than a jump."""
        levels, repeated, gaps = self.levels, self.counts > 1, np.diff(self.levels) > jump
        isolated = np.zeros(len(levels), dtype=bool)
        for number in range(1, FEW_LEVELS + 1) if len(levels) > FEW_LEVELS + MANY_VALUES else ():
            for ends, gap in ((slice(None, number), gaps[number - 1]), (slice(-number, None), gaps[-number])):
                isolated[ends] |= gap and repeated[ends].all()
        return levels[isolated]

    def levels_apart(self) -> Array:
        """Values at another level than the others: beyond a gap of a third of all that the column spans.

        The narrowest part of the values says how far they scatter. Where it does not, or few are known, none are.
        """
        known, n_usual = self.ordered, int(NARROWEST * len(self.ordered))
        apart: list[Array] = []
        if len(known) < LEAST_KNOWN:
            return known[:0]
        widths = known[n_usual:] - known[: len(known) - n_usual]
        first = int(widths.argmin())
        middle, scatter = known[first : first + n_usual + 1].mean(), widths[first] / SPAN
        levels = self.levels
        while scatter > 0 and len(levels) > 1:
            gaps = np.diff(levels)
            place = int(gaps.argmax())
            side = levels[: place + 1] if levels[place] < middle else levels[place + 1 :]
            if gaps[place] < max(GAP * scatter, EMPTY * (levels[-1] - levels[0])) or (
                np.abs(side - middle).min() < APART * scatter
            ):
                break
            apart.append(side)
            levels = levels[~np.isin(levels, side)]
        return np.sort(np.concatenate([known[:0], *apart]))

    def is_poor(self) -> bool:
        """Whether the column is empty or constant, or says little because it has few values; and say so."""
        n_levels, n_known, whole = len(self.levels), len(self.ordered), self.reading.whole
        is_coarse = n_levels <= FEW_VALUES and n_known >= LEAST_KNOWN
        if not n_known and not any(found.column == self.name for found in self.reading.findings):
            self.reading.found("missing-column", self.name, whole, f"{self.name!r} is NaN in all {len(whole)} rows")
        elif n_levels == 1 < n_known:
            self.found("constant", self.levels, f"is {self.levels[0]:.6g}{self.reading.unit}")
        elif n_known and is_coarse:
            self.found(
                "few-values", self.levels, f"has the {n_levels} values {texts_of(self.levels)}{self.reading.unit}"
            )
        if n_levels < 2 or is_coarse:
            self.reading.useless.add(self.place)
        return n_levels < 2


def texts_of(levels: Array) -> str:
    """Numbers as a sentence lists them."""
    return ", ".join(f"{level:.6g}" for level in levels)


def contents_of(reading: Reading) -> list[tuple[Any, bytes]]:
    """Name and bytes of each column that varies."""
    columns = zip(reading.columns, reading.values.T, strict=True)
    return [(name, column.tobytes()) for name, column in columns if np.fmax.reduce(column) > np.fmin.reduce(column)]


def find_equal_columns(reading: Reading) -> None:
    """Name columns that are copies of another one."""
    seen: dict[bytes, Any] = {}
    for name, content in contents_of(reading):
        if content in seen:
            detail = f"{name!r} equals {seen[content]!r} in {len(reading.values)} rows"
            reading.found("equal-columns", name, reading.whole, detail)
        seen.setdefault(content, name)
