"""Checks of frequencies beside the weather: exchanged modes, outliers, temperatures of another time, steps, trends."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import (
    Array,
    as_columns,
    means_of_known,
    median,
    range_sums,
    robust_deviation,
    rows_by_pattern,
    spread_evenly,
)
from skthermo._core.estimators import check_array
from skthermo._core.frames import YEAR, column_names, columns_by_sensor, correlation_time, has_stamps, row_times
from skthermo.preprocessing._weather_lines import WeatherLines, distances_from_neighbours, predicted_by_weather
from skthermo.preprocessing.checks._record_findings import RecordFinding, RecordFindings, findings_table, period_of
from skthermo.preprocessing.checks._set_aside import CleanedRecords
from skthermo.preprocessing.checks._stuck import stuck_columns
from skthermo.preprocessing.folds import BlockedKFold, out_of_fold

Rows = NDArray[np.intp]


def check_records(
    temperatures: Any = None, frequencies: Any = None, *, unit: str = "Hz", model: Any = None
) -> RecordFindings:
    """Look at temperatures and frequencies for faults that would otherwise be learned.

    It looks for gross errors first: arguments that are no tables of numbers, wrong times, numbers that stand for
    missing values, other units, empty, constant or equal columns, tables that are exchanged or have different rows. No
    argument makes it fail. Such values are then left out, and it looks for stuck sensors and modes, weather that
    explains nothing, temperatures of another time, modes exchanged in some rows, outliers, steps and trends.
    One table alone is checked for gross errors only, which takes milliseconds for a year of hourly records. A finding
    is a reason to look at the records, no proof of a fault.

    Parameters
    ----------
    temperatures : array-like or DataFrame of shape (n_samples, n_sensors), optional
        In degrees Celsius; NaN is allowed.
    frequencies : array-like or DataFrame of shape (n_samples, n_modes), optional
        Of the healthy structure, in Hz, or another quantity that follows the weather; NaN is allowed.
    unit : str, default="Hz"
        Unit of the second table, as the findings give it: "" for parameters, which are multipliers. Values in Hz have
        to be positive.
    model : FEModel, optional
        The second table's modes are compared with its nominal frequencies, which shows other units and other modes.

    Returns
    -------
    RecordFindings
        Its ``table`` has a row for each finding, ``summary()`` a line; ``temperatures`` and ``frequencies`` are the
        cleaned tables; ``refuse_meaningless`` raises an error.

    Raises
    ------
    ValueError
        If the unit is no text, or the model no FE model. Tables never raise an error.

    See Also
    --------
    HampelFilter : Puts NaN in place of outliers.
    residual_trend : The trend of residuals of any regression.

    Notes
    -----
    :doc:`/guide/records_theory` states each test, :doc:`/guide/warnings` explains its findings. The ``severity`` of a
    gross error is "meaningless" if results of a fit would be meaningless.

    Examples
    --------
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.preprocessing import check_records
    >>> year = make_truss_campaign(random_state=0)
    >>> print(check_records(year.temperatures, year.frequencies))
    No finding in 365 records.
    >>> late = year.frequencies.shift(60)
    >>> check_records(year.temperatures, late).table[["what", "n_rows"]]
             what  n_rows
    0  time-shift     305
    >>> print(check_records(year.temperatures[["T1"]] + 273.15))
    1 finding in 365 records.
    kelvin: 'T1' lies between 268.093 and 309.327 in 365 rows, 2025-01-01 to 2025-12-31
        Bounds and reports are in degrees Celsius. Subtract 273.15
    """
    cleaned = CleanedRecords(temperatures, frequencies, unit=unit, model=model)
    far, findings = cleaned.outliers(), cleaned.findings
    if cleaned.belong_together:
        records = RecordsInOrder(cleaned, unit)
        findings = [*findings, *records.findings()]
        far.iloc[records.order] |= records.are_outliers
    table = findings_table(findings)
    cleaned.set_stuck_aside()
    return RecordFindings(table, cleaned.n_rows, far, **cleaned.tables(), left_out=cleaned.left_out())


class RecordsInOrder:
    """Records in order of time, in which values with a finding become NaN.

    Each sensor has its present value, without lags; of several rows with one time, the first counts.
    """

    def __init__(self, cleaned: CleanedRecords, unit: str):
        T, F = cleaned.readings
        useful = cleaned.useful_values(T)
        is_timed = isinstance(T.index, pd.DatetimeIndex)
        rows, self.index = T.whole, pd.RangeIndex(len(T.values))
        if is_timed and not cleaned.have_wrong_times:
            rows = np.flatnonzero(~T.index.duplicated())
            self.index = T.index[rows]
        elif not is_timed:
            self.index = T.index
        sensors = columns_by_sensor(T)
        self.sensors, self.modes = list(sensors), F.columns
        self.T = useful[rows][:, [places[0] for places in sensors.values()]]
        self.F = cleaned.useful_values(F)[rows]
        self.order, self.unit = T.order[rows], f" {unit}" if unit else ""
        self.are_outliers = np.zeros(self.F.shape, dtype=bool)
        is_useless = np.isnan(useful) & (T.were_known | np.isnan(T.values).all(axis=0))
        self.has_faulty_sensors = bool(is_useless.mean(axis=0).max() > 0.01)
        self.has_wrong_times = cleaned.have_wrong_times
        self.hours: float | None = None  # between records
        self.inertia = 24  # rows by which a structure may follow the weather late: a day, at least one
        if isinstance(self.index, pd.DatetimeIndex) and len(self.index) > 1:
            self.hours = max(pd.Series(self.index).diff().median().total_seconds() / 3600, 1e-6)
            self.inertia = max(int(24 / self.hours), 1)

    def findings(self) -> Iterator[RecordFinding]:
        """Findings one after the other; each search passes over the values of earlier findings."""
        yield from self._stuck("stuck-sensor", self.T, self.sensors, " °C")
        yield from self._stuck("stuck-mode", self.F, self.modes, self.unit)
        if np.count_nonzero(~np.isnan(self.T).all(axis=1) & ~np.isnan(self.F).all(axis=1)) < 50:
            yield from self._outliers(_are_implausible(self.F))
            return
        weather = WeatherLines.learned(self.T)
        places = weather.coordinates(self.T)
        lines, past = weather.inputs(places), with_past(places)
        is_timed = isinstance(self.index, pd.DatetimeIndex)
        folds = BlockedKFold().fold_of(pd.DataFrame(index=self.index) if is_timed else self.T)
        yield from self._exchanged_modes(lines, folds)
        yield from self._outliers(self._far_from_neighbours(lines, folds))
        changes, level = self._changes(np.hstack([lines, past]))
        F = self.F - level  # a step or a trend would pass for a season of another time
        shift = self._shift(lines, past, places, F, folds)
        if shift is not None:
            yield shift
            return
        share = explained(lines, F, folds)
        if len(share) and (share < 0.02).all() and not self.has_faulty_sensors:
            usable = np.flatnonzero(~np.isnan(F).all(axis=1) & ~np.isnan(places).any(axis=1))
            detail = (
                f"at most {max(share.max(), 0.0):.1%} of the variance of a mode, in periods held out, in {len(usable)} "
                "rows"
            )
            yield RecordFinding.in_rows(self.index, "no-thermal-effect", "", usable, detail)
            return
        yield from changes

    def _stuck(self, what: str, table: Array, names: list[Hashable], unit: str) -> Iterator[RecordFinding]:
        for place, rows in stuck_columns(table):
            name, value = names[place], table[rows[0], place]
            detail = f"{name!r} is {value:.6g}{unit} in {len(rows)} rows, {period_of(self.index, rows)}"
            yield RecordFinding.in_rows(self.index, what, name, rows, detail)
            table[rows, place] = np.nan
            self.has_faulty_sensors |= table is self.T

    def _exchanged_modes(self, lines: Array, folds: Rows) -> Iterator[RecordFinding]:
        """Pairs of modes that the weather explains much better with their values exchanged in some rows.

        A row with one value of two counts if the value is far from its own column's prediction and near to the other's.
        """
        found = []
        for first, second in combinations(range(len(self.modes)), 2):
            pair = self.F[:, [first, second]]
            difference = pair[:, 1] - pair[:, 0]
            known = ~np.isnan(difference)
            n_known = np.count_nonzero(known)
            least = max(3, 0.002 * n_known)
            sign = 1.0 if np.count_nonzero(difference > 0) >= np.count_nonzero(difference < 0) else -1.0
            turned = known & (sign * difference < 0)
            if np.count_nonzero(turned) < least:
                continue
            ordered = np.where(turned[:, np.newaxis], pair[:, ::-1], pair)
            ordered[~known], given = np.nan, np.where(known[:, np.newaxis], pair, np.nan)
            predicted = predicted_by_weather(lines, ordered, folds)
            rest = ordered - predicted
            deviation = robust_deviation(rest)
            with np.errstate(invalid="ignore"):
                is_near = (np.abs(rest) < 5 * deviation).all(axis=1)
                is_far = np.abs(pair - predicted) > 5 * deviation
                is_near_to_other = np.abs(pair - predicted[:, ::-1]) < 5 * deviation[::-1]
            rows = np.flatnonzero(turned & is_near & is_far.any(axis=1))
            if len(rows) < least:
                continue
            kept = np.flatnonzero(is_near)
            before = given[kept] - predicted_by_weather(lines[kept], given[kept], folds[kept], trim=False)
            ratio = np.nanmean(rest[kept] ** 2, axis=0) / np.nanmean(before**2, axis=0)
            if np.sqrt(ratio.prod()) < 0.5:
                alone = (is_far & is_near_to_other).any(axis=1) & (np.isnan(pair).sum(axis=1) == 1)
                found.append(([first, second], n_known, np.union1d(rows, np.flatnonzero(alone))))
        for both, n_known, rows in found:
            names = " and ".join(repr(self.modes[mode]) for mode in both)
            detail = f"{names} in {len(rows)} of {n_known} rows, {period_of(self.index, rows)}"
            yield RecordFinding.in_rows(self.index, "exchanged-modes", names, rows, detail)
            self.F[np.ix_(rows, both)] = self.F[np.ix_(rows, both[::-1])]

    def _far_from_neighbours(self, lines: Array, folds: Rows) -> NDArray[np.bool_]:
        """Values far from their neighbours and from a regression on the weather or, without weather, implausible
        ones."""
        F, has_weather = self.F, ~np.isnan(lines).any(axis=1)[:, np.newaxis]
        rest = F - np.where(has_weather, predicted_by_weather(lines, F, folds), median(F))
        distances, local = distances_from_neighbours(rest, np.arange(len(F)), 25)
        floor = 0.1 * robust_deviation(F)
        deviation = np.fmax(robust_deviation(rest), floor)
        local = np.fmax(np.fmax(local, robust_deviation(distances)), floor)
        with np.errstate(invalid="ignore"):
            far = (np.abs(distances) > 8 * local) & (np.abs(rest - median(rest)) > 8 * deviation)
        return far & (deviation > 0) & (has_weather | _are_implausible(F))

    def _outliers(self, far: NDArray[np.bool_]) -> Iterator[RecordFinding]:
        for name, column, is_far in zip(self.modes, self.F.T, far.T, strict=True):
            rows = np.flatnonzero(is_far)
            if len(rows):
                detail = (
                    f"{name!r} in {len(rows)} of {np.count_nonzero(~np.isnan(column))} rows, the first "
                    f"{column[rows[0]]:.4g}{self.unit} in {period_of(self.index, rows[:1])}"
                )
                yield RecordFinding.in_rows(self.index, "frequency-outliers", name, rows, detail)
        self.F[far] = np.nan
        self.are_outliers |= far

    def _shift(self, lines: Array, past: Array, places: Array, F: Array, folds: Rows) -> RecordFinding | None:
        """A finding where temperatures of other rows explain clearly more than the row's own and its past."""
        n_rows, inputs, found = len(F), np.hstack([lines, past]), []
        for shift in proposed_shifts(places, F, self.inertia):
            rows = spread_evenly(np.arange(max(shift, 0), n_rows + min(shift, 0)), 4000)
            own = unexplained(inputs[rows], F[rows], folds[rows])
            other = unexplained(inputs[rows - shift], F[rows], folds[rows])
            varying = ~np.isnan(own) & ~np.isnan(other) & (own > 0)
            if varying.any():
                ratio = float(np.exp(np.log(np.maximum(other, 1e-300)[varying] / own[varying]).mean()))
                found.append((ratio, shift, float(1 - np.nanmean(other)), float(1 - np.nanmean(own))))
        if not found:
            return None
        ratio, shift, shifted, unshifted = min(found)
        if ratio > 0.9 or shifted < max(0.1, unshifted + 0.01):
            return None
        rows = np.arange(max(shift, 0), n_rows + min(shift, 0))  # means of the past may follow a season by chance
        own = explained(lines[rows], F[rows], folds[rows])
        other = explained(lines[rows - shift], F[rows], folds[rows])
        if other.sum() <= max(own.sum(), len(other) * 0.05):
            return None
        length, direction = "", "before" if shift > 0 else "after"
        if self.hours is not None:
            hours = abs(shift) * self.hours
            length = f" (about {hours:.3g} hours)" if hours < 48 else f" (about {hours / 24:.3g} days)"
        detail = (
            f"those of {abs(shift)} rows {direction}{length} explain {shifted:.0%} of the variance in periods held "
            f"out, those of the same rows {max(unshifted, 0.0):.0%}"
        )
        return RecordFinding.in_rows(self.index, "time-shift", "", rows, detail)

    def _changes(self, inputs: Array) -> tuple[list[RecordFinding], Array]:
        """Steps and trends beside the weather, and their share in each frequency."""
        level = np.zeros(self.F.shape)
        found: list[RecordFinding] = []
        rows = spread_evenly(np.arange(len(inputs)), 20_000)
        F, index = self.F[rows], self.index[rows]
        is_timed = isinstance(index, pd.DatetimeIndex)
        is_short = is_timed and index[-1] - index[0] < pd.Timedelta(days=90)  # a trend may be the season
        if self.has_faulty_sensors or self.has_wrong_times or is_short:
            return found, level
        times = row_times(pd.DataFrame(index=self.index))
        span, deviations = np.ptp(times[rows]), robust_deviation(F)
        for known, basis, mode in bases_of(inputs[rows], F):
            name, n_inputs = self.modes[mode], inputs.shape[1]
            all_known = np.flatnonzero(~np.isnan(self.F[:, mode]))
            of_frequency = 0.1 * deviations[mode]
            row, change, error = largest_step(basis, known, F[:, mode], n_inputs)
            if abs(change) > max(5 * error, of_frequency):
                level[rows[row] :, mode] = change
                detail = (
                    f"{name!r} changes by {change:+.2g}{self.unit} about {period_of(self.index, rows[[row]])}, "
                    f"standard error {error:.1g}"
                )
                found.append(RecordFinding.in_rows(self.index, "sudden-change", name, all_known, detail))
                continue
            places = (times[rows] - times[rows[0]]) / span
            change, error, first, last, number = trend_of(basis, known, places, F[:, mode], n_inputs)
            least = max(5 * error, 0.5 * error * np.sqrt(number / 12), of_frequency)  # half of the residuals' deviation
            if abs(change) > least:
                level[:, mode] = change * (times - times[0]) / np.ptp(times)
                a_year = f" ({change * YEAR.value / span:+.2g}{self.unit} a year)" if is_timed else ""
                detail = (
                    f"{name!r} changes by {change:+.2g}{self.unit}, standard error {error:.1g}{a_year}; first fifth "
                    f"{first:+.2g}{self.unit}, last fifth {last:+.2g}{self.unit}"
                )
                found.append(RecordFinding.in_rows(self.index, "trend", name, all_known, detail))
        return sorted(found, key=lambda one: self.modes.index(one.column)), level


