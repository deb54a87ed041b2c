"""Checks of frequencies beside the weather: exchanged modes, outliers, temperatures of another time."""

from __future__ import annotations

from itertools import combinations, compress

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

from skthermo._core.arrays import Array, as_floats, means_of_known, median, robust_deviation, spread_evenly
from skthermo._core.frames import Table, column_names, columns_by_sensor, usual_step
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing._weather_lines import WeatherLines, distances_from_neighbours, predicted_by_weather
from skthermo.preprocessing.checks._columns import Reading
from skthermo.preprocessing.checks._record_findings import period_of
from skthermo.preprocessing.folds import BlockedKFold

Rows = NDArray[np.intp]


def look_at_both(T: Reading, F: Reading, *, has_wrong_times: bool) -> NDArray[np.bool_]:
    """Findings of two tables in order of time, added to those of the frequencies, and which frequencies are outliers.

    Each sensor counts with its present value, without lags. Each search passes over the values of earlier findings.
    """
    sensors = [places[0] for places in columns_by_sensor(T).values() if places[0] not in T.useless]
    temperatures, values = T.values[:, sensors], F.values.copy()
    values[:, list(F.useless)] = np.nan
    if np.count_nonzero(~np.isnan(temperatures).all(axis=1) & ~np.isnan(values).all(axis=1)) < 50:
        return find_outliers(F, values, None)
    places, lines = WeatherLines.learned(temperatures).inputs(temperatures)
    is_timed = isinstance(T.index, pd.DatetimeIndex) and not has_wrong_times
    folds = BlockedKFold().fold_of(pd.DataFrame(index=T.index) if is_timed else temperatures)
    hours = max(usual_step(T.index) / pd.Timedelta("1h"), 1e-6) if is_timed else None
    exchange_modes(F, values, lines, folds)
    far = find_outliers(F, values, lines, folds)
    values[far] = np.nan
    compare_times(T, F, values, places, lines, folds, hours)
    return far


def exchange_modes(F: Reading, values: Array, lines: Array, folds: Rows) -> None:
    """Name pairs of modes that the weather explains much better with their values exchanged in some rows, and exchange
    these.

    A row with one value of two counts if the value is far from its own column's prediction and near to the other's.
    """
    found = []
    for both in combinations(range(values.shape[1]), 2):
        pair = values[:, both]
        difference = pair[:, 1] - pair[:, 0]
        known = ~np.isnan(difference)
        least = max(3, 0.002 * np.count_nonzero(known))
        turned = known & (difference * np.sign(np.nansum(np.sign(difference))) < 0)
        if np.count_nonzero(turned) < least:
            continue
        ordered = np.where(known[:, np.newaxis], np.where(turned[:, np.newaxis], pair[:, ::-1], pair), np.nan)
        predicted = predicted_by_weather(lines, ordered, folds)
        rest, before = ordered - predicted, np.where(known[:, np.newaxis], pair, np.nan)
        deviation = robust_deviation(rest)
        with np.errstate(invalid="ignore"):
            is_near = (np.abs(rest) < 5 * deviation).all(axis=1)
            is_far = np.abs(pair - predicted) > 5 * deviation
            is_near_to_other = np.abs(pair - predicted[:, ::-1]) < 5 * deviation[::-1]
        exchanged = turned & is_near & is_far.any(axis=1)
        if np.count_nonzero(exchanged) < least:
            continue
        before = before[is_near] - predicted_by_weather(lines[is_near], before[is_near], folds[is_near], trim=False)
        ratio = np.nanmean(rest[is_near] ** 2, axis=0) / np.nanmean(before**2, axis=0)
        if np.sqrt(ratio.prod()) < 0.5:
            alone = (is_far & is_near_to_other).any(axis=1) & (np.isnan(pair).sum(axis=1) == 1)
            found.append((both, np.count_nonzero(known), exchanged | alone))
    for both, n_known, rows in found:
        names = f"{F.columns[both[0]]!r} and {F.columns[both[1]]!r}"
        F.found("mode-order", names, rows, f"{names} look exchanged in {np.count_nonzero(rows)} of {n_known} rows")
        values[np.ix_(rows, both)] = values[np.ix_(rows, both[::-1])]


