"""Compares poles with reference modes, and assigns them one-to-one."""

from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo.preprocessing._nearest import row_patterns

Array = NDArray[np.float64]
MISSED = 3.0  # cost of a mode without a pole: no pair costs more
FORBIDDEN = 1e6
POLES_AT_A_TIME = 65_536
FARTHEST_RATIO = 8.0  # beyond it nothing is said about frequencies: rad/s are 6.3 times those in Hz


class Pairs(NamedTuple):
    """Poles and modes whose shapes fit; costs of their shapes are 0 to 2."""

    pole: NDArray[np.intp]
    mode: NDArray[np.intp]
    mac: Array
    cost: Array

    def at(self, chosen: NDArray) -> "Pairs":
        """Some of the pairs."""
        return Pairs(*(values[chosen] for values in self))


def close_modes(frequencies: Array, close: float) -> list[NDArray[np.intp]]:
    """Groups of modes, in each of which neighbours in frequency are no farther apart than a share of it."""
    order = np.argsort(frequencies)
    steps = np.diff(frequencies[order]) > close * frequencies[order][1:]
    return np.split(order, np.flatnonzero(steps) + 1)


def fitting_pairs(
    frequencies: Array,
    shapes: NDArray | None,
    reference: tuple[Array, NDArray | None],
    min_mac: float,
    groups: list[NDArray[np.intp]],
) -> Pairs:
    """All pairs of a pole and a mode with similar shapes, within a factor of `FARTHEST_RATIO` in frequency."""
    blocks = []
    for start in range(0, max(len(frequencies), 1), POLES_AT_A_TIME):
        block = slice(start, start + POLES_AT_A_TIME)
        ratios = frequencies[block, np.newaxis] / reference[0]
        fits = (ratios < FARTHEST_RATIO) & (ratios > 1 / FARTHEST_RATIO)
        if shapes is None or reference[1] is None:
            mac = span = np.ones(ratios.shape)
        else:
            mac, span = shape_agreement(shapes[block], reference[1], groups)
            fits &= span >= min_mac
        pole, mode = np.nonzero(fits)
        cost = (1 - span[fits]) / (1 - min_mac) + (span - mac)[fits]
        blocks.append(Pairs(pole + start, mode, mac[fits], cost))
    return Pairs(*(np.concatenate(values) for values in zip(*blocks, strict=True)))


def shape_agreement(shapes: NDArray, reference: NDArray, groups: list[NDArray[np.intp]]) -> tuple[Array, Array]:
    """MAC of poles with modes, and of poles with the spaces that groups of close modes span.

    Both are computed from the sensors where a pole's shape is not NaN, if these are more than one and more than the
    modes of the group; otherwise, they are NaN, and the space counts as the mode alone.

    Parameters
    ----------
    shapes : ndarray of shape (n_poles, n_sensors)
        Shapes of the poles.
    reference : ndarray of shape (n_sensors, n_modes)
        Shapes of the modes.
    groups : list of ndarray
        Modes of each group.

    Returns
    -------
    tuple of two ndarrays of shape (n_poles, n_modes)
    """
    mac = np.full((len(shapes), reference.shape[1]), np.nan)
    span = mac.copy()
    for missing, poles in row_patterns(np.isnan(shapes)) if len(shapes) else ():
        n_present = len(missing) - missing.sum()
        if n_present < min(2, len(missing)):
            continue
        seen, modes = shapes[np.ix_(poles, ~missing)], reference[~missing]
        with np.errstate(invalid="ignore", divide="ignore"):
            seen = seen / np.linalg.norm(seen, axis=1, keepdims=True)
            modes = modes / np.linalg.norm(modes, axis=0)
        both = np.abs(seen @ modes.conj()) ** 2
        mac[poles] = span[poles] = np.minimum(both, 1)
        for group in groups:
            if 1 < len(group) < n_present and np.isfinite(modes[:, group]).all():
                basis = scipy.linalg.orth(modes[:, group], rcond=1e-3)
                projected = (np.abs(seen @ basis.conj()) ** 2).sum(axis=1, keepdims=True)
                span[np.ix_(poles, group)] = np.clip(projected, mac[np.ix_(poles, group)], 1)
    return mac, span


def assign(record: NDArray[np.intp], pole: NDArray[np.intp], mode: NDArray[np.intp], cost: Array) -> NDArray[np.intp]:
    """Positions of the pairs that assign poles to modes one-to-one in every record, at the lowest total cost.

    Where the best poles of all modes of a record differ, they are the solution; only other records are solved as
    assignment problems. A mode may stay without a pole at the cost `MISSED`.
    """
    order = np.lexsort((cost, mode, record))
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = (np.diff(record[order]) != 0) | (np.diff(mode[order]) != 0)
    best = order[is_first]
    _, inverse, counts = np.unique(pole[best], return_inverse=True, return_counts=True)
    contested = np.unique(record[best][counts[inverse] > 1])
    chosen = [best[~np.isin(record[best], contested)]]
    starts = np.searchsorted(record[order], contested, side="left")
    ends = np.searchsorted(record[order], contested, side="right")
    for start, end in zip(starts, ends, strict=True):
        pairs = order[start:end]
        modes, row = np.unique(mode[pairs], return_inverse=True)
        poles, column = np.unique(pole[pairs], return_inverse=True)
        costs = np.full((len(modes), len(poles) + len(modes)), MISSED)
        costs[:, : len(poles)] = FORBIDDEN
        costs[row, column] = cost[pairs]
        solution = linear_sum_assignment(costs)[1]
        chosen.append(pairs[solution[row] == column])
    return np.concatenate(chosen)
