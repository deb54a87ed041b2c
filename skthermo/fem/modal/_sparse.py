"""Sparse eigenproblems K phi = lambda M phi, one theta after the other."""

from collections.abc import Callable

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo.fem._factors import Factors
from skthermo.fem._terms import SparseTerms
from skthermo.fem.modal._dense import EigenSolver

MAX_STEPS = 6
RANDOM_COLUMNS, RANDOM_STEPS = 2, 3
CLUSTER = 0.01  # relative distance of eigenvalues that are evaluated together
DEPENDENT = 1e-14  # share of modal mass below which a direction is rounding error


def modes_near(
    stiffness: scipy.sparse.csc_array,
    factors: Factors,
    mass: scipy.sparse.csc_array,
    guesses: Array,
    n_modes: int,
    *,
    tol: float,
) -> tuple[Array, Array] | None:
    """Eigenvalues in ascending order and shapes of unit modal mass, or None where few steps do not find them.

    Rayleigh-Ritz of A = K^-1 M, in the inner product of M, on the guesses, two columns that a few steps of inverse
    iteration make of random ones, and the images of all these by A. A mode that the guesses lack shows among the
    others. A residual r of unit modal mass says that an eigenvalue of A lies within |r|, and bounds the error of a
    converged one by |r|^2 over the distance to the next (Kato and Temple). The modes are found once this is below
    ``tol`` for all that may be among the lowest.
    """
    if not np.isfinite(guesses).all():
        return None
    nothing = guesses[:, :0]
    known = orthonormal(guesses, mass, nothing, nothing)
    random = np.random.default_rng(0).standard_normal((len(guesses), RANDOM_COLUMNS))
    for _ in range(RANDOM_STEPS):  # towards the lowest modes beside those
        random = factors.solve(orthonormal(random, mass, *known)[1])
    basis, weighted = (np.hstack(both) for both in zip(known, orthonormal(random, mass, *known), strict=True))
    n_followed = basis.shape[1]
    images, block = nothing, weighted
    for _ in range(MAX_STEPS):
        if not block.shape[1] or basis.shape[1] < n_modes:
            return None
        images = np.hstack([images, factors.solve(block)])
        values, weights = np.linalg.eigh(weighted.T @ images)
        values, weights = values[::-1][:n_followed], weights[:, ::-1][:, :n_followed]
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


GUARD_VECTORS = 2  # eigenpairs computed beyond those wanted: repeated and clustered eigenvalues converge together
FEW_MASSES = 20
"""Fewest degrees of freedom with mass, beyond three for each eigenpair, for a Lanczos iteration to converge."""


class ShiftInvertSolver:
    """Lanczos iteration on K^-1 M in the inner product of M, which may be singular.

    The start vector is random with a fixed seed: the same theta gives the same bits, and no mode of a symmetric
    structure is orthogonal to it.
    """

    def __init__(self, stiffness: SparseTerms, mass: SparseTerms):
        self._stiffness = stiffness
        self._mass = mass
        self._start = seeded_start(stiffness.n_dof)
        self._factorise = stiffness.pattern.elimination.factorise

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        return self._each(theta, n_modes, with_shapes=False)[0]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        return self._each(theta, n_modes, with_shapes=True)

    def modes_near(self, theta: Array, guesses: Array, n_modes: int, *, tol: float) -> tuple[Array, Array]:
        """The same as ``modes``, to a relative error ``tol`` of the eigenvalues, faster from good guesses of shapes.

        Guesses (n_samples, n_dof, n_guesses) are for at least as many modes; rows that they do not help are solved as
        by ``modes``.
        """
        return self._each(theta, n_modes, with_shapes=True, guesses=guesses, tol=tol)

    def scaled(self, factors: Array) -> "ShiftInvertSolver":
        return ShiftInvertSolver(self._stiffness.scaled(factors), self._mass)

    def _each(
        self, theta: Array, n_modes: int, *, with_shapes: bool, guesses: Array | None = None, tol: float = 0.0
    ) -> tuple[Array, Array]:
        eigenvalues = np.full((len(theta), n_modes), np.nan)
        shapes = np.full((len(theta) if with_shapes else 0, len(self._start), n_modes), np.nan)
        pairs = zip(self._stiffness.each(theta), self._mass.each(theta), strict=True)
        for row, (stiffness, mass) in enumerate(pairs):
            factors, found = self._factorise(stiffness), None
            if factors is not None and guesses is not None:
                found = modes_near(stiffness, factors, mass, guesses[row], n_modes, tol=tol)
            if found is None:
                found = lowest_modes(stiffness, factors, mass, n_modes, self._start)
            eigenvalues[row] = found[0]
            if with_shapes:
                shapes[row] = found[1]
        return eigenvalues, shapes

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        stiffness, mass = self._stiffness.assemble(theta)[0], self._mass.assemble(theta)[0]
        factors = self._factorise(stiffness)
        eigenvalues, shapes = lowest_modes(stiffness, factors, mass, n_modes, self._start)
        return eigenvalues, shapes, factors.solve if factors else (lambda columns: np.full_like(columns, np.nan))


