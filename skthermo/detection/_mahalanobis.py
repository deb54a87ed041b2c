"""Damage index and alarm by Mahalanobis distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.stats import chi2
from sklearn.base import BaseEstimator, clone
from sklearn.covariance import EmpiricalCovariance

from skthermo._estimators.warnings import warn_user, without_warnings
from skthermo._tables.arrays import Array
from skthermo._validation import HasMethods, StrOptions
from skthermo.detection._base import DamageDetector
from skthermo.detection._patterns import PatternScale, as_if_complete
from skthermo.detection._thresholds import conformal_threshold, factor_of_few, quantile_threshold
from skthermo.exceptions import FewRecordsWarning
from skthermo.residuals.gaussian import Gaussian, check_invertible, check_not_empty, modes_text
from skthermo.residuals.neighbourhoods import Neighbourhoods

ROWS_AT_ONCE = 20_000  # whose distances are computed, which bounds memory
N_FOLDS = 10  # of the baseline, whose distances come from the others where there is no closed form


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
          of the records that a covariance was fitted on are too small: 100 records of 6 modes give 5.6 % false alarms
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
            return quantile_threshold(index, self.contamination)
        return conformal_threshold(index, self.contamination, n_independent=self.n_independent_)

    def _index(self, F: Array) -> Array:
        return np.concatenate([self._of_few(F[i : i + ROWS_AT_ONCE]) for i in range(0, len(F), ROWS_AT_ONCE)])

    def _own_index(self, F: Array) -> Array:
        return self._index(F)

    def _seen_at(self, threshold: float) -> str:
        single = 1 / np.sqrt(np.diag(np.linalg.inv(self.covariance_.covariance_)))
        smallest = np.sqrt(max(threshold**2 - self.n_features_in_, 0.0)) * single
        sizes = ", ".join(f"{size:.2g}" for size in smallest)
        return f". Half of the records of a shift of one mode alone raise an alarm if it is {sizes} (mode by mode)"

    def _has_likelihood(self) -> bool:
        return True

    def _log_densities(self, F: Array) -> Array:
        return self._normal.log_densities(F)

    def _of_few(self, F: Array) -> Array:
        distances, present = self._distances(F), ~np.isnan(F)
        if present.all():
            return distances
        return as_if_complete(distances, present.sum(axis=1), F.shape[1]) * self.pattern_scale_(present)

    def _distances(self, F: Array) -> Array:
        """Distances of rows in the modes that they have; NaN where there is none."""
        if self.covariance is not None and not np.isnan(F).any():
            return np.sqrt(self.covariance_.mahalanobis(F))
        return self._normal.distances(F)

    def _as_if_new(self, baseline: Neighbourhoods) -> Array:
        """Distances of baseline rows, as large as those of new records."""
        if self.covariance is not None or np.isnan(baseline.records).any() or not baseline.is_short:
            return self._left_out(baseline)
        n_records, n_modes = baseline.records.shape
        time = round(baseline.correlation_time, 2)
        return self._distances(baseline.records) * factor_of_few(n_records, n_modes, time, self.contamination)

    def _left_out(self, baseline: Neighbourhoods) -> Array:
        """Distances of baseline rows from the others."""
        distances, complete = self._distances(baseline.records), ~np.isnan(baseline.records).any(axis=1)
        known = complete if self.covariance is not None else ~np.isnan(baseline.records).all(axis=1)
        some = Neighbourhoods(baseline.times[known], baseline.records[known])
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
