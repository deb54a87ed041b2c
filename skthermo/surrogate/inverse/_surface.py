"""Logarithms of frequencies as polynomials of logarithms of parameters."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.typing import NDArray

from skthermo._estimators.threads import single_blas_thread
from skthermo._tables.arrays import Array

ROWS_PER_CHUNK = 1024
MOST_TERMS = 150  # of a polynomial through solutions with derivatives
KEPT = 0.01  # weight by which coefficients stay small that solutions hardly determine
LEAST_SCALE = 0.01  # of ln theta


@dataclass(frozen=True)
class ResponseSurface:
    """ln f as a polynomial of z = (ln theta - middle) / scale; coefficients (n_terms, n_modes)."""

    degree: int
    middle: Array
    scale: Array
    coefficients: Array

    @classmethod
    def of(cls, x: Array, frequencies: Array, sensitivity: Array | None = None) -> ResponseSurface:
        """The surface through frequencies at rows of ln theta = x and, where they are known, d ln f / d ln theta."""
        solved = np.isfinite(frequencies).all(axis=1)
        x, log_f, n_parameters = x[solved], np.log(frequencies[solved]), x.shape[1]
        most = MOST_TERMS if sensitivity is not None else len(x) // 2
        degree = max((d for d in (1, 2, 3) if n_terms(n_parameters, d) <= most), default=1)
        middle, scale = x.mean(axis=0), np.maximum(x.std(axis=0), LEAST_SCALE)
        z = (x - middle) / scale
        kept = KEPT * np.sqrt(len(z)) * np.eye(n_terms(n_parameters, degree))[1 + n_parameters :]
        equations, values = [terms(z, degree)], [log_f]
        if sensitivity is not None:
            equations.append(slopes_of_terms(z, degree).reshape(-1, kept.shape[1]))
            values.append((sensitivity[solved] * scale).swapaxes(1, 2).reshape(-1, log_f.shape[1]))
            equations.append(kept)
            values.append(np.zeros((len(kept), log_f.shape[1])))
        with single_blas_thread():  # the same bits on any number of threads
            coefficients = np.linalg.lstsq(np.vstack(equations), np.vstack(values), rcond=None)[0]
        return cls(degree, middle, scale, coefficients)

    def linearise(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies and d ln f / d ln theta."""
        z = (np.log(theta) - self.middle) / self.scale
        log_f = np.empty((len(z), self.coefficients.shape[1]))
        slopes = np.empty((*log_f.shape, z.shape[1]))
        for rows in (slice(i, i + ROWS_PER_CHUNK) for i in range(0, len(z), ROWS_PER_CHUNK)):
            log_f[rows] = terms(z[rows], self.degree) @ self.coefficients
            slopes[rows] = (slopes_of_terms(z[rows], self.degree) @ self.coefficients).swapaxes(1, 2)
        return np.exp(log_f), slopes / self.scale


def n_terms(n_parameters: int, degree: int) -> int:
    """Number of products of up to so many parameters, 1 included."""
    return comb(n_parameters + degree, degree)


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
