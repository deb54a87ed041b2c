"""What steps before a detector have made of frequencies: how values are changed, and their density."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import UnevaluatedRowsWarning


def _none(n_rows: int) -> Array:
    return np.zeros(n_rows)


@dataclass(frozen=True)
class Changes:
    """What relative changes of frequencies make of the columns: some matrices, and which of them is that of each row.

    The matrices are (n_matrices, n_columns, n_modes), ``which`` is (n_rows,).
    """

    matrices: Array
    which: NDArray[np.intp]

    @classmethod
    def of_all(cls, matrix: Array, n_rows: int) -> "Changes":
        """The same for all rows."""
        return cls(matrix[np.newaxis], np.zeros(n_rows, dtype=np.intp))

    def of(self, rows: Any) -> "Changes":
        """Those of some rows."""
        return Changes(self.matrices, self.which[rows])

    def typical(self) -> Array:
        """The mean over the rows, (n_columns, n_modes)."""
        counts = np.bincount(self.which, minlength=len(self.matrices))
        return np.einsum("k,kij->ij", counts / counts.sum(), self.matrices)


@dataclass(frozen=True)
class Origin:
    """How an array was made of frequencies in Hz.

    ``log_volumes`` gives the logarithms of the factors by which the volume of each row was changed, ``changes`` the
    `Changes` of its columns. Both are computed if they are asked for.
    """

    log_volumes: Callable[[], Array]
    changes: Callable[[], Changes]


_origins: dict[int, tuple[ref, tuple[int, ...], Origin]] = {}
"""Arrays by the address of their numbers while they exist, their shapes and origins."""


def with_origin(values: Array, origin: Origin) -> Array:
    """The array, of which `origin_of` knows the origin while it exists."""
    address = _address(values)
    _origins[address] = ref(values, lambda _: _origins.pop(address, None)), values.shape, origin
    return values


def origin_of(table: Any) -> Origin | None:
    """The origin of an array, also of a frame of it; None where no step has said it."""
    values = np.asarray(table)
    _, shape, origin = _origins.get(_address(values), (None, None, None))
    return origin if shape == values.shape else None


def log_volumes(table: Any) -> Array:
    """Logarithms of the factors by which rows were changed; zero where none are known."""
    origin = origin_of(table)
    return (partial(_none, len(table)) if origin is None else origin.log_volumes)()


def mean_log_density(densities: Array, present: NDArray[np.bool_]) -> float:
    """Mean over the values that are there, from the logarithm of the density of each row; NaN without any value.

    A warning says so where most rows have none.
    """
    known = present.any(axis=1)
    if 2 * known.sum() < len(known):
        warn_user(
            f"the score is of {known.sum()} of {len(known)} rows: the others have no value. Compare scores of the same "
            "rows only",
            UnevaluatedRowsWarning,
            "rows-not-scored",
        )
    return float(densities[known].sum() / present.sum()) if known.any() else float("nan")


def _address(values: NDArray) -> int:
    address: int = values.__array_interface__["data"][0]
    return address
