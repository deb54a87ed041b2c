"""Fit and predict with regressors of one or several outputs, with or without standard deviations."""

from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, clone
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from skthermo._arrays import Array, as_columns
from skthermo._validation import InvalidParameterError


def fit_outputs(regressor: BaseEstimator, X: Any, y: Any, sample_weight: Array | None = None) -> BaseEstimator:
    """A clone of the regressor fitted to all outputs, or one clone for each output if it takes only one.

    Weights are ignored where the regressor does not take them.

    Several outputs are simply tried, because scikit-learn's tag for them is not reliable: it is False for
    ``MLPRegressor``.
    """
    try:
        return clone(regressor).fit(X, y, **weights_for(regressor, sample_weight))
    except InvalidParameterError:
        raise
    except Exception as error:
        if y.ndim == 1:
            raise
        try:
            return MultiOutputRegressor(regressor).fit(X, y, **weights_for(regressor, sample_weight))
        except Exception:
            raise error from None


def weights_for(estimator: BaseEstimator, sample_weight: Array | None) -> dict[str, Array]:
    """Arguments of ``fit`` that give an estimator, or a pipeline's last step, its weights; none if it takes none."""
    if sample_weight is None:
        return {}
    if isinstance(estimator, Pipeline):
        name, last = estimator.steps[-1]
        return {f"{name}__{key}": value for key, value in weights_for(last, sample_weight).items()}
    if isinstance(estimator, MultiOutputRegressor):
        return weights_for(estimator.estimator, sample_weight)
    return {"sample_weight": sample_weight} if has_fit_parameter(estimator, "sample_weight") else {}


def predict_with_std(regressor: Any, X: Array) -> tuple[Array, Array]:
    """Means and standard deviations of all outputs."""
    if isinstance(regressor, MultiOutputRegressor):
        parts = [predict_with_std(part, X) for part in regressor.estimators_]
        means, deviations = (np.hstack(columns) for columns in zip(*parts, strict=True))
        return means, deviations
    try:
        means, deviations = regressor.predict(X, return_std=True)
    except TypeError as error:
        raise ValueError(
            f"{regressor!r} gives no standard deviations; expected a regressor whose predict takes return_std, such as "
            "GaussianProcessRegressor or BayesianRidge"
        ) from error
    return as_columns(means), as_columns(deviations)
