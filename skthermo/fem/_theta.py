"""Rows of parameter multipliers."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import ModelWarning

ROWS_PER_CHUNK = 256  # largest number of samples solved together


def nominal_theta(n_parameters: int) -> Array:
    """One row of ones: every parameter at its nominal value."""
    return np.ones((1, n_parameters))


def warn_of_failures(theta: Array, solved: Array) -> None:
    """Warn of rows without NaN that have no solution: their number and the theta of the first."""
    failed = np.isnan(solved).any(axis=tuple(range(1, solved.ndim))) & ~np.isnan(theta).any(axis=1)
    if failed.any():
        first = np.flatnonzero(failed)[0]
        warn_user(
            f"{failed.sum()} of {len(theta)} samples are NaN: their stiffness is not positive definite, or they could "
            f"not be solved, first at theta = {theta[first].tolist()} (row {first})",
            ModelWarning,
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
