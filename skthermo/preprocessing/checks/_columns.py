"""Checks of the columns of one table: values that cannot be, columns without information, other units and signs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from skthermo._core.arrays import Array, median, spread_evenly
from skthermo._core.frames import MISSING_CODES, columns_by_sensor
from skthermo.preprocessing.checks._reading import Reading, texts_of

LOGGED = (*MISSING_CODES, 999.0, 9999.0, 99999.0, 999.9, -999.9, 9999.9, -9999.9, 999.99, 9999.99, 1e20, 1e30, -1e30)
COLDEST, HOTTEST = -90.0, 100.0  # degrees Celsius that a structure in the open may have


def look_at_temperatures(T: Reading) -> None:
    """Put aside values that no thermometer in the open shows, and name columns in another unit or with another sign."""
    varying = []
    for places in columns_by_sensor(T).values():  # lags repeat what a sensor shows
        place = places[0]
        column, known = T.values[:, place], known_of(T, place)
        if known.size and known[0] > COLDEST + 273.15 and known[-1] < HOTTEST + 273.15:
            T.found_in("kelvin", place, span_of(known))
            continue
        wrong = beyond_the_open(column, known) | np.isin(column, isolated_levels(known, 30.0))
        in_kelvin = wrong & (column > COLDEST + 273.15) & (column < HOTTEST + 273.15)
        T.put_aside("kelvin", place, in_kelvin)
        T.put_aside("placeholders", place, wrong)
        known = known_of(T, place, known)
        low, high = usual_range(known, 10.0)  # a structure passes gaps while records are left out
        T.put_aside("another-level", place, (column < low) | (column > high))
        if has_levels(T, place, known_of(T, place, known)):
            varying.append(place)
    find_equal_columns(T)
    for place in in_other_units(T, varying):
        column = T.values[:, place]
        T.put_aside("implausible-values", place, (column < COLDEST) | (column > HOTTEST))


def look_at_responses(F: Reading, *, in_hertz: bool, beside_weather: bool) -> None:
    """Put aside values that are no frequencies, or no responses of another kind.

    Beside the weather, single values far from others are left to the search for exchanged modes and outliers.
    """
    for place in range(len(F.columns)):
        column, known = F.values[:, place], known_of(F, place)
        F.put_aside("placeholders", place, np.isin(column, logged_levels(known)) | (in_hertz & (column <= 0)))
        known = known_of(F, place, known)
        if not has_levels(F, place, known):
            continue
        low, middle, high = known[(np.array([0.1, 0.5, 0.9]) * (len(known) - 1)).astype(int)]
        is_far = (column > 2 * middle) | (column < middle / 2) if in_hertz else ~np.isnan(column)
        if high > low:
            F.put_aside("placeholders", place, is_far & np.isin(column, isolated_levels(known, 3 * (high - low))))
        known = known_of(F, place, known)
        low, high = usual_range(known)
        is_apart = is_far & ((column < low) | (column > high))
        if not beside_weather:
            low, middle, high = known[(np.array([0.25, 0.5, 0.75]) * (len(known) - 1)).astype(int)]
            is_apart |= (high > low) & (np.abs(column - middle) > 20 * 0.74 * (high - low))
        F.put_aside("another-level", place, is_apart)
    find_equal_columns(F)


def known_of(table: Reading, place: int, before: Array | None = None) -> Array:
    """The known values of a column in order, which are those before if none was put aside since."""
    column = table.values[:, place]
    n_known = np.count_nonzero(~np.isnan(column))
    return before if before is not None and len(before) == n_known else np.sort(column)[:n_known]


def span_of(known: Array) -> str:
    """Smallest and largest value as a sentence gives them."""
    return f"lies between {known[0]:.6g} and {known[-1]:.6g}"


def beyond_the_open(column: Array, known: Array) -> NDArray[np.bool_]:
    """Values beyond all temperatures of the open and 50 degrees beyond the others, or, 30 degrees from the others, a
    number that loggers write."""
    gaps, levels = np.diff(known), known[equal_runs(known)[0]]
    above = np.flatnonzero((gaps > 50) & (known[1:] > HOTTEST))
    below = np.flatnonzero((gaps > 50) & (known[:-1] < COLDEST))
    wrong = np.zeros(len(column), dtype=bool)
    if above.size:
        wrong |= column > known[above[0]]
    if below.size:
        wrong |= column < known[below[-1] + 1]
    for value in levels[np.isin(levels, LOGGED)]:
        others = known[known != value]
        is_lonely = not others.size or np.abs(others - value).min() > 30  # tenths of a degree pass through -99
        if not COLDEST <= value <= HOTTEST and is_lonely and known[int(0.95 * (len(known) - 1))] < HOTTEST:
            wrong |= column == value
    return wrong


def logged_levels(known: Array) -> Array:
    """Numbers that loggers write for a missing response, far from all others."""
    logged, counts = np.unique(known[np.isin(known, LOGGED)], return_counts=True)
    rest = known[~np.isin(known, LOGGED)]
    if logged.size and rest.size:
        low, middle, high = rest[(np.array([0.1, 0.5, 0.9]) * (len(rest) - 1)).astype(int)]
        return logged[((counts > 1) | (logged < 0)) & (np.abs(logged - middle) > 3 * (high - low))]
    return logged


def isolated_levels(known: Array, jump: float) -> Array:
    """At most three values at either end that repeat exactly, farther from all others than a jump."""
    first, counts = equal_runs(known)
    levels = known[first]
    isolated, gaps = np.zeros(len(levels), dtype=bool), np.diff(levels) > jump
    for number in (1, 2, 3) if len(levels) > 8 else ():
        isolated[:number] |= gaps[number - 1] & (counts[:number] > 1).all()
        isolated[-number:] |= gaps[-number] & (counts[-number:] > 1).all()
    return levels[isolated]


def usual_range(known: Array, least: float = 0.0) -> tuple[float, float]:
    """Lowest and highest of the values in order that are not at another level.

    Another level begins where, beyond the narrowest 40 % of the values, the distance from their middle at least doubles
    from one value to the next, to eight standard deviations or more, by a gap of five and of ``least``. The narrowest
    40 % of normal values span 1.049 standard deviations. Where they are equal, or fewer than 50 values are known, no
    value is at another level.
    """
    n_usual = int(0.4 * len(known))
    if len(known) < 50:
        return -np.inf, np.inf
    widths = known[n_usual:] - known[: len(known) - n_usual]
    first = int(widths.argmin())
    middle, scatter = known[first : first + n_usual + 1].mean(), widths[first] / 1.049
    distances, gaps = np.abs(known - middle), np.diff(known)
    inner, outer = np.sort([distances[:-1], distances[1:]], axis=0)
    ends = np.flatnonzero((gaps >= np.maximum(inner, max(least, 5 * scatter))) & (outer >= 8 * scatter) & (scatter > 0))
    below, above = ends[ends < first], ends[ends >= first + n_usual]
    return known[below[-1] + 1] if below.size else -np.inf, known[above[0]] if above.size else np.inf


def has_levels(table: Reading, place: int, known: Array) -> bool:
    """Whether a column has more than one value; name it where it has few, one or none."""
    levels, n_known = known[equal_runs(known)[0]], len(known)
    is_coarse = len(levels) <= 4 and n_known >= 50
    if not n_known:
        name = table.columns[place]
        if not any(found.column == name for found in table.findings):
            rows = np.ones(len(table.values), dtype=bool)
            table.found("missing-column", name, rows, f"{name!r} is NaN in all {len(rows)} rows")
    elif len(levels) == 1 < n_known:
        table.found_in("constant", place, f"is {levels[0]:.6g}{table.unit}")
    elif is_coarse:
        table.found_in("few-values", place, f"has the {len(levels)} values {texts_of(levels)}{table.unit}")
    if len(levels) < 2 or is_coarse:
        table.useless.add(place)
    return len(levels) > 1


def contents_of(table: Reading) -> list[tuple[Any, bytes]]:
    """Name and bytes of each column that varies."""
    found = []
    for name, column in zip(table.columns, table.values.T, strict=True):
        if np.fmax.reduce(column) > np.fmin.reduce(column):
            found.append((name, column.tobytes()))
    return found


def find_equal_columns(table: Reading) -> None:
    """Name columns that are copies of another one."""
    seen: dict[bytes, Any] = {}
    everywhere = np.ones(len(table.values), dtype=bool)
    for name, content in contents_of(table):
        if content in seen:
            detail = f"{name!r} equals {seen[content]!r} in {len(everywhere)} rows"
            table.found("equal-columns", name, everywhere, detail)
        seen.setdefault(content, name)


def in_other_units(T: Reading, places: list[int]) -> list[int]:
    """Name sensors in degrees Fahrenheit, in parts of a degree or with another sign; the places of the others."""
    mirrored = opposite_signs(T, places)
    fine = [place for place in places if place not in mirrored]
    if not fine or len(mirrored) == 1 == len(fine):
        return []
    values = T.values[:, fine]
    lowest, middles, warmest, highest = np.nanquantile(values, [0, 0.5, 0.99, 1], axis=0)
    typical = np.median(middles)  # a bridge has 45 to 85, or a warmest percent of 70, in degrees Fahrenheit only
    is_warm = 45 < typical < 85 or (typical < 45 and np.median(warmest) > 70)
    if is_warm and middles.min() > 16 and lowest.min() > -60 and highest.max() < 170:
        for place in fine:
            T.found_in("unit-of-temperatures", place, f"{span_of(known_of(T, place))}, as in degrees Fahrenheit,")
        return []
    together = np.flatnonzero(~np.isnan(values).any(axis=1))
    if len(fine) > 1 and len(together) >= 50:
        quantiles = np.quantile(values[spread_evenly(together, 1000)], [0.05, 0.5, 0.95], axis=0)
        for number, place in enumerate(list(fine)):
            unit = unit_beside(quantiles, number, lowest[number], highest[number])
            if unit:
                T.found_in("unit-of-temperatures", place, f"{span_of(known_of(T, place))}, as in {unit},")
                fine.remove(place)
    in_degrees = [place for place in fine if not in_parts_of_a_degree(T, place)]
    for place in in_degrees if len(fine) > 2 * len(in_degrees) else ():
        T.found_in("unit-of-temperatures", place, f"{span_of(known_of(T, place))}, beside others in such a unit,")
    return [] if len(fine) > 2 * len(in_degrees) else in_degrees


def opposite_signs(T: Reading, places: list[int]) -> list[int]:
    """Sensors that fall where the others rise, about at the level of the others with another sign; and name them.

    Of two sensors, either may be the one.
    """
    if len(places) < 2 or len(T.values) < 50:
        return []
    values = T.values[:, places]
    lows, middles, highs = np.nanquantile(values, [0.25, 0.5, 0.75], axis=0)
    standard = np.clip(np.nan_to_num((values - middles) / np.where(highs > lows, highs - lows, np.inf)), -3, 3)
    norms = np.maximum(np.sqrt((standard**2).sum(axis=0)), 1e-150)
    correlations = standard.T @ standard / np.outer(norms, norms)
    mirrored = []
    for number, place in enumerate(places if correlations.min() < -0.6 else ()):
        others = np.arange(len(places)) != number
        centre = np.median(middles[others])
        is_mirrored = abs(middles[number] + centre) < min(15, abs(middles[number] - centre))
        against, among = np.median(correlations[number, others]), np.median(correlations[np.ix_(others, others)])
        if is_mirrored and against < -0.6 and among > 0.6 and not (mirrored and len(places) == 2):
            partner = "the others" if len(places) > 2 else repr(T.columns[places[1]])
            T.found_in("unit-of-temperatures", place, f"and {partner} have a correlation of {against:.2f}")
            mirrored.append(place)
    return mirrored


def unit_beside(quantiles: Array, number: int, lowest: float, highest: float) -> str:
    """Unit in which a sensor shows the others' temperatures, where it is no degree Celsius.

    ``quantiles`` are the 5th, 50th and 95th percentile of each sensor, (3, n_sensors), in rows where all have a value.
    """
    low, middle, high = quantiles[:, number]
    others = np.delete(quantiles, number, axis=1)
    centre, spread = np.median(others[1]), np.median(others[2] - others[0])
    ratio, off = (high - low) / max(spread, 1e-300), abs((middle - 32) / 1.8 - centre)
    at_zero = middle - ratio * centre  # where the others are at 0 degrees Celsius
    is_fahrenheit = middle - centre > 20 and off < 15 and (off < 5 or abs(at_zero - 32) < 10)
    if is_fahrenheit and lowest > -60 and highest < 170 and 0.3 < ratio / 1.8 < 3:
        return "degrees Fahrenheit beside the others"
    is_wide = high - low > 90 or highest > HOTTEST or lowest < COLDEST
    if is_wide and abs(middle / 10 - centre) < 7.5 and 0.3 < ratio / 10 < 3:
        return "tenths of a degree beside the others"
    return ""


def in_parts_of_a_degree(T: Reading, place: int) -> bool:
    """Whether a column spans more than the open does, smoothly, as in tenths of a degree or less; and name it."""
    known, column = known_of(T, place), T.values[:, place]
    low, high = known[int(0.05 * (len(known) - 1))], known[int(0.95 * (len(known) - 1))]
    if high <= HOTTEST and low >= COLDEST and known[-1] - known[0] < 180:
        return False
    series = column[~np.isnan(column)]
    steps = np.abs(np.diff(series))[(series[1:] > HOTTEST) | (series[1:] < COLDEST)]
    for scale in (10.0, 100.0, 1000.0):
        if known[0] / scale > COLDEST and known[-1] / scale < HOTTEST:
            is_smooth = bool(high - low > 4 * np.median(steps))  # of temperatures, not of errors
            if is_smooth:
                T.found_in("unit-of-temperatures", place, f"{span_of(known)}, as in degrees times {scale:g},")
            return is_smooth
    return False


def put_stuck_aside(table: Reading) -> None:
    """Put aside the runs in which a column only repeats a value; a column that begins as another one is its lag."""
    for place, column in enumerate(table.values.T):
        rows = np.flatnonzero(~np.isnan(column))
        values = column[rows]
        first, lengths = equal_runs(values)
        if place in table.useless or len(values) < 20 or lengths.max() < 5 or len(lengths) < 3:
            continue
        longest = np.argsort(-lengths, kind="stable")[:20]
        for run in np.sort(longest[lengths[longest] >= 5]):
            stuck = rows[first[run] : first[run] + lengths[run]]
            is_lag = stuck[0] == 0 and np.count_nonzero(table.values[0] == column[0]) > 1
            if (
                not is_lag
                and is_outstanding(values[first], lengths, run)
                and others_vary(values, lengths, lengths[run])
            ):
                wrong = np.zeros(len(column), dtype=bool)
                wrong[stuck] = True
                table.put_aside("stuck", place, wrong)


def equal_runs(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First place and length of each run of equal values; without NaN."""
    first = np.flatnonzero(np.append(True, values[1:] != values[:-1])[: len(values)])
    return first, np.diff(np.append(first, len(values)))


