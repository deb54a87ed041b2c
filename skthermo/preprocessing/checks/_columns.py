"""What the columns of one table show: values that cannot be, and values that say nothing; other units and signs."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, maximum_filter1d, minimum_filter1d

from skthermo._core.arrays import HUGE, NORMAL, Array, as_floats, median, spread_evenly
from skthermo._core.frames import IMPLAUSIBLE, MARKERS, columns_by_sensor
from skthermo.preprocessing.checks._findings import Finding

LOGGED = (*MARKERS, 999.0, 9999.0, 99999.0, 999.9, -999.9, 9999.9, -9999.9, 999.99, 9999.99, 1e20, 1e30, -1e30)
APART, GAP = 8.0, 5.0  # standard deviations: from the middle of the usual values, and between two levels
EMPTY = 1 / 3  # share of all that a column spans, between two levels
FEW_LEVELS, MANY_VALUES = 3, 5  # different values that repeat, far from so many others
FEW_VALUES, LEAST_KNOWN = 4, 50  # different values of a column of so many
NARROWEST, SPAN = 0.4, 1.049  # share of the values of a column, and the standard deviations that it spans if normal
AMONG = np.ones(3)  # rows, of which the middle one is as doubtful as the two others

SHORTEST = 5  # number of equal records in a row that may count as stuck
USUAL = 4  # times the length of a usual run, which a stuck one exceeds where values are rounded
USUAL_RANK = 3  # the usual run is the longest but so many
CHANCE = 0.01  # number of such runs that chance may give in the whole column
FEW = 0.05  # share of the other periods of that length that may vary as little as rounding does
STEPS = 3  # steps of rounding that count as little
MOST_RUNS = 20  # longest ones of a column, which are looked at

COLDEST, HOTTEST = -90.0, 100.0  # degrees Celsius that a structure in the open may have
FREEZING, COLD, HOT, DEGREES = 32.0, -60.0, 170.0, 1.8  # in Fahrenheit
KELVIN = (183.0, 373.0)  # the same range in kelvin
FAR = 50.0  # degrees beyond all others, of a value that is none
JUMP = 30.0  # the same, of a value that repeats exactly
APART_AT_LEAST = 10.0  # degrees between two levels, which a structure passes between records that are left out
WIDEST, WIDE = 180.0, 90.0  # degrees that a thermometer spans in the open, and that it does beside another
SMOOTH = 4.0  # times a step between records, that temperatures span and errors do not
SCALES = (10.0, 100.0, 1000.0)  # tenths, hundredths, thousandths of a degree
ALIKE_IN, NEAR, OTHER_UNIT = 5.0, 15.0, 20.0  # degrees between medians of thermometers: alike, in one unit, in two
AT_ZERO = 10.0  # degrees Fahrenheit from 32, of a sensor in Fahrenheit where the others are at 0 degrees Celsius
ALIKE = (0.3, 3.0)  # ratio of the spreads of two thermometers
WARM, WARMEST = (45.0, 85.0), 70.0  # medians, and warmest percent, that a bridge has only in degrees Fahrenheit
AGAINST = -0.6  # correlation of a sensor with the others whose sign is wrong
MOST_COMPARED = 1000  # rows
CLIPPED = 3.0  # distances of the quartiles, of values that correlations are calculated from

BEYOND = 3.0  # times the range of the inner 80 % of a column, from its median, of a value that is none
OTHER_MODE = 2.0  # times the median of a mode, or its inverse, of a frequency that is none of the mode
QUARTILES = NORMAL / 2  # standard deviations of a normal distribution in the distance of its quartiles
UNITS = {"rad/s": 2 * np.pi, "kHz": 1e-3, "mHz": 1e3, "cycles per minute": 60.0}  # and how many of them are 1 Hz
SAME, OTHER = 0.2, 0.5  # logarithms of ratios to the model's frequencies in the same and in another unit


class Reading:
    """A table of records as numbers in order of time, NaN where they cannot be used, and what was found on the way.

    Whatever is no table has no column. Rows are row ``order`` of the table that was given. Columns that are ``useless``
    have one value, or very few. The ``unit`` is what a sentence says after a value.
    """

    def __init__(self, table: Any, what: str, unit: str):
        self.what, self.unit = what, " °C" if what == "temperatures" else f" {unit}" if unit else ""
        self.columns: list[Hashable] = []
        self.values, self.index = np.empty((0, 0)), pd.RangeIndex(0)
        self.findings: list[Finding] = []
        self.useless: set[int] = set()
        self.aside: list[tuple[str, NDArray[np.intp], int, Array]] = []
        is_series = isinstance(table, pd.Series)
        if is_series:
            table = table.to_frame("" if table.name is None else table.name)
        self.is_frame = isinstance(table, pd.DataFrame)
        reason = self._read_frame(table) if self.is_frame else self._read_array(table)
        if is_series and what == "temperatures":
            reason = "are a Series, not a DataFrame"
        n_rows, n_columns = self.values.shape
        if reason:
            self.findings.append(Finding("no-table", "", 0, None, None, f"the {what} {reason}"))
        elif not self.values.size:
            detail = f"the {what} have {n_rows} rows and {n_columns} columns"
            self.findings.append(Finding("no-rows", "", n_rows, None, None, detail))
        self.is_table = self.values.size > 0
        self.given_index, self.whole = self.index, np.arange(n_rows)
        self.order, self.were_known = self.whole, ~np.isnan(self.values)

    def _read_frame(self, table: pd.DataFrame) -> str:
        """Read a frame, NaN in columns that hold no numbers, and look at its names."""
        names = table.columns
        self.columns, self.index, rows = list(names), table.index, np.arange(len(table))
        try:
            self.values = np.array(as_floats(table))
        except Exception:  # some column is no numbers: the others may be
            self.values = np.full(table.shape, np.nan)
            for place, name in enumerate(self.columns):
                try:
                    self.values[:, place] = np.ravel(as_floats(table.iloc[:, [place]]))
                except Exception as error:  # objects of users may raise anything
                    self.findings.append(Finding.of(self.index, "no-numbers", name, rows, _reason(error)))
        found: list[tuple[Hashable, str]] = []
        tuples = [name for name in names if isinstance(name, tuple)]
        others = [name for name in names if not isinstance(name, str)]
        if tuples or isinstance(names, pd.MultiIndex):
            found.append(("", f"the {self.what} have tuples such as {names[0]!r}"))
        if 0 < len(others) < len(names):
            found.append(("", f"{others[0]!r} is no text beside others"))
        for name in names[names.duplicated()].unique():
            found.append((name, f"{name!r} is the name of {np.sum(names == name)} columns"))
        self.findings += [Finding.of(self.index, "column-names", name, rows, detail) for name, detail in found]
        return ""

    def _read_array(self, table: Any) -> str:
        """Read whatever becomes an array; why it is none, else an empty text."""
        kind = type(table).__name__
        try:
            values = np.array(as_floats(table))
            names = list(getattr(table, "columns", ()))
        except Exception as error:  # objects of users may raise anything
            return f"are a {kind} ({_reason(error)})"
        if values.ndim in (1, 2):
            self.values = values[:, np.newaxis] if values.ndim == 1 else values
            self.index = pd.RangeIndex(len(values))
            prefix = "T" if self.what == "temperatures" else "f"
            self.columns = names or [f"{prefix}{place + 1}" for place in range(self.values.shape[1])]
        if values.ndim == 2 or (values.ndim == 1 and self.what == "frequencies"):
            return ""
        return f"are a {kind} of shape {values.shape}"

    def sort(self, index: pd.Index) -> None:
        """Put rows in order of the times of an index, and aside what is infinite or too large to be squared."""
        self.index = index
        if isinstance(index, pd.DatetimeIndex) and not index.is_monotonic_increasing and not index.hasnans:
            self.order = index.argsort(kind="stable")
            self.index, self.values = index[self.order], self.values[self.order]
            self.were_known = self.were_known[self.order]
        with np.errstate(invalid="ignore"):
            infinite = np.abs(self.values) > HUGE
        for place in np.flatnonzero(infinite.any(axis=0)):
            rows = np.flatnonzero(infinite[:, place])
            name, value = self.columns[place], self.values[rows[0], place]
            self.found("infinite-values", name, rows, f"{name!r} is {value:g} in {self.share(rows)}")
            self.set_aside("infinite-values", rows, int(place))

    def share(self, rows: NDArray[np.intp]) -> str:
        """How many of the rows these are, as a sentence says it."""
        n_rows = len(self.values)
        return f"{n_rows} rows" if len(rows) == n_rows else f"{len(rows)} of {n_rows} rows"

    def found(self, what: str, column: Hashable, rows: NDArray[np.intp], detail: str) -> None:
        """Add a finding in some rows, with their period."""
        self.findings.append(Finding.of(self.index, what, column, rows, detail, period=True))

    def set_aside(self, what: str, rows: NDArray[np.intp], place: int) -> None:
        """Make values of a column NaN."""
        self.aside.append((what, rows, place, self.values[rows, place].copy()))
        self.values[rows, place] = np.nan

    def contents(self) -> list[tuple[Any, bytes]]:
        """Name and bytes of each column that varies."""
        columns = zip(self.columns, self.values.T, strict=True)
        return [(name, column.tobytes()) for name, column in columns if np.fmax.reduce(column) > np.fmin.reduce(column)]

    def find_equal_columns(self) -> None:
        """Name columns that are copies of another one."""
        seen: dict[bytes, Any] = {}
        for name, content in self.contents():
            if content in seen:
                detail = f"{name!r} equals {seen[content]!r} in {len(self.values)} rows"
                self.found("equal-columns", name, self.whole, detail)
            seen.setdefault(content, name)


def _reason(error: Exception) -> str:
    return f"{str(error).partition(';')[0]:.150}"


class Column:
    """One column of a table, its known values in order and how often each of them occurs."""

    def __init__(self, reading: Reading, place: int, name: Hashable):
        self.reading, self.place, self.name = reading, place, name
        self._sort()

    def _sort(self) -> None:
        column = self.reading.values[:, self.place]
        known = np.sort(column)[: len(column) - np.count_nonzero(np.isnan(column))]
        first, self.counts = equal_runs(known)
        self.ordered, self.levels = known, known[first]

    def quantiles(self, *shares: float) -> Array:
        """Values of the column that these shares of the known values do not exceed."""
        return self.ordered[(np.array(shares) * (len(self.ordered) - 1)).astype(int)]

    @property
    def span(self) -> str:
        """Smallest and largest value as a sentence gives them."""
        return f"lies between {self.levels[0]:.6g} and {self.levels[-1]:.6g}"

    def found(self, what: str, levels: Array, detail: str) -> NDArray[np.intp]:
        """Add a finding in the rows that have one of these levels, and return these."""
        column = self.reading.values[:, self.place]
        rows = np.flatnonzero(np.isin(column, levels) if len(levels) < len(self.levels) else ~np.isnan(column))
        self.reading.found(what, self.name, rows, f"{self.name!r} {detail} in {self.reading.share(rows)}")
        return rows

    def put_aside(self, what: str, levels: Array) -> None:
        """Add a finding in the rows that have one of these levels; they, and single rows among them, become NaN."""
        if len(levels):
            named = texts_of(levels) if len(levels) <= FEW_LEVELS else f"{levels[0]:.6g} to {levels[-1]:.6g}"
            wrong = np.zeros(len(self.reading.values), dtype=bool)
            wrong[self.found(what, levels, f"is {named}{self.reading.unit}")] = True
            self.reading.set_aside(what, np.flatnonzero(wrong | binary_closing(wrong, AMONG)), self.place)
            self._sort()

    def isolated_levels(self, jump: float) -> Array:
        """A few values at either end that repeat exactly, farther from all others than a jump."""
        levels, repeated, gaps = self.levels, self.counts > 1, np.diff(self.levels) > jump
        isolated = np.zeros(len(levels), dtype=bool)
        for number in range(1, FEW_LEVELS + 1) if len(levels) > FEW_LEVELS + MANY_VALUES else ():
            for ends, gap in ((slice(None, number), gaps[number - 1]), (slice(-number, None), gaps[-number])):
                isolated[ends] |= gap and repeated[ends].all()
        return levels[isolated]

    def levels_apart(self, least: float = 0.0) -> Array:
        """Values at another level than the others: beyond this gap, and a third of all that the column spans.

        The narrowest part of the values says how far they scatter. Where it does not, or few are known, none are.
        """
        known, n_usual = self.ordered, int(NARROWEST * len(self.ordered))
        apart: list[Array] = []
        if len(known) < LEAST_KNOWN:
            return known[:0]
        widths = known[n_usual:] - known[: len(known) - n_usual]
        first = int(widths.argmin())
        middle, scatter = known[first : first + n_usual + 1].mean(), widths[first] / SPAN
        levels = self.levels
        while scatter > 0 and len(levels) > 1:
            gaps = np.diff(levels)
            place = int(gaps.argmax())
            side = levels[: place + 1] if levels[place] < middle else levels[place + 1 :]
            if gaps[place] < max(least, GAP * scatter, EMPTY * (levels[-1] - levels[0])) or (
                np.abs(side - middle).min() < APART * scatter
            ):
                break
            apart.append(side)
            levels = levels[~np.isin(levels, side)]
        return np.sort(np.concatenate([known[:0], *apart]))

    def is_poor(self) -> bool:
        """Whether the column is empty or constant, or says little because it has few values; and say so."""
        reading, n_levels, n_known = self.reading, len(self.levels), len(self.ordered)
        is_coarse = n_levels <= FEW_VALUES and n_known >= LEAST_KNOWN
        if not n_known and self.name not in [found.column for found in reading.findings]:
            detail = f"{self.name!r} is NaN in all {len(reading.values)} rows"
            reading.found("missing-column", self.name, reading.whole, detail)
        elif n_levels == 1 < n_known:
            self.found("constant", self.levels, f"is {self.levels[0]:.6g}{reading.unit}")
        elif n_known and is_coarse:
            self.found("few-values", self.levels, f"has the {n_levels} values {texts_of(self.levels)}{reading.unit}")
        if n_levels < 2 or is_coarse:
            reading.useless.add(self.place)
        return n_levels < 2

    def put_no_temperatures_aside(self) -> None:
        """Values far beyond all others and beyond what the open has, then levels that repeat, far from others."""
        levels = self.levels
        beyond = (levels < COLDEST) | (levels > HOTTEST)
        if beyond.any():
            gaps = np.diff(levels)
            above = np.append(False, np.logical_or.accumulate((gaps > FAR) & (levels[1:] > HOTTEST)))
            below = np.append(np.logical_or.accumulate(((gaps > FAR) & (levels[:-1] < COLDEST))[::-1])[::-1], False)
            lonely = np.minimum(np.append(np.inf, gaps), np.append(gaps, np.inf)) > JUMP
            if self.quantiles(0.95) < HOTTEST:  # tenths of a degree pass through -99
                above |= np.isin(levels, LOGGED) & lonely
            is_none = beyond & (above | below)
            in_kelvin = is_none & (levels > KELVIN[0]) & (levels < KELVIN[1])
            self.put_aside("kelvin", levels[in_kelvin])
            self.put_aside("placeholders", levels[is_none & ~in_kelvin])
        self.put_aside("isolated-level", self.isolated_levels(JUMP))
        self.put_aside("another-level", self.levels_apart(APART_AT_LEAST))

    def put_placeholders_aside(self) -> None:
        """What loggers write for a missing response, far from all others."""
        rest = self.ordered[~np.isin(self.ordered, LOGGED)]
        if not len(rest):
            self.put_aside("placeholders", self.levels)
        elif len(rest) < len(self.ordered):
            repeats = (self.counts > 1) | (self.levels < 0)
            logged = self.levels[np.isin(self.levels, LOGGED) & repeats]
            low, middle, high = rest[(np.array([0.1, 0.5, 0.9]) * (len(rest) - 1)).astype(int)]
            self.put_aside("placeholders", logged[np.abs(logged - middle) > BEYOND * (high - low)])


def texts_of(levels: Array) -> str:
    """Numbers as a sentence lists them."""
    return ", ".join(map("{:.6g}".format, levels))


def equal_runs(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First place and length of each run of equal values; without NaN."""
    first = np.flatnonzero(np.append(True, values[1:] != values[:-1])[: len(values)])
    return first, np.diff(np.append(first, len(values)))


