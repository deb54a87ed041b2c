"""Whether temperatures of another time explain the frequencies better than those of their own rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, range_sums, spread_evenly
from skthermo.preprocessing._weather_regression import out_of_fold

MOST_ROWS = 4000  # that are predicted for each shift
FARTHEST = 1 / 4  # of the records, by which they may be shifted
N_PEAKS = 3  # shifts that each kind of correlation proposes
PAST = (6, 24, 168)  # rows of means of the past: a structure follows the weather late
LEAST_MEANS = 10  # times that such a period must fit into the records
BETTER = 0.9  # ratio of what shifted temperatures leave to what those of the row leave, below which they are better
LEAST_GAIN = 0.01  # share of the variance that shifted temperatures explain beyond those of the row
LEAST_EXPLAINED = 0.1  # share of the variance that shifted temperatures explain


class TimeShift(NamedTuple):
    """By how many rows temperatures are earlier than frequencies, and the shares of the variance explained."""

    rows: int
    explained: float
    unshifted: float


def best_shift(
    lines: Array, past: Array, places: Array, F: Array, folds: NDArray[np.intp], inertia: int
) -> TimeShift | None:
    """The shift at which temperatures explain most, if they explain clearly more than those of the row and its past.

    A structure may follow the weather late, by up to ``inertia`` rows, without a fault.
    """
    n_rows, inputs, found = len(F), np.hstack([lines, past]), []
    for shift in proposed_shifts(places, F, inertia):
        rows = spread_evenly(np.arange(max(shift, 0), n_rows + min(shift, 0)), MOST_ROWS)
        own, other = (unexplained(table, F[rows], folds[rows]) for table in (inputs[rows], inputs[rows - shift]))
        varying = ~np.isnan(own) & ~np.isnan(other) & (own > 0)
        if not varying.any():
            continue
        ratio = float(np.exp(np.log(np.maximum(other, 1e-300)[varying] / own[varying]).mean()))
        found.append((ratio, TimeShift(shift, *(float(1 - np.nanmean(part)) for part in (other, own)))))
    if not found:
        return None
    ratio, best = min(found)
    if ratio > BETTER or best.explained < max(LEAST_EXPLAINED, best.unshifted + LEAST_GAIN):
        return None
    rows = np.arange(max(best.rows, 0), n_rows + min(best.rows, 0))  # means of the past may follow a season by chance
    own, other = (explained(lines[part], F[rows], folds[rows]) for part in (rows, rows - best.rows))
    return best if other.sum() > max(own.sum(), len(other) * LEAST_EXPLAINED / 2) else None


def explained(inputs: Array, frequencies: Array, folds: NDArray[np.intp]) -> Array:
    """Share of the variance of each mode that varies, which inputs explain out of fold; at most zero for nothing."""
    rows = spread_evenly(np.arange(len(inputs)), MOST_ROWS)
    left = unexplained(inputs[rows], frequencies[rows], folds[rows])
    return 1 - left[~np.isnan(left)]


def unexplained(inputs: Array, frequencies: Array, folds: NDArray[np.intp]) -> Array:
    """Mean square that inputs leave of each mode out of fold, over that which the mean of the other folds leaves."""
    known = np.where(np.isnan(inputs).any(axis=1)[:, np.newaxis], np.nan, frequencies)
    left = known - out_of_fold(inputs, known, folds, trim=False)
    whole = known - out_of_fold(np.ones((len(inputs), 1)), known, folds, trim=False)
    counts = np.maximum((~np.isnan(known)).sum(axis=0), 1)
    squares = [np.nansum(part**2, axis=0) / counts for part in (left, whole)]
    return np.divide(squares[0], squares[1], out=np.full(len(counts), np.nan), where=squares[1] > 0)


def with_past(places: Array) -> Array:
    """Coordinates of the weather a row before, and their means over more of the past, side by side."""
    n_rows, filled = len(places), np.nan_to_num(places)
    ends, columns = np.arange(1, n_rows + 1), [np.vstack([filled[:1], filled[:-1]])]
    for period in PAST:
        if period * LEAST_MEANS <= n_rows:
            starts = np.maximum(ends - period, 0)
            columns.append(range_sums(filled, starts, ends) / (ends - starts)[:, np.newaxis])
    return np.hstack(columns)


def proposed_shifts(places: Array, frequencies: Array, inertia: int) -> list[int]:
    """Shifts at which coordinates of the weather and frequencies, or their changes, are most correlated."""
    n_rows = len(places)
    farthest, found = int(FARTHEST * n_rows), set()
    for of in (np.asarray, lambda table: np.diff(table, axis=0), lambda table: _changes_of_means(table, inertia)):
        weather, modes = (_spectra(of(table), 2 * n_rows) for table in (places, frequencies))
        correlations = (scipy.fft.irfft(modes * row.conj(), 2 * n_rows, axis=1) for row in weather)
        strength = sum((one**2).sum(axis=0) for one in correlations)
        strength = np.concatenate([strength[-farthest:], strength[: farthest + 1]])
        strength[farthest - 1 : farthest + inertia + 1] = 0
        for _ in range(N_PEAKS):
            peak = int(strength.argmax())
            found.add(peak - farthest)
            strength[max(peak - 2, 0) : peak + 3] = 0
    return sorted(found)


def _changes_of_means(table: Array, length: int) -> Array:
    """Change from the mean over some rows to that over the next ones, which shows fronts beside days and seasons."""
    sums = np.vstack(
        [np.zeros((1, table.shape[1])), np.cumsum(np.nan_to_num(table - np.nanmean(table, axis=0)), axis=0)]
    )
    return sums[2 * length :] - 2 * sums[length:-length] + sums[: -2 * length]


def _spectra(table: Array, length: int) -> Array:
    """Fourier transforms of standardised columns, gaps at their mean, outliers drawn in."""
    known = ~np.isnan(table)
    counts = np.maximum(known.sum(axis=0), 1)
    centred = np.where(known, table - np.where(known, table, 0.0).sum(axis=0) / counts, 0.0)
    deviations = np.sqrt((centred**2).sum(axis=0) / counts)
    standard = np.clip(centred / np.where(deviations > 0, deviations, np.inf), -5, 5)
    return scipy.fft.rfft(standard.T, length, axis=1)
