"""Rows of theta, and matrices that are affine in products of its parameters."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, Matrix, as_dense
from skthermo.exceptions import ModelWarning
from skthermo.fem._factors import Elimination, elimination

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
            f"{failed.sum()} of {len(theta)} samples are NaN: their stiffness is not positive definite, or the solver "
            f"failed. The first is theta = {theta[first].tolist()} (row {first}). Narrow the bounds, or correct the "
            "model there",
            ModelWarning,
            "no-solution",
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


SPARSE_ROWS_PER_CHUNK = 16  # sparse samples are solved one by one; a few of them are enough work for one task


class AffineTerms(ABC):
    """The sum over t of ``factor_t * prod_p(theta_p ** exponent_tp) * matrix_t``.

    ``exponents`` (n_terms, n_parameters) say how often each parameter multiplies each term, and ``factors`` (n_terms,)
    are fixed multipliers, such as 1 - severity of damage.
    """

    n_dof: int
    max_rows = ROWS_PER_CHUNK

    def __init__(self, exponents: NDArray[np.int64], factors: Array | None = None):
        self.exponents = exponents
        self.factors = np.ones(len(exponents)) if factors is None else factors
        self._used = [(t, p, exponents[t, p]) for t, p in np.argwhere(exponents)]
        _freeze(self.exponents, self.factors)

    @property
    def is_constant(self) -> bool:
        """Whether no parameter multiplies any term."""
        return not self.exponents.any()

    def products(self, theta: Array) -> Array:
        """The product of each term's parameters, (n_samples, n_terms)."""
        products = np.ones((len(theta), len(self.exponents)))
        for term, parameter, exponent in self._used:
            products[:, term] *= theta[:, parameter] ** exponent
        return products

    def coefficients(self, theta: Array) -> Array:
        """The factor of each matrix, (n_samples, n_terms)."""
        return self.factors * self.products(theta)

    def coefficient_gradients(self, theta: Array) -> Array:
        """Derivative of ``coefficients``, (n_samples, n_terms, n_parameters)."""
        return self.coefficients(theta)[:, :, np.newaxis] * self.exponents / theta[:, np.newaxis]

    def gradients(self, theta: Array, shapes: Array) -> Array:
        """phi' (dA / d theta_p) phi, (n_samples, n_modes, n_parameters)."""
        return self.quadratic_forms(shapes) @ self.coefficient_gradients(theta)

    def derivatives(self, theta: Array, vectors: Array) -> Array:
        """(dA / d theta_p) times each vector at one row of theta, (n, n_vectors, n_parameters)."""
        gradients = self.coefficient_gradients(theta)[0]
        return np.stack([self.weighted_sum(weights) @ vectors for weights in gradients.T], axis=2)

    @classmethod
    @abstractmethod
    def from_matrices(cls, matrices: Sequence[Matrix], exponents: NDArray[np.int64]) -> "AffineTerms":
        """Terms with a factor of one."""

    @abstractmethod
    def assemble(self, theta: Array) -> Array | list[scipy.sparse.csc_array]:
        """The summed matrix of every row of theta."""

    @abstractmethod
    def weighted_sum(self, weights: Array) -> Matrix:
        """The weighted sum of the matrices."""

    def each(self, theta: Array) -> Iterator[Matrix]:
        """The summed matrices, one by one; a constant matrix is summed once."""
        for i, row in enumerate(theta[:, np.newaxis]):
            if i == 0 or not self.is_constant:
                matrix = self.assemble(row)[0]
            yield matrix

    def product(self, theta: Array, vectors: Array) -> Array:
        """The summed matrix of every row times its vectors, (n_samples, n, n_vectors)."""
        return np.stack([matrix @ columns for matrix, columns in zip(self.each(theta), vectors, strict=True)])

    @property
    @abstractmethod
    def n_entries(self) -> int:
        """Number of stored entries of one summed matrix."""

    @abstractmethod
    def quadratic_forms(self, shapes: Array) -> Array:
        """phi' A_t phi of every shape and term, (n_samples, n_modes, n_terms)."""

    def scaled(self, factors: Array) -> Self:
        """The same matrices with their factors multiplied."""
        return self._with(self.exponents, self.factors * factors)

    def with_exponents(self, exponents: NDArray[np.int64]) -> Self:
        """The same matrices, multiplied by other parameters."""
        return self._with(exponents, self.factors)

    def _with(self, exponents: NDArray[np.int64], factors: Array) -> Self:
        twin = copy(self)
        AffineTerms.__init__(twin, exponents, factors)
        return twin

    @property
    @abstractmethod
    def each_matrix(self) -> list[Matrix]:
        """The matrices of the terms."""

    def with_terms(self, matrices: Sequence[Matrix], exponents: NDArray[np.int64]) -> "AffineTerms":
        """These terms and further ones; a row of zeros among the exponents makes a constant one."""
        terms = type(self).from_matrices([*self.each_matrix, *matrices], np.vstack([self.exponents, exponents]))
        return terms.scaled(np.append(self.factors, np.ones(len(matrices))))

    @abstractmethod
    def projected(self, basis: Array) -> "DenseTerms":
        """Terms basis' A_t basis with the same coefficients."""


