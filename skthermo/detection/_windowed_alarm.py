"""Alarms raised by several records in a row."""

from numbers import Integral
from typing import Any, Literal

import numpy as np
from sklearn.model_selection import KFold

from skthermo._arrays import Array
from skthermo._validation import Interval, StrOptions
from skthermo._weather import correlation_time
from skthermo.detection._base import DamageDetector
from skthermo.detection._gaussian import check_not_empty
from skthermo.detection._thresholds import conformal_threshold
from skthermo.detection._window_laws import CountLaw, MeanLaw, SumLaw
from skthermo.detection._windows import FadingWindows, Windows

LAWS = {"mean": MeanLaw, "ewma": MeanLaw, "cusum": SumLaw, "m-of-n": CountLaw}

MOST_PERIODS = 50
"""Largest number of periods of the baseline whose windows are judged by what the others teach."""


class WindowedAlarm(DamageDetector):
    """Alarm where the last records together are far from a healthy baseline.

    Records have to be in order of time, and are best whitened: residuals of
    ``TemperatureCompensator(..., scale="local")``.

    Parameters
    ----------
    window : int or str
        Number of records, up to the one that is judged, or a time such as ``"24h"`` on the ``DatetimeIndex`` of a
        frame. With gaps in time, a number of records reaches back beyond them; a time does not.
    rule : {"mean", "ewma", "cusum", "m-of-n"}, default="mean"
        What the damage index of a window is:

        - ``"mean"``: length of the mean of the whitened records, in standard deviations of such a mean. Finds small
          lasting changes.
        - ``"ewma"``: the same of an exponentially weighted mean of all records so far, whose weights have the mean age
          of those of the window. Finds medium and large changes some 20 % sooner; remembers an absurd record longer.
        - ``"cusum"``: length of the cumulative sum of the whitened records, which shrinks with each by half of the
          change that the mean of a window would just find. Finds medium lasting changes in several times as many
          records, if residuals are steady in time; its alarms outlast their cause.
        - ``"m-of-n"``: the m-th largest damage index of the n records (unsquared Mahalanobis distances), so that
          there is an alarm where m of them exceed the threshold. Not misled by a few absurd records.

    m : int, optional
        Number of records of a full window that have to exceed the threshold; by default half of them. For
        ``rule="m-of-n"``.
    contamination : float, default=0.02
        Share of healthy windows above the threshold. Windows of later records overlap: alarms come in runs.

    Attributes
    ----------
    law_ : object
        What the baseline teaches about windows.
    width_ : int
        Largest number of records in a window.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline's windows, each judged by what other periods teach.
    threshold_ : float
        A damage index above it is an alarm.
    offset_ : float
        ``-threshold_``, so that ``decision_function`` is ``score_samples - offset_``.
    n_features_in_ : int
        Number of modes.
    feature_names_in_ : ndarray of str
        Names of the modes, where `fit` saw a frame with such names.

    See Also
    --------
    MahalanobisDetector : Alarms of single records.
    skthermo.metrics.time_to_detection : How long after its onset damage is found.

    Notes
    -----
    Residuals of neighbouring records are alike, so that the mean of 24 of them scatters more than one fifth of a
    single one. The standard deviation of a mean therefore includes the mean correlation of two records in one window,
    mode by mode, and the threshold comes from the baseline's own windows. Every window is judged by what other
    periods of the baseline teach, and the number of independent windows, by the correlation time of the baseline's
    highest ones, decides which of their indices is the threshold. If there are too few for the rate, the threshold
    is the largest index, and a warning says so. With thresholds for days to come in mind, let the compensator predict
    its baseline forward in time: ``TemperatureCompensator(..., cv=TimeSeriesSplit(5))``.

    Windows with gaps are judged by the records that are there. Under "m-of-n", their index is the one that would be
    as unlikely in a full window of independent records, by the binomial law. The first windows of a series are
    shorter than the others: a call does not remember the records of the last one.

    References
    ----------
    Crosier, Multivariate generalizations of cumulative sum quality-control schemes, Technometrics 30 (1988) 291-303
    [Cro88]_, for "cusum".

    Examples
    --------
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector, WindowedAlarm
    >>> healthy = make_truss_campaign(3, random_state=0).frequencies
    >>> damaged = make_truss_campaign(damage={"top": 0.1}, random_state=1).frequencies
    >>> single, week = MahalanobisDetector().fit(healthy), WindowedAlarm(7).fit(healthy)
    >>> print(f"{(single.predict(damaged) == -1).mean():.0%}, {(week.predict(damaged) == -1).mean():.0%} alarms")
    11%, 70% alarms
    """

    _parameter_constraints: dict = {
        **DamageDetector._parameter_constraints,
        "window": [Interval(Integral, 1, None, closed="left"), str],
        "rule": [StrOptions(set(LAWS))],
        "m": [Interval(Integral, 1, None, closed="left"), None],
    }

    def __init__(
        self,
        window: int | str,
        *,
        rule: Literal["mean", "ewma", "cusum", "m-of-n"] = "mean",
        m: int | None = None,
        contamination: float = 0.02,
    ):
        self.window = window
        self.rule = rule
        self.m = m
        self.contamination = contamination

    def _records(self, X: Any, F: Array) -> Windows | FadingWindows:
        if self.m is not None and self.rule != "m-of-n":
            raise ValueError(f"m is {self.m}, but rule is {self.rule!r}; expected m only with the rule 'm-of-n'")
        if self.rule in ("ewma", "cusum") and isinstance(self.window, str):
            raise ValueError(
                f"window is {self.window!r} and rule {self.rule!r}; expected a number of records with this rule"
            )
        return FadingWindows.of(F, self.window) if self.rule == "ewma" else Windows.of(X, F, self.window)

    def _learn(self, windows: Windows | FadingWindows) -> Array:
        n_rows, index = len(windows.rows), np.full(len(windows.rows), np.nan)
        law = LAWS[self.rule]
        check_not_empty(windows.rows)
        width = self.width_ = self.window if self.rule == "ewma" else windows.longest
        if n_rows < 2 * width:
            raise ValueError(
                f"the baseline has {n_rows} rows, and windows hold up to {width} records; expected at least twice as "
                "many rows"
            )
        n_periods = int(np.clip(n_rows // (2 * width), 2, MOST_PERIODS))
        for rest, fold in KFold(n_periods).split(windows.rows):
            index[fold] = law.of(windows, rest, self.contamination, self.m).index(windows)[fold]
        self.law_ = law.of(windows, np.arange(n_rows), self.contamination, self.m)
        return index

    def _limit(self, index: Array) -> float:
        is_high = np.where(np.isnan(index), np.nan, index > np.nanquantile(index, 1 - self.contamination))
        # Few high windows hardly tell how long they last: neighbours within half a window, or a sum's, are not trusted.
        time = max(correlation_time(is_high), self.width_ if self.rule == "cusum" else self.width_ / 2)
        return conformal_threshold(index, self.contamination, 1 / time, "windows")

    def _index(self, windows: Windows | FadingWindows) -> Array:
        if self.rule == "cusum":
            return self.law_.index(windows)
        index = np.empty(len(windows.rows))
        for run, piece in windows.pieces():
            index[run] = self.law_.index(piece)[run.start - run.stop :]
        return index
