"""Checks of the columns of one table: impossible values, columns without information, other units and signs."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from skthermo._core.arrays import HUGE, NORMAL, Array, as_floats, median, spread_evenly
from skthermo._core.frames import MISSING_CODES, columns_by_sensor
from skthermo.preprocessing.checks._record_findings import RecordFinding
from skthermo.preprocessing.checks._stuck import equal_runs

LOGGED = (*MISSING_CODES, 999.0, 9999.0, 99999.0, 999.9, -999.9, 9999.9, -9999.9, 999.99, 9999.99, 1e20, 1e30, -1e30)
COLDEST, HOTTEST = -90.0, 100.0  # degrees Celsius that a structure in the open may have
IN_KELVIN = (183.0, 373.0)  # the same range in kelvin


class Reading:
    """A table of records as numbers in order of time, NaN where they cannot be used, and findings on the way.

    An argument that is no table has no column. ``order`` has the positions of the rows in the table that was given.
    Columns that are ``useless`` have one value, or very few. Sentences write the ``unit`` after a value.
    """

    def __init__(self, table: Any, what: str, unit: str):
        self.what, self.unit = what, " °C" if what == "temperatures" else f" {unit}" if unit else ""
        self.columns: list[Hashable] = []
        self.values, self.index = np.empty((0, 0)), pd.RangeIndex(0)
        self.findings: list[RecordFinding] = []
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
            self.findings.append(RecordFinding("no-table", "", 0, None, None, f"the {what} {reason}"))
        elif not self.values.size:
            detail = f"the {what} have {n_rows} rows and {n_columns} columns"
            self.findings.append(RecordFinding("no-rows", "", n_rows, None, None, detail))
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
                    self.findings.append(RecordFinding.in_rows(self.index, "no-numbers", name, rows, _reason(error)))
        found: list[tuple[Hashable, str]] = []
        tuples = [name for name in names if isinstance(name, tuple)]
        others = [name for name in names if not isinstance(name, str)]
        if tuples or isinstance(names, pd.MultiIndex):
            found.append(("", f"the {self.what} have tuples such as {names[0]!r}"))
        if 0 < len(others) < len(names):
            found.append(("", f"{others[0]!r} is no text beside others"))
        for name in names[names.duplicated()].unique():
            found.append((name, f"{name!r} is the name of {np.sum(names == name)} columns"))
        self.findings += [
            RecordFinding.in_rows(self.index, "column-names", name, rows, detail) for name, detail in found
        ]
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
        self.findings.append(RecordFinding.in_rows(self.index, what, column, rows, detail, period=True))

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
            named = texts_of(levels) if len(levels) <= 3 else f"{levels[0]:.6g} to {levels[-1]:.6g}"
            wrong = np.zeros(len(self.reading.values), dtype=bool)
            wrong[self.found(what, levels, f"is {named}{self.reading.unit}")] = True
            self.reading.set_aside(what, np.flatnonzero(wrong | binary_closing(wrong, np.ones(3))), self.place)
            self._sort()

    def isolated_levels(self, jump: float) -> Array:
        """At most three values at either end that repeat exactly, farther from all others than a jump."""
        levels, repeated, gaps = self.levels, self.counts > 1, np.diff(self.levels) > jump
        isolated = np.zeros(len(levels), dtype=bool)
        for number in (1, 2, 3) if len(levels) > 8 else ():
            for ends, gap in ((slice(None, number), gaps[number - 1]), (slice(-number, None), gaps[-number])):
                isolated[ends] |= gap and repeated[ends].all()
        return levels[isolated]

    def levels_apart(self, least: float = 0.0) -> Array:
        """Values at another level than the others: beyond this gap, five standard deviations, and a third of all that
        the column spans, and eight standard deviations from the middle of the usual values.

        The standard deviation is that of the narrowest 40 % of the values, which span 1.049 of it where values are
        normal. Where that is zero, or fewer than 50 values are known, no value is at another level.
        """
        known, n_usual = self.ordered, int(0.4 * len(self.ordered))
        apart: list[Array] = []
        if len(known) < 50:
            return known[:0]
        widths = known[n_usual:] - known[: len(known) - n_usual]
        first = int(widths.argmin())
        middle, scatter = known[first : first + n_usual + 1].mean(), widths[first] / 1.049
        levels = self.levels
        while scatter > 0 and len(levels) > 1:
            gaps = np.diff(levels)
            place = int(gaps.argmax())
            side = levels[: place + 1] if levels[place] < middle else levels[place + 1 :]
            if gaps[place] < max(least, 5 * scatter, (levels[-1] - levels[0]) / 3) or (
                np.abs(side - middle).min() < 8 * scatter
            ):
                break
            apart.append(side)
            levels = levels[~np.isin(levels, side)]
        return np.sort(np.concatenate([known[:0], *apart]))

    def is_poor(self) -> bool:
        """Whether the column is empty or constant, or says little because it has few values; and say so."""
        reading, n_levels, n_known = self.reading, len(self.levels), len(self.ordered)
        is_coarse = n_levels <= 4 and n_known >= 50
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
        """Values 50 degrees beyond all others and beyond what the open has; then levels that repeat, 30 degrees from
        others; then another level, 10 degrees away, which a structure passes between records that are left out."""
        levels = self.levels
        beyond = (levels < COLDEST) | (levels > HOTTEST)
        if beyond.any():
            gaps = np.diff(levels)
            above = np.append(False, np.logical_or.accumulate((gaps > 50) & (levels[1:] > HOTTEST)))
            below = np.append(np.logical_or.accumulate(((gaps > 50) & (levels[:-1] < COLDEST))[::-1])[::-1], False)
            lonely = np.minimum(np.append(np.inf, gaps), np.append(gaps, np.inf)) > 30
            if self.quantiles(0.95) < HOTTEST:  # tenths of a degree pass through -99
                above |= np.isin(levels, LOGGED) & lonely
            is_none = beyond & (above | below)
            in_kelvin = is_none & (levels > IN_KELVIN[0]) & (levels < IN_KELVIN[1])
            self.put_aside("kelvin", levels[in_kelvin])
            self.put_aside("placeholders", levels[is_none & ~in_kelvin])
        self.put_aside("isolated-level", self.isolated_levels(30.0))
        self.put_aside("another-level", self.levels_apart(10.0))

    def put_placeholders_aside(self) -> None:
        """What loggers write for a missing response, far from all others."""
        rest = self.ordered[~np.isin(self.ordered, LOGGED)]
        if not len(rest):
            self.put_aside("placeholders", self.levels)
        elif len(rest) < len(self.ordered):
            repeats = (self.counts > 1) | (self.levels < 0)
            logged = self.levels[np.isin(self.levels, LOGGED) & repeats]
            low, middle, high = rest[(np.array([0.1, 0.5, 0.9]) * (len(rest) - 1)).astype(int)]
            self.put_aside("placeholders", logged[np.abs(logged - middle) > 3 * (high - low)])


def texts_of(levels: Array) -> str:
    """Numbers as a sentence lists them."""
    return ", ".join(map("{:.6g}".format, levels))


def look_at_temperatures(T: Reading) -> None:
    """Put aside values that no thermometer in the open shows, and name columns in another unit or with another sign."""
    varying = []
    for name, places in columns_by_sensor(T).items():  # lags repeat what a sensor shows
        column = Column(T, places[0], name)
        if len(column.levels) and column.levels[0] > IN_KELVIN[0] and column.levels[-1] < IN_KELVIN[1]:
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
    typical = np.median(middles)  # a bridge has 45 to 85, or a warmest percent of 70, in degrees Fahrenheit only
    is_warm = 45 < typical < 85 or (typical < 45 and np.median(warmest) > 70)
    if is_warm and middles.min() > 16 and lowest.min() > -60 and highest.max() < 170:
        for column in columns:
            column.found("fahrenheit", column.levels, column.span)
        return
    values = T.values[:, [column.place for column in columns]]
    known = np.flatnonzero(~np.isnan(values).any(axis=1))
    if len(columns) > 1 and len(known) >= 50:
        quantiles = np.quantile(values[spread_evenly(known, 1000)], [0.05, 0.5, 0.95], axis=0)
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
    if len(columns) < 2 or len(T.values) < 50:
        return []
    lows, middles, highs = np.array([column.quantiles(0.25, 0.5, 0.75) for column in columns]).T
    spreads = np.where(highs > lows, highs - lows, np.inf)
    values = T.values[:, [column.place for column in columns]]
    standard = np.clip(np.nan_to_num((values - middles) / spreads), -3, 3)
    norms = np.sqrt((standard**2).sum(axis=0))
    correlations = standard.T @ standard / np.maximum(np.outer(norms, norms), 1e-300)
    mirrored = []
    for place, column in enumerate(columns):
        others = np.arange(len(columns)) != place
        centre = np.median(middles[others])
        is_mirrored = abs(middles[place] + centre) < min(15, abs(middles[place] - centre))
        against, among = np.median(correlations[place, others]), np.median(correlations[np.ix_(others, others)])
        if is_mirrored and against < -0.6 and among > 0.6:
            partner = f"{columns[1].name!r}" if len(columns) == 2 else "the others"
            detail = f"{column.name!r} and {partner} have a correlation of {against:.2f} in {len(T.values)} rows"
            T.found("opposite-signs", column.name, T.whole, detail)
            mirrored.append(column)
            if len(columns) == 2:
                break
    return mirrored


def _is_in_another_unit(column: Column, place: int, quantiles: Array) -> bool:
    """Whether a sensor shows the others' temperatures in degrees Fahrenheit, or in tenths of a degree; and say so.

    ``quantiles`` are the 5th, 50th and 95th percentile of each sensor, (3, n_sensors), in rows where all have a value.
    """
    others = np.delete(quantiles, place, axis=1)
    low, middle, high = quantiles[:, place]
    centre, spread = np.median(others[1]), np.median(others[2] - others[0])
    ratio = (high - low) / max(spread, 1e-300)
    beside = f"{column.span} with a median of {middle:.4g}, that of the others is {centre:.4g},"
    at_zero = middle - ratio * centre  # where the others are at 0 degrees Celsius
    off = abs((middle - 32) / 1.8 - centre)
    is_apart = middle - centre > 20 and off < 15 and (off < 5 or abs(at_zero - 32) < 10)
    is_apart &= column.levels[0] > -60 and column.levels[-1] < 170
    if is_apart and 0.3 < ratio / 1.8 < 3:
        column.found("fahrenheit", column.levels, beside)
        return True
    is_wide = high - low > 90 or column.levels[-1] > HOTTEST or column.levels[0] < COLDEST
    if is_wide and abs(middle / 10 - centre) < 7.5 and 0.3 < ratio / 10 < 3:
        column.found("scaled-temperatures", column.levels, beside)
        return True
    return False


def _is_scaled(column: Column) -> bool:
    """Whether a column, which spans more than the open does, is in tenths of a degree or less; and say so."""
    lowest, low, high, highest = column.quantiles(0, 0.05, 0.95, 1)
    if high <= HOTTEST and low >= COLDEST and highest - lowest < 180:
        return False
    series = column.reading.values[:, column.place]
    series = series[~np.isnan(series)]
    steps = np.abs(np.diff(series))[(series[1:] > HOTTEST) | (series[1:] < COLDEST)]
    for scale in (10.0, 100.0, 1000.0):
        if lowest / scale > COLDEST and highest / scale < HOTTEST:
            is_smooth = high - low > 4 * np.median(steps)  # of temperatures, not of errors
            if is_smooth:
                column.found("scaled-temperatures", column.levels, f"{column.span}, as in degrees times {scale:g},")
            return bool(is_smooth)
    return False


def look_at_responses(F: Reading, *, in_hertz: bool, beside_weather: bool) -> None:
    """Put aside values that are no frequencies, or no responses of another kind.

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
        isolated, apart = column.isolated_levels(3 * width), column.levels_apart()
        if in_hertz:
            isolated = isolated[(isolated > 2 * middle) | (isolated < middle / 2)]
            apart = apart[(apart > 2 * middle) | (apart < middle / 2)]
        column.put_aside("isolated-level", isolated if width > 0 else isolated[:0])
        column.put_aside("another-level", apart[~np.isin(apart, isolated)])
        low, middle, high = column.quantiles(0.25, 0.5, 0.75)
        deviation = NORMAL / 2 * (high - low)
        far = np.abs(column.levels - middle) > 20 * deviation
        if deviation > 0 and not beside_weather:
            column.put_aside("implausible-values", column.levels[far])
    F.find_equal_columns()


def compare_with_model(F: Reading, model: Any) -> None:
    """Name frequencies in another unit than a model's nominal ones, and frequencies of another mode."""
    nominal = np.ravel(model.frequencies(np.ones((1, len(model.parameter_names)))))
    if len(nominal) != len(F.columns):
        F.found("number-of-modes", "", F.whole, f"{len(F.columns)} columns for {len(nominal)} modes")
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
    beside = f"the medians {texts_of(middles)} beside {texts_of(nominal)} Hz of the model"
    if typical[best] < 0.2 and typical[0] > 0.5:
        F.found("unit-of-frequencies", "", F.whole, f"{beside} are about those in {names[best]}; {len(F.whole)} rows")
        return
    for place in np.flatnonzero(off[0] > 0.5):
        name, fits = F.columns[place], np.flatnonzero(off[1:, place] < 0.2)
        hint = f", as in {names[1 + fits[0]]}" if len(fits) else ""
        detail = f"{name!r} has the median {middles[place]:.4g}, the model {nominal[place]:.4g} Hz{hint}"
        F.found("unit-of-a-mode", name, F.whole, detail)
