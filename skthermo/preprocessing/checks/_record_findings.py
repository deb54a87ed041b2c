"""What has been found in records, as a table, text, warnings and an error."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

import pandas as pd

from skthermo._tables.saved_frames import SavesFrames
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing._memory import MemoryFindings
from skthermo.preprocessing.checks._kinds import MEANINGLESS, SET_ASIDE, WARNINGS, Finding

COLUMNS = ["what", "column", "n_rows", "from", "to", "detail", "severity", "consequence", "action"]
MOST_NAMED = 12  # findings of one kind that a sentence lists
UNWARNED = SET_ASIDE | {"few-rows"}  # estimators set values aside, or need more records, and warn of that


@dataclass(frozen=True, repr=False)
class RecordFindings(SavesFrames):
    """What `check_records` has found.

    Parameters
    ----------
    table : DataFrame
        A row for each finding: ``what`` was found (its code in the guide) in which ``column``, in how many rows
        (``n_rows``), ``from`` and ``to`` which row by the labels of the records' index, a sentence that says more
        (``detail``), its ``severity`` ("meaningless" if results of a fit would be, else "doubtful"), its
        ``consequence``, and the ``action`` to take. Empty where nothing was found.
    n_rows : int
        Number of records.
    outliers : DataFrame of bool of shape (n_records, n_modes), optional
        Which frequencies are outliers, on the records' index.
    memory : MemoryFindings, optional
        What `find_memory` has found; None where nothing was looked for.

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
    memory: MemoryFindings | None = None

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
            Kinds of findings of which there is no warning.

        Yields
        ------
        RecordsWarning
            Its ``kind`` is what was found.
        """
        for kind, rows in self.table.groupby("what", sort=False):
            if kind not in UNWARNED.union(exclude):
                yield RecordsWarning(WARNINGS[kind].format(listed_details(rows["detail"])), kind)

    def refuse_meaningless(self, *, exclude: Collection[str] = ()) -> None:
        """Raise an error that lists everything with which results of a fit would be meaningless.

        Parameters
        ----------
        exclude : collection of str, default=()
            Kinds of findings that do no harm to what is done with the records.

        Raises
        ------
        ValueError
            If the severity of a finding is "meaningless".
        """
        severe = self.table[(self.table["severity"] == MEANINGLESS) & ~self.table["what"].isin(list(exclude))]
        if len(severe):
            kinds = severe.groupby("what", sort=False)
            texts = [WARNINGS[kind].format(listed_details(rows["detail"])) for kind, rows in kinds]
            raise ValueError(". ".join(text[0].upper() + text[1:] if n else text for n, text in enumerate(texts)))


def findings_table(findings: Iterable[Finding]) -> pd.DataFrame:
    """Findings one by one as a table."""
    rows = [[*found, found.severity, found.consequence, found.action] for found in findings]
    return pd.DataFrame(rows, columns=COLUMNS)


def listed_details(details: pd.Series) -> str:
    """Details of findings one after the other, not more than a reader can take in."""
    rest = len(details) - MOST_NAMED
    return "; ".join([*details[:MOST_NAMED], *([f"and {rest} more"] if rest > 0 else [])])
