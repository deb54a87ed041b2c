"""Damage index and alarm by Mahalanobis distance, which means the same whichever modes a record has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import scipy  # which loads scipy.signal once it is used
from numpy.typing import NDArray
from scipy.stats import chi2
from sklearn.base import BaseEstimator, clone
from sklearn.covariance import EmpiricalCovariance

from skthermo._core.arrays import Array, patterns
from skthermo._core.estimators import HasMethods, StrOptions
from skthermo._core.warnings import warn_user, without_warnings
from skthermo.detection._base import DamageDetector, conformal_threshold
from skthermo.exceptions import FewRecordsWarning
from skthermo.residuals.folds import Neighbourhoods
from skthermo.residuals.gaussian import Gaussian, Mask, check_invertible, check_not_empty, modes_text

ROWS_AT_ONCE = 20_000  # whose distances are computed, which bounds memory
N_SIMULATED, MOST_SIMULATED, N_NEW, START = 200, 400, 50, 200
"""Number of simulated baselines, most records of each, new records that each evaluates, records before the first."""
N_FOLDS = 10  # of the baseline, whose distances come from the others where there is no closed form
CHANCE = 0.95  # groups of rows get factors only if they differ by more than chance would with this probability
PATTERN_SHARE = 0.1  # of a pattern's rows above the level that gives its factor; alarms alone are too few for that
FEWEST_ROWS = 50  # of a group that gets a factor of its own


class MahalanobisDetector(DamageDetector):
    """Alarm where frequencies, or their residuals, are far from a healthy baseline.

    The damage index is the *unsquared* Mahalanobis distance, eq. (20) of [KCM26]_, DI = sqrt((f - mu) Sigma^-1 (f -
    mu)^T), in the modes that a record has.

    Parameters
    ----------
    contamination : float, default=0.02
        Share of healthy records above the threshold.
    covariance : covariance estimator, optional
        Any of scikit-learn's, such as ``LedoitWolf()`` for few records or ``MinCovDet()`` for a baseline with outliers;
        it is fitted on complete rows. By default the most likely covariance of all rows, by accelerated expectation
        maximisation [VR08]_ where modes are missing.
    threshold : {"conformal", "quantile", "chi2"}, default="conformal"
        How the threshold is set:

        - ``"conformal"``: the ceil((n + 1)(1 - contamination))-th smallest of the distances that each of the n baseline
          records has from the others, those left out that are within two correlation times of it. New records that are
          as the baseline's (neither season nor trend) exceed it at about the rate asked for or less, however they are
          distributed, and also where records depend on those just before them. Where the neighbours to be left out are
          more than a fifth of a complete baseline, the distances are its own, times a factor.
        - ``"quantile"``: the (1 - contamination) quantile of the baseline's own distances, as in the paper. Distances
          of the records that a covariance was fitted on are too small: 100 records of 6 modes give 5 % false alarms
          where 2 % are asked for.
        - ``"chi2"``: the distance that normally distributed records exceed at that rate. Real residuals are not normal
          and exceed it some two to seven times as often (two to three times on the Z24 bridge).

    Attributes
    ----------
    covariance_ : estimator
        Fitted: mean (``location_``) and covariance of the baseline.
    pattern_scale_ : object
        Factors for patterns of missing modes.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline; with the conformal threshold, each record's distance from the others.
    n_independent_ : float
        How many independent records the baseline counts as: its number of records over their correlation time.
    threshold_, offset_ : float
        A damage index above the threshold is an alarm; ``decision_function`` is ``score_samples - offset_``.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of modes and, where `fit` saw a frame with such, their names.

    See Also
    --------
    OutlierDetector : Any of scikit-learn's outlier detectors, for a baseline that is not normally distributed.
    WindowedAlarm : Alarms by several records in a row.

    Notes
    -----
    `fit` refuses a baseline whose covariance is singular: one with too few rows, a constant mode, or a mode that is a
    combination of others. The units of the modes do not matter, unless ``covariance`` depends on them.

    A record with missing modes gets the distance in those that it has, expressed as the distance in all modes that a
    normally distributed record exceeds as often [WH31]_. Rows without any mode cannot be evaluated: their index is NaN,
    and ``predict`` gives 0. :doc:`/guide/detectors_theory` says how correlation times, thresholds and such distances
    are found, and what false alarms they give.

    Examples
    --------
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector
    >>> healthy = make_truss_campaign(random_state=0).frequencies
    >>> damaged = make_truss_campaign(damage={"bottom": 0.3}, random_state=1).frequencies
    >>> detector = MahalanobisDetector().fit(healthy)
    >>> float((detector.predict(damaged) == -1).mean())
    1.0
    """

    _parameter_constraints: dict = {
        **DamageDetector._parameter_constraints,
        "covariance": [HasMethods(["fit", "mahalanobis"]), None],
        "threshold": [StrOptions({"quantile", "conformal", "chi2"})],
    }

    def __init__(
        self,
        contamination: float = 0.02,
        *,
        covariance: BaseEstimator | None = None,
        threshold: Literal["quantile", "conformal", "chi2"] = "conformal",
    ):
        self.contamination = contamination
        self.covariance = covariance
        self.threshold = threshold

    def _learn(self, F: Array, times: Array) -> Array:
        present, baseline = ~np.isnan(F), Neighbourhoods(times, F)
        names = getattr(self, "feature_names_in_", None)
        self.covariance_ = (
            _most_likely(F, names) if self.covariance is None else _fit_complete(self.covariance, F, names)
        )
        self.n_independent_ = baseline.n_independent
        distances = self._as_if_new(baseline) if self.threshold == "conformal" else self._distances(F)
        index = as_if_complete(distances, present.sum(axis=1), F.shape[1])
        self.pattern_scale_ = PatternScale.of(index, present, self.contamination)
        return index * self.pattern_scale_(present)

    def _limit(self, index: Array) -> float:
        if self.threshold == "chi2":
            return float(np.sqrt(chi2.isf(self.contamination, self.n_features_in_)))
        if self.threshold == "quantile":
            return float(np.nanquantile(index, 1 - self.contamination))
        return conformal_threshold(index, self.contamination, n_independent=self.n_independent_)

    def _index(self, F: Array) -> Array:
        index = np.empty(len(F))
        for start in range(0, len(F), ROWS_AT_ONCE):
            rows = F[start : start + ROWS_AT_ONCE]
            distances, present = self._distances(rows), ~np.isnan(rows)
            if not present.all():
                distances = as_if_complete(distances, present.sum(axis=1), F.shape[1]) * self.pattern_scale_(present)
            index[start : start + ROWS_AT_ONCE] = distances
        return index

    def _seen_at(self, threshold: float) -> str:
        single = 1 / np.sqrt(np.diag(np.linalg.inv(self.covariance_.covariance_)))
        smallest = np.sqrt(max(threshold**2 - self.n_features_in_, 0.0)) * single
        sizes = ", ".join(f"{size:.2g}" for size in smallest)
        return f". Half of the records of a shift of one mode alone raise an alarm if it is {sizes} (mode by mode)"

    def _has_likelihood(self) -> bool:
        return True

    def _log_densities(self, F: Array) -> Array:
        return self._normal.log_densities(F)

    def _distances(self, F: Array) -> Array:
        """Distances of rows in the modes that they have; NaN where there is none."""
        if self.covariance is not None and not np.isnan(F).any():
            return np.sqrt(self.covariance_.mahalanobis(F))
        return self._normal.distances(F)

    def _as_if_new(self, baseline: Neighbourhoods) -> Array:
        """Distances of baseline rows from the others, as large as those of new records."""
        records = baseline.records
        distances, complete = self._distances(records), ~np.isnan(records).any(axis=1)
        if self.covariance is None and complete.all():
            if not baseline.is_short:
                return baseline.distances(self._normal)
            time = round(baseline.correlation_time, 2)
            return distances * factor_of_few(*records.shape, time, self.contamination)
        known = complete if self.covariance is not None else ~np.isnan(records).all(axis=1)
        some = Neighbourhoods(baseline.times[known], records[known])
        if self.covariance is not None:
            distances[known] = some.out_of_fold(N_FOLDS, self._distances_from)
        elif complete[known].all():
            distances[known] = some.distances(self._normal)
        else:
            with without_warnings():  # which the fit on all rows has given
                distances[known] = some.out_of_fold(N_FOLDS, _distances_from)
        return distances

    @property
    def _normal(self) -> Gaussian:
        """The baseline's normal distribution."""
        return Gaussian(self.covariance_.location_, self.covariance_.covariance_)

    def _distances_from(self, others: Array, rows: Array) -> Array:
        """Distances of complete rows from others, by a covariance estimator."""
        return np.sqrt(clone(self.covariance).fit(others).mahalanobis(rows))


