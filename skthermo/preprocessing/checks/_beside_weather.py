"""Checks of frequencies beside the weather: exchanged modes, outliers, temperatures of another time."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd
import scipy.fft
from numpy.typing import NDArray

from skthermo._core.arrays import NORMAL, Array, means_of_known, median, range_sums, robust_deviation, spread_evenly
from skthermo._core.frames import columns_by_sensor
from skthermo.preprocessing._weather_lines import WeatherLines, predicted_by_weather
from skthermo.preprocessing.checks._reading import Reading
from skthermo.preprocessing.checks._record_findings import period_of
from skthermo.preprocessing.folds import BlockedKFold

Rows = NDArray[np.intp]


def look_at_both(T: Reading, F: Reading, *, has_wrong_times: bool) -> NDArray[np.bool_]:
    """Findings of two tables in order of time, added to those of the frequencies, and which frequencies are outliers.

    Each sensor counts with its present value, without lags. Each search passes over the values of earlier findings.
    """
    sensors = []
    for places in columns_by_sensor(T).values():
        if places[0] not in T.useless:
            sensors.append(places[0])
    temperatures, values = T.values[:, sensors], F.values.copy()
    values[:, list(F.useless)] = np.nan
    if np.count_nonzero(~np.isnan(temperatures).all(axis=1) & ~np.isnan(values).all(axis=1)) < 50:
        return find_outliers(F, values, None)
    places, lines = WeatherLines.learned(temperatures).inputs(temperatures)
    hours = None
    if isinstance(T.index, pd.DatetimeIndex) and not has_wrong_times:
        folds = BlockedKFold().fold_of(pd.DataFrame(index=T.index))
        hours = max(float(np.median(np.diff(T.index.as_unit("ns").asi8))) / 3.6e12, 1e-6)
    else:
        folds = BlockedKFold().fold_of(temperatures)
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
        F.found("exchanged-modes", names, rows, f"{names} in {np.count_nonzero(rows)} of {n_known} rows")
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
            some = spread_evenly(np.arange(len(rest)), 4000)
            usual = np.fmax(robust_deviation(beside_neighbours(rest, some)[0]), floor)
            far = (np.abs(rest - median(rest)) > 8 * scatter) & (scatter > 0) & (has_weather | far)
            rows = np.flatnonzero(far.any(axis=1))
            distances, local = beside_neighbours(rest, rows)
            far[rows] &= np.abs(distances) > 8 * np.fmax(local, usual)
    for place in np.flatnonzero(far.any(axis=0)):
        first, name = np.flatnonzero(far[:, place])[:1], F.columns[place]
        n_known = np.count_nonzero(~np.isnan(values[:, place]))
        detail = (
            f"{name!r} in {np.count_nonzero(far[:, place])} of {n_known} rows, the first "
            f"{values[first[0], place]:.4g}{F.unit} in {period_of(F.index, first)}"
        )
        F.found("frequency-outliers", name, far[:, place], detail, period=False)
    return far


def beside_neighbours(values: Array, rows: Rows) -> tuple[Array, Array]:
    """Distances of some rows from the median of the 25 rows around, and the standard deviation of these rows, by the
    median of their distances."""
    padded = np.pad(values, ((12, 12), (0, 0)), constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(padded, 25, axis=0)[rows]
    n_known = np.count_nonzero(~np.isnan(around), axis=2)[..., np.newaxis]
    ends = np.maximum(np.concatenate([n_known - 1, n_known], axis=2) // 2, 0)
    middle = np.take_along_axis(np.sort(around, axis=2), ends, axis=2).mean(axis=2)
    distances = np.sort(np.abs(around - middle[..., np.newaxis]), axis=2)
    return values[rows] - middle, NORMAL * np.take_along_axis(distances, ends, axis=2).mean(axis=2)


def compare_times(
    T: Reading, F: Reading, values: Array, places: Array, lines: Array, folds: Rows, hours: float | None
) -> None:
    """Name temperatures that explain nothing, or clearly less than temperatures of other rows do.

    A structure may follow the weather of up to a day before. Temperatures of other rows have to explain more in four
    parts of the records, too, so that a change of the structure does not look like the season of another time.
    """
    inertia = 24 if hours is None else max(int(24 / hours), 1)
    n_rows, left, shift = len(values), {}, 0
    for other in [0, *proposed_shifts(places, values, inertia)]:
        rows = spread_evenly(np.arange(max(other, 0), n_rows + min(other, 0)), 4000)
        left[other] = unexplained(lines[rows - other], values[rows], folds[rows])
        if not left[other].size:
            return
        shift = other if np.mean(left[other]) < np.mean(left[shift]) else shift
    rows = spread_evenly(np.arange(max(shift, 0), n_rows + min(shift, 0)), 4000)
    columns, filled, ratios = [lines, np.roll(np.nan_to_num(places), 1, axis=0)], np.nan_to_num(places), []
    for period in (6, 24, 168):  # means of the weather over more of the past
        if 10 * period <= n_rows:
            ends = np.arange(1, n_rows + 1)
            starts = np.maximum(ends - period, 0)
            columns.append(range_sums(filled, starts, ends) / (ends - starts)[:, np.newaxis])
    inputs = np.hstack(columns)
    for n_parts in (4, 1):
        own = unexplained(inputs[rows], values[rows], folds[rows], n_parts)
        other = unexplained(inputs[rows - shift], values[rows], folds[rows], n_parts)
        ratios.append(np.exp(np.mean(np.log(np.maximum(other, 1e-300) / own))))
    own, other = np.mean(own), np.mean(other)
    is_better = ratios[0] < 1 and ratios[1] < 0.9 and 1 - other > max(0.1, 1 - own + 0.01)
    if is_better and np.mean(left[shift]) < 0.95:  # means of the past may follow a season by chance
        length = ""
        if hours is not None:
            late = abs(shift) * hours
            length = f" (about {late:.3g} hours)" if late < 48 else f" (about {late / 24:.3g} days)"
        detail = (
            f"those of {abs(shift)} rows {'before' if shift > 0 else 'after'}{length} explain {1 - other:.0%} of the "
            f"variance in periods held out, those of the same rows {max(1 - own, 0.0):.0%}"
        )
        is_there = (np.arange(n_rows) >= shift) & (np.arange(n_rows) < n_rows + shift)
        F.found("time-shift", "", is_there, detail, period=False)
        return
    rows = spread_evenly(np.arange(n_rows), 4000)
    least = min(left[0].min(), unexplained(lines[rows], values[rows], folds[rows], 4).min(initial=1.0))
    if least > 0.98 and np.isnan(T.values[~np.isnan(T.before)]).mean() < 0.01:
        usable = ~np.isnan(values).all(axis=1) & ~np.isnan(places).any(axis=1)
        detail = f"at most {max(1 - least, 0.0):.1%} of the variance of a mode, in periods held out"
        F.found("no-thermal-effect", "", usable, f"{detail}, in {np.count_nonzero(usable)} rows", period=False)


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
        if 2 * length > n_rows:
            continue
        spectra = []
        for table in (places, values):
            standard = np.nan_to_num(table - means_of_known(table))
            if length:
                sums = np.cumsum(np.pad(standard, ((1, 0), (0, 0))), axis=0)
                standard = sums[2 * length :] - 2 * sums[length:-length] + sums[: -2 * length]
            deviations = standard.std(axis=0)
            standard = np.clip(standard / np.where(deviations > 0, deviations, np.inf), -5, 5)
            spectra.append(scipy.fft.rfft(standard.astype(np.float32).T, 2 * n_rows))
        strength = np.zeros(2 * n_rows)
        for weather in spectra[0]:
            strength += (scipy.fft.irfft(spectra[1] * weather.conj(), 2 * n_rows) ** 2).sum(axis=0)
        strength = np.concatenate([strength[-farthest:], strength[: farthest + 1]])
        strength[farthest - 1 : farthest + inertia + 1] = 0
        for _ in range(3):
            peak = int(strength.argmax())
            found.add(peak - farthest)
            strength[max(peak - 2, 0) : peak + 3] = 0
    return sorted(found)
