"""Values that cannot be count as missing, and columns of which most are such, or that say nothing, are left out."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo._estimators.warnings import warn_each
from skthermo._tables.frames import Table, frame_like
from skthermo._tables.saved_frames import SavesFrames
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing.checks._gross import CleanedRecords
from skthermo.preprocessing.checks._kinds import IMPOSSIBLE, LEFT_OUT, SET_ASIDE, Finding
from skthermo.preprocessing.checks._reading import Reading
from skthermo.preprocessing.checks._record_findings import RecordFindings, findings_table, listed_details
from skthermo.preprocessing.checks._signs import stuck_columns

MOST, MANY = 0.5, 0.2
"""Shares of the values of a column, with more than which set aside the rest is not trusted: of any kind, and of values
at another level, of which it is not certain which level is right."""


@dataclass(frozen=True)
class SetAside(SavesFrames):
    """Tables of records without values that cannot be, and what has become of them.

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
        values = self.table[self.table["what"].isin(SET_ASIDE) & ~self.table["column"].isin(list(self.left_out))]
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
    """Records without values that cannot be.

    Infinite values, numbers that loggers write for a missing one, frequencies that are not positive, values at another
    level far from all others, and those of a sensor that is stuck become NaN. A column is left out if it has no value,
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
    tables = {"temperatures": temperatures, "frequencies": frequencies}
    given = {what: table for what, table in tables.items() if table is not None}
    records = CleanedRecords.of(given, unit=unit, model=model)
    findings = findings_table(records.findings)
    kinds = (SET_ASIDE if is_baseline else IMPOSSIBLE).difference(exclude)
    harmless = SET_ASIDE | (set() if needs_all else LEFT_OUT) | set(exclude)
    others = RecordFindings(findings[~findings["what"].isin(harmless)], records.n_rows)
    others.refuse_meaningless()
    left_out: dict[Hashable, str] = {}
    for reading in records.readings:
        _set_runs_aside(reading, exclude)
        reading.restore(kinds)
        own = dict(_left_out(reading, exclude))
        if own and len(own) == len(reading.columns):
            raise ValueError(
                f"no column of the {reading.what} can be used: {'; '.join(own.values())}; expected measurements"
            )
        left_out |= own
    if needs_all and left_out:
        raise ValueError(f"columns cannot be used: {'; '.join(left_out.values())}; expected measurements in each")
    found = [finding for reading in records.readings for finding in reading.findings]
    cleaned = {one.what: _as_given(one, given[one.what]) for one in records.readings}
    result = SetAside(
        cleaned.get("temperatures"),
        cleaned.get("frequencies"),
        findings_table(one for one in found if one.what in LEFT_OUT.union(kinds)),
        left_out,
        others,
    )
    warn_each(result.warnings())
    return result


def _set_runs_aside(reading: Reading, exclude: Collection[str]) -> None:
    what = "stuck-sensor" if reading.what == "temperatures" else "stuck-mode"
    for place, rows in () if what in exclude else stuck_columns(reading.values):
        name, value = reading.columns[place], f"{reading.values[rows[0], place]:.6g}{reading.unit}"
        reading.found(what, name, rows, f"{name!r} is {value} in {reading.share(rows)}")
        reading.set_aside(what, rows, place)


def _left_out(reading: Reading, exclude: Collection[str]) -> Iterator[tuple[Hashable, str]]:
    """Columns that have no value or one, and those of which most values were set aside, each with a reason."""
    known = np.count_nonzero(reading.were_known, axis=0)
    set_aside = np.count_nonzero(reading.were_known & np.isnan(reading.values), axis=0)
    for place, name in enumerate(reading.columns):
        own: list[Finding] = [found for found in reading.findings if found.column == name]
        elsewhere = sum(found.n_rows for found in own if found.what == "another-level")
        if set_aside[place] > MOST * known[place] or elsewhere > MANY * known[place]:
            yield name, "; ".join(found.detail for found in own if found.what in SET_ASIDE)
        else:
            useless = [found for found in own if found.what in LEFT_OUT and found.what not in exclude]
            if useless:
                yield name, f"{useless[0].detail} ({useless[0].what})"


def _as_given(reading: Reading, table: Any) -> Table:
    """The cleaned values in the rows of a table."""
    values = np.empty_like(reading.values)
    values[reading.order] = reading.values
    return frame_like(table, values, reading.columns)
