"""Fit and predict with regressors of one or several outputs, with or without standard deviations."""

from typing import Any

import numpy as np
from sklearn import config_context
from sklearn.base import BaseEstimator, clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.linear_model import LinearRegression
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from skthermo._arrays import Array, as_columns
from skthermo._validation import BaseSearchCV, InvalidParameterError, _routing_enabled, routes_weights


def fit_outputs(regressor: BaseEstimator, X: Any, y: Any, sample_weight: Array | None = None) -> BaseEstimator:
    """A clone of the regressor fitted to all outputs, or one clone for each output if it takes only one.

    Several outputs are simply tried, because scikit-learn's tag for them is not reliable: it is False for
    ``MLPRegressor``.
    """
    try:
        return fit_weighted(clone(regressor), X, y, sample_weight)
    except InvalidParameterError:
        raise
    except Exception as error:
        if y.ndim == 1:
            raise
        try:
            return fit_weighted(MultiOutputRegressor(regressor), X, y, sample_weight)
        except Exception:
            raise error from None


def fit_weighted(estimator: BaseEstimator, X: Any, y: Any, sample_weight: Array | None = None) -> BaseEstimator:
    """Fit an estimator, with weights if it takes them: of a pipeline the last step, of a search what it searches over.

    With metadata routing, where a user has requested or refused weights for some part, scikit-learn routes them.
    """
    if sample_weight is None or not takes_weights(estimator):
        return estimator.fit(X, y)
    if inside(estimator) is None or routes_weights(estimator):
        return estimator.fit(X, y, sample_weight=sample_weight)
    with config_context(enable_metadata_routing=False):  # nobody has said which step gets them
        return estimator.fit(X, y, **{name_of_weights(estimator): sample_weight})


def takes_weights(estimator: Any) -> bool:
    """Whether ``fit`` of an estimator, and of the regressor that it hands weights on to, takes ``sample_weight``."""
    part = inside(estimator)
    if part is not None:
        routed = routes_weights(estimator)
        return takes_weights(part) if routed is None else routed
    regressor = getattr(estimator, "regressor", None)  # of a TemperatureMapper; its default one takes weights
    return has_fit_parameter(estimator, "sample_weight") and (regressor is None or takes_weights(regressor))


def check_takes_weights(estimator: Any) -> None:
    """Raise an error for an estimator whose ``fit`` takes no weights."""
    if not takes_weights(estimator):
        routed = ", by set_fit_request(sample_weight=True) with metadata routing" if _routing_enabled() else ""
        raise ValueError(
            f"sample_weight is given, but fit of {estimator!r:.200} takes no weights; expected an estimator that takes "
            f"them{routed}"
        )


def inside(estimator: Any) -> BaseEstimator | None:
    """The estimator that one of scikit-learn's wrappers hands arguments of ``fit`` on to; None for others."""
    if isinstance(estimator, Pipeline):
        return estimator.steps[-1][1]
    if isinstance(estimator, TransformedTargetRegressor):
        return LinearRegression() if estimator.regressor is None else estimator.regressor
    return estimator.estimator if isinstance(estimator, MultiOutputRegressor | BaseSearchCV) else None


def name_of_weights(estimator: Any) -> str:
    """The argument of ``fit`` that hands weights on to what is inside, without metadata routing."""
    part = inside(estimator)
    if part is None:
        return "sample_weight"
    return (
        f"{estimator.steps[-1][0]}__{name_of_weights(part)}"
        if isinstance(estimator, Pipeline)
        else name_of_weights(part)
    )


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
