"""Wrappers of scikit-learn's private functions, which are imported only here, and types of its public ones; FE models
and seeds inside estimators."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar, overload

import numpy as np
import pandas as pd
import sklearn.utils
import sklearn.utils._param_validation
import sklearn.utils.validation
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.impute._base import _BaseImputer
from sklearn.model_selection._search import BaseSearchCV
from sklearn.neighbors._base import _get_weights
from sklearn.pipeline import Pipeline
from sklearn.utils import check_random_state
from sklearn.utils._param_validation import HasMethods, InvalidParameterError, StrOptions
from sklearn.utils.metaestimators import _BaseComposition
from sklearn.utils.validation import _check_feature_names_in, _check_sample_weight, _num_samples, check_is_fitted

from skthermo._arguments import is_model
from skthermo._arrays import without_mask, without_missing
from skthermo._names import is_labelled, is_numbered
from skthermo._numbers import refuse_huge, refuse_no_numbers

if TYPE_CHECKING:  # scikit-learn has no types: without these, a decorated fit and every fit_transform would be Any
    Method = TypeVar("Method", bound=Callable[..., Any])

    def _fit_context(*, prefer_skip_nested_validation: bool) -> Callable[[Method], Method]: ...

    class TransformerMixin:
        """Transformers of which frames give frames, and arrays give arrays."""

        @overload
        def fit_transform(self, X: pd.DataFrame, y: Any = None) -> pd.DataFrame: ...
        @overload
        def fit_transform(self, X: ArrayLike, y: Any = None) -> NDArray[np.float64]: ...
        def fit_transform(self, X: Any, y: Any = None) -> Any: ...
        def set_output(self, *, transform: Literal["default", "pandas", "polars"] | None = None) -> Self: ...
else:
    from sklearn.base import TransformerMixin, _fit_context

__all__ = [
    "BaseSearchCV",
    "Estimator",
    "HasMethods",
    "Interval",
    "InvalidParameterError",
    "StrOptions",
    "TransformerMixin",
    "_BaseComposition",
    "_BaseImputer",
    "_check_feature_names_in",
    "_fit_context",
    "_get_weights",
    "_num_samples",
    "check_array",
    "check_is_fitted",
    "check_sample_weight",
    "seed_parts",
    "seeded",
    "validate_data",
    "with_nan",
]


class Estimator(BaseEstimator):
    """Base of estimators that accept NaN in X, and of which clones share FE models."""

    def _validate_params(self) -> None:
        if isinstance(getattr(self, "random_state", None), bool):
            raise InvalidParameterError(
                f"The 'random_state' parameter of {type(self).__name__} is {self.random_state!r}; expected an integer, "
                "a RandomState or None"
            )
        super()._validate_params()

    def __sklearn_clone__(self) -> Self:
        parameters = self.get_params(deep=False)
        twin = type(self)(**{k: v if is_model(v) else clone(v, safe=False) for k, v in parameters.items()})
        for name in ("_metadata_request", "_sklearn_output_config"):
            if hasattr(self, name):
                setattr(twin, name, clone(getattr(self, name), safe=False))
        return twin

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


class Interval(sklearn.utils._param_validation.Interval):
    """scikit-learn's interval without True and False, which would count as 1 and 0."""

    def is_satisfied_by(self, val: Any) -> bool:
        """Whether a value is a number within the interval."""
        return not isinstance(val, bool | np.timedelta64) and super().is_satisfied_by(val)


def validate_data(estimator: BaseEstimator, X: Any, **options: Any) -> Any:
    """scikit-learn's `validate_data`; masked or missing values in X become NaN, and repeated column names and what is
    no number are errors."""
    values = sklearn.utils.validation.validate_data(estimator, with_nan(X), **options)
    refuse_huge(values, "X")
    return values


def check_array(values: Any, **options: Any) -> Any:
    """scikit-learn's `check_array`; masked or missing values become NaN, and what is no number is an error."""
    array = sklearn.utils.check_array(with_nan(values), **options)
    refuse_huge(array, options.get("input_name") or "y")
    return array


def check_sample_weight(sample_weight: ArrayLike, X: Any, n_rows: int) -> NDArray[np.float64]:
    """Weights of the rows of X, none negative; a Series with labels is read by those of a frame's rows."""
    if isinstance(X, pd.DataFrame) and is_labelled(sample_weight) and not is_numbered(X.index):
        given: Any = sample_weight
        if not given.index.equals(X.index):
            if not given.index.is_unique or set(given.index) != set(X.index):
                raise ValueError("sample_weight has another index than X; expected a weight for each of its rows")
            sample_weight = given.loc[X.index]
    refuse_no_numbers(sample_weight, "sample_weight")
    weights = _check_sample_weight(sample_weight, np.empty((n_rows, 1)), ensure_non_negative=True)
    refuse_huge(weights, "sample_weight")
    return weights


def with_nan(X: Any) -> Any:
    """X with NaN for masked values, and for None and pandas' NA in object arrays; otherwise unchanged.

    Times, text, booleans, bytes and repeated column names are errors.
    """
    if isinstance(X, pd.DataFrame) and X.columns.has_duplicates:
        raise ValueError(f"the input has the columns {list(X.columns)}; expected each name once")
    refuse_no_numbers(X)
    if isinstance(X, pd.DataFrame) and any(dtype.kind == "O" for dtype in X.dtypes):
        return pd.DataFrame(without_missing(X.to_numpy(dtype=object)), X.index, X.columns)
    if isinstance(X, np.ndarray) and X.dtype == object:
        return without_missing(np.asarray(X))
    return without_mask(X)


def seeded(random_state: Any) -> np.random.RandomState | None:
    """A RandomState, or None; with None, parts draw from numpy's global state."""
    return None if random_state is None else check_random_state(random_state)


def seed_parts(estimator: BaseEstimator, random_state: np.random.RandomState | None) -> None:
    """Seed every ``random_state`` of an estimator and its parts that is None; None seeds nothing.

    FE models, and the parts of a part that has its own seed, are not seeded. A seed is drawn for every other part, so
    that giving one part its own seed does not change the seeds of the others.
    """
    if random_state is None:
        return
    parameters = estimator.get_params(deep=True)
    seeds = {}
    for name in sorted(parameters):
        if name == "random_state" or name.endswith("__random_state"):
            *parts, _ = name.split("__")
            if any(is_model(parameters.get("__".join(parts[: depth + 1]))) for depth in range(len(parts))):
                continue
            seed = random_state.randint(np.iinfo(np.int32).max)
            owners = ("__".join([*parts[:depth], "random_state"]) for depth in range(len(parts) + 1))
            if all(parameters.get(owner) is None for owner in owners):
                seeds[name] = seed
    estimator.set_params(**seeds)


def last_step(estimator: Any) -> Any:
    """The estimator at the end of a pipeline, the best one of a fitted search, or the estimator itself."""
    if isinstance(estimator, Pipeline):
        return last_step(estimator.steps[-1][1])
    if isinstance(estimator, BaseSearchCV):
        return last_step(getattr(estimator, "best_estimator_", estimator.estimator))
    return estimator
