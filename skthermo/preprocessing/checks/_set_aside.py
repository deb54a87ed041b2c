"""The gate of records: values that cannot be measurements become NaN, columns without use are left out, wrong rows and
tables are errors."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, check_model, spread_evenly
from skthermo._core.frames import MISSING_CODES, Table, as_stamps, named_frame
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import warn_each
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing.checks._column_checks import (
    Reading,
    compare_with_model,
    look_at_responses,
    look_at_temperatures,
)
from skthermo.preprocessing.checks._record_findings import (
    ASIDE_KINDS,
    IMPOSSIBLE,
    LEFT_OUT_KINDS,
    RecordFinding,
    RecordFindings,
    findings_table,
    label_of,
    listed_details,
    period_of,
)
from skthermo.preprocessing.checks._stuck import stuck_columns

WRONG_TIMES = {"missing-stamps", "equal-stamps", "stamps-from-numbers", "stamps-as-text"}


@dataclass(frozen=True)
class SetAside(SavesFrames):
    """Tables with NaN in place of values that cannot be measurements, and a table of these values.

    Parameters
    ----------
    temperatures, frequencies : array-like or DataFrame, or None
        The tables as they were given, NaN where a value was set aside.
    table : DataFrame
        A row for each finding, as in `RecordFindings`: which values count as missing, and why.
    left_out : dict
        Columns that cannot be used at all, each with the reason.
    others : RecordFindings
        What else was found, which is doubtful.

    Examples
    --------
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.preprocessing import set_aside
    >>> year = make_truss_campaign(random_state=0)
    >>> found = set_aside(year.temperatures, year.frequencies)
    >>> len(found.table), found.left_out
    (0, {})
    """

    temperatures: Table | None
    frequencies: Table | None
    table: pd.DataFrame
    left_out: dict[Hashable, str]
    others: RecordFindings

    def warnings(self) -> Iterator[RecordsWarning]:
        """One warning that counts and names the values, and one that names the columns that are left out.

        Yields
        ------
        RecordsWarning
            Of kind "set-aside" or "left-out".
        """
        values = self.table[self.table["what"].isin(ASIDE_KINDS) & ~self.table["column"].isin(list(self.left_out))]
        if len(values):
            n_values = values["n_rows"].sum()
            what = (
                "1 value cannot be a measurement, and counts"
                if n_values == 1
                else (f"{n_values:,} values cannot be measurements, and count")
            )
            yield RecordsWarning(
                f"{what} as missing: {listed_details(values['detail'])}. Repair these sensors, or put NaN there",
                "set-aside",
            )
        if self.left_out:
            yield RecordsWarning(
                f"columns are left out, and nothing is said of them: {'; '.join(self.left_out.values())}. Repair these "
                "sensors, or drop the columns",
                "left-out",
            )


def set_aside(
    temperatures: Any = None,
    frequencies: Any = None,
    *,
    unit: str = "Hz",
    model: Any = None,
    exclude: Collection[str] = (),
    needs_all: bool = False,
    is_baseline: bool = True,
) -> SetAside:
    """Put NaN in place of values that cannot be measurements.

    These are infinite values, numbers that loggers write for a missing value, frequencies that are not positive, values
    at another level far from all others, and values of a stuck sensor. A column is left out if it has no value,
    a single one, if more than half of its values are set aside, or more than a fifth as another level.

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
    exclude : collection of str, default=()
        Kinds of findings that do no harm to what is done with the records, such as "stuck-sensor" where the rows need
        not follow each other in time. Their values are not set aside.
    needs_all : bool, default=False
        Whether columns that would be left out are an error.
    is_baseline : bool, default=True
        Whether the records are of one healthy state. In others, damage may move values to another level, so that only
        those are set aside that are infinite, stand for a missing one, or are frequencies that are not positive.

    Returns
    -------
    SetAside
        The tables, what was set aside, and which columns are left out.

    Raises
    ------
    ValueError
        If the unit is no text, or what is left is meaningless as a whole: tables of other units, of different rows, or
        exchanged; text; no record; or no column of a table that can be used. All of it is listed.

    Warns
    -----
    UserWarning
        One that counts and names the values, and one that names the columns.

    Examples
    --------
    >>> import warnings
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.preprocessing import set_aside
    >>> year = make_truss_campaign(random_state=0)
    >>> year.temperatures.loc["2025-03", "T1"] = 484.667
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     found = set_aside(year.temperatures, year.frequencies)
    >>> found.table[["what", "column", "n_rows"]]
               what column  n_rows
    0  placeholders     T1      31
    >>> int(found.temperatures["T1"].isna().sum())
    31
    """
    records = CleanedRecords(temperatures, frequencies, unit=unit, model=model)
    findings = findings_table(records.findings)
    kinds = (ASIDE_KINDS if is_baseline else IMPOSSIBLE).difference(exclude)
    harmless = ASIDE_KINDS | (set() if needs_all else LEFT_OUT_KINDS) | set(exclude)
    others = RecordFindings(findings[~findings["what"].isin(harmless)], records.n_rows)
    others.refuse_meaningless()
    records.set_stuck_aside(exclude)
    records.use(ASIDE_KINDS - kinds)
    left_out = records.left_out(exclude)
    for reading in records.readings:
        own = [left_out[name] for name in reading.columns if name in left_out]
        if own and len(own) == len(reading.columns):
            raise ValueError(f"no column of the {reading.what} can be used: {'; '.join(own)}; expected measurements")
    if needs_all and left_out:
        raise ValueError(f"columns cannot be used: {'; '.join(left_out.values())}; expected measurements in each")
    found = [one for reading in records.readings for one in reading.findings if one.what in LEFT_OUT_KINDS | kinds]
    result = SetAside(**records.tables(), table=findings_table(found), left_out=left_out, others=others)
    warn_each(result.warnings())
    return result


class CleanedRecords:
    """Temperatures, frequencies or both as numbers in order of time, NaN where a value is grossly wrong.

    What was found on the way is in ``findings``. Statistics on both tables make sense only if they ``belong_together``.
    """

    def __init__(self, temperatures: Any, frequencies: Any, *, unit: str, model: Any):
        if not isinstance(unit, str):
            raise ValueError(f"unit is {unit!r:.100}; expected a text such as 'Hz', or ''")
        given = {"temperatures": temperatures, "frequencies": frequencies}
        self.given = [table for table in given.values() if table is not None]
        self.readings = [Reading(table, what, unit) for what, table in given.items() if table is not None]
        self.n_rows = max((len(reading.values) for reading in self.readings), default=0)
        tables = [reading for reading in self.readings if reading.is_table]
        for reading in tables:
            frames = [one for one in self.readings if one.is_frame and len(one.values) == len(reading.values)]
            reading.sort(reading.given_index if reading.is_frame or not frames else frames[0].given_index)
        differing = _different_rows(*tables) if len(tables) == 2 else []
        exchanged = _exchanged(*tables, in_hertz=unit == "Hz") if len(tables) == 2 else []
        self.findings = [*differing, *_rows_found(tables)]
        self.have_wrong_times = any(found.what in WRONG_TIMES for found in self.findings)
        self.belong_together = len(tables) == 2 and not differing and not exchanged
        for reading in tables if not exchanged and self.n_rows > 1 else []:
            if reading.what == "temperatures":
                look_at_temperatures(reading)
            else:
                look_at_responses(reading, in_hertz=unit == "Hz", beside_weather=len(tables) == 2)
                if model is not None and unit == "Hz":
                    check_model(model)
                    compare_with_model(reading, model)
        for reading in self.readings:
            self.findings += reading.findings
        self.findings += exchanged

    def outliers(self) -> pd.DataFrame | None:
        """Which frequencies were put aside, in the rows and columns that were given; None where none were."""
        F = self.readings[-1] if self.readings else None
        if F is None or F.what != "frequencies":
            return None
        far = np.zeros(F.values.shape, dtype=bool)
        far[F.order] = F.were_known & np.isnan(F.values)
        return pd.DataFrame(far, F.given_index if F.is_frame else None, pd.Index(F.columns, tupleize_cols=False))

    def set_stuck_aside(self, exclude: Collection[str] = ()) -> None:
        """Make values NaN in rows in which a sensor or a mode was stuck."""
        for reading in self.readings:
            what = "stuck-sensor" if reading.what == "temperatures" else "stuck-mode"
            for place, rows in () if what in exclude else stuck_columns(reading.values):
                name, value = reading.columns[place], f"{reading.values[rows[0], place]:.6g}{reading.unit}"
                reading.found(what, name, rows, f"{name!r} is {value} in {reading.share(rows)}")
                reading.set_aside(what, rows, place)

    def use(self, kinds: Collection[str]) -> None:
        """Values that were put aside for these kinds of findings are used as they were given."""
        for reading in self.readings:
            for kind, rows, place, before in reversed(reading.aside):
                if kind in kinds:
                    reading.values[rows, place] = before

    def left_out(self, exclude: Collection[str] = ()) -> dict[Hashable, str]:
        """Columns without a value or with one, and columns of which most values were set aside, with the reasons."""
        reasons: dict[Hashable, str] = {}
        for reading in self.readings:
            known = np.count_nonzero(reading.were_known, axis=0)
            n_aside = np.count_nonzero(reading.were_known & np.isnan(reading.values), axis=0)
            for place, name in enumerate(reading.columns):
                own: list[RecordFinding] = [found for found in reading.findings if found.column == name]
                elsewhere = sum(found.n_rows for found in own if found.what == "another-level")
                useless = [found for found in own if found.what in LEFT_OUT_KINDS and found.what not in exclude]
                # of two levels, it is not certain which one is right
                if n_aside[place] > 0.5 * known[place] or elsewhere > 0.2 * known[place]:
                    reasons[name] = "; ".join(found.detail for found in own if found.what in ASIDE_KINDS)
                elif useless:
                    reasons[name] = f"{useless[0].detail} ({useless[0].what})"
        return reasons

    def tables(self) -> dict[str, Table | None]:
        """Temperatures and frequencies in the order of rows that were given; None where they were not given."""
        tables: dict[str, Table | None] = {"temperatures": None, "frequencies": None}
        for reading, given in zip(self.readings, self.given, strict=True):
            values = np.empty_like(reading.values)
            values[reading.order] = reading.values
            tables[reading.what] = named_frame(given, values)
        return tables

    def useful_values(self, reading: Reading) -> Array:
        """Values, NaN in columns that are constant or have very few different values."""
        return np.where(np.isin(np.arange(len(reading.columns)), list(reading.useless)), np.nan, reading.values)


def _different_rows(first: Reading, second: Reading) -> list[RecordFinding]:
    """Tables that differ in the number of rows or in their labels."""
    what, here, there = "different-rows", first.given_index, second.given_index
    if len(here) != len(there):
        detail = f"{len(here)} rows of {first.what} and {len(there)} of {second.what}"
        return [RecordFinding(what, "", abs(len(here) - len(there)), None, None, detail)]
    if not (first.is_frame and second.is_frame) or here.equals(there):
        return []
    differ = np.flatnonzero([one != other for one, other in zip(here, there, strict=True)])
    row = differ[0] if len(differ) else 0
    detail = (
        f"{len(differ)} of {len(here)} rows have different labels, the first row {row}: {here[row]} and {there[row]}"
    )
    return [RecordFinding(what, "", len(differ), here[row], here[differ[-1]], detail)]


def _exchanged(T: Reading, F: Reading, *, in_hertz: bool) -> list[RecordFinding]:
    """Columns that stand in both tables, or temperatures that are frequencies and frequencies that are none."""
    modes = {content: name for name, content in F.contents()}
    found, details = [], {}
    for name, content in T.contents():
        if content in modes:
            details[name] = f"{name!r} of the temperatures equals {modes[content]!r}"
    what = "temperatures-are-frequencies" if details else "exchanged-tables"
    if not details and in_hertz and min(len(T.values), len(F.values)) >= 50:
        (steady, is_positive), (changing, _) = _relative_change(T.values), _relative_change(F.values)
        if is_positive and steady < min(0.1, changing / 4):
            part = f"{steady:.1%} of their median, of the frequencies within {changing:.0%}"
            details[""] = f"half of the temperatures lie within {part}"
    for name, detail in details.items():
        found.append(RecordFinding.in_rows(T.index, what, name, T.whole, detail, period=True))
    return found


def _relative_change(values: Array) -> tuple[float, bool]:
    """Distance of the quartiles over the median of a typical column, and whether all columns are positive."""
    some = values[spread_evenly(np.arange(len(values)), 1000)]
    known = some[:, np.fmax.reduce(some) > np.fmin.reduce(some)]
    if not known.size:
        return np.nan, False
    low, middle, high = np.nanquantile(known, [0.25, 0.5, 0.75], axis=0)
    return float(np.median((high - low) / np.maximum(np.abs(middle), 1e-300))), bool((low > 0).all())


def _rows_found(tables: list[Reading]) -> Iterator[RecordFinding]:
    """What is wrong with the times of rows, and whether few rows have a value in each table."""
    indexes = [reading.given_index for reading in tables if reading.is_frame]
    if len(indexes) == 2 and indexes[0].equals(indexes[1]):
        del indexes[1]
    for index in indexes:
        yield from _stamps_found(index) if isinstance(index, pd.DatetimeIndex) else _labels_found(index)
    if not tables:
        return
    n_rows = min(len(reading.values) for reading in tables)
    is_known = np.ones(n_rows, dtype=bool)
    for reading in tables:
        is_known &= ~np.isnan(reading.values[:n_rows]).all(axis=1)
    known = np.flatnonzero(is_known)
    if len(known) < 50 and (len(known) or not any(reading.findings for reading in tables)):
        what, detail = "few-rows" if len(known) > 1 else "no-rows", f"{len(known)} of {n_rows} rows have values"
        yield RecordFinding.in_rows(tables[0].index, what, "", known, detail, period=True)


def _stamps_found(index: pd.DatetimeIndex) -> Iterator[RecordFinding]:
    n_rows, everything = len(index), np.arange(len(index))
    missing = np.flatnonzero(index.isna())
    if len(missing):
        detail = f"{len(missing)} of {n_rows} rows, the first row {missing[0]}"
        yield RecordFinding.in_rows(index, "missing-stamps", "", missing, detail)
        return
    try:
        stamps = index.as_unit("ns").asi8
    except ValueError:  # beyond the years that nanoseconds reach
        yield RecordFinding.in_rows(index, "stamps-from-numbers", "", everything, f"{index.min()} to {index.max()}")
        return
    steps = np.diff(stamps)
    if n_rows > 1 and not steps.any():
        detail = f"{label_of(index[0])} in all {n_rows} rows"
        yield RecordFinding.in_rows(index, "equal-stamps", "", everything, detail)
        return
    is_early = 0 <= stamps.max() < pd.Timestamp("1970-03-01").value  # as other numbers are that count nanoseconds
    if n_rows > 1 and is_early and np.median(np.abs(steps)) < pd.Timedelta("1min").value:
        detail = f"{index[0]} to {index[-1]} in {n_rows} rows, all at the beginning of 1970"
        yield RecordFinding.in_rows(index, "stamps-from-numbers", "", everything, detail)
        return
    again = np.flatnonzero(index.duplicated())
    if len(again):
        again = again[np.argsort(stamps[again], kind="stable")]
        detail = f"{len(again)} of {n_rows} rows have the time of another, {period_of(index, again)}"
        yield RecordFinding.in_rows(index, "repeated-stamps", "", again, detail)
    late = 1 + np.flatnonzero(steps < 0)
    if len(late):
        detail = f"{len(late)} of {n_rows} rows are earlier than the row before, the first row {late[0]}"
        yield RecordFinding.in_rows(index, "unsorted-stamps", "", late, f"{detail} ({label_of(index[late[0]])})")


def _labels_found(index: pd.Index) -> Iterator[RecordFinding]:
    """Labels that look like times although they are none."""
    detail = ""
    if len(index) > 1 and pd.api.types.is_integer_dtype(index.dtype) and not isinstance(index, pd.MultiIndex):
        months = index.to_numpy() // 100 % 100
        if 19500101 <= index.min() < index.max() <= 21001231 and ((months >= 1) & (months <= 12)).all():
            detail = f"the index holds dates as integers, such as {index[0]}"
    try:
        as_stamps(index)
    except Exception as error:  # labels of users may be anything
        reason = str(error).partition(";")[0].replace("X has", "the index has").replace("of X ", "")
        detail = f"{reason:.150}"
    if detail:
        yield RecordFinding.in_rows(index, "stamps-as-text", "", np.arange(len(index)), detail)


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
        is_target = baseline.columns.isin(targets)
        found = cls.beside(*_range(baseline.to_numpy()))
        lowest, highest = np.where(is_target, -np.inf, found.lowest), np.where(is_target, np.inf, found.highest)
        return replace(found, lowest=lowest, highest=highest)

    @classmethod
    def beside(cls, least: Array, most: Array) -> Plausible:
        """Temperatures where these are known: none in kelvin, and none that is 100 degrees beyond them."""
        return cls(np.fmin(least - 100, -80), np.fmax(most + 100, 100), least, most)

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
