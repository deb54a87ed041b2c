"""Arrays, numbers, names and other arguments as users give them, read and checked without scikit-learn or pandas.

What counts as a number: not times, text, booleans, bytes or categories, which NumPy and pandas would convert. Checks
return their argument, or raise a ValueError that says what was got and what was expected; values with names are read by
name.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from datetime import date, time, timedelta
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

from skthermo.exceptions import RecordsWarning

Array: TypeAlias = NDArray[np.float64]
Matrix: TypeAlias = Array | scipy.sparse.csc_array
MatrixLike: TypeAlias = ArrayLike | scipy.sparse.sparray | scipy.sparse.spmatrix
Bounds: TypeAlias = ArrayLike | Mapping[str, float | tuple[float, float]]
RandomState: TypeAlias = int | np.random.RandomState | None
HUGE = 1e150  # squares of larger numbers are infinite
NORMAL = 1.4826  # standard deviations of a normal distribution in one median absolute deviation
Reduce: TypeAlias = bool | float | Literal["auto"]


def real_array(values: Any, what: str, *, any_size: bool = False) -> Array:
    """An array of floats; complex numbers, sparse matrices, other values than numbers and, without ``any_size``,
    numbers too large to be squared are errors."""
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
    """An array of floats; values that are masked or missing become NaN, and other values than numbers are errors."""
    values = without_mask(values)
    if scipy.sparse.issparse(values):
        raise ValueError("the input is a sparse matrix; expected a dense array of numbers")
    is_pandas = hasattr(values, "iloc")
    dtypes: list[Any] = np.ravel(values.dtypes).tolist() if is_pandas else [getattr(values, "dtype", None)]
    if set(dtypes) == {np.dtype(float)}:
        return np.array(values) if is_pandas else np.asarray(values)
    refuse_no_numbers(values)
    array: Any = values if is_pandas else np.asarray(values)
    if any(dtype.kind == "c" for dtype in (dtypes if is_pandas else [array.dtype])):
        raise ValueError("Complex data not supported: the values are complex; expected real numbers")
    try:
        return array.to_numpy(dtype=float, na_value=np.nan) if is_pandas else array.astype(float, copy=False)
    except TypeError:  # pandas' NA in an object array is not a float
        pass
    from pandas import isna

    objects = np.asarray(array, dtype=object)
    try:
        return np.where(isna(objects), np.nan, objects).astype(float)
    except TypeError as error:
        raise TypeError(f"the input is {values!r:.100}; expected numbers ({error})") from error


def without_mask(values: Any) -> Any:
    """A masked array becomes an array with NaN at masked values; anything else is returned unchanged."""
    if not isinstance(values, np.ma.MaskedArray):
        return values
    floats: Any = values if values.dtype.kind in "fc" else values.astype(float)
    return floats.filled(np.nan)


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
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]


def piecewise_linear(values: Array, knots: Array) -> Array:
    """Columns, then max(column - knot, 0) of all columns for each row of knots."""
    return np.hstack([values, *np.maximum(values - knots[:, np.newaxis], 0.0)])


def median(values: Array) -> Array:
    """Median of each column, NaN ignored; NaN for a column without a value.

    `numpy.nanmedian` takes ten times as long for a year of days, which it makes masked arrays of.
    """
    missing = np.isnan(values)
    if len(values) and not missing.any():
        return np.median(values, axis=0)
    found = np.full(values.shape[1], np.nan)
    for place, column in enumerate(values.T):
        known = column[~missing[:, place]]
        found[place] = np.median(known) if len(known) else np.nan
    return found


def means_of_known(values: Array, axis: int = 0) -> Array:
    """Means without NaN along one axis of a table; NaN, without a warning, where nothing is known."""
    counts = (~np.isnan(values)).sum(axis=axis)
    return np.divide(np.nansum(values, axis=axis), counts, out=np.full(len(counts), np.nan), where=counts > 0)


def means_of_usual(frequencies: Array, names: Sequence[Any]) -> tuple[Array, list[RecordsWarning]]:
    """Means of columns of frequencies, NaN ignored, without values that are not positive or are farther than half of it
    from the median of the others, and the finding of these values."""
    middle = median(np.where((frequencies > 0) & np.isfinite(frequencies), frequencies, np.nan))
    is_usual = np.abs(frequencies - middle) <= middle / 2
    counts = (~is_usual & ~np.isnan(frequencies)).sum(axis=0)
    means = means_of_known(np.where(is_usual, frequencies, np.nan))
    if not counts.any():
        return means, []
    where = ", ".join(f"{name!r} ({count})" for name, count in zip(names, counts, strict=True) if count)
    text = f"{counts.sum()} frequencies are not positive, or far from all others: {where}. They count as missing"
    return means, [RecordsWarning(f"{text}. Put NaN there", "set-aside")]


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
    """Derivatives of a function of rows of theta by a relative step, (n_samples, ..., n_parameters). Where it is NaN on
    one side, ``values``, those at theta, take its place."""
    n_samples, n_parameters = theta.shape
    steps = step * theta[:, np.newaxis] * np.eye(n_parameters)  # (sample, perturbed parameter, parameter)
    moved = np.stack([theta[:, np.newaxis] + steps, theta[:, np.newaxis] - steps])
    sides = function(moved.reshape(-1, n_parameters)).reshape(2, n_samples, n_parameters, *values.shape[1:])
    known = ~np.isnan(sides)
    above, below = np.where(known, sides, values[:, np.newaxis])
    n_known = np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    widths = n_known * (step * theta).reshape(n_samples, n_parameters, *[1] * (values.ndim - 1))
    return np.moveaxis((above - below) / widths, 1, -1)


def cramer_rao(information: Array, negligible: float = 1e-12) -> Array:
    """Smallest covariance of unbiased estimates: the inverse of a Fisher information matrix, which may be singular.

    Parameters that are not determined have infinite variances and NaN covariances. An eigenvalue of the scaled matrix
    below the negligible share of the largest counts as zero. With NaN in the information, all is NaN.

    >>> cramer_rao(np.array([[4.0, 0.0], [0.0, 0.0]]))
    array([[0.25,  nan],
           [ nan,  inf]])
    """
    if not np.isfinite(information).all():
        return np.full_like(information, np.nan)
    scale = np.sqrt(np.diagonal(information))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    known = values > negligible * max(values[-1], np.finfo(float).tiny)
    covariance = (vectors[:, known] / values[known]) @ vectors[:, known].T / np.outer(scale, scale)
    unknown = (vectors[:, ~known] ** 2).sum(axis=1) > np.sqrt(negligible)
    covariance[unknown] = covariance[:, unknown] = np.nan
    covariance[unknown, unknown] = np.inf
    return covariance


def is_real(value: Any) -> bool:
    """Whether a value is a real number; True, False and durations are none."""
    return isinstance(value, Real) and not isinstance(value, bool | np.timedelta64)


def refuse_no_numbers(values: Any, what: str = "the input") -> None:
    """Raise an error for an array, a table or nested lists with values that are no numbers.

    NumPy and pandas would read "1.0" and True as 1, and a date as nanoseconds. Flags are columns of a frame.
    """
    refuse_arrow(values, what)
    if isinstance(values, type) or callable(values):
        raise ValueError(f"{what} is {values!r:.100}; expected numbers")
    parts = {None: values}
    if hasattr(type(values), "columns") and hasattr(type(values), "dtypes"):
        parts = {}
        for place, (name, dtype) in enumerate(zip(values.columns, values.dtypes, strict=True)):
            if str(dtype).lower() != "boolean" and (not isinstance(dtype, np.dtype) or dtype.kind not in "fiucb"):
                parts[name] = values.iloc[:, place] if hasattr(values, "iloc") else values[name].to_numpy()
    for name, part in parts.items():
        kind, example = _no_number(part)
        if kind:
            where = what if name is None else f"column {name!r}"
            hint = ""
            if kind == "times" and name is not None:
                hint = f", and times as the index of a pandas frame, as by frame.set_index({name!r})"
            raise ValueError(f"{where} holds {kind}, such as {example!r:.60}; expected numbers{hint}")


def refuse_arrow(values: Any, what: str) -> None:
    """Raise an error for a table of pyarrow, which is no frame to scikit-learn either."""
    if type(values).__module__.startswith("pyarrow"):
        raise ValueError(f"{what} is a {type(values).__name__} of pyarrow; expected a frame, as to_pandas() gives")


def refuse_no_array(values: Any, what: str, expected: str = "expected an array or a frame of numbers") -> None:
    """Raise an error for an argument without rows: no list, no dense array and nothing that becomes one."""
    refuse_arrow(values, what)
    if scipy.sparse.issparse(values):
        raise TypeError(f"{what} is a sparse matrix; expected a dense array of numbers")
    if isinstance(values, type) or not (isinstance(values, list | tuple) or hasattr(values, "__array__")):
        raise ValueError(f"{what} is {values!r:.100}, of type {type(values).__name__}; {expected}")


def refuse_no_table(values: Any, what: str, *, or_vector: bool = False) -> None:
    """Raise an error for an argument that is no dense table of real numbers, (n_samples, n_columns), or has columns
    whose names are not all text or all numbers; a vector may stand for a table of one column."""
    expected = "expected a table of numbers, (n_samples, n_columns): a frame or an array"
    refuse_no_array(values, what, expected)
    refuse_no_numbers(values, what)
    shape = values.shape if hasattr(values, "shape") else np.asarray(values).shape
    if len(shape) != 2 and not (len(shape) == 1 and or_vector):
        if hasattr(values, "iloc"):
            raise ValueError(f"{what} is a Series, {values.name!r}; expected a frame, as {what}.to_frame() gives")
        raise ValueError(
            f"{what} has {len(shape)} dimensions, shape {shape}; {expected}. Reshape your data by reshape(-1, 1) if it "
            "is one column, by reshape(1, -1) if it is one row"
        )
    names = list(getattr(values, "columns", ()))
    if len(set(names)) < len(names):
        raise ValueError(f"{what} has the columns {names}; expected each name once")
    are_text = {isinstance(name, str) for name in names}
    if len(are_text) > 1 or any(isinstance(name, tuple) for name in names):
        kind = "tuples" if isinstance(names[0], tuple) else "partly text and partly not"
        raise ValueError(
            f"the names of the columns of {what} are {kind}, such as {names[0]!r}; expected text, as in "
            f"{what}.columns = ['T1', 'T2', 'f1']"
        )


def refuse_huge(values: Any, what: str) -> None:
    """Raise an error for finite numbers that are too large to be squared."""
    array = np.asarray(values)
    if array.dtype == np.float64 and array.size and np.fmax.reduce(np.abs(array), axis=None) > HUGE:
        huge = array[np.isfinite(array) & (np.abs(array) > HUGE)]
        if huge.size:
            raise ValueError(f"{what} holds {huge[0]:g}; expected numbers from {-HUGE:g} to {HUGE:g}")


def _no_number(values: Any) -> tuple[str, Any]:
    """What kind of values are no numbers, and the first of them; an empty text if all are numbers."""
    if isinstance(values, list | tuple):
        if len({len(row) for row in values if isinstance(row, list | tuple)}) > 1:
            return "rows of different lengths", values
        return next((found for found in map(_no_number, values) if found[0]), ("", None))
    dtype = getattr(values, "dtype", None)
    kinds = {"b": "booleans", "U": "text", "T": "text", "S": "bytes", "M": "times", "m": "times", "V": "records"}
    kind = "categories" if str(dtype) == "category" else kinds.get(getattr(dtype, "kind", ""), "")
    if kind:
        return kind, next(iter(np.ravel(np.asarray(values, dtype=object))), None)
    objects = [values] if dtype is None else []
    if getattr(dtype, "kind", "") == "O":
        objects = np.ravel(np.asarray(values, dtype=object))
    firsts = dict(zip(map(type, objects[::-1]), objects[::-1], strict=True))  # the first value of each type
    no_numbers = {
        "booleans": (bool, np.bool_),
        "text": (str,),
        "bytes": (bytes, bytearray, memoryview),
        "times": (date, time, timedelta, np.datetime64, np.timedelta64),
        "complex numbers": (complex, np.complexfloating),
    }
    for kind, classes in no_numbers.items():
        for cls, example in firsts.items():
            if issubclass(cls, classes):
                return kind, example
    return "", None


def check_theta(
    theta: ArrayLike, parameter_names: Sequence[str], *, allow_nan: bool = False, one_row: bool = False
) -> Array:
    """Rows of finite, positive multipliers, one column for each parameter."""
    names = list(parameter_names)
    values = real_array(by_name(theta, names, "theta"), "theta")
    rows = values[np.newaxis] if values.ndim == 1 else values
    if rows.ndim != 2 or rows.shape[1] != len(names):
        raise ValueError(
            f"theta has shape {values.shape}; expected (n_samples, {len(names)}), "
            f"a column for each of the parameters {names}"
        )
    wrong = ~(np.isfinite(rows) & (rows > 0)) & ~(allow_nan & np.isnan(rows))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise ValueError(
            f"theta must be finite and positive; row {row}, parameter {names[column]!r} "
            f"is {rows[row, column]} ({np.count_nonzero(wrong)} such values in all)"
        )
    if one_row and len(rows) != 1:
        raise ValueError(f"theta has {len(rows)} rows; expected one")
    return rows


def check_bounds(bounds: Bounds, parameter_names: Sequence[str]) -> Array:
    """Lowest and highest multiplier of every parameter."""
    names = list(parameter_names)
    if isinstance(bounds, Mapping) or is_labelled(bounds):
        ends = np.empty((len(names), 2))
        for name, own, width in zip(names, ends, by_name(bounds, names, "bounds"), strict=True):
            what = f"bounds of parameter {name!r} are {width!r}; expected a half-width"
            if np.ndim(width) == 0 and not (is_real(width) and 0 < float(width) < 1):
                raise ValueError(f"{what} between 0 and 1, or (lowest, highest)")
            if np.shape(width) not in ((), (2,)):
                raise ValueError(f"{what} or (lowest, highest)")
            own[:] = check_bounds(width if np.ndim(width) == 0 else [width], [name])
        return ends
    table = by_name(bounds, ("lowest", "highest"), "bounds", "columns")
    if hasattr(table, "iloc") and table.ndim == 2 and not is_numbered(table.index):
        table = by_name(table.T, names, "bounds").T
    array = real_array(table, "bounds")
    if array.ndim == 0:
        if not 0 < array < 1:
            raise ValueError(f"bounds is {array}; expected a half-width between 0 and 1, such as 0.3 for 30 %")
        return np.tile([1 - array, 1 + array], (len(names), 1))
    if array.shape != (len(names), 2):
        raise ValueError(
            f"bounds has shape {array.shape}; expected a half-width or ({len(names)}, 2), lowest and highest "
            f"multipliers of {names}, or a mapping of these names"
        )
    for name, (lowest, highest) in zip(names, array, strict=True):
        if not 0 < lowest < highest < np.inf:
            raise ValueError(f"bounds of parameter {name!r} are [{lowest}, {highest}]; expected 0 < lowest < highest")
    return array


def check_prior(prior: ArrayLike | Mapping[str, float], parameter_names: Sequence[str]) -> Array:
    """Standard deviation of the prior of every parameter."""
    names = list(parameter_names)
    deviations = real_array(by_name(prior, names, "prior"), "prior")
    if deviations.shape not in ((), (len(names),)) or not ((deviations > 0) & (deviations <= 1)).all():
        raise ValueError(
            f"prior is {deviations}; expected relative standard deviations above 0 and at most 1 (0.3 means 30 %), "
            f"a number or one for each of {names}"
        )
    return np.broadcast_to(deviations, (len(names),))


def check_noise(
    noise: ArrayLike,
    n_modes: int,
    mode_names: Sequence[Any] | None = None,
    *,
    what: str = "noise",
    most: float = 0.2,
) -> NDArray[np.float64]:
    """Relative standard deviation of every mode; where all are larger than ``most``, percent may be meant."""
    array = real_array(by_mode(noise, n_modes, mode_names, what), what)
    if array.shape not in ((), (n_modes,)) or not ((array >= 0) & (array < 1)).all():
        raise ValueError(
            f"{what} is {array}; expected a relative standard deviation, 0 or more and below 1 (0.01 means 1 %), "
            f"a number or one for each of the {n_modes} modes"
        )
    if (array > most).all():  # a single mode may be unknown
        raise ValueError(
            f"{what} is {array}, which means {100 * np.min(array):.0f} % or more in every mode; expected at most "
            f"{most:g} in some mode. If percent were meant, give {np.min(array) / 100:g} for {np.min(array):g} %"
        )
    return np.broadcast_to(array, (n_modes,))


def by_mode(values: Any, n_modes: int, mode_names: Sequence[Any] | None, what: str) -> Any:
    """Values of a Series or mapping by mode in the order of the modes, which are named f1, f2, ... by default."""
    names = [f"f{i + 1}" for i in range(n_modes)] if mode_names is None else list(mode_names)[:n_modes]
    return by_name(values, names, what, "modes")


def check_flag(flag: Any, what: str) -> bool:
    """Whether a flag is set; anything but a boolean is an error."""
    if not isinstance(flag, bool | np.bool_):
        raise ValueError(f"{what} is {flag!r:.100}; expected True or False")
    return bool(flag)


def check_jobs(n_jobs: Any) -> None:
    """Raise an error unless this is a number of joblib's jobs."""
    if n_jobs is not None and (not isinstance(n_jobs, Integral) or isinstance(n_jobs, bool) or n_jobs == 0):
        raise ValueError(f"n_jobs is {n_jobs!r}; expected an integer, such as 2, or -1 for all processors, or None")


