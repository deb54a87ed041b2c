"""Sparse eigenproblems K phi = lambda M phi, one theta after the other, and checks for mechanisms and missing mass."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from skthermo._core.arrays import Array, Label, Matrix, as_dense
from skthermo.fem._factors import Solve, factorise
from skthermo.fem._terms import SparseTerms

GUARD_VECTORS = 2  # eigenpairs computed beyond those wanted: repeated and clustered eigenvalues converge together


class ShiftInvertSolver:
    """Lanczos iteration on K^-1 M in the inner product of M, which may be singular.

    The start vector is random with a fixed seed: the same theta gives the same bits, and no mode of a symmetric
    structure is orthogonal to it.
    """

    def __init__(self, stiffness: SparseTerms, mass: SparseTerms):
        self._stiffness = stiffness
        self._mass = mass
        self._start = seeded_start(stiffness.n_dof)
        self._factorise = stiffness.factorise

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        solved = (lowest_modes(*matrices, n_modes, self._start)[0] for matrices in self._matrices(theta))
        return np.array(list(solved)).reshape(len(theta), n_modes)

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        eigenvalues, shapes = np.empty((len(theta), n_modes)), np.empty((len(theta), len(self._start), n_modes))
        for row, matrices in enumerate(self._matrices(theta)):
            eigenvalues[row], shapes[row] = lowest_modes(*matrices, n_modes, self._start)
        return eigenvalues, shapes

    def _matrices(self, theta: Array) -> Iterator[tuple[Matrix, Solve | None, Matrix]]:
        """Stiffness, solves with it, and mass, row by row."""
        for stiffness, mass in zip(self._stiffness.each(theta), self._mass.each(theta), strict=True):
            yield stiffness, self._factorise(stiffness), mass

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        stiffness, solve, mass = next(self._matrices(theta))
        eigenvalues, shapes = lowest_modes(stiffness, solve, mass, n_modes, self._start)
        return eigenvalues, shapes, solve or (lambda columns: np.full_like(columns, np.nan))


def lowest_modes(
    stiffness: scipy.sparse.csc_array,
    solve: Solve | None,
    mass: scipy.sparse.csc_array,
    n_modes: int,
    start: Array,
) -> tuple[Array, Array]:
    """Eigenvalues in ascending order and shapes of unit modal mass; NaN without a factorisation or convergence."""
    n_dof = len(start)
    nothing = np.full(n_modes, np.nan), np.full((n_dof, n_modes), np.nan)
    if solve is None:
        return nothing
    massive = np.flatnonzero(mass.diagonal())
    wanted = min(n_modes + GUARD_VECTORS, n_dof - 1)
    if len(massive) < 20 + 3 * wanted:  # a Lanczos iteration does not converge
        vectors = modes_of_few_masses(solve, mass, massive, n_modes)
    else:
        inverse = scipy.sparse.linalg.LinearOperator((n_dof, n_dof), matvec=solve, dtype=float)
        try:
            values, vectors = scipy.sparse.linalg.eigsh(stiffness, wanted, mass, sigma=0, OPinv=inverse, v0=start)
        except scipy.sparse.linalg.ArpackError:
            return nothing
        vectors = vectors[:, np.argsort(values)[:n_modes]]
    # One more application of K^-1 M removes the rounding errors at massless degrees of freedom.
    shapes = solve(mass @ vectors)
    shapes /= np.sqrt(np.einsum("im,im->m", shapes, mass @ shapes))
    return np.einsum("im,im->m", shapes, stiffness @ shapes), shapes


def modes_of_few_masses(solve: Solve, mass: scipy.sparse.csc_array, massive: NDArray[np.intp], n_modes: int) -> Array:
    """Lowest shapes, up to their scale, from the dense flexibility R' K^-1 R of the mass M = R R'.

    With few masses the Krylov space of K^-1 M is too small for a Lanczos iteration.
    """
    root = np.zeros((mass.shape[0], len(massive)))
    weights, directions = np.linalg.eigh(mass[massive][:, massive].toarray())
    root[massive] = directions * np.sqrt(np.maximum(weights, 0.0))
    flexible = solve(root)
    return flexible @ np.linalg.eigh(root.T @ flexible)[1][:, ::-1][:, :n_modes]


def seeded_start(n_dof: int) -> Array:
    """A random start vector, the same in every call."""
    return np.random.default_rng(0).standard_normal(n_dof)


def check_supported(stiffness: Matrix, dofs: Sequence[Label] = ()) -> None:
    """Refuse a stiffness that is not positive definite within rounding, and name where the motion is largest.

    The energy x'Kx of a motion is a sum of entries that cancel where the motion is nearly rigid. Of a mechanism,
    rounding of these entries is all that is left; the softest motion of a fine mesh has more.
    """
    diagonal = stiffness.diagonal()
    if (diagonal <= 0).any():
        rows = np.flatnonzero(diagonal <= 0)
        coupled = rows[[abs(stiffness[[row]]).sum() > abs(diagonal[row]) for row in rows]]
        if len(coupled):
            raise ValueError(
                f"the stiffness has no positive diagonal at {_listed(coupled, dofs)}, which other rows are tied to, as "
                "to Lagrange multipliers of constraints; expected a stiffness from which constraints are eliminated, "
                "or stiff springs in their place"
            )
        _refuse(rows, dofs)
    scale = 1 / np.sqrt(diagonal)
    if isinstance(stiffness, np.ndarray):
        eigenvalues, vectors = np.linalg.eigh(scale[:, np.newaxis] * stiffness * scale)
        lowest, vector, rounding = eigenvalues[0], vectors[:, 0], 50 * np.finfo(float).eps * eigenvalues[-1]
    else:
        scaled = _scaled(stiffness, scale)
        lowest, vector = _lowest(scaled)
        rounding = 10 * np.finfo(float).eps * (np.abs(vector) @ (abs(scaled) @ np.abs(vector)))
    if lowest <= rounding:
        motion = np.abs(scale * vector)
        largest = np.argsort(-motion, kind="stable")
        _refuse(largest[motion[largest] > 0.5 * motion[largest[0]]], dofs)


def count_modes(mass: Matrix, *, at_least: int, what: str = "nominal mass", dofs: Sequence[Label] = ()) -> int:
    """How many modes of finite frequency a mass matrix allows: an error if fewer than ``at_least``.

    For a sparse matrix with many masses this is the number of degrees of freedom with mass.
    """
    diagonal = mass.diagonal()
    if isinstance(mass, np.ndarray) or np.count_nonzero(diagonal) <= 500:
        kept = np.flatnonzero(diagonal) if isinstance(mass, scipy.sparse.csc_array) else slice(None)
        part = mass[kept][:, kept]
        eigenvalues = np.linalg.eigvalsh(as_dense(part))
        tolerance = 10 * len(eigenvalues) * np.finfo(float).eps * abs(eigenvalues[-1])
        outside = abs(mass).sum() > (1 + 1e-12) * abs(part).sum()  # beside a diagonal of zero
        negative, count = outside or eigenvalues[0] < -tolerance, int((eigenvalues > tolerance).sum())
    else:
        massive = diagonal > 0
        scale = 1 / np.sqrt(np.where(massive, diagonal, 1.0))
        shifted = _scaled(mass, scale) + 1e-10 * scipy.sparse.eye_array(len(diagonal), format="csc")
        negative, count = factorise(shifted) is None, int(massive.sum())
    if negative:
        rows = np.flatnonzero(diagonal < 0)
        where = f", as its diagonal is negative at {_listed(rows, dofs)}" if len(rows) else ""
        raise ValueError(f"the {what} has a negative eigenvalue{where}; expected none below zero")
    if count < at_least:
        raise ValueError(
            f"n_modes is {at_least}, but {len(diagonal)} degrees of freedom, {len(diagonal) - count} of them "
            f"massless, have only {count} modes"
        )
    return count


def _scaled(matrix: scipy.sparse.csc_array, scale: Array) -> scipy.sparse.csc_array:
    """The matrix with its rows and columns multiplied by ``scale``."""
    diagonal = scipy.sparse.diags_array(scale, format="csc")
    return diagonal @ matrix @ diagonal


def _lowest(matrix: scipy.sparse.csc_array) -> tuple[float, Array]:
    """Lowest eigenvalue and its eigenvector, by shift-invert with a shift below it."""
    identity = scipy.sparse.eye_array(matrix.shape[0], format="csc")
    shift = 1e-10
    while (solve := factorise(matrix + shift * identity)) is None:
        shift *= 10
    inverse = scipy.sparse.linalg.LinearOperator(matrix.shape, matvec=solve, dtype=float)
    start = seeded_start(matrix.shape[0])
    eigenvalue, vector = scipy.sparse.linalg.eigsh(matrix, 1, sigma=-shift, OPinv=inverse, v0=start)
    return float(eigenvalue[0]), vector[:, 0]


def _listed(rows: NDArray[np.intp], dofs: Sequence[Label]) -> str:
    """Some of the degrees of freedom, by label where they have one."""
    shown = [f"node {dofs[i][0]!r} along {dofs[i][1]}" if dofs else f"degree of freedom {i}" for i in rows[:6]]
    return ", ".join(shown) + (f" and {len(rows) - 6} more" if len(rows) > 6 else "")


def _refuse(free: NDArray[np.intp], dofs: Sequence[Label]) -> None:
    raise ValueError(
        f"the structure is a mechanism: {_listed(free, dofs)} can move without resistance; "
        "expected supports, springs or members that resist every motion (a positive definite stiffness)"
    )
