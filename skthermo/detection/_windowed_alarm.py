"""Alarms raised by several records in a row."""

from __future__ import annotations

from numbers import Integral
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.model_selection import KFold

from skthermo._tables.arrays import Array
from skthermo._tables.frames import correlation_time
from skthermo._validation import Interval, StrOptions, check_is_fitted
from skthermo.detection._base import DamageDetector
from skthermo.detection._laws import CountLaw, MeanLaw
from skthermo.detection._thresholds import conformal_threshold
from skthermo.detection._windows import Windows
from skthermo.residuals.gaussian import check_not_empty
from skthermo.residuals.neighbourhoods import Neighbourhoods

MOST_PERIODS = 50  # into which the baseline is divided; the windows of each are evaluated by the others


class WindowedAlarm(DamageDetector):
    """Alarm where the last records together are far from a healthy baseline.

    Records have to be in order of time, and are best whitened: residuals of ``TemperatureCompensator(...,
    whiten="local")``.

    Parameters
    ----------
    window : int or str
        Number of records, up to the one that is evaluated, or a time such as ``"24h"`` on the ``DatetimeIndex`` of a
        frame. With gaps in time, a number of records reaches back beyond them; a time does not.
    rule : {"mean", "m-of-n"}, default="mean"
        What the damage index of a window is:

        - ``"mean"``: length of the mean of the whitened records, in standard deviations of such a mean. Finds small
          lasting changes.
        - ``"m-of-n"``: the m-th largest damage index of the n records (unsquared Mahalanobis distances), so that there
          is an alarm where m of them exceed the threshold. Not misled by a few implausible records.
    m : int, optional
        Number of records of a full window that have to exceed the threshold; by default half of them. For
        ``rule="m-of-n"``.
    contamination : float, default=0.02
        Share of healthy windows above the threshold. Windows of later records overlap: alarms come in runs.

    Attributes
    ----------
    law_ : object
        Distribution of the records, learned from the baseline, by which windows are evaluated.
    width_, fewest_ : int
        Largest number of records in a window, and fewest with a value that a window is evaluated by: half as many as a
        window of the baseline has (median).
    lookback_ : int or numpy.timedelta64
        How far back a window looks: a number of rows before its last one, or a time.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline's windows, each by a distribution learned from the other periods; NaN where a
        window has too few records.
    threshold_, offset_ : float
        A damage index above the threshold is an alarm; ``decision_function`` is ``score_samples - offset_``.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of modes and, where `fit` saw a frame with such, their names.

    See Also
    --------
    MahalanobisDetector : Alarms of single records.
    skthermo.metrics.time_to_detection : How long after its onset damage is found.

    Notes
    -----
    The threshold comes from the baseline's own windows, each evaluated by the other periods
    (:doc:`/guide/detectors_theory`). For days to come, let the compensator predict its baseline forward in time:
    ``TemperatureCompensator(..., cv=TimeSeriesSplit(5))``.

    Windows with gaps are evaluated by the records that are there. Windows with fewer records with a value than
    ``fewest_`` are not evaluated: their index is NaN, and ``predict`` gives 0. So it is with the first windows of a
    series: a call does not remember the records of the last one.

    Examples
    --------
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector, WindowedAlarm
    >>> healthy = make_truss_campaign(3, random_state=0).frequencies
    >>> damaged = make_truss_campaign(damage={"top": 0.1}, random_state=1).frequencies
    >>> single, week = MahalanobisDetector().fit(healthy), WindowedAlarm(7).fit(healthy)
    >>> shares = [(one.damage_index(damaged) > one.threshold_).mean() for one in (single, week)]
    >>> print("{:.0%} alarms by records, {:.0%} by weeks".format(*shares))
    11% alarms by records, 66% by weeks
    """

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

    @property
    def lookback_(self) -> int | np.timedelta64:
        """How far back a window looks: a number of rows before its last one, or a time."""
        check_is_fitted(self)
        return pd.Timedelta(self.window).to_timedelta64() if isinstance(self.window, str) else self.window - 1

    def _records(self, X: Any, F: Array) -> Windows:
        if self.m is not None and self.rule != "m-of-n":
            raise ValueError(f"m is {self.m}, but rule is {self.rule!r}; expected m only with the rule 'm-of-n'")
        return Windows.of(X, F, self.window)

    def _learn(self, windows: Windows, times: Array) -> Array:
        check_not_empty(windows.rows)
        n_rows, width = len(windows.rows), windows.longest
        if n_rows < 2 * width:
            raise ValueError(
                f"the baseline has {n_rows} rows, and windows hold up to {width} records; expected at least twice as "
                "many rows"
            )
        n_periods = int(np.clip(n_rows // (2 * width), 2, MOST_PERIODS))
        baseline, index = Neighbourhoods(times, windows.rows), np.empty(n_rows)
        for _, fold in KFold(n_periods).split(windows.rows):
            law = self._law(windows, baseline.away_from(np.isin(np.arange(n_rows), fold)))
            index[fold] = _index_of_run(law, windows, fold[0], fold[-1] + 1)
        self.law_, self.width_ = self._law(windows, np.arange(n_rows)), width
        self.fewest_ = int(np.ceil(np.median(windows.n_known) / 2))
        return np.where(windows.n_known < self.fewest_, np.nan, index)

    def _law(self, windows: Windows, rows: NDArray[np.intp]) -> MeanLaw | CountLaw:
        """The distribution learned from the records in some rows."""
        if self.rule == "mean":
            return MeanLaw.of(windows, rows)
        return CountLaw.of(windows, rows, self.contamination, self.m)

    def _limit(self, index: Array) -> float:
        is_high = np.where(np.isnan(index), np.nan, index > np.nanquantile(index, 1 - self.contamination))
        # Few high windows hardly tell how long they last, but those within half a window of each other share records.
        time = max(correlation_time(is_high), self.width_ / 2)
        return conformal_threshold(index, self.contamination, 1 / time, "windows")

    def _index(self, windows: Windows) -> Array:
        index = np.concatenate([_index_of_run(self.law_, windows, run.start, run.stop) for run in windows.runs()])
        return np.where(windows.n_known < self.fewest_, np.nan, index)

    def _own_index(self, windows: Windows) -> Array:
        return self._index(windows)

    def _seen_at(self, threshold: float) -> str:
        return f". It sees shifts of the mean of a window of {threshold:.2g} of its standard deviations"

    def _cause(self, X: Any, rows: NDArray[np.bool_]) -> str:
        return (
            f"their windows hold fewer than {self.fewest_} records with a value, half as many as in the baseline; the "
            "first rows of a call need the records before them too"
        )


def _index_of_run(law: MeanLaw | CountLaw, windows: Windows, start: int, stop: int) -> Array:
    """Damage index of the windows that end in a run of records."""
    return law.index(windows.ending_in(start, stop))[start - stop :]
