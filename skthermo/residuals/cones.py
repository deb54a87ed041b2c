"""Projections of whitened rows on cones of all non-negative combinations of some directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from skthermo._core.arrays import Array

RIDGE = 1e-10  # added to the squared length of each direction, so that equal ones share an effect evenly
SMALLEST = 1e-9  # share of the length of a row below which a direction explains nothing more of it
MOST_STEPS = 3  # for each direction; rows that have not ended then are solved one by one


def project_on_cones(products: Array, along: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
    """Amounts of the directions and length of the projection of rows w on cones of directions B, their columns.

    The amounts a >= 0 that are closest to a row, min |w - B a|, depend on products alone: B'B of each cone, (n_cones,
    n_directions, n_directions), and ``along``, B'w of each row, (n_rows, n_directions), whose cone is ``which``. They
    are found by the active sets of Lawson and Hanson (1974), for all rows together: those with the same cone and active
    set share an inverse (Van Benthem and Keenan, 2004), of the size of that set: there may be any number of directions.
    """
    lengths = np.sqrt(np.einsum("ijj->ij", products))
    scale = np.where(lengths > 0, lengths, 1.0)
    products = products / scale[:, :, np.newaxis] / scale[:, np.newaxis, :]
    along = np.where(lengths[which] > 0, along, 0.0) / scale[which]
    amounts = _amounts(products + RIDGE * np.eye(products.shape[1]), along, which)
    squared = 2 * (amounts * along).sum(axis=1) - (amounts * _times(products, amounts, which)).sum(axis=1)
    return amounts / scale[which], np.sqrt(np.maximum(squared, 0.0))


def _amounts(products: Array, along: Array, which: NDArray[np.intp]) -> Array:
    """Non-negative least squares of all rows, by active sets."""
    amounts, active = np.zeros_like(along), np.zeros(along.shape, dtype=bool)
    refused = np.zeros_like(active)  # directions that have just left the active set, or could not enter it
    limit = SMALLEST * np.maximum(np.abs(along).max(axis=1, initial=0.0), np.finfo(float).tiny)
    rows = np.arange(len(along))
    for _ in range(MOST_STEPS * along.shape[1]):
        left = along[rows] - _times(products, amounts[rows], which[rows])
        left[active[rows] | refused[rows]] = -np.inf
        best = left.argmax(axis=1)
        rows, best = (part[left[np.arange(len(rows)), best] > limit[rows]] for part in (rows, best))
        if not len(rows):
            return amounts
        active[rows, best] = True
        entered = _move(products, along, which, amounts, active, rows, best)
        refused[rows] = False
        refused[rows[~entered], best[~entered]] = True
    for row in rows:
        root = np.linalg.cholesky(products[which[row]])
        amounts[row] = lsq_linear(root.T, np.linalg.solve(root, along[row]), (0, np.inf), method="bvls").x
    return amounts


def _move(
    products: Array,
    along: Array,
    which: NDArray[np.intp],
    amounts: Array,
    active: NDArray[np.bool_],
    rows: NDArray[np.intp],
    entering: NDArray[np.intp],
) -> NDArray[np.bool_]:
    """Move some rows to the least squares of their active sets, from which directions leave that would be negative.

    Tells for which rows the direction that enters has a positive amount.
    """
    entered = np.ones(len(rows), dtype=bool)
    open_rows = np.arange(len(rows))
    while len(open_rows):
        now = rows[open_rows]
        wanted = _solved(products, along[now], which[now], active[now])
        own = wanted[np.arange(len(now)), entering[open_rows]] <= 0
        first = own & (amounts[now, entering[open_rows]] == 0)
        entered[open_rows[first]] = False
        active[now[first], entering[open_rows[first]]] = False
        negative = active[now] & (wanted <= 0)
        shares = np.where(negative, amounts[now], np.inf) / np.where(negative, amounts[now] - wanted, 1.0)
        share = np.minimum(shares.min(axis=1), 1.0)[:, np.newaxis]
        moved = amounts[now] + share * (wanted - amounts[now])
        leaving = negative & (shares <= share)
        moved[leaving] = 0.0
        active[now] &= ~leaving
        moved[~active[now]] = 0.0
        amounts[now[~first]] = moved[~first]
        open_rows = open_rows[negative.any(axis=1) & ~first]
    return entered


def _solved(products: Array, along: Array, which: NDArray[np.intp], active: NDArray[np.bool_]) -> Array:
    """Least squares of rows in the directions of their active sets; zero in the others."""
    sets = np.hstack([np.packbits(active, axis=1), which[:, np.newaxis].astype("<i8").view(np.uint8)])
    _, first, case = np.unique(sets.view(f"V{sets.shape[1]}").ravel(), return_index=True, return_inverse=True)
    most = max(int(active[first].sum(axis=1).max(initial=0)), 1)
    places = np.argsort(~active[first], axis=1, kind="stable")[:, :most]  # the active directions, before some others
    used = np.take_along_axis(active[first], places, axis=1)
    both = used[:, :, np.newaxis] & used[:, np.newaxis, :]
    among = products[which[first][:, np.newaxis, np.newaxis], places[:, :, np.newaxis], places[:, np.newaxis, :]]
    inverses = np.where(both, np.linalg.inv(np.where(both, among, np.eye(most))), 0.0)
    solved = np.einsum("ijk,ik->ij", inverses[case], np.take_along_axis(along, places[case], axis=1))
    amounts = np.zeros_like(along)
    np.put_along_axis(amounts, places[case], solved, axis=1)
    return amounts


def _times(products: Array, amounts: Array, which: NDArray[np.intp]) -> Array:
    """Each row times the products of its cone."""
    times = np.empty_like(amounts)
    for cone in np.unique(which):
        own = which == cone
        times[own] = amounts[own] @ products[cone]
    return times
