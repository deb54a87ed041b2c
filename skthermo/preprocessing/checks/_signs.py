"""Signs of faults: runs of equal values, modes exchanged, temperatures of another time, trends and steps."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy.fft
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from skthermo._tables.arrays import (
    Array,
    as_columns,
    means_of_known,
    median,
    range_sums,
    robust_deviation,
    spread_evenly,
)
from skthermo._tables.frames import YEAR, column_names, correlation_time, has_stamps, row_times
from skthermo._validation import check_array
from skthermo.preprocessing._weather_regression import out_of_fold

SHORTEST = 5  # number of equal records in a row that may count as stuck
USUAL = 4  # times the length of a usual run, which a stuck one exceeds where values are rounded
USUAL_RANK = 3  # the usual run is the longest but so many
CHANCE = 0.01  # number of such runs that chance may give in the whole column
FEW = 0.05  # share of the other periods of that length that may vary as little as rounding does
STEPS = 3  # steps of rounding that count as little
MOST_RUNS = 20  # longest ones of a column, which are looked at
LEAST_ROWS = 3
LEAST_SHARE = 0.002  # of the records that have both modes
FAR = 5.0  # robust deviations that a value is away from its column's prediction, and nearer to the other's
IN_ORDER = 0.5  # ratio of the mean squares with the modes in order and as given, below which they were exchanged
MOST_ROWS = 4000  # that are predicted for each shift
FARTHEST = 1 / 4  # of the records, by which they may be shifted
N_PEAKS = 3  # shifts that each kind of correlation proposes
PAST = (6, 24, 168)  # rows of means of the past: a structure follows the weather late
LEAST_MEANS = 10  # times that such a period must fit into the records
SHIFTED = 0.9  # ratio of what shifted temperatures leave to what those of the row leave, below which they are better
LEAST_GAIN = 0.01  # share of the variance that shifted temperatures explain beyond those of the row
LEAST_EXPLAINED = 0.1  # share of the variance that shifted temperatures explain
Rows = NDArray[np.intp]
PARTS = 5  # into which the records are divided, to compare the first with the last
LEAST_RECORDS = 10
N_PLACES = 100  # at which a step is sought
SHARPER = 0.9  # ratio of what a step leaves to what a line leaves, below which the change is a step
ESTIMATES = ["change", "standard_error", "first", "last", "n_independent"]


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


def stuck_columns(table: Array) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Place of a column and rows of each run at which it was stuck; what begins as another column is a lag of it."""
    for place, column in enumerate(table.T):
        for rows in stuck_runs(column):
            if rows[0] > 0 or np.count_nonzero(table[0] == column[0]) == 1:
                yield place, rows


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
        if np.sqrt(ratio.prod()) < IN_ORDER:
            alone = _alone_in_the_wrong_column(pair, predicted, deviation)
            found.append(Swap((first, second), np.union1d(rows, alone)))
    return found


def _alone_in_the_wrong_column(pair: Array, predicted: Array, deviation: Array) -> NDArray[np.intp]:
    """Rows with one value of two, which is far from what its own column should be and near to the other's."""
    with np.errstate(invalid="ignore"):
        is_far = np.abs(pair - predicted) > FAR * deviation
        is_near = np.abs(pair - predicted[:, ::-1]) < FAR * deviation[::-1]
    return np.flatnonzero((is_far & is_near).any(axis=1) & (np.isnan(pair).sum(axis=1) == 1))


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
    if ratio > SHIFTED or best.explained < max(LEAST_EXPLAINED, best.unshifted + LEAST_GAIN):
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
    whole = known - _means_of_other_folds(known, folds)
    counts = np.maximum((~np.isnan(known)).sum(axis=0), 1)
    squares = [np.nansum(part**2, axis=0) / counts for part in (left, whole)]
    return np.divide(squares[0], squares[1], out=np.full(len(counts), np.nan), where=squares[1] > 0)


