"""Generalised eigenproblems K phi = lambda M phi of many theta.

Forms of the same problem, two of them dense and in batches. All scale mode shapes to unit modal mass, and
give NaN where the stiffness is not positive definite.
"""

from typing import Protocol

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from skthermo.fem._shift_invert import ShiftInvertForm
from skthermo.fem._terms import AffineTerms, DenseTerms, SparseTerms
from skthermo.fem._theta import nominal_theta

Array = NDArray[np.float64]

WIDEST_SPECTRUM = 1e6
"""Largest ratio of eigenvalues at which the standard form still gives the lowest one to 1e-9."""


class EigenForm(Protocol):
    """What solves the eigenproblem for many theta at once."""

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        """Lowest eigenvalues, (n_samples, n_modes)."""

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        """Lowest eigenvalues and their shapes, (n_samples, n_dof, n_modes)."""

    def scaled(self, factors: Array) -> "EigenForm":
        """The form of the same structure with its stiffness terms multiplied."""


class StandardForm:
    """A y = lambda y with A = L^-1 K L^-T and phi = L^-T y, for a constant mass M = L L'.

    The mass is factored once and every stiffness term transformed once.
    """

    def __init__(self, stiffness: DenseTerms, basis: Array):
        self._basis = basis
        self._stiffness = stiffness

    @classmethod
    def from_mass(cls, stiffness: DenseTerms, mass: Array) -> "StandardForm":
        lower = np.linalg.cholesky(mass)
        basis = scipy.linalg.solve_triangular(lower, np.eye(len(mass)), lower=True).T
        return cls(stiffness.congruent(basis), basis)

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        return _stable_only(np.linalg.eigvalsh(self._stiffness.assemble(theta)))[:, :n_modes]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        eigenvalues, shapes = np.linalg.eigh(self._stiffness.assemble(theta))
        return _stable_only(eigenvalues)[:, :n_modes], self._basis @ shapes[:, :, :n_modes]

    def scaled(self, factors: Array) -> "StandardForm":
        return StandardForm(self._stiffness.scaled(factors), self._basis)


class FlexibilityForm:
    """B y = y / lambda with B = L^-1 M L^-T and phi = L^-T y sqrt(lambda), for K = L L'.

    Serves a mass that varies with theta or leaves degrees of freedom massless, and keeps the
    digits of the lowest modes where the spectrum of stiffness is wide.
    """

    def __init__(self, stiffness: DenseTerms, mass: DenseTerms):
        self._stiffness = stiffness
        self._mass = mass

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        flexibility, _, stable = self._flexibility(theta)
        return stable / np.linalg.eigvalsh(flexibility)[:, ::-1][:, :n_modes]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        flexibility, back, stable = self._flexibility(theta)
        inverse_eigenvalues, shapes = np.linalg.eigh(flexibility)
        eigenvalues = stable / inverse_eigenvalues[:, ::-1][:, :n_modes]
        return eigenvalues, back @ shapes[:, :, ::-1][:, :, :n_modes] * np.sqrt(eigenvalues)[:, np.newaxis]

    def _flexibility(self, theta: Array) -> tuple[Array, Array, Array]:
        """B, L^-T, and a column of ones with NaN where the stiffness has no L."""
        lower, stable = _cholesky(self._stiffness.assemble(theta))
        inverse: Array = np.asarray(np.linalg.inv(lower), dtype=float)
        transposed = inverse.swapaxes(1, 2)
        return inverse @ self._mass.assemble(theta) @ transposed, transposed, stable

    def scaled(self, factors: Array) -> "FlexibilityForm":
        return FlexibilityForm(self._stiffness.scaled(factors), self._mass)


def _stable_only(eigenvalues: NDArray[np.floating]) -> Array:
    """Eigenvalues in ascending order; rows whose lowest is not positive become NaN."""
    return np.where(eigenvalues[:, :1] > 0, eigenvalues, np.nan)


def _cholesky(matrices: Array) -> tuple[Array, Array]:
    """Lower factors and ones; the identity and NaN where a matrix is not positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(matrices), dtype=float), np.ones((len(matrices), 1))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.eye(matrices.shape[1])[np.newaxis], np.full((1, 1), np.nan)
        factors, stable = zip(*(_cholesky(matrix[np.newaxis]) for matrix in matrices), strict=True)
        return np.concatenate(factors), np.concatenate(stable)


def eigen_form(stiffness: AffineTerms, mass: AffineTerms) -> EigenForm:
    """Batches for dense terms, shift-invert for sparse ones."""
    if isinstance(stiffness, DenseTerms) and isinstance(mass, DenseTerms):
        return dense_form(stiffness, mass)
    if isinstance(stiffness, SparseTerms) and isinstance(mass, SparseTerms):
        return ShiftInvertForm(stiffness, mass)
    raise TypeError("stiffness and mass must both be dense or both sparse")


def dense_form(stiffness: DenseTerms, mass: DenseTerms, widest: float = WIDEST_SPECTRUM) -> EigenForm:
    """The standard form where the spectrum is narrow enough for it (the fastest), else the flexibility form."""
    if mass.is_constant:
        nominal = nominal_theta(stiffness.exponents.shape[1])
        matrix = mass.assemble(nominal)[0]
        lowest, highest = np.linalg.eigvalsh(matrix)[[0, -1]]
        if lowest > len(matrix) * np.finfo(float).eps * highest:
            form = StandardForm.from_mass(stiffness, matrix)
            eigenvalues = form.eigenvalues(nominal, len(matrix))[0]
            if eigenvalues[-1] < widest * eigenvalues[0]:
                return form
    return FlexibilityForm(stiffness, mass)


def hertz(eigenvalues: Array) -> Array:
    """Natural frequencies in Hz of the eigenvalues (2 pi f)^2."""
    return np.sqrt(eigenvalues) / (2 * np.pi)
