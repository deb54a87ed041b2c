"""Nearest neighbours of rows with gaps (receivers) among the rows that fill them (donors).

A pattern is a set of missing columns. For a receiver and all donors of one pattern, the columns that both
have are the same. The distance that ignores NaN is then the Euclidean distance in these shared columns,
times the square root of (all columns / shared columns), and a k-d tree can find the nearest donors.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from skthermo._tables.arrays import Array, rows_by_pattern

Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]

SMALL_POOL = 256  # up to so many donors, computing all distances is faster than a tree
BLOCK = 512  # receivers in one query of a tree
FEW_PAIRS = 10_000_000  # below so many pairs of receiver and donor, computing all distances is faster
PAIRS_PER_POOL = 2000  # searching one pool takes about as long as so many distances


class Donors:
    """Rows from which gaps are filled, grouped by their missing columns."""

    def __init__(self, values: Array):
        self.values = values
        self.patterns = rows_by_pattern(np.isnan(values))

    def mean(self, column: int) -> float:
        """Mean of a column, NaN ignored."""
        return float(np.nanmean(self.values[:, column]))

    def trees_are_faster(self, missing: Mask) -> bool:
        """Whether searching trees is expected to take less time than computing all distances."""
        gappy = missing[missing.any(axis=1)]
        n_pairs = len(gappy) * len(self.values)
        if n_pairs < FEW_PAIRS:
            return False
        return len(rows_by_pattern(gappy)) * len(self.patterns) * PAIRS_PER_POOL < n_pairs

    def nearest(self, receivers: Array, observed: Mask, column: int, n_neighbors: int) -> tuple[Array, Rows]:
        """The nearest donors that have a value in a column.

        Returns their distances and row numbers, both (n_receivers, n_neighbors) and by ascending distance.
        If there are fewer donors, the remaining distances are infinite and row numbers 0.
        """
        distances = np.full((len(receivers), n_neighbors), np.inf)
        rows = np.zeros((len(receivers), n_neighbors), dtype=np.intp)
        for shared, members in self._pools(observed, column):
            scale = np.sqrt(len(shared) / shared.sum())
            search = _searcher(self.values[np.ix_(members, shared)], n_neighbors)
            points = receivers[:, shared]
            # A query has one bound for all its receivers, so those with near neighbours go together.
            for block in np.array_split(np.argsort(distances[:, -1]), math.ceil(len(points) / BLOCK)):
                found, at = search(points[block], distances[block[-1], -1] / scale)
                _merge(distances, rows, block, found * scale, members[at])
        return distances, rows

    def _pools(self, observed: Mask, column: int) -> Iterator[tuple[Mask, Rows]]:
        """Donors that share the same columns with the receivers, as (columns, rows); largest pool first."""
        pools: dict[bytes, tuple[Mask, list[Rows]]] = {}
        for missing, rows in self.patterns:
            shared = observed & ~missing
            if not missing[column] and shared.any():
                pools.setdefault(shared.tobytes(), (shared, []))[1].append(rows)
        joined = [(shared, np.concatenate(rows)) for shared, rows in pools.values()]
        yield from sorted(joined, key=lambda pool: -len(pool[1]))


def _searcher(pool: Array, n_neighbors: int) -> Callable[[Array, float], tuple[Array, Rows]]:
    """A function that finds the nearest rows of a pool within a distance.

    It gives their distances and positions; beyond that distance these are infinite and 0.
    """
    k = min(n_neighbors, len(pool))
    if len(pool) <= SMALL_POOL:
        return lambda points, within: _smallest(cdist(points, pool), k)
    # Building the tree takes most of the time, and these options make it quick.
    tree = cKDTree(pool, leafsize=32, balanced_tree=False, compact_nodes=False)

    def search(points: Array, within: float) -> tuple[Array, Rows]:
        # A neighbour exactly at the bound must be found in spite of rounding.
        found, at = tree.query(points, k=[*range(1, k + 1)], distance_upper_bound=within * (1 + 1e-9) + 1e-300)
        return found, np.where(np.isinf(found), 0, at)

    return search


def _smallest(distances: Array, k: int) -> tuple[Array, Rows]:
    at = np.argpartition(distances, k - 1, axis=1)[:, :k]
    return np.take_along_axis(distances, at, axis=1), at


def _merge(distances: Array, rows: Rows, block: Rows, found: Array, found_rows: Rows) -> None:
    """Replace the nearest donors of a block of receivers where a new one is nearer, in place."""
    closer = (found < distances[block, -1:]).any(axis=1)
    block, found, found_rows = block[closer], found[closer], found_rows[closer]
    both = np.hstack([distances[block], found])
    nearest = np.argsort(both, axis=1, kind="stable")[:, : distances.shape[1]]
    distances[block] = np.take_along_axis(both, nearest, axis=1)
    rows[block] = np.take_along_axis(np.hstack([rows[block], found_rows]), nearest, axis=1)
