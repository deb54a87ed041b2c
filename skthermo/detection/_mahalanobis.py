"""Damage index and alarm by Mahalanobis distance."""

import numpy as np
from sklearn.base import BaseEstimator, clone
from sklearn.covariance import EmpiricalCovariance

from skthermo._arrays import Array
from skthermo._validation import HasMethods
from skthermo.detection._base import DamageDetector


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
    }

    def __init__(self, contamination: float = 0.02, *, covariance: BaseEstimator | None = None):
        self.contamination = contamination
        self.covariance = covariance

    def _learn(self, complete: Array) -> None:
        covariance = EmpiricalCovariance() if self.covariance is None else clone(self.covariance)
        self.covariance_ = covariance.fit(complete)
        scale = _scale(self.covariance_.covariance_, complete)
        correlation = self.covariance_.covariance_ / np.outer(scale, scale)
        _check_invertible(correlation, len(complete))
        if self.covariance is None:  # its own inverse loses modes in a small unit beside others in a large one
            self.covariance_.precision_ = np.linalg.inv(correlation) / np.outer(scale, scale)

    def _index(self, complete: Array) -> Array:
        return np.sqrt(self.covariance_.mahalanobis(complete))


def _scale(covariance: Array, complete: Array) -> Array:
    """Standard deviations of the modes; infinite where a mode is constant, and its deviation only rounding."""
    deviations = np.sqrt(np.diag(covariance))
    return np.where(deviations <= 1e-14 * np.abs(complete).max(axis=0), np.inf, deviations)


def _check_invertible(correlation: Array, n_rows: int) -> None:
    rank = np.linalg.matrix_rank(correlation, hermitian=True)
    if rank < len(correlation):
        raise ValueError(
            f"the covariance of {n_rows} complete baseline rows and {len(correlation)} modes is singular "
            f"(rank {rank}); expected more than {len(correlation)} rows, no mode that is constant or a copy "
            "of others, or a shrunk covariance such as LedoitWolf()"
        )
