"""Checks of models, theta, bounds, priors, noise, degrees of freedom and units; values with names are read by name.

Each check returns its argument as an array, or raises a ValueError that says what was got and what was expected.
"""

from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._tables.arrays import Array, Bounds, is_real, real_array, refuse_no_numbers

Reduce: TypeAlias = bool | float | Literal["auto"]

DEFAULT_TOLERANCE = 1e-5  # relative error of the frequencies of a reduced model
MOST_NOISE = 0.2  # largest relative noise of frequencies: more is meant in percent


def check_theta(
    theta: ArrayLike, parameter_names: Sequence[str], *, allow_nan: bool = False, one_row: bool = False
) -> Array:
    """Rows of finite, positive multipliers, one column for each parameter."""
    names = list(parameter_names)
    values = real_array(by_name(columns_by_name(theta, names, "theta"), names, "theta"), "theta")
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
        widths = by_name(bounds, names, "bounds")
        return np.vstack([check_bounds(_pair(width, name), [name]) for name, width in zip(names, widths, strict=True)])
    ends = columns_by_name(bounds, ("lowest", "highest"), "bounds", "columns")
    array = real_array(rows_by_name(ends, names, "bounds"), "bounds")
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
    most: float = MOST_NOISE,
) -> NDArray[np.float64]:
    """Relative standard deviation of every mode."""
    array = real_array(by_mode(noise, n_modes, mode_names, what), what)
    if array.shape not in ((), (n_modes,)) or not ((array >= 0) & (array < 1)).all():
        raise ValueError(
            f"{what} is {array}; expected a relative standard deviation, 0 or more and below 1 (0.01 means 1 %), "
            f"a number or one for each of the {n_modes} modes"
        )
    if (array > most).all():  # a single mode may be unknown
        raise ValueError(
            f"{what} is {array}, which means {100 * np.min(array):.0f} % or more in every mode: percent? expected at "
            f"most {most:g} in some mode, and {np.min(array) / 100:g} where {np.min(array):g} % is meant"
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
    """Raise an error for what is no number of joblib's jobs."""
    if n_jobs is not None and (not isinstance(n_jobs, Integral) or isinstance(n_jobs, bool) or n_jobs == 0):
        raise ValueError(f"n_jobs is {n_jobs!r}; expected an integer, such as 2, or -1 for all processors, or None")


def check_names(names: Any, what: str) -> list[str]:
    """Different names as a list; one text in place of several is an error."""
    given = names if isinstance(names, str | bytes | type) or not isinstance(names, Iterable) else list(names)
    if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
        raise ValueError(f"{what} is {names!r:.100}; expected a list of names, such as ['deck']")
    if len(set(given)) < len(given):
        raise ValueError(f"{what} are {given!r:.200}; expected each name once")
    return given


def check_size(value: Any, what: str, lowest: float, highest: float, expected: str) -> float:
    """A real number strictly between two others."""
    if not is_real(value) or not lowest < float(value) < highest:
        raise ValueError(f"{what} is {value!r:.100}; expected {expected}")
    return float(value)


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


def check_dofs(dofs: ArrayLike, n_dof: int) -> NDArray[np.intp]:
    """Different degrees of freedom of a model."""
    array = integer_row(dofs, "dofs")
    outside = array[(array < 0) | (array >= n_dof)]
    if outside.size:
        raise ValueError(f"dofs holds {outside[0]}; expected 0 to {n_dof - 1}, the model's degrees of freedom")
    values, counts = np.unique(array, return_counts=True)
    if (counts > 1).any():
        raise ValueError(f"dofs holds {values[counts > 1][0]} more than once; expected each degree of freedom once")
    return array.astype(np.intp)


def seem_rad_per_s(ratios: ArrayLike, tolerance: float = 0.15) -> bool:
    """Whether all known ratios of measured to expected frequencies are about 2 pi: rad/s given in place of Hz."""
    offsets = np.abs(np.asarray(ratios, dtype=float) / (2 * np.pi) - 1)
    return bool(np.isfinite(offsets).any() and not (offsets >= tolerance).any())


def _pair(width: Any, name: str) -> Any:
    """A half-width, or lowest and highest as the only row."""
    if np.ndim(width) == 0:
        if not (is_real(width) and 0 < float(width) < 1):
            raise ValueError(
                f"bounds of parameter {name!r} are {width!r}; expected a half-width between 0 and 1, or (lowest, "
                "highest)"
            )
        return width
    if np.shape(width) != (2,):
        raise ValueError(f"bounds of parameter {name!r} are {width!r}; expected a half-width or (lowest, highest)")
    return [width]


MEMBERS = ("parameter_names", "n_modes", "frequencies")


def is_model(candidate: Any) -> bool:
    """Whether an object is an FE model, judged by its attributes."""
    return not isinstance(candidate, type) and all(hasattr(candidate, name) for name in MEMBERS)


def check_model(candidate: Any) -> None:
    """Raise an error for an object that is not an FE model."""
    if not is_model(candidate):
        raise ValueError(
            f"model is {candidate!r:.200}; expected an FE model, an object with parameter_names, n_modes and "
            "frequencies"
        )


def by_name(values: Any, names: Sequence[Any], what: str, kind: str = "parameters") -> Any:
    """Values of a mapping, or of a Series with labels, in the order of the names; anything else unchanged.

    The labels must be exactly the names. Labels 0, 1, 2, ... are no names.
    """
    if isinstance(values, Mapping):
        labels = list(values)
    elif is_labelled(values):
        labels = list(values.index)
    else:
        return values
    check_labels(labels, names, what, kind)
    return [values[name] for name in names]


def rows_by_name(table: Any, names: Sequence[Any], what: str, kind: str = "parameters") -> Any:
    """A frame with labelled rows in the order of the names; anything else unchanged."""
    if not hasattr(table, "iloc") or table.ndim != 2 or is_numbered(table.index):
        return table
    check_labels(list(table.index), names, what, kind)
    return table.loc[list(names)]


def columns_by_name(table: Any, names: Sequence[Any], what: str, kind: str = "parameters") -> Any:
    """A frame with labelled columns in the order of the names; anything else unchanged."""
    if not hasattr(table, "columns") or is_numbered(table.columns):
        return table
    check_labels(list(table.columns), names, what, kind)
    return table[list(names)]


def check_labels(labels: Sequence[Any], names: Sequence[Any], what: str, kind: str) -> None:
    """Raise an error unless labels are the names, in any order."""
    unknown = [label for label in labels if label not in names]
    missing = [name for name in names if name not in labels]
    repeated = [label for place, label in enumerate(labels) if label in labels[:place]]
    for wrong, problem in ((unknown, "unknown"), (missing, "missing"), (repeated, "repeated")):
        if wrong:
            raise ValueError(f"{what}: {wrong} are {problem}; expected each of the {kind} {list(names)}")


def is_labelled(values: Any) -> bool:
    """Whether values are a Series of pandas whose labels are not just 0, 1, 2, ..."""
    return hasattr(values, "iloc") and values.ndim == 1 and not is_numbered(values.index)


def is_numbered(labels: Any) -> bool:
    """Whether labels are just 0, 1, 2, ..., which name nothing."""
    return list(labels) == list(range(len(labels)))


def as_mapping(values: Any) -> Any:
    """A Series with different labels as a mapping; anything else unchanged."""
    return dict(values.items()) if is_labelled(values) and values.index.is_unique else values


def tolerance(model: Any, reduce: Reduce, n_solves: int = 0) -> float | None:
    """Relative error allowed in the frequencies of a reduced model, read from ``reduce``; None without reduction.

    "auto" reduces models that state by ``reduction_pays`` that it saves time for a number of solves.
    """
    if isinstance(reduce, str):
        pays = hasattr(model, "reduced") and hasattr(model, "reduction_pays") and model.reduction_pays(n_solves)
        return DEFAULT_TOLERANCE if pays else None
    if not reduce:
        return None
    if not hasattr(model, "reduced"):
        raise ValueError(
            f"reduce is {reduce}, but {model!r} has no method 'reduced'; expected a model with one, such as "
            "AffineModel, or reduce=False"
        )
    return DEFAULT_TOLERANCE if isinstance(reduce, (bool, np.bool_)) else reduce


def is_auto(reduce: Reduce) -> bool:
    """Whether the model decides whether it is reduced."""
    return isinstance(reduce, str)
