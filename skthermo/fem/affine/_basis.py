"""A basis of mode shapes that represents a model within a box, enlarged until a stated error is reached."""

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU

from skthermo._estimators.threads import map_on_blas_threads
from skthermo._tables.arrays import Array, RandomState, as_random_state
from skthermo.fem._theta import nominal_theta
from skthermo.fem.affine._core import AffineCore
from skthermo.fem.modal import GuidedSolver, ShiftInvertSolver, factorise, may_be_missed, pair_modes

FIRST_SNAPSHOTS = 16
UNGUIDED = 3  # snapshots, beside which all others start from the modes of a basis
SNAPSHOT_SHARE = 10.0  # largest error of an eigenvalue of a snapshot, as a share of the basis's tolerance
CHECK_SHARE = 1e-2  # the same at a check point
SNAPSHOTS_PER_ROUND = 12
CANDIDATES_PER_ROUND = 64
CHECK_POINTS = 20
MAX_ROUNDS = 40
HOPELESS, HOPELESS_ROUNDS = 1000, 3
"""Estimated errors, in units of ``tol``, that are given up if so many further rounds have not halved them: points where
the modes that are followed have dissolved among others, far from the nominal state."""

LEAST_ENERGY = 1e-13  # share of strain energy below which a direction is rounding error
LEAST_SHARE = 1e-3  # of the tolerance, the energy below which a direction is forgotten in further rounds


class Basis(NamedTuple):
    """Basis vectors (n_dof, n), the core on them, and its largest relative error of a frequency at the check points."""

    vectors: Array
    core: AffineCore
    error: float
    check_points: Array
    snapshot_points: Array


class Directions(NamedTuple):
    """Directions (n_dof, n), orthonormal in a stiffness, and the energies (n,) that vectors have along them."""

    vectors: Array
    energies: Array


def grow_basis(
    full: AffineCore, bounds: Array, tol: float, random_state: RandomState, start: Array | None = None
) -> Basis:
    """Add modes at the points of largest estimated error until estimate and true error at new points are small."""
    random = own_stream(random_state)
    nominal = nominal_theta(len(bounds))
    stiffness = csc_array(full.stiffness.assemble(nominal)[0])
    factors = factorise(stiffness)
    if start is None:
        points = np.vstack([nominal, *drawn(bounds, random, FIRST_SNAPSHOTS)])
        used, snapshots, points = [points], snapshots_at(full, points[:UNGUIDED]), points[UNGUIDED:]
    else:
        used, snapshots, points = [nominal[:0]], start, nominal[:0]
    directions = principal_directions(of_unit_energy(snapshots, stiffness), stiffness, LEAST_SHARE * tol)
    vectors, core = basis_of(directions, full, tol)
    largest: list[float] = []
    for _ in range(MAX_ROUNDS):
        if len(points):
            snapshots = snapshots_at(guided(full, core, vectors, SNAPSHOT_SHARE * tol), points)
            known = directions.vectors * np.sqrt(directions.energies)
            known_and_new = np.hstack([known, of_unit_energy(snapshots, stiffness)])
            directions = principal_directions(known_and_new, stiffness, LEAST_SHARE * tol)
            vectors, core = basis_of(directions, full, tol)
        for candidates in drawn(bounds, random, CANDIDATES_PER_ROUND)[::-1]:  # errors are largest at corners
            errors = estimated_errors(full, core, vectors, candidates, factors)
            if errors.max() >= tol / 2:
                break
        else:
            candidates = without(np.vstack(drawn(bounds, random, CHECK_POINTS)), np.vstack(used))
            errors = true_errors(guided(full, core, vectors, CHECK_SHARE * tol), core, candidates)
            if errors.max() < tol / 2:
                return Basis(vectors, core, float(errors.max()), candidates, np.vstack(used))
        largest.append(float(errors.max()))
        before = largest[-1 - HOPELESS_ROUNDS] if len(largest) > HOPELESS_ROUNDS else np.inf
        if largest[-1] > max(before / 2, HOPELESS * tol):
            break
        points = candidates[np.argsort(-errors)[:SNAPSHOTS_PER_ROUND]]
        used.append(points)
    raise RuntimeError(
        f"after {len(largest)} rounds {vectors.shape[1]} basis vectors do not give frequencies to {tol:g}; expected a "
        "larger tol, or narrower bounds"
    )


