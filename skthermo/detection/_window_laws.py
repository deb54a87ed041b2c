"""Damage indices of windows: of the mean of their records, or of how many of them are far from the baseline."""

import math
import warnings
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, betaincinv
from scipy.stats import chi

from skthermo._arrays import Array
from skthermo.detection._gaussian import Gaussian, check_invertible
from skthermo.detection._mahalanobis import MahalanobisDetector
from skthermo.detection._patterns import as_if_complete
from skthermo.detection._windows import NUMBERS, FadingWindows, Windows

NEGLIGIBLE = 1e-15
"""Modes whose records have faded to a smaller sum of squared weights are missing."""

SMALLEST = 1e-50
"""Indices of windows that are less likely grow in proportion to their records', as they do far out."""


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
    def of(
        cls, windows: Windows | FadingWindows, rows: NDArray[np.intp], contamination: float, m: int | None
    ) -> "MeanLaw":
        """Learned from the records in some rows, and from the windows that end there."""
        records = Gaussian.of(windows.rows[rows])
        check_invertible(records.covariance, windows.rows[rows])
        white = records.whiten(windows.rows)
        sums, weights, squared_weights = cls._sums(windows, white)
        squares = windows.square_sums(np.nan_to_num(white) ** 2)
        excess, pairs = (sums**2 - squares)[rows].sum(axis=0), (weights**2 - squared_weights)[rows].sum(axis=0)
        return cls(records, np.clip(excess / np.maximum(pairs, 1), 0.0, 1.0))

    def index(self, windows: Windows | FadingWindows) -> Array:
        """Damage index of every window."""
        sums, weights, squared_weights = self._sums(windows, self.records.whiten(windows.rows))
        variances = (1 - self.correlation) * squared_weights + self.correlation * weights**2
        known = squared_weights > NEGLIGIBLE
        squared = np.where(known, sums**2, 0.0) / np.where(known, variances, 1.0)
        return as_if_complete(np.sqrt(squared.sum(axis=1)), known.sum(axis=1), sums.shape[1])

    @staticmethod
    def _sums(windows: Windows | FadingWindows, white: Array) -> tuple[Array, Array, Array]:
        """Sums of the records, of their weights, and of the squares of these, mode by mode."""
        present = (~np.isnan(white)).astype(float)
        return windows.sums(np.nan_to_num(white)), windows.sums(present), windows.square_sums(present)


@dataclass(frozen=True)
class SumLaw:
    """Length of a cumulative sum of whitened records that shrinks by an allowance with each of them (Crosier, 1988).

    The allowance is half of the change that the mean of a window would just find.

    Attributes
    ----------
    records : Gaussian
        Of single records.
    allowance : float
    """

    records: Gaussian
    allowance: float

    @classmethod
    def of(cls, windows: Windows, rows: NDArray[np.intp], contamination: float, m: int | None) -> "SumLaw":
        """Learned from the records in some rows, and from the windows that end there."""
        means = MeanLaw.of(windows, rows, contamination, m)
        variance = (1 - means.correlation) / windows.longest + means.correlation
        just_found = chi.isf(contamination, len(variance)) * np.sqrt(variance.mean())
        return cls(means.records, float(just_found / 2))

    def index(self, windows: Windows) -> Array:
        """Length of the sum at every record, before it shrinks; NaN before the first mode."""
        index, total = np.empty(len(windows.rows)), [0.0] * windows.rows.shape[1]
        begun = False
        for first in range(0, len(index), NUMBERS // 20):
            block = self.records.whiten(windows.rows[first : first + NUMBERS // 20])
            has_modes = (~np.isnan(block)).any(axis=1).tolist()
            for i, row in enumerate(np.nan_to_num(block).tolist(), first):
                total = [x + y for x, y in zip(total, row, strict=True)]
                length = math.hypot(*total)
                begun = begun or has_modes[i - first]
                index[i] = length if begun else np.nan
                if has_modes[i - first]:
                    kept = max(1 - self.allowance / length, 0.0) if length > 0 else 0.0
                    total = [kept * x for x in total]
        return index


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
        detector = MahalanobisDetector(contamination, threshold="quantile")
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", r"\d+ of \d+ (baseline )?values")  # the whole baseline has been checked
            detector.fit(windows.rows[rows])
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
        value[partial] = self._equally_likely(value[partial], m[partial], count[partial], n_modes)
        return value

    def _equally_likely(self, value: Array, m: NDArray[np.intp], count: NDArray[np.intp], n_modes: int) -> Array:
        """Indices in a full window that are as unlikely as these, the m-th of ``count``."""
        farthest = chi.isf(betaincinv(m, count - m + 1, SMALLEST), n_modes)
        chance = np.maximum(betainc(m, count - m + 1, chi.sf(np.minimum(value, farthest), n_modes)), SMALLEST)
        return np.maximum(value / farthest, 1.0) * chi.isf(betaincinv(self.m, self.n - self.m + 1, chance), n_modes)
