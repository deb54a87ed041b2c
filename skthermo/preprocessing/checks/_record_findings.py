"""Findings about records: their kinds, consequences and remedies; as a table, text, warnings and an error."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Iterator
from dataclasses import dataclass, field
from datetime import time
from typing import Any, NamedTuple

import pandas as pd
from numpy.typing import NDArray

from skthermo._core.frames import Table
from skthermo._core.saved_frames import SavesFrames
from skthermo.exceptions import RecordsWarning

WARNINGS = {
    "no-table": "the argument is no table of numbers: {}. Nothing can be learned from it. Give a DataFrame or a "
    "two-dimensional array of numbers, a row for each record, and each column a name of its own, one text each",
    "different-rows": "the tables have different rows: {}. Frequencies would be compared with the temperatures of "
    "other times. Join the tables by their times",
    "no-rows": "there are too few records: {}. Nothing can be learned from them. Give the records of a year, or at "
    "least of weeks",
    "few-rows": "there are few records: {}. Outliers and shifts cannot be distinguished from chance. Give the records "
    "of a year, or at least of weeks",
    "wrong-stamps": "times are missing, all equal, or read in the wrong unit: {}. Order and duration of the records "
    "are unknown. Drop rows without a time, and read the others by pandas.to_datetime with format= or unit=",
    "stamps-as-text": "the index holds times that are no DatetimeIndex: {}. Rows would count as equally spaced, in "
    "the given order. Convert the index by pandas.to_datetime",
    "repeated-stamps": "times occur more than once: {}. Lags and memory cannot know which of the rows was earlier. "
    "Keep one row for each time, such as by groupby(level=0).mean()",
    "unsorted-stamps": "rows are not in order of time: {}. Folds and lags take rows for periods of time. Sort them by "
    "sort_index()",
    "missing-column": "a column has no value: {}. Nothing can be learned from it. Leave it out, or check why it is "
    "empty",
    "constant": "a column is constant: {}. It carries no information, and its spread of zero makes any change "
    "infinite. Leave it out",
    "placeholders": "values stand for missing ones: {}. They count as missing. Put NaN there",
    "another-level": "values are far from all others: {}. They count as missing. Put NaN there",
    "implausible-values": "values are implausible: {}. They count as missing. Put NaN there",
    "stuck": "values only repeat: {}. They count as missing. Put NaN where a sensor or a mode is stuck",
    "few-values": "a column has very few different values: {}. Its resolution hides the effect of the weather. Check "
    "rounding and the settings of the logger",
    "equal-columns": "columns are equal: {}. One channel counts twice, and another is missing. Keep one of them, and "
    "check where the other was read from",
    "kelvin": "temperatures look like kelvin: {}. Bounds and reports are in degrees Celsius. Subtract 273.15",
    "unit-of-temperatures": "temperatures have another unit or sign: {}. Frost and reports would be wrong by many "
    "degrees. Convert them to degrees Celsius",
    "exchanged-tables": "temperatures and frequencies look exchanged: {}. Frequencies would be predicted from "
    "frequencies, which hides all damage. Give temperatures in the first table only, and frequencies in the second",
    "unit-of-frequencies": "frequencies are not those of the model's modes: {}. Changes would be read as those of "
    "another mode or by a wrong factor. Give Hz and a column for each mode of the model, or model.with_modes of the "
    "modes that match_modes finds",
    "unit-of-a-mode": "a mode is far from the model's: {}. Its changes would be read as changes of another mode or "
    "unit. Convert it to Hz, or order the columns as the model's modes",
    "no-thermal-effect": "the temperatures explain nothing of the frequencies: {}. Nothing can be compensated by "
    "them. Check whether the rows of both tables belong together",
    "time-shift": "temperatures of other rows explain the frequencies better: {}. The weather of another time would "
    "be learned. Join the tables by their times",
    "exchanged-modes": "modes look exchanged in some rows: {}. The scatter of both would hide damage. Exchange them "
    "back, or track modes by shape",
    "frequency-outliers": "frequencies are far from their neighbours in time and from a regression on the weather: {}. "
    "Impossible values are set aside, the others widen the spread of a baseline. Put NaN where a value is wrong, as "
    "HampelFilter does",
}
"""By kind: the finding, with a place for details; its consequence; the remedy."""

ARE_MEANINGLESS = frozenset(
    {
        *("no-table", "different-rows", "no-rows", "wrong-stamps", "missing-column", "constant", "kelvin"),
        *("exchanged-tables", "unit-of-frequencies"),
    }
)
"""Kinds with which no result of a fit means anything."""

ASIDE_KINDS = frozenset({"placeholders", "another-level", "implausible-values", "stuck"})
"""Kinds of values that cannot be measurements, which count as missing."""

LEFT_OUT_KINDS = frozenset({"missing-column", "constant"})
"""Kinds of columns that say nothing."""


class RecordFinding(NamedTuple):
    """A finding in a column: its kind, in how many rows, from which row to which, and a sentence that says more."""

    what: str
    column: Hashable
    n_rows: int
    first: Hashable
    last: Hashable
    detail: str

    @classmethod
    def in_rows(
        cls, index: pd.Index, what: str, column: Hashable, rows: NDArray, detail: str, *, period: bool = True
    ) -> RecordFinding:
        """A finding in some rows of an index, which the detail ends with."""
        if not len(rows):
            return cls(what, column, 0, None, None, detail)
        where = f", {period_of(index, rows)}" if period else ""
        return cls(what, column, len(rows), index[rows[0]], index[rows[-1]], detail + where)


def period_of(index: pd.Index, rows: NDArray) -> str:
    """First and last of some rows, as a sentence names them: by dates, by times, or by labels."""
    named = []
    for label in (index[rows[0]], index[rows[-1]])[: len(rows)]:
        if not isinstance(label, pd.Timestamp) or label is pd.NaT:
            named.append(f"row {label}")
        else:
            named.append(f"{label:%Y-%m-%d}" if label.time() == time() else f"{label:%Y-%m-%d %H:%M}")
    return " to ".join(named)


def findings_table(findings: Iterable[RecordFinding]) -> pd.DataFrame:
    """Findings one by one as a table, each with its consequence and its remedy."""
    rows = []
    for found in findings:
        severity = "meaningless" if found.what in ARE_MEANINGLESS else "doubtful"
        rows.append([*found, severity, *WARNINGS[found.what].split(". ")[1:3]])
    columns = ["what", "column", "n_rows", "from", "to", "detail", "severity", "consequence", "action"]
    return pd.DataFrame(rows, columns=columns)


@dataclass(frozen=True, repr=False)
class RecordFindings(SavesFrames):
    """Findings of `check_records`, and the cleaned tables.

    Parameters
    ----------
    table : DataFrame
        A row for each finding: its kind (``what``, the code in the guide), its ``column``, the number of rows
        (``n_rows``) and the labels of the first and the last of them (``from``, ``to``), a sentence with details
        (``detail``), its ``severity`` ("meaningless" if results of a fit would be meaningless, else "doubtful"), its
        ``consequence``, and the ``action`` to take. Empty where nothing was found.
    n_rows : int
        Number of records.
    outliers : DataFrame of bool of shape (n_records, n_modes), optional
        Which frequencies are outliers, on the records' index.
    temperatures, frequencies : array-like or DataFrame, optional
        The tables as they were given, NaN in place of values that cannot be measurements.
    left_out : dict, optional
        Columns that cannot be used, each with the reason.

    Examples
    --------
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.preprocessing import check_records
    >>> year = make_truss_campaign(random_state=0)
    >>> year.temperatures.loc["2025-12":, "T1"] = 20.0
    >>> print(check_records(year.temperatures, year.frequencies))
    1 finding in 365 records.
    stuck: 'T1' is 20 °C in 31 of 365 rows, 2025-12-01 to 2025-12-31
        They count as missing. Put NaN where a sensor or a mode is stuck
    """

    table: pd.DataFrame
    n_rows: int
    outliers: pd.DataFrame | None = None
    temperatures: Table | None = None
    frequencies: Table | None = None
    left_out: dict[Hashable, str] = field(default_factory=dict)

    def summary(self) -> str:
        """A line for each finding, and for each kind a line with its consequence and what to do.

        Returns
        -------
        str
            Text of several lines; a single one where nothing was found.
        """
        if self.table.empty:
            return f"No finding in {self.n_rows} records."
        lines = [f"{len(self.table)} finding{'s' if len(self.table) > 1 else ''} in {self.n_rows} records."]
        for kind, rows in self.table.groupby("what", sort=False):
            lines += [f"{kind}: {detail}" for detail in rows["detail"]]
            lines.append(f"    {rows['consequence'].iloc[0]}. {rows['action'].iloc[0]}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return self.summary()

    def warnings(self, *, exclude: Collection[str] = ()) -> Iterator[RecordsWarning]:
        """Warnings of values that count as missing, of columns that are left out, and of each other kind of finding.

        Parameters
        ----------
        exclude : collection of str, default=()
            Kinds of findings that give no warning.

        Yields
        ------
        RecordsWarning
            Of kind "set-aside", "left-out", or the kind of the finding. A small number of records gives none.
        """
        aside = self.table["what"].isin(ASIDE_KINDS.difference(exclude)) & ~self.table["column"].isin([*self.left_out])
        if aside.any():
            n_values, details = self.table["n_rows"][aside].sum(), listed_details(self.table["detail"][aside])
            count = f"{n_values:,} values cannot be measurements, and count"
            yield RecordsWarning(
                f"{'1 value cannot be a measurement, and counts' if n_values == 1 else count} as missing: {details}. "
                "Repair these sensors, or put NaN there",
                "set-aside",
            )
        if self.left_out:
            yield RecordsWarning(
                f"columns are left out, and nothing is said of them: {'; '.join(self.left_out.values())}. Repair these "
                "sensors, or drop the columns",
                "left-out",
            )
        for kind, rows in self.table.groupby("what", sort=False):
            if kind not in {*ASIDE_KINDS, *LEFT_OUT_KINDS, "few-rows", *exclude}:
                yield RecordsWarning(WARNINGS[kind].format(listed_details(rows["detail"])), kind)

    def refuse_meaningless(self, *, exclude: Collection[str] = (), needs_all: bool = False) -> None:
        """Raise an error that lists everything with which results of a fit would be meaningless.

        Parameters
        ----------
        exclude : collection of str, default=()
            Kinds of findings that do no harm to the use of these records.
        needs_all : bool, default=False
            Whether a column that is left out makes them meaningless.

        Raises
        ------
        ValueError
            If the severity of a finding is "meaningless".
        """
        severe = self.table[(self.table["severity"] == "meaningless") & ~self.table["what"].isin(list(exclude))]
        texts = []
        for kind, rows in severe.groupby("what", sort=False):
            text = WARNINGS[kind].format(listed_details(rows["detail"]))
            texts.append(text[0].upper() + text[1:] if texts else text)
        if needs_all and self.left_out and not texts:
            texts = [f"columns cannot be used: {'; '.join(self.left_out.values())}; expected measurements in each"]
        if texts:
            raise ValueError(". ".join(texts))


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
    >>> from skthermo.preprocessing.checks import set_aside
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

        Returns
        -------
        iterator of RecordsWarning
            Of kind "set-aside" or "left-out".
        """
        return RecordFindings(self.table, 0, left_out=self.left_out).warnings()


def listed_details(details: Any) -> str:
    """Details of at most a dozen findings one after the other."""
    rest = len(details) - 12
    return "; ".join([*details[:12], *([f"and {rest} more"] if rest > 0 else [])])
