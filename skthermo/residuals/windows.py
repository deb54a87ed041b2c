"""Trailing means of residuals over a window of time, within a regime of the weather."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, median, robust_deviation
from skthermo._core.frames import check_duration, has_stamps
from skthermo._core.saved_frames import SavesFrames

Regimes = NDArray[np.intp]


@dataclass(frozen=True)
class WindowMeans(SavesFrames):
    """Trailing means of residuals, and what they need of the baseline.

    ``width`` is the number of records in the longest window; ``limits``, (n_regimes, 2, n_targets), are the lowest and
    the highest residual that counts in a mean; ``usual``, (n_regimes, n_targets), the numbers of values that a window
    usually holds; ``history`` the residuals of the last window of the baseline, with their regimes, where records have
    stamps.
    """

    window: int | pd.Timedelta
    width: int
    share: float
    limits: Array
    usual: Array
    history: tuple[pd.DataFrame, Regimes] | None

    @property
    def lookback_(self) -> int | np.timedelta64:
        """How long before a record its window begins: a number of rows, or a time."""
        return self.window - 1 if isinstance(self.window, int) else self.window.to_timedelta64()

    @classmethod
    def fitted(
        cls, residuals: pd.DataFrame, regime: Regimes, window: Any, share: float, *, farthest: float = 4.0
    ) -> WindowMeans:
        """Learn from the residuals of a baseline in order of time.

        A residual counts as no farther from the median of its regime than so many robust standard deviations, so that
        an outlier does not dominate a mean. What more than half of a window lies beyond that is added: a change that
        lasts counts in full.
        """
        window = int(window) if isinstance(window, Integral) else check_duration(window, "window", may_be_zero=False)
        values, numbers = residuals.to_numpy(), range(regime.max() + 1)
        middle = np.array([median(values[regime == k]) for k in numbers])
        reach = farthest * np.array([robust_deviation(values[regime == k]) for k in numbers])
        limits = np.stack([middle - reach, middle + reach], axis=1)
        counts = means_by_regime(values, regime, residuals.index, window, limits)[1]
        usual = np.array([np.median(counts[regime == k], axis=0) for k in numbers])
        history = None
        if has_stamps(residuals):
            first = len(residuals) - window if isinstance(window, int) else 0
            recent = slice(max(first, 0), None)
            if not isinstance(window, int):
                recent = residuals.index > residuals.index[-1] - window
            history = residuals[recent], regime[recent]
        ones = pd.Series(1.0, residuals.index)
        width = window if isinstance(window, int) else int(ones.rolling(window).count().max())
        return cls(window, width, share, limits, usual, history)

    def __call__(self, residuals: pd.DataFrame, regime: Regimes, *, is_baseline: bool = False) -> Array:
        """Means of records in order of time; NaN where a window holds too few values.

        The records of the baseline are the history of later records.
        """
        values, index, n_before = residuals.to_numpy(), residuals.index, 0
        if self.history is not None:
            if not has_stamps(residuals):
                raise ValueError("X has rows without a DatetimeIndex; expected a DatetimeIndex, as in fit")
            known, zone = self.history[0].index.tz, index.tz
            if (known is None) != (zone is None):
                raise ValueError(f"X has stamps in time zone {zone}; expected {known}, as in fit")
        if self.history is not None and not is_baseline and len(index) and index[0] > self.history[0].index[-1]:
            before, before_regime = self.history
            values, index, n_before = np.vstack([before, values]), before.index.append(index), len(before)
            regime = np.concatenate([before_regime, regime])
        means, counts = means_by_regime(values, regime, index, self.window, self.limits)
        return np.where(counts >= np.maximum(self.share * self.usual[regime], 1), means, np.nan)[n_before:]


def means_by_regime(
    values: Array, regime: Regimes, index: pd.Index, window: Any, limits: Array
) -> tuple[Array, NDArray[np.intp]]:
    """Means of the clipped values within the window that ends with each row and in its regime, moved by as far as more
    than half of the values lie beyond the limits, and their numbers."""
    means, counts = np.full(values.shape, np.nan), np.zeros(values.shape, dtype=np.intp)
    for number, (lowest, highest) in enumerate(limits):
        own = regime == number
        rows = pd.DataFrame(np.where(own[:, np.newaxis], values, np.nan), None if isinstance(window, int) else index)
        within = rows.clip(lowest, highest, axis=1).rolling(window, min_periods=1)
        around = rows.rolling(window, min_periods=1)
        above = np.maximum(around.quantile(0.5, interpolation="lower") - highest, 0.0)
        below = np.minimum(around.quantile(0.5, interpolation="higher") - lowest, 0.0)
        means[own] = (within.mean() + above + below).to_numpy()[own]
        counts[own] = np.nan_to_num(within.count().to_numpy())[own]
    return means, counts
