"""A table of records as numbers, whatever was given: values that cannot be, columns without information, other
units."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import HUGE, Array, as_floats, check_model, median, spread_evenly
from skthermo._core.frames import MISSING_CODES, columns_by_sensor, named_frame, of_a_wrong_clock
from skthermo.preprocessing._quantities import OPEN, TEMPERATURE, kind_of
from skthermo.preprocessing.checks._record_findings import ASIDE_REASONS, RecordFinding

LOGGED = (*MISSING_CODES, 999.0, 9999.0, 99999.0, 999.9, -999.9, 9999.9, -9999.9, 999.99, 9999.99, 1e20, 1e30, -1e30)
COLDEST, HOTTEST = -90.0, 100.0  # degrees Celsius that a structure in the open may have
OTHER_UNITS = (1.8, 32.0, "degrees Fahrenheit"), (10.0, 0.0, "tenths of a degree"), (-1.0, 0.0, "another sign")
"""Units other than degrees Celsius: how many make a degree, the value at 0 degrees, and the name."""


class Reading:
    """A table as numbers in order of time, NaN where a value cannot be a measurement, and its findings.

    An argument that is no table has no column. ``order`` has the positions of the rows in the table that was given,
    ``useless`` the positions of columns with one value, or very few. Sentences write the ``unit`` after a value.
    """

    def __init__(self, table: Any, what: str, unit: str, beside: Any):
        self.given, self.what, self.unit = table, what, " °C" if what == "temperatures" else f" {unit}" if unit else ""
        self.findings: list[RecordFinding] = []
        self.useless: set[int] = set()
        self._aside: list[tuple[str, int, NDArray[np.bool_]]] = []
        self.values, self.columns = np.empty((0, 0)), list[Hashable]()
        is_series = isinstance(table, pd.Series)
        frame = table.to_frame("" if table.name is None else table.name) if is_series else table
        self.is_frame = isinstance(frame, pd.DataFrame)
        self.given_index = self.index = frame.index if self.is_frame else pd.RangeIndex(0)
        reason = self._read_frame(frame) if self.is_frame else self._read_array(table)
        n_rows = len(self.values)
        if not self.is_frame:  # the times of an array are those of the frame beside it
            is_beside = isinstance(beside, pd.DataFrame | pd.Series) and len(beside) == n_rows
            self.given_index, self.index = pd.RangeIndex(n_rows), beside.index if is_beside else pd.RangeIndex(n_rows)
        if reason or (is_series and what == "temperatures"):
            reason = reason or "are a Series, not a DataFrame"
            self.findings.append(RecordFinding("no-table", "", 0, None, None, f"the {what} {reason}", True))
        elif not self.values.size:
            detail = f"the {what} have {n_rows} rows and {self.values.shape[1]} columns"
            self.findings.append(RecordFinding("few-records", "", n_rows, None, None, detail, True))
        self.order = np.arange(n_rows)
        if isinstance(self.index, pd.DatetimeIndex) and not self.index.is_monotonic_increasing:
            self.order = self.order if self.index.hasnans else self.index.argsort(kind="stable")
            self.index, self.values = self.index[self.order], self.values[self.order]
        if isinstance(self.given_index, pd.DatetimeIndex) and len(self.given_index) == n_rows:
            self.values[of_a_wrong_clock(self.given_index)[self.order]] = np.nan
        self.before = self.values.copy()
        with np.errstate(invalid="ignore"):
            too_large = np.abs(self.values) > HUGE
        for place in np.flatnonzero(too_large.any(axis=0)):
            self.put_aside("placeholders", int(place), too_large[:, place])

    def _read_frame(self, frame: pd.DataFrame) -> str:
        """Read a frame, NaN in columns that hold no numbers, and look at its names."""
        names = frame.columns
        self.columns, self.values = list(names), np.full(frame.shape, np.nan)
        for place, name in enumerate(names):
            try:
                self.values[:, place] = np.ravel(as_floats(frame.iloc[:, [place]]))
            except Exception as error:  # objects of users may raise anything
                detail = f"{str(error).partition(';')[0]:.150}"
                self.found("no-table", name, None, detail, period=False, meaningless=True)
        kinds = set(map(type, names))
        problems = [("", f"the {self.what} have tuples such as {names[0]!r}")] if tuple in kinds else []
        if str in kinds and len(kinds) > 1:
            problems.append(("", "some names of columns are text, others are not"))
        for name in names[names.duplicated()].unique():
            problems.append((name, f"{name!r} is the name of {np.sum(names == name)} columns"))
        for name, detail in problems:
            self.found("no-table", name, None, detail, period=False, meaningless=True)
        return ""

    def _read_array(self, table: Any) -> str:
        """Read whatever becomes an array; why it is none, else an empty text."""
        kind = type(table).__name__
        try:
            values, names = np.array(as_floats(table)), list(getattr(table, "columns", ()))
        except Exception as error:  # objects of users may raise anything
            self.given = None
            return f"are a {kind} ({str(error).partition(';')[0]:.150})"
        if values.ndim in (1, 2):
            self.values = values[:, np.newaxis] if values.ndim == 1 else values
            prefix = "T" if self.what == "temperatures" else "f"
            self.columns = names or [f"{prefix}{place + 1}" for place in range(self.values.shape[1])]
        if values.ndim == 2 or (values.ndim == 1 and self.what == "frequencies"):
            return ""
        return f"are a {kind} of shape {values.shape}"

    def found(self, what: str, column: Hashable, rows: NDArray | None, detail: str, **options: bool) -> None:
        """Add a finding in some rows, with options of `RecordFinding.in_rows`."""
        self.findings.append(RecordFinding.in_rows(self.index, what, column, rows, detail, **options))

    def found_in(
        self, what: str, place: int, detail: str, rows: NDArray[np.bool_] | None = None, *, meaningless: bool = False
    ) -> None:
        """Add a finding about a column, by default in all rows in which it has a value."""
        rows = ~np.isnan(self.values[:, place]) if rows is None else rows
        n_rows, n_found, name = len(rows), np.count_nonzero(rows), self.columns[place]
        share = f"{n_rows} rows" if n_found == n_rows else f"{n_found} of {n_rows} rows"
        self.found(what, name, rows, f"{name!r} {detail} in {share}", meaningless=meaningless)

    def put_aside(self, what: str, place: int, wrong: NDArray[np.bool_], *, is_kelvin: bool = False) -> None:
        """Add a finding where values of a column are wrong; these, and single values between them, become NaN."""
        column = self.values[:, place]
        wrong = wrong & ~np.isnan(column)
        if not wrong.any():
            return
        levels = np.unique(column[wrong])
        named = texts_of(levels) if len(levels) <= 3 else f"{levels[0]:.6g} to {levels[-1]:.6g}"
        unit = ", as in kelvin," if is_kelvin else self.unit
        self.found_in(what, place, f"is {named}{unit}", wrong, meaningless=is_kelvin)
        wrong[1:-1] |= wrong[:-2] & wrong[2:]
        self._aside.append((what, place, wrong))
        column[wrong] = np.nan

    def use(self, reasons: Collection[str]) -> None:
        """Use the values that were put aside for these reasons as they were given."""
        self.values = self.before.copy()
        for reason, place, wrong in self._aside:
            if reason not in reasons:
                self.values[wrong, place] = np.nan

    def cleaned(self, *, needs_values: bool = True, needs_change: bool = True) -> tuple[Any, dict[Hashable, str]]:
        """The values as they were given, NaN where some are put aside, and columns that cannot be used, with reasons.

        Most of their values were set aside, or they have no value, or one, where such are needed.
        """
        n_known = np.count_nonzero(~np.isnan(self.before), axis=0)
        n_left = np.count_nonzero(~np.isnan(self.values), axis=0)
        reasons: dict[Hashable, str] = {}
        for place, name in enumerate(self.columns):
            own = [found for found in self.findings if found.column == name]
            aside = [found for found in own if found.what in ASIDE_REASONS]
            useless = [found.detail for found in own if found.is_useless_column]
            n_elsewhere = sum(found.n_rows for found in aside if found.what == "another-level")
            # of two levels, it is not certain which one is right
            if n_left[place] < 0.5 * n_known[place] or n_elsewhere > 0.2 * n_known[place]:
                reasons[name] = "; ".join(found.detail for found in aside)
            elif useless and (needs_change if n_known[place] else needs_values):
                reasons[name] = useless[0]
        values = np.empty_like(self.values)
        values[self.order] = self.values
        return named_frame(self.given, values), reasons


def texts_of(levels: Array) -> str:
    """Numbers as a sentence lists them."""
    return ", ".join(map("{:.6g}".format, levels))


def are_temperatures(T: Reading) -> NDArray[np.bool_]:
    """Which columns hold temperatures: those that a name says to be, and of those that stay open the ones whose values
    can be temperatures. Inputs may be flags, radiation, wind or powers of temperatures too, which have no degrees."""
    found = np.ones(len(T.columns), dtype=bool)
    for place, (name, column) in enumerate(zip(T.columns, T.values.T, strict=True)):
        known, (kind, _) = column[~np.isnan(column) & ~np.isin(column, LOGGED)], kind_of(name)
        if kind != TEMPERATURE and known.size:
            could_be = [((known > COLDEST + zero) & (known < HOTTEST + zero)).mean() for zero in (0.0, 273.15)]
            found[place] = kind == OPEN and max(could_be) > 0.8 and not np.isin(known, (0.0, 1.0)).all()
    return found


def look_at(table: Reading, unit: str, model: Any, *, beside_weather: bool) -> None:
    """Look at temperatures, at other inputs as at responses of any unit, or at responses, each column by itself."""
    are_inputs = table.what == "temperatures"
    are_thermal = are_temperatures(table) if are_inputs else np.zeros(len(table.columns), dtype=bool)
    in_hertz = unit == "Hz" and not are_inputs
    look_at_temperatures(table, np.flatnonzero(are_thermal))
    others = np.flatnonzero(~are_thermal)
    look_at_responses(table, others, in_hertz=in_hertz, beside_weather=beside_weather or are_inputs)
    if in_hertz:
        doubt_unit(table, model)
    put_stuck_aside(table)


def look_at_temperatures(T: Reading, thermal: NDArray[np.intp]) -> None:
    """Put aside values that no thermometer in the open shows, and name columns in another unit or with another sign."""
    varying = []
    for places in columns_by_sensor(T).values():  # lags repeat what a sensor shows
        if places[0] not in thermal:
            continue
        place, column = places[0], T.values[:, places[0]]
        known = np.sort(column[~np.isnan(column)])
        if known.size and known[0] > COLDEST + 273.15 and known[-1] < HOTTEST + 273.15:
            detail = f"lies between {known[0]:.6g} and {known[-1]:.6g}, as in kelvin,"
            T.found_in("wrong-unit", place, detail, meaningless=True)
            continue
        wrong = np.isin(column, marker_levels(known, 30.0, COLDEST, HOTTEST))
        kelvin = wrong & (column > COLDEST + 273.15) & (column < HOTTEST + 273.15)
        T.put_aside("wrong-unit", place, kelvin, is_kelvin=True)
        T.put_aside("placeholders", place, wrong)
        known = np.sort(column[~np.isnan(column)])
        low, high = usual_range(known, 10.0)  # a structure passes gaps while records are left out
        T.put_aside("another-level", place, (column < low) | (column > high))
        if has_levels(T, place, known[(known >= low) & (known <= high)]):
            varying.append(place)
    for place in in_degrees(T, varying):
        T.put_aside("implausible-values", place, (T.values[:, place] < COLDEST) | (T.values[:, place] > HOTTEST))


def look_at_responses(F: Reading, places: NDArray[np.intp], *, in_hertz: bool, beside_weather: bool) -> None:
    """Put aside values of some columns that are no frequencies, or no responses of another kind.

    Beside the weather, single values far from others are left to the search for exchanged modes and outliers.
    """
    for place in places.tolist():
        column = F.values[:, place]
        known = np.sort(column[~np.isnan(column)])
        rest = known[~np.isin(known, LOGGED) & ((known > 0) | (not in_hertz))]
        low, middle, high = np.quantile(rest, [0.1, 0.5, 0.9]) if rest.size else (0.0, 0.0, 0.0)
        levels = marker_levels(known, 3 * (high - low)) if high > low or not rest.size else known[:0]
        is_apart = (column > 2 * middle) | (column < middle / 2) if in_hertz else np.ones(len(column), dtype=bool)
        wrong = np.isin(column, levels) & (is_apart | np.isin(column, LOGGED)) | (in_hertz & (column <= 0))
        F.put_aside("placeholders", place, wrong)
        known = np.sort(column[~np.isnan(column)])
        if not has_levels(F, place, known):
            continue
        low, high = usual_range(known)
        is_far = is_apart & ((column < low) | (column > high))
        if not beside_weather:
            low, middle, high = np.quantile(known, [0.25, 0.5, 0.75])
            is_far |= (high > low) & (np.abs(column - middle) > 20 * 0.74 * (high - low))
        F.put_aside("another-level", place, is_far)


def marker_levels(known: Array, jump: float, coldest: float = -np.inf, hottest: float = np.inf) -> Array:
    """Values among those in order that stand for missing ones.

    These are numbers that loggers write, once if negative, farther than a jump from all others; at most three values at
    either end that repeat exactly, farther than a jump from the next; and values beyond the coldest and the hottest
    possible, 50 away from the next.
    """
    first, counts = equal_runs(known)
    levels = known[first]
    gaps, is_logged, marked = np.diff(levels), np.isin(levels, LOGGED), np.zeros(len(levels), dtype=bool)
    for place in np.flatnonzero(is_logged & ((counts > 1) | (levels < 0))):
        marked[place] = np.abs(levels[~is_logged] - levels[place]).min(initial=np.inf) > jump
    for number in (1, 2, 3) if len(levels) > 8 else ():
        marked[:number] |= (gaps[number - 1] > jump) & (counts[:number] > 1).all()
        marked[-number:] |= (gaps[-number] > jump) & (counts[-number:] > 1).all()
    is_far = gaps > 50
    marked[1:] |= np.logical_or.accumulate(is_far & (levels[1:] > hottest))
    marked[:-1] |= np.logical_or.accumulate((is_far & (levels[:-1] < coldest))[::-1])[::-1]
    return levels[marked]


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
    inner, outer = np.minimum(distances[:-1], distances[1:]), np.maximum(distances[:-1], distances[1:])
    ends = np.flatnonzero((gaps >= np.maximum(inner, max(least, 5 * scatter))) & (outer >= 8 * scatter) & (scatter > 0))
    below, above = ends[ends < first], ends[ends >= first + n_usual]
    return known[below[-1] + 1] if below.size else -np.inf, known[above[0]] if above.size else np.inf


def has_levels(table: Reading, place: int, known: Array) -> bool:
    """Whether a column has more than one value; name it where it has few, one or none."""
    levels, n_known, name = known[equal_runs(known)[0]], len(known), table.columns[place]
    is_coarse = len(levels) <= 4 and n_known >= 50
    is_flag = np.array_equal(levels, [0.0, 1.0])  # of frost, or of a closed lane
    if not n_known and not any(found.column == name for found in table.findings):
        detail = f"{name!r} is NaN in all {len(table.values)} rows"
        table.found("useless-column", name, None, detail, meaningless=True)
    elif len(levels) == 1 < n_known:
        table.found_in("useless-column", place, f"is {levels[0]:.6g}{table.unit}, constant,", meaningless=True)
    elif n_known and is_coarse and not is_flag:
        table.found_in("useless-column", place, f"has only the values {texts_of(levels)}{table.unit}")
    if len(levels) < 2 or is_coarse:
        table.useless.add(place)
    return len(levels) > 1


def in_degrees(T: Reading, places: list[int]) -> list[int]:
    """The sensors in degrees Celsius; those in degrees Fahrenheit, in parts of a degree or with another sign are named.

    A sensor has another unit if it lies much nearer to the others in this unit, and varies as they do. All
    sensors together, or one alone, have another unit if no bridge in the open is as warm, or if their values span more
    than the open does, smoothly. Of two sensors, either may be the one with another sign.
    """
    values, n_sensors, hints = T.values[:, places], len(places), {}
    if not n_sensors:
        return []
    lowest, low, middles, high, warmest, highest = np.nanquantile(values, [0, 0.05, 0.5, 0.95, 0.99, 1], axis=0)
    typical = np.median(middles)  # a bridge has 45 to 85, or a warmest percent of 70, in degrees Fahrenheit only
    is_warm = 45 < typical < 85 or (typical < 45 and np.median(warmest) > 70)
    together = spread_evenly(np.flatnonzero(~np.isnan(values).any(axis=1)), 1000)
    if is_warm and middles.min() > 16 and lowest.min() > -60 and highest.max() < 170:
        hints = dict.fromkeys(range(n_sensors), "as in degrees Fahrenheit")
    elif len(together) >= 100 and n_sensors > 1:
        some = values[together]
        with np.errstate(invalid="ignore", divide="ignore"):  # of a column that is constant there
            correlations = np.corrcoef(some.T)
        widths = np.maximum(np.ptp(np.quantile(some, [0.05, 0.95], axis=0), axis=0), 1e-300)
        for number, (factor, zero, unit) in product(range(n_sensors), OTHER_UNITS):
            others, own = np.arange(n_sensors) != number, some[:, [number]]
            before = np.median(np.abs(own - some[:, others]), axis=0).mean()
            after = np.median(np.abs((own - zero) / factor - some[:, others]), axis=0).mean()
            is_near = before > 10 and after < 0.4 * before if factor > 0 else after < 0.7 * before
            is_alike = 0.3 < np.median(widths[number] / widths[others]) / abs(factor) < 3
            is_alike &= np.median(correlations[number, others]) * np.sign(factor) > 0.6
            if is_near and is_alike and (n_sensors > 2 or not hints):
                hints.setdefault(number, f"as in {unit} beside the others")
    for number in range(n_sensors):
        series = values[~np.isnan(values[:, number]), number]
        steps = np.abs(np.diff(series))[(series[1:] > HOTTEST) | (series[1:] < COLDEST)]
        is_open = low[number] >= COLDEST and high[number] <= HOTTEST and highest[number] - lowest[number] < 180
        is_smooth = steps.size and high[number] - low[number] > 4 * np.median(steps)  # of temperatures, not of errors
        largest = max(highest[number] / HOTTEST, lowest[number] / COLDEST)
        if not is_open and is_smooth and largest < 1000:
            hints.setdefault(number, f"as in degrees times {10 if largest < 10 else 100 if largest < 100 else 1000}")
    is_rule, celsius = 2 * len(hints) > n_sensors, []
    for number, place in enumerate(places):
        hint = hints.get(number, "beside others in such a unit" if is_rule else "")
        if hint:
            span = f"lies between {lowest[number]:.6g} and {highest[number]:.6g}"
            T.found_in("wrong-unit", place, f"{span}, {hint},")
        else:
            celsius.append(place)
    return celsius


def put_stuck_aside(table: Reading) -> None:
    """Put aside the runs in which a column only repeats a value; a column that begins as another one is its lag."""
    for place, column in enumerate(table.values.T):
        for stuck in stuck_runs(column) if place not in table.useless else ():
            if stuck[0] > 0 or np.count_nonzero(table.values[0] == column[0]) == 1:
                table.put_aside("stuck", place, np.isin(np.arange(len(column)), stuck))


def stuck_runs(column: Array) -> Iterator[NDArray[np.intp]]:
    """Rows of each run in which a column only repeats a value."""
    rows = np.flatnonzero(~np.isnan(column))
    values = column[rows]
    first, lengths = equal_runs(values)
    if len(values) >= 20 and lengths.max() >= 5 and len(lengths) >= 3:
        longest = np.argsort(-lengths, kind="stable")[:20]
        for run in np.sort(longest[lengths[longest] >= 5]):
            if is_outstanding(values[first], lengths, run):
                yield rows[first[run] : first[run] + lengths[run]]


def equal_runs(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First place and length of each run of equal values; without NaN."""
    first = np.flatnonzero(np.append(True, values[1:] != values[:-1])[: len(values)])
    return first, np.diff(np.append(first, len(values)))


