"""Detectors that the field uses, with and without temperatures, each calibrated to one rate of false alarms."""

import warnings

import numpy as np
from sklearn.base import BaseEstimator, OutlierMixin
from sklearn.decomposition import PCA, FactorAnalysis
from sklearn.ensemble import GradientBoostingRegressor, IsolationForest
from sklearn.linear_model import LinearRegression
from sklearn.mixture import GaussianMixture
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import LocalOutlierFactor, NearestNeighbors
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import OneClassSVM

from skthermo.detection import CompensatedDetector, MahalanobisDetector, OutlierDetector
from skthermo.surrogate import TemperatureMapper


class NeighbourDistance(OutlierMixin, BaseEstimator):
    """Minus the distance to the k-th nearest record of the baseline."""

    def __init__(self, n_neighbors=20):
        self.n_neighbors = n_neighbors

    def fit(self, X, y=None):
        self.neighbours_ = NearestNeighbors(n_neighbors=self.n_neighbors).fit(X)
        return self

    def score_samples(self, X):
        return -self.neighbours_.kneighbors(X)[0][:, -1]


class MinorComponents(OutlierMixin, BaseEstimator):
    """Minus the Mahalanobis distance in all principal components but the first, which weather is taken to move."""

    def __init__(self, n_left_out=1):
        self.n_left_out = n_left_out

    def fit(self, X, y=None):
        self.pca_ = PCA(whiten=True).fit(X)
        return self

    def score_samples(self, X):
        return -np.linalg.norm(self.pca_.transform(X)[:, self.n_left_out :], axis=1)


class SpecificFactors(OutlierMixin, BaseEstimator):
    """Minus the distance from what common factors, taken to be the weather, explain of all columns."""

    def __init__(self, n_factors=1):
        self.n_factors = n_factors

    def fit(self, X, y=None):
        self.factors_ = FactorAnalysis(self.n_factors).fit(X)
        return self

    def score_samples(self, X):
        common = self.factors_.transform(X) @ self.factors_.components_ + self.factors_.mean_
        return -np.linalg.norm((X - common) / np.sqrt(self.factors_.noise_variance_), axis=1)


class ConditionalCovariance(OutlierMixin, BaseEstimator):
    """Minus the Mahalanobis distance among the records in the most similar weather; targets are the last columns."""

    def __init__(self, targets, n_neighbors=50):
        self.targets = targets
        self.n_neighbors = n_neighbors

    def fit(self, X, y=None):
        T, self.F_ = np.split(np.asarray(X), [-len(self.targets)], axis=1)
        self.scaler_ = StandardScaler().fit(T)
        self.weather_ = NearestNeighbors(n_neighbors=self.n_neighbors).fit(self.scaler_.transform(T))
        return self

    def score_samples(self, X):
        T, F = np.split(np.asarray(X), [-len(self.targets)], axis=1)
        near = self.F_[self.weather_.kneighbors(self.scaler_.transform(T), return_distance=False)]
        mean = near.mean(axis=1)
        centred = near - mean[:, np.newaxis]
        covariance = np.einsum("nki,nkj->nij", centred, centred) / (self.n_neighbors - 1)
        distance = (F - mean)[:, np.newaxis] @ np.linalg.solve(covariance, (F - mean)[:, :, np.newaxis])
        return -np.sqrt(distance[:, 0, 0])


class Cointegration(OutlierMixin, BaseEstimator):
    """Minus the deviation of the most stationary combination of the columns, by Johansen's procedure."""

    def fit(self, X, y=None):
        try:
            from statsmodels.tsa.vector_ar.vecm import coint_johansen
        except ImportError as error:
            raise ImportError("cointegration needs statsmodels; get it with: pip install statsmodels") from error
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", np.exceptions.ComplexWarning)  # of eigenvectors that are real
            self.vector_ = coint_johansen(X, 0, 1).evec[:, 0]  # with a constant, and one lagged difference
        self.mean_, self.deviation_ = np.mean(X @ self.vector_), np.std(X @ self.vector_)
        return self

    def score_samples(self, X):
        return -np.abs(X @ self.vector_ - self.mean_) / self.deviation_


def field_detectors(targets, estimator=None, random_state=0, *, contamination=0.02, block=None):
    """Detectors by name, not fitted: those named "raw" see frequencies only, the others temperatures beside them.

    `targets` names the frequency columns, the last ones. An `estimator`, such as the chain of the structure,
    compensates as well. With "regimes", records are divided where the scatter of the residuals changes.
    Thresholds come from blocks of time that are left out. `block` is their length for outlier detectors: hourly records
    of one winter want "1D", or whole spells of frost are left out, and the threshold hides damage.
    """
    novelties = {
        "isolation forest": IsolationForest(random_state=random_state),
        "20 neighbours": NeighbourDistance(20),
        "local outlier factor": LocalOutlierFactor(novelty=True),
        "one-class SVM": OneClassSVM(),
        **{f"less {k} component{'s'[: k > 1]}": MinorComponents(k) for k in (1, 2, 3) if k < len(targets)},
        "factor analysis": SpecificFactors(),
        "Gaussian mixture": GaussianMixture(6, random_state=random_state),
        "cointegration": Cointegration(),
    }
    regressors = {
        "piecewise-linear": TemperatureMapper(),
        "boosted trees": MultiOutputRegressor(GradientBoostingRegressor(random_state=random_state)),
        "linear regression": LinearRegression(),
    }
    if estimator is not None:
        regressors["chain"] = estimator

    def outlier(name):
        return OutlierDetector(make_pipeline(StandardScaler(), novelties[name]), contamination, block=block)

    def compensated(regressor, detector=None, regimes=None):
        detector = detector or MahalanobisDetector(contamination)
        return CompensatedDetector(detector, regressor, targets=targets, regimes=regimes)

    detectors = {"raw, Mahalanobis": MahalanobisDetector(contamination)}
    detectors |= {f"raw, {name}": outlier(name) for name in novelties}
    for name, regressor in regressors.items():
        detectors |= {name: compensated(regressor), f"{name}, regimes": compensated(regressor, regimes="auto")}
    for name in ("isolation forest", "20 neighbours"):
        detectors[f"piecewise-linear, {name}"] = compensated(regressors["piecewise-linear"], outlier(name))
    nearby = ConditionalCovariance(targets)
    detectors["conditional covariance"] = OutlierDetector(nearby, contamination, block=block)
    return detectors
