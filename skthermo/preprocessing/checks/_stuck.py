"""Runs of equal values: in which rows a sensor or a mode was stuck."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from skthermo._core.arrays import Array


def equal_runs(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First place and length of each run of equal values; without NaN."""
    first = np.flatnonzero(np.append(True, values[1:] != values[:-1])[: len(values)])
    return first, np.diff(np.append(first, len(values)))


def stuck_columns(table: Array) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Place of a column and rows of each run in which it was stuck; a column that begins as another one is its lag."""
    for place, column in enumerate(table.T):
        for rows in stuck_runs(column):
            if rows[0] > 0 or np.count_nonzero(table[0] == column[0]) == 1:
                yield place, rows


def stuck_runs(column: Array) -> list[NDArray[np.intp]]:
    """Rows of each run of equal values in a column, in order of time, in which it was stuck; NaN is passed over."""
    rows = np.flatnonzero(~np.isnan(column))
    values = column[rows]
    if len(values) < 20:
        return []
    first, lengths = equal_runs(values)
    if lengths.max() < 5 or len(lengths) < 3:
        return []
    step = np.abs(np.diff(values[first])).min()
    longest = np.argsort(-lengths, kind="stable")[:20]
    found = []
    for run in np.sort(longest[lengths[longest] >= 5]):
        if _is_outstanding(values[first], lengths, run) and _others_vary(values, lengths, lengths[run], step):
            found.append(rows[first[run] : first[run] + lengths[run]])
    return found


def _is_outstanding(values: Array, lengths: NDArray[np.intp], run: np.intp) -> bool:
    """Whether a run is four times as long as a usual one by rounding, and as a usual one at its value.

    The usual run is the fourth longest. Chance would give less than a hundredth of such a run in the whole column.
    Rain, and the sun at night, are zero again and again.
    """
    length, n_values = lengths[run], lengths.sum()
    rounded = (lengths > 1) & (lengths < 5)
    share = (lengths[rounded] - 1).sum() / n_values
    same = np.sort(lengths[values == values[run]])[::-1]
    if len(same) > 3 and length < 4 * same[3]:
        return False
    if rounded.any() and len(lengths) > 3:
        usual = np.sort(lengths)[-4]
        return bool(length >= 4 * usual and n_values * share ** (length - 1) <= 0.01)
    return True


def _others_vary(values: Array, lengths: NDArray[np.intp], length: int, step: float) -> bool:
    """Whether 95 % of the other periods of a run's length vary by at least three steps of rounding."""
    if 2 * length >= len(values):
        return True
    as_long = np.repeat(lengths >= length, lengths)
    if np.count_nonzero(as_long) > len(values) / 2:
        return False
    windows, size = slice(0, len(values) - length + 1), {"size": int(length), "origin": -(int(length) // 2)}
    ranges = (maximum_filter1d(values, **size) - minimum_filter1d(values, **size))[windows]
    elsewhere = ~maximum_filter1d(as_long, **size)[windows]
    return bool(elsewhere.any() and np.quantile(ranges[elsewhere], 0.05) >= 3 * step * (1 - 1e-9))
