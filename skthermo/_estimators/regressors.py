"""Fit and predict with regressors of one or several outputs, with or without what they know of their uncertainty."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn import config_context
from sklearn.base import BaseEstimator, clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.linear_model import LinearRegression
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, as_columns
from skthermo._validation import BaseSearchCV, InvalidParameterError, _routing_enabled, last_step, routes_weights
from skthermo.exceptions import WeatherWarning


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


def offers(estimator: Any, name: str) -> bool:
    """Whether a fitted estimator offers a method or an attribute: that at the end of a pipeline or search counts.

    Clones for each output offer what all of them do, and a chain with a mapper what that mapper offers.
    """
    last = last_step(estimator)
    if isinstance(last, MultiOutputRegressor):
        return all(offers(part, name) for part in last.estimators_)
    return offers(last.mapper_, name) if hasattr(last, "mapper_") else hasattr(last, name)


def inputs_of_last_step(estimator: Any, X: Any) -> Any:
    """What the last step of a fitted pipeline, or of a search over pipelines, is given, such as lagged temperatures."""
    estimator = getattr(estimator, "best_estimator_", estimator)
    if not isinstance(estimator, Pipeline):
        return X
    return inputs_of_last_step(estimator.steps[-1][1], estimator[:-1].transform(X) if len(estimator) > 1 else X)


def predicted_covariance(estimator: Any, X: Any) -> Array:
    """What a fitted estimator that offers ``predict_covariance`` says, (n_samples, n_outputs, n_outputs).

    Clones for each output know nothing of each other: theirs is diagonal.
    """
    last, inputs = last_step(estimator), inputs_of_last_step(estimator, X)
    if isinstance(last, MultiOutputRegressor):
        variances = np.array([predicted_covariance(part, inputs)[:, 0, 0] for part in last.estimators_]).T
        return variances[:, :, np.newaxis] * np.eye(variances.shape[1])
    covariances = np.asarray(last.predict_covariance(inputs), dtype=float)
    if covariances.ndim != 3 or len(covariances) != len(inputs) or covariances.shape[1] != covariances.shape[2]:
        raise ValueError(
            f"predict_covariance of {last!r:.200} gave the shape {covariances.shape} for {len(inputs)} rows; expected "
            "(n_samples, n_outputs, n_outputs)"
        )
    return covariances


def reach_of(estimator: Any, X: Any) -> tuple[Any, Any] | None:
    """The weather that a fitted estimator with ``reach_`` stands on, and X as the inputs that it is of; else None."""
    if not offers(estimator, "reach_"):
        return None
    last, inputs = last_step(estimator), inputs_of_last_step(estimator, X)
    if isinstance(last, MultiOutputRegressor):
        return reach_of(last.estimators_[0], inputs)
    return reach_of(last.mapper_, inputs) if hasattr(last, "mapper_") else (last.reach_, inputs)


def told_by_fleet(estimator: Any, X: Any) -> NDArray[np.bool_]:
    """Rows in weather that only the fleet of an estimator has seen; none where it offers no ``from_fleet``."""
    if not offers(estimator, "from_fleet"):
        return np.zeros(X.shape[0], dtype=bool)
    last, inputs = last_step(estimator), inputs_of_last_step(estimator, X)
    if isinstance(last, MultiOutputRegressor):
        return np.any([told_by_fleet(part, inputs) for part in last.estimators_], axis=0)
    if hasattr(last, "mapper_"):
        return told_by_fleet(last.mapper_, inputs)
    return np.asarray(last.from_fleet(inputs), dtype=bool)


def warn_of_fleet(rows: NDArray[np.bool_], consequence: str) -> None:
    """Count the rows in weather that the fleet has seen, and the records of this structure have not."""
    if rows.any():
        warn_user(
            f"{rows.sum()} of {len(rows)} rows are in weather that the training records have not seen, and stand on "
            f"what the fleet has shown there: {consequence}",
            WeatherWarning,
            "rows that stand on the fleet",
        )