def _are_implausible(F: Array) -> NDArray[np.bool_]:
    """Values of twice or half the median of their mode, which need no weather to be doubtful."""
    middle, deviation = median(F), robust_deviation(F)
    with np.errstate(invalid="ignore"):
        far = (2 * middle < F) | (middle / 2 > F)
        return far & (middle > 0) & (np.abs(F - middle) > 8 * deviation)


def explained(inputs: Array, frequencies: Array, folds: Rows) -> Array:
    """Share of the variance of each mode that varies, which inputs explain out of fold; at most zero for nothing."""
    rows = spread_evenly(np.arange(len(inputs)), 4000)
    left = unexplained(inputs[rows], frequencies[rows], folds[rows])
    return 1 - left[~np.isnan(left)]


def unexplained(inputs: Array, frequencies: Array, folds: Rows) -> Array:
    """Mean square of each mode's residuals out of fold by the inputs, over that by the mean of the other folds."""
    values = np.where(np.isnan(inputs).any(axis=1)[:, np.newaxis], np.nan, frequencies)
    means = out_of_fold(lambda train: lambda test: np.tile(means_of_known(values[train]), (len(test), 1)), folds)
    means = np.where(np.isnan(means), median(values), means)  # where the other folds have no value
    left = np.nansum((values - predicted_by_weather(inputs, values, folds, trim=False)) ** 2, axis=0)
    whole = np.nansum((values - means) ** 2, axis=0)
    return np.divide(left, whole, out=np.full(len(whole), np.nan), where=whole > 0)