def find_outliers(F: Reading, values: Array, lines: Array | None, folds: Rows | None = None) -> NDArray[np.bool_]:
    """Values far from their neighbours and from a regression on the weather; and name their modes.

    Without weather, only values of twice or half the median of their mode are doubtful.
    """
    middle, deviation = median(values), robust_deviation(values)
    with np.errstate(invalid="ignore"):
        far = ((2 * middle < values) | (middle / 2 > values)) & (middle > 0) & (np.abs(values - middle) > 8 * deviation)
        if lines is not None:
            has_weather, floor = ~np.isnan(lines).any(axis=1)[:, np.newaxis], 0.1 * deviation
            rest = values - np.where(has_weather, predicted_by_weather(lines, values, folds), middle)
            scatter = np.fmax(robust_deviation(rest), floor)
            far = (np.abs(rest - median(rest)) > 8 * scatter) & (scatter > 0) & (has_weather | far)
            doubtful = np.flatnonzero(far.any(axis=0))
            if doubtful.size:
                distances, local = distances_from_neighbours(rest[:, doubtful], np.arange(len(rest)), 25)
                usual = np.fmax(robust_deviation(distances), floor[doubtful])
                far[:, doubtful] &= np.abs(distances) > 8 * np.fmax(local, usual)
    for place in np.flatnonzero(far.any(axis=0)):
        first, name = np.flatnonzero(far[:, place])[:1], F.columns[place]
        n_known = np.count_nonzero(~np.isnan(values[:, place]))
        detail = (
            f"{name!r} in {np.count_nonzero(far[:, place])} of {n_known} rows, the first "
            f"{values[first[0], place]:.4g}{F.unit} in {period_of(F.index, first)}"
        )
        F.found("doubtful-values", name, far[:, place], detail, period=False)
    return far


def compare_times(
    T: Reading, F: Reading, values: Array, places: Array, lines: Array, folds: Rows, hours: float | None
) -> None:
    """Name temperatures that explain nothing, or clearly less than temperatures of other rows do.

    A structure may follow the weather of up to a day before, or its means. Temperatures of other rows have to explain
    more in four parts of the records, too, so that a change of the structure does not look like the season of another
    time.
    """
    n_rows, inertia, past = len(values), 24 if hours is None else max(int(24 / hours), 1), pd.DataFrame(places)
    means = [past.rolling(length, min_periods=1).mean() for length in (6, 24, 168) if 10 * length <= n_rows]
    inputs = np.hstack([lines, *(table.fillna(0.0) for table in (past.shift(fill_value=0.0), *means))])

    def left(columns: Array, shift: int, own: int, n_parts: int = 1) -> Array:
        """Share of the variance of modes that is left by temperatures of ``own`` rows before, where both are there."""
        rows = spread_evenly(np.arange(max(shift, 0), n_rows + min(shift, 0)), 4000)
        return unexplained(columns[rows - own], values[rows], folds[rows], n_parts)

    shares = {}
    for shift in (0, *proposed_shifts(places, values, inertia)):
        of_modes = left(lines, shift, shift)
        if not of_modes.size:
            return
        shares[shift] = of_modes.mean()
    shift = min(shares, key=lambda one: shares[one])
    own, other = ([left(inputs, shift, rows, n_parts) for n_parts in (4, 1)] for rows in (0, shift))
    if not all(share.size for share in (*own, *other)):
        return
    in_parts, whole = (np.log(np.maximum(there, 1e-300) / here).mean() for here, there in zip(own, other, strict=True))
    explained, without = 1 - other[1].mean(), 1 - own[1].mean()
    # means of the past may follow a season by chance
    if in_parts < 0 and whole < np.log(0.9) and explained > max(0.1, without + 0.01) and shares[shift] < 0.95:
        late = "" if hours is None else abs(shift) * hours
        length = late and (f" (about {late:.3g} hours)" if late < 48 else f" (about {late / 24:.3g} days)")
        detail = (
            f"temperatures of {abs(shift)} rows {'before' if shift > 0 else 'after'}{length} explain {explained:.0%} "
            f"of the variance in periods held out, those of the same rows {max(without, 0.0):.0%}"
        )
        is_there = (np.arange(n_rows) >= shift) & (np.arange(n_rows) < n_rows + shift)
        F.found("different-rows", "", is_there, detail, period=False)
        return
    least = min(left(lines, 0, 0, n_parts).min(initial=1.0) for n_parts in (1, 4))
    if least > 0.98 and np.isnan(T.values[~np.isnan(T.before)]).mean() < 0.01:
        usable = ~np.isnan(values).all(axis=1) & ~np.isnan(places).any(axis=1)
        detail = (
            f"temperatures explain at most {max(1 - least, 0.0):.1%} of the variance of a mode, in periods held out, "
            f"in {np.count_nonzero(usable)} rows"
        )
        F.found("different-rows", "", usable, detail, period=False)


