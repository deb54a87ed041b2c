"""Factorisation of sparse symmetric matrices: the only place that calls a direct solver.

The environment variable SKTHERMO_SOLVER names the solver: "superlu", which SciPy brings, or "rslab", an optional
package that is faster where factors fill.
"""

import os
from collections.abc import Callable
from functools import partial
from types import ModuleType
from typing import Any, Protocol, TypeAlias

import numpy as np
import scipy.sparse.linalg
from numpy.typing import NDArray

from skthermo._core.arrays import Array

SYMMETRIC_MODE = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}

Solve: TypeAlias = Callable[[Array], Array]
"""Gives the solution x of K x = b by the factors of a positive definite K, for one vector b or several side by side."""


class Elimination(Protocol):
    """Factorises matrices of one sparsity pattern, whose order of elimination is computed once."""

    def factorise(self, matrix: scipy.sparse.csc_array) -> Solve | None:
        """Solves with a matrix of the pattern; None where it is not positive definite."""


def elimination(rows: NDArray[np.int32], pointers: NDArray[np.int32]) -> Elimination:
    """The elimination of a pattern, given as compressed sparse columns with sorted rows, by the chosen solver."""
    eliminations: dict[str, Callable[..., Elimination]] = {"superlu": SuperLUElimination, "rslab": RslabElimination}
    name = chosen_solver()
    if name not in eliminations:
        raise ValueError(f"SKTHERMO_SOLVER is {name!r}; expected one of {list(eliminations)}")
    return eliminations[name](rows, pointers)


def chosen_solver() -> str:
    """The solver that the environment names."""
    return os.environ.get("SKTHERMO_SOLVER", "superlu")


def factorise(matrix: scipy.sparse.csc_array) -> Solve | None:
    """Solves with a single matrix; None where it is not positive definite."""
    if chosen_solver() == "superlu":
        factors = superlu(matrix, "MMD_AT_PLUS_A")
        return None if factors is None else factors.solve
    matrix = matrix.sorted_indices()
    return elimination(matrix.indices, matrix.indptr).factorise(matrix)


class SuperLUElimination:
    """Minimum degree, and L U without pivoting."""

    def __init__(self, rows: NDArray[np.int32], pointers: NDArray[np.int32]):
        n_dof, n_entries = len(pointers) - 1, len(rows)
        pattern = scipy.sparse.csc_array((np.ones(n_entries), rows, pointers), shape=(n_dof, n_dof))
        dominant = pattern + scipy.sparse.diags_array(np.diff(pointers) + 1.0, format="csc")
        # With all that may be dropped dropped, an incomplete factorisation costs little more than its order.
        incomplete = scipy.sparse.linalg.spilu(
            dominant, drop_tol=1.0, fill_factor=1.0, permc_spec="MMD_AT_PLUS_A", **SYMMETRIC_MODE
        )
        self._order = np.argsort(incomplete.perm_c)
        places = scipy.sparse.csc_array((np.arange(1, n_entries + 1), rows, pointers), shape=(n_dof, n_dof))
        ordered = places[self._order][:, self._order]
        ordered.sort_indices()
        self._places, self._rows, self._pointers = ordered.data - 1, ordered.indices, ordered.indptr

    def factorise(self, matrix: scipy.sparse.csc_array) -> Solve | None:
        """Solves with a matrix of the pattern; None where it is not positive definite."""
        entries = matrix.data[self._places], self._rows, self._pointers
        ordered = scipy.sparse.csc_array(entries, shape=matrix.shape)
        factors = superlu(ordered, "NATURAL", panel_size=1, relax=1)
        return None if factors is None else partial(solve_reordered, factors, self._order)


def solve_reordered(factors: scipy.sparse.linalg.SuperLU, order: NDArray[np.intp], columns: Array) -> Array:
    """Solve with the factors of a matrix whose rows and columns were put in another order."""
    solution = np.empty_like(columns)
    solution[order] = factors.solve(columns[order])
    return solution


def superlu(matrix: scipy.sparse.csc_array, order: str, **options: int) -> scipy.sparse.linalg.SuperLU | None:
    """L U without pivoting, or None where a pivot is not positive: the matrix is not positive definite."""
    try:
        factors = scipy.sparse.linalg.splu(matrix, permc_spec=order, **SYMMETRIC_MODE, **options)
    except RuntimeError:  # exactly singular
        return None
    return factors if (factors.U.diagonal() > 0).all() else None


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
