"""Rows of parameter multipliers."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike

from skthermo._arrays import Array, real_array
from skthermo._warnings import warn_user

ROWS_PER_CHUNK = 256
"""Largest number of samples solved together."""


def nominal_theta(n_parameters: int) -> Array:
    """One row of ones: every parameter at its nominal value."""
    return np.ones((1, n_parameters))


def check_theta(
    theta: ArrayLike, parameter_names: Sequence[str], *, allow_nan: bool = False, one_row: bool = False
) -> Array:
    """Rows of finite, positive multipliers, one column for each parameter.

    Parameters
    ----------
    theta : array-like or DataFrame of shape (n_samples, n_parameters) or (n_parameters,)
        Multipliers of the nominal values. A frame's columns must be the parameters' names
        in their order; a vector is one row.
    parameter_names : sequence of str
        The parameters.
    allow_nan : bool, default=False
        Whether NaN is allowed for unknown values.
    one_row : bool, default=False
        Whether exactly one row is expected.

    Returns
    -------
    ndarray of shape (n_samples, n_parameters)
        The multipliers, a vector as one row.

    Raises
    ------
    ValueError
        If the width or the names differ, a value is not finite and positive, or there are
        several rows where one is expected.

    Examples
    --------
    >>> from skthermo.fem import check_theta
    >>> check_theta([1.0, 0.9], ["E_deck", "E_arch"])
    array([[1. , 0.9]])
    >>> check_theta([[1.0, 0.9], [1.0, -0.1]], ["E_deck", "E_arch"])
    Traceback (most recent call last):
    ...
    ValueError: theta must be finite and positive; row 1, parameter 'E_arch' is -0.1 (1 such values in all)
    """
    names = list(parameter_names)
    if hasattr(theta, "columns") and list(theta.columns) != names:
        raise ValueError(f"theta has the columns {list(theta.columns)}; expected the parameters {names} in this order")
    values = real_array(theta, "theta")
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


def warn_of_failures(theta: Array, solved: Array) -> None:
    """Warn of rows without NaN that have no solution: their number and the theta of the first."""
    failed = np.isnan(solved).any(axis=tuple(range(1, solved.ndim))) & ~np.isnan(theta).any(axis=1)
    if failed.any():
        first = np.flatnonzero(failed)[0]
        warn_user(
            f"{failed.sum()} of {len(theta)} samples are NaN: their stiffness is not positive definite, or they could "
            f"not be solved, first at theta = {theta[first].tolist()} (row {first})",
            "no solution",
        )


def by_name(row: Array, parameter_names: Sequence[str]) -> dict[str, float]:
    """Multipliers by parameter name, for messages."""
    return dict(zip(parameter_names, row.tolist(), strict=True))


@contextmanager
def failures_named(rows: Array, parameter_names: Sequence[str]) -> Iterator[None]:
    """Re-raise a user function's error with its theta."""
    try:
        yield
    except Exception as error:
        many = f"{len(rows)} rows from " if rows.ndim == 2 else ""
        theta = by_name(np.atleast_2d(rows)[0], parameter_names)
        raise RuntimeError(
            f"the model's function failed at {many}theta = {theta}: {type(error).__name__}: {error}"
        ) from error