def _means_of_other_folds(values: Array, folds: NDArray[np.intp]) -> Array:
    """For each row the means of the columns over the rows of all other folds; medians where these have no value."""
    known = ~np.isnan(values)
    sums, counts = (
        np.column_stack([np.bincount(folds, column) for column in part.T])
        for part in (np.where(known, values, 0.0), known)
    )
    others = counts.sum(axis=0) - counts
    medians = np.broadcast_to(median(values), sums.shape).copy()
    return np.divide(sums.sum(axis=0) - sums, others, out=medians, where=others > 0)[folds]


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
    sums = np.vstack([np.zeros((1, table.shape[1])), np.cumsum(np.nan_to_num(table - means_of_known(table)), axis=0)])
    return sums[2 * length :] - 2 * sums[length:-length] + sums[: -2 * length]


def _spectra(table: Array, length: int) -> Array:
    """Fourier transforms of standardised columns, gaps at their mean, outliers drawn in."""
    known = ~np.isnan(table)
    counts = np.maximum(known.sum(axis=0), 1)
    centred = np.where(known, table - np.where(known, table, 0.0).sum(axis=0) / counts, 0.0)
    deviations = np.sqrt((centred**2).sum(axis=0) / counts)
    standard = np.clip(centred / np.where(deviations > 0, deviations, np.inf), -5, 5)
    return scipy.fft.rfft(standard.T, length, axis=1)


def residual_trend(residuals: ArrayLike) -> pd.DataFrame:
    """Trend of residuals over time, by mode: an estimate and its standard error.

    Residuals of a healthy structure that its weather explains have none. A drift of a sensor, a structure that ages, or
    another season of the weather than the regression knows gives one.

    Parameters
    ----------
    residuals : array-like or DataFrame of shape (n_samples, n_modes)
        Measured minus predicted frequencies, best out of fold, as
        `~skthermo.detection.TemperatureCompensator.fit_transform` gives them; NaN is ignored. The index of a frame
        tells their times; without a ``DatetimeIndex``, rows are equally spaced.

    Returns
    -------
    DataFrame of shape (n_modes, 6)
        In the unit of the residuals, by mode: ``change``, by which a straight line changes from the first record to the
        last; its ``standard_error``; the same ``per_year`` (NaN without a ``DatetimeIndex``); ``first`` and ``last``,
        the means of the first and the last fifth of the period, beside the mean of all; and ``n_independent``, as how
        many independent records the residuals count. NaN for a mode with fewer than a dozen residuals.

    Notes
    -----
    The line is that of least squares. Its variance is that of independent records times the correlation time, 1 + 2 *
    the sum of the autocorrelations, of what remains beside the line.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.preprocessing import residual_trend
    >>> noise = np.random.default_rng(0).normal(0, 0.01, (1000, 1))
    >>> residual_trend(noise + np.linspace(0, 0.02, 1000)[:, np.newaxis])[["change", "standard_error"]].round(4)
        change  standard_error
    r1  0.0184          0.0011
    """
    values = as_columns(check_array(residuals, input_name="residuals", dtype=np.float64, ensure_2d=False))
    times = row_times(residuals)
    names = column_names(residuals, "r") if values.ndim == np.ndim(residuals) else ["r1"]
    order = np.argsort(times, kind="stable")
    return trend_table(Inputs(np.ones((len(values), 1))), values[order], times[order], names, has_stamps(residuals))


class Inputs:
    """Inputs beside which trends and steps of columns are sought, (n_samples, n_inputs), in order of time.

    Their orthonormal basis is found once for columns one after the other that have values in the same rows.
    """

    def __init__(self, values: Array):
        self.values = values
        self.are_known = ~np.isnan(values).any(axis=1)
        self._last: tuple[Rows, Array] | None = None

    @property
    def number(self) -> int:
        """Number of inputs."""
        return self.values.shape[1]

    def known(self, column: Array) -> Rows:
        """Rows in which the inputs and a column are known."""
        return np.flatnonzero(self.are_known & ~np.isnan(column))

    def basis(self, rows: Rows) -> Array:
        """Orthonormal columns that span what the inputs do in some rows."""
        if self._last is None or not np.array_equal(self._last[0], rows):
            basis, triangle = np.linalg.qr(self.values[rows])
            directions, sizes, _ = np.linalg.svd(triangle)
            self._last = rows, basis @ directions[:, sizes > 1e-8 * sizes.max()]
        return self._last[1]

    def rest(self, rows: Rows, columns: Array) -> Array:
        """What the inputs leave of columns in some rows."""
        basis = self.basis(rows)
        return columns - basis @ (basis.T @ columns)


