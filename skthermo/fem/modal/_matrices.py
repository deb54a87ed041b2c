"""Protocol of matrices that depend on theta, as eigensolvers use them."""

from collections.abc import Iterator
from typing import Any, Protocol

from skthermo._arrays import Array, Matrix


class ParametrisedMatrix(Protocol):
    """A stiffness or mass matrix as a function of theta."""

    n_dof: int

    @property
    def is_constant(self) -> bool:
        """Whether it is the same for every theta."""

    def assemble(self, theta: Array) -> Any:
        """The matrix of every row of theta: an array (n_samples, n_dof, n_dof), or a list of sparse matrices."""

    def each(self, theta: Array) -> Iterator[Matrix]:
        """The matrices of the rows of theta, one after the other."""

    def derivatives(self, theta: Array, vectors: Array) -> Array:
        """(dA / d theta_p) times each vector at one row of theta, (n_dof, n_vectors, n_parameters)."""

    def scaled(self, factors: Array) -> Any:
        """The same matrix with each of its terms multiplied."""

    def projected(self, basis: Array) -> Any:
        """The dense matrix basis' A basis."""


class DenseMatrix(ParametrisedMatrix, Protocol):
    """A dense matrix as a function of theta."""

    def batch_derivatives(self, theta: Array, vectors: Array) -> Array:
        """(dA / d theta_p) times the vectors of every row of theta, (n_samples, n_dof, n_vectors, n_parameters)."""
