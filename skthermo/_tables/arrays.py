"""Arrays, matrices and seeds, without scikit-learn or pandas; what counts as a number: not times, text, booleans, bytes
or categories, which NumPy and pandas would convert."""

from collections.abc import Callable, Iterator, Mapping
from datetime import date, time, timedelta
from numbers import Integral, Real
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Matrix: TypeAlias = Array | scipy.sparse.csc_array
MatrixLike: TypeAlias = ArrayLike | scipy.sparse.sparray | scipy.sparse.spmatrix
Bounds: TypeAlias = ArrayLike | Mapping[str, float | tuple[float, float]]
RandomState: TypeAlias = int | np.random.RandomState | None

NO_NUMBERS = {
    "booleans": (bool, np.bool_),
    "text": (str,),
    "bytes": (bytes, bytearray, memoryview),
    "times": (date, time, timedelta, np.datetime64, np.timedelta64),
    "complex numbers": (complex, np.complexfloating),
}
KINDS = {"b": "booleans", "U": "text", "T": "text", "S": "bytes", "M": "times", "m": "times", "V": "records"}
HUGE = 1e150  # squares of larger numbers are infinite
NORMAL = 1.4826  # standard deviations of a normal distribution in one median absolute deviation


def real_array(values: Any, what: str, *, any_size: bool = False) -> Array:
    """An array of floats; complex numbers, sparse matrices and what is no number or, without ``any_size``, too
    large to be squared, are errors."""
    if values is None:
        raise ValueError(f"{what} is None; expected numbers")
    if scipy.sparse.issparse(values):
        raise ValueError(f"{what} is a sparse matrix; expected a dense array of numbers")
    try:
        array = None if np.iscomplexobj(values) else as_floats(values)
    except (TypeError, ValueError) as error:
        reason = str(error).partition(";")[0]
        raise ValueError(f"{what} is {values!r:.200}; expected numbers ({reason})") from error
    if array is None:
        raise ValueError(f"{what} is complex; expected real numbers")
    if not any_size:
        refuse_huge(array, what)
    return array


def shape_array(values: Any, what: str, *, any_size: bool = False) -> NDArray:
    """An array of floats or, where some are complex, of complex numbers: mode shapes."""
    values = without_mask(values)
    try:
        is_complex = np.iscomplexobj(values)
    except ValueError as error:  # rows of different length
        raise ValueError(f"{what} is {values!r:.200}; expected rows of one length") from error
    return np.asarray(values, dtype=complex) if is_complex else real_array(values, what, any_size=any_size)


def as_floats(values: Any) -> Array:
    """An array of floats; values that are masked or missing become NaN, and what is no number is an error."""
    values = without_mask(values)
    if scipy.sparse.issparse(values):
        raise ValueError("the input is a sparse matrix; expected a dense array of numbers")
    is_pandas = hasattr(values, "iloc")
    dtypes: list[Any] = np.ravel(values.dtypes).tolist() if is_pandas else [getattr(values, "dtype", None)]
    if dtypes and all(dtype == np.float64 for dtype in dtypes):
        return np.array(values) if is_pandas else np.asarray(values)
    refuse_no_numbers(values)
    array: Any = values if is_pandas else np.asarray(values)
    if any(dtype.kind == "c" for dtype in (dtypes if is_pandas else [array.dtype])):
        raise ValueError("the values are complex; expected real numbers")
    try:
        return array.to_numpy(dtype=float, na_value=np.nan) if is_pandas else array.astype(float, copy=False)
    except TypeError:  # pandas' NA in an object array is not a float
        return without_missing(np.asarray(array, dtype=object)).astype(float)


def without_mask(values: Any) -> Any:
    """A masked array becomes an array with NaN at masked values; anything else is returned unchanged."""
    if not isinstance(values, np.ma.MaskedArray):
        return values
    floats: Any = values if values.dtype.kind in "fc" else values.astype(float)
    return floats.filled(np.nan)


def without_missing(objects: NDArray[np.object_]) -> NDArray[np.object_]:
    """Objects with NaN in place of None and of pandas' NA."""
    from pandas import isna

    return np.where(isna(objects), np.nan, objects)


