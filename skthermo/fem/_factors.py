"""Factorisation of sparse symmetric matrices: the only place that calls a direct solver.

The environment variable SKTHERMO_SOLVER names the solver: "superlu", which SciPy brings, or "rslab", an optional
package that is faster where factors fill.
"""

import os
from collections.abc import Callable
from functools import partial
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse.linalg
from numpy.typing import NDArray

from skthermo._core.arrays import Array

Solve: TypeAlias = Callable[[Array], Array]
"""Gives the solution x of K x = b by the factors of a positive definite K, for one vector b or several side by side."""


Factorise: TypeAlias = Callable[[scipy.sparse.csc_array], Solve | None]
"""Gives solves with a matrix; None where it is not positive definite."""


def elimination(rows: NDArray[np.int32], pointers: NDArray[np.int32]) -> Factorise:
    """What factorises matrices of a pattern, given as compressed sparse columns with sorted rows, by the solver that
    the environment names."""
    name = os.environ.get("SKTHERMO_SOLVER", "superlu")
    if name not in ("superlu", "rslab"):
        raise ValueError(f"SKTHERMO_SOLVER is {name!r}; expected one of {['superlu', 'rslab']}")
    return superlu if name == "superlu" else RslabElimination(rows, pointers).factorise


def factorise(matrix: scipy.sparse.csc_array) -> Solve | None:
    """Solves with a single matrix; None where it is not positive definite."""
    matrix = matrix.sorted_indices()
    return elimination(matrix.indices, matrix.indptr)(matrix)


def superlu(matrix: scipy.sparse.csc_array) -> Solve | None:
    """By minimum degree and L U without pivoting: a pivot that is not positive tells of an indefinite matrix."""
    options = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    try:
        factors = scipy.sparse.linalg.splu(matrix, permc_spec="MMD_AT_PLUS_A", **options)
    except RuntimeError:  # exactly singular
        return None
    return factors.solve if (factors.U.diagonal() > 0).all() else None


class RslabElimination:
    """Nested dissection or minimum degree, whichever fills less, and supernodal L D L'.

    One thread each: results are the same to the last bit, and rows of theta are spread over cores.
    """

    def __init__(self, rows: NDArray[np.int32], pointers: NDArray[np.int32]):
        n_dof = len(pointers) - 1
        columns = np.repeat(np.arange(n_dof, dtype=rows.dtype), np.diff(pointers))
        self._lower = np.flatnonzero(rows >= columns)
        counts = np.bincount(columns[self._lower], minlength=n_dof)
        self._rows, self._pointers = rows[self._lower], np.append(0, np.cumsum(counts))
        self._analysis: Any = None
        _rslab()

    def __getstate__(self) -> dict[str, object]:
        return vars(self) | {"_analysis": None}  # it cannot be sent to a worker, which makes its own

    def factorise(self, matrix: scipy.sparse.csc_array) -> Solve | None:
        """Solves with a matrix of the pattern; None where it is not positive definite."""
        data = matrix.data[self._lower]
        if self._analysis is None:
            pattern = scipy.sparse.csc_array((data, self._rows, self._pointers), shape=matrix.shape)
            self._analysis = _rslab().analyze(pattern, path="ldlt", threads=1)
        try:
            factors = self._analysis.factor(data)
        except RuntimeError:  # a pivot is zero
            return None
        return partial(solve_by_rslab, factors) if factors.inertia == (len(self._pointers) - 1, 0, 0) else None


def solve_by_rslab(factors: Any, columns: Array) -> Array:
    """Solve by rslab, which has one method for a vector and another for several."""
    solve = factors.solve if columns.ndim == 1 else factors.solve_many
    return np.asarray(solve(np.ascontiguousarray(columns)))


def _rslab() -> ModuleType:
    from skthermo._core.estimators import import_optional  # imported here because scikit-learn imports pandas

    return import_optional("rslab", extra="sparse")
