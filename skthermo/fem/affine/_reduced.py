"""Affine models on a basis of mode shapes, which grows until a stated error is reached."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import NamedTuple, Self

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU

from skthermo._estimators.threads import map_on_blas_threads
from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, Bounds, RandomState, as_random_state, check_bounds, check_theta
from skthermo.exceptions import ModelWarning
from skthermo.fem._terms import nominal_theta
from skthermo.fem.affine._base import AffineBase, Change, Groups, Names
from skthermo.fem.affine._core import AffineCore
from skthermo.fem.modal import GuidedSolver, ShiftInvertSolver, factorise, pair_modes

FIRST_SNAPSHOTS = 16
UNGUIDED = 2  # snapshots, beside which all others start from the modes of a basis
SNAPSHOT_SHARE = 10.0  # largest error of an eigenvalue of a snapshot, as a share of the basis's tolerance
CHECK_SHARE = 1e-2  # the same at a check point
NEAR = 10  # estimated errors, in units of ``tol``, up to which a step towards the modes replaces them
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
    """Add modes at the points of largest estimated error until estimate and true error at new points are small.

    Once errors are small, the full model is not solved at such a point: instead of a mode, K_0^-1 r is added, the
    direction in which a step of preconditioned conjugate gradients would correct it.
    """
    own_seed = as_random_state(random_state).randint(2**32, size=8, dtype=np.uint32)
    random = np.random.RandomState(own_seed)  # other points than those of a sample with the same seed
    nominal = nominal_theta(len(bounds))
    stiffness = csc_array(full.stiffness.assemble(nominal)[0])
    factors = factorise(stiffness)
    if start is None:
        used = np.vstack([nominal, *drawn(bounds, random, FIRST_SNAPSHOTS)])
        start, points = snapshots_at(full, used[:UNGUIDED]), used[UNGUIDED:]
    else:
        used = points = nominal[:0]
    directions = principal_directions(of_unit_energy(start, stiffness), stiffness, LEAST_SHARE * tol)
    vectors, core = basis_of(directions, full, tol)
    new = of_unit_energy(snapshots_at(guided(full, core, vectors, SNAPSHOT_SHARE * tol), points), stiffness)
    largest: list[float] = []
    for _ in range(MAX_ROUNDS):
        if new.shape[1]:
            known = directions.vectors * np.sqrt(directions.energies)
            directions = principal_directions(np.hstack([known, new]), stiffness, LEAST_SHARE * tol)
            vectors, core = basis_of(directions, full, tol)
        for candidates in drawn(bounds, random, CANDIDATES_PER_ROUND)[::-1]:  # errors are largest at corners
            estimates, steps = estimated_errors(full, core, vectors, candidates, factors)
            errors, is_near = estimates.max(axis=1), estimates.max() < NEAR * tol
            if errors.max() >= tol / 2:
                break
        else:
            candidates, is_near = without(np.vstack(drawn(bounds, random, CHECK_POINTS)), used), False
            errors = true_errors(guided(full, core, vectors, CHECK_SHARE * tol), core, candidates)
            if errors.max() < tol / 2:
                return Basis(vectors, core, float(errors.max()), candidates, used)
        largest.append(float(errors.max()))
        before = largest[-1 - HOPELESS_ROUNDS] if len(largest) > HOPELESS_ROUNDS else np.inf
        if largest[-1] > max(before / 2, HOPELESS * tol):
            break
        worst = np.argsort(-errors)[:SNAPSHOTS_PER_ROUND]
        used = np.vstack([used, candidates[worst]])
        if is_near:
            new = np.hstack([steps[row][:, estimates[row] >= tol / 4] for row in worst])
        else:
            snapshots = snapshots_at(guided(full, core, vectors, SNAPSHOT_SHARE * tol), candidates[worst])
            new = of_unit_energy(snapshots, stiffness)
    raise RuntimeError(
        f"after {len(largest)} rounds {vectors.shape[1]} basis vectors do not give frequencies to {tol:g}; expected a "
        "larger tol, or narrower bounds"
    )


def basis_of(directions: Directions, full: AffineCore, tol: float) -> tuple[Array, AffineCore]:
    """Basis vectors, the directions with ``tol`` or more of the strain energy of a snapshot, and the core on them."""
    vectors = directions.vectors[:, directions.energies > tol]
    return vectors, full.projected(vectors, tol)


def guided(full: AffineCore, core: AffineCore, vectors: Array, tol: float) -> AffineCore:
    """The full core; a sparse one is solved from the shapes of the core on the basis, to a relative error ``tol``."""
    if not isinstance(full.solver, ShiftInvertSolver):
        return full
    return replace(full, solver=GuidedSolver(full.solver, core.solver, vectors, tol))


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
        rows = rows[full.may_be_missed(rows, mac, pair_modes(mac, full.nominal.repeated))]
        n_candidates = min(2 * n_candidates, full.max_candidates)
    side_by_side = np.hstack(shapes)
    return side_by_side[:, np.isfinite(side_by_side).all(axis=0)]


def estimated_errors(
    full: AffineCore, core: AffineCore, vectors: Array, theta: Array, factors: SuperLU
) -> tuple[Array, list[Array]]:
    """r' K_0^-1 r / (2 lambda) of the modes of every row, (n_samples, n_modes), and K_0^-1 r / sqrt(lambda)."""
    errors, steps = [], []
    for rows in np.split(theta, range(full.rows_per_chunk, len(theta), full.rows_per_chunk)):
        frequencies, shapes = core.modes(rows)
        eigenvalues, phi = (2 * np.pi * frequencies) ** 2, vectors @ shapes
        inertia = eigenvalues[:, np.newaxis] * full.mass.product(rows, phi)
        residuals = full.stiffness.product(rows, phi) - inertia
        parts = [factors.solve(residual) for residual in residuals]
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