def with_past(places: Array) -> Array:
    """Coordinates of the weather a row before, and their means over more of the past, side by side."""
    n_rows, filled = len(places), np.nan_to_num(places)
    ends, columns = np.arange(1, n_rows + 1), [np.vstack([filled[:1], filled[:-1]])]
    for period in (6, 24, 168):
        if 10 * period <= n_rows:
            starts = np.maximum(ends - period, 0)
            columns.append(range_sums(filled, starts, ends) / (ends - starts)[:, np.newaxis])
    return np.hstack(columns)


def proposed_shifts(places: Array, frequencies: Array, inertia: int) -> list[int]:
    """Shifts at which coordinates of the weather and frequencies, or their changes, are most correlated."""
    n_rows = len(places)
    farthest, found = n_rows // 4, set()
    for of in (np.asarray, partial(np.diff, axis=0), partial(_changes_of_means, length=inertia)):
        weather, modes = _spectra(of(places), 2 * n_rows), _spectra(of(frequencies), 2 * n_rows)
        strength = np.zeros(2 * n_rows)
        for row in weather:
            strength += (scipy.fft.irfft(modes * row.conj(), 2 * n_rows, axis=1) ** 2).sum(axis=0)
        strength = np.concatenate([strength[-farthest:], strength[: farthest + 1]])
        strength[farthest - 1 : farthest + inertia + 1] = 0
        for _ in range(3):
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
    The line is fitted by least squares. Its variance is the variance for independent records times the correlation time
    of the rest beside the line, 1 + 2 * the sum of its autocorrelations.

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
    span = np.ptp(times) if len(times) else 0.0
    places = (times[order] - times[order][:1]) / span if span > 0 else np.zeros(len(times))
    rows = np.full((values.shape[1], 5), np.nan)
    for known, basis, mode in bases_of(np.ones((len(values), 1)), values[order]):
        rows[mode] = trend_of(basis, known, places, values[order, mode], 1)
    estimates = ["change", "standard_error", "first", "last", "n_independent"]
    table = pd.DataFrame(rows, index=list(names), columns=estimates)
    table.insert(2, "per_year", table["change"] * (YEAR.value / span if has_stamps(residuals) and span > 0 else np.nan))
    return table


