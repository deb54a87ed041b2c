"""Sparse generalised eigenproblems K phi = lambda M phi, one theta after the other."""

from collections.abc import Callable

import numpy as np
import scipy.sparse.linalg
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo.fem._factors import Factors
from skthermo.fem._terms import SparseTerms
from skthermo.fem._theta import nominal_theta
from skthermo.fem.modal._dense import EigenSolver
from skthermo.fem.modal._near_modes import modes_near

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
        self._references: dict[int, Array] = {}

    def __getstate__(self) -> dict[str, object]:
        return vars(self) | {"_references": {}}  # what was solved before is no part of a model

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        return self._each(theta, n_modes, with_shapes=False)[0]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        return self._each(theta, n_modes, with_shapes=True)

    def modes_near(self, theta: Array, guesses: Array, n_modes: int, *, tol: float) -> tuple[Array, Array]:
        """The same as ``modes``, to a relative error ``tol`` of the eigenvalues, faster from good guesses of shapes.

        Guesses (n_samples, n_dof, n_guesses) are for at least as many modes; rows that they do not help are solved as
        by ``modes``.
        """
        if n_modes not in self._references:
            self._references[n_modes] = self.modes(nominal_theta(theta.shape[1]), n_modes)[1][0]
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
                found = modes_near(stiffness, factors, mass, guesses[row], self._references[n_modes], n_modes, tol=tol)
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
        n_guesses = min(n_modes + GUARD_VECTORS, self._basis.shape[1])
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