def basis_of(directions: Directions, full: AffineCore, tol: float) -> tuple[Array, AffineCore]:
    """Basis vectors, the directions that hold ``tol`` or more of the strain energy of a snapshot, and the core on them.

    No snapshot loses more than ``tol`` with any direction.
    """
    vectors = directions.vectors[:, directions.energies > tol]
    return vectors, full.projected(vectors, tol)


def guided(full: AffineCore, core: AffineCore, vectors: Array, tol: float) -> AffineCore:
    """The full core; a sparse one is solved from the shapes of the core on the basis, to a relative error ``tol``."""
    if not isinstance(full.solver, ShiftInvertSolver):
        return full
    return replace(full, solver=GuidedSolver(full.solver, core.solver, vectors, tol))


def own_stream(seed: RandomState) -> np.random.RandomState:
    """A random stream that differs from that of a sample drawn with the same seed."""
    return np.random.RandomState(as_random_state(seed).randint(2**32, size=8, dtype=np.uint32))


def drawn(bounds: Array, random: np.random.RandomState, n_points: int) -> tuple[Array, Array]:
    """Uniform random points of a box, and as many of its corners, or all of these where they are fewer."""
    lowest, highest = bounds.T
    if 2 ** len(bounds) <= n_points // 2:
        corners = np.array([*product(*bounds)])
    else:
        corners = np.where(random.randint(2, size=(n_points // 2, len(bounds))), highest, lowest)
    return random.uniform(lowest, highest, size=(n_points - len(corners), len(bounds))), corners


def without(points: Array, others: Array) -> Array:
    """The points that are not among others."""
    return points[~(points[:, np.newaxis] == others).all(axis=2).any(axis=1)]


def snapshots_at(full: AffineCore, theta: Array) -> Array:
    """Shapes of the lowest modes of the full model, and of all modes that its columns are looked for among."""
    rows, n_candidates, shapes = theta, full.first_candidates, [np.empty((full.stiffness.n_dof, 0))]
    while len(rows):
        candidates = full.solver.modes(rows, n_candidates)[1]
        shapes += [*candidates]
        if not full.track or n_candidates == full.max_candidates:
            break
        mac = full.nominal_mac(candidates)
        rows = rows[may_be_missed(mac, pair_modes(mac, full.nominal.repeated), full.nominal.repeated)]
        n_candidates = min(2 * n_candidates, full.max_candidates)
    side_by_side = np.hstack(shapes)
    return side_by_side[:, np.isfinite(side_by_side).all(axis=0)]


def estimated_errors(full: AffineCore, core: AffineCore, vectors: Array, theta: Array, factors: SuperLU) -> Array:
    """Largest r' K_0^-1 r / (2 lambda) over the modes of every row."""
    errors = []
    for rows in np.split(theta, range(full.rows_per_chunk, len(theta), full.rows_per_chunk)):
        frequencies, shapes = core.modes(rows)
        eigenvalues, phi = (2 * np.pi * frequencies) ** 2, vectors @ shapes
        inertia = eigenvalues[:, np.newaxis] * full.mass.product(rows, phi)
        residuals = full.stiffness.product(rows, phi) - inertia
        norms = [np.einsum("im,im->m", residual, factors.solve(residual)) for residual in residuals]
        errors.append((np.array(norms) / (2 * eigenvalues)).max(axis=1))
    return np.nan_to_num(np.concatenate(errors))


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


def principal_directions(vectors: Array, stiffness: csc_array, least: float) -> Directions:
    """Principal directions of vectors in the inner product of a stiffness, without those of less than some energy.

    The directions times the roots of their energies stand for the vectors where further ones are added.
    """
    energies, turns = scipy.linalg.eigh(vectors.T @ (stiffness @ vectors))
    kept = energies > max(least, LEAST_ENERGY * energies[-1])
    return Directions(vectors @ (turns[:, kept] / np.sqrt(energies[kept])), energies[kept])