def check_names(names: Any, what: str, known: Iterable[Any] | None = None) -> list[str]:
    """Different names, all of them known, as a list; one text in place of several is an error."""
    given = names if isinstance(names, str | bytes | type) or not isinstance(names, Iterable) else list(names)
    if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
        raise ValueError(f"{what} is {names!r:.100}; expected a list of names, such as ['deck']")
    if len(set(given)) < len(given):
        raise ValueError(f"{what} are {given!r:.200}; expected each name once")
    unknown = [] if known is None else [name for name in given if name not in known]
    if unknown:
        raise ValueError(f"{what} names {unknown!r:.200}; expected some of {list(known)}")
    return given


def check_size(value: Any, what: str, lowest: float, highest: float, expected: str) -> float:
    """A real number strictly between two others."""
    if not is_real(value) or not lowest < float(value) < highest:
        raise ValueError(f"{what} is {value!r:.100}; expected {expected}")
    return float(value)


def check_probability(value: Any, what: str) -> float:
    """A probability strictly between 0 and 1."""
    return check_size(value, what, 0, 1, "a probability between 0 and 1, such as 0.9")


def integer_row(values: Any, what: str, expected: str = "integers in one row") -> NDArray[np.integer]:
    """One or more integers; anything else, also True and False among them, is an error."""
    try:
        array = np.asarray(values)
        is_row = array.ndim == 1 and array.size and np.issubdtype(array.dtype, np.integer)
        refuse_no_numbers(values, what)
    except ValueError as error:  # also rows of different length
        raise ValueError(f"{what} is {values!r:.200}; expected {expected}") from error
    if not is_row:
        raise ValueError(
            f"{what} is {values!r:.100}, of shape {array.shape} and type {array.dtype}; expected {expected}"
        )
    return array