def as_columns(values: ArrayLike) -> Array:
    """A 2-D array of floats; a vector becomes a single column."""
    array = as_floats(values)
    return array[:, np.newaxis] if array.ndim == 1 else array


def as_dense(matrix: Matrix) -> Array:
    """A matrix as an array."""
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def positive_integer(value: Any, what: str) -> int:
    """A positive integer of any type as Python's ``int``; anything else is an error.

    NumPy's small integer types would overflow in products.
    """
    if not isinstance(value, Integral) or not is_real(value) or value < 1:
        raise ValueError(f"{what} is {value!r}; expected a positive integer")
    return int(value)


def as_random_state(seed: Any) -> np.random.RandomState:
    """scikit-learn's `check_random_state`, imported on first use because scikit-learn imports pandas."""
    from sklearn.utils import check_random_state

    try:
        if isinstance(seed, bool):
            raise ValueError
        return check_random_state(seed)
    except ValueError as error:
        raise ValueError(
            f"random_state is {seed!r}; expected None, an integer from 0 to {2**32 - 1} or a numpy.random.RandomState "
            "(generator.integers(2**31) draws an integer from a numpy.random.Generator)"
        ) from error


def spread_evenly(rows: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """At most that many of the rows, spread evenly over them."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), most)).astype(int))]


def range_sums(values: NDArray, first: NDArray[np.intp], stop: NDArray[np.intp]) -> Array:
    """Sums of the values over ranges of rows, each from its first row to the one before its stop."""
    totals = np.concatenate([np.zeros((1, *values.shape[1:])), values.cumsum(axis=0)])
    return totals[stop] - totals[first]


def broken_lines(values: Array, knots: Array) -> Array:
    """Columns, then max(column - knot, 0) of all columns for each row of knots."""
    return np.hstack([values, *(np.maximum(values - row, 0.0) for row in knots)])


def median(values: Array) -> Array:
    """Median of each column, NaN ignored; NaN for a column without a value.

    `numpy.nanmedian` takes ten times as long for a year of days, which it makes masked arrays of.
    """
    missing = np.isnan(values)
    if len(values) and not missing.any():
        return np.median(values, axis=0)
    known = (column[~gaps] for column, gaps in zip(values.T, missing.T, strict=True))
    return np.array([np.median(column) if len(column) else np.nan for column in known])


def means_of_known(values: Array, axis: int = 0) -> Array:
    """Means without NaN along one axis of a table; NaN, without a warning, where nothing is known."""
    counts = (~np.isnan(values)).sum(axis=axis)
    return np.divide(np.nansum(values, axis=axis), counts, out=np.full(len(counts), np.nan), where=counts > 0)


def robust_deviation(values: Array) -> Array:
    """Standard deviations of columns that outliers hardly move, NaN ignored; from the median of the distances."""
    return NORMAL * median(np.abs(values - median(values)))


def patterns(mask: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Different rows of a mask, and which of them each row is."""
    if mask.all():
        return mask[:1], np.zeros(len(mask), dtype=np.intp)
    packed = np.packbits(mask, axis=1)
    keys = np.ascontiguousarray(packed).view(np.dtype((np.void, packed.shape[1]))).ravel()
    first, of_row = np.unique(keys, return_index=True, return_inverse=True)[1:]
    return mask[first], of_row.ravel()


def rows_by_pattern(mask: NDArray[np.bool_]) -> list[tuple[NDArray[np.bool_], NDArray[np.intp]]]:
    """Different rows of a mask, each with the positions at which it occurs."""
    masks, of_row = patterns(mask)
    order = np.argsort(of_row, kind="stable")
    return list(zip(masks, np.split(order, np.cumsum(np.bincount(of_row))[:-1]), strict=True)) if len(mask) else []


def central_differences(function: Callable[[Array], Array], theta: Array, values: Array, step: float) -> Array:
    """Derivatives of a function at rows of theta by a relative step, (n_samples, ..., n_parameters).

    The function turns rows of theta into values (n_rows, ...); where it is NaN on one side, ``values``, those at theta,
    take its place.
    """
    n_samples, n_parameters = theta.shape
    steps = step * theta[:, np.newaxis] * np.eye(n_parameters)  # (sample, perturbed parameter, parameter)
    moved = np.stack([theta[:, np.newaxis] + steps, theta[:, np.newaxis] - steps])
    sides = function(moved.reshape(-1, n_parameters)).reshape(2, n_samples, n_parameters, *values.shape[1:])
    known = ~np.isnan(sides)
    above, below = np.where(known, sides, values[:, np.newaxis])
    n_known = np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    widths = n_known * (step * theta).reshape(n_samples, n_parameters, *[1] * (values.ndim - 1))
    return np.moveaxis((above - below) / widths, 1, -1)


def is_real(value: Any) -> bool:
    """Whether a value is a real number; True, False and durations are none."""
    return isinstance(value, Real) and not isinstance(value, bool | np.timedelta64)


def refuse_no_numbers(values: Any, what: str = "the input") -> None:
    """Raise an error for an array, a table or nested lists with values that are no numbers.

    NumPy and pandas would read "1.0" and True as 1, and a date as nanoseconds.
    """
    if isinstance(values, type) or callable(values):
        raise ValueError(f"{what} is {values!r:.100}; expected numbers")
    for name, part in _parts(values):
        what, example = _no_number(part)
        if what:
            where = f"column {name!r}" if name is not None else what
            hint = f", and times as the index of a pandas frame, as by frame.set_index({name!r})"
            raise ValueError(
                f"{where} holds {what}, such as {example!r:.60}; expected numbers"
                f"{hint if name is not None and what == 'times' else ''}"
            )


def refuse_huge(values: Any, what: str) -> None:
    """Raise an error for finite numbers that are too large to be squared."""
    array = np.asarray(values)
    if array.dtype == np.float64 and array.size and np.fmax.reduce(np.abs(array), axis=None) > HUGE:
        huge = array[np.isfinite(array) & (np.abs(array) > HUGE)]
        if huge.size:
            raise ValueError(f"{what} holds {huge[0]:g}; expected numbers from {-HUGE:g} to {HUGE:g}")


def _parts(values: Any) -> Iterator[tuple[Any, Any]]:
    """Columns of a frame that may hold no numbers, by name; of anything else the values themselves."""
    if not (hasattr(type(values), "columns") and hasattr(type(values), "dtypes")):
        yield None, values
        return
    for place, (name, dtype) in enumerate(zip(values.columns, values.dtypes, strict=True)):
        if not isinstance(dtype, np.dtype) or dtype.kind not in "fiuc":
            yield name, values.iloc[:, place] if hasattr(values, "iloc") else values[name].to_numpy()


def _no_number(values: Any) -> tuple[str, Any]:
    """What kind of values are no numbers, and the first of them; an empty text if all are numbers."""
    if isinstance(values, list | tuple):
        if len({len(row) for row in values if isinstance(row, list | tuple)}) > 1:
            return "rows of different lengths", values
        return next((found for found in map(_no_number, values) if found[0]), ("", None))
    dtype = getattr(values, "dtype", None)
    if dtype is None:
        return _kind_of(values), values
    kind = "categories" if str(dtype) == "category" else KINDS.get(getattr(dtype, "kind", ""), "")
    if kind:
        return kind, next(iter(np.ravel(np.asarray(values, dtype=object))), None)
    if getattr(dtype, "kind", "") == "O":
        objects = np.ravel(np.asarray(values, dtype=object))
        kinds = {kind: _kind_of_type(kind) for kind in set(map(type, objects))}
        if any(kinds.values()):
            example = next(value for value in objects if kinds[type(value)])
            return kinds[type(example)], example
    return "", None


def _kind_of(value: Any) -> str:
    return _kind_of_type(type(value))


def _kind_of_type(cls: type) -> str:
    return next((what for what, classes in NO_NUMBERS.items() if issubclass(cls, classes)), "")
