"""Assigns poles to reference modes whose frequencies are fixed, or followed where they change slowly."""

import numpy as np
from numpy.typing import NDArray

from skthermo.preprocessing._assignment import Pairs, assign

Array = NDArray[np.float64]
Positions = NDArray[np.intp]


def assign_near(
    pairs: Pairs, record: Positions, frequencies: Array, reference: Array, max_shift: float
) -> tuple[Positions, Positions]:
    """Positions of the chosen pairs, and of all pairs within ``max_shift`` of the reference frequencies."""
    shift = np.abs(frequencies / reference[pairs.mode] - 1)
    near = np.flatnonzero(shift <= max_shift)
    fitting = pairs.at(near)
    chosen = assign(record[near], fitting.pole, fitting.mode, fitting.cost + shift[near] / max_shift)
    return near[chosen], near


def assign_while_following(
    pairs: Pairs,
    record: Positions,
    frequencies: Array,
    reference: Array,
    max_shift: float,
    *,
    order: Positions,
    n_records: float,
    max_drift: float,
) -> tuple[Positions, Positions, Array]:
    """The same, record by record in the order given, near exponential means of the frequencies assigned before.

    A mode without a pole keeps its mean, and no mean leaves the reference by more than ``max_drift``. The third result
    holds the means that every record was compared with.
    """
    gain = -np.expm1(-1 / n_records)
    lowest, highest = (1 - max_drift) * reference, (1 + max_drift) * reference
    by_record = np.argsort(record, kind="stable")
    edges = np.searchsorted(record[by_record], np.arange(len(order) + 1))
    followed = np.empty((len(order), len(reference)))
    chosen, near = [np.empty(0, dtype=np.intp)], [np.empty(0, dtype=np.intp)]
    mean = reference.copy()
    for row in order:
        followed[row] = mean
        own = by_record[edges[row] : edges[row + 1]]
        taken, fitting = assign_near(pairs.at(own), record[own], frequencies[own], mean, max_shift)
        modes = pairs.mode[own[taken]]
        mean[modes] += gain * (frequencies[own[taken]] - mean[modes])
        mean = np.clip(mean, lowest, highest)
        chosen.append(own[taken])
        near.append(own[fitting])
    return np.concatenate(chosen), np.concatenate(near), followed
