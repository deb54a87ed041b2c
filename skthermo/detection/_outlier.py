"""Damage index and alarm by any of scikit-learn's outlier detectors."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, clone

from skthermo._arrays import Array
from skthermo._validation import HasMethods
from skthermo.detection._base import DamageDetector
from skthermo.detection._thresholds import quantile_threshold


class OutlierDetector(DamageDetector):
    """Alarm where an outlier detector scores frequencies lower than nearly all of a healthy baseline.

    The damage index is minus the estimator's ``score_samples`` (or the ``decision_function`` of PyOD's detectors,
    where higher is more abnormal), and the threshold a quantile of the baseline's damage index.

    Parameters
    ----------
    estimator : outlier detector
        With ``fit`` and ``score_samples``, such as ``IsolationForest()``, ``OneClassSVM()``,
        ``LocalOutlierFactor(novelty=True)`` or ``EllipticEnvelope()``, a pipeline that ends
        with one, or a detector of PyOD. Its own threshold and ``contamination`` are not used.
    contamination : float, default=0.02
        Share of the baseline above the threshold: 0.02 puts it at the 98th percentile.

    Attributes
    ----------
    estimator_ : outlier detector
        Fitted clone.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline; NaN where a mode is missing.
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
    MahalanobisDetector : Distance from the mean, for a baseline that is close to normally distributed.

    Notes
    -----
    The scale of the damage index is the estimator's: ``EllipticEnvelope`` gives the *squared* Mahalanobis distance,
    ``IsolationForest`` a number between 0 and 1. Indices of different estimators cannot be compared, but their
    alarms can. Estimators that measure distances, such as ``OneClassSVM``, give high modes more weight, because these
    vary more in Hz; ``make_pipeline(StandardScaler(), OneClassSVM())`` as the estimator weights all modes alike.

    The threshold comes from rows on which the estimator was fitted. Estimators that score such rows better than new
    ones, as ``LocalOutlierFactor`` does, set it too low: check the rate of false alarms on healthy records that `fit`
    has not seen. Rows with a missing mode are left out of the baseline; their damage index is NaN, and ``predict``
    raises no alarm there.

    Examples
    --------
    >>> from sklearn.neighbors import LocalOutlierFactor
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> from sklearn.svm import OneClassSVM
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import OutlierDetector
    >>> healthy = make_truss_campaign(random_state=0).frequencies
    >>> damaged = make_truss_campaign(damage={"bottom": 0.3}, random_state=1).frequencies
    >>> detector = OutlierDetector(make_pipeline(StandardScaler(), OneClassSVM())).fit(healthy)
    >>> float((detector.predict(damaged) == -1).mean())
    1.0
    >>> OutlierDetector(LocalOutlierFactor()).fit(healthy)
    Traceback (most recent call last):
    ...
    ValueError: estimator is LocalOutlierFactor(), which has no score_samples; expected an outlier detector
    that scores new records, such as IsolationForest() or LocalOutlierFactor(novelty=True)
    """

    _parameter_constraints: dict = {**DamageDetector._parameter_constraints, "estimator": [HasMethods("fit")]}

    def __init__(self, estimator: BaseEstimator, contamination: float = 0.02):
        self.estimator = estimator
        self.contamination = contamination

    def _learn(self, F: Array) -> Array:
        complete = F[~np.isnan(F).any(axis=1)]
        if len(complete) < 2:
            raise ValueError(f"{len(complete)} of {len(F)} rows have every mode; expected at least 2")
        scores = hasattr(self.estimator, "score_samples") or hasattr(self.estimator, "decision_function")
        self.estimator_ = clone(self.estimator).fit(complete) if scores else None
        if not hasattr(self.estimator_, "score_samples") and not _is_pyod(self.estimator_):
            raise ValueError(
                f"estimator is {self.estimator!r}, which has no score_samples; expected an outlier detector that "
                "scores new records, such as IsolationForest() or LocalOutlierFactor(novelty=True)"
            )
        return self._index(F)

    def _limit(self, index: Array) -> float:
        return quantile_threshold(index, self.contamination)

    def _index(self, F: Array) -> Array:
        index, complete = np.full(len(F), np.nan), ~np.isnan(F).any(axis=1)
        if complete.any():
            fitted, rows = self.estimator_, F[complete]
            index[complete] = fitted.decision_function(rows) if _is_pyod(fitted) else -fitted.score_samples(rows)
        return index


def _is_pyod(estimator: Any) -> bool:
    """Whether a fitted detector scores as PyOD's do: higher is more abnormal."""
    return hasattr(estimator, "decision_scores_")
