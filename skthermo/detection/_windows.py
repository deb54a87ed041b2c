"""Damage indices of windows: of the mean of their records, or of how many of them are far from the baseline."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import betainc, betaincinv
from scipy.stats import chi

from skthermo._arrays import Array
from skthermo.detection._gaussian import Gaussian, check_invertible
from skthermo.detection._mahalanobis import MahalanobisDetector
from skthermo.detection._patterns import as_if_complete

SMALLEST = 1e-300
"""Probabilities are not followed below this."""

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
        if not isinstance(window, str):
            return cls(rows, np.maximum(np.arange(len(rows)) - window + 1, 0))
        try:
            duration = pd.Timedelta(window)
        except ValueError:
            duration = pd.NaT
        if not duration > pd.Timedelta(0):
            raise ValueError(f"window is {window!r}; expected a number of records, or a time such as '24h'")
        times = getattr(X, "index", None)
        if not isinstance(times, pd.DatetimeIndex) or not times.is_monotonic_increasing:
            raise ValueError(
                f"window is {window!r}, a time, but the records are not a frame on a DatetimeIndex in order of time; "
                "expected one, or a number of records as the window"
            )
        return cls(rows, times.searchsorted(times - duration, side="right"))

    def sums(self, values: Array) -> Array:
        """Sums of the values of the records in every window."""
        totals = np.concatenate([np.zeros((1, *values.shape[1:])), values.cumsum(axis=0)])
        return totals[1:] - totals[self.first]

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


class WindowLaw(Protocol):
    """What a baseline teaches about windows."""

    def index(self, windows: Windows) -> Array:
        """Damage index of every window; NaN where no record has a mode."""


@dataclass(frozen=True)
class MeanLaw:
    """Length of the mean of whitened records, over its standard deviation, which grows with their correlation.

    Attributes
    ----------
    records : Gaussian
        Of single records.
    correlation : ndarray of shape (n_modes,)
        Mean correlation of two whitened records in one window.
    """

    records: Gaussian
    correlation: Array

    @classmethod
    def of(cls, windows: Windows, rows: NDArray[np.intp], contamination: float, m: int | None) -> "MeanLaw":
        """Learned from the records in some rows, and from the windows that end there."""
        records = Gaussian.of(windows.rows[rows])
        check_invertible(records.covariance, windows.rows[rows])
        white = records.whiten(windows.rows)
        counts = windows.sums(~np.isnan(white))[rows]
        sums, squares = (windows.sums(np.nan_to_num(values))[rows] for values in (white, white**2))
        correlation = (sums**2 - squares).sum(axis=0) / np.maximum((counts * (counts - 1)).sum(axis=0), 1)
        return cls(records, np.clip(correlation, 0.0, 1.0))

    def index(self, windows: Windows) -> Array:
        """Damage index of every window."""
        white = self.records.whiten(windows.rows)
        counts = windows.sums(~np.isnan(white))
        sums = windows.sums(np.nan_to_num(white))
        squared = sums**2 / np.maximum(counts * (1 + (counts - 1) * self.correlation), 1)
        return as_if_complete(np.sqrt(squared.sum(axis=1)), (counts > 0).sum(axis=1), sums.shape[1])


@dataclass(frozen=True)
class CountLaw:
    """The m-th largest damage index of the records in a window: it exceeds a threshold where m records do.

    In a window with gaps, the index is the one that is as unlikely in a window of ``n`` independent records, by the
    binomial law.

    Attributes
    ----------
    detector : MahalanobisDetector
        Judges single records.
    n : int
        Number of records in a full window.
    m : int
    """

    detector: MahalanobisDetector
    n: int
    m: int

    @classmethod
    def of(cls, windows: Windows, rows: NDArray[np.intp], contamination: float, m: int | None) -> "CountLaw":
        """Learned from the records in some rows."""
        detector = MahalanobisDetector(contamination, threshold="quantile").fit(windows.rows[rows])
        n = int(np.median(windows.sizes))
        if m is not None and m > n:
            raise ValueError(f"m is {m}, but windows hold {n} records; expected at most as many")
        return cls(detector, n, (n + 1) // 2 if m is None else m)

    def index(self, windows: Windows) -> Array:
        """Damage index of every window."""
        single = self.detector.damage_index(windows.rows)
        padded = np.concatenate([np.full(windows.longest - 1, np.nan), single])
        last = np.lib.stride_tricks.sliding_window_view(padded, windows.longest)
        inside = np.arange(windows.longest) >= windows.longest - windows.sizes[:, np.newaxis]
        return self._as_if_full(np.where(inside, last, np.nan), windows.rows.shape[1])

    def _as_if_full(self, single: Array, n_modes: int) -> Array:
        count = (~np.isnan(single)).sum(axis=1)
        m = np.maximum(np.rint(self.m * count / self.n), 1).astype(int)
        value = -np.take_along_axis(np.sort(-single, axis=1), np.minimum(m, single.shape[1])[:, np.newaxis] - 1, axis=1)
        value, partial = value[:, 0], (count != self.n) & (count > 0)
        m, count = m[partial], count[partial]
        chance = np.maximum(betainc(m, count - m + 1, chi.sf(value[partial], n_modes)), SMALLEST)
        value[partial] = chi.isf(np.maximum(betaincinv(self.m, self.n - self.m + 1, chance), SMALLEST), n_modes)
        return value