class GuidedSolver:
    """A sparse solver that starts from the shapes of the same structure on a basis, to a relative error ``tol``."""

    def __init__(self, full: ShiftInvertSolver, reduced: EigenSolver, basis: Array, tol: float):
        self._full = full
        self._reduced = reduced
        self._basis = basis
        self._tol = tol

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        return self.modes(theta, n_modes)[0]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        n_guesses = min(n_modes + 2 * GUARD_VECTORS, self._basis.shape[1])
        if n_guesses < n_modes:
            return self._full.modes(theta, n_modes)
        guesses = self._basis @ self._reduced.modes(theta, n_guesses)[1]
        return self._full.modes_near(theta, guesses, n_modes, tol=self._tol)

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        return self._full.local_modes(theta, n_modes)

    def scaled(self, factors: Array) -> EigenSolver:
        return self._full.scaled(factors)


def lowest_modes(
    stiffness: scipy.sparse.csc_array,
    factors: Factors | None,
    mass: scipy.sparse.csc_array,
    n_modes: int,
    start: Array,
) -> tuple[Array, Array]:
    """Eigenvalues in ascending order and shapes of unit modal mass; NaN without factors or convergence."""
    n_dof = len(start)
    nothing = np.full(n_modes, np.nan), np.full((n_dof, n_modes), np.nan)
    if factors is None:
        return nothing
    massive = np.flatnonzero(mass.diagonal())
    wanted = min(n_modes + GUARD_VECTORS, n_dof - 1)
    if len(massive) < FEW_MASSES + 3 * wanted:
        vectors = modes_of_few_masses(factors, mass, massive, n_modes)
    else:
        inverse = scipy.sparse.linalg.LinearOperator((n_dof, n_dof), matvec=factors.solve, dtype=float)
        try:
            values, vectors = scipy.sparse.linalg.eigsh(stiffness, wanted, mass, sigma=0, OPinv=inverse, v0=start)
        except scipy.sparse.linalg.ArpackError:
            return nothing
        vectors = vectors[:, np.argsort(values)[:n_modes]]
    # One more application of K^-1 M removes the rounding errors at massless degrees of freedom.
    shapes = factors.solve(mass @ vectors)
    shapes /= np.sqrt(np.einsum("im,im->m", shapes, mass @ shapes))
    return np.einsum("im,im->m", shapes, stiffness @ shapes), shapes


def modes_of_few_masses(
    factors: Factors, mass: scipy.sparse.csc_array, massive: NDArray[np.intp], n_modes: int
) -> Array:
    """Lowest shapes, up to their scale, from the dense flexibility R' K^-1 R of the mass M = R R'.

    With few masses the Krylov space of K^-1 M is too small for a Lanczos iteration.
    """
    root = np.zeros((mass.shape[0], len(massive)))
    weights, directions = np.linalg.eigh(mass[massive][:, massive].toarray())
    root[massive] = directions * np.sqrt(np.maximum(weights, 0.0))
    flexible = factors.solve(root)
    return flexible @ np.linalg.eigh(root.T @ flexible)[1][:, ::-1][:, :n_modes]


def seeded_start(n_dof: int) -> Array:
    """A random start vector, the same in every call."""
    return np.random.default_rng(0).standard_normal(n_dof)
