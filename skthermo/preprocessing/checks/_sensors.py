"""Gross errors of temperatures: values that no thermometer in the open shows, other units and signs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, spread_evenly
from skthermo._tables.frames import columns_by_sensor
from skthermo.preprocessing.checks._column import LEAST_KNOWN, LOGGED, Column, find_equal_columns
from skthermo.preprocessing.checks._reading import Reading

COLDEST, HOTTEST = -90.0, 100.0  # degrees Celsius that a structure in the open may have
FREEZING, COLD, HOT, DEGREES = 32.0, -60.0, 170.0, 1.8  # in Fahrenheit
KELVIN = (183.0, 373.0)  # the same range in kelvin
FAR = 50.0  # degrees beyond all others, of a value that is none
JUMP = 30.0  # the same, of a value that repeats exactly
WIDEST, WIDE = 180.0, 90.0  # degrees that a thermometer spans in the open, and that it does beside another
SMOOTH = 4.0  # times a step between records, that temperatures span and errors do not
SCALES = (10.0, 100.0, 1000.0)  # tenths, hundredths, thousandths of a degree
SAME, NEAR, APART = 5.0, 15.0, 20.0  # degrees between medians of thermometers: alike, in one unit, and in two
AT_ZERO = 10.0  # degrees Fahrenheit from 32, of a sensor in Fahrenheit where the others are at 0 degrees Celsius
ALIKE = (0.3, 3.0)  # ratio of the spreads of two thermometers
WARM, WARMEST = (45.0, 85.0), 70.0  # medians, and warmest percent, that a bridge has only in degrees Fahrenheit
AGAINST = -0.6  # correlation of a sensor with the others whose sign is wrong
MOST_COMPARED = 1000  # rows
CLIPPED = 3.0  # distances of the quartiles, of values that correlations are calculated from


def look_at_temperatures(T: Reading) -> None:
    """Put aside what no thermometer in the open shows, and name columns in another unit."""
    varying = []
    for name, places in columns_by_sensor(T).items():  # lags repeat what a sensor shows
        column = Column(T, places[0], name)
        if _is_kelvin(column):
            column.found("kelvin", column.levels, column.span)
            continue
        _put_no_temperatures_aside(column)
        if not column.is_poor():
            varying.append(column)
    find_equal_columns(T)
    _compare_sensors(varying)


def _is_kelvin(column: Column) -> bool:
    levels = column.levels
    return bool(len(levels) and levels[0] > KELVIN[0] and levels[-1] < KELVIN[1])


def _put_no_temperatures_aside(column: Column) -> None:
    """Values far beyond all others and beyond what the open has, then levels that repeat exactly, far from others."""
    levels = column.levels
    if len(levels) and (levels[0] < COLDEST or levels[-1] > HOTTEST):
        gap = np.diff(levels) > FAR
        above = np.append(False, np.logical_or.accumulate(gap & (levels[1:] > HOTTEST)))
        below = np.append(np.logical_or.accumulate((gap & (levels[:-1] < COLDEST))[::-1])[::-1], False)
        beyond = (levels < COLDEST) | (levels > HOTTEST)
        logged = LOGGED if column.quantile(0.95) < HOTTEST else ()  # tenths of a degree pass through -99
        is_none = beyond & (above | below | _stand_apart(levels, logged))
        in_kelvin = is_none & (levels > KELVIN[0]) & (levels < KELVIN[1])
        kelvin, others = levels[in_kelvin], levels[is_none & ~in_kelvin]
        column.put_aside("kelvin", kelvin)
        column.put_aside("placeholders", others)
    column.put_aside("isolated-level", column.isolated_levels(JUMP))
    column.put_aside("another-level", column.levels_apart())


def _stand_apart(levels: Array, some: tuple[float, ...]) -> NDArray[np.bool_]:
    """Which levels are some of these, and not near to another one."""
    gaps = np.concatenate([[np.inf], np.diff(levels), [np.inf]])
    return np.isin(levels, some) & (np.minimum(gaps[1:], gaps[:-1]) > JUMP)


def _compare_sensors(columns: list[Column]) -> None:
    """Name sensors in another unit, or with another sign, than the others or than degrees Celsius."""
    mirrored = _opposite_signs(columns)
    columns = [column for column in columns if column not in mirrored]
    if not columns or len(mirrored) == 1 == len(columns):
        return
    middles, warmest = (np.array([column.quantile(share) for column in columns]) for share in (0.5, 0.99))
    is_warm = WARM[0] < np.median(middles) < WARM[1] or np.median(middles) < WARM[0] < WARMEST < np.median(warmest)
    ends = [column.levels[[0, -1]] for column in columns]
    if is_warm and middles.min() > FREEZING / 2 and np.min(ends) > COLD and np.max(ends) < HOT:
        for column in columns:
            column.found("fahrenheit", column.levels, column.span)
        return
    beside = _common_quantiles(columns)
    others = [column for place, column in enumerate(columns) if not _is_in_another_unit(column, place, beside)]
    fine = [column for column in others if not _is_scaled(column)]
    for column in fine:
        if len(others) > 2 * len(fine):
            column.found("scaled-temperatures", column.levels, f"{column.span}, beside others in such a unit,")
        else:
            beyond = (column.levels < COLDEST) | (column.levels > HOTTEST)
            column.put_aside("implausible-values", column.levels[beyond])


def _common_quantiles(columns: list[Column]) -> Array:
    """5th, 50th and 95th percentile of each sensor, (3, n_sensors), in rows in which all have a value; NaN without."""
    values = _side_by_side(columns)
    known = np.flatnonzero(~np.isnan(values).any(axis=1))
    if len(known) < LEAST_KNOWN or len(columns) < 2:
        return np.full((3, len(columns)), np.nan)
    return np.quantile(values[spread_evenly(known, MOST_COMPARED)], [0.05, 0.5, 0.95], axis=0)


def _side_by_side(columns: list[Column]) -> Array:
    return np.column_stack([column.reading.values[:, column.place] for column in columns])


def _is_scaled(column: Column) -> bool:
    """Whether a column, which spans more than the open does, is in tenths of a degree or less; and say so."""
    ends = column.levels[0], column.levels[-1]
    is_hot = column.quantile(0.95) > HOTTEST or column.quantile(0.05) < COLDEST
    if not is_hot and ends[1] - ends[0] < WIDEST:
        return False
    series = column.reading.values[:, column.place]
    series = series[~np.isnan(series)]
    steps = np.abs(np.diff(series))[(series[1:] > HOTTEST) | (series[1:] < COLDEST)]
    for scale in SCALES:
        if ends[0] / scale > COLDEST and ends[1] / scale < HOTTEST:
            is_smooth = column.quantile(0.95) - column.quantile(0.05) > SMOOTH * np.median(steps)
            if is_smooth:
                column.found("scaled-temperatures", column.levels, f"{column.span}, as in degrees times {scale:g},")
            return bool(is_smooth)
    return False


def _is_in_another_unit(column: Column, place: int, quantiles: Array) -> bool:
    """Whether a sensor shows what the others do in degrees Fahrenheit, or in tenths of a degree; and say so."""
    others = np.delete(quantiles, place, axis=1)
    if np.isnan(quantiles).any():
        return False
    low, middle, high = quantiles[:, place]
    centre, spread = np.median(others[1]), np.median(others[2] - others[0])
    ratio = (high - low) / max(spread, 1e-300)
    beside = f"{column.span} with a median of {middle:.4g}, that of the others is {centre:.4g},"
    at_zero = middle - ratio * centre  # where the others are at 0 degrees Celsius
    off = abs((middle - FREEZING) / DEGREES - centre)
    is_apart = middle - centre > APART and off < NEAR and (off < SAME or abs(at_zero - FREEZING) < AT_ZERO)
    is_apart &= column.levels[0] > COLD and column.levels[-1] < HOT
    if is_apart and ALIKE[0] < ratio / DEGREES < ALIKE[1]:
        column.found("fahrenheit", column.levels, beside)
        return True
    is_wide = high - low > WIDE or column.levels[-1] > HOTTEST or column.levels[0] < COLDEST
    if is_wide and abs(middle / SCALES[0] - centre) < NEAR / 2 and ALIKE[0] < ratio / SCALES[0] < ALIKE[1]:
        column.found("scaled-temperatures", column.levels, beside)
        return True
    return False


def _opposite_signs(columns: list[Column]) -> list[Column]:
    """Sensors that fall where the others rise, about at the level of the others with another sign; and say so.

    Of two sensors, either may be the one.
    """
    if len(columns) < 2 or len(columns[0].reading.values) < LEAST_KNOWN:
        return []
    middles = np.array([column.quantile(0.5) for column in columns])
    spreads = np.array([column.quantile(0.75) - column.quantile(0.25) for column in columns])
    standard = np.clip(
        np.nan_to_num((_side_by_side(columns) - middles) / np.where(spreads > 0, spreads, np.inf)), -CLIPPED, CLIPPED
    )
    norms = np.sqrt((standard**2).sum(axis=0))
    correlations = standard.T @ standard / np.maximum(np.outer(norms, norms), 1e-300)
    mirrored = []
    for place, column in enumerate(columns):
        others = np.arange(len(columns)) != place
        centre = np.median(middles[others])
        is_mirrored = abs(middles[place] + centre) < min(NEAR, abs(middles[place] - centre))
        against, among = np.median(correlations[place, others]), np.median(correlations[np.ix_(others, others)])
        if is_mirrored and against < AGAINST and among > -AGAINST:
            partner = f"{columns[1].name!r}" if len(columns) == 2 else "the others"
            whole = column.reading.whole
            detail = f"{column.name!r} and {partner} have a correlation of {against:.2f} in {len(whole)} rows"
            column.reading.found("opposite-signs", column.name, whole, detail)
            mirrored.append(column)
            if len(columns) == 2:
                break
    return mirrored
