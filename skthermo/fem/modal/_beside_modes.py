"""Derivatives of mode shapes beside the modes at hand, by iteration."""

from collections.abc import Callable

import numpy as np

from skthermo._arrays import Array, Matrix

CONVERGED = 1e-5
"""Residual, as a share of the derivative, at which the iteration stops; its error is smaller."""

MAX_ITERATIONS = 200


def solve_beside_modes(
    solve: Callable[[Array], Array], mass: Matrix, shapes: Array, forces: Array, shifts: Array, known: Array
) -> Array:
    """x of (K - shift M) x = force, M-orthogonal to the lowest modes, for many columns at once.

    K^-1 turns it into (I - shift K^-1 M) x = K^-1 force, which is positive definite beside all modes up to the shift:
    conjugate gradients in the inner product of M, whose rate the ratio of the shift to the next eigenvalue sets.
    The last residual is added, which makes it a step of x = K^-1 (force + shift M x) and reaches massless degrees of
    freedom too.
    """
    weighted = mass @ shapes

    def beside(vectors: Array) -> Array:
        return vectors - shapes @ (weighted.T @ vectors)

    residuals = beside(solve(forces))
    x, searches, found = np.zeros_like(residuals), np.zeros_like(residuals), np.empty_like(residuals)
    inertia = mass @ residuals
    squares, previous = np.einsum("ic,ic->c", residuals, inertia), np.full(len(shifts), np.inf)
    enough, columns = CONVERGED**2 * (known + squares), np.arange(len(shifts))
    for _ in range(MAX_ITERATIONS):
        going = squares > enough
        if not going.all():
            found[:, columns[~going]] = (x + residuals)[:, ~going]
            x, searches, residuals = x[:, going], searches[:, going], residuals[:, going]
            columns, squares, previous, enough, shifts = (
                v[going] for v in (columns, squares, previous, enough, shifts)
            )
            if not columns.size:
                break
        searches = residuals + squares / previous * searches
        inertia = mass @ searches
        images = beside(searches - shifts * solve(inertia))
        steps = squares / np.einsum("ic,ic->c", inertia, images)
        x, residuals, previous = x + steps * searches, residuals - steps * images, squares
        squares = np.einsum("ic,ic->c", residuals, mass @ residuals)
    found[:, columns] = x + residuals
    return found
