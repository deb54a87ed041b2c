"""Damage index and alarm by Mahalanobis distance, in the modes that a record has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from scipy.stats import chi2
from sklearn.base import BaseEstimator, clone
from sklearn.covariance import EmpiricalCovariance

from skthermo._core.arrays import Array
from skthermo._core.estimators import HasMethods, StrOptions
from skthermo.detection._base import DamageDetector, conformal_threshold
from skthermo.exceptions import FewRecordsWarning, SkthermoWarning
from skthermo.preprocessing.folds import Rows, out_of_fold
from skthermo.residuals.gaussian import Gaussian, check_invertible, modes_text


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

        - ``"conformal"``: the ceil((n + 1)(1 - contamination))-th smallest of the distances of the n baseline records,
          each from records of other blocks of time, dealt in turn to five folds: fifty blocks or, of residuals, as
          few as are longer than these remember, without the records beside a block that remember it.
        - ``"quantile"``: the (1 - contamination) quantile of the baseline's own distances, as in the paper. Distances
          of the records that a covariance was fitted on are too small: 100 records of 6 modes give 5 % false alarms
          where 2 % are asked for.
        - ``"chi2"``: the distance that normally distributed records exceed at that rate. Residuals of real bridges are
          not normal and exceed it more often.

    Attributes
    ----------
    covariance_ : estimator
        Fitted: mean (``location_``) and covariance of the baseline.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline; with the conformal threshold, each record's distance from records of other folds.
    n_independent_ : float
        Number of independent records that the residuals of the baseline are worth, or its indices where columns are
        frequencies, from the variance of the means of a dozen parts.
    threshold_, offset_ : float
        A damage index above the threshold is an alarm; ``decision_function`` is ``score_samples - offset_``.
    report_ : DataFrame
        As what each column was read, and in how many rows a value was set aside, as `DamageDetector` has it.
    findings_ : list of SkthermoWarning
        What `fit` has warned of.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of modes and, where `fit` saw a frame with such, their names.

    See Also
    --------
    DirectionalDetector : Looks in the directions in which damage moves frequencies.
    CompensatedDetector : Removes the effect of temperature before.
    OutlierDetector : Any of scikit-learn's outlier detectors, for a baseline that is not normally distributed.

    Notes
    -----
    `fit` refuses a baseline whose covariance is singular: one with too few rows, a constant mode, or a mode that is a
    combination of others. The units of the modes do not matter.

    A record with missing modes gets the distance in those that it has, expressed as the distance in all modes that a
    normally distributed record exceeds as often [WH31]_. Rows without any mode cannot be evaluated: their index is NaN,
    and ``predict`` gives 0.

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
        self.covariance_ = self._fitted(F, self.findings_)
        return self._by_others(self._indices, F, times) if self.threshold == "conformal" else self._index(F)

    def _by_others(self, value: Callable[[Gaussian, Array], Array], F: Array, times: Array) -> Array:
        """Value of each row by the distribution of other rows; infinite where these do not determine one."""
        whole, is_moments = normal_of(self.covariance_), self.covariance is None and not np.isnan(F).any()

        def learn(train: Rows) -> Callable[[Rows], Array]:
            try:
                if is_moments:
                    others = whole.without(np.delete(F, train, axis=0), len(F))
                    check_invertible(others, len(train), has_gaps=False)
                else:
                    others = normal_of(self._fitted(F[train], []))
            except ValueError:
                return lambda test: np.full_like(value(whole, F[test]), np.inf)
            return lambda test: value(others, F[test])

        return out_of_fold(learn, self._other_blocks(times))

    def _limit(self, index: Array) -> float:
        if self.threshold == "chi2":
            return float(np.sqrt(chi2.isf(self.contamination, self.n_features_in_)))
        if self.threshold == "quantile":
            return float(np.nanquantile(index, 1 - self.contamination))
        return conformal_threshold(index, self.contamination)

    def _index(self, F: Array) -> Array:
        return self._indices(normal_of(self.covariance_), F)

    def _indices(self, normal: Gaussian, F: Array) -> Array:
        """Damage index of rows by a distribution of healthy ones."""
        distances = normal.distances(F)
        return as_if_complete(distances, F) if np.isnan(F).any() else distances

    def _fitted(self, F: Array, findings: list[SkthermoWarning]) -> BaseEstimator:
        """Mean and covariance of rows, as one of scikit-learn's covariance estimators."""
        names = getattr(self, "feature_names_in_", None)
        if self.covariance is None:
            return most_likely(F, names, findings)
        complete = F[~np.isnan(F).any(axis=1)]
        if len(complete) < 2:
            raise ValueError(
                f"{len(complete)} of {len(F)} rows have every mode; expected at least 2 for the covariance "
                f"{self.covariance!r} (covariance=None takes rows with gaps)"
            )
        fitted = clone(self.covariance).fit(complete)
        check_invertible(normal_of(fitted), len(complete), has_gaps=False, names=names)
        return fitted

    def _has_likelihood(self) -> bool:
        return True

    def _log_densities(self, F: Array) -> Array:
        return normal_of(self.covariance_).log_densities(F)


