"""Damage index and alarm by Mahalanobis distance."""

from typing import Literal

import numpy as np
from scipy.stats import chi2
from sklearn.base import BaseEstimator, clone
from sklearn.covariance import EmpiricalCovariance
from sklearn.model_selection import KFold

from skthermo._arrays import Array
from skthermo._validation import HasMethods, StrOptions
from skthermo.detection._base import DamageDetector
from skthermo.detection._gaussian import Gaussian, check_invertible, patterns, precisions
from skthermo.detection._patterns import PatternScale, as_if_complete
from skthermo.detection._thresholds import conformal_threshold, quantile_threshold

ROWS = 20_000
"""Number of rows whose distances are computed at a time, which bounds memory."""

FOLDS = 10
"""Periods of the baseline whose distances are computed with a covariance of the others, if it has no closed form."""


class MahalanobisDetector(DamageDetector):
    """Alarm where frequencies are far from a healthy baseline.

    The damage index is the *unsquared* Mahalanobis distance, eq. (20),
    DI = sqrt((f - mu) Sigma^-1 (f - mu)^T), and the threshold a quantile of the baseline's.

    Parameters
    ----------
    contamination : float, default=0.02
        Share of the baseline above the threshold: 0.02 puts it at the 98th percentile.
    covariance : covariance estimator, optional
        Any of scikit-learn's, such as ``LedoitWolf()`` for few records or ``MinCovDet()``
        for a baseline with outliers. By default ``EmpiricalCovariance()``.

    Attributes
    ----------
    covariance_ : estimator
        Fitted clone: mean (``location_``) and covariance of the baseline.
    threshold_ : float
        The (1 - contamination) quantile of the baseline's damage index.
    offset_ : float
        ``-threshold_``, so that ``decision_function`` is ``score_samples - offset_``.
    n_features_in_ : int
        Number of modes.
    feature_names_in_ : ndarray of str
        Names of the modes, where `fit` saw a frame with such names.

    See Also
    --------
    OutlierDetector : Any of scikit-learn's outlier detectors, for a baseline that is not normally distributed.

    Notes
    -----
    `fit` refuses a baseline whose covariance is singular: one with too few rows, a constant mode,
    or a mode that is a combination of others. The units of the modes do not matter, unless ``covariance`` depends
    on them, as a shrunk one does.

    Rows with a missing mode are left out of the baseline; their damage index is NaN, and
    ``predict`` raises no alarm there.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519.

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

    def _learn(self, F: Array) -> float:
        present = ~np.isnan(F)
        self.covariance_ = _most_likely(F) if self.covariance is None else _fit_complete(self.covariance, F)
        distances = self._distances(F)
        if self.threshold == "conformal":
            distances = self._left_out(F, distances)
        index = as_if_complete(distances, present.sum(axis=1), F.shape[1])
        self.pattern_scale_ = PatternScale.of(index, present, self.contamination)
        if self.threshold == "chi2":
            return float(np.sqrt(chi2.isf(self.contamination, F.shape[1])))
        choose = quantile_threshold if self.threshold == "quantile" else conformal_threshold
        return choose(index * self.pattern_scale_(present), self.contamination)

    def _index(self, F: Array) -> Array:
        index = np.empty(len(F))
        for first in range(0, len(F), ROWS):
            rows = F[first : first + ROWS]
            distances, present = self._distances(rows), ~np.isnan(rows)
            if not present.all():
                distances = as_if_complete(distances, present.sum(axis=1), F.shape[1]) * self.pattern_scale_(present)
            index[first : first + ROWS] = distances
        return index

    def _distances(self, F: Array) -> Array:
        """Distances of rows in the modes that they have; NaN where there is none."""
        scale = np.sqrt(np.diag(self.covariance_.covariance_))
        correlation = self.covariance_.covariance_ / np.outer(scale, scale)
        standard = (F - self.covariance_.location_) / scale
        present = ~np.isnan(F)
        if present.all():
            if self.covariance is not None:
                return np.sqrt(self.covariance_.mahalanobis(F))
            standard = standard @ np.linalg.cholesky(np.linalg.inv(correlation))
            return np.sqrt(np.einsum("ij,ij->i", standard, standard))
        masks, of_row = patterns(present)
        inverses = precisions(np.broadcast_to(correlation, (len(masks), *correlation.shape)), masks)
        standard = np.nan_to_num(standard)
        squared = np.einsum("ij,ijk,ik->i", standard, inverses[of_row], standard)
        return np.where(present.any(axis=1), np.sqrt(np.maximum(squared, 0.0)), np.nan)

    def _left_out(self, F: Array, distances: Array) -> Array:
        """Distances of baseline rows from the other rows."""
        if self.covariance is None:
            present = ~np.isnan(F)
            n_rows = np.where(present, present.sum(axis=0), len(F)).min(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                left_out = np.sqrt(n_rows * distances**2 / (n_rows - 1 - distances**2))
            return np.where(distances**2 < n_rows - 1, left_out, np.where(np.isnan(distances), np.nan, np.inf))
        complete, left_out = np.flatnonzero(~np.isnan(F).any(axis=1)), distances.copy()
        for rest, fold in KFold(min(FOLDS, len(complete))).split(complete):
            others = clone(self.covariance).fit(F[complete[rest]])
            left_out[complete[fold]] = np.sqrt(others.mahalanobis(F[complete[fold]]))
        return left_out


def _most_likely(F: Array) -> EmpiricalCovariance:
    """Mean and covariance of rows with or without gaps."""
    empty = np.isnan(F).all(axis=0)
    if empty.any():
        raise ValueError(f"modes {np.flatnonzero(empty).tolist()} (counted from 0) are NaN in all {len(F)} rows")
    learned = Gaussian.of(F)
    scale = check_invertible(learned.covariance, F)
    fitted = EmpiricalCovariance()
    fitted.location_, fitted.covariance_, fitted.n_features_in_ = learned.mean, learned.covariance, F.shape[1]
    # The inverse of the covariance itself would lose modes in a small unit beside others in a large one.
    fitted.precision_ = np.linalg.inv(learned.covariance / np.outer(scale, scale)) / np.outer(scale, scale)
    return fitted


def _fit_complete(covariance: BaseEstimator, F: Array) -> BaseEstimator:
    """A clone of a covariance estimator, which takes only complete rows."""
    complete = F[~np.isnan(F).any(axis=1)]
    if len(complete) < 2:
        raise ValueError(
            f"{len(complete)} of {len(F)} rows have every mode; expected at least 2 for the covariance "
            f"{covariance!r} (covariance=None takes rows with gaps)"
        )
    fitted = clone(covariance).fit(complete)
    check_invertible(fitted.covariance_, complete)
    return fitted
