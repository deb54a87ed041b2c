"""The gate of records: values that cannot be measurements become NaN, columns without use are left out, and doubtful
records are named."""

from __future__ import annotations

from collections.abc import Collection
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
    RecordFinding,
    RecordFindings,
    SetAside,
    findings_table,
)
from skthermo.preprocessing.checks._rows import different_rows_found, exchanged_found, few_rows_found, times_found


class CheckedTables:
    """Temperatures, frequencies or both, read, cleaned and looked at each by itself.

    ``findings`` are those about rows and about both tables; a reading has its own. Statistics of both make sense only
    if they ``belong_together``.
    """

    def __init__(self, temperatures: Any, frequencies: Any, *, unit: str, model: Any):
        if not isinstance(unit, str):
            raise ValueError(f"unit is {unit!r:.100}; expected a text such as 'Hz', or ''")
        self.readings, tables, frames = [], [], []
        for table, what in ((temperatures, "temperatures"), (frequencies, "frequencies")):
            if table is not None:
                self.readings.append(Reading(table, what, unit))
        for reading in self.readings:
            if reading.values.size:
                tables.append(reading)
            if reading.is_frame:
                frames.append(reading)
        self.findings: list[RecordFinding] = []
        self.n_rows = max(map(len, (reading.values for reading in self.readings)), default=0)
        for reading in tables:
            alike = [one.given_index for one in frames if len(one.values) == len(reading.values)]
            reading.sort(reading.given_index if reading.is_frame or not alike else alike[0])
        is_pair, in_hertz = len(tables) == 2, unit == "Hz"
        exchanged = exchanged_found(*tables, in_hertz=in_hertz) if is_pair else []
        self.findings += different_rows_found(*tables) if is_pair else []
        self.belong_together = is_pair and not exchanged and not self.findings
        for number, frame in enumerate(frames):
            if number == 0 or not frame.given_index.equals(frames[0].given_index):
                self.findings += times_found(frame.given_index) if frame.values.size else []
        self.findings += few_rows_found(tables) if tables else []
        self.findings += exchanged
        for reading in tables if not exchanged and self.n_rows > 1 else ():
            if reading.what == "temperatures":
                look_at_temperatures(reading)
            else:
                look_at_responses(reading, in_hertz=in_hertz, beside_weather=is_pair)
                if model is not None and in_hertz:
                    check_model(model)
                    compare_with_model(reading, model)
            put_stuck_aside(reading)

    def all_findings(self) -> list[RecordFinding]:
        """Findings about rows, then those of each table."""
        found = list(self.findings)
        for reading in self.readings:
            found += reading.findings
        return found

    def cleaned(self, exclude: Collection[str] = ()) -> dict[str, Any]:
        """The tables as they were given, without what was put aside, and the columns that cannot be used."""
        parts: dict[str, Any] = {"temperatures": None, "frequencies": None, "left_out": {}}
        for reading in self.readings:
            parts[reading.what] = reading.table()
            parts["left_out"] |= reading.left_out(exclude)
        return parts


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
    checked = CheckedTables(temperatures, frequencies, unit=unit, model=model)
    outliers, parts = None, checked.cleaned()
    for reading in checked.readings:
        if reading.what == "frequencies":
            far = np.isnan(reading.values) & ~np.isnan(reading.before)
            if checked.belong_together:
                wrong_times = {"wrong-stamps", "stamps-as-text"}.intersection(found.what for found in checked.findings)
                far |= look_at_both(*checked.readings, has_wrong_times=bool(wrong_times))
            index = reading.given_index if reading.is_frame else None
            names = pd.Index(reading.columns, tupleize_cols=False)
            outliers = pd.DataFrame(far[np.argsort(reading.order)], index, names)
    return RecordFindings(findings_table(checked.all_findings()), checked.n_rows, outliers, **parts)


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
    checked = CheckedTables(temperatures, frequencies, unit=unit, model=model)
    kinds = (ASIDE_KINDS if is_baseline else {"placeholders"}).difference(exclude)
    table = findings_table(checked.all_findings())
    harmless = {*ASIDE_KINDS, *(() if needs_all else LEFT_OUT_KINDS), *exclude}
    others = RecordFindings(table[~table["what"].isin(harmless)], checked.n_rows)
    others.refuse_meaningless()
    for reading in checked.readings:
        reading.use(ASIDE_KINDS - kinds)
    found = SetAside(table=table[table["what"].isin(LEFT_OUT_KINDS | kinds)], others=others, **checked.cleaned(exclude))
    for reading in checked.readings:
        if reading.columns and set(reading.columns) <= set(found.left_out):
            reasons = "; ".join(map(found.left_out.get, reading.columns))
            raise ValueError(f"no column of the {reading.what} can be used: {reasons}; expected measurements")
    RecordFindings(table[:0], 0, left_out=found.left_out).refuse_meaningless(needs_all=needs_all)
    warn_each(found.warnings())
    return found