def _most_likely(F: Array, names: Sequence[str] | None) -> EmpiricalCovariance:
    """Mean and covariance of rows with or without gaps."""
    check_not_empty(F, names)
    together = ~np.isnan(F).T @ ~np.isnan(F)
    if not together.all():
        pair = np.isin(np.arange(F.shape[1]), np.argwhere(~together)[0])
        warn_user(
            f"{modes_text(pair, names)} never have a value in the same row ({(~together).sum() // 2} such pairs). "
            "Their correlation is inferred from the other modes. Leave one of them out, or give records with both",
            FewRecordsWarning,
            "modes-never-together",
        )
    learned = Gaussian.of(F)
    scale = check_invertible(learned.covariance, F, names=names)
    fitted = EmpiricalCovariance()
    fitted.location_, fitted.covariance_, fitted.n_features_in_ = learned.mean, learned.covariance, F.shape[1]
    fitted.precision_ = np.linalg.inv(learned.covariance / np.outer(scale, scale)) / np.outer(scale, scale)
    return fitted


def _distances_from(others: Array, rows: Array) -> Array:
    """Distances of rows from others, in the modes that they have; infinite if the others do not determine them."""
    if np.isnan(others).all(axis=0).any():
        return np.full(len(rows), np.inf)
    learned = Gaussian.of(others)
    try:
        check_invertible(learned.covariance, others)
    except ValueError:
        return np.full(len(rows), np.inf)
    return learned.distances(rows)


