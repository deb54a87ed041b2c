"""The gate of records: values that cannot be measurements become NaN, columns without use are left out, and doubtful
records are named."""

from __future__ import annotations

from collections.abc import Collection
from operator import itemgetter
from typing import Any

import numpy as np
import pandas as pd

from skthermo._core.arrays import check_model
from skthermo._core.warnings import warn_each
from skthermo.preprocessing.checks._beside_weather import look_at_both
from skthermo.preprocessing.checks._columns import (
    compare_with_model,
    look_at_responses,
    look_at_temperatures,
    put_stuck_aside,
)
from skthermo.preprocessing.checks._reading import Reading
from skthermo.preprocessing.checks._record_findings import (
    ASIDE_KINDS,
    LEFT_OUT_KINDS,
    WARNINGS,
    RecordFinding,
    RecordFindings,
    SetAside,
    findings_table,
)
from skthermo.preprocessing.checks._rows import (
    copies_found,
    exchanged_found,
    rows_found,
    times_found,
)


def examine(
    temperatures: Any, frequencies: Any, unit: str, model: Any
) -> tuple[list[Reading], list[RecordFinding], bool]:
    """Temperatures, frequencies or both, read, cleaned and looked at each by itself; findings about rows; and whether
    statistics of both make sense."""
    if not isinstance(unit, str):
        raise ValueError(f"unit is {unit!r:.100}; expected a text such as 'Hz', or ''")
    readings, tables, findings, indexes = [], [], [], []
    for table, what, beside in (
        (temperatures, "temperatures", frequencies),
        (frequencies, "frequencies", temperatures),
    ):
        if table is not None:
            readings.append(Reading(table, what, unit, beside))
    for reading in readings:
        if reading.values.size:
            tables.append(reading)
            if reading.is_frame and not any(map(reading.given_index.equals, indexes)):
                indexes.append(reading.given_index)
                findings += times_found(reading.given_index)
    is_pair = len(tables) == 2
    findings = (rows_found(tables) if tables else []) + findings
    copies = copies_found(tables)
    exchanged = exchanged_found(*tables) if is_pair and unit == "Hz" and not copies else []
    if exchanged or "exchanged-tables" in map(itemgetter(0), copies):
        return readings, [*findings, *copies, *exchanged], False
    for reading in tables:
        if len(reading.values) < 2:
            continue
        if reading.what == "temperatures":
            look_at_temperatures(reading)
        else:
            look_at_responses(reading, in_hertz=unit == "Hz", beside_weather=is_pair)
            if model is not None and unit == "Hz":
                check_model(model)
                compare_with_model(reading, model)
        put_stuck_aside(reading)
    return readings, [*findings, *copies], is_pair and "different-rows" not in map(itemgetter(0), findings)


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
    residual_trend : The trend of residuals of any regression.

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
    0  time-shift     305
    >>> print(check_records(year.temperatures[["T1"]] + 273.15))
    1 finding in 365 records.
    kelvin: 'T1' lies between 268.093 and 309.327 in 365 rows, 2025-01-01 to 2025-12-31
        Bounds and reports are in degrees Celsius. Subtract 273.15
    """
    readings, findings, belong_together = examine(temperatures, frequencies, unit, model)
    outliers, tables, left_out, n_rows = None, {}, {}, 0
    for reading in readings:
        tables[reading.what], reasons = reading.cleaned()
        left_out, n_rows = left_out | reasons, max(n_rows, len(reading.values))
        if reading.what == "frequencies":
            far = np.isnan(reading.values) & ~np.isnan(reading.before)
            if belong_together:
                wrong_times = {"wrong-stamps", "stamps-as-text"}.intersection(map(itemgetter(0), findings))
                far |= look_at_both(*readings, has_wrong_times=bool(wrong_times))
            index = reading.given_index if reading.is_frame else None
            outliers = pd.DataFrame(
                far[np.argsort(reading.order)], index, pd.Index(reading.columns, tupleize_cols=False)
            )
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
        Kinds of findings that do no harm to what is done with the records, such as "stuck" where the rows need not
        follow each other in time. Their values are not set aside.
    needs_all : bool, default=False
        Whether columns that would be left out are an error.
    is_baseline : bool, default=True
        Whether the records are of one healthy state. In others, damage may move values to another level, so that only
        those are set aside that stand for a missing one: infinite ones, numbers that loggers write, frequencies that
        are not positive.

    Returns
    -------
    SetAside
        The tables, what was set aside, and which columns are left out.

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
    unknown = set(exclude).difference(WARNINGS)
    if unknown:
        raise ValueError(f"exclude has {sorted(unknown)}; expected some of {[*WARNINGS]}")
    readings, findings, _ = examine(temperatures, frequencies, unit, model)
    kinds = (ASIDE_KINDS if is_baseline else {"placeholders"}).difference(exclude)
    tables, left_out, n_rows = {"temperatures": None, "frequencies": None}, {}, 0
    for reading in readings:
        findings += reading.findings
        n_rows = max(n_rows, len(reading.values))
    table = findings_table(findings)
    harmless = {*ASIDE_KINDS, *(() if needs_all else LEFT_OUT_KINDS), *exclude}
    others = RecordFindings(table[~table["what"].isin(harmless)], n_rows)
    others.refuse_meaningless()
    for reading in readings:
        reading.use(ASIDE_KINDS - kinds)
        tables[reading.what], reasons = reading.cleaned(exclude)
        left_out |= reasons
        if reading.columns and set(reading.columns) == set(reasons):
            raise ValueError(
                f"no column of the {reading.what} can be used: {'; '.join(reasons.values())}; expected measurements"
            )
    RecordFindings(table[:0], n_rows, left_out=left_out).refuse_meaningless(needs_all=needs_all)
    aside = table[table["what"].isin(LEFT_OUT_KINDS | kinds)]
    found = SetAside(**tables, table=aside, left_out=left_out, others=others)
    warn_each(found.warnings())
    return found
