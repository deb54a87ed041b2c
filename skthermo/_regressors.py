"""Fit and predict with regressors of one or several outputs, with or without standard deviations."""

from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, clone
from sklearn.multioutput import MultiOutputRegressor

from skthermo._arrays import Array, as_columns
from skthermo._validation import InvalidParameterError


def fit_outputs(regressor: BaseEstimator, X: Any, y: Any) -> BaseEstimator:
    """A clone of the regressor fitted to all outputs, or one clone for each output if it takes only one.

    Several outputs are simply tried, because scikit-learn's tag for them is not reliable: it is False for
    ``MLPRegressor``.
    """
    try:
        return clone(regressor).fit(X, y)
    except InvalidParameterError:
        raise
    except Exception as error:
        if y.ndim == 1:
            raise
        try:
            return MultiOutputRegressor(regressor).fit(X, y)
        except Exception:
            raise error from None


def predict_with_std(regressor: Any, X: Array) -> tuple[Array, Array]:
    """Means and standard deviations of all outputs.

    Raises
    ------
    ValueError
        If the regressor gives no standard deviations.
    """
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
