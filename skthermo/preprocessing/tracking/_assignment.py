"""Compares poles with reference modes and assigns them one-to-one, near fixed or followed frequencies."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._tables.arrays import Array
from skthermo.preprocessing.tracking._poles import Poles
from skthermo.preprocessing.tracking._reference import ReferenceModes, shape_agreement

Positions = NDArray[np.intp]
MISSED = 3.0  # cost of a mode without a pole: no pair costs more
FORBIDDEN = 1e6
POLES_AT_A_TIME = 65_536
LARGEST_RATIO = 8.0  # of frequencies that are compared: those in rad/s are 6.3 times those in Hz


class Pairs(NamedTuple):
    """Poles and modes whose shapes fit, with the pole's record and frequency; costs of their shapes are 0 to 2."""

    pole: Positions
    mode: Positions
    mac: Array
    cost: Array
    record: Positions
    frequency: Array

    def at(self, chosen: NDArray) -> "Pairs":
        """Some of the pairs."""
        return Pairs(*(values[chosen] for values in self))


def fitting_pairs(poles: Poles, modes: ReferenceModes, min_mac: float, close: float) -> Pairs:
    """All pairs of a pole and a mode with similar shapes, within a factor of `LARGEST_RATIO` in frequency."""
    groups = modes.close_groups(close)
    blocks = []
    for start in range(0, max(len(poles.frequencies), 1), POLES_AT_A_TIME):
        block = slice(start, start + POLES_AT_A_TIME)
        ratios = poles.frequencies[block, np.newaxis] / modes.frequencies
        fits = (ratios < LARGEST_RATIO) & (ratios > 1 / LARGEST_RATIO)
        if poles.shapes is None or modes.shapes is None:
            mac = span = np.ones(ratios.shape)
        else:
            mac, span = shape_agreement(poles.shapes[block], modes.shapes, groups)
            fits &= span >= min_mac
        pole, mode = np.nonzero(fits)
        cost = (1 - span[fits]) / (1 - min_mac) + (span - mac)[fits]
        pole += start
        blocks.append(Pairs(pole, mode, mac[fits], cost, poles.record[pole], poles.frequencies[pole]))
    return Pairs(*(np.concatenate(values) for values in zip(*blocks, strict=True)))


def assign(record: Positions, pole: Positions, mode: Positions, cost: Array) -> Positions:
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


def assign_near(pairs: Pairs, reference: Array, max_shift: float) -> tuple[Positions, Positions]:
    """Positions of the chosen pairs, and of all pairs within ``max_shift`` of the reference frequencies."""
    shift = np.abs(pairs.frequency / reference[pairs.mode] - 1)
    near = np.flatnonzero(shift <= max_shift)
    fitting = pairs.at(near)
    chosen = assign(fitting.record, fitting.pole, fitting.mode, fitting.cost + shift[near] / max_shift)
    return near[chosen], near


def assign_while_following(
    pairs: Pairs, reference: Array, max_shift: float, *, order: Positions, n_records: float, max_drift: float
) -> tuple[Positions, Positions, Array]:
    """The same, record by record in the order given, near exponential means of the frequencies assigned before.

    A mode without a pole keeps its mean, and no mean leaves the reference by more than ``max_drift``. The third result
    holds the means that every record was compared with.
    """
    gain = -np.expm1(-1 / n_records)
    lowest, highest = (1 - max_drift) * reference, (1 + max_drift) * reference
    by_record = np.argsort(pairs.record, kind="stable")
    edges = np.searchsorted(pairs.record[by_record], np.arange(len(order) + 1))
    followed = np.empty((len(order), len(reference)))
    chosen, near = [np.empty(0, dtype=np.intp)], [np.empty(0, dtype=np.intp)]
    mean = reference.copy()
    for row in order:
        followed[row] = mean
        own = by_record[edges[row] : edges[row + 1]]
        taken, fitting = assign_near(pairs.at(own), mean, max_shift)
        modes = pairs.mode[own[taken]]
        mean[modes] += gain * (pairs.frequency[own[taken]] - mean[modes])
        mean = np.clip(mean, lowest, highest)
        chosen.append(own[taken])
        near.append(own[fitting])
    return np.concatenate(chosen), np.concatenate(near), followed
