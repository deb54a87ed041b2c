"""Polynomials of ln theta that approximate ln f, from which refined estimates start."""

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.typing import NDArray

from skthermo._estimators.threads import single_blas_thread
from skthermo._tables.arrays import Array

SAMPLES_PER_TERM = 2  # least number of samples for each term of the polynomial
ROWS_PER_CHUNK = 1024
KEPT = 0.01  # weight of what samples of the box tell, beside solutions near the records


@dataclass(frozen=True)
class ResponseSurface:
    """ln f as a polynomial of z = (ln theta - middle) / scale; coefficients (n_terms, n_modes)."""

    degree: int
    middle: Array
    scale: Array
    coefficients: Array

    @classmethod
    def of_samples(cls, theta: Array, frequencies: Array) -> "ResponseSurface | None":
        """The surface of samples of a box; None where they are too few."""
        known = ~(np.isnan(frequencies).any(axis=1) | np.isnan(theta).any(axis=1))
        x, log_f = np.log(theta[known]), np.log(frequencies[known])
        n_parameters = theta.shape[1]
        degree = next((d for d in (3, 2) if len(x) >= SAMPLES_PER_TERM * comb(n_parameters + d, d)), None)
        if degree is None:
            return None
        middle, scale = x.mean(axis=0), x.std(axis=0)
        return cls(degree, middle, scale, least_squares(terms((x - middle) / scale, degree), log_f))

    def near(self, x: Array, frequencies: Array, sensitivity: Array) -> "ResponseSurface":
        """The surface that is accurate near solutions, frequencies and d ln f / d ln theta at rows of ln theta = x.

        In directions in which these hardly differ, this surface is kept.
        """
        solved = np.isfinite(frequencies).all(axis=1) & np.isfinite(sensitivity).all(axis=(1, 2))
        z, log_f = (x[solved] - self.middle) / self.scale, np.log(frequencies[solved])
        slopes = (sensitivity[solved] * self.scale).swapaxes(1, 2).reshape(-1, log_f.shape[1])
        kept = KEPT * np.sqrt(len(z)) * np.eye(len(self.coefficients))
        equations = np.vstack([terms(z, self.degree), slopes_of_terms(z, self.degree).reshape(-1, len(kept)), kept])
        coefficients = least_squares(equations, np.vstack([log_f, slopes, kept @ self.coefficients]))
        return replace(self, coefficients=coefficients)

    def linearise(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies and d ln f / d ln theta."""
        z = (np.log(theta) - self.middle) / self.scale
        log_f, slopes = (
            np.empty((len(z), self.coefficients.shape[1])),
            np.empty((len(z), self.coefficients.shape[1], z.shape[1])),
        )
        for rows in (slice(i, i + ROWS_PER_CHUNK) for i in range(0, len(z), ROWS_PER_CHUNK)):
            log_f[rows] = terms(z[rows], self.degree) @ self.coefficients
            slopes[rows] = (slopes_of_terms(z[rows], self.degree) @ self.coefficients).swapaxes(1, 2)
        return np.exp(log_f), slopes / self.scale


def products(n_variables: int, degree: int) -> list[NDArray[np.intp]]:
    """Which variables are multiplied in each product of one, two, ... variables, (n_products, n_factors)."""
    variables = range(n_variables)
    return [np.array([*combinations_with_replacement(variables, factors)]) for factors in range(1, degree + 1)]


def terms(z: Array, degree: int) -> Array:
    """1 and every product of up to so many variables, (n_samples, n_terms)."""
    values = [z[:, chosen].prod(axis=2) for chosen in products(z.shape[1], degree)]
    return np.hstack([np.ones((len(z), 1)), *values])


def slopes_of_terms(z: Array, degree: int) -> Array:
    """Derivatives of the terms by each variable, (n_samples, n_variables, n_terms)."""
    slopes = [np.zeros((*z.shape, 1))]
    for chosen in products(z.shape[1], degree):
        slope, column = np.zeros((*z.shape, len(chosen))), np.arange(len(chosen))
        for factor in range(chosen.shape[1]):
            slope[:, chosen[:, factor], column] += z[:, np.delete(chosen, factor, axis=1)].prod(axis=2)
        slopes.append(slope)
    return np.concatenate(slopes, axis=2)


def least_squares(equations: Array, values: Array) -> Array:
    """Least-squares solution, the same bits on any number of threads."""
    with single_blas_thread():
        return np.linalg.lstsq(equations, values, rcond=None)[0]
