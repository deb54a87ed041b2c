"""The basis of mode shapes on which a reduced model is solved; it grows until a stated error is reached."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import scipy.linalg
from scipy.sparse import csc_array

from skthermo._core.arrays import Array, RandomState, as_random_state
from skthermo._core.parallel import map_on_blas_threads
from skthermo.fem._factors import Solve, factorise
from skthermo.fem.modal import AffineCore

Basis = tuple[Array, AffineCore, float, Array, Array]
"""Basis vectors (n_dof, n), the core on them, its largest relative error of a frequency at the check points, these
points, and those of the snapshots."""


def grow_basis(
    full: AffineCore, bounds: Array, tol: float, random_state: RandomState, start: Array | None = None
) -> Basis:
    """Add modes at the points of largest estimated error until estimate and true error at new points are small.

    Once errors are small, the full model is not solved at such a point: instead of a mode, K_0^-1 r is added, the
    direction in which a step of preconditioned conjugate gradients would correct it.
    """
    own_seed = as_random_state(random_state).randint(2**32, size=8, dtype=np.uint32)
    random = np.random.RandomState(own_seed)  # other points than those of a sample with the same seed
    nominal = np.ones((1, len(bounds)))
    stiffness = csc_array(full.stiffness.assemble(nominal)[0])
    solve: Any = factorise(stiffness)
    used = nominal[:0]
    if start is None:
        used = np.vstack([nominal, *drawn(bounds, random, 16)])
        start = snapshots_at(full, used)
    known, largest = of_unit_energy(start, stiffness), list[float]()
    for _ in range(40):
        directions, energies = principal_directions(known, stiffness, 1e-3 * tol)
        vectors = directions[:, energies > tol]
        core = full.projected(vectors, tol)
        for candidates in drawn(bounds, random, 64)[::-1]:  # errors are largest at corners
            estimates, steps = estimated_errors(full, core, vectors, candidates, solve)
            errors, is_near = estimates.max(axis=1), estimates.max() < 10 * tol
            if errors.max() >= tol / 2:
                break
        else:
            candidates, is_near = np.vstack(drawn(bounds, random, 20)), False
            candidates = candidates[~(candidates[:, np.newaxis] == used).all(axis=2).any(axis=1)]
            errors = true_errors(full, core, candidates)
            if errors.max() < tol / 2:
                return vectors, core, float(errors.max()), candidates, used
        largest.append(float(errors.max()))
        before = largest[-4] if len(largest) > 3 else np.inf
        if largest[-1] > max(before / 2, 1000 * tol):  # modes that are followed have dissolved among others
            break
        worst = np.argsort(-errors)[:12]
        used = np.vstack([used, candidates[worst]])
        if is_near:
            new = np.hstack([steps[row][:, estimates[row] >= tol / 4] for row in worst])
        else:
            new = of_unit_energy(snapshots_at(full, candidates[worst]), stiffness)
        known = np.hstack([directions * np.sqrt(energies), new])
    raise RuntimeError(
        f"after {len(largest)} rounds {vectors.shape[1]} basis vectors do not give frequencies to {tol:g}; expected a "
        "larger tol, or narrower bounds"
    )


def drawn(bounds: Array, random: np.random.RandomState, n_points: int) -> tuple[Array, Array]:
    """Uniform random points of a box, and as many of its corners, or all of these where they are fewer."""
    lowest, highest = bounds.T
    if 2 ** len(bounds) <= n_points // 2:
        corners = np.array([*product(*bounds)])
    else:
        corners = np.where(random.randint(2, size=(n_points // 2, len(bounds))), highest, lowest)
    return random.uniform(lowest, highest, size=(n_points - len(corners), len(bounds))), corners


def snapshots_at(full: AffineCore, theta: Array) -> Array:
    """Shapes of the lowest modes of the full model, and of all modes that its columns are looked for among."""
    rows, n_candidates, shapes = theta, full.first_candidates, [np.empty((full.stiffness.n_dof, 0))]
    while len(rows):
        candidates = full.solver.modes(rows, n_candidates)[1]
        shapes += [*candidates]
        if not full.track or n_candidates == full.max_candidates:
            break
        rows = rows[full.paired(rows, candidates)[2]]
        n_candidates = min(2 * n_candidates, full.max_candidates)
    side_by_side = np.hstack(shapes)
    return side_by_side[:, np.isfinite(side_by_side).all(axis=0)]


def estimated_errors(
    full: AffineCore, core: AffineCore, vectors: Array, theta: Array, solve: Solve
) -> tuple[Array, list[Array]]:
    """r' K_0^-1 r / (2 lambda) of the modes of every row, (n_samples, n_modes), and K_0^-1 r / sqrt(lambda)."""
    errors, steps = [], []
    for rows in np.split(theta, range(full.rows_per_chunk, len(theta), full.rows_per_chunk)):
        frequencies, shapes = core.modes(rows)
        eigenvalues, phi = (2 * np.pi * frequencies) ** 2, vectors @ shapes
        inertia = eigenvalues[:, np.newaxis] * full.mass.product(rows, phi)
        residuals = full.stiffness.product(rows, phi) - inertia
        parts = [solve(residual) for residual in residuals]
        errors.append(np.einsum("sim,sim->sm", residuals, parts) / (2 * eigenvalues))
        steps += [part / np.sqrt(squares) for part, squares in zip(parts, eigenvalues, strict=True)]
    return np.nan_to_num(np.concatenate(errors)), steps


def true_errors(full: AffineCore, core: AffineCore, theta: Array) -> Array:
    """Largest relative error of a frequency in every row."""
    size = full.rows_per_chunk
    chunks = [theta[i : i + size] for i in range(0, len(theta), size)]
    exact = np.concatenate([part for (part,) in map_on_blas_threads(full.frequencies, chunks)])
    errors = np.where(np.isnan(exact), 0.0, np.abs(core.frequencies(theta)[0] / exact - 1))
    return np.nan_to_num(errors, nan=np.inf).max(axis=1)


def of_unit_energy(vectors: Array, stiffness: csc_array) -> Array:
    """Vectors x scaled to x' K x = 1."""
    return vectors / np.sqrt(np.einsum("im,im->m", vectors, stiffness @ vectors))


def principal_directions(vectors: Array, stiffness: csc_array, least: float) -> tuple[Array, Array]:
    """Principal directions of vectors, orthonormal in a stiffness, and the energies of the vectors along them, without
    directions of less than some energy."""
    energies, turns = scipy.linalg.eigh(vectors.T @ (stiffness @ vectors))
    kept = energies > max(least, 1e-13 * energies[-1])  # less is rounding error
    return vectors @ (turns[:, kept] / np.sqrt(energies[kept])), energies[kept]
