"""Batches of dense generalised eigenproblems K phi = lambda M phi.

Two forms of the same problem. Both scale mode shapes to unit modal mass.
"""

from typing import Protocol

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from skthermo.fem._terms import AffineTerms
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

    def __init__(self, stiffness: AffineTerms, basis: Array):
        self._basis = basis
        self._stiffness = stiffness

    @classmethod
    def from_mass(cls, stiffness: AffineTerms, mass: Array) -> "StandardForm":
        lower = np.linalg.cholesky(mass)
        basis = scipy.linalg.solve_triangular(lower, np.eye(len(mass)), lower=True).T
        return cls(stiffness.congruent(basis), basis)

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        eigenvalues = np.linalg.eigvalsh(self._stiffness.assemble(theta))
        return _positive(eigenvalues[:, :n_modes], theta)

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        eigenvalues, shapes = np.linalg.eigh(self._stiffness.assemble(theta))
        return _positive(eigenvalues[:, :n_modes], theta), self._basis @ shapes[:, :, :n_modes]

    def scaled(self, factors: Array) -> "StandardForm":
        return StandardForm(self._stiffness.scaled(factors), self._basis)


class FlexibilityForm:
    """B y = y / lambda with B = L^-1 M L^-T and phi = L^-T y sqrt(lambda), for K = L L'.

    Serves a mass that varies with theta or leaves degrees of freedom massless, and keeps the
    digits of the lowest modes where the spectrum of stiffness is wide.
    """

    def __init__(self, stiffness: AffineTerms, mass: AffineTerms):
        self._stiffness = stiffness
        self._mass = mass

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        flexibility, _ = self._flexibility(theta)
        return 1 / np.linalg.eigvalsh(flexibility)[:, ::-1][:, :n_modes]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        flexibility, back = self._flexibility(theta)
        inverse_eigenvalues, shapes = np.linalg.eigh(flexibility)
        eigenvalues = 1 / inverse_eigenvalues[:, ::-1][:, :n_modes]
        return eigenvalues, back @ shapes[:, :, ::-1][:, :, :n_modes] * np.sqrt(eigenvalues)[:, np.newaxis]

    def _flexibility(self, theta: Array) -> tuple[Array, Array]:
        stiffness = self._stiffness.assemble(theta)
        try:
            inverse = np.linalg.inv(np.linalg.cholesky(stiffness))
        except np.linalg.LinAlgError:
            _positive(np.linalg.eigvalsh(stiffness), theta)
            raise
        transposed = inverse.swapaxes(1, 2)
        return inverse @ self._mass.assemble(theta) @ transposed, transposed

    def scaled(self, factors: Array) -> "FlexibilityForm":
        return FlexibilityForm(self._stiffness.scaled(factors), self._mass)


def _positive(eigenvalues: NDArray[np.floating], theta: Array) -> Array:
    """Eigenvalues of stable structures, or an error that says which theta is not one."""
    if not (eigenvalues[:, :1] > 0).all():
        row = theta[np.argmin(eigenvalues[:, 0])]
        raise ValueError(
            f"the stiffness at theta = {row.tolist()} is not positive definite; expected a stable structure"
        )
    return np.asarray(eigenvalues, dtype=float)


def dense_form(stiffness: AffineTerms, mass: AffineTerms) -> EigenForm:
    """The standard form where it is accurate (and fastest), else the flexibility form."""
    if mass.is_constant:
        nominal = nominal_theta(stiffness.exponents.shape[1])
        matrix = mass.assemble(nominal)[0]
        lowest, highest = np.linalg.eigvalsh(matrix)[[0, -1]]
        if lowest > len(matrix) * np.finfo(float).eps * highest:
            form = StandardForm.from_mass(stiffness, matrix)
            eigenvalues = form.eigenvalues(nominal, len(matrix))[0]
            if eigenvalues[-1] < WIDEST_SPECTRUM * eigenvalues[0]:
                return form
    return FlexibilityForm(stiffness, mass)


def hertz(eigenvalues: Array) -> Array:
    """Natural frequencies in Hz of the eigenvalues (2 pi f)^2."""
    return np.sqrt(eigenvalues) / (2 * np.pi)
