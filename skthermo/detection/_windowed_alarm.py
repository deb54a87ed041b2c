"""Alarms raised by several records in a row."""

from numbers import Integral
from typing import Any, Literal

import numpy as np
from sklearn.model_selection import KFold

from skthermo._arrays import Array
from skthermo._validation import Interval, StrOptions
from skthermo._weather import correlation_time
from skthermo.detection._base import DamageDetector
from skthermo.detection._thresholds import conformal_threshold
from skthermo.detection._windows import CountLaw, MeanLaw, Windows

MOST_PERIODS = 50
"""Largest number of periods of the baseline whose windows are judged by what the others teach."""


class WindowedAlarm(DamageDetector):
    """Alarm where the last records together are far from a healthy baseline."""

    _parameter_constraints: dict = {
        **DamageDetector._parameter_constraints,
        "window": [Interval(Integral, 1, None, closed="left"), str],
        "rule": [StrOptions({"mean", "m-of-n"})],
        "m": [Interval(Integral, 1, None, closed="left"), None],
    }

    def __init__(
        self,
        window: int | str,
        *,
        rule: Literal["mean", "m-of-n"] = "mean",
        m: int | None = None,
        contamination: float = 0.02,
    ):
        self.window = window
        self.rule = rule
        self.m = m
        self.contamination = contamination

    def _records(self, X: Any, F: Array) -> Windows:
        return Windows.of(X, F, self.window)

    def _learn(self, windows: Windows) -> Array:
        n_rows, index = len(windows.rows), np.full(len(windows.rows), np.nan)
        law = MeanLaw if self.rule == "mean" else CountLaw
        n_periods = int(np.clip(n_rows // (2 * windows.longest), 2, MOST_PERIODS))
        for rest, fold in KFold(n_periods).split(windows.rows):
            index[fold] = law.of(windows, rest, self.contamination, self.m).index(windows)[fold]
        self.law_ = law.of(windows, np.arange(n_rows), self.contamination, self.m)
        return index

    def _limit(self, index: Array) -> float:
        is_high = np.where(np.isnan(index), np.nan, index > np.nanquantile(index, 1 - self.contamination))
        return conformal_threshold(index, self.contamination, 1 / correlation_time(is_high))

    def _index(self, windows: Windows) -> Array:
        return self.law_.index(windows)