def stuck_columns(table: Array) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Place of a column and rows of each run at which it was stuck; what begins as another column is a lag of it."""
    for place, column in enumerate(table.T):
        for rows in stuck_runs(column):
            if rows[0] > 0 or np.count_nonzero(table[0] == column[0]) == 1:
                yield place, rows


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
    for run in np.sort(longest[lengths[longest] >= SHORTEST]):
        if _is_outstanding(values[first], lengths, run) and _others_vary(values, lengths, lengths[run], step):
            found.append(rows[first[run] : first[run] + lengths[run]])
    return found


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


def look_at_temperatures(T: Reading) -> None:
    """Put aside what no thermometer in the open shows, and name columns in another unit or with another sign."""
    varying = []
    for name, places in columns_by_sensor(T).items():  # lags repeat what a sensor shows
        column = Column(T, places[0], name)
        if len(column.levels) and column.levels[0] > KELVIN[0] and column.levels[-1] < KELVIN[1]:
            column.found("kelvin", column.levels, column.span)
            continue
        column.put_no_temperatures_aside()
        if not column.is_poor():
            varying.append(column)
    T.find_equal_columns()
    mirrored = _opposite_signs(T, varying)
    columns = [column for column in varying if column not in mirrored]
    if not columns or len(mirrored) == 1 == len(columns):
        return
    lowest, middles, warmest, highest = np.array([column.quantiles(0, 0.5, 0.99, 1) for column in columns]).T
    is_warm = WARM[0] < np.median(middles) < WARM[1]
    is_warm |= np.median(middles) < WARM[0] and np.median(warmest) > WARMEST
    if is_warm and middles.min() > FREEZING / 2 and lowest.min() > COLD and highest.max() < HOT:
        for column in columns:
            column.found("fahrenheit", column.levels, column.span)
        return
    values = T.values[:, [column.place for column in columns]]
    known = np.flatnonzero(~np.isnan(values).any(axis=1))
    if len(columns) > 1 and len(known) >= LEAST_KNOWN:
        quantiles = np.quantile(values[spread_evenly(known, MOST_COMPARED)], [0.05, 0.5, 0.95], axis=0)
        columns = [column for place, column in enumerate(columns) if not _is_in_another_unit(column, place, quantiles)]
    fine = [column for column in columns if not _is_scaled(column)]
    for column in fine:
        if len(columns) > 2 * len(fine):
            column.found("scaled-temperatures", column.levels, f"{column.span}, beside others in such a unit,")
        else:
            beyond = (column.levels < COLDEST) | (column.levels > HOTTEST)
            column.put_aside("implausible-values", column.levels[beyond])


def _opposite_signs(T: Reading, columns: list[Column]) -> list[Column]:
    """Sensors that fall where the others rise, about at the level of the others with another sign; and say so.

    Of two sensors, either may be the one.
    """
    if len(columns) < 2 or len(T.values) < LEAST_KNOWN:
        return []
    lows, middles, highs = np.array([column.quantiles(0.25, 0.5, 0.75) for column in columns]).T
    spreads = np.where(highs > lows, highs - lows, np.inf)
    values = T.values[:, [column.place for column in columns]]
    standard = np.clip(np.nan_to_num((values - middles) / spreads), -CLIPPED, CLIPPED)
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
            detail = f"{column.name!r} and {partner} have a correlation of {against:.2f} in {len(T.values)} rows"
            T.found("opposite-signs", column.name, T.whole, detail)
            mirrored.append(column)
            if len(columns) == 2:
                break
    return mirrored


def _is_in_another_unit(column: Column, place: int, quantiles: Array) -> bool:
    """Whether a sensor shows what the others do in degrees Fahrenheit, or in tenths of a degree; and say so.

    By the 5th, 50th and 95th percentile of each sensor, (3, n_sensors), in rows in which all have a value.
    """
    others = np.delete(quantiles, place, axis=1)
    low, middle, high = quantiles[:, place]
    centre, spread = np.median(others[1]), np.median(others[2] - others[0])
    ratio = (high - low) / max(spread, 1e-300)
    beside = f"{column.span} with a median of {middle:.4g}, that of the others is {centre:.4g},"
    at_zero = middle - ratio * centre  # where the others are at 0 degrees Celsius
    off = abs((middle - FREEZING) / DEGREES - centre)
    is_apart = middle - centre > OTHER_UNIT and off < NEAR and (off < ALIKE_IN or abs(at_zero - FREEZING) < AT_ZERO)
    is_apart &= column.levels[0] > COLD and column.levels[-1] < HOT
    if is_apart and ALIKE[0] < ratio / DEGREES < ALIKE[1]:
        column.found("fahrenheit", column.levels, beside)
        return True
    is_wide = high - low > WIDE or column.levels[-1] > HOTTEST or column.levels[0] < COLDEST
    if is_wide and abs(middle / SCALES[0] - centre) < NEAR / 2 and ALIKE[0] < ratio / SCALES[0] < ALIKE[1]:
        column.found("scaled-temperatures", column.levels, beside)
        return True
    return False


def _is_scaled(column: Column) -> bool:
    """Whether a column, which spans more than the open does, is in tenths of a degree or less; and say so."""
    lowest, low, high, highest = column.quantiles(0, 0.05, 0.95, 1)
    if high <= HOTTEST and low >= COLDEST and highest - lowest < WIDEST:
        return False
    series = column.reading.values[:, column.place]
    series = series[~np.isnan(series)]
    steps = np.abs(np.diff(series))[(series[1:] > HOTTEST) | (series[1:] < COLDEST)]
    for scale in SCALES:
        if lowest / scale > COLDEST and highest / scale < HOTTEST:
            is_smooth = high - low > SMOOTH * np.median(steps)
            if is_smooth:
                column.found("scaled-temperatures", column.levels, f"{column.span}, as in degrees times {scale:g},")
            return bool(is_smooth)
    return False


def look_at_responses(F: Reading, *, in_hertz: bool, beside_weather: bool) -> None:
    """Put aside what is no frequency, or no response of another kind.

    Beside the weather, single values far from others are left to the search for exchanged modes and outliers.
    """
    for place, name in enumerate(F.columns):
        column = Column(F, place, name)
        column.put_placeholders_aside()
        if in_hertz:
            column.put_aside("not-positive", column.levels[column.levels <= 0])
        if column.is_poor():
            continue
        low, middle, high = column.quantiles(0.1, 0.5, 0.9)
        width = high - low
        isolated, apart = column.isolated_levels(BEYOND * width), column.levels_apart()
        if in_hertz:
            isolated = isolated[(isolated > OTHER_MODE * middle) | (isolated < middle / OTHER_MODE)]
            apart = apart[(apart > OTHER_MODE * middle) | (apart < middle / OTHER_MODE)]
        column.put_aside("isolated-level", isolated if width > 0 else isolated[:0])
        column.put_aside("another-level", apart[~np.isin(apart, isolated)])
        low, middle, high = column.quantiles(0.25, 0.5, 0.75)
        deviation = QUARTILES * (high - low)
        far = np.abs(column.levels - middle) > IMPLAUSIBLE * deviation
        if deviation > 0 and not beside_weather:
            column.put_aside("implausible-values", column.levels[far])
    F.find_equal_columns()


def compare_with_model(F: Reading, model: Any) -> None:
    """Name frequencies in another unit than the nominal ones of a model, and those of another mode."""
    nominal = np.ravel(model.frequencies(np.ones((1, len(model.parameter_names)))))
    if len(nominal) != len(F.columns):
        F.found("number-of-modes", "", F.whole, f"{len(F.columns)} columns for {len(nominal)} modes")
        return
    middles = median(F.values)
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = np.array([nominal, *np.outer([*UNITS.values()], nominal), 1 / nominal])
        off = np.abs(np.log(middles / expected))
    if np.isnan(off[0]).all():
        return
    units = ["Hz", *UNITS, "seconds, the periods"]
    typical = np.nanmedian(off, axis=1)
    best = 1 + int(np.argmin(typical[1:]))
    beside = f"the medians {texts_of(middles)} beside {texts_of(nominal)} Hz of the model"
    if typical[best] < SAME and typical[0] > OTHER:
        F.found("unit-of-frequencies", "", F.whole, f"{beside} are about those in {units[best]}; {len(F.whole)} rows")
        return
    for place in np.flatnonzero(off[0] > OTHER):
        name, fits = F.columns[place], np.flatnonzero(off[1:, place] < SAME)
        hint = f", as in {units[1 + fits[0]]}" if len(fits) else ""
        detail = f"{name!r} has the median {middles[place]:.4g}, the model {nominal[place]:.4g} Hz{hint}"
        F.found("unit-of-a-mode", name, F.whole, detail)
