"""Nearest donors of incomplete rows, by trees for each pattern of missing columns.

Among donors that share the same observed columns with a receiver, the NaN-aware Euclidean distance is
an ordinary one in those columns, times the square root of (all columns / shared columns).
"""

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]

SMALL_POOL = 256  # below it, all distances are faster than a tree
BLOCK = 512  # receivers that are asked together
FEW_PAIRS = 10_000_000  # below it, so they are for the whole data
PAIRS_PER_POOL = 2000  # about as many distances as one more pool costs


def row_patterns(missing: Mask) -> list[tuple[Mask, Rows]]:
    """Distinct rows of a mask, and where each stands."""
    packed = np.packbits(missing, axis=1)
    _, first, inverse = np.unique(packed, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(inverse.ravel(), kind="stable")
    counts = np.bincount(inverse.ravel(), minlength=len(first))
    groups = np.split(order, np.cumsum(counts)[:-1])
    return [(missing[row], rows) for row, rows in zip(first, groups, strict=True)]


class Donors:
    """Rows that give values, grouped by what they miss."""

    def __init__(self, values: Array):
        self.values = values
        self.patterns = row_patterns(np.isnan(values))

    def mean(self, column: int) -> float:
        """Mean of a column over the donors that have it."""
        return float(np.nanmean(self.values[:, column]))

    def are_worth_trees(self, missing: Mask) -> bool:
        """Whether trees for every pair of patterns cost less than the distances of every pair of rows."""
        gappy = missing[missing.any(axis=1)]
        n_pairs = len(gappy) * len(self.values)
        if n_pairs < FEW_PAIRS:
            return False
        return len(row_patterns(gappy)) * len(self.patterns) * PAIRS_PER_POOL < n_pairs

    def nearest(self, receivers: Array, observed: Mask, column: int, n_neighbors: int) -> tuple[Array, Rows]:
        """Distances and rows of the nearest donors that have a column, (n_receivers, n_neighbors).

        Where there are fewer donors, distances are infinite and rows 0.
        """
        distances = np.full((len(receivers), n_neighbors), np.inf)
        rows = np.zeros((len(receivers), n_neighbors), dtype=np.intp)
        for shared, members in self._pools(observed, column):
            stretch = np.sqrt(len(shared) / shared.sum())
            search = _searcher(self.values[np.ix_(members, shared)], n_neighbors)
            points = receivers[:, shared]
            # Receivers that need only look nearby are asked together, so that their bound is tight.
            for block in np.array_split(np.argsort(distances[:, -1]), math.ceil(len(points) / BLOCK)):
                found, at = search(points[block], distances[block[-1], -1] / stretch)
                _merge(distances, rows, block, found * stretch, members[at])
        return distances, rows

    def _pools(self, observed: Mask, column: int) -> Iterator[tuple[Mask, Rows]]:
        """Columns shared with the receivers, and the donors that share just these; largest pool first."""
        pools: dict[bytes, tuple[Mask, list[Rows]]] = {}
        for missing, rows in self.patterns:
            shared = observed & ~missing
            if not missing[column] and shared.any():
                pools.setdefault(shared.tobytes(), (shared, []))[1].append(rows)
        joined = [(shared, np.concatenate(rows)) for shared, rows in pools.values()]
        yield from sorted(joined, key=lambda pool: -len(pool[1]))


def _searcher(pool: Array, n_neighbors: int) -> Callable[[Array, float], tuple[Array, Rows]]:
    """Search of a pool: distances and positions of the nearest, infinite and 0 beyond a distance."""
    k = min(n_neighbors, len(pool))
    if len(pool) <= SMALL_POOL:
        return lambda points, within: _smallest(cdist(points, pool), k)
    tree = cKDTree(pool, leafsize=32, balanced_tree=False, compact_nodes=False)  # most of the time goes into building

    def search(points: Array, within: float) -> tuple[Array, Rows]:
        # What is just as far away as the bound counts as inside, rounding allowed for.
        found, at = tree.query(points, k=[*range(1, k + 1)], distance_upper_bound=within * (1 + 1e-9) + 1e-300)
        return found, np.where(np.isinf(found), 0, at)

    return search


def _smallest(distances: Array, k: int) -> tuple[Array, Rows]:
    at = np.argpartition(distances, k - 1, axis=1)[:, :k]
    return np.take_along_axis(distances, at, axis=1), at


def _merge(distances: Array, rows: Rows, block: Rows, found: Array, found_rows: Rows) -> None:
    """Keep the nearest of both, ascending, in a block of the first two arrays."""
    closer = (found < distances[block, -1:]).any(axis=1)
    block, found, found_rows = block[closer], found[closer], found_rows[closer]
    both = np.hstack([distances[block], found])
    nearest = np.argsort(both, axis=1, kind="stable")[:, : distances.shape[1]]
    distances[block] = np.take_along_axis(both, nearest, axis=1)
    rows[block] = np.take_along_axis(np.hstack([rows[block], found_rows]), nearest, axis=1)
