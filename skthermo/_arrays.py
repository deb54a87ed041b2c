"""Arrays, matrices and seeds, without scikit-learn or pandas."""

from collections.abc import Mapping
from numbers import Integral
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Matrix: TypeAlias = Array | scipy.sparse.csc_array
Bounds: TypeAlias = ArrayLike | Mapping[str, float | tuple[float, float]]
RandomState: TypeAlias = int | np.random.RandomState | None


def real_array(values: Any, what: str) -> Array:
    """An array of floats; complex numbers, sparse matrices and what is not a number are errors.

    Raises
    ------
    ValueError
        Names what was given.
    """
    if scipy.sparse.issparse(values):
        raise ValueError(f"{what} is a sparse matrix; expected a dense array of numbers")
    if np.iscomplexobj(values):
        raise ValueError(f"{what} is complex; expected real numbers")
    if isinstance(values, np.ma.MaskedArray):
        values = values.astype(float).filled(np.nan)
    try:
        return as_floats(values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{what} is {values!r:.200}; expected numbers ({error})") from error


def as_floats(values: ArrayLike) -> Array:
    """An array of floats; missing values of a nullable pandas column become NaN."""
    if hasattr(values, "iloc"):  # a pandas frame or series
        return values.to_numpy(dtype=float, na_value=np.nan)
    return np.asarray(values, dtype=float)


def as_columns(values: ArrayLike) -> Array:
    """A table of floats; a vector becomes its only column."""
    array = as_floats(values)
    return array[:, np.newaxis] if array.ndim == 1 else array


def as_dense(matrix: Matrix) -> Array:
    """A matrix as an array."""
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def positive_integer(value: Any, what: str) -> int:
    """Python's integer of an integer of any kind; what is none, or not positive, is an error.

    NumPy's small integers overflow where they are multiplied.
    """
    if not isinstance(value, Integral) or isinstance(value, bool) or value < 1:
        raise ValueError(f"{what} is {value!r}; expected a positive integer")
    return int(value)


def as_random_state(seed: Any) -> np.random.RandomState:
    """scikit-learn's `check_random_state`, imported on first use because scikit-learn imports pandas."""
    from sklearn.utils import check_random_state

    try:
        return check_random_state(seed)
    except ValueError as error:
        raise ValueError(
            f"random_state is {seed!r}; expected an integer, a numpy.random.RandomState or None "
            "(of a numpy.random.Generator, generator.integers(2**31) draws an integer)"
        ) from error
