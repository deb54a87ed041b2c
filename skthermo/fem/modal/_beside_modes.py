"""The part of a mode shape's derivative that the computed modes do not span, by conjugate gradients."""

from collections.abc import Callable

import numpy as np

from skthermo._tables.arrays import Array, Matrix

CONVERGED = 1e-5
"""Residual, as a share of the derivative, at which the iteration stops. The error of the result is smaller."""

MAX_ITERATIONS = 200


def solve_beside_modes(
    solve: Callable[[Array], Array], mass: Matrix, shapes: Array, forces: Array, shifts: Array, known: Array
) -> Array:
    """Solve (K - shift M) x = force for x M-orthogonal to the lowest modes, for many columns at once.

    Multiplied by K^-1 it reads (I - shift K^-1 M) x = K^-1 force, which is positive definite on the complement of all
    modes up to the shift. It is solved by conjugate gradients in the inner product of M; the lower the ratio of the
    shift to the next eigenvalue, the fewer iterations. The last residual is added to x, which is one step of
    x = K^-1 (force + shift M x): it corrects the massless degrees of freedom, which the inner product of M cannot see.

    ``solve`` solves K x = b for columns b, ``shifts`` are below the eigenvalue of the first mode that is missing in
    ``shapes``, and the residual is measured by ``known``, the squared length of the derivative's part along these.
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