def check_path(path: Any, what: str = "path") -> Path:
    """A path, given as text or as a path."""
    if not isinstance(path, str | PathLike) or not str(path):
        raise ValueError(f"{what} is {path!r:.200}; expected a path, as text or a pathlib.Path")
    return Path(path)


Label: TypeAlias = tuple[Hashable, Hashable]


def check_dofs(dofs: ArrayLike, n_dof: int, labels: Sequence[Label] = ()) -> NDArray[np.intp]:
    """Different degrees of freedom of a model by position, from positions or from labels, such as (12, "x")."""
    given: Any = dofs.tolist() if isinstance(dofs, np.ndarray) else dofs
    are_rows = isinstance(given, list | tuple) and len(given) > 0
    if are_rows and all(isinstance(row, list | tuple) and len(row) == 2 for row in given):
        if not labels:
            raise ValueError(
                f"dofs holds {given[0]!r:.100}, but the model's degrees of freedom have no labels; expected 0 to "
                f"{n_dof - 1}"
            )
        places = {label: i for i, label in enumerate(labels)}
        unknown = [row for row in map(tuple, given) if not is_label(row) or row not in places]
        if unknown:
            raise ValueError(
                f"dofs holds {unknown[0]!r:.100}; expected degrees of freedom of the model, such as {labels[0]!r} "
                "(model.dofs lists all)"
            )
        dofs = [places[tuple(row)] for row in given]
    array = integer_row(dofs, "dofs")
    outside = array[(array < 0) | (array >= n_dof)]
    if outside.size:
        raise ValueError(f"dofs holds {outside[0]}; expected 0 to {n_dof - 1}, the model's degrees of freedom")
    values, counts = np.unique(array, return_counts=True)
    if (counts > 1).any():
        raise ValueError(f"dofs holds {values[counts > 1][0]} more than once; expected each degree of freedom once")
    return array.astype(np.intp)


