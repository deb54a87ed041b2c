"""The one import point for scikit-learn's private helpers, and input checks shared by estimators."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, _fit_context, clone
from sklearn.impute._base import _BaseImputer
from sklearn.model_selection._search import BaseSearchCV
from sklearn.neighbors._base import _get_weights
from sklearn.utils import check_array, check_random_state
from sklearn.utils._param_validation import HasMethods, Interval, StrOptions
from sklearn.utils.validation import _check_feature_names_in, _num_samples, check_is_fitted, validate_data

__all__ = [
    "BaseSearchCV",
    "HasMethods",
    "Interval",
    "StrOptions",
    "_BaseImputer",
    "_check_feature_names_in",
    "_fit_context",
    "_get_weights",
    "_num_samples",
    "as_columns",
    "as_floats",
    "check_array",
    "check_is_fitted",
    "check_columns",
    "check_same_rows",
    "clone_sharing_models",
    "column_names",
    "is_model",
    "like",
    "seed_parts",
    "seeded",
    "validate_data",
]


PREFIXES = {"temperature": "T", "frequency": "f"}


def is_model(candidate: Any) -> bool:
    """Whether an object is an FE model, judged by what it can do."""
    wanted = ("parameter_names", "n_modes", "frequencies")
    return not isinstance(candidate, type) and all(hasattr(candidate, name) for name in wanted)


def like(X: Any, values: NDArray, columns: Sequence[str]) -> Any:
    """Values as a frame with X's index where X is a frame, else as they are."""
    if not isinstance(X, pd.DataFrame):
        return values
    return pd.DataFrame(values, index=X.index, columns=list(columns), copy=False)


def as_floats(values: ArrayLike) -> NDArray[np.float64]:
    """An array of floats; what a nullable pandas column misses becomes NaN."""
    if isinstance(values, pd.DataFrame | pd.Series):
        return values.to_numpy(dtype=float, na_value=np.nan)
    return np.asarray(values, dtype=float)


def as_columns(values: ArrayLike) -> NDArray[np.float64]:
    """A table of floats; a vector becomes its only column."""
    array = as_floats(values)
    return array[:, np.newaxis] if array.ndim == 1 else array


def column_names(X: Any, default: str) -> list[str]:
    """Names of X's columns, for messages and outputs: a frame's own, else default1, default2, ..."""
    if isinstance(X, pd.DataFrame):
        return [str(name) for name in X.columns]
    return [f"{default}{i + 1}" for i in range(np.shape(X)[1])]


def check_columns(X: ArrayLike, what: str, *, varying: bool = False) -> None:
    """Refuse columns that hold no value, or (``varying``) only one value in two or more rows.

    Raises
    ------
    ValueError
        Names the column.
    """
    for name, column in zip(column_names(X, PREFIXES[what]), as_floats(X).T, strict=True):
        present = column[~np.isnan(column)]
        if not present.size:
            raise ValueError(f"{what} column {name!r} is NaN in all {len(column)} rows; expected values")
        if varying and len(column) > 1 and np.ptp(present) == 0:
            raise ValueError(
                f"{what} column {name!r} is constant ({present[0]:g} in all {present.size} rows with a value); "
                "expected one that varies: leave it out"
            )


def check_same_rows(X: Any, y: Any, names: tuple[str, str]) -> None:
    """Refuse two tables of different length or, where both are frames, of different index.

    Raises
    ------
    ValueError
        Names the first row that differs.
    """
    if _num_samples(X) != _num_samples(y):
        raise ValueError(
            f"{names[0]} has {_num_samples(X)} rows and {names[1]} {_num_samples(y)}; expected the same number"
        )
    if not isinstance(X, pd.DataFrame) or not isinstance(y, pd.DataFrame | pd.Series) or X.index.equals(y.index):
        return
    for row, (left, right) in enumerate(zip(X.index, y.index, strict=True)):
        if left != right:
            raise ValueError(
                f"{names[0]} and {names[1]} have different indices (row {row}: {left} and {right}); expected the same"
            )


def seeded(random_state: Any) -> np.random.RandomState | None:
    """A RandomState, or None, with which parts draw from numpy's global state."""
    return None if random_state is None else check_random_state(random_state)


def seed_parts(estimator: BaseEstimator, random_state: np.random.RandomState | None) -> None:
    """Seed every ``random_state`` of an estimator and its parts that is None; None seeds nothing.

    What stands inside a part with a seed of its own is that part's to seed. A seed is drawn for every part, so
    that seeding one leaves the rest as they were.
    """
    if random_state is None:
        return
    parameters = estimator.get_params(deep=True)
    seeds = {}
    for name in sorted(parameters):
        if name == "random_state" or name.endswith("__random_state"):
            seed = random_state.randint(np.iinfo(np.int32).max)
            *parts, _ = name.split("__")
            owners = ("__".join([*parts[:depth], "random_state"]) for depth in range(len(parts) + 1))
            if all(parameters.get(owner) is None for owner in owners):
                seeds[name] = seed
    estimator.set_params(**seeds)


def clone_sharing_models(estimator: BaseEstimator) -> BaseEstimator:
    """scikit-learn's clone, but FE models are shared and never copied."""
    parameters = estimator.get_params(deep=False)
    twin = type(estimator)(
        **{name: value if is_model(value) else clone(value, safe=False) for name, value in parameters.items()}
    )
    for name in ("_metadata_request", "_sklearn_output_config"):
        if hasattr(estimator, name):
            setattr(twin, name, clone(getattr(estimator, name), safe=False))
    return twin
