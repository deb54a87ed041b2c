"""Pairs of modes whose columns are exchanged in part of the records."""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, robust_deviation
from skthermo.preprocessing._weather_regression import out_of_fold

LEAST_ROWS = 3
LEAST_SHARE = 0.002  # of the records that have both modes
FAR = 5.0  # robust deviations that a value is away from its column's prediction, and nearer to the other's
BETTER = 0.5  # ratio of the mean squares with the modes in order and as given, below which they were exchanged


class Swap(NamedTuple):
    """Two columns, and the rows in which they are exchanged."""

    modes: tuple[int, int]
    rows: NDArray[np.intp]


def swapped_modes(inputs: Array, frequencies: Array, folds: NDArray[np.intp]) -> list[Swap]:
    """Pairs of columns that the weather explains much better with their values exchanged in some rows."""
    found = []
    for first, second in combinations(range(frequencies.shape[1]), 2):
        pair = frequencies[:, [first, second]]
        difference = pair[:, 1] - pair[:, 0]
        known = ~np.isnan(difference)
        sign = 1.0 if np.count_nonzero(difference > 0) >= np.count_nonzero(difference < 0) else -1.0
        turned = known & (sign * difference < 0)
        if np.count_nonzero(turned) < max(LEAST_ROWS, LEAST_SHARE * np.count_nonzero(known)):
            continue
        ordered = np.where(turned[:, np.newaxis], pair[:, ::-1], pair)
        ordered[~known], given = np.nan, np.where(known[:, np.newaxis], pair, np.nan)
        predicted = out_of_fold(inputs, ordered, folds)
        rest = ordered - predicted
        deviation = robust_deviation(rest)
        with np.errstate(invalid="ignore"):
            is_near = (np.abs(rest) < FAR * deviation).all(axis=1)
            was_far = (np.abs(given - predicted) > FAR * deviation).any(axis=1)
        rows = np.flatnonzero(turned & is_near & was_far)
        if len(rows) < max(LEAST_ROWS, LEAST_SHARE * np.count_nonzero(known)):
            continue
        kept = np.flatnonzero(is_near)
        before = given[kept] - out_of_fold(inputs[kept], given[kept], folds[kept], trim=False)
        ratio = np.nanmean(rest[kept] ** 2, axis=0) / np.nanmean(before**2, axis=0)
        if np.sqrt(ratio.prod()) < BETTER:
            alone = _alone_in_the_wrong_column(pair, predicted, deviation)
            found.append(Swap((first, second), np.union1d(rows, alone)))
    return found


def _alone_in_the_wrong_column(pair: Array, predicted: Array, deviation: Array) -> NDArray[np.intp]:
    """Rows with one value of two, which is far from what its own column should be and near to the other's."""
    with np.errstate(invalid="ignore"):
        is_far = np.abs(pair - predicted) > FAR * deviation
        is_near = np.abs(pair - predicted[:, ::-1]) < FAR * deviation[::-1]
    return np.flatnonzero((is_far & is_near).any(axis=1) & (np.isnan(pair).sum(axis=1) == 1))
