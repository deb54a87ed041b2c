"""Derivatives of the mode shapes of many theta at once, for dense matrices."""

import numpy as np

from skthermo._tables.arrays import Array
from skthermo.fem._terms import DenseTerms

NUDGE = 1e-9  # share of the stiffness that is added where a repeated eigenvalue makes the equations singular


def shape_derivatives(
    stiffness: DenseTerms, mass: DenseTerms, theta: Array, eigenvalues: Array, shapes: Array
) -> Array:
    """Derivatives of mode shapes of unit modal mass, (n_samples, n, n_modes, n_parameters).

    Solves the bordered equations

    [K - lambda M, M phi; phi' M, 0] [d phi; -d lambda] = [-(dK - lambda dM) phi; -1/2 phi' dM phi]

    for each mode of all rows together. They are regular where the eigenvalue is not repeated, also with massless
    degrees of freedom. Rows with NaN eigenvalues, which have no solution, stay NaN.
    """
    solved = np.flatnonzero(np.isfinite(eigenvalues).all(axis=1))
    derivatives = np.full((*shapes.shape, theta.shape[1]), np.nan)
    theta, eigenvalues, shapes = theta[solved], eigenvalues[solved], shapes[solved]
    K, M = stiffness.assemble(theta), mass.assemble(theta)
    forces, d_masses = -stiffness.batch_derivatives(theta, shapes), np.zeros((len(theta), *derivatives.shape[2:]))
    if not mass.is_constant:
        inertia = mass.batch_derivatives(theta, shapes)
        forces += eigenvalues[:, np.newaxis, :, np.newaxis] * inertia
        d_masses = np.einsum("sim,simp->smp", shapes, inertia)
    for mode in range(shapes.shape[2]):
        phi, shift = shapes[:, :, mode], eigenvalues[:, mode, np.newaxis, np.newaxis]
        right = np.concatenate([forces[:, :, mode], -0.5 * d_masses[:, np.newaxis, mode]], axis=1)
        border = (M @ phi[:, :, np.newaxis])[:, :, 0]
        derivatives[solved, :, mode] = _solve_bordered(K - shift * M, border, right, K)
    return derivatives


def _solve_bordered(matrices: Array, borders: Array, right: Array, scale: Array) -> Array:
    """The first n unknowns of equations with a border of one row and column."""
    n = matrices.shape[1]
    largest = np.abs(scale).max(axis=(1, 2), initial=0.0)
    factors = largest / np.abs(borders).max(axis=1)
    bordered = np.zeros((len(matrices), n + 1, n + 1))
    bordered[:, :n, :n] = matrices
    bordered[:, :n, n] = bordered[:, n, :n] = borders * factors[:, np.newaxis]
    right[:, n] *= factors[:, np.newaxis]
    try:
        found = np.linalg.solve(bordered, right)
    except np.linalg.LinAlgError:
        bordered[:, :n, :n] += NUDGE * largest[:, np.newaxis, np.newaxis] * np.eye(n)
        found = np.linalg.solve(bordered, right)
    return np.asarray(found, dtype=float)[:, :n]
