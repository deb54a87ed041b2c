"""Alarms by several records in a row: by their mean, or by how many of them are far from the baseline."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from numbers import Integral
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.special import betainc, betaincinv
from scipy.stats import chi
from sklearn.base import clone
from sklearn.model_selection import KFold
from sklearn.utils.metaestimators import available_if

from skthermo._core.arrays import Array, check_probability, patterns, range_sums
from skthermo._core.estimators import Interval, StrOptions, check_is_fitted
from skthermo._core.frames import correlation_time, first_disorder
from skthermo._core.origins import Changes, Origin, with_origin
from skthermo._core.warnings import reported_by_caller, without_warnings
from skthermo.detection._base import DamageDetector, conformal_threshold
from skthermo.detection._directional import (
    Detectability,
    DirectionalDetector,
    JoinedTests,
    explained_share,
    largest_amount,
    mean_squares,
)
from skthermo.detection._mahalanobis import MahalanobisDetector, as_if_complete
from skthermo.residuals.cones import project_on_cones
from skthermo.residuals.folds import Neighbourhoods
from skthermo.residuals.gaussian import Gaussian, check_invertible, check_not_empty, whitenings
from skthermo.residuals.weather import parts

MOST_PERIODS = 50  # into which the baseline is divided; the windows of each are evaluated by the others
CLIPPED = 1.5  # standard deviations within a window beyond which a record moves the mean of the window no more
TOGETHER = 512  # windows whose values a processor keeps at hand
OF_COLUMNS = "implausible-values", "isolated-level", "equal-columns", "few-values"  # kinds of findings
SMALLEST_SIZE = 0.1  # mean square of a projection on a cone that hardly any mode shows
SMALLEST_CHANCE = 1e-50  # indices of windows that are less likely grow in proportion to those of their records


def _tests_directions(alarm: WindowedAlarm) -> bool:
    """Whether means of windows are tested against directions."""
    return alarm.rule == "mean" and isinstance(alarm.detector, DirectionalDetector)


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
    detector : MahalanobisDetector or DirectionalDetector, optional
        Unfitted; by default a `MahalanobisDetector`. With a `DirectionalDetector`, the mean of a window is tested
        against the cone of its directions, and for "m-of-n" the index of each record is its index.
    contamination : float, default=0.02
        Share of healthy windows above the threshold. Windows of later records overlap: alarms come in runs.

    Attributes
    ----------
    detector_ : DirectionalDetector or None
        Fitted to the records of the baseline; None without directions.
    tests_ : object or None
        How the test against the cone and that in any direction are joined; None without directions.
    law_ : object
        Distribution of the records, learned from the baseline, by which windows are evaluated.
    width_, fewest_ : int
        Largest number of records in a window, and fewest with a value that a window is evaluated by: half as many as a
        window of the baseline has (median).
    usual_counts_ : ndarray of shape (n_modes,)
        Mean number of records in a window that have each mode.
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
        "detector": [MahalanobisDetector, None],
    }

    def __init__(
        self,
        window: int | str,
        *,
        rule: Literal["mean", "m-of-n"] = "mean",
        m: int | None = None,
        detector: MahalanobisDetector | None = None,
        contamination: float = 0.02,
    ):
        self.window = window
        self.rule = rule
        self.m = m
        self.detector = detector
        self.contamination = contamination

    @property
    def lookback_(self) -> int | np.timedelta64:
        """How far back a window looks: a number of rows before its last one, or a time."""
        check_is_fitted(self)
        return pd.Timedelta(self.window).to_timedelta64() if isinstance(self.window, str) else self.window - 1

    def _records(self, X: Any, F: Array, is_baseline: bool = False) -> Windows:
        if self.m is not None and self.rule != "m-of-n":
            raise ValueError(f"m is {self.m}, but rule is {self.rule!r}; expected m only with the rule 'm-of-n'")
        windows = Windows.of(X, F, self.window)
        if is_baseline:
            self.detector_ = None
            if isinstance(self.detector, DirectionalDetector):
                check_not_empty(F)
                with without_warnings():  # of single records
                    self.detector_ = clone(self.detector).set_params(contamination=self.contamination).fit(X)
        return windows

    def _learn(self, windows: Windows, times: Array) -> Array:
        check_not_empty(windows.rows)
        n_rows, width = len(windows.rows), windows.longest
        if n_rows < 2 * width:
            raise ValueError(
                f"the baseline has {n_rows} rows, and windows hold up to {width} records; expected at least twice as "
                "many rows"
            )
        n_periods = int(np.clip(n_rows // (2 * width), 2, MOST_PERIODS))
        baseline, runs = Neighbourhoods(times, windows.rows), []
        for _, fold in KFold(n_periods).split(windows.rows):
            law = self._law(windows, baseline.away_from(np.isin(np.arange(n_rows), fold)))
            runs.append(_indices_of_run(law, windows, fold[0], fold[-1] + 1))
        self.law_, self.width_ = self._law(windows, np.arange(n_rows)), width
        self.fewest_ = int(np.ceil(np.median(windows.n_known) / 2))
        self.usual_counts_ = windows.sums((~np.isnan(windows.rows)).astype(float))[width - 1 :].mean(axis=0)
        indices = np.where(windows.n_known < self.fewest_, np.nan, np.concatenate(runs, axis=1))
        self.tests_ = JoinedTests.of(indices[1], indices[0], self.detector_.omnibus) if len(indices) > 1 else None
        return self._joined(indices)

    def _joined(self, indices: Array) -> Array:
        return indices[0] if self.tests_ is None else self.tests_(indices[1], indices[0])

    def _law(self, windows: Windows, rows: NDArray[np.intp]) -> MeanLaw | CountLaw:
        """The distribution learned from the records in some rows."""
        directional, effects, changes = self.detector_, None, None
        if directional is not None:
            changes = directional.typical_changes_
            effects = changes @ directional.directions_.to_numpy().T
        if self.rule == "mean":
            return MeanLaw.of(windows, rows, effects)
        detector = MahalanobisDetector() if self.detector is None else clone(self.detector)
        return CountLaw.of(windows, rows, detector.set_params(contamination=self.contamination), self.m, changes)

    def _limit(self, index: Array) -> float:
        is_high = np.where(np.isnan(index), np.nan, index > np.nanquantile(index, 1 - self.contamination))
        # Few high windows hardly tell how long they last, but those within half a window of each other share records.
        time = max(correlation_time(is_high), self.width_ / 2)
        return conformal_threshold(index, self.contamination, 1 / time, "windows")

    def _index(self, windows: Windows) -> Array:
        runs = [_indices_of_run(self.law_, windows, run.start, run.stop) for run in windows.runs()]
        return self._joined(np.where(windows.n_known < self.fewest_, np.nan, np.concatenate(runs, axis=1)))

    def _seen_at(self, threshold: float) -> str:
        return f". It sees shifts of the mean of a window of {threshold:.2g} of its standard deviations"

    @available_if(_tests_directions)
    def severities(self, X: ArrayLike) -> pd.DataFrame:
        """Losses by which the mean of each window is explained, as `DirectionalDetector.severities` of records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Records in order of time, in the columns of `fit`.

        Returns
        -------
        DataFrame of shape (n_samples, n_directions)
            Of the window that ends with each record; NaN where none of its records has a mode.
        """
        directional, index = self.detector_, X.index if isinstance(X, pd.DataFrame) else None
        limited = np.minimum(self._explained(X)[0], largest_amount(directional.directions))
        return pd.DataFrame(limited, index, directional.directions_.index)

    @available_if(_tests_directions)
    def explained(self, X: ArrayLike) -> Array:
        """Share of the departure of each window that the directions explain, as `DirectionalDetector.explained`.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Records in order of time, in the columns of `fit`.

        Returns
        -------
        ndarray of shape (n_samples,)
            Of the squared distance of the mean of the window that ends with each record, from 0 to 1.
        """
        return self._explained(X)[1]

    @available_if(_tests_directions)
    def pod(self, severities: ArrayLike) -> pd.DataFrame:
        """Probability of detection of full windows by the rule "mean", as `DirectionalDetector.pod` of records.

        Parameters
        ----------
        severities : array-like of shape (n_severities,)
            Amounts of each direction: losses of stiffness of each group, from 0 to 1.

        Returns
        -------
        DataFrame of shape (n_severities, n_directions)
            Share of windows above the threshold, all of whose records have the loss.
        """
        return self._detectability().pod(severities)

    @available_if(_tests_directions)
    def minimum_detectable_damage(self, level: float = 0.9) -> pd.Series:
        """Smallest amount of each direction that a share of full windows finds, by the rule "mean".

        Parameters
        ----------
        level : float, default=0.9
            That share, between 0 and 1.

        Returns
        -------
        Series of shape (n_directions,)
            Loss of stiffness by group, infinite where not even a whole loss is found.
        """
        return self._detectability().smallest(check_probability(level, "level"))

    def _explained(self, X: ArrayLike) -> tuple[Array, Array]:
        check_is_fitted(self)
        windows = self._records(X, self._validated(X, reset=False, order="C"))
        parts = [self.law_.explained(windows.ending_in(run.start, run.stop)) for run in windows.runs()]
        lengths = [run.start - run.stop for run in windows.runs()]
        amounts, shares = zip(*([one[n:] for one in part] for n, part in zip(lengths, parts, strict=True)), strict=True)
        return np.concatenate(amounts), np.concatenate(shares)

    def _detectability(self) -> Detectability:
        check_is_fitted(self)
        deviations = self.law_.deviations(self.usual_counts_)
        white = self.law_.white_effects / deviations[:, np.newaxis]
        names, largest = list(self.detector_.directions_.index), largest_amount(self.detector_.directions)
        return Detectability(self.tests_, white, names, self.threshold_, largest)

    def _cause(self, X: Any, rows: NDArray[np.bool_]) -> str:
        return (
            f"their windows hold fewer than {self.fewest_} records with a value, half as many as in the baseline; the "
            "first rows of a call need the records before them too"
        )


def _indices_of_run(law: MeanLaw | CountLaw, windows: Windows, start: int, stop: int) -> Array:
    """Damage indices of the windows that end in a run of records, (n_tests, n_windows)."""
    return law.indices(windows.ending_in(start, stop))[:, start - stop :]


@dataclass(frozen=True)
class MeanLaw:
    """Length of the robust mean of whitened records, over the standard deviation of their mean.

    This grows with the mean ``correlation`` of two whitened records in one window, mode by mode. With ``effects`` of
    some directions on the columns, (n_columns, n_directions), there is also the length of its projection on their cone.
    """

    records: Gaussian
    correlation: Array
    effects: Array | None = None

    @classmethod
    def of(cls, windows: Windows, rows: NDArray[np.intp], effects: Array | None = None) -> MeanLaw:
        """Learned from the records in some rows, and from the windows that end there."""
        records = Gaussian.of(windows.rows[rows])
        check_invertible(records.covariance, windows.rows[rows])
        white = records.whiten(windows.rows)
        sums, counts = windows.sums(np.nan_to_num(white)), windows.sums((~np.isnan(white)).astype(float))
        squares = windows.sums(np.nan_to_num(white) ** 2)
        excess, pairs = (sums**2 - squares)[rows].sum(axis=0), (counts**2 - counts)[rows].sum(axis=0)
        return cls(records, np.clip(excess / np.maximum(pairs, 1), 0.0, 1.0), effects)

    def indices(self, windows: Windows) -> Array:
        """Damage indices of every window, (n_tests, n_windows), the omnibus first; NaN where no record has a mode."""
        standard, counts = self._means(windows)
        present, n_modes = counts > 0, standard.shape[1]
        omnibus = as_if_complete(np.linalg.norm(standard, axis=1), present.sum(axis=1), n_modes)
        if self.effects is None:
            return omnibus[np.newaxis]
        lengths, (masks, mask) = self._projected(standard, counts)[1], patterns(present)
        if not masks.all():
            whole, *sizes = mean_squares(np.vstack([np.ones(n_modes), masks])[:, :, np.newaxis] * self.white_effects)
            lengths = as_if_complete(lengths, np.maximum(sizes, SMALLEST_SIZE)[mask], whole)
        return np.stack([omnibus, np.where(present.any(axis=1), lengths, np.nan)])

    def explained(self, windows: Windows) -> tuple[Array, Array]:
        """Amounts of the directions in every window, and the share of its departure that they explain."""
        standard, counts = self._means(windows)
        amounts, lengths = self._projected(standard, counts)
        amounts[(counts == 0).all(axis=1)] = np.nan
        return amounts, explained_share(lengths, np.linalg.norm(standard, axis=1))

    def _means(self, windows: Windows) -> tuple[Array, Array]:
        """Robust means of whitened records in standard deviations, 0 without any, and how many have each mode."""
        white = self.records.whiten(windows.rows)
        counts, limits = windows.sums((~np.isnan(white)).astype(float)), CLIPPED * np.sqrt(1 - self.correlation)
        columns = zip(white.T, limits, strict=True)
        means = np.column_stack([robust_means(windows.inside(column), limit) for column, limit in columns])
        return np.where(counts > 0, means / self.deviations(counts), 0.0), counts

    def _projected(self, standard: Array, counts: Array) -> tuple[Array, Array]:
        """Amounts of the directions, and length of the projection on their cone."""
        weights = np.where(counts > 0, 1 / self.deviations(counts), 0.0)
        cases, case = np.unique(weights, axis=0, return_inverse=True)
        effects = cases[:, :, np.newaxis] * self.white_effects
        along = np.einsum("ij,ijk->ik", standard, effects[case])
        return project_on_cones(effects.swapaxes(1, 2) @ effects, along, case)

    def deviations(self, counts: Array) -> Array:
        """Standard deviations of the means of so many whitened records of each mode."""
        return np.sqrt(self.correlation + (1 - self.correlation) / np.maximum(counts, 1))

    @property
    def white_effects(self) -> Array:
        """Whitened effects of the directions, (n_modes, n_directions)."""
        complete = np.ones((1, len(self.correlation)), dtype=bool)
        return whitenings(self.records.covariance[np.newaxis], complete)[0][0] @ self.effects


def robust_means(rows: Array, limit: float) -> Array:
    """Mean of each row, of which no value counts as farther from the median than a limit; NaN left out.

    Moving all values moves it as far, and moving any of them never moves it the other way.
    """
    means = np.empty(len(rows))
    for start in range(0, len(rows), TOGETHER):
        some = rows[start : start + TOGETHER]
        counts, moves = (~np.isnan(some)).sum(axis=1), np.sort(some, axis=1)
        middle = np.maximum([counts - 1, counts], 0) // 2
        medians = np.take_along_axis(moves, middle.T, axis=1).mean(axis=1, keepdims=True)
        np.subtract(some, medians, out=moves)
        np.maximum(np.minimum(moves, limit, out=moves), -limit, out=moves)
        np.copyto(moves, 0.0, where=np.isnan(moves))
        means[start : start + TOGETHER] = medians[:, 0] + moves.sum(axis=1) / np.maximum(counts, 1)
    return means


@dataclass(frozen=True)
class CountLaw:
    """The m-th largest damage index of the n records in a window: it exceeds a threshold where m records do.

    In a window with gaps, the index is the one that is as unlikely in a full window of independent records, by the
    binomial law.
    """

    detector: MahalanobisDetector
    n: int
    m: int
    changes: Array | None = None

    @classmethod
    def of(
        cls,
        windows: Windows,
        rows: NDArray[np.intp],
        detector: MahalanobisDetector,
        m: int | None,
        changes: Array | None = None,
    ) -> CountLaw:
        """Learned from the records in some rows by an unfitted detector, which may need to know what changes make of
        them."""
        with reported_by_caller(OF_COLUMNS):  # the whole baseline has been checked
            detector.set_params(threshold="quantile").fit(_known(windows.rows[rows], changes))
        n = int(np.median(windows.sizes))
        if m is not None and m > n:
            raise ValueError(f"m is {m}, but windows hold {n} records; expected at most as many")
        return cls(detector, n, (n + 1) // 2 if m is None else m, changes)

    def indices(self, windows: Windows) -> Array:
        """Damage index of every window, (1, n_windows); NaN where no record has a mode."""
        with without_warnings():  # the alarm counts windows that are not evaluated
            single = self.detector.damage_index(_known(windows.rows, self.changes))
        return self._as_if_full(windows.inside(single), windows.rows.shape[1])[np.newaxis]

    def _as_if_full(self, single: Array, n_modes: int) -> Array:
        """The m-th largest index of each row, m in proportion to the records that are there."""
        count = (~np.isnan(single)).sum(axis=1)
        m = np.maximum(np.rint(self.m * count / self.n), 1).astype(int)
        value = -np.take_along_axis(np.sort(-single, axis=1), np.minimum(m, single.shape[1])[:, np.newaxis] - 1, axis=1)
        value, partial = value[:, 0], (count != self.n) & (count > 0)
        value[partial] = self._equally_likely(value[partial], m[partial], count[partial], n_modes)
        return value

    def _equally_likely(self, value: Array, m: NDArray[np.intp], count: NDArray[np.intp], n_modes: int) -> Array:
        """Indices in a full window that are as unlikely as these, the m-th of ``count``."""
        farthest = chi.isf(betaincinv(m, count - m + 1, SMALLEST_CHANCE), n_modes)
        chance = betainc(m, count - m + 1, chi.sf(np.minimum(value, farthest), n_modes))
        full = chi.isf(betaincinv(self.m, self.n - self.m + 1, np.maximum(chance, SMALLEST_CHANCE)), n_modes)
        return np.maximum(value / farthest, 1.0) * full


def _known(rows: Array, matrix: Array | None) -> Array:
    """A copy of some rows, of which a detector knows what relative changes of the frequencies make of them."""
    rows = rows.copy()
    if matrix is None:
        return rows
    return with_origin(rows, Origin(partial(np.zeros, len(rows)), partial(Changes.of_all, matrix, len(rows))))


@dataclass(frozen=True)
class Windows:
    """Records in order of time, and the first record of the window that ends with each."""

    rows: Array
    first: NDArray[np.intp]

    @classmethod
    def of(cls, X: Any, rows: Array, window: int | str) -> Windows:
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
        return range_sums(values, self.first, np.arange(len(values)) + 1)

    def inside(self, values: Array) -> Array:
        """The value of each record in every window, (n_rows, longest), in order of time after NaN in shorter ones."""
        padded = np.concatenate([np.full(self.longest - 1, np.nan), values])
        last = np.lib.stride_tricks.sliding_window_view(padded, self.longest)
        return np.where(np.arange(self.longest) >= self.longest - self.sizes[:, np.newaxis], last, np.nan)

    def ending_in(self, start: int, stop: int) -> Windows:
        """The windows that end in a run of records, after those of the records before it that they need."""
        before = self.first[start]
        return Windows(self.rows[before:stop], np.maximum(self.first[before:stop] - before, 0))

    def runs(self) -> Iterator[slice]:
        """Runs of records whose windows fit into memory."""
        return parts(len(self.rows), self.longest)

    @cached_property
    def n_known(self) -> NDArray[np.intp]:
        """Number of records with a value in every window."""
        return self.sums((~np.isnan(self.rows)).any(axis=1).astype(np.intp))

    @property
    def sizes(self) -> NDArray[np.intp]:
        """Number of records in every window."""
        return np.arange(len(self.rows)) - self.first + 1

    @property
    def longest(self) -> int:
        """Largest number of records in a window."""
        return int(self.sizes.max())
