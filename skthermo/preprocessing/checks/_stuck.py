"""Runs of equal values that are longer than chance and rounding explain."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from skthermo._tables.arrays import Array

SHORTEST = 5  # number of equal records in a row that may count as stuck
USUAL = 4  # times the length of a usual run, which a stuck one exceeds where values are rounded
USUAL_RANK = 3  # the usual run is the longest but so many
CHANCE = 0.01  # number of such runs that chance may give in the whole column
FEW = 0.05  # share of the other periods of that length that may vary as little as rounding does
STEPS = 3  # steps of rounding that count as little
MOST_RUNS = 20  # longest ones of a column, which are looked at


def equal_runs(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First place and length of each run of equal values; without NaN."""
    first = np.flatnonzero(np.append(True, values[1:] != values[:-1])[: len(values)])
    return first, np.diff(np.append(first, len(values)))


def stuck_runs(column: Array) -> list[NDArray[np.intp]]:
    """Rows of each run of equal values in a column, in order of time, at which it was stuck; NaN is passed over."""
    rows = np.flatnonzero(~np.isnan(column))
    values = column[rows]
    if len(values) < 4 * SHORTEST:
        return []
    first, lengths = equal_runs(values)
    if lengths.max() < SHORTEST or len(lengths) < 3:
        return []
    step = np.abs(np.diff(values[first])).min()
    longest = np.argsort(-lengths, kind="stable")[:MOST_RUNS]
    found = []
    for run in longest[lengths[longest] >= SHORTEST]:
        if _is_outstanding(values[first], lengths, run) and _others_vary(values, lengths, lengths[run], step):
            found.append(rows[first[run] : first[run] + lengths[run]])
    return sorted(found, key=lambda run: run[0])


def _is_outstanding(values: Array, lengths: NDArray[np.intp], run: np.intp) -> bool:
    """Whether a run is much longer than the column has them by rounding, and than others at the same value.

    Rain, and the sun at night, are zero again and again.
    """
    length, n_values = lengths[run], lengths.sum()
    rounded = (lengths > 1) & (lengths < SHORTEST)
    share = (lengths[rounded] - 1).sum() / n_values
    same = np.sort(lengths[values == values[run]])[::-1]
    if len(same) > USUAL_RANK and length < USUAL * same[USUAL_RANK]:
        return False
    if rounded.any() and len(lengths) > USUAL_RANK:
        usual = np.sort(lengths)[-1 - USUAL_RANK]
        return bool(length >= USUAL * usual and n_values * share ** (length - 1) <= CHANCE)
    return True


def _others_vary(values: Array, lengths: NDArray[np.intp], length: int, step: float) -> bool:
    """Whether nearly all other periods of a run's length vary by more than rounding."""
    if 2 * length >= len(values):
        return True
    as_long = np.repeat(lengths >= length, lengths)
    if np.count_nonzero(as_long) > len(values) / 2:
        return False
    windows, size = slice(0, len(values) - length + 1), {"size": int(length), "origin": -(int(length) // 2)}
    ranges = (maximum_filter1d(values, **size) - minimum_filter1d(values, **size))[windows]
    elsewhere = ~maximum_filter1d(as_long, **size)[windows]
    return bool(elsewhere.any() and np.quantile(ranges[elsewhere], FEW) >= STEPS * step * (1 - 1e-9))