def is_label(dof: Any) -> bool:
    """Whether something can be the label of a degree of freedom, (node, direction)."""
    try:
        hash(dof)
    except TypeError:
        return False
    return isinstance(dof, tuple) and len(dof) == 2 and not any(isinstance(part, bool) for part in dof)


def is_model(candidate: Any) -> bool:
    """Whether an object has the attributes of an FE model."""
    has_names = hasattr(candidate, "parameter_names") and hasattr(candidate, "n_modes")
    return has_names and hasattr(candidate, "frequencies") and not isinstance(candidate, type)


def check_model(candidate: Any) -> None:
    """Raise an error for an object that is not an FE model."""
    if not is_model(candidate):
        raise ValueError(
            f"model is {candidate!r:.200}; expected an FE model, an object with parameter_names, n_modes and "
            "frequencies"
        )


def by_name(values: Any, names: Sequence[Any], what: str, kind: str = "parameters") -> Any:
    """Values of a mapping, a Series with labels or a frame with named columns, in the order of the names; anything else
    unchanged.

    The labels must be exactly the names. Labels 0, 1, 2, ... are no names.
    """
    is_table = hasattr(values, "columns") and not is_numbered(values.columns)
    if not is_table and not isinstance(values, Mapping) and not is_labelled(values):
        return values
    labels = list(values.columns if is_table else values if isinstance(values, Mapping) else values.index)
    unknown = [label for label in labels if label not in names]
    missing = [name for name in names if name not in labels]
    repeated = [label for place, label in enumerate(labels) if label in labels[:place]]
    for wrong, problem in ((unknown, "unknown"), (missing, "missing"), (repeated, "repeated")):
        if wrong:
            raise ValueError(f"{what}: {wrong} are {problem}; expected each of the {kind} {list(names)}")
    return values[list(names)] if is_table else [values[name] for name in names]