class DenseTerms(AffineTerms):
    """Terms for batches: ``matrices`` is (n_terms, n, n)."""

    def __init__(self, matrices: Array, exponents: NDArray[np.int64], factors: Array | None = None):
        super().__init__(exponents, factors)
        self.matrices = matrices
        self.n_dof = matrices.shape[1]
        _freeze(self.matrices)

    @classmethod
    def from_matrices(cls, matrices: Sequence[Matrix], exponents: NDArray[np.int64]) -> "DenseTerms":
        return cls(np.ascontiguousarray(np.stack([as_dense(matrix) for matrix in matrices])), exponents)

    @property
    def n_entries(self) -> int:
        return self.n_dof**2

    def assemble(self, theta: Array) -> Array:
        flat = self.matrices.reshape(len(self.matrices), -1)
        return (self.coefficients(theta) @ flat).reshape(-1, self.n_dof, self.n_dof)

    def weighted_sum(self, weights: Array) -> Array:
        return np.tensordot(weights, self.matrices, axes=1)

    def batch_derivatives(self, theta: Array, vectors: Array) -> Array:
        """(dA / d theta_p) times the vectors of every row of theta, (n_samples, n, n_vectors, n_parameters)."""
        products = np.stack([matrix @ vectors for matrix in self.matrices], axis=3)
        return products @ self.coefficient_gradients(theta)[:, np.newaxis]

    def quadratic_forms(self, shapes: Array) -> Array:
        forms = [np.einsum("sim,sim->sm", shapes, matrix @ shapes) for matrix in self.matrices]
        return np.stack(forms, axis=2)

    @property
    def each_matrix(self) -> list[Matrix]:
        return list(self.matrices)

    def projected(self, basis: Array) -> "DenseTerms":
        return DenseTerms(basis.T @ self.matrices @ basis, self.exponents, self.factors)


@dataclass(frozen=True, eq=False)
class SparsityPattern:
    """Places of the entries of a sparse matrix, as compressed sparse columns."""

    rows: NDArray[np.int32]
    pointers: NDArray[np.int32]

    def __post_init__(self) -> None:
        _freeze(self.rows, self.pointers)

    @property
    def n_dof(self) -> int:
        return len(self.pointers) - 1

    @property
    def columns(self) -> NDArray[np.int32]:
        return np.repeat(np.arange(self.n_dof, dtype=np.int32), np.diff(self.pointers))

    @cached_property
    def elimination(self) -> Elimination:
        """The order in which matrices of this pattern are factorised."""
        return elimination(self.rows, self.pointers)

    def matrix(self, data: Array) -> scipy.sparse.csc_array:
        return scipy.sparse.csc_array((data, self.rows, self.pointers), shape=(self.n_dof, self.n_dof))


class SparseTerms(AffineTerms):
    """Terms on the union of their sparsity patterns: ``entries`` is (n_union, n_terms), one column for each matrix.

    The union is stored as compressed sparse columns, so that a sum of terms is one product
    with ``entries`` and has the same pattern whatever theta is.
    """

    max_rows = SPARSE_ROWS_PER_CHUNK

    def __init__(self, entries: scipy.sparse.csc_array, pattern: SparsityPattern, exponents: NDArray[np.int64]):
        super().__init__(exponents)
        self.entries = entries
        self.pattern = pattern
        self.n_dof = pattern.n_dof
        _freeze(entries.data, entries.indices, entries.indptr)

    @classmethod
    def from_matrices(cls, matrices: Sequence[Matrix], exponents: NDArray[np.int64]) -> "SparseTerms":
        n_dof = matrices[0].shape[0]
        parts = [scipy.sparse.coo_array(matrix) for matrix in matrices]
        places = np.concatenate([part.col.astype(np.int64) * n_dof + part.row for part in parts])
        union, position = np.unique(places, return_inverse=True)
        term = np.repeat(np.arange(len(parts)), [part.nnz for part in parts])
        values = np.concatenate([part.data for part in parts])
        entries = scipy.sparse.csc_array((values, (position, term)), shape=(len(union), len(parts)))
        pointers = np.searchsorted(union, np.arange(n_dof + 1) * n_dof)
        return cls(entries, SparsityPattern((union % n_dof).astype(np.int32), pointers.astype(np.int32)), exponents)

    @property
    def n_entries(self) -> int:
        return len(self.pattern.rows)

    def assemble(self, theta: Array) -> list[scipy.sparse.csc_array]:
        sums = self.entries @ self.coefficients(theta).T
        return [self.pattern.matrix(data) for data in sums.T.copy()]

    def weighted_sum(self, weights: Array) -> scipy.sparse.csc_array:
        used = self.entries[:, np.flatnonzero(weights)]
        return self.pattern.matrix(used @ weights[weights != 0])

    def quadratic_forms(self, shapes: Array) -> Array:
        columns = self.pattern.columns
        forms = [self.entries.T @ (shape[self.pattern.rows] * shape[columns]) for shape in shapes]
        return np.array(forms).reshape(len(shapes), -1, shapes.shape[2]).swapaxes(1, 2)

    @property
    def each_matrix(self) -> list[Matrix]:
        ends = self.entries.indptr[1:-1]
        parts = zip(np.split(self.entries.data, ends), np.split(self.entries.indices, ends), strict=True)
        rows, columns = self.pattern.rows, self.pattern.columns
        places = ((data, (rows[union], columns[union])) for data, union in parts)
        return [scipy.sparse.csc_array(place, shape=(self.n_dof, self.n_dof)) for place in places]

    def projected(self, basis: Array) -> DenseTerms:
        matrices = np.stack([_projected(matrix, basis) for matrix in self.each_matrix])
        return DenseTerms(matrices, self.exponents, self.factors)


def _projected(matrix: scipy.sparse.csc_array, basis: Array) -> Array:
    """basis' A basis, from the degrees of freedom that A joins."""
    used = np.flatnonzero(np.diff(matrix.indptr))
    product: Array = basis[used].T @ (matrix[:, used] @ basis[used])[used]
    return product


def _freeze(*arrays: NDArray) -> None:
    for array in arrays:
        array.flags.writeable = False