def is_outstanding(levels: Array, lengths: NDArray[np.intp], run: np.intp) -> bool:
    """Whether a run of equal values is four times as long as a usual one at its value and, where values are equal by
    rounding, as a usual one; and whether chance would give less than a hundredth of such a run in the whole column.

    The usual run is the fourth longest. Rain, and the sun at night, are zero again and again.
    """
    length, n_values = lengths[run], lengths.sum()
    for others in (lengths[levels == levels[run]], lengths if ((lengths > 1) & (lengths < 5)).any() else lengths[:0]):
        if len(others) > 3 and length < 4 * np.sort(others)[-4]:
            return False
    share = (lengths[lengths <= length] - 1).sum() - length + 1
    return bool(n_values * (share / n_values) ** (length - 1) <= 0.01)


def doubt_unit(F: Reading, model: Any) -> None:
    """Name frequencies in another unit than a model's nominal ones, and frequencies of another mode; without a model
    those of which all are above 1000 Hz."""
    middles = median(F.values)
    if model is None:
        if np.nanmin(middles, initial=np.inf) > 1000 and not np.isnan(middles).all():
            detail = f"the medians {texts_of(middles)} Hz are about those of structures in mHz; {len(F.values)} rows"
            F.found("wrong-unit", "", None, detail)
        return
    check_model(model)
    nominal = np.ravel(model.frequencies(np.ones((1, len(model.parameter_names)))))
    if len(nominal) != len(F.columns):
        detail = f"{len(F.columns)} columns for {len(nominal)} modes of the model"
        F.found("mode-order", "", None, detail, meaningless=True)
        return
    of_model = "Hz of a model with mass or stiffness in another unit, such as kg for t (1000 moves modes by 31.6)"
    units = {"Hz": 1.0, "rad/s": 2 * np.pi, "kHz": 1e-3, "mHz": 1e3, "cycles per minute": 60.0}  # how many are 1 Hz
    names = [*units, of_model, of_model, "seconds, the periods"]
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = [*np.outer([*units.values(), np.sqrt(1000.0), np.sqrt(1e-3)], nominal), 1 / nominal]
        off = np.abs(np.log(middles / expected))
    if np.isnan(off[0]).all():
        return
    typical = np.nanmedian(off, axis=1)
    best = 1 + int(np.argmin(typical[1:]))
    if typical[best] < 0.2 and typical[0] > 0.5:
        detail = f"the medians {texts_of(middles)} beside {texts_of(nominal)} Hz of the model are about those in"
        detail = f"{detail} {names[best]}; {len(F.values)} rows"
        F.found("wrong-unit", "", None, detail, meaningless=names[best] != of_model)
        return
    for place in np.flatnonzero(off[0] > 0.5):
        fits = np.flatnonzero(off[1:, place] < 0.2)
        hint = f", as in {names[1 + fits[0]]}," if len(fits) else ""
        detail = f"has the median {middles[place]:.4g}, the model {nominal[place]:.4g} Hz{hint}"
        F.found_in("wrong-unit", place, detail)