def _fit_complete(covariance: BaseEstimator, F: Array, names: Sequence[str] | None) -> BaseEstimator:
    """A clone of a covariance estimator, which takes only complete rows."""
    complete = F[~np.isnan(F).any(axis=1)]
    if len(complete) < 2:
        raise ValueError(
            f"{len(complete)} of {len(F)} rows have every mode; expected at least 2 for the covariance "
            f"{covariance!r} (covariance=None takes rows with gaps)"
        )
    fitted = clone(covariance).fit(complete)
    check_invertible(fitted.covariance_, complete, names=names)
    return fitted


@lru_cache
def factor_of_few(n_records: int, n_modes: int, correlation_time: float, contamination: float) -> float:
    """What the indices of a short, dependent baseline are multiplied by, so that they are as those of new records.

    Normally distributed baselines of so many records and modes are drawn, in which each mode is an autoregression of
    first order with the given correlation time. It is the ratio of the distance that new, independent records exceed
    at the rate asked for, on the mean over such baselines, to that which as many of a baseline's own records exceed.
    """
    n_drawn = min(n_records, MOST_SIMULATED)  # longer steps stand for a long baseline
    memory = ((correlation_time - 1) / (correlation_time + 1)) ** (n_records / n_drawn)
    rate, random = max(contamination, 1 / (n_records + 1)), np.random.RandomState(0)
    shocks = random.standard_normal((N_SIMULATED, START + n_drawn, n_modes))
    rows = scipy.signal.lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], shocks, axis=1)[:, START:]
    mean = rows.mean(axis=1, keepdims=True)
    precision = np.linalg.inv(np.einsum("rij,rik->rjk", rows - mean, rows - mean) / n_drawn)
    new = random.standard_normal((N_SIMULATED, N_NEW, n_modes))
    own, later = (
        np.sqrt(np.einsum("rij,rjk,rik->ri", some - mean, precision, some - mean, optimize=True))
        for some in (rows, new)
    )
    return float(np.quantile(later / np.quantile(own, 1 - rate, axis=1)[:, np.newaxis], 1 - rate))