def normal_of(fitted: BaseEstimator) -> Gaussian:
    """The normal distribution with the mean and the covariance that an estimator has learned."""
    return Gaussian(fitted.location_, fitted.covariance_)


def most_likely(F: Array, names: Sequence[str] | None, findings: list[SkthermoWarning]) -> EmpiricalCovariance:
    """Mean and covariance of rows with or without gaps, by expectation maximisation."""
    has_gaps = bool(np.isnan(F).any())
    if has_gaps:
        look_at_gaps(F, names, findings)
    normal = Gaussian.fitted(F)
    scale = check_invertible(normal, len(F), has_gaps=has_gaps, names=names)
    if not normal.is_settled:
        text = (
            "gaps leave a part of the covariance nearly undetermined. Leave out the mode that is missing most, or give "
        )
        findings.append(FewRecordsWarning(text + "more records", "few-records"))
    learned = EmpiricalCovariance()
    learned.location_, learned.covariance_, learned.n_features_in_ = normal.mean, normal.covariance, F.shape[1]
    learned.precision_ = np.linalg.inv(normal.covariance / np.outer(scale, scale)) / np.outer(scale, scale)
    return learned


def look_at_gaps(F: Array, names: Sequence[str] | None, findings: list[SkthermoWarning]) -> None:
    """Refuse modes without a value, and find modes that have none in the same row."""
    present = (~np.isnan(F)).astype(float)
    n_together = present.T @ present
    if (np.diag(n_together) == 0).any():
        raise ValueError(f"{modes_text(np.diag(n_together) == 0, names)} are NaN in all {len(F)} rows")
    if (n_together == 0).any():
        pair = modes_text(np.isin(np.arange(F.shape[1]), np.argwhere(n_together == 0)[0]), names)
        text = f"{pair} never have a value in the same row: their correlation is inferred from the other modes. Leave "
        findings.append(FewRecordsWarning(text + "one of them out, or give records with both", "few-records"))


def as_if_complete(distances: Array, F: Array) -> Array:
    """Distance in all modes that a normal record exceeds as often as its own in those that it has.

    By the approximation of Wilson and Hilferty: the cube root of a chi-square number is nearly normal.
    """
    n_modes, n_present = F.shape[1], (~np.isnan(F)).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        here, there = 2 / (9 * n_present), 2 / (9 * n_modes)
        normal = (np.cbrt(distances**2 / n_present) - (1 - here)) / np.sqrt(here)
        mapped = np.sqrt(n_modes * (1 - there + normal * np.sqrt(there)) ** 3)
    return np.where(n_present == n_modes, distances, np.where(n_present == 0, np.nan, mapped))