def bases_of(inputs: Array, values: Array) -> Iterator[tuple[Rows, Array, int]]:
    """For each mode that has enough values: the rows in which it and the inputs are known, orthonormal columns that
    span what the inputs do there, and its position."""
    usable = ~np.isnan(inputs).any(axis=1)
    for is_known, modes in rows_by_pattern(~np.isnan(values.T) & usable):
        known = np.flatnonzero(is_known)
        if len(known) >= 10 + 2 * inputs.shape[1]:
            basis, triangle = np.linalg.qr(inputs[known])
            directions, sizes, _ = np.linalg.svd(triangle)
            basis = basis @ directions[:, sizes > 1e-8 * sizes.max()]
            yield from ((known, basis, int(mode)) for mode in modes)


def trend_of(
    basis: Array, known: Rows, places: Array, column: Array, n_inputs: int
) -> tuple[float, float, float, float, float]:
    """Change from place 0 to 1 beside inputs, its standard error, means of the first and last fifth, and the effective
    number."""
    x, y = places[known], column[known]
    if np.ptp(x) == 0:
        return (np.nan,) * 5
    # Frisch-Waugh: both the values and the times without their parts that the inputs explain
    both = np.column_stack([x, y])
    alone, rest = (both - basis @ (basis.T @ both)).T
    change = alone @ rest / (alone @ alone)
    scatter = rest - change * alone
    error, time = _standard_error(scatter, known, len(column), alone @ alone, n_inputs)
    at = scatter + change * (x - x.mean())
    is_first, is_last = x <= 1 / 5, x >= 1 - 1 / 5
    first = at[is_first].mean() if is_first.any() else np.nan
    last = at[is_last].mean() if is_last.any() else np.nan
    return change, error, first, last, len(y) / time