def unexplained(inputs: Array, values: Array, folds: Rows, n_parts: int = 1) -> Array:
    """Share of the variance of each mode that inputs do not explain out of fold, (n_modes,): the median of parts of the
    records, each by itself, with at least a hundred rows; modes without a value in a part are left out."""
    values = np.where(np.isnan(inputs).any(axis=1)[:, np.newaxis], np.nan, values)
    n_parts = min(max(len(values) // 100, 1), n_parts)
    shares = np.empty((n_parts, values.shape[1]))
    for own, rows in zip(shares, np.array_split(np.arange(len(values)), n_parts), strict=True):
        left = values[rows] - predicted_by_weather(inputs[rows], values[rows], folds[rows], trim=False)
        whole = means_of_known((values[rows] - means_of_known(values[rows])) ** 2)
        own[:] = means_of_known(left**2) / np.where(whole > 0, whole, np.nan)
    return np.median(shares[:, ~np.isnan(shares).any(axis=0)], axis=0)


def proposed_shifts(places: Array, values: Array, inertia: int) -> list[int]:
    """Shifts at which coordinates of the weather and frequencies, or their changes from one day to the next, are most
    correlated, up to a quarter of the records."""
    n_rows, found = len(places), set()
    farthest = n_rows // 4
    for length in (0, 1, inertia):
        spectra = []
        for table in map(pd.DataFrame, (places, values)):
            changes = table.rolling(length, min_periods=1).mean().diff(length) if length else table
            standard = ((changes - changes.mean()) / changes.std()).clip(-5, 5).fillna(0.0)
            spectra.append(rfft(standard.to_numpy(np.float32).T, 2 * n_rows))
        strength = sum((irfft(spectra[1] * weather.conj(), 2 * n_rows) ** 2).sum(axis=0) for weather in spectra[0])
        strength = np.concatenate([strength[-farthest:], strength[: farthest + 1]])
        strength[farthest - 1 : farthest + inertia + 1] = 0
        found.update((np.argsort(strength)[-6:] - farthest).tolist())
    return sorted(found)


def looks_exchanged(temperatures: Array, frequencies: Array) -> bool:
    """Whether temperatures are frequencies: most vary by far less, relative to their median, than the frequencies."""
    T, F = TypicalColumns(temperatures, "T"), TypicalColumns(frequencies, "f")
    vary = [columns.variation[columns.deviation > 0] for columns in (T, F)]
    if min(map(len, (temperatures, frequencies))) < 50 or not all(map(len, vary)):
        return False
    return bool(np.median(vary[0]) < min(0.075, np.median(vary[1]) / 4))


def misplaced_columns(temperatures: Table, frequencies: Table) -> list[RecordsWarning]:
    """The finding of temperatures that behave like frequencies, and of frequencies that behave like temperatures.

    Frequencies are positive, vary by a few percent of their median, at most 15, and rise or fall together (rank
    correlation beyond .1 and three standard errors). Temperatures in degrees Celsius vary five times as much, and are
    nearly equal (rank correlation above .6).
    """
    if len(temperatures) < 30:
        return []
    T, F = TypicalColumns(temperatures, "T"), TypicalColumns(frequencies, "f")
    steady = F.variation[F.variation <= 0.15]
    usual = np.median(steady) if len(steady) else np.min(T.variation, initial=0.15)
    is_temperature = (F.variation >= 5.0 * usual) & (len(steady) > 0 or (T.variation <= 0.15).any())
    is_mode = T.variation <= np.minimum(3.0 * F.variation[~is_temperature].max(initial=0.0), 0.15)
    is_mode &= (T.median >= np.nanmin(F.median) / 10) & (T.median <= np.nanmax(F.median) * 10)
    if not is_mode.any() and not is_temperature.any():
        return []
    ranks = pd.DataFrame(np.hstack([T.values, F.values])).corr("spearman", min_periods=30).fillna(0).to_numpy()
    among, across = np.hsplit(ranks[: len(T.names)], [len(T.names)])
    together = means_of_known(np.abs(across[:, ~is_temperature]), axis=1)
    least = np.maximum(among[:, ~is_mode].max(axis=1, initial=-1.0), max(0.1, 3 / np.sqrt(len(T.values))))
    is_mode &= together > least
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = T.deviation[:, np.newaxis] / F.deviation
    is_alike = (np.abs(T.median[:, np.newaxis] - F.median) <= 20) & (ratio >= 1 / 3) & (ratio <= 3)
    is_temperature &= ((across > 0.6) & is_alike)[~is_mode].any(axis=0)
    found = []
    if is_mode.any():
        found.append(
            f"the columns {[*compress(T.names, is_mode)]} behave like frequencies: they vary as little as the modes, "
            "and with them. A mode that predicts the others hides damage"
        )
    if is_temperature.any():
        found.append(
            f"the targets {[*compress(F.names, is_temperature)]} behave like temperatures: they vary by far more than "
            "the modes, and are nearly equal to other temperatures. A detector would evaluate the weather"
        )
    text = f"{', and '.join(found)}. Put all modes, and nothing else, among the targets"
    return [RecordsWarning(text, "exchanged-tables")] if found else []


class TypicalColumns:
    """Columns of a table, of rows evenly spread, with their robust statistics."""

    def __init__(self, table: Table, default: str):
        values = as_floats(table)[spread_evenly(np.arange(len(table)), 2000)]
        self.values, self.names = values, column_names(table, default)
        self.median, self.deviation = median(values), robust_deviation(values)
        positive = (np.fmin.reduce(values) > 0) & (self.deviation > 0)
        self.variation = np.divide(self.deviation, self.median, out=np.full(values.shape[1], np.inf), where=positive)
