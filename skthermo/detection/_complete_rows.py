"""Regression on records with missing values."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.compose import TransformedTargetRegressor
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import Pipeline
from sklearn.utils import get_tags

from skthermo._arrays import as_columns, as_floats
from skthermo._regressors import fit_outputs
from skthermo._validation import BaseSearchCV, _BaseImputer, is_model


class CompleteRowsRegressor(RegressorMixin, BaseEstimator):
    """Fits and predicts with the rows that a regressor accepts; the prediction of other rows is NaN."""

    def __init__(self, estimator: BaseEstimator):
        self.estimator = estimator

    def fit(self, X: Any, y: Any) -> "CompleteRowsRegressor":
        usable = self._predictable(X)
        if not takes_missing_targets(self.estimator):
            usable &= _complete(y)
        if not usable.any():
            wanted = "every target" if takes_nan(self.estimator) else "every value"
            raise ValueError(
                f"none of {len(y)} rows to learn from is complete; expected rows with {wanted} for "
                f"{type(self.estimator).__name__}"
            )
        self.n_targets_ = y.shape[1]
        self.estimator_ = fit_outputs(self.estimator, X[usable], self._as_target(y[usable]))
        return self

    def predict(self, X: Any) -> NDArray[np.float64]:
        usable = self._predictable(X)
        predicted = np.full((len(X), self.n_targets_), np.nan)
        if usable.any():
            values = as_columns(self.estimator_.predict(X[usable]))
            expected = (int(usable.sum()), self.n_targets_)
            if values.shape != expected:
                raise ValueError(
                    f"{type(self.estimator_).__name__} predicted the shape {values.shape}; expected {expected}, a "
                    "column for each target"
                )
            predicted[usable] = values
        return predicted

    def _predictable(self, X: Any) -> NDArray[np.bool_]:
        return np.ones(len(X), dtype=bool) if takes_nan(self.estimator) else _complete(X)

    def _as_target(self, y: Any) -> Any:
        """The targets as the regressor takes them: a single one as a vector, unless it always takes columns."""
        if y.shape[1] > 1 or not get_tags(_final_estimator(self.estimator)).target_tags.single_output:
            return y
        return y.squeeze(axis=1)


def takes_nan(estimator: BaseEstimator) -> bool:
    """Whether an estimator accepts NaN in X.

    scikit-learn's tag does not say so for estimators inside a pipeline, a search or another wrapper.
    """
    if isinstance(estimator, Pipeline):
        for step in (step for _, step in estimator.steps if step not in (None, "passthrough")):
            if not takes_nan(step):
                return False
            if isinstance(step, _BaseImputer):
                return True
        return True
    if isinstance(estimator, MultiOutputRegressor | BaseSearchCV):
        return takes_nan(estimator.estimator)
    if isinstance(estimator, TransformedTargetRegressor) and estimator.regressor is not None:
        return takes_nan(estimator.regressor)
    return get_tags(estimator).input_tags.allow_nan


def takes_missing_targets(estimator: BaseEstimator) -> bool:
    """Whether an estimator accepts NaN in y: one with an FE model leaves out incomplete rows itself, after its lags."""
    return is_model(getattr(_final_estimator(estimator), "model", None))


def _final_estimator(estimator: BaseEstimator) -> BaseEstimator:
    """The last estimator of a pipeline, or the one inside a search."""
    if isinstance(estimator, Pipeline):
        return _final_estimator(estimator.steps[-1][1])
    return _final_estimator(estimator.estimator) if isinstance(estimator, BaseSearchCV) else estimator


def _complete(values: Any) -> NDArray[np.bool_]:
    return ~np.isnan(as_floats(values)).any(axis=1)