@dataclass(frozen=True)
class Plausible:
    """Which values can be measured: between bounds by column, and none that loggers write for a missing one.

    A number such as -99 stands for a missing value only where the others of the baseline's column do not reach it.
    """

    lowest: Array
    highest: Array
    least: Array
    most: Array

    @classmethod
    def learned(cls, baseline: pd.DataFrame, targets: Sequence[Any]) -> Plausible:
        """No temperature in kelvin, and none that is 100 degrees beyond the baseline; targets may have any value."""
        (least, most), is_target = _range(baseline.to_numpy()), baseline.columns.isin(targets)
        lowest = np.where(is_target, -np.inf, np.fmin(least - 100, -80))
        return cls(lowest, np.where(is_target, np.inf, np.fmax(most + 100, 100)), least, most)

    @classmethod
    def of_weather(cls, temperatures: Array) -> Plausible:
        """Temperatures that weather may bring where these are known."""
        least, most = _range(temperatures)
        beyond = np.maximum(most - least, 30)
        return cls(least - beyond, most + beyond, least, most)

    def implausible(self, values: Array) -> NDArray[np.bool_]:
        """Which values no sensor measures."""
        is_marker = np.isin(values, MISSING_CODES) & ~((values >= self.least) & (values <= self.most))
        return is_marker | np.isinf(values) | (values < self.lowest) | (values > self.highest)


def _range(values: Array) -> tuple[Array, Array]:
    """Least and most of each column, numbers that may stand for missing values left out."""
    known = np.where(np.isin(values, MISSING_CODES), np.nan, values)
    return np.fmin.reduce(known), np.fmax.reduce(known)
