"""Tests of whitened rows against cones of all non-negative combinations of some directions, and what they find."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from skthermo._tables.arrays import Array, real_array

RIDGE = 1e-10  # added to the squared length of each direction, so that equal ones share an effect evenly
SMALLEST = 1e-9  # share of the length of a row below which a direction explains nothing more of it
MOST_STEPS = 3  # for each direction; rows that have not ended then are solved one by one
N_DRAWS = 2000  # normal records, by which rates of detection are estimated
N_DRAWS_OF_PATTERN = 400  # by which the mean squared length of projections is
TAIL, FEWEST_IN_TAIL = 0.1, 20  # share of the baseline that shows how rare large indices are, and least number of it
BEYOND = 5.0  # standard deviations above the threshold at which every record is found
STEPS = np.linspace(0.0, 1.0, 21)  # shares of the largest amount that are tried


@dataclass(frozen=True)
class Cones:
    """Products of the directions of one or several cones, (n_cones, n_directions, n_directions).

    The amounts a >= 0 of the directions B that are closest to a row w, min |w - B a|, depend on the products B'B and
    B'w alone. They are found by the active sets of Lawson and Hanson (1974), for all rows together: those with the same
    cone and active set share an inverse (Van Benthem and Keenan, 2004).
    """

    products: Array

    @classmethod
    def of(cls, directions: Array) -> Cones:
        """Those of directions (..., n_dimensions, n_directions), which are the columns."""
        directions = directions.reshape(-1, *directions.shape[-2:])
        return cls(directions.swapaxes(1, 2) @ directions)

    def project(self, along: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        """Amounts of the directions and length of the projection of rows, from their products with the directions.

        ``along`` is B'w, (n_rows, n_directions), and ``which`` the cone of each row.
        """
        lengths = np.sqrt(np.einsum("ijj->ij", self.products))
        scale = np.where(lengths > 0, lengths, 1.0)
        products = self.products / scale[:, :, np.newaxis] / scale[:, np.newaxis, :]
        along = np.where(lengths[which] > 0, along, 0.0) / scale[which]
        amounts = _amounts(products + RIDGE * np.eye(products.shape[1]), along, which)
        squared = 2 * (amounts * along).sum(axis=1) - _squares(products, amounts, which)
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
        amounts[row] = nnls(root.T, np.linalg.solve(root, along[row]))[0]
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
    codes = active @ (1 << np.arange(active.shape[1], dtype=np.int64)) + (which.astype(np.int64) << active.shape[1])
    _, first, case = np.unique(codes, return_index=True, return_inverse=True)
    both = active[first][:, :, np.newaxis] & active[first][:, np.newaxis, :]
    alone = np.where(both, products[which[first]], 0.0)
    alone += np.eye(active.shape[1]) * ~active[first][:, np.newaxis, :]
    inverses = np.where(both, np.linalg.inv(alone), 0.0)
    return np.einsum("ijk,ik->ij", inverses[case], along)


def _times(products: Array, amounts: Array, which: NDArray[np.intp]) -> Array:
    if len(products) == 1:
        return amounts @ products[0]
    return np.einsum("ijk,ik->ij", products[which], amounts)


def _squares(products: Array, amounts: Array, which: NDArray[np.intp]) -> Array:
    return (amounts * _times(products, amounts, which)).sum(axis=1)


@dataclass(frozen=True)
class Tail:
    """Squared indices of a baseline above a level, and by how much they exceed it on average."""

    level: float
    excess: float

    @classmethod
    def of(cls, index: Array) -> Tail:
        """Of the highest tenth of the indices, or more of a short baseline."""
        squares = index[np.isfinite(index)] ** 2
        share = min(max(TAIL, FEWEST_IN_TAIL / max(len(squares), 1)), 0.5)
        level = float(np.quantile(squares, 1 - share))
        above = squares[squares > level]
        return cls(level, float(above.mean()) - level if len(above) else 0.0)


@dataclass(frozen=True)
class JoinedTests:
    """The index of the cone and that of the omnibus, joined so that the latter gives a share of the false alarms.

    Squares of either index exceed their tails exponentially. The omnibus index is expressed as the index of the cone
    that is exceeded as often, times what the shares of both are to each other; the larger of the two counts.
    """

    cone: Tail
    omnibus: Tail
    share: float

    @classmethod
    def of(cls, cone: Array, omnibus: Array, share: float) -> JoinedTests:
        """Learned from the indices of a baseline."""
        return cls(Tail.of(cone), Tail.of(omnibus), share)

    def __call__(self, cone: Array, omnibus: Array) -> Array:
        if self.share in (0, 1):
            return omnibus if self.share else cone
        ratio = self.cone.excess / self.omnibus.excess if self.omnibus.excess > 0 else 1.0
        rarer = np.log((1 - self.share) / self.share)
        squared = self.cone.level + ratio * (omnibus**2 - self.omnibus.level) - self.cone.excess * rarer
        return np.maximum(cone, np.sqrt(np.maximum(squared, 0.0)))


@dataclass(frozen=True)
class Detectability:
    """Which amounts of each direction normal records let a threshold find, none above the ``largest``.

    ``white`` are the effects of the directions on what is tested, whitened, (n_modes, n_directions).
    """

    tests: JoinedTests
    white: Array
    names: Sequence[Any]
    threshold: float
    largest: float

    def pod(self, severities: ArrayLike) -> pd.DataFrame:
        """Share of records above the threshold, by severity and direction."""
        amounts = np.ravel(real_array(severities, "severities"))
        if not ((amounts >= 0) & (amounts <= self.largest)).all():
            expected = "losses from 0 to 1" if self.largest == 1 else "amounts that are not negative"
            raise ValueError(f"severities is {severities!r:.200}; expected {expected}")
        rates = [self._rates_of(direction, amounts) for direction in range(len(self.names))]
        return pd.DataFrame(np.transpose(rates), pd.Index(amounts, name="severity"), list(self.names))

    def smallest(self, level: float) -> pd.Series:
        """Smallest amount that is found in a share of the records; infinite where not even the largest is."""
        found = [self._smallest(effect, level) for effect in range(len(self.names))]
        return pd.Series(found, pd.Index(list(self.names), name="direction"), dtype=float)

    def _smallest(self, direction: int, level: float) -> float:
        """The first of some steps that is found often enough, and again of finer ones before it."""
        length = max(float(np.linalg.norm(self.white[:, direction])), np.finfo(float).tiny)
        low, high = 0.0, min((self.threshold + BEYOND) / length, self.largest)
        for _ in range(2):
            steps = low + STEPS * (high - low)
            reached = np.flatnonzero(self._rates_of(direction, steps) >= level)
            if not len(reached):
                return np.inf
            last = max(reached[0], 1)
            low, high = float(steps[last - 1]), float(steps[last])
        return high

    def _rates_of(self, direction: int, amounts: Array) -> Array:
        """Shares of normal rows with each amount above the threshold."""
        draws = np.random.RandomState(0).standard_normal((N_DRAWS, len(self.white)))
        moved = draws + np.outer(amounts, self.white[:, direction])[:, np.newaxis]
        moved = moved.reshape(-1, len(self.white))
        lengths = Cones.of(self.white).project(moved @ self.white, np.zeros(len(moved), dtype=np.intp))[1]
        above = self.tests(lengths, np.linalg.norm(moved, axis=1)) > self.threshold
        return above.reshape(len(amounts), -1).mean(axis=1)


def mean_squares(white: Array) -> Array:
    """Mean squared length of the projections of normal rows on the cones of some effects, (n_cones, n_modes, n_dir)."""
    draws = np.random.RandomState(0).standard_normal((N_DRAWS_OF_PATTERN, white.shape[1]))
    which: NDArray[np.intp] = np.repeat(np.arange(len(white)), N_DRAWS_OF_PATTERN)
    lengths = Cones.of(white).project((draws @ white).reshape(len(which), -1), which)[1]
    return (lengths.reshape(len(white), -1) ** 2).mean(axis=1)
