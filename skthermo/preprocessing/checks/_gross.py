"""Gross errors of records: units, markers, empty or equal columns, tables exchanged or of different times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from skthermo._tables.arrays import NORMAL, Array, check_model, median, spread_evenly
from skthermo._tables.frames import IMPLAUSIBLE
from skthermo.preprocessing.checks._column import LOGGED, Column, contents_of, find_equal_columns, texts_of
from skthermo.preprocessing.checks._kinds import Finding
from skthermo.preprocessing.checks._reading import Reading, stamp_findings
from skthermo.preprocessing.checks._record_findings import RecordFindings, findings_table
from skthermo.preprocessing.checks._sensors import look_at_temperatures

BEYOND = 3.0  # times the range of the inner 80 % of a column, from its median, of a value that is none
OTHER_MODE = 2.0  # times the median of a mode, or its inverse, of a frequency that is none of the mode
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
        If the unit is no text, or the model no FE model.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.preprocessing import gross_errors
    >>> print(gross_errors(np.linspace(260, 310, 365)[:, np.newaxis]))
    1 finding in 365 records.
    kelvin: 'T1' lies between 260 and 310 in 365 rows, row 0 to row 364
        Bounds and reports are in degrees Celsius. Subtract 273.15
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
        if not isinstance(unit, str):
            raise ValueError(f"unit is {unit!r:.100}; expected a text such as 'Hz', or ''")
        records = cls([Reading.of(table, what, unit) for what, table in given.items()])
        tables = [reading for reading in records.readings if reading.is_table]
        for reading in tables:
            reading.sort(records._index_of(reading))
            reading.set_infinite_aside()
        records.findings += records._rows()
        exchanged = _exchanged(*tables, in_hertz=unit == "Hz") if len(tables) == 2 else []
        for reading in tables if not exchanged and records.n_rows > 1 else []:
            if reading.what == "temperatures":
                look_at_temperatures(reading)
            else:
                _look_at_responses(reading, in_hertz=unit == "Hz", beside_weather=len(tables) == 2)
                if model is not None and unit == "Hz":
                    check_model(model)
                    _compare_with_model(reading, model)
        records.findings += [found for reading in records.readings for found in reading.findings] + exchanged
        records.belong_together = len(tables) == 2 and not exchanged and records._have_same_rows()
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
        wrong = {"missing-stamps", "equal-stamps", "stamps-from-numbers", "stamps-as-text"}
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
        return np.where(np.isin(np.arange(len(reading.columns)), list(reading.useless)), np.nan, reading.values)

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
    kind = "few-rows" if len(known) > 1 else "no-rows"
    return [tables[0].finding(kind, "", known, f"{len(known)} of {n_rows} rows have values")]


def _different_rows(first: Reading, second: Reading) -> Finding:
    """Tables differ in the number of rows or in their labels."""
    rows = [len(reading.values) for reading in (first, second)]
    if rows[0] != rows[1]:
        detail = f"{rows[0]} rows of {first.what} and {rows[1]} of {second.what}"
        return Finding("different-rows", "", abs(rows[0] - rows[1]), None, None, detail)
    differ = np.flatnonzero([one != other for one, other in zip(first.given_index, second.given_index, strict=True)])
    row = differ[0] if len(differ) else 0
    labels = f"{first.given_index[row]} and {second.given_index[row]}"
    detail = f"{len(differ)} of {rows[0]} rows have different labels, the first row {row}: {labels}"
    return Finding("different-rows", "", len(differ), first.given_index[row], first.given_index[differ[-1]], detail)


def _exchanged(T: Reading, F: Reading, *, in_hertz: bool) -> list[Finding]:
    """Columns that stand in both tables, or temperatures that are frequencies and frequencies that are none."""
    modes = {content: name for name, content in contents_of(F)}
    shared = [(name, modes[content]) for name, content in contents_of(T) if content in modes]
    if shared:
        what = "temperatures-are-frequencies"
        return [T.finding(what, one, T.whole, f"{one!r} of the temperatures equals {two!r}") for one, two in shared]
    if not in_hertz or min(len(T.values), len(F.values)) < FEW_ROWS:
        return []
    (steady, is_positive), (changing, _) = (_relative_change(reading.values) for reading in (T, F))
    if not is_positive or not steady < min(STEADY, changing / CHANGING):
        return []
    detail = (
        f"half of the temperatures lie within {steady:.1%} of their median, of the frequencies within {changing:.0%}"
    )
    return [T.finding("exchanged-tables", "", T.whole, detail)]


def _relative_change(values: Array) -> tuple[float, bool]:
    """Distance of the quartiles over the median of a typical column, and whether all columns are positive."""
    some = values[spread_evenly(np.arange(len(values)), MOST_COMPARED)]
    known = some[:, np.fmax.reduce(some) > np.fmin.reduce(some)]
    if not known.size:
        return np.nan, False
    low, middle, high = np.nanquantile(known, [0.25, 0.5, 0.75], axis=0)
    return float(np.median((high - low) / np.maximum(np.abs(middle), 1e-300))), bool((low > 0).all())


def _look_at_responses(F: Reading, *, in_hertz: bool, beside_weather: bool) -> None:
    """Put aside what is no frequency, or no response of another kind.

    Beside the weather, single values far from others are left to the search for exchanged modes and outliers.
    """
    for place, name in enumerate(F.columns):
        column = Column(F, place, name)
        rest = column.ordered[~np.isin(column.ordered, LOGGED)]
        if not len(rest):
            column.put_aside("placeholders", column.levels)
        elif len(rest) < len(column.ordered):
            repeats = (column.counts > 1) | (column.levels < 0)
            logged = column.levels[np.isin(column.levels, LOGGED) & repeats]
            low, middle, high = (rest[int(share * (len(rest) - 1))] for share in (0.1, 0.5, 0.9))
            column.put_aside("placeholders", logged[np.abs(logged - middle) > BEYOND * (high - low)])
        if in_hertz:
            column.put_aside("not-positive", column.levels[column.levels <= 0])
        if column.is_poor():
            continue
        middle, width = column.quantile(0.5), column.quantile(0.9) - column.quantile(0.1)
        isolated, apart = column.isolated_levels(BEYOND * width), column.levels_apart()
        if in_hertz:
            isolated, apart = (
                one[(one > OTHER_MODE * middle) | (one < middle / OTHER_MODE)] for one in (isolated, apart)
            )
        column.put_aside("isolated-level", isolated if width > 0 else isolated[:0])
        column.put_aside("another-level", apart[~np.isin(apart, isolated)])
        deviation = QUARTILES * (column.quantile(0.75) - column.quantile(0.25))
        far = np.abs(column.levels - column.quantile(0.5)) > IMPLAUSIBLE * deviation
        if deviation > 0 and not beside_weather:
            column.put_aside("implausible-values", column.levels[far])
    find_equal_columns(F)


def _compare_with_model(F: Reading, model: Any) -> None:
    """Name frequencies in another unit than the nominal ones of a model, and those of another mode."""
    nominal = np.ravel(model.frequencies(np.ones((1, len(model.parameter_names)))))
    if len(nominal) != len(F.columns):
        detail = f"{len(F.columns)} columns for {len(nominal)} modes"
        F.found("number-of-modes", "", F.whole, detail)
        return
    middles = median(F.values)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = {name: np.abs(np.log(middles / nominal / factor)) for name, factor in UNITS.items()}
        off["seconds, the periods"] = np.abs(np.log(middles * nominal))
        in_hertz = np.abs(np.log(middles / nominal))
    if np.isnan(in_hertz).all():
        return
    best = min(off, key=lambda name: np.nanmedian(off[name]))
    beside = f"the medians {texts_of(middles)} beside {texts_of(nominal)} Hz of the model"
    if np.nanmedian(off[best]) < SAME and np.nanmedian(in_hertz) > OTHER:
        F.found("unit-of-frequencies", "", F.whole, f"{beside} are about those in {best}; {len(F.whole)} rows")
        return
    for place, name in enumerate(F.columns):
        if in_hertz[place] > OTHER:
            fits = [unit for unit, errors in off.items() if errors[place] < SAME]
            hint = f", as in {fits[0]}" if fits else ""
            detail = f"{name!r} has the median {middles[place]:.4g}, the model {nominal[place]:.4g} Hz{hint}"
            F.found("unit-of-a-mode", name, F.whole, detail)