def trend_table(inputs: Inputs, values: Array, times: Array, names: Sequence[Hashable], is_timed: bool) -> pd.DataFrame:
    """Trend of each column beside what inputs explain of it; rows in order of time."""
    span = np.ptp(times) if len(times) else 0.0
    places = (times - times[:1]) / span if span > 0 else np.zeros(len(times))
    rows = [_trend(inputs, places, column) for column in values.T]
    table = pd.DataFrame(rows, index=list(names), columns=ESTIMATES)
    table.insert(2, "per_year", table["change"] * (YEAR.value / span if is_timed and span > 0 else np.nan))
    return table


def _trend(inputs: Inputs, places: Array, column: Array) -> list[float]:
    """Change from place 0 to 1, its standard error, means of the first and last part, and the effective number."""
    known = inputs.known(column)
    x, y = places[known], column[known]
    if len(y) < LEAST_RECORDS + 2 * inputs.number or np.ptp(x) == 0:
        return [np.nan] * 5
    # Frisch-Waugh: the trend of what the inputs leave of values, over what they leave of time
    alone, rest = inputs.rest(known, np.column_stack([x, y])).T
    change = alone @ rest / (alone @ alone)
    scatter = rest - change * alone
    error, time = _standard_error(scatter, known, len(column), alone @ alone, inputs.number)
    at = scatter + change * (x - x.mean())
    ends = [at[part].mean() if part.any() else np.nan for part in (x <= 1 / PARTS, x >= 1 - 1 / PARTS)]
    return [change, error, *ends, len(y) / time]


def _standard_error(scatter: Array, known: Rows, n_rows: int, square: float, n_inputs: int) -> tuple[float, float]:
    """Of the coefficient of a regressor with this sum of squares, and the correlation time of what it leaves."""
    in_time = np.full(n_rows, np.nan)
    in_time[known] = scatter
    time = min(correlation_time(in_time), len(known) / 2)
    variance = np.sum(scatter**2) / max(len(known) - n_inputs - 2 * time, 1.0)
    return float(np.sqrt(variance * time / square)), time


class Step(NamedTuple):
    """Row from which a level is another one, the change and its standard error."""

    row: int
    change: float
    standard_error: float


def largest_step(inputs: Inputs, column: Array) -> Step | None:
    """The step that explains most of a column beside inputs; None where a straight line does nearly as well.

    Rows are in order of time. As for a trend, the standard error holds if what remains depends on what was before.
    """
    known = inputs.known(column)
    n_places = min(N_PLACES, len(known) // LEAST_RECORDS)
    if len(known) < LEAST_RECORDS + 2 * inputs.number or n_places < 2:
        return None
    at = np.arange(1, n_places) * len(known) // n_places
    basis = inputs.basis(known)
    line, rest = (inputs.rest(known, values) for values in (np.arange(len(known)) / len(known), column[known]))
    # a step is 1 from its place on: its products are sums of the last rows
    within, products = (part[::-1].cumsum(axis=0)[::-1][at] for part in (basis, rest))
    squares = np.maximum(len(known) - at - (within**2).sum(axis=1), 1e-12 * len(known))
    explained_by_line = (line @ rest) ** 2 / max(line @ line, 1e-12 * len(known))
    best = int(np.argmax(products**2 / squares))
    change = products[best] / squares[best]
    if rest @ rest - change * products[best] > SHARPER * (rest @ rest - explained_by_line):
        return None
    scatter = rest - change * ((np.arange(len(known)) >= at[best]) - basis @ within[best])
    error, _ = _standard_error(scatter, known, len(column), squares[best], inputs.number)
    return Step(int(known[at[best]]), float(change), error)
