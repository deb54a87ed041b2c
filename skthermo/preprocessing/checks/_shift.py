"""Whether temperatures of another time explain the frequencies better than those of their own rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from skthermo._arrays import Array, spread_evenly
from skthermo.preprocessing._weather_regression import out_of_fold

MOST_ROWS = 4000  # that are predicted for each shift
FARTHEST = 1 / 4  # of the records, by which they may be shifted
N_PEAKS = 3  # shifts that each kind of correlation proposes
PAST = (6, 24, 168)  # rows of means of the past: a structure follows the weather late
LEAST_MEANS = 20  # times that such a period must fit into the records
BETTER = 0.9  # ratio of what shifted temperatures leave to what those of the row leave, below which they are better
LEAST_EXPLAINED = 0.1  # share of the variance that shifted temperatures explain


class Shift(NamedTuple):
    """By how many rows temperatures are earlier than frequencies, and the shares of the variance explained."""

    rows: int
    explained: float
    unshifted: float


def best_shift(lines: Array, past: Array, places: Array, F: Array, folds: NDArray[np.intp]) -> Shift | None:
    """The shift at which temperatures explain most, if they explain clearly more than those of the row and its past."""
    n_rows, inputs, found = len(F), np.hstack([lines, past]), []
    for shift in proposed_shifts(places, F):
        rows = spread_evenly(np.arange(max(shift, 0), n_rows + min(shift, 0)), MOST_ROWS)
        own, other = (unexplained(table, F[rows], folds[rows]) for table in (inputs[rows], inputs[rows - shift]))
        ratio = np.exp(np.nanmean(np.log(other / own)))
        found.append((ratio, Shift(shift, *(float(1 - np.nanmean(part)) for part in (other, own)))))
    if not found:
        return None
    ratio, shift = min(found)
    if ratio > BETTER or shift.explained < LEAST_EXPLAINED:
        return None
    rows = np.arange(max(shift.rows, 0), n_rows + min(shift.rows, 0))  # means of the past may follow a season by chance
    own, other = (explained(lines[part], F[rows], folds[rows]) for part in (rows, rows - shift.rows))
    return shift if other.mean() > max(own.mean(), LEAST_EXPLAINED / 2) else None


def explained(inputs: Array, frequencies: Array, folds: NDArray[np.intp]) -> Array:
    """Share of each mode's variance that inputs explain out of fold; at most zero where they explain nothing."""
    rows = spread_evenly(np.arange(len(inputs)), MOST_ROWS)
    return np.nan_to_num(1 - unexplained(inputs[rows], frequencies[rows], folds[rows]))


def unexplained(inputs: Array, frequencies: Array, folds: NDArray[np.intp]) -> Array:
    """Mean square that inputs leave of each mode out of fold, over that which the mean of the other folds leaves."""
    known = np.where(np.isnan(inputs).any(axis=1)[:, np.newaxis], np.nan, frequencies)
    left = known - out_of_fold(inputs, known, folds, trim=False)
    whole = known - out_of_fold(np.ones((len(inputs), 1)), known, folds, trim=False)
    counts = np.maximum((~np.isnan(known)).sum(axis=0), 1)
    squares = [np.nansum(part**2, axis=0) / counts for part in (left, whole)]
    return np.divide(squares[0], squares[1], out=np.full(len(counts), np.nan), where=squares[1] > 0)


def with_past(places: Array) -> Array:
    """Means of coordinates of the weather over some rows of the past, (n_samples, n_periods * n_coordinates)."""
    n_rows, filled = len(places), np.nan_to_num(places)
    sums = np.vstack([np.zeros((1, places.shape[1])), np.cumsum(filled, axis=0)])
    ends, columns = np.arange(1, n_rows + 1), []
    for period in PAST:
        if period * LEAST_MEANS <= n_rows:
            starts = np.maximum(ends - period, 0)
            columns.append((sums[ends] - sums[starts]) / (ends - starts)[:, np.newaxis])
    return np.hstack([np.empty((n_rows, 0)), *columns])


def proposed_shifts(places: Array, frequencies: Array) -> list[int]:
    """Shifts at which coordinates of the weather and frequencies, or their changes, are most correlated."""
    n_rows = len(places)
    farthest, found = int(FARTHEST * n_rows), set()
    for of in (np.asarray, lambda table: np.diff(table, axis=0)):
        weather, modes = (_spectra(of(table), 2 * n_rows) for table in (places, frequencies))
        correlations = (scipy.fft.irfft(modes * row.conj(), 2 * n_rows, axis=1) for row in weather)
        strength = sum((one**2).sum(axis=0) for one in correlations)
        strength = np.concatenate([strength[-farthest:], strength[: farthest + 1]])
        for _ in range(N_PEAKS):
            peak = int(strength.argmax())
            found.add(peak - farthest)
            strength[max(peak - 2, 0) : peak + 3] = 0
    return sorted(found - {0})


def _spectra(table: Array, length: int) -> Array:
    """Fourier transforms of standardised columns, gaps at their mean, outliers drawn in."""
    known = ~np.isnan(table)
    counts = np.maximum(known.sum(axis=0), 1)
    centred = np.where(known, table - np.where(known, table, 0.0).sum(axis=0) / counts, 0.0)
    deviations = np.sqrt((centred**2).sum(axis=0) / counts)
    standard = np.clip(centred / np.where(deviations > 0, deviations, np.inf), -5, 5)
    return scipy.fft.rfft(standard.T, length, axis=1)