def _standard_error(scatter: Array, known: Rows, n_rows: int, square: float, n_inputs: int) -> tuple[float, float]:
    """Standard error of the coefficient of a regressor with this sum of squares, and the scatter's correlation time."""
    in_time = np.full(n_rows, np.nan)
    in_time[known] = scatter
    time = min(correlation_time(in_time), len(known) / 2)
    variance = np.sum(scatter**2) / max(len(known) - n_inputs - 2 * time, 1.0)
    return float(np.sqrt(variance * time / square)), time


def largest_step(basis: Array, known: Rows, column: Array, n_inputs: int) -> tuple[int, float, float]:
    """The step that explains most of a column beside inputs: its row, the change and its standard error.

    The change is 0 where a straight line does nearly as well. Rows are in order of time. As for a trend, the standard
    error allows for correlation of the rest.
    """
    n_places = min(100, len(known) // 10)
    if n_places < 2:
        return 0, 0.0, np.inf
    at = np.arange(1, n_places) * len(known) // n_places
    line, y = np.arange(len(known)) / len(known), column[known]
    line, rest = line - basis @ (basis.T @ line), y - basis @ (basis.T @ y)
    # a step is 1 from its place on: its products are sums of the last rows
    within, products = basis[::-1].cumsum(axis=0)[::-1][at], rest[::-1].cumsum()[::-1][at]
    squares = np.maximum(len(known) - at - (within**2).sum(axis=1), 1e-12 * len(known))
    explained_by_line = (line @ rest) ** 2 / max(line @ line, 1e-12 * len(known))
    best = int(np.argmax(products**2 / squares))
    change = products[best] / squares[best]
    if rest @ rest - change * products[best] > 0.9 * (rest @ rest - explained_by_line):
        return 0, 0.0, np.inf
    scatter = rest - change * ((np.arange(len(known)) >= at[best]) - basis @ within[best])
    error, _ = _standard_error(scatter, known, len(column), squares[best], n_inputs)
    return int(known[at[best]]), float(change), error
