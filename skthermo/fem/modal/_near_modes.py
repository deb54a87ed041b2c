"""The lowest modes of a large model from good guesses of them, by a few block steps of inverse iteration."""

import numpy as np
import scipy.sparse

from skthermo._tables.arrays import Array
from skthermo.fem._factors import Factors

MAX_STEPS = 6
FURTHER, RANDOM_COLUMNS, RANDOM_STEPS = 2, 2, 3
CLUSTER = 0.01  # relative distance of eigenvalues that are judged together
DEPENDENT = 1e-14  # share of modal mass below which a direction is rounding error


def modes_near(
    stiffness: scipy.sparse.csc_array,
    factors: Factors,
    mass: scipy.sparse.csc_array,
    guesses: Array,
    reference: Array,
    n_modes: int,
    *,
    tol: float,
) -> tuple[Array, Array] | None:
    """Eigenvalues in ascending order and shapes of unit modal mass, or None where few steps do not find them.

    Rayleigh-Ritz of A = K^-1 M, in the inner product of M, on the guesses, two more of the best directions that they
    and the modes of a reference state span, two columns that a few steps of inverse iteration make of random ones, and
    the images of all these by A. A mode that the guesses lack shows among the others. A residual r of unit modal mass
    says that an eigenvalue of A lies within |r|, and bounds the error of a converged one by |r|^2 over the distance to
    the next (Kato and Temple). The modes are found once this is below ``tol`` for all that may be among the lowest.
    """
    columns = np.hstack([guesses, reference])
    if not np.isfinite(columns).all():
        return None
    nothing = columns[:, :0]
    known = orthonormal(columns, mass, nothing, nothing)[0]
    lowest = known @ np.linalg.eigh(known.T @ (stiffness @ known))[1][:, : guesses.shape[1] + FURTHER]
    random = np.random.default_rng(0).standard_normal((len(guesses), RANDOM_COLUMNS))
    for _ in range(RANDOM_STEPS):  # towards the lowest modes beside those
        random = factors.solve(orthonormal(random, mass, lowest, mass @ lowest)[1])
    columns = np.hstack([lowest, random])
    basis, weighted = orthonormal(columns, mass, nothing, nothing)
    images, block = nothing, weighted
    for _ in range(MAX_STEPS):
        if not block.shape[1] or basis.shape[1] < n_modes:
            return None
        images = np.hstack([images, factors.solve(block)])
        values, weights = np.linalg.eigh(weighted.T @ images)
        values, weights = values[::-1][: columns.shape[1]], weights[:, ::-1][:, : columns.shape[1]]
        vectors = images @ weights
        residuals = vectors - basis @ (weights * values)
        distances = np.sqrt(np.einsum("im,im->m", residuals, mass @ residuals))
        if are_found(values, distances, n_modes, tol):
            shapes = vectors[:, :n_modes]
            shapes /= np.sqrt(np.einsum("im,im->m", shapes, mass @ shapes))
            return np.einsum("im,im->m", shapes, stiffness @ shapes), shapes
        added, block = orthonormal(images[:, -block.shape[1] :], mass, basis, weighted)
        basis, weighted = np.hstack([basis, added]), np.hstack([weighted, block])
    return None


def are_found(values: Array, distances: Array, n_modes: int, tol: float) -> bool:
    """Whether all eigenvalues that may be among the largest ``n_modes`` have converged to ``tol``."""
    apart = np.abs(values / values[:, np.newaxis] - 1)
    together = apart < CLUSTER
    gaps = np.where(together, np.inf, apart).min(axis=1)
    errors = together @ (distances / values) ** 2 / gaps
    wanted = values + distances >= values[n_modes - 1]
    return bool(values[n_modes - 1] > 0 and (errors[wanted] < tol).all())


def orthonormal(columns: Array, mass: scipy.sparse.csc_array, basis: Array, weighted: Array) -> tuple[Array, Array]:
    """Directions x of the columns with x' M x = 1, M-orthogonal to each other and to a basis, and M x."""
    for _ in range(2):  # the second time against rounding
        columns = columns - basis @ (weighted.T @ columns)
    products = columns.T @ (mass @ columns)
    scale = np.sqrt(np.maximum(products.diagonal(), np.finfo(float).tiny))
    shares, directions = np.linalg.eigh(products / scale / scale[:, np.newaxis])
    kept = shares > DEPENDENT
    vectors = (columns / scale) @ (directions[:, kept] / np.sqrt(shares[kept]))
    return vectors, mass @ vectors
