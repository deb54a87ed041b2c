"""Dense generalised eigenproblems K phi = lambda M phi of many theta in one batch.

There are two forms of it. Both scale mode shapes to unit modal mass, and return NaN where the stiffness is not
positive definite.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo.fem._terms import DenseTerms

WIDEST_SPECTRUM = 1e6
"""Largest ratio of eigenvalues at which the standard form still gives the lowest one to 1e-9 of its value."""


class EigenSolver(Protocol):
    """Solves the eigenproblem for many theta at once."""

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        """Lowest eigenvalues, (n_samples, n_modes)."""

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        """Lowest eigenvalues and their shapes, (n_samples, n_dof, n_modes)."""

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        """Eigenvalues and shapes at one row of theta, and a function that solves K x = b there."""

    def scaled(self, factors: Array) -> "EigenSolver":
        """The solver of the same structure with its stiffness terms multiplied."""


class StandardSolver:
    """A y = lambda y with A = L^-1 K L^-T and phi = L^-T y, for a constant mass M = L L'.

    The mass is factored once and every stiffness term transformed once.
    """

    def __init__(self, transformed: DenseTerms, basis: Array, stiffness: DenseTerms):
        self._transformed = transformed
        self._basis = basis
        self._stiffness = stiffness

    @classmethod
    def from_mass(cls, stiffness: DenseTerms, mass: Array) -> "StandardSolver":
        """The solver for a positive definite mass matrix."""
        lower = np.linalg.cholesky(mass)
        basis = scipy.linalg.solve_triangular(lower, np.eye(len(mass)), lower=True).T
        return cls(stiffness.projected(basis), basis, stiffness)

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        return _nan_unless_positive(np.linalg.eigvalsh(self._transformed.assemble(theta)))[:, :n_modes]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        eigenvalues, shapes = np.linalg.eigh(self._transformed.assemble(theta))
        return _nan_unless_positive(eigenvalues)[:, :n_modes], self._basis @ shapes[:, :, :n_modes]

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        eigenvalues, shapes = self.modes(theta, n_modes)
        return eigenvalues[0], shapes[0], cholesky_solver(self._stiffness, theta)

    def scaled(self, factors: Array) -> "StandardSolver":
        return StandardSolver(self._transformed.scaled(factors), self._basis, self._stiffness.scaled(factors))


class FlexibilitySolver:
    """B y = y / lambda with B = L^-1 M L^-T and phi = L^-T y sqrt(lambda), for K = L L'.

    The mass may vary with theta or be zero at some degrees of freedom. The lowest modes stay accurate where the
    eigenvalues span many orders of magnitude.
    """

    def __init__(self, stiffness: DenseTerms, mass: DenseTerms):
        self._stiffness = stiffness
        self._mass = mass

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        flexibility, _, ones = self._flexibility(theta)
        return ones / np.linalg.eigvalsh(flexibility)[:, ::-1][:, :n_modes]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        flexibility, back, ones = self._flexibility(theta)
        inverse_eigenvalues, shapes = np.linalg.eigh(flexibility)
        eigenvalues = ones / inverse_eigenvalues[:, ::-1][:, :n_modes]
        return eigenvalues, back @ shapes[:, :, ::-1][:, :, :n_modes] * np.sqrt(eigenvalues)[:, np.newaxis]

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        eigenvalues, shapes = self.modes(theta, n_modes)
        return eigenvalues[0], shapes[0], cholesky_solver(self._stiffness, theta)

    def scaled(self, factors: Array) -> "FlexibilitySolver":
        return FlexibilitySolver(self._stiffness.scaled(factors), self._mass)

    def _flexibility(self, theta: Array) -> tuple[Array, Array, Array]:
        """B, L^-T, and a column of ones with NaN where the stiffness has no L."""
        lower, ones = _cholesky(self._stiffness.assemble(theta))
        inverse: Array = np.asarray(np.linalg.inv(lower), dtype=float)
        transposed = inverse.swapaxes(1, 2)
        return inverse @ self._mass.assemble(theta) @ transposed, transposed, ones


def dense_solver(
    stiffness: DenseTerms, mass: DenseTerms, nominal: Array, widest: float = WIDEST_SPECTRUM
) -> EigenSolver:
    """The standard form, which is the fastest, where it is accurate enough; else the flexibility form."""
    if mass.is_constant:
        matrix = mass.assemble(nominal)[0]
        lowest, highest = np.linalg.eigvalsh(matrix)[[0, -1]]
        if lowest > len(matrix) * np.finfo(float).eps * highest:
            solver = StandardSolver.from_mass(stiffness, matrix)
            eigenvalues = solver.eigenvalues(nominal, len(matrix))[0]
            if eigenvalues[-1] < widest * eigenvalues[0]:
                return solver
    return FlexibilitySolver(stiffness, mass)


def hertz(eigenvalues: Array) -> Array:
    """Natural frequencies in Hz of the eigenvalues (2 pi f)^2."""
    return np.sqrt(eigenvalues) / (2 * np.pi)


def cholesky_solver(stiffness: DenseTerms, theta: Array) -> Callable[[Array], Array]:
    """A function that solves K x = b at one theta; the matrix is factored when it is first called."""
    factors: list = []

    def solve(columns: Array) -> Array:
        if not factors:
            factors.append(scipy.linalg.cho_factor(stiffness.assemble(theta)[0]))
        return scipy.linalg.cho_solve(factors[0], columns)

    return solve


def _nan_unless_positive(eigenvalues: NDArray[np.floating]) -> Array:
    """Eigenvalues in ascending order; rows whose lowest is not positive become NaN."""
    return np.where(eigenvalues[:, :1] > 0, eigenvalues, np.nan)


def _cholesky(matrices: Array) -> tuple[Array, Array]:
    """Lower factors and ones; the identity and NaN where a matrix is not positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(matrices), dtype=float), np.ones((len(matrices), 1))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.eye(matrices.shape[1])[np.newaxis], np.full((1, 1), np.nan)
        factors, ones = zip(*(_cholesky(matrix[np.newaxis]) for matrix in matrices), strict=True)
        return np.concatenate(factors), np.concatenate(ones)
