"""Which records count together with each one."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import lfilter

from skthermo._arrays import Array
from skthermo._frames import first_disorder

NUMBERS = 2_000_000
"""Numbers that are held in memory at a time."""


@dataclass(frozen=True)
class Windows:
    """Records in order of time, and the first record of the window that ends with each.

    Attributes
    ----------
    rows : ndarray of shape (n_records, n_modes)
    first : ndarray of shape (n_records,)
    """

    rows: Array
    first: NDArray[np.intp]

    @classmethod
    def of(cls, X: Any, rows: Array, window: int | str) -> "Windows":
        """Windows of a number of records, or of a time on the index of a frame."""
        row = first_disorder(X)
        if row:
            raise ValueError(
                f"row {row} ({X.index[row]}) is earlier than the row before it; expected records in order of time, as "
                "X.sort_index() gives"
            )
        if not isinstance(window, str):
            return cls(rows, np.maximum(np.arange(len(rows)) - window + 1, 0))
        try:
            duration = pd.Timedelta(window)
        except ValueError:
            duration = pd.NaT
        if not duration >= pd.Timedelta("1s"):
            raise ValueError(f"window is {window!r}; expected a number of records, or a time such as '24h'")
        times = getattr(X, "index", None)
        if not isinstance(times, pd.DatetimeIndex) or times.hasnans:
            raise ValueError(
                f"window is {window!r}, a time, but the records are not a frame with a stamp for each; expected a "
                "DatetimeIndex, or a number of records as the window"
            )
        return cls(rows, times.searchsorted(times - duration, side="right"))

    def sums(self, values: Array) -> Array:
        """Sums of the values of the records in every window."""
        totals = np.concatenate([np.zeros((1, *values.shape[1:])), values.cumsum(axis=0)])
        return totals[1:] - totals[self.first]

    def square_sums(self, values: Array) -> Array:
        """The same with the squares of the records' weights, which are 1."""
        return self.sums(values)

    def pieces(self) -> Iterator[tuple[slice, "Windows"]]:
        """Runs of windows, which hold a bounded number of records, each with the records before that it needs."""
        step = max(NUMBERS // self.longest, 1)
        for start in range(0, len(self.rows), step):
            stop, before = min(start + step, len(self.rows)), self.first[start]
            first = np.maximum(self.first[before:stop] - before, 0)
            yield slice(start, stop), Windows(self.rows[before:stop], first)

    @property
    def sizes(self) -> NDArray[np.intp]:
        """Number of records in every window."""
        return np.arange(len(self.rows)) - self.first + 1

    @property
    def longest(self) -> int:
        """Largest number of records in a window."""
        return int(self.sizes.max())


@dataclass(frozen=True)
class FadingWindows:
    """All records up to each one, with weights that fade by a factor from one to the next.

    Attributes
    ----------
    rows : ndarray of shape (n_records, n_modes)
    fading : float
    longest : int
        Number of records after which weights are negligible.
    """

    rows: Array
    fading: float
    longest: int

    @classmethod
    def of(cls, rows: Array, window: int) -> "FadingWindows":
        """Weights with the mean age of those of a window; 1e-17 of their sum is beyond ``longest``."""
        return cls(rows, (window - 1) / (window + 1), 20 * window)

    def sums(self, values: Array) -> Array:
        """Weighted sums of the values of the records."""
        return lfilter([1.0], [1.0, -self.fading], values, axis=0)

    def square_sums(self, values: Array) -> Array:
        """The same with the squares of the weights."""
        return lfilter([1.0], [1.0, -(self.fading**2)], values, axis=0)

    def pieces(self) -> Iterator[tuple[slice, "FadingWindows"]]:
        """Runs of bounded length, each with the records before that count."""
        step = max(NUMBERS // self.rows.shape[1], self.longest)
        for start in range(0, len(self.rows), step):
            stop = min(start + step, len(self.rows))
            rows = self.rows[max(start - self.longest, 0) : stop]
            yield slice(start, stop), FadingWindows(rows, self.fading, self.longest)
