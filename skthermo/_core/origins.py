"""How arrays were made of frequencies, known while they exist."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from skthermo._core.arrays import Array
from skthermo._core.frames import Table, frame_like


@dataclass(frozen=True)
class Changes:
    """What relative changes of frequencies make of the columns: some matrices, and which of them is that of each row.

    The matrices are (n_matrices, n_columns, n_modes), ``which`` is (n_rows,).
    """

    matrices: Array
    which: NDArray[np.intp]

    @classmethod
    def of_all(cls, matrix: Array, n_rows: int) -> Changes:
        """The same for all rows."""
        return cls(matrix[np.newaxis], np.zeros(n_rows, dtype=np.intp))

    def of(self, rows: Any) -> Changes:
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


_origins: dict[int, tuple[tuple[int, ...], Origin]] = {}
"""Shapes and origins of arrays by the address of their numbers, while they exist."""


def with_origin(values: Array, origin: Origin) -> Array:
    """The array, of which `origin_of` knows the origin while it exists."""
    _origins[values.ctypes.data] = values.shape, origin
    finalize(values, _origins.pop, values.ctypes.data, None)
    return values


def origin_of(table: Any) -> Origin | None:
    """The origin of an array, also of a frame of it; None where no step has said it."""
    values = np.asarray(table)
    shape, origin = _origins.get(values.ctypes.data, (None, None))
    return origin if shape == values.shape else None


def of_origin(table: Table, origin: Origin | None) -> Table:
    """A table that was read from a file, and its origin with it, so that `origin_of` knows it."""
    if origin is None or origin_of(table) is not None:
        return table
    return frame_like(table, with_origin(np.array(table, dtype=float), origin))