def is_outstanding(levels: Array, lengths: NDArray[np.intp], run: np.intp) -> bool:
    """Whether a run is four times as long as a usual one by rounding, and as a usual one at its value.

    The usual run is the fourth longest. Chance would give less than a hundredth of such a run in the whole column.
    Rain, and the sun at night, are zero again and again.
    """
    length, n_values = lengths[run], lengths.sum()
    rounded = lengths[(lengths > 1) & (lengths < 5)]
    same = np.sort(lengths[levels == levels[run]])[::-1]
    if len(same) > 3 and length < 4 * same[3]:
        return False
    if rounded.size and len(lengths) > 3:
        share = (rounded - 1).sum() / n_values
        return bool(length >= 4 * np.sort(lengths)[-4] and n_values * share ** (length - 1) <= 0.01)
    return True


def others_vary(values: Array, lengths: NDArray[np.intp], length: int) -> bool:
    """Whether 95 % of the other periods of a run's length vary by at least three steps of rounding."""
    as_long = np.repeat(lengths >= length, lengths)
    if 2 * length >= len(values) or np.count_nonzero(as_long) > len(values) / 2:
        return bool(2 * length >= len(values))
    steps = np.abs(np.diff(values))
    windows, size = slice(0, len(values) - length + 1), {"size": int(length), "origin": -(int(length) // 2)}
    ranges = (maximum_filter1d(values, **size) - minimum_filter1d(values, **size))[windows]
    elsewhere = ~maximum_filter1d(as_long, **size)[windows]
    least = 3 * steps[steps > 0].min() * (1 - 1e-9)
    return bool(elsewhere.any() and np.quantile(ranges[elsewhere], 0.05) >= least)


def compare_with_model(F: Reading, model: Any) -> None:
    """Name frequencies in another unit than a model's nominal ones, and frequencies of another mode."""
    nominal = np.ravel(model.frequencies(np.ones((1, len(model.parameter_names)))))
    everywhere = np.ones(len(F.values), dtype=bool)
    if len(nominal) != len(F.columns):
        F.found("unit-of-frequencies", "", everywhere, f"{len(F.columns)} columns for {len(nominal)} modes")
        return
    middles = median(F.values)
    units = {"rad/s": 2 * np.pi, "kHz": 1e-3, "mHz": 1e3, "cycles per minute": 60.0}  # how many of them are 1 Hz
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = np.array([nominal, *np.outer([*units.values()], nominal), 1 / nominal])
        off = np.abs(np.log(middles / expected))
    if np.isnan(off[0]).all():
        return
    names = ["Hz", *units, "seconds, the periods"]
    typical = np.nanmedian(off, axis=1)
    best = 1 + int(np.argmin(typical[1:]))
    if typical[best] < 0.2 and typical[0] > 0.5:
        detail = f"the medians {texts_of(middles)} beside {texts_of(nominal)} Hz of the model are about those in"
        F.found("unit-of-frequencies", "", everywhere, f"{detail} {names[best]}; {len(everywhere)} rows")
        return
    for place in np.flatnonzero(off[0] > 0.5):
        fits = np.flatnonzero(off[1:, place] < 0.2)
        hint = f", as in {names[1 + fits[0]]}," if len(fits) else ""
        F.found_in(
            "unit-of-a-mode", place, f"has the median {middles[place]:.4g}, the model {nominal[place]:.4g} Hz{hint}"
        )
