"""Damage index and alarm by Mahalanobis distance."""

import warnings
from numbers import Real

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, OutlierMixin, clone
from sklearn.covariance import EmpiricalCovariance

from skthermo._validation import HasMethods, Interval, _fit_context, check_is_fitted, validate_data


class MahalanobisDetector(OutlierMixin, BaseEstimator):
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

    Notes
    -----
    Rows with a missing mode do not enter the baseline; their damage index is NaN, and
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
        "contamination": [Interval(Real, 0, 0.5, closed="right")],
        "covariance": [HasMethods(["fit", "mahalanobis"]), None],
    }

    def __init__(self, contamination: float = 0.02, *, covariance: BaseEstimator | None = None):
        self.contamination = contamination
        self.covariance = covariance

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: None = None) -> "MahalanobisDetector":
        """Learn mean, covariance and threshold of a healthy baseline.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz; rows with NaN are left out.
        y : None
            Ignored.

        Returns
        -------
        MahalanobisDetector
            The fitted detector.

        Raises
        ------
        ValueError
            If the complete rows are too few, or too much alike, for a covariance that can be
            inverted.
        """
        F = validate_data(self, X, ensure_all_finite="allow-nan", ensure_min_samples=2)
        complete = F[~np.isnan(F).any(axis=1)]
        if len(complete) < 2:
            raise ValueError(f"{len(complete)} of {len(F)} rows have every mode; expected at least 2")
        covariance = EmpiricalCovariance() if self.covariance is None else clone(self.covariance)
        self.covariance_ = covariance.fit(complete)
        self._check_invertible(len(complete))
        self.threshold_ = np.quantile(self._distance(complete), 1 - self.contamination)
        self.offset_ = -self.threshold_
        return self

    def damage_index(self, X: ArrayLike) -> NDArray[np.float64] | pd.Series:
        """Unsquared Mahalanobis distance from the baseline, eq. (20).

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray or Series of shape (n_samples,)
            Dimensionless; NaN where a mode is missing. A frame gives a series on its index.
        """
        check_is_fitted(self)
        F = validate_data(self, X, ensure_all_finite="allow-nan", reset=False)
        index = np.full(len(F), np.nan)
        complete = ~np.isnan(F).any(axis=1)
        if complete.any():
            index[complete] = self._distance(F[complete])
        return pd.Series(index, index=X.index, name="damage_index") if isinstance(X, pd.DataFrame) else index

    def score_samples(self, X: ArrayLike) -> NDArray[np.float64]:
        """Negative damage index: higher is healthier.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray of shape (n_samples,)
        """
        return -np.asarray(self.damage_index(X))

    def decision_function(self, X: ArrayLike) -> NDArray[np.float64]:
        """Threshold minus damage index: negative is an alarm.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray of shape (n_samples,)
        """
        return self.score_samples(X) - self.offset_

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """Alarm or not.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray of shape (n_samples,)
            -1 where the damage index exceeds the threshold, +1 elsewhere, also where a mode
            is missing; one warning counts those rows.
        """
        decision = self.decision_function(X)
        unknown = int(np.isnan(decision).sum())
        if unknown:
            warnings.warn(
                f"{unknown} of {len(decision)} rows have a missing mode: no alarm is raised there",
                UserWarning,
                stacklevel=2,
            )
        return np.where(decision < 0, -1, 1)

    def _distance(self, complete: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sqrt(self.covariance_.mahalanobis(complete))

    def _check_invertible(self, n_rows: int) -> None:
        covariance = self.covariance_.covariance_
        rank = np.linalg.matrix_rank(covariance, hermitian=True)
        if rank < len(covariance):
            raise ValueError(
                f"the covariance of {n_rows} complete baseline rows and {len(covariance)} modes is singular "
                f"(rank {rank}); expected more than {len(covariance)} rows, no mode that is constant or a copy "
                "of others, or a shrunk covariance such as LedoitWolf()"
            )

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags
