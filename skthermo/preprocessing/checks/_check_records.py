"""The gate of records: values that cannot be measurements become NaN, columns without use are left out, and doubtful
records are named."""

from __future__ import annotations

from collections.abc import Collection, Hashable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.frames import as_stamps, of_a_wrong_clock
from skthermo._core.warnings import warn_each
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing.checks._beside_weather import look_at_both, looks_exchanged
from skthermo.preprocessing.checks._columns import Reading, look_at
from skthermo.preprocessing.checks._record_findings import (
    ASIDE_REASONS,
    WARNINGS,
    RecordFinding,
    RecordFindings,
    findings_table,
    period_of,
)


def examine(
    temperatures: Any, frequencies: Any, unit: str, model: Any
) -> tuple[list[Reading], list[RecordFinding], bool]:
    """Temperatures, frequencies or both, read, cleaned and looked at each by itself; findings about rows; and whether
    statistics of both make sense."""
    if not isinstance(unit, str):
        raise ValueError(f"unit is {unit!r:.100}; expected a text such as 'Hz', or ''")
    pairs = (temperatures, "temperatures", frequencies), (frequencies, "frequencies", temperatures)
    readings = [Reading(table, what, unit, beside) for table, what, beside in pairs if table is not None]
    tables = [reading for reading in readings if reading.values.size]
    findings = rows_found(tables) if tables else []
    are_alike = len(tables) == 2 and tables[0].given_index.equals(tables[1].given_index)
    for reading in tables[:1] if are_alike else tables:
        findings += times_found(reading.given_index) if reading.is_frame else []
    is_pair, copies = len(tables) == 2, copies_found(tables)
    if is_pair and unit == "Hz" and not copies and looks_exchanged(*(reading.values for reading in tables)):
        detail = "the temperatures vary less, relative to their median, than the frequencies do"
        copies = [RecordFinding.in_rows(tables[0].index, "exchanged-tables", "", None, detail, meaningless=True)]
    if any(one.what == "exchanged-tables" for one in copies):
        return readings, [*findings, *copies], False
    for reading in tables:
        if len(reading.values) > 1:
            look_at(reading, unit, model, beside_weather=is_pair)
    return readings, [*findings, *copies], is_pair and all(one.what != "different-rows" for one in findings)


def check_records(
    temperatures: Any = None, frequencies: Any = None, *, unit: str = "Hz", model: Any = None
) -> RecordFindings:
    """Look at temperatures and frequencies for faults that would otherwise be learned.

    It looks for gross errors first: arguments that are no tables of numbers, wrong times, numbers that stand for
    missing values, other units, empty, constant or equal columns, stuck sensors and modes, tables that are exchanged or
    have different rows. No argument makes it fail. Such values are then left out, and it looks for modes exchanged in
    some rows, outliers, temperatures of another time, and weather that explains nothing. A finding is a reason to look
    at the records, no proof of a fault.

    Parameters
    ----------
    temperatures : array-like or DataFrame of shape (n_samples, n_sensors), optional
        In degrees Celsius; NaN is allowed.
    frequencies : array-like or DataFrame of shape (n_samples, n_modes), optional
        Of the healthy structure, in Hz, or another quantity that follows the weather; NaN is allowed.
    unit : str, default="Hz"
        Unit of the second table, as the findings give it: "" for parameters, which are multipliers. Values in Hz have
        to be positive.
    model : FEModel, optional
        The second table's modes are compared with its nominal frequencies, which shows other units and other modes.

    Returns
    -------
    RecordFindings
        Its ``table`` has a row for each finding, ``summary()`` a line; ``temperatures`` and ``frequencies`` are the
        cleaned tables; ``refuse_meaningless`` raises an error.

    Raises
    ------
    ValueError
        If the unit is no text, or the model no FE model. Tables never raise an error.

    See Also
    --------
    HampelFilter : Puts NaN in place of outliers.

    Notes
    -----
    :doc:`/guide/records_theory` states each test, :doc:`/guide/warnings` explains its findings. The ``severity`` of a
    gross error is "meaningless" if results of a fit would be meaningless.

    Examples
    --------
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.preprocessing import check_records
    >>> year = make_truss_campaign(random_state=0)
    >>> print(check_records(year.temperatures, year.frequencies))
    No finding in 365 records.
    >>> late = year.frequencies.shift(60)
    >>> check_records(year.temperatures, late).table[["what", "n_rows"]]
                 what  n_rows
    0  different-rows     305
    >>> print(check_records(year.temperatures[["T1"]] + 273.15))
    1 finding in 365 records.
    wrong-unit: 'T1' lies between 268.093 and 309.327, as in kelvin, in 365 rows, 2025-01-01 to 2025-12-31
        They are read as degrees Celsius and Hz. Convert them, order modes as the model does, or give its mass and
        stiffness in kg and N/m
    """
    readings, findings, belong_together = examine(temperatures, frequencies, unit, model)
    outliers, tables, left_out, n_rows = None, {}, {}, 0
    for reading in readings:
        tables[reading.what], reasons = reading.cleaned()
        left_out, n_rows = left_out | reasons, max(n_rows, len(reading.values))
        if reading.what == "frequencies":
            far = np.isnan(reading.values) & ~np.isnan(reading.before)
            if belong_together:
                has_wrong_times = any(one.what == "wrong-stamps" and one.is_meaningless for one in findings)
                far |= look_at_both(*readings, has_wrong_times=has_wrong_times)
            columns = pd.Index(reading.columns, tupleize_cols=False)
            outliers = pd.DataFrame(far[np.argsort(reading.order)], reading.given_index, columns)
        findings += reading.findings
    return RecordFindings(findings_table(findings), n_rows, outliers, **tables, left_out=left_out)


def set_aside(
    temperatures: Any = None,
    frequencies: Any = None,
    *,
    unit: str = "Hz",
    model: Any = None,
    exclude: Collection[str] = (),
    needs_all: bool = False,
    is_baseline: bool = True,
) -> tuple[RecordFindings, list[RecordsWarning]]:
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
        Kinds of findings that are no error in these records and leave no column out, such as "few-records"; a column
        of a baseline needs a value in any case. Or reasons for which no value is set aside, such as "stuck" where the
        rows need not follow each other in time.
    needs_all : bool, default=False
        Whether columns that would be left out are an error.
    is_baseline : bool, default=True
        Whether the records are of one healthy state. In others, damage may move values to another level, so that only
        those are set aside that stand for a missing one: infinite ones, numbers that loggers write, frequencies that
        are not positive.

    Returns
    -------
    RecordFindings
        The tables, NaN where a value was set aside, and columns that are left out; its ``table`` has these alone.
    list of RecordsWarning
        What else is doubtful.

    Raises
    ------
    ValueError
        If the unit is no text, a kind to exclude is unknown, or what is left is meaningless as a whole: tables of
        other units, of different rows, or exchanged; text; no record; or no column of a table that can be used. All of
        it is listed.

    Warns
    -----
    UserWarning
        One that counts and names the values, and one that names the columns.

    Examples
    --------
    >>> import warnings
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.preprocessing.checks import set_aside
    >>> year = make_truss_campaign(random_state=0)
    >>> year.temperatures.loc["2025-03", "T1"] = 484.667
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     found, doubts = set_aside(year.temperatures, year.frequencies)
    >>> found.table[["what", "column", "n_rows"]]
               what column  n_rows
    0  placeholders     T1      31
    >>> int(found.temperatures["T1"].isna().sum())
    31
    """
    known = [*WARNINGS, *sorted(ASIDE_REASONS)]
    unknown = set(exclude).difference(known)
    if unknown:
        raise ValueError(f"exclude has {sorted(unknown)}; expected some of {known}")
    readings, findings, _ = examine(temperatures, frequencies, unit, model)
    reasons = (ASIDE_REASONS if is_baseline else {"placeholders"}).difference(exclude)
    needs_change = "useless-column" not in exclude
    every = [*findings, *(one for reading in readings for one in reading.findings)]
    doubtful = [one for one in every if one.what not in ASIDE_REASONS and (needs_all or not one.is_useless_column)]
    doubtful = [one for one in doubtful if not one.is_meaningless or one.what not in exclude]
    n_rows = max((len(reading.values) for reading in readings), default=0)
    others = RecordFindings(findings_table(doubtful), n_rows)
    others.refuse_meaningless()
    tables, left_out = dict[str, Any](), dict[Hashable, str]()
    for reading in readings:
        reading.use(ASIDE_REASONS - reasons)
        options = {"needs_change": needs_change, "needs_values": needs_change or is_baseline}
        tables[reading.what], useless = reading.cleaned(**options)
        left_out |= useless
        if reading.columns and set(reading.columns) == set(useless):
            why = "; ".join(useless.values())
            raise ValueError(f"no column of the {reading.what} can be used: {why}; expected measurements")
    aside = [one for one in every if one.is_useless_column or one.what in reasons]
    found = RecordFindings(findings_table(aside), n_rows, **tables, left_out=left_out)
    found.refuse_meaningless(exclude={"useless-column"}, needs_all=needs_all)
    warn_each(found.warnings())
    return found, list(others.warnings())


def times_found(index: pd.Index) -> list[RecordFinding]:
    """What is wrong with the times of rows."""

    def found(rows: NDArray | None, detail: str, **options: bool) -> RecordFinding:
        return RecordFinding.in_rows(index, "wrong-stamps", "", rows, detail, **options)

    n_rows = len(index)
    if not isinstance(index, pd.DatetimeIndex):
        detail = labels_found(index)
        return [found(None, detail, period=False)] if detail else []
    if index.hasnans:
        missing = np.flatnonzero(index.isna())
        detail = f"{len(missing)} of {n_rows} rows have no time, the first row {missing[0]}"
        return [found(missing, detail, period=False, meaningless=True)]
    try:
        stamps = index.as_unit("ns").asi8
    except ValueError:
        return [found(None, "beyond the years from 1678 to 2262, which nanoseconds reach", meaningless=True)]
    steps = np.diff(stamps)
    if n_rows > 1 and not steps.any():
        return [found(None, f"all {n_rows} rows have one time", meaningless=True)]
    is_early = n_rows > 1 and 0 <= stamps.max() < pd.Timestamp("1970-03-01").value
    if is_early and np.median(np.abs(steps)) < pd.Timedelta("1min").value:
        detail = f"{n_rows} rows are at the beginning of 1970, as numbers are that count nanoseconds"
        return [found(None, detail, meaningless=True)]
    findings, again, late = [], np.flatnonzero(index.duplicated()), 1 + np.flatnonzero(steps < 0)
    if len(again):
        again = again[np.argsort(stamps[again], kind="stable")]
        findings.append(found(again, f"{len(again)} of {n_rows} rows have the time of another"))
    if (wrong := of_a_wrong_clock(index)).any():
        detail = f"{wrong.sum()} of {n_rows} rows are stamped far from the others, and count as missing"
        findings.append(found(wrong, detail))
    years = index.year[[0, n_rows // 2, -1]] if n_rows else [2000]
    if max(years) < 1990 or min(years) > 2069:
        findings.append(found(None, f"all {n_rows} rows are of {years[0]}, as of a clock that was not set"))
    if len(late):
        detail = f"{len(late)} of {n_rows} rows are earlier than the row before, the first row {late[0]}"
        findings.append(found(late, f"{detail} ({period_of(index, late[:1])})", period=False))
    return findings


def labels_found(index: pd.Index) -> str:
    """What is wrong with labels that look like times although they are none; an empty text for others."""
    try:
        as_stamps(index)
    except Exception as error:  # labels of users may be anything
        return f"{str(error).partition(';')[0].replace('X has', 'the index has').replace('of X ', ''):.150}"
    if len(index) > 1 and pd.api.types.is_integer_dtype(index.dtype) and not isinstance(index, pd.MultiIndex):
        months = index.to_numpy() // 100 % 100
        if 19500101 <= index.min() < index.max() <= 21001231 and ((months >= 1) & (months <= 12)).all():
            return f"the index holds dates as integers, such as {index[0]}"
    return ""


def rows_found(tables: list[Reading]) -> list[RecordFinding]:
    """Whether tables differ in the number of rows or in their labels, and whether few rows have a value in each."""
    found, first, last = [], tables[0], tables[-1]
    here, there, n_findings = first.given_index, last.given_index, len(first.findings) + len(last.findings)
    if len(here) != len(there):
        detail = f"{len(here)} rows of {first.what} and {len(there)} of {last.what}"
        found.append(RecordFinding("different-rows", "", abs(len(here) - len(there)), None, None, detail, True))
    elif first.is_frame and last.is_frame and not here.equals(there):
        rows = np.array([row for row, pair in enumerate(zip(here, there, strict=True)) if pair[0] != pair[1]] or [0])
        detail = f"{len(rows)} of {len(here)} rows have different labels, the first row {rows[0]}"
        detail = f"{detail}: {here[rows[0]]} and {there[rows[0]]}"
        found.append(RecordFinding.in_rows(here, "different-rows", "", rows, detail, period=False, meaningless=True))
    n_rows = min(len(here), len(there))
    known = np.flatnonzero(np.all([~np.isnan(one.values[:n_rows]).all(axis=1) for one in (first, last)], axis=0))
    if len(known) < 50 and (len(known) or not n_findings):
        detail, is_error = f"{len(known)} of {n_rows} rows have values", len(known) < 2
        found.append(RecordFinding.in_rows(first.index, "few-records", "", known, detail, meaningless=is_error))
    return found


def copies_found(tables: list[Reading]) -> list[RecordFinding]:
    """Columns that vary and are copies of another one, in their table or in both."""
    found, seen = [], {}
    for table in tables:
        for place in np.flatnonzero(np.fmax.reduce(table.values) > np.fmin.reduce(table.values)):
            name = table.columns[place]
            owner, other = seen.setdefault(table.values[:, place].tobytes(), (table, place))
            what, detail = "useless-column", f"{name!r} equals {owner.columns[other]!r} in {len(table.values)} rows"
            if owner is not table:
                what, detail = "exchanged-tables", f"{owner.columns[other]!r} of the temperatures equals {name!r}"
            if (owner, other) != (table, place):
                is_error = owner is not table
                found.append(RecordFinding.in_rows(table.index, what, name, None, detail, meaningless=is_error))
    return found
