"""Gross errors of records: units, markers, empty or equal columns, tables exchanged or of different times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from skthermo._tables.arrays import NORMAL, Array, check_model, median, spread_evenly
from skthermo._tables.frames import IMPLAUSIBLE, MARKERS, columns_by_sensor
from skthermo.preprocessing.checks._kinds import Finding
from skthermo.preprocessing.checks._reading import Reading, stamp_findings
from skthermo.preprocessing.checks._record_findings import RecordFindings, findings_table
from skthermo.preprocessing.checks._signs import equal_runs

COLDEST, HOTTEST = -90.0, 100.0  # degrees Celsius that a structure in the open may have
FREEZING, HOT, DEGREES = 32.0, 160.0, 1.8  # in Fahrenheit
KELVIN = (183.0, 373.0)  # the same range in kelvin
FAR = 50.0  # degrees beyond all others, of a value that is none
JUMP = 30.0  # the same, of a value that repeats exactly
WIDEST, WIDE = 180.0, 90.0  # degrees that a thermometer spans in the open, and that it does beside another
SMOOTH = 4.0  # times a step between records, that temperatures span and errors do not
SCALES = (10.0, 100.0, 1000.0)  # tenths, hundredths, thousandths of a degree
NEAR, APART = 15.0, 20.0  # degrees between the medians of thermometers of one structure, in one unit and in two
ALIKE = (0.3, 3.0)  # ratio of the spreads of two thermometers
WARM, WARMEST = (45.0, 85.0), 70.0  # medians, and warmest percent, that a bridge has only in degrees Fahrenheit
AGAINST = -0.6  # correlation of a sensor with the others whose sign is wrong
LOGGED = (*MARKERS, 999.0, 9999.0, 99999.0, 999.9, -999.9, 9999.9, -9999.9, 999.99, 9999.99, 1e20, 1e30, -1e30)
BEYOND = 3.0  # times the range of the inner 80 % of a column, from its median, of a value that is none
OTHER_MODE = 2.0  # times the median of a mode, or its inverse, of a frequency that is none of the mode
FEW_LEVELS, MANY_VALUES = 3, 5  # different values that repeat, far from so many others
FEW_VALUES, LEAST_KNOWN = 4, 50  # different values of a column of so many
AMONG = np.ones(3)  # rows, of which the middle one is as doubtful as the two others
USELESS = frozenset({"missing column", "constant", "few values", "no numbers"})
FEW_WRONG = 0.01  # share of the rows in which a sensor may be wrong without a doubt on the others
FEW_ROWS = 50
QUARTILES = NORMAL / 2  # standard deviations of a normal distribution in the distance of its quartiles
STEADY, CHANGING = 0.1, 4.0  # quartile distance over the median of frequencies, and how often it is in temperatures
MOST_COMPARED = 1000  # rows
UNITS = {"rad/s": 2 * np.pi, "kHz": 1e-3, "mHz": 1e3, "cycles per minute": 60.0}  # and how many of them are 1 Hz
SAME, OTHER = 0.2, 0.5  # logarithms of ratios to the model's frequencies in the same and in another unit


def gross_errors(
    temperatures: Any = None, frequencies: Any = None, *, unit: str = "Hz", model: Any = None
) -> RecordFindings:
    """Look for errors with which nothing can be learned from records, in either table or in both.

    Whatever is given, it does not fail: what is no table of numbers is a finding. A year of hourly records takes some
    milliseconds.

    Parameters
    ----------
    temperatures : array-like or DataFrame of shape (n_samples, n_sensors), optional
        In degrees Celsius; NaN is allowed.
    frequencies : array-like or DataFrame of shape (n_samples, n_modes), optional
        Or responses of another kind; NaN is allowed.
    unit : str, default="Hz"
        Unit of the second table. Values in Hz have to be positive.
    model : FEModel, optional
        To whose nominal frequencies those in Hz are compared.

    Returns
    -------
    RecordFindings
        Its ``refuse_meaningless`` raises an error, its ``warnings`` are of what is doubtful, too.

    Raises
    ------
    ValueError
        If the model is no FE model.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.preprocessing import gross_errors
    >>> print(gross_errors(np.linspace(260, 310, 365)[:, np.newaxis]))
    1 finding in 365 records.
    kelvin: 'T1' lies between 260 and 310 in 365 rows, row 0 to row 364
        bounds and reports are in degrees Celsius; subtract 273.15
    """
    tables = {"temperatures": temperatures, "frequencies": frequencies}
    given = {what: table for what, table in tables.items() if table is not None}
    records = CleanedRecords.of(given, unit=unit, model=model)
    return RecordFindings(findings_table(records.findings), records.n_rows)


class CleanedRecords:
    """Temperatures and frequencies as numbers in order of time, NaN where a value is grossly wrong.

    What was found on the way is in ``findings``. Statistics on both tables make sense only if they ``belong_together``.
    """

    def __init__(self, readings: list[Reading]):
        self.readings = readings
        self.findings: list[Finding] = []
        self.belong_together = False

    @classmethod
    def of(cls, given: Mapping[str, Any], *, unit: str, model: Any) -> CleanedRecords:
        """Read temperatures, frequencies or both."""
        records = cls([Reading.of(table, what) for what, table in given.items()])
        tables = [reading for reading in records.readings if reading.is_table]
        for reading in tables:
            reading.sort(records._index_of(reading))
            reading.set_infinite_aside()
        records.findings += records._rows()
        confused = _confused(*tables, in_hertz=unit == "Hz") if len(tables) == 2 else []
        for reading in tables if not confused and records.n_rows > 1 else []:
            if reading.what == "temperatures":
                _look_at_temperatures(reading)
            else:
                _look_at_responses(reading, unit, beside_weather=len(tables) == 2)
                if model is not None and unit == "Hz":
                    check_model(model)
                    _compare_with_model(reading, model)
        records.findings += [found for reading in records.readings for found in reading.findings] + confused
        records.belong_together = len(tables) == 2 and not confused and records._have_same_rows()
        return records

    @property
    def n_rows(self) -> int:
        """Number of records, of the longer table."""
        return max((len(reading.values) for reading in self.readings), default=0)

    @property
    def have_times(self) -> bool:
        """Whether the rows have times, which may be repeated or in disorder."""
        has_stamps = any(isinstance(reading.index, pd.DatetimeIndex) for reading in self.readings)
        return has_stamps and not self.have_wrong_times

    @property
    def have_wrong_times(self) -> bool:
        """Whether the rows have times that cannot be used."""
        wrong = {"missing stamps", "equal stamps", "stamps from numbers", "stamps as text"}
        return any(found.what in wrong for found in self.findings)

    def _index_of(self, reading: Reading) -> pd.Index:
        """Labels of the rows, those of the other table for an array beside a frame."""
        frames = [one for one in self.readings if one.is_frame and len(one.values) == len(reading.values)]
        return frames[0].given_index if frames and not reading.is_frame else reading.given_index

    def outliers(self) -> pd.DataFrame:
        """Which frequencies were put aside, in the rows and columns that were given; empty where no table was."""
        F = self.readings[-1]
        far = np.zeros(F.values.shape, dtype=bool)
        far[F.order] = F.were_known & np.isnan(F.values)
        return pd.DataFrame(far, F.given_index if F.is_frame else None, pd.Index(F.columns, tupleize_cols=False))

    @property
    def have_faulty_sensors(self) -> bool:
        """Whether values of a sensor were put aside, or are of no use."""
        T = self.readings[0]
        is_useless = np.isnan(self.useful_values(T)) & (T.were_known | np.isnan(T.values).all(axis=0))
        return bool(is_useless.mean(axis=0).max() > FEW_WRONG)

    def useful_values(self, reading: Reading) -> Array:
        """Values, NaN in columns that are constant or have very few different values."""
        useless = {found.column for found in reading.findings if found.what in USELESS}
        return np.where([name in useless for name in reading.columns], np.nan, reading.values)

    def _have_same_rows(self) -> bool:
        first, second = (reading.given_index for reading in self.readings)
        are_frames = all(reading.is_frame for reading in self.readings)
        return len(first) == len(second) and (not are_frames or first.equals(second))

    def _rows(self) -> list[Finding]:
        """What is wrong with the rows, in either table and between them."""
        tables = [reading for reading in self.readings if reading.is_table]
        found = []
        if len(tables) == 2 and not self._have_same_rows():
            found.append(_different_rows(*tables))
        indexes = [reading.given_index for reading in tables if reading.is_frame]
        if len(indexes) == 2 and indexes[0].equals(indexes[1]):
            del indexes[1]
        found += [finding for index in indexes for finding in stamp_findings(index)]
        if tables:
            found += _few_rows(tables)
        return found


def _few_rows(tables: list[Reading]) -> list[Finding]:
    """Too few rows with a value in each table."""
    n_rows = min(len(reading.values) for reading in tables)
    known = np.flatnonzero(np.all([(~np.isnan(one.values[:n_rows])).any(axis=1) for one in tables], axis=0))
    if len(known) >= FEW_ROWS or (not len(known) and any(reading.findings for reading in tables)):
        return []
    kind = "few rows" if len(known) > 1 else "no rows"
    return [tables[0].finding(kind, "", known, f"{len(known)} of {n_rows} rows have values")]


def _different_rows(first: Reading, second: Reading) -> Finding:
    """Tables differ in the number of rows or in their labels."""
    rows = [len(reading.values) for reading in (first, second)]
    if rows[0] != rows[1]:
        detail = f"{rows[0]} rows of {first.what} and {rows[1]} of {second.what}"
        return Finding("different rows", "", abs(rows[0] - rows[1]), None, None, detail)
    differ = np.flatnonzero([one != other for one, other in zip(first.given_index, second.given_index, strict=True)])
    row = differ[0] if len(differ) else 0
    labels = f"{first.given_index[row]} and {second.given_index[row]}"
    detail = f"{len(differ)} of {rows[0]} rows have different labels, the first row {row}: {labels}"
    return Finding("different rows", "", len(differ), first.given_index[row], first.given_index[differ[-1]], detail)


def _confused(T: Reading, F: Reading, *, in_hertz: bool) -> list[Finding]:
    """Columns that stand in both tables, or temperatures that are frequencies and frequencies that are none."""
    modes = {content: name for name, content in _contents(F)}
    shared = [(name, modes[content]) for name, content in _contents(T) if content in modes]
    if shared:
        what = "temperatures are frequencies"
        return [T.finding(what, one, T.whole, f"{one!r} of the temperatures equals {two!r}") for one, two in shared]
    if not in_hertz or min(len(T.values), len(F.values)) < FEW_ROWS:
        return []
    (steady, is_positive), (changing, _) = (_relative_change(reading.values) for reading in (T, F))
    if not is_positive or not steady < min(STEADY, changing / CHANGING):
        return []
    detail = (
        f"half of the temperatures lie within {steady:.1%} of their median, of the frequencies within {changing:.0%}"
    )
    return [T.finding("exchanged tables", "", T.whole, detail)]


def _relative_change(values: Array) -> tuple[float, bool]:
    """Distance of the quartiles over the median of a typical column, and whether all columns are positive."""
    some = values[spread_evenly(np.arange(len(values)), MOST_COMPARED)]
    known = some[:, np.fmax.reduce(some) > np.fmin.reduce(some)]
    if not known.size:
        return np.nan, False
    low, middle, high = np.nanquantile(known, [0.25, 0.5, 0.75], axis=0)
    return float(np.median((high - low) / np.maximum(np.abs(middle), 1e-300))), bool((low > 0).all())


def _contents(reading: Reading) -> list[tuple[Any, bytes]]:
    """Name and bytes of each column that varies."""
    columns = zip(reading.columns, reading.values.T, strict=True)
    return [(name, column.tobytes()) for name, column in columns if np.fmax.reduce(column) > np.fmin.reduce(column)]


def _find_equal_columns(reading: Reading) -> None:
    seen: dict[bytes, Any] = {}
    for name, content in _contents(reading):
        if content in seen:
            detail = f"{name!r} equals {seen[content]!r} in {len(reading.values)} rows"
            reading.found("equal columns", name, reading.whole, detail)
        seen.setdefault(content, name)


class Column:
    """One column of a table, its known values in order and how often each of them occurs."""

    def __init__(self, reading: Reading, place: int):
        self.reading, self.place, self.name = reading, place, reading.columns[place]
        self._sort()

    def _sort(self) -> None:
        column = self.reading.values[:, self.place]
        known = np.sort(column)[: len(column) - np.count_nonzero(np.isnan(column))]
        first, self.counts = equal_runs(known)
        self.ordered, self.levels = known, known[first]

    def quantile(self, share: float) -> float:
        """A value of the column that this share of the known values does not exceed."""
        return float(self.ordered[int(share * (len(self.ordered) - 1))])

    @property
    def span(self) -> str:
        """Smallest and largest value as a sentence gives them."""
        return f"lies between {self.levels[0]:.6g} and {self.levels[-1]:.6g}"

    def found(self, what: str, levels: Array, detail: str) -> None:
        """Add a finding in the rows that have one of these levels."""
        rows = self._rows(levels)
        self.reading.found(what, self.name, rows, f"{self.name!r} {detail} in {self.reading.share(rows)}")

    def put_aside(self, what: str, levels: Array, unit: str = "") -> None:
        """Add a finding in the rows that have one of these levels; they, and single rows among them, become NaN."""
        if len(levels):
            named = _texts(levels) if len(levels) <= FEW_LEVELS else f"{levels[0]:.6g} to {levels[-1]:.6g}"
            self.found(what, levels, f"is {named}{unit}")
            wrong = np.isin(np.arange(len(self.reading.values)), self._rows(levels))
            self.reading.values[wrong | binary_closing(wrong, AMONG), self.place] = np.nan
            self._sort()

    def _rows(self, levels: Array) -> NDArray[np.intp]:
        column = self.reading.values[:, self.place]
        return np.flatnonzero(np.isin(column, levels) if len(levels) < len(self.levels) else ~np.isnan(column))

    def is_poor(self) -> bool:
        """Whether the column is empty or constant, or says little because it has few values; and say so."""
        n_known = len(self.ordered)
        is_named = any(found.column == self.name for found in self.reading.findings)
        if not n_known and not is_named:
            whole = self.reading.whole
            self.reading.found("missing column", self.name, whole, f"{self.name!r} is NaN in all {len(whole)} rows")
        elif len(self.levels) == 1 < n_known:
            self.found("constant", self.levels, f"is {self.levels[0]:.6g}")
        elif len(self.levels) <= FEW_VALUES and n_known >= LEAST_KNOWN:
            self.found("few values", self.levels, f"has the {len(self.levels)} values {_texts(self.levels)}")
        return len(self.levels) < 2


def _texts(levels: Array) -> str:
    return ", ".join(f"{level:.6g}" for level in levels)


def _look_at_temperatures(T: Reading) -> None:
    """Put aside what no thermometer in the open shows, and name columns in another unit."""
    sensors = columns_by_sensor(T)  # lags repeat what a sensor shows
    columns = [Column(T, places[0]) for places in sensors.values()]
    varying = []
    for column in columns:
        if _is_kelvin(column):
            column.found("kelvin", column.levels, column.span)
            continue
        _put_no_temperatures_aside(column)
        if not column.is_poor():
            varying.append(column)
    _find_equal_columns(T)
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
        is_none = beyond & (above | below | _stand_apart(levels, LOGGED))
        in_kelvin = is_none & (levels > KELVIN[0]) & (levels < KELVIN[1])
        kelvin, others = levels[in_kelvin], levels[is_none & ~in_kelvin]
        column.put_aside("kelvin", kelvin)
        column.put_aside("markers", others)
    column.put_aside("isolated level", _isolated_levels(column, JUMP))


def _stand_apart(levels: Array, some: tuple[float, ...]) -> NDArray[np.bool_]:
    """Which levels are some of these, and not near to another one."""
    gaps = np.concatenate([[np.inf], np.diff(levels), [np.inf]])
    return np.isin(levels, some) & (np.minimum(gaps[1:], gaps[:-1]) > JUMP)


def _isolated_levels(column: Column, jump: float) -> Array:
    """A few values at either end of a column that repeat exactly, farther from all others than a jump."""
    levels, repeated, gaps = column.levels, column.counts > 1, np.diff(column.levels) > jump
    isolated = np.zeros(len(levels), dtype=bool)
    for number in range(1, FEW_LEVELS + 1) if len(levels) > FEW_LEVELS + MANY_VALUES else ():
        for ends, gap in ((slice(None, number), gaps[number - 1]), (slice(-number, None), gaps[-number])):
            isolated[ends] |= gap and repeated[ends].all()
    return levels[isolated]


def _look_at_responses(F: Reading, unit: str, *, beside_weather: bool) -> None:
    """Put aside what is no frequency, or no response of another kind.

    Beside the weather, single values far from others are left to the search for exchanged modes and outliers.
    """
    in_hertz, unit = unit == "Hz", f" {unit}" if unit else ""
    for place in range(len(F.columns)):
        column = Column(F, place)
        rest = column.ordered[~np.isin(column.ordered, LOGGED)]
        if not len(rest):
            column.put_aside("markers", column.levels, unit)
        elif len(rest) < len(column.ordered):
            repeats = (column.counts > 1) | (column.levels < 0)
            logged = column.levels[np.isin(column.levels, LOGGED) & repeats]
            low, middle, high = (rest[int(share * (len(rest) - 1))] for share in (0.1, 0.5, 0.9))
            column.put_aside("markers", logged[np.abs(logged - middle) > BEYOND * (high - low)], unit)
        if in_hertz:
            column.put_aside("not positive", column.levels[column.levels <= 0], unit)
        if column.is_poor():
            continue
        middle, width = column.quantile(0.5), column.quantile(0.9) - column.quantile(0.1)
        isolated = _isolated_levels(column, BEYOND * width)
        if in_hertz:
            isolated = isolated[(isolated > OTHER_MODE * middle) | (isolated < middle / OTHER_MODE)]
        column.put_aside("isolated level", isolated if width > 0 else isolated[:0], unit)
        deviation = QUARTILES * (column.quantile(0.75) - column.quantile(0.25))
        far = np.abs(column.levels - column.quantile(0.5)) > IMPLAUSIBLE * deviation
        if deviation > 0 and not beside_weather:
            column.put_aside("implausible values", column.levels[far], unit)
    _find_equal_columns(F)


def _compare_sensors(columns: list[Column]) -> None:
    """Name sensors in another unit, or with another sign, than the others or than degrees Celsius."""
    mirrored = _opposite_signs(columns)
    columns = [column for column in columns if column not in mirrored]
    if not columns or len(mirrored) == 1 == len(columns):
        return
    middles, warmest = (np.array([column.quantile(share) for column in columns]) for share in (0.5, 0.99))
    is_warm = WARM[0] < np.median(middles) < WARM[1] or np.median(middles) < WARM[0] < WARMEST < np.median(warmest)
    if is_warm and middles.min() > FREEZING / 2 and max(column.levels[-1] for column in columns) < HOT:
        for column in columns:
            column.found("fahrenheit", column.levels, column.span)
        return
    fine = [column for column in columns if not _is_scaled(column)]
    if 2 * len(fine) <= len(columns):
        for column in fine:
            column.found("scaled temperatures", column.levels, f"{column.span}, beside others in such a unit,")
        return
    for column in fine:
        others = [other for other in fine if other is not column]
        if not (others and _is_in_another_unit(column, others)):
            beyond = (column.levels < COLDEST) | (column.levels > HOTTEST)
            column.put_aside("implausible values", column.levels[beyond])


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
                column.found("scaled temperatures", column.levels, f"{column.span}, as in degrees times {scale:g},")
            return bool(is_smooth)
    return False


def _is_in_another_unit(column: Column, others: list[Column]) -> bool:
    """Whether a sensor shows what the others do in degrees Fahrenheit, or in tenths of a degree; and say so."""
    middle, centre = column.quantile(0.5), float(np.median([other.quantile(0.5) for other in others]))
    spreads = [other.quantile(0.95) - other.quantile(0.05) for other in (column, *others)]
    ratio = spreads[0] / max(float(np.median(spreads[1:])), 1e-300)
    beside = f"{column.span} with a median of {middle:.4g}, that of the others is {centre:.4g},"
    off = abs((middle - FREEZING) / DEGREES - centre)
    if middle - centre > max(APART, 2 * off) and off < NEAR and ALIKE[0] < ratio / DEGREES < ALIKE[1]:
        column.found("fahrenheit", column.levels, beside)
        return True
    is_wide = spreads[0] > WIDE or column.levels[-1] > HOTTEST or column.levels[0] < COLDEST
    if is_wide and abs(middle / SCALES[0] - centre) < NEAR / 2 and ALIKE[0] < ratio / SCALES[0] < ALIKE[1]:
        column.found("scaled temperatures", column.levels, beside)
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
    values = np.column_stack([column.reading.values[:, column.place] for column in columns]) - middles
    standard = np.clip(np.nan_to_num(values / np.where(spreads > 0, spreads, np.inf)), -BEYOND, BEYOND)
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
            column.reading.found("opposite signs", column.name, whole, detail)
            mirrored.append(column)
            if len(columns) == 2:
                break
    return mirrored


def _compare_with_model(F: Reading, model: Any) -> None:
    """Name frequencies in another unit than the nominal ones of a model, and those of another mode."""
    nominal = np.ravel(model.frequencies(np.ones((1, len(model.parameter_names)))))
    if len(nominal) != len(F.columns):
        detail = f"{len(F.columns)} columns for {len(nominal)} modes"
        F.found("number of modes", "", F.whole, detail)
        return
    middles = median(F.values)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = {name: np.abs(np.log(middles / nominal / factor)) for name, factor in UNITS.items()}
        off["seconds, the periods"] = np.abs(np.log(middles * nominal))
        in_hertz = np.abs(np.log(middles / nominal))
    if np.isnan(in_hertz).all():
        return
    best = min(off, key=lambda name: np.nanmedian(off[name]))
    beside = f"the medians {_texts(middles)} beside {_texts(nominal)} Hz of the model"
    if np.nanmedian(off[best]) < SAME and np.nanmedian(in_hertz) > OTHER:
        F.found("unit of frequencies", "", F.whole, f"{beside} are about those in {best}; {len(F.whole)} rows")
        return
    for place, name in enumerate(F.columns):
        if in_hertz[place] > OTHER:
            fits = [unit for unit, errors in off.items() if errors[place] < SAME]
            hint = f", as in {fits[0]}" if fits else ""
            detail = f"{name!r} has the median {middles[place]:.4g}, the model {nominal[place]:.4g} Hz{hint}"
            F.found("unit of a mode", name, F.whole, detail)
