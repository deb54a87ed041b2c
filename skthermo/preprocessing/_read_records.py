"""Temperatures and frequencies from the files of a logger."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from skthermo._core.warnings import warn_each
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing.loggers.logger_files import lonely_stamps
from skthermo.preprocessing.loggers.together import LoggerRecords


def read_records(
    *files: str | Path,
    temperatures: Sequence[str] | None = None,
    responses: Sequence[str] | None = None,
    zone: str | None = None,
    stamps: str | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read temperatures and frequencies from CSV files, Excel workbooks or parquet, as ``skthermo init`` does.

    Separator, decimal sign, names, units, the format of the stamps and numbers for missing values are found in the
    files; :ref:`logger-files` lists what is read.

    Parameters
    ----------
    *files : str or Path
        One file with all columns, or a file of temperatures and then a file of frequencies. Files with the same columns
        follow each other; others are joined by their stamps.
    temperatures, responses : sequence of str, optional
        Names of the columns. By default units, names in five languages and values decide; of two files, the first has
        the temperatures and the second the responses among the columns that these leave open.
    zone : str, optional
        Time zone of the logger's clock, such as "Europe/Brussels". By default stamps have no time zone, and those with
        an offset are in UTC.
    stamps : str, optional
        Format of the stamps, such as "%d/%m/%Y %H:%M". By default as they tell.

    Returns
    -------
    temperatures : DataFrame
        In degrees Celsius and in order of time, NaN where a value is missing.
    frequencies : DataFrame
        On the same stamps, in Hz.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If a file cannot be read with certainty, or if nothing tells which columns are temperatures or responses.

    Warns
    -----
    UserWarning
        If columns are not used, if a file may be read in another way too, or if stamps are not in all files.

    See Also
    --------
    check_records : Faults of the records.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from skthermo.preprocessing import read_records
    >>> file = Path(tempfile.mkdtemp()) / "log.csv"
    >>> lines = ["Zeit;Luft [°C];f1 [Hz]", "13.01.2026 22:00;-1,5;4,012", "13.01.2026 23:00;-999;4,015"]
    >>> _ = file.write_text("\\n".join([*lines, ""]), encoding="utf-8")
    >>> T, F = read_records(file)
    >>> T.join(F)
                         Luft [°C]  f1 [Hz]
    2026-01-13 22:00:00       -1.5    4.012
    2026-01-13 23:00:00        NaN    4.015
    """
    if not files or not all(isinstance(file, str | PathLike) for file in files):
        raise ValueError(f"files are {files!r:.100}; expected paths, at least one")
    if stamps is not None and not (isinstance(stamps, str) and stamps):
        raise ValueError(f"stamps is {stamps!r:.100}; expected a format such as '%d.%m.%Y %H:%M'")
    temperatures, responses = _names(temperatures, "temperatures"), _names(responses, "responses")
    read = LoggerRecords.read(list(map(Path, files)), temperatures, responses, (), zone, stamps)
    findings = [finding for look in read.looks for finding in look.findings]
    said = [*(note for look in read.looks for note in look.notes), *read.notes]
    said += [f"{name!r} is not used, as {why}" for name, why in read.ignored.items()]
    if said:
        text = f"{'; '.join(said)}. If that is wrong, name the columns, or the format of stamps"
        findings.append(RecordsWarning(text, "read-as"))
    if len(read.waiting):
        findings.append(lonely_stamps(read.waiting, "files", read.table))
    warn_each(findings)
    return read.table[read.roles["temperatures"]], read.table[read.roles["responses"]]


def _names(given: Any, argument: str) -> list[str] | None:
    """Names of columns, one or several."""
    if given is None or isinstance(given, str):
        return None if given is None else [given]
    if not isinstance(given, Sequence | pd.Index) or not all(isinstance(name, str) for name in given):
        raise ValueError(f"{argument} are {given!r:.100}; expected names of columns")
    return list(given)
