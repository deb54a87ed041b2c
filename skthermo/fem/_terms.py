"""Matrices that are affine in products of the parameters."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROWS_PER_CHUNK = 256
CHUNK_BYTES = 2**25


class AffineTerms:
    """The sum over t of ``factor_t * prod_p(theta_p ** exponent_tp) * matrix_t``.

    Parameters
    ----------
    matrices : ndarray of shape (n_terms, n, n)
        Symmetric matrices.
    exponents : ndarray of shape (n_terms, n_parameters)
        How often each parameter multiplies each term; a row of zeros is the constant part.
    factors : ndarray of shape (n_terms,), optional
        Fixed multipliers, such as what damage leaves of a term. One by default.
    """

    def __init__(self, matrices: Array, exponents: NDArray[np.int64], factors: Array | None = None):
        self.matrices = matrices
        self.exponents = exponents
        self.factors = np.ones(len(matrices)) if factors is None else factors
        for array in (self.matrices, self.exponents, self.factors):
            array.flags.writeable = False

    @property
    def n_dof(self) -> int:
        return self.matrices.shape[1]

    @property
    def is_constant(self) -> bool:
        return not self.exponents.any()

    def coefficients(self, theta: Array) -> Array:
        """What multiplies each matrix, (n_samples, n_terms)."""
        return self.factors * np.prod(theta[:, np.newaxis] ** self.exponents, axis=2)

    def coefficient_gradients(self, theta: Array) -> Array:
        """Derivative of ``coefficients``, (n_samples, n_terms, n_parameters)."""
        return self.coefficients(theta)[:, :, np.newaxis] * self.exponents / theta[:, np.newaxis]

    def assemble(self, theta: Array) -> Array:
        """The summed matrices, (n_samples, n, n)."""
        flat = self.matrices.reshape(len(self.matrices), -1)
        return (self.coefficients(theta) @ flat).reshape(-1, self.n_dof, self.n_dof)

    def quadratic_forms(self, shapes: Array) -> Array:
        """phi' A_t phi of every shape and term, (n_samples, n_modes, n_terms)."""
        forms = [np.einsum("sim,sim->sm", shapes, matrix @ shapes) for matrix in self.matrices]
        return np.stack(forms, axis=2)

    def gradients(self, theta: Array, shapes: Array) -> Array:
        """phi' (dA / d theta_p) phi, (n_samples, n_modes, n_parameters)."""
        return self.quadratic_forms(shapes) @ self.coefficient_gradients(theta)

    def scaled(self, factors: Array) -> "AffineTerms":
        """The same matrices, each multiplied once more."""
        return AffineTerms(self.matrices, self.exponents, self.factors * factors)

    def congruent(self, basis: Array) -> "AffineTerms":
        """Each matrix A_t as basis' A_t basis; the coefficients stay."""
        return AffineTerms(basis.T @ self.matrices @ basis, self.exponents, self.factors)