def as_if_complete(distances: Array, n_present: Array, n_modes: int) -> Array:
    """Distance in ``n_modes`` dimensions that a normal record exceeds as often as its own in ``n_present``.

    By the approximation of Wilson and Hilferty: the cube root of a chi-square number is nearly normal.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        here, there = 2 / (9 * n_present), 2 / (9 * n_modes)
        normal = (np.cbrt(distances**2 / n_present) - (1 - here)) / np.sqrt(here)
        squared = n_modes * (1 - there + normal * np.sqrt(there)) ** 3
        mapped = np.sqrt(squared)
    return np.where(n_present == n_modes, distances, np.where(n_present == 0, np.nan, mapped))


@dataclass(frozen=True)
class PatternScale:
    """Factors that make the indices of every pattern of missing modes exceed one threshold equally often.

    A pattern's factor is that of all rows with as many modes, at the threshold, times its own, at the highest tenth of
    its rows. Both are drawn to 1 as far as groups differ no more than by chance. Complete rows have the factor 1.
    """

    by_number: Array
    masks: Mask
    by_pattern: Array

    @classmethod
    def of(cls, index: Array, present: Mask, contamination: float) -> PatternScale:
        """Learned from the indices of a baseline."""
        known = np.isfinite(index)
        index, present = index[known], present[known]
        by_number = _factors(index, present.sum(axis=1), present.shape[1] + 1, contamination, trend=True)
        masks, of_row = patterns(present)
        by_pattern = _factors(
            index * by_number[present.sum(axis=1)], of_row, len(masks), max(contamination, PATTERN_SHARE)
        )
        scale = cls(by_number, masks, by_pattern)
        complete = scale(np.ones((1, present.shape[1]), dtype=bool))[0]
        return cls(by_number / complete, masks, by_pattern)

    def __call__(self, present: Mask) -> Array:
        """Factors of rows, by which of their modes are there."""
        masks, of_row = patterns(present)
        same = (masks[:, np.newaxis] == self.masks).all(axis=2)
        factors = self.by_number[masks.sum(axis=1)] * np.where(same.any(axis=1), same @ self.by_pattern, 1.0)
        return factors[of_row]


def _factors(index: Array, group: NDArray[np.intp], n_groups: int, share: float, *, trend: bool = False) -> Array:
    """Factors that make the groups exceed one level equally often, 1 where a group is small.

    With ``trend``, they are drawn to a straight line over the numbers of the groups.
    """
    counts = np.bincount(group, minlength=n_groups)
    large = np.flatnonzero(counts >= max(FEWEST_ROWS, 1 / share))
    if len(large) < 2:
        return np.ones(n_groups)
    logs = np.log(index)
    values = np.array([np.quantile(logs[group == one], 1 - share) for one in large])
    low, high = 1 - min(2 * share, 0.9), 1 - share / 2
    steepness = np.diff(np.quantile(logs, [low, high]))[0] / (high - low)
    factors = np.ones(n_groups)
    variances = share * (1 - share) * steepness**2 / counts[large]
    line = _line(large, values, variances) if trend else 0.0
    factors[large] = np.exp(-line - _effects(values - line, variances))
    return factors


def _line(numbers: Array, values: Array, variances: Array) -> Array:
    """Differences from the mean on a straight line, shrunk; zero if chance may have caused them."""
    weights = 1 / variances
    x = numbers - np.average(numbers, weights=weights)
    information = (weights * x * x).sum()
    slope = (weights * x * values).sum() / information
    evidence = slope**2 * information
    return slope * (1 - 1 / evidence) * x if evidence > chi2.ppf(CHANCE, 1) else np.zeros(len(x))


def _effects(values: Array, variances: Array) -> Array:
    """Differences from the mean, shrunk as in a random-effects model; zero if chance may have caused them."""
    weights = 1 / variances
    differences = values - np.average(values, weights=weights)
    excess = (weights * differences**2).sum() - chi2.ppf(CHANCE, len(values) - 1)
    between = max(excess / (weights.sum() - (weights**2).sum() / weights.sum()), 0.0)
    return differences * between / (between + variances)