def is_labelled(values: Any) -> bool:
    """Whether values are a Series of pandas whose labels are not just 0, 1, 2, ..."""
    return hasattr(values, "iloc") and values.ndim == 1 and not is_numbered(values.index)


def is_numbered(labels: Any) -> bool:
    """Whether labels are just 0, 1, 2, ..., which name nothing."""
    return list(labels) == list(range(len(labels)))


def as_mapping(values: Any) -> Any:
    """A Series with different labels as a mapping; anything else unchanged."""
    return dict(values.items()) if is_labelled(values) and values.index.is_unique else values


def mapping_of(values: Any, what: str, expected: str) -> Mapping[Any, Any]:
    """A mapping, or a Series with different labels as one; an error for anything else."""
    mapping = as_mapping(values)
    if not isinstance(mapping, Mapping):
        raise ValueError(f"{what} is {values!r:.200}; expected {expected}")
    return mapping


def tolerance(model: Any, reduce: Reduce, n_solves: int = 0) -> float | None:
    """Relative error allowed in the frequencies of a reduced model, read from ``reduce``; None without reduction.

    "auto" reduces models that state by ``reduction_pays`` that it saves time for a number of solves.
    """
    if is_auto(reduce):
        pays = hasattr(model, "reduced") and hasattr(model, "reduction_pays") and model.reduction_pays(n_solves)
        return 1e-5 if pays else None
    if not reduce:
        return None
    if not hasattr(model, "reduced"):
        raise ValueError(
            f"reduce is {reduce}, but {model!r} has no method 'reduced'; expected a model with one, such as "
            "AffineModel, or reduce=False"
        )
    return 1e-5 if isinstance(reduce, (bool, np.bool_)) else reduce


def is_auto(value: Any) -> bool:
    """Whether a parameter is "auto"; it may be an array, or anything else."""
    return isinstance(value, str) and value == "auto"
