"""Looks at records before anything is learned from them."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, median, robust_deviation, spread_evenly
from skthermo._tables.frames import Table, columns_by_sensor, row_times
from skthermo.preprocessing._folds import BlockedKFold
from skthermo.preprocessing._hampel import distances_from_neighbours
from skthermo.preprocessing._memory import WEEKS, MemoryFindings, find_memory, lines_of, trailing_means
from skthermo.preprocessing._weather_regression import WeatherBasis, out_of_fold
from skthermo.preprocessing.checks._gross import CleanedRecords
from skthermo.preprocessing.checks._kinds import Finding
from skthermo.preprocessing.checks._reading import finding, period_of
from skthermo.preprocessing.checks._record_findings import RecordFindings, findings_table
from skthermo.preprocessing.checks._signs import (
    Inputs,
    TimeShift,
    best_shift,
    explained,
    largest_step,
    stuck_columns,
    swapped_modes,
    trend_table,
    with_past,
)

LEAST_ROWS = 50  # with temperatures and frequencies, below which only runs of equal values are looked for
MOST_FITTED = 20_000  # rows, evenly spread, that a trend is fitted to
NOTHING = 0.02  # share of a mode's variance that counts as explained by chance
WINDOW = 25  # rows that are neighbours of a value
OUTLYING = 8.0  # robust deviations from the neighbours, and from what the weather explains, of an outlier
INERTIA = 24  # rows by which a structure may follow the weather late, where their times are not known
SHORTEST_TREND = pd.Timedelta(days=90)  # of records; in fewer it may be the season
CERTAIN = 5.0  # standard errors of a trend
LEAST_CHANGE = 0.5  # standard deviations of the residuals by which a trend that matters changes them
LEAST_OF_ALL = 0.1  # the same, in standard deviations of the frequency
IMPLAUSIBLE = 2.0  # times the median of its mode, or its inverse, of an outlier among few records
PREDICTABLE = 0.1  # standard deviation of a residual over that of the frequency, at least, in what is outlying


def check_records(temperatures: Any, frequencies: Any, *, unit: str = "Hz", model: Any = None) -> RecordFindings:
    """Look at temperatures and frequencies for faults that would otherwise be learned.

    It looks for gross errors first: what is no table of numbers, wrong times, numbers that stand for missing values,
    other units, empty, constant or equal columns, tables that are exchanged or have different rows. Whatever it is
    given as a table, it does not fail. Such values are then left out, and it looks for sensors and modes that are
    stuck, weather that explains nothing, temperatures of another time, modes exchanged in some rows, outliers, memory,
    steps and trends. A finding is a reason to look at the records, no proof of a fault.

    Parameters
    ----------
    temperatures : array-like or DataFrame of shape (n_samples, n_sensors)
        In degrees Celsius; NaN is allowed.
    frequencies : array-like or DataFrame of shape (n_samples, n_modes)
        Of the healthy structure, in Hz, or another quantity that follows the weather; NaN is allowed.
    unit : str, default="Hz"
        Unit of the second table, as the findings give it: "" for parameters, which are multipliers. Values in Hz have
        to be positive.
    model : FEModel, optional
        The second table's modes are compared with its nominal frequencies, which shows other units and other modes.

    Returns
    -------
    RecordFindings
        Its ``table`` has a row for each finding, ``summary()`` a line.

    Raises
    ------
    ValueError
        If the unit is no text, or the model no FE model. Tables never raise an error.

    See Also
    --------
    HampelFilter : Puts NaN in place of outliers.
    find_memory : Means of earlier temperatures that explain the frequencies, also those of hours.
    residual_trend : The trend of residuals of any regression.

    Notes
    -----
    :doc:`/guide/records_theory` states each test, :doc:`/guide/warnings` what its findings mean. The ``severity`` of a
    gross error is "meaningless" if results of a fit would be.

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
    """
    tables = {"temperatures": temperatures, "frequencies": frequencies}
    cleaned = CleanedRecords.of(tables, unit=unit, model=model)
    if not cleaned.belong_together:
        return RecordFindings(findings_table(cleaned.findings), cleaned.n_rows, cleaned.outliers())
    records = _Records.of(cleaned, f" {unit}" if unit else "")
    findings = [*cleaned.findings, *_stuck(records)]  # its rows then are NaN, and so on
    findings += _against_weather(records) if records.n_usable >= LEAST_ROWS else _implausible(records)
    far = cleaned.outliers()
    far.iloc[records.order] |= records.outliers
    return RecordFindings(findings_table(findings), cleaned.n_rows, far, records.memory)


@dataclass
class _Records:
    """Records in order of time; what is found to be wrong becomes NaN."""

    T: Array
    F: Array
    sensors: list[Hashable]
    modes: list[Hashable]
    order: NDArray[np.intp]
    index: pd.Index
    unit: str
    outliers: NDArray[np.bool_]
    has_faulty_sensors: bool = False
    has_wrong_times: bool = False
    memory: MemoryFindings | None = None

    @classmethod
    def of(cls, cleaned: CleanedRecords, unit: str) -> _Records:
        """Of every sensor what it shows at that time, and of rows with one time the first."""
        T, F = cleaned.readings
        sensors = columns_by_sensor(T)
        rows, index = T.whole, pd.RangeIndex(len(T.values))
        if cleaned.have_times:
            rows = np.flatnonzero(~T.index.duplicated())
            index = T.index[rows]
        elif not isinstance(T.index, pd.DatetimeIndex):
            index = T.index
        values, modes = (cleaned.useful_values(reading)[rows] for reading in (T, F))
        now = values[:, [places[0] for places in sensors.values()]]
        outliers = np.zeros((len(rows), len(F.columns)), dtype=bool)
        records = cls(now, modes, list(sensors), F.columns, T.order[rows], index, unit, outliers)
        records.has_faulty_sensors = cleaned.have_faulty_sensors
        records.has_wrong_times = cleaned.have_wrong_times
        return records

    @property
    def n_usable(self) -> int:
        """Number of rows with a temperature and a frequency."""
        return int((~np.isnan(self.T).all(axis=1) & ~np.isnan(self.F).all(axis=1)).sum())

    @property
    def hours(self) -> float | None:
        """Median time between records; None where they have no stamps."""
        if not isinstance(self.index, pd.DatetimeIndex):
            return None
        return max(pd.Series(self.index).diff().median().total_seconds() / 3600, 1e-6)

    @property
    def inertia(self) -> int:
        """Number of rows by which a structure may follow the weather late: a day, at least one."""
        return INERTIA if self.hours is None else max(int(24 / self.hours), 1)

    def finding(self, what: str, column: Hashable, rows: NDArray[np.intp], detail: str) -> Finding:
        return finding(self.index, what, column, rows, detail)

    def period(self, rows: NDArray[np.intp]) -> str:
        return period_of(self.index, rows)


def _stuck(records: _Records) -> Iterator[Finding]:
    for what, table, names, unit in (
        ("stuck-sensor", records.T, records.sensors, " °C"),
        ("stuck-mode", records.F, records.modes, records.unit),
    ):
        for place, rows in stuck_columns(table):
            name, value = names[place], table[rows[0], place]
            detail = f"{name!r} is {value:.6g}{unit} in {len(rows)} rows, {records.period(rows)}"
            yield records.finding(what, name, rows, detail)
            table[rows, place] = np.nan
            records.has_faulty_sensors |= table is records.T


def _against_weather(records: _Records) -> Iterator[Finding]:
    basis = WeatherBasis.of(records.T)
    places = basis.coordinates(records.T)
    lines, past = basis.lines(places), with_past(places)
    folds = BlockedKFold().fold_of(_with_stamps(records))
    yield from _exchanged(records, lines, folds)
    yield from _outliers(records, lines, folds)
    slow = list(_slow_means(records))
    changes, level = _changes(records, np.hstack([lines, past, *(inputs for _, inputs in slow)]))
    F = records.F - level  # a step or a trend would pass for a season of another time
    share = explained(lines, F, folds)
    usable = np.flatnonzero(~np.isnan(F).all(axis=1) & ~np.isnan(places).any(axis=1))
    shift = best_shift(lines, past, places, F, folds, records.inertia)
    if shift is not None:
        yield records.finding("time-shift", "", *_shifted(records, shift))
        return
    if len(share) and (share < NOTHING).all() and not records.has_faulty_sensors:
        detail = f"at most {max(share.max(), 0.0):.1%} of the variance of a mode, out of fold, in {len(usable)} rows"
        yield records.finding("no-thermal-effect", "", usable, detail)
        return
    yield from (finding for finding, _ in slow)
    yield from changes


def _with_stamps(records: _Records) -> Table:
    return pd.DataFrame(index=records.index) if isinstance(records.index, pd.DatetimeIndex) else records.T


def _slow_means(records: _Records) -> Iterator[tuple[Finding, Array]]:
    """Findings of memory of weeks, each with piecewise-linear functions of the mean that explains it."""
    names = {type(name) for name in (*records.sensors, *records.modes)}
    if (
        records.has_faulty_sensors
        or records.has_wrong_times
        or names != {str}
        or len(set(records.modes)) < len(records.modes)
    ):
        return
    tables = ((records.T, records.sensors), (records.F, records.modes))
    found = find_memory(*(pd.DataFrame(values, records.index, names) for values, names in tables))
    records.memory = found
    chosen = found.table[found.table["chosen"].astype(bool)]
    usable = np.flatnonzero(~np.isnan(records.F).all(axis=1))
    for (constant, sensor), part in chosen.groupby(["time_constant", "sensor"], sort=False):
        duration = pd.Timedelta(constant)
        if duration >= WEEKS:
            times, length = records.index.as_unit("ns").asi8, duration.as_unit("ns").value
            mean = trailing_means(times, records.T[:, [records.sensors.index(sensor)]], length)
            before = np.exp(-(times - times[0]) / length)[:, np.newaxis]  # weight of the weather before the records
            detail = (
                f"the mean of {sensor!r} with a time constant of {duration.days} days lowers the out-of-fold error by "
                f"{part['fall'].mean():.0%}: ExponentialMeans(['{constant}'], sensors=[{sensor!r}])"
            )
            inputs = np.hstack([lines_of(mean[:, 0]), before, before * mean])
            yield records.finding("thermal-memory", sensor, usable, detail), inputs


def _exchanged(records: _Records, lines: Array, folds: NDArray[np.intp]) -> Iterator[Finding]:
    for (first, second), rows in swapped_modes(lines, records.F, folds):
        names = f"{records.modes[first]!r} and {records.modes[second]!r}"
        n_both = int((~np.isnan(records.F[:, [first, second]])).all(axis=1).sum())
        detail = f"{names} in {len(rows)} of {n_both} rows, {records.period(rows)}"
        yield records.finding("exchanged-modes", names, rows, detail)
        records.F[np.ix_(rows, [first, second])] = records.F[np.ix_(rows, [second, first])]


def _outliers(records: _Records, lines: Array, folds: NDArray[np.intp]) -> Iterator[Finding]:
    F, has_weather = records.F, ~np.isnan(lines).any(axis=1)[:, np.newaxis]
    rest = F - np.where(has_weather, out_of_fold(lines, F, folds), median(F))
    distances, local = distances_from_neighbours(rest, np.arange(len(F)), WINDOW)
    floor = PREDICTABLE * robust_deviation(F)
    deviation = np.fmax(robust_deviation(rest), floor)
    local = np.fmax(np.fmax(local, robust_deviation(distances)), floor)
    with np.errstate(invalid="ignore"):
        far = (np.abs(distances) > OUTLYING * local) & (np.abs(rest - median(rest)) > OUTLYING * deviation)
    yield from _outliers_found(records, far & (deviation > 0) & (has_weather | _are_implausible(F)))


def _implausible(records: _Records) -> Iterator[Finding]:
    yield from _outliers_found(records, _are_implausible(records.F))


def _are_implausible(F: Array) -> NDArray[np.bool_]:
    """Values of twice or half the median of their mode, which need no weather to be doubtful."""
    middle, deviation = median(F), robust_deviation(F)
    with np.errstate(invalid="ignore"):
        far = (IMPLAUSIBLE * middle < F) | (middle / IMPLAUSIBLE > F)
        return far & (middle > 0) & (np.abs(F - middle) > OUTLYING * deviation)


def _outliers_found(records: _Records, far: NDArray[np.bool_]) -> Iterator[Finding]:
    F = records.F
    for name, column, is_far in zip(records.modes, F.T, far.T, strict=True):
        rows = np.flatnonzero(is_far)
        if len(rows):
            n_known = int((~np.isnan(column)).sum())
            detail = (
                f"{name!r} in {len(rows)} of {n_known} rows, the first {column[rows[0]]:.4g}{records.unit} in "
                f"{records.period(rows[:1])}"
            )
            yield records.finding("frequency-outliers", name, rows, detail)
    F[far] = np.nan
    records.outliers |= far


def _shifted(records: _Records, shift: TimeShift) -> tuple[NDArray[np.intp], str]:
    rows = np.arange(max(shift.rows, 0), len(records.F) + min(shift.rows, 0))
    length, direction = "", "before" if shift.rows > 0 else "after"
    if records.hours is not None:
        hours = abs(shift.rows) * records.hours
        length = f" (about {hours:.3g} hours)" if hours < 48 else f" (about {hours / 24:.3g} days)"
    detail = (
        f"those of {abs(shift.rows)} rows {direction}{length} explain {shift.explained:.0%} of the variance out of "
        f"fold, those of the same rows {shift.unshifted:.0%}"
    )
    return rows, detail


def _changes(records: _Records, inputs: Array) -> tuple[list[Finding], Array]:
    """Steps and trends that are found beside the weather, and what they add to each frequency."""
    level = np.zeros(records.F.shape)
    found: list[Finding] = []
    rows = spread_evenly(np.arange(len(inputs)), MOST_FITTED)
    F, index = records.F[rows], records.index[rows]
    timed = isinstance(index, pd.DatetimeIndex)
    if records.has_faulty_sensors or records.has_wrong_times or (timed and index[-1] - index[0] < SHORTEST_TREND):
        return found, level
    times = row_times(pd.DataFrame(index=records.index))
    beside, deviations = Inputs(inputs[rows]), robust_deviation(F)
    for mode, name in enumerate(records.modes):
        known = np.flatnonzero(~np.isnan(records.F[:, mode]))
        of_frequency = LEAST_OF_ALL * deviations[mode]
        row = trend_table(beside, F[:, [mode]], times[rows], [name], timed).iloc[0]
        step = largest_step(beside, F[:, mode])
        if step is not None and abs(step.change) > max(CERTAIN * step.standard_error, of_frequency):
            level[rows[step.row] :, mode] = step.change
            detail = f"{name!r} changes by {step.change:+.2g}{records.unit} about {records.period(rows[[step.row]])}"
            found.append(
                records.finding("sudden-change", name, known, f"{detail}, standard error {step.standard_error:.1g}")
            )
            continue
        change, error = row["change"], row["standard_error"]
        scatter = error * np.sqrt(row["n_independent"] / 12)
        if not (abs(change) > CERTAIN * error and abs(change) > max(LEAST_CHANGE * scatter, of_frequency)):
            continue
        level[:, mode] = change * (times - times[0]) / np.ptp(times)
        a_year = f" ({row['per_year']:+.2g}{records.unit} a year)" if timed else ""
        detail = (
            f"{name!r} changes by {change:+.2g}{records.unit}, standard error {error:.1g}{a_year}; first fifth "
            f"{row['first']:+.2g}{records.unit}, last fifth {row['last']:+.2g}{records.unit}"
        )
        found.append(records.finding("trend", name, known, detail))
    return found, level
