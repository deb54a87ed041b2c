"""Checks for mechanisms and missing mass."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse.linalg
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, Label, Matrix, as_dense
from skthermo.fem._factors import factorise
from skthermo.fem.modal._sparse import seeded_start

EPS = np.finfo(float).eps

FEW_DOFS = 500  # degrees of freedom up to which a mass matrix is examined as a dense one
SMALL_SHIFT = 1e-10  # multiple of the identity that makes a semidefinite matrix of unit diagonal positive definite


def check_supported(stiffness: Matrix, dofs: Sequence[Label] = ()) -> None:
    """Refuse a stiffness that is not positive definite within rounding, and name where the motion is largest.

    The energy x'Kx of a motion is a sum of entries that cancel where the motion is nearly rigid. Of a mechanism,
    rounding of these entries is all that is left; the softest motion of a fine mesh has more.
    """
    diagonal = stiffness.diagonal()
    if (diagonal <= 0).any():
        _refuse(np.flatnonzero(diagonal <= 0), dofs)
    scale = 1 / np.sqrt(diagonal)
    if isinstance(stiffness, np.ndarray):
        eigenvalues, vectors = np.linalg.eigh(scale[:, np.newaxis] * stiffness * scale)
        lowest, vector, rounding = eigenvalues[0], vectors[:, 0], 50 * EPS * eigenvalues[-1]
    else:
        scaled = _scaled(stiffness, scale)
        lowest, vector = _lowest(scaled)
        rounding = 10 * EPS * (np.abs(vector) @ (abs(scaled) @ np.abs(vector)))
    if lowest <= rounding:
        motion = np.abs(scale * vector)
        largest = np.argsort(-motion, kind="stable")
        _refuse(largest[motion[largest] > 0.5 * motion[largest[0]]], dofs)


def count_modes(mass: Matrix, *, at_least: int, what: str = "nominal mass") -> int:
    """How many modes of finite frequency a mass matrix allows: an error if fewer than ``at_least``.

    For a sparse matrix with many masses this is the number of degrees of freedom with mass.
    """
    diagonal = mass.diagonal()
    if isinstance(mass, np.ndarray) or np.count_nonzero(diagonal) <= FEW_DOFS:
        kept = np.flatnonzero(diagonal) if isinstance(mass, scipy.sparse.csc_array) else slice(None)
        part = mass[kept][:, kept]
        eigenvalues = np.linalg.eigvalsh(as_dense(part))
        tolerance = 10 * len(eigenvalues) * EPS * abs(eigenvalues[-1])
        outside = abs(mass).sum() > (1 + 1e-12) * abs(part).sum()  # beside a diagonal of zero
        negative, count = outside or eigenvalues[0] < -tolerance, int((eigenvalues > tolerance).sum())
    else:
        massive = diagonal > 0
        scale = 1 / np.sqrt(np.where(massive, diagonal, 1.0))
        shifted = _scaled(mass, scale) + SMALL_SHIFT * scipy.sparse.eye_array(len(diagonal), format="csc")
        negative, count = factorise(shifted) is None, int(massive.sum())
    if negative:
        raise ValueError(f"the {what} has a negative eigenvalue; expected none below zero")
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
    shift = SMALL_SHIFT
    while (factors := factorise(matrix + shift * identity)) is None:
        shift *= 10
    inverse = scipy.sparse.linalg.LinearOperator(matrix.shape, matvec=factors.solve, dtype=float)
    start = seeded_start(matrix.shape[0])
    eigenvalue, vector = scipy.sparse.linalg.eigsh(matrix, 1, sigma=-shift, OPinv=inverse, v0=start)
    return float(eigenvalue[0]), vector[:, 0]


def _refuse(free: NDArray[np.intp], dofs: Sequence[Label]) -> None:
    shown = [f"node {dofs[i][0]!r} along {dofs[i][1]}" if dofs else f"degree of freedom {i}" for i in free[:6]]
    listed = ", ".join(shown) + (f" and {len(free) - 6} more" if len(free) > 6 else "")
    raise ValueError(
        f"the structure is a mechanism: {listed} can move without resistance; "
        "expected supports, springs or members that resist every motion (a positive definite stiffness)"
    )
