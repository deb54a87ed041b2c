"""Quadratic approximation of ln f by ln theta, from which refined estimates start."""

from dataclasses import dataclass

import numpy as np

from skthermo._arrays import Array
from skthermo._threads import single_blas_thread

SAMPLES_PER_TERM = 2  # least number of samples for each term of the polynomial
KEPT = 0.01  # weight of what samples of the box tell, beside solutions near the records


@dataclass(frozen=True)
class ResponseSurface:
    """ln f as a quadratic polynomial of z = (ln theta - middle) / scale; coefficients (n_terms, n_modes)."""

    middle: Array
    scale: Array
    coefficients: Array

    @classmethod
    def of_samples(cls, theta: Array, frequencies: Array) -> "ResponseSurface | None":
        """The surface of samples of a box; None where they are too few."""
        known = ~(np.isnan(frequencies).any(axis=1) | np.isnan(theta).any(axis=1))
        x, log_f = np.log(theta[known]), np.log(frequencies[known])
        n_parameters = theta.shape[1]
        if len(x) < SAMPLES_PER_TERM * (n_parameters + 1) * (n_parameters + 2) / 2:
            return None
        middle, scale = x.mean(axis=0), x.std(axis=0)
        return cls(middle, scale, least_squares(terms((x - middle) / scale), log_f))

    def near(self, x: Array, frequencies: Array, sensitivity: Array) -> "ResponseSurface":
        """The surface that is accurate near solutions, frequencies and d ln f / d ln theta at rows of ln theta = x.

        In directions in which these hardly differ, this surface is kept.
        """
        solved = np.isfinite(frequencies).all(axis=1) & np.isfinite(sensitivity).all(axis=(1, 2))
        z, log_f = (x[solved] - self.middle) / self.scale, np.log(frequencies[solved])
        slopes = (sensitivity[solved] * self.scale).swapaxes(1, 2).reshape(-1, log_f.shape[1])
        kept = KEPT * np.sqrt(len(z)) * np.eye(len(self.coefficients))
        equations = np.vstack([terms(z), slopes_of_terms(z).reshape(-1, len(kept)), kept])
        coefficients = least_squares(equations, np.vstack([log_f, slopes, kept @ self.coefficients]))
        return ResponseSurface(self.middle, self.scale, coefficients)

    def linearise(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies and d ln f / d ln theta."""
        z = (np.log(theta) - self.middle) / self.scale
        slopes = np.einsum("spt,tm->smp", slopes_of_terms(z), self.coefficients)
        return np.exp(terms(z) @ self.coefficients), slopes / self.scale


def terms(z: Array) -> Array:
    """1, every variable and every product of two of them, (n_samples, n_terms)."""
    first, second = np.triu_indices(z.shape[1])
    return np.hstack([np.ones((len(z), 1)), z, z[:, first] * z[:, second]])


def slopes_of_terms(z: Array) -> Array:
    """Derivatives of the terms by each variable, (n_samples, n_variables, n_terms)."""
    n_variables = z.shape[1]
    first, second = np.triu_indices(n_variables)
    unit = np.eye(n_variables)
    products = unit[:, first] * z[:, np.newaxis, second] + unit[:, second] * z[:, np.newaxis, first]
    linear = np.broadcast_to(unit, (len(z), n_variables, n_variables))
    return np.concatenate([np.zeros((len(z), n_variables, 1)), linear, products], axis=2)


def least_squares(equations: Array, values: Array) -> Array:
    """Least-squares solution, the same bits on any number of threads."""
    with single_blas_thread():
        return np.linalg.lstsq(equations, values, rcond=None)[0]