def principal_directions(vectors: Array, stiffness: csc_array, least: float) -> Directions:
    """Principal directions of vectors in the inner product of a stiffness, without those of less than some energy."""
    energies, turns = scipy.linalg.eigh(vectors.T @ (stiffness @ vectors))
    kept = energies > max(least, LEAST_ENERGY * energies[-1])
    return Directions(vectors @ (turns[:, kept] / np.sqrt(energies[kept])), energies[kept])


class ReducedModel(AffineBase):
    """An affine FE model projected on a small basis of its own mode shapes, accurate to a stated error.

    The basis V is spanned by modes at random points and corners of the box, and then at points where an error estimate
    is largest. Every term is projected once, V' K_t V, so that each solve is a small dense eigenproblem.
    `AffineModel.reduced` makes such a model.

    Parameters
    ----------
    full : AffineModel
        The model to reduce.
    bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
        Box of multipliers in which the error is controlled. Outside it a warning is given.
    tol : float, default=1e-5
        Largest relative error of a frequency. The basis grows until the errors at fresh random
        points and corners of the box are below tol / 2.
    random_state : int, RandomState or None, default=None
        Seed of those points, which are never those of a sample drawn with the same seed.

    Attributes
    ----------
    basis_size_ : int
        Number of basis vectors.
    error_ : float
        Largest relative error of a frequency at the check points.
    check_points_ : ndarray of shape (n_checks, n_parameters)
        Theta at which the full model was solved to compute ``error_``: ten or more uniform in the box, and up to
        ten of its corners, none of them a snapshot point.
    snapshot_points_ : ndarray of shape (n_snapshots, n_parameters)
        Theta whose modes, or steps towards them, span the basis.

    Raises
    ------
    ValueError
        If the bounds are infeasible or ``tol`` is not between 0 and 1.
    RuntimeError
        If no basis reaches ``tol``.

    Notes
    -----
    The j-th lowest frequency is never below the full model's j-th (Rayleigh-Ritz). The estimate of a relative error
    [MMO00]_ is r' K_0^-1 r / (2 lambda), with the residual r = K phi - lambda M phi of a mode of unit modal mass and
    the nominal stiffness K_0: within 30 % of K_0, 0.64 to 1.3 times the error. Shapes are given at all degrees of
    freedom. A damaged model is checked anew, and its basis is enlarged if necessary. Iteration on the basis errs by at
    most a hundredth of ``tol``, which a bound certifies row by row; LAPACK solves the other rows.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.datasets import make_truss
    >>> truss = make_truss()
    >>> reduced = truss.reduced(bounds=0.2, random_state=0)
    >>> reduced.error_ < 5e-6
    True
    >>> theta = [[0.9, 1.1, 1.0, 0.85]]
    >>> bool(np.abs(reduced.frequencies(theta) / truss.frequencies(theta) - 1).max() < 1e-5)
    True
    """

    _basis: Array

    def __init__(self, full: AffineBase, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None):
        if not isinstance(full, AffineBase):
            raise ValueError(f"full is {full!r:.200}; expected an AffineModel, or a ReducedModel")
        if not isinstance(tol, int | float | np.floating) or not 0 < tol < 1:
            raise ValueError(f"tol is {tol!r}; expected a relative error between 0 and 1, such as 1e-5")
        self._parameter_names, self._groups, self._contents = full.parameter_names, full._groups, full._contents
        self._dofs = full.dofs
        self._full = full
        self._bounds = check_bounds(bounds, full.parameter_names)
        self._tol = tol
        self._use(grow_basis(full._core, self._bounds, tol, random_state))

    @property
    def full(self) -> AffineBase:
        """The model that was reduced."""
        return self._full

    @property
    def basis_size_(self) -> int:
        """Number of basis vectors."""
        return self._core.stiffness.n_dof

    def rescaled(self, theta: ArrayLike) -> Self:
        row = check_theta(theta, self.parameter_names, one_row=True)
        full = self._full.rescaled(row)
        return self._twin(
            _full=full,
            _bounds=self._bounds / row.T,
            _core=full._core.projected(self._basis, self._tol),
            check_points_=self.check_points_ / row,
            snapshot_points_=self.snapshot_points_ / row,
        )

    def reduced(self, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None) -> ReducedModel:
        return ReducedModel(self._full, bounds, tol=tol, random_state=random_state)

    def __repr__(self) -> str:
        return f"ReducedModel({self._full!r}, {self.basis_size_} basis vectors, error {self.error_:.1e})"

    @property
    def _full_core(self) -> AffineCore:
        return self._full._core

    def _changed(self, change: Change, names: Names = None, bounds: Array | None = None, groups: Groups = None) -> Self:
        full = self._full._changed(change, names, groups=groups)
        known = dict(zip(self._parameter_names, self._bounds, strict=True))
        new = () if bounds is None else bounds
        known |= dict(zip([name for name in full.parameter_names if name not in known], new, strict=True))
        bounds = np.array([known[name] for name in full.parameter_names])
        twin = self._twin(_full=full, _bounds=bounds, _parameter_names=full.parameter_names, _groups=full._groups)
        twin._use(grow_basis(full._core, bounds, self._tol, 0, start=self._basis))
        return twin

    def _use(self, basis: Basis) -> None:
        self._core, self._basis = basis.core, basis.vectors
        self.error_, self.check_points_, self.snapshot_points_ = basis.error, basis.check_points, basis.snapshot_points

    def _warn_of_bounds(self, theta: Array) -> None:
        lowest, highest = self._bounds.T * [[1 - 1e-9], [1 + 1e-9]]
        outside = ((theta < lowest) | (theta > highest)).any(axis=1)
        if outside.any():
            warn_user(
                f"{outside.sum()} of {len(theta)} theta are outside the bounds for which the model was reduced, row "
                f"{np.flatnonzero(outside)[0]} the first. Frequencies there may be wrong by more than {self._tol:g}. "
                "Reduce the model for wider bounds, or use the full one",
                ModelWarning,
                "outside-reduced-bounds",
            )
