"""Findings about records: their kinds, consequences and remedies; as a table, text, warnings and an error."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Iterator
from dataclasses import dataclass, field
from datetime import time
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.frames import Table
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import one_of_each_kind
from skthermo.exceptions import RecordsWarning

WARNINGS = {
    "no-table": "the argument is no table of numbers: {}. Nothing can be learned from it. Give a DataFrame or a "
    "two-dimensional array of numbers, a row for each record, and each column a name of its own, one text each",
    "few-records": "there are few records: {}. Nothing can be learned from them but chance. Give the records of a "
    "year, or at least of weeks",
    "different-rows": "the tables have different rows, or rows of different times: {}. The weather of other times "
    "would be learned. Join the tables by their times",
    "wrong-stamps": "times are missing, wrong, repeated or not in order: {}. Lags, means and folds take rows for "
    "periods of time. Read times by pandas.to_datetime with format= or unit=, keep one row for each, and sort_index()",
    "useless-column": "columns say nothing, or repeat another: {}. They carry no information, or carry it twice. "
    "Repair the sensors, or leave the columns out",
    "set-aside": "values cannot be measurements: {}. They count as missing. Put NaN there",
    "wrong-unit": "columns have another unit or sign: {}. They are read as degrees Celsius and Hz. Convert them, "
    "order modes as the model does, or give its mass and stiffness in kg and N/m",
    "exchanged-tables": "temperatures and frequencies look exchanged: {}. Frequencies would be predicted from "
    "frequencies, which hides all damage. Give temperatures in the first table only, and frequencies in the second",
    "mode-order": "columns do not have one mode of the model each: {}. One mode would be read as another. Track modes "
    "by shape, order columns as the model does, or give it the same modes by with_modes (match_modes finds them)",
    "doubtful-values": "frequencies are far from their neighbours in time and from a regression on the weather: {}. "
    "Impossible values are set aside, the others make alarms later. Look at these records, and leave a value empty "
    "where it is wrong",
}
"""By kind: the finding, with a place for details; its consequence; the remedy."""

ASIDE_REASONS = frozenset({"placeholders", "another-level", "implausible-values", "stuck"})
"""Why values cannot be measurements, and count as missing."""


class RecordFinding(NamedTuple):
    """A finding in a column: its kind, or why values are set aside; in how many rows, from which to which; a sentence
    that says more; and whether no result of a fit means anything with it."""

    what: str
    column: Hashable
    n_rows: int
    first: Hashable
    last: Hashable
    detail: str
    is_meaningless: bool

    @classmethod
    def in_rows(
        cls,
        index: pd.Index,
        what: str,
        column: Hashable,
        rows: NDArray | None,
        detail: str,
        *,
        period: bool = True,
        meaningless: bool = False,
    ) -> RecordFinding:
        """A finding in some rows of an index, a mask or positions, by default in all; the detail ends with them."""
        rows = np.arange(len(index)) if rows is None else np.flatnonzero(rows) if rows.dtype == bool else rows
        if not len(rows):
            return cls(what, column, 0, None, None, detail, meaningless)
        where = f", {period_of(index, rows)}" if period else ""
        return cls(what, column, len(rows), index[rows[0]], index[rows[-1]], detail + where, meaningless)

    @property
    def kind(self) -> str:
        """Code of the warning."""
        return "set-aside" if self.what in ASIDE_REASONS else self.what

    @property
    def is_useless_column(self) -> bool:
        """Whether the column has no value, or a single one."""
        return self.what == "useless-column" and self.is_meaningless


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
        *before, is_meaningless = found
        severity = "meaningless" if is_meaningless else "doubtful"
        rows.append([*before, severity, *WARNINGS[found.kind].split(". ")[1:3]])
    columns = ["what", "column", "n_rows", "from", "to", "detail", "severity", "consequence", "action"]
    return pd.DataFrame(rows, columns=columns)


@dataclass(frozen=True, repr=False)
class RecordFindings(SavesFrames):
    """Findings of `check_records`, and the cleaned tables.

    Parameters
    ----------
    table : DataFrame
        A row for each finding: its kind (``what``, the code in the guide; of values that are set aside, the reason:
        "placeholders", "another-level", "implausible-values" or "stuck"), its ``column``, the number of rows
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
        They count as missing. Put NaN there
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
        for (consequence, action), rows in self.table.groupby(["consequence", "action"], sort=False):
            lines += [f"{what}: {detail}" for what, detail in zip(rows["what"], rows["detail"], strict=True)]
            lines.append(f"    {consequence}. {action}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return self.summary()

    def warnings(self, *, exclude: Collection[str] = ()) -> Iterator[RecordsWarning]:
        """One warning of each kind: values that count as missing, columns that are left out, other findings.

        Parameters
        ----------
        exclude : collection of str, default=()
            Kinds of findings that give no warning.

        Yields
        ------
        RecordsWarning
            Of kind "set-aside", or the kind of the finding. A small number of records gives none.
        """
        kinds, details = (
            self.table["what"].mask(self.table["what"].isin(ASIDE_REASONS), "set-aside"),
            self.table["detail"],
        )
        is_of_columns = (kinds == "set-aside") & self.table["column"].isin([*self.left_out])
        is_of_columns |= (kinds == "useless-column") & (self.table["severity"] == "meaningless")
        found = []
        others = ~is_of_columns & ~self.table["what"].isin(["few-records", *exclude])
        for kind, listed in details[others].groupby(kinds[others], sort=False):
            text = WARNINGS[kind].format(listed_details(listed))
            n_values = self.table["n_rows"][listed.index].sum() if kind == "set-aside" else 0
            found.append(RecordsWarning(f"{n_values:,} {text}" if n_values > 1 else text, kind))
        if self.left_out:
            text = f"columns are left out, and nothing is said of them: {'; '.join(self.left_out.values())}"
            found.append(RecordsWarning(f"{text}. Repair these sensors, or drop the columns", "useless-column"))
        yield from one_of_each_kind(found)

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


def listed_details(details: Any) -> str:
    """Details of at most a dozen findings one after the other."""
    rest = len(details) - 12
    return "; ".join([*details[:12], *([f"and {rest} more"] if rest > 0 else [])])
