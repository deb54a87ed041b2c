"""Findings about records: their kinds, consequences and remedies; as a table, text, warnings and an error."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import pandas as pd
from numpy.typing import NDArray

from skthermo._core.frames import Table, midnight
from skthermo._core.saved_frames import SavesFrames
from skthermo.exceptions import RecordsWarning

WARNINGS = {
    "no-table": "the argument is no table of numbers: {}. Nothing can be learned from it. Give a DataFrame or a "
    "two-dimensional array of numbers, a row for each record",
    "no-numbers": "columns hold something other than numbers: {}. Nothing can be learned from them. Convert or drop "
    "these columns",
    "column-names": "column names are ambiguous: {}. Columns are matched by name, so that one would be read as "
    "another. Give every column a name of its own, one text each",
    "different-rows": "the tables have different rows: {}. Frequencies would be compared with the temperatures of "
    "other times. Join the tables by their times",
    "no-rows": "there are too few records: {}. Nothing can be learned from them. Give the records of a year, or at "
    "least of weeks",
    "few-rows": "there are few records: {}. Outliers, shifts and trends cannot be distinguished from chance. Give the "
    "records of a year, or at least of weeks",
    "missing-stamps": "rows have no time: {}. Their place among the others is unknown. Drop these rows, or give their "
    "times",
    "equal-stamps": "all rows have the same time: {}. Order and duration of the records are unknown. Give each row "
    "its own time",
    "stamps-from-numbers": "times come from numbers that were read in the wrong unit: {}. Days would count as "
    "fractions of a second. Convert them by pandas.to_datetime with format= or unit=",
    "stamps-as-text": "the index holds times that are no DatetimeIndex: {}. Rows would count as equally spaced, in "
    "the given order. Convert the index by pandas.to_datetime",
    "repeated-stamps": "times occur more than once: {}. Lags and memory cannot know which of the rows was earlier. "
    "Keep one row for each time, such as by groupby(level=0).mean()",
    "unsorted-stamps": "rows are not in order of time: {}. Folds and lags take rows for periods of time. Sort them by "
    "sort_index()",
    "missing-column": "a column has no value: {}. Nothing can be learned from it. Leave it out, or check why it is "
    "empty",
    "infinite-values": "values are infinite or too large to be squared: {}. They count as missing. Put NaN there",
    "placeholders": "values stand for missing ones: {}. They count as missing. Put NaN there",
    "isolated-level": "values far from all others repeat exactly: {}. They count as missing. Put NaN there",
    "another-level": "values are far from all others: {}. They count as missing. Put NaN there",
    "implausible-values": "values are implausible: {}. They count as missing. Put NaN there",
    "constant": "a column is constant: {}. It carries no information, and its spread of zero makes any change "
    "infinite. Leave it out",
    "few-values": "a column has very few different values: {}. Its resolution hides the effect of the weather. Check "
    "rounding and the settings of the logger",
    "equal-columns": "columns are equal: {}. One channel counts twice, and another is missing. Keep one of them, and "
    "check where the other was read from",
    "not-positive": "frequencies are zero or negative: {}. They count as missing. Put NaN where a mode was not "
    "identified",
    "kelvin": "temperatures look like kelvin: {}. Bounds and reports are in degrees Celsius. Subtract 273.15",
    "fahrenheit": "temperatures look like degrees Fahrenheit: {}. Frost and reports would be wrong by many degrees. "
    "Convert them by (T - 32) / 1.8",
    "scaled-temperatures": "temperatures look like fractions of a degree: {}. Frost and reports would be wrong by "
    "that factor. Divide them by the factor",
    "opposite-signs": "a sensor falls where the others rise: {}. Means of the sensors would cancel, and its summer "
    "would count as frost. Check its sign",
    "exchanged-tables": "temperatures and frequencies look exchanged: {}. Temperatures would be predicted from "
    "frequencies. Exchange the two tables",
    "temperatures-are-frequencies": "a column stands in both tables: {}. The frequency would predict itself and hide "
    "all damage. Give temperatures only in the first table",
    "number-of-modes": "frequencies and model have different numbers of modes: {}. A column would be read as another "
    "mode. Give a column for each mode of the model, or model.with_modes of the modes that match_modes finds",
    "unit-of-frequencies": "frequencies are in another unit than the model's: {}. Changes of the frequencies would be "
    "wrong by that factor. Convert them to Hz",
    "unit-of-a-mode": "a mode is far from the model's: {}. Its changes would be read as changes of another mode or "
    "unit. Convert it to Hz, or order the columns as the model's modes",
    "stuck-sensor": "values of a sensor only repeat: {}. They count as missing. Put NaN where it is stuck",
    "stuck-mode": "values of a mode only repeat: {}. They count as missing. Put NaN where it is stuck",
    "no-thermal-effect": "the temperatures explain nothing of the frequencies: {}. Nothing can be compensated by "
    "them. Check whether the rows of both tables belong together",
    "time-shift": "temperatures of other rows explain the frequencies better: {}. The weather of another time would "
    "be learned. Join the tables by their times",
    "exchanged-modes": "modes look exchanged in some rows: {}. The scatter of both would hide damage. Exchange them "
    "back, or track modes by shape",
    "frequency-outliers": "frequencies are far from their neighbours in time and from a regression on the weather: {}. "
    "Impossible values are set aside, the others widen the spread of a baseline. Put NaN where a value is wrong, as "
    "HampelFilter does",
    "sudden-change": "frequencies change at once, and the weather does not explain it: {}. Both levels would be "
    "learned as healthy. Fit on records of one structure, in one state and by one way of identification",
    "trend": "residuals of the frequencies beside the weather have a trend: {}. A detector takes a trend that goes on "
    "for damage. Check whether the structure or a sensor drifts",
}
"""By kind: the finding, with a place for details; its consequence; the remedy."""

ARE_MEANINGLESS = frozenset(
    {
        *("no-table", "no-numbers", "column-names", "different-rows", "no-rows", "missing-stamps", "equal-stamps"),
        *("stamps-from-numbers", "missing-column", "constant", "kelvin", "exchanged-tables", "number-of-modes"),
        *("temperatures-are-frequencies", "unit-of-frequencies"),
    }
)
"""Kinds with which no result of a fit means anything."""

ASIDE_KINDS = frozenset(
    {
        *("infinite-values", "placeholders", "isolated-level", "another-level", "implausible-values", "not-positive"),
        *("stuck-sensor", "stuck-mode"),
    }
)
"""Kinds of values that cannot be measurements, which count as missing."""

IMPOSSIBLE = frozenset({"infinite-values", "placeholders", "not-positive"})
"""Kinds of values that are impossible in any state of a structure."""

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
        cls, index: pd.Index, what: str, column: Hashable, rows: NDArray, detail: str, *, period: bool = False
    ) -> RecordFinding:
        """A finding in some rows of an index, which the detail may end with."""
        if not len(rows):
            return cls(what, column, 0, None, None, detail)
        where = f", {period_of(index, rows)}" if period else ""
        return cls(what, column, len(rows), index[rows[0]], index[rows[-1]], detail + where)


def period_of(index: pd.Index, rows: NDArray) -> str:
    """First and last of some rows, as a sentence names them."""
    first, last = label_of(index[rows[0]]), label_of(index[rows[-1]])
    return f"{first} to {last}" if len(rows) > 1 else first


def label_of(label: Any) -> str:
    """How a sentence names a row: by its date, by its time, or by its label."""
    if not isinstance(label, pd.Timestamp) or label is pd.NaT:
        return f"row {label}"
    return f"{label:%Y-%m-%d}" if label == midnight(label) else f"{label:%Y-%m-%d %H:%M}"


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
        The tables as they were given, NaN in place of values that cannot be measurements, as `set_aside` gives them.
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
    stuck-sensor: 'T1' is 20 °C in 31 rows, 2025-12-01 to 2025-12-31
        They count as missing. Put NaN where it is stuck
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
        """One warning for each kind of finding.

        Parameters
        ----------
        exclude : collection of str, default=()
            Kinds of findings that give no warning.

        Yields
        ------
        RecordsWarning
            Its ``kind`` is that of the finding.
        """
        for kind, rows in self.table.groupby("what", sort=False):
            if kind not in {*ASIDE_KINDS, "few-rows", *exclude}:  # estimators warn of these themselves
                yield RecordsWarning(WARNINGS[kind].format(listed_details(rows["detail"])), kind)

    def refuse_meaningless(self, *, exclude: Collection[str] = ()) -> None:
        """Raise an error that lists everything with which results of a fit would be meaningless.

        Parameters
        ----------
        exclude : collection of str, default=()
            Kinds of findings that do no harm to the use of these records.

        Raises
        ------
        ValueError
            If the severity of a finding is "meaningless".
        """
        severe = self.table[(self.table["severity"] == "meaningless") & ~self.table["what"].isin(list(exclude))]
        if len(severe):
            kinds = severe.groupby("what", sort=False)
            texts = [WARNINGS[kind].format(listed_details(rows["detail"])) for kind, rows in kinds]
            raise ValueError(". ".join(text[0].upper() + text[1:] if n else text for n, text in enumerate(texts)))


def listed_details(details: pd.Series) -> str:
    """Details of at most a dozen findings one after the other."""
    rest = len(details) - 12
    return "; ".join([*details[:12], *([f"and {rest} more"] if rest > 0 else [])])
