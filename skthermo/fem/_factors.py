"""Factorisation of sparse symmetric matrices: the only place that calls a direct solver."""

from typing import Protocol

import numpy as np
import scipy.sparse.linalg
from numpy.typing import NDArray

from skthermo._arrays import Array

SYMMETRIC = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}


class Factors(Protocol):
    """The factors of a positive definite matrix K."""

    def solve(self, columns: Array) -> Array:
        """The solution x of K x = columns, one vector or several side by side."""


class Elimination:
    """Factorises matrices of one sparsity pattern, whose order of elimination is computed once.

    The order is that of minimum degree. It depends on the pattern alone.
    """

    def __init__(self, rows: NDArray[np.int32], pointers: NDArray[np.int32]):
        n_dof, n_entries = len(pointers) - 1, len(rows)
        pattern = scipy.sparse.csc_array((np.ones(n_entries), rows, pointers), shape=(n_dof, n_dof))
        dominant = pattern + scipy.sparse.diags_array(np.diff(pointers) + 1.0, format="csc")
        # With all that may be dropped dropped, an incomplete factorisation costs little more than its order.
        incomplete = scipy.sparse.linalg.spilu(
            dominant, drop_tol=1.0, fill_factor=1.0, permc_spec="MMD_AT_PLUS_A", **SYMMETRIC
        )
        self._order = np.argsort(incomplete.perm_c)
        places = scipy.sparse.csc_array((np.arange(1, n_entries + 1), rows, pointers), shape=(n_dof, n_dof))
        ordered = places[self._order][:, self._order]
        ordered.sort_indices()
        self._places, self._rows, self._pointers = ordered.data - 1, ordered.indices, ordered.indptr

    def factorise(self, matrix: scipy.sparse.csc_array) -> Factors | None:
        """Factors of a matrix of the pattern, or None where it is not positive definite."""
        entries = matrix.data[self._places], self._rows, self._pointers
        ordered = scipy.sparse.csc_array(entries, shape=matrix.shape)
        factors = _superlu(ordered, "NATURAL", panel_size=1, relax=1)
        return None if factors is None else _Reordered(factors, self._order)


class _Reordered:
    """Factors of a matrix whose rows and columns were put in another order."""

    def __init__(self, factors: Factors, order: NDArray[np.intp]):
        self._factors = factors
        self._order = order

    def solve(self, columns: Array) -> Array:
        solution = np.empty_like(columns)
        solution[self._order] = self._factors.solve(columns[self._order])
        return solution


def factorise(matrix: scipy.sparse.csc_array) -> Factors | None:
    """Factors of a single matrix, or None where it is not positive definite."""
    return _superlu(matrix, "MMD_AT_PLUS_A")


def _superlu(matrix: scipy.sparse.csc_array, order: str, **options: int) -> scipy.sparse.linalg.SuperLU | None:
    """L U without pivoting, or None where a pivot is not positive: the matrix is not positive definite."""
    try:
        factors = scipy.sparse.linalg.splu(matrix, permc_spec=order, **SYMMETRIC, **options)
    except RuntimeError:  # exactly singular
        return None
    return factors if (factors.U.diagonal() > 0).all() else None
