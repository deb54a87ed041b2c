"""Files of records: CSV in any common form, and parquet."""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import RecordsWarning

ISO, UNIX = "ISO8601", "unix"
PARQUET = (".parquet", ".pq")
ENDINGS = (".csv", ".txt", ".dat", ".tsv", *PARQUET)
MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none"}  # texts without a value, in small letters
DATE = re.compile(r"\d{4}-\d\d-\d\d")
OFFSET = re.compile(r":.*(Z|[+-]\d\d:?\d\d)$")


@dataclass(frozen=True)
class CsvFormat:
    """How CSV files of records are written.

    Parameters
    ----------
    separator : str, default=","
        Sign between values.
    decimal : str, default="."
        Decimal sign of numbers.
    encoding : str, default="utf-8"
        Encoding of the text, such as "utf-8", "utf-16" or "cp1252".
    names_line : int, default=1
        Line that holds the names of the columns; lines before it are left out.
    values_line : int, optional
        Line that holds the first record; by default the one after the names.
    stamp_columns : list of str, optional
        Columns that hold the stamp: one, or two with the date and the time of day. By default the first column.
    stamps : str, default="ISO8601"
        Format of stamps, such as "%d.%m.%Y %H:%M". "ISO8601" is 2026-01-31 13:00, "unix" are seconds since 1970.
    time_zone : str, optional
        Time zone of the records, such as "Europe/Brussels" or "UTC". Stamps with an offset are converted to it, stamps
        without one are of its clocks. By default stamps have no time zone.
    missing : list of float, optional
        Numbers that stand for a missing value, such as -999.
    """

    separator: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    names_line: int = 1
    values_line: int | None = None
    stamp_columns: Sequence[str] = ()
    stamps: str = ISO
    time_zone: str | None = None
    missing: Sequence[float] = ()


def read_file(
    file: Path, form: CsvFormat, *, ignore: Collection[str] = (), leave_unfinished: bool = False
) -> pd.DataFrame:
    """Records on their stamps in the order of the file; what is no stamp or number is an error that names its line.

    A last line without a line break may be cut off: it is left out if asked for, else there is a warning.
    """
    if file.suffix.lower() in PARQUET:
        table = _parquet(file).drop(columns=list(ignore), errors="ignore")
    else:
        table = _csv(file, form, ignore, leave_unfinished)
    return table.mask(table.isin(list(form.missing))) if len(form.missing) else table


def in_zone(table: pd.DataFrame, zone: Any, file: Path) -> pd.DataFrame:
    """Records in the time zone of a baseline, which has to have one if the stamps have offsets."""
    if not len(table):
        return table
    if (table.index.tz is None) != (zone is None):
        got = "have no offset from UTC" if table.index.tz is None else "have an offset from UTC"
        expected = "none" if zone is None else "one for each, such as 2026-01-31T13:00+01:00"
        raise ValueError(f"{file}: stamps {got}; expected {expected}, as in the records of the baseline")
    return table if zone is None else table.tz_convert(zone)


def _parquet(file: Path) -> pd.DataFrame:
    table = pd.read_parquet(file)
    table = table if isinstance(table.index, pd.DatetimeIndex) else table.set_index(table.columns[0])
    if not isinstance(table.index, pd.DatetimeIndex):
        raise ValueError(f"{file}: the first column holds {table.index.dtype}; expected times")
    return table


def _csv(file: Path, form: CsvFormat, ignore: Collection[str], leave_unfinished: bool) -> pd.DataFrame:
    """Numbers are read to the last bit, and each line has as many values as the first."""
    text = text_of(file, form.encoding)
    is_finished = not text or text.endswith(("\n", "\r"))
    if not is_finished and leave_unfinished:
        text = text[: max(text.rfind("\n"), text.rfind("\r")) + 1]
    elif not is_finished:
        warn_user(
            f"{file} does not end with a line break. Its last value may be cut off. Rename files when they are "
            "complete",
            RecordsWarning,
            "unfinished-file",
        )
    rows = [(line, row) for line, row in rows_of(text, form.separator) if line >= form.names_line]
    if not rows:
        raise ValueError(f"{file} is empty; expected a line of names, then a line for each record")
    names = rows[0][1]
    records = [one for one in rows[1:] if one[0] >= (form.values_line or 0)]
    stamp_columns = list(form.stamp_columns) or names[:1]
    wanted = [name for name in names if name not in stamp_columns and name not in ignore]
    if len(names) < 2 or len(set(wanted)) < len(wanted) or any(name not in names for name in stamp_columns):
        raise ValueError(
            f"{file}: line {rows[0][0]} names {names}; expected stamps and columns, each once, with "
            f"{form.separator!r} between"
        )
    for line, row in records:
        if len(row) != len(names):
            raise ValueError(f"{file}, line {line}: values: {len(row)}; expected {len(names)} as named above")
    lines = [line for line, _ in records]
    cells = dict(zip(names, zip(*(row for _, row in records), strict=True), strict=True)) if records else {}
    texts = [" ".join(parts) for parts in zip(*(cells.get(name, ()) for name in stamp_columns), strict=True)]
    values = [_numbers(cells.get(name, ()), form.decimal, file, lines) for name in wanted]
    return pd.DataFrame(dict(zip(wanted, values, strict=True)), _times(texts, form, file, lines), dtype=float)


def text_of(file: Path, encoding: str) -> str:
    """The text of a file, without a mark of its encoding."""
    try:
        return file.read_bytes().decode(encoding).removeprefix("\ufeff")
    except (UnicodeDecodeError, LookupError) as error:
        raise ValueError(f"{file} is no text in the encoding {encoding!r}: {error}") from error


def rows_of(text: str, separator: str) -> list[tuple[int, list[str]]]:
    """Cells of each line that is not empty, with the number of the line."""
    lines = csv.reader(text.splitlines(), delimiter=separator, skipinitialspace=separator != "\t")
    return [(lines.line_num, [cell.strip() for cell in row]) for row in lines if any(map(str.strip, row))]


def _numbers(texts: Sequence[str], decimal: str, file: Path, lines: Sequence[int]) -> Array:
    values = np.full(len(texts), np.nan)
    for place, text in enumerate(texts):
        if text.lower() not in MISSING:
            try:
                values[place] = number(text, decimal)
            except ValueError as error:
                expected = f"a number with the decimal sign {decimal!r}, or nothing"
                raise ValueError(f"{file}, line {lines[place]}: {text!r:.100}; expected {expected}") from error
    return values


def number(text: str, decimal: str) -> float:
    """A number; with another decimal sign, a point would stand for thousands."""
    if "_" in text or (decimal != "." and "." in text):
        raise ValueError(text)
    return float(text.replace(decimal, "."))


def _times(texts: Sequence[str], form: CsvFormat, file: Path, lines: Sequence[int]) -> pd.DatetimeIndex:
    """Texts as times: in the time zone of the records; without one, in UTC if they have offsets."""
    n_offsets = sum(OFFSET.search(text) is not None for text in texts)
    if n_offsets not in (0, len(texts)):
        raise ValueError(f"{file}: {n_offsets} of {len(texts)} stamps have an offset from UTC; expected all or none")
    index = parsed(texts, form.stamps)
    is_wrong = np.array(index.isna())
    if is_wrong.any():
        place = int(np.argmax(is_wrong))
        expected = {ISO: "one like 2026-01-31 13:00", UNIX: "seconds since 1970"}
        raise ValueError(
            f"{file}, line {lines[place]}: {texts[place]!r:.100} is no time; expected "
            f"{expected.get(form.stamps, f'one like the format {form.stamps}')}; "
            f"{is_wrong.sum()} of {len(texts)} stamps are wrong"
        )
    if form.time_zone is None:
        return index
    return index.tz_convert(form.time_zone) if index.tz else _by_local_clock(index, form.time_zone, file, lines)


def parsed(texts: Sequence[str], form: str) -> pd.DatetimeIndex:
    """Texts as times, NaT for what is none in this format; in UTC if they have offsets."""
    if form == UNIX:
        seconds = pd.to_numeric(pd.Series(texts, dtype=object), errors="coerce")
        return pd.DatetimeIndex(pd.to_datetime(seconds, unit="s", errors="coerce", utc=True)).as_unit("ns")
    has_offsets = any(OFFSET.search(text) for text in texts)
    index = pd.DatetimeIndex(pd.to_datetime(list(texts), format=form, errors="coerce", utc=has_offsets))
    is_other = np.array([form == ISO and DATE.match(text) is None for text in texts], dtype=bool)
    return index.where(~is_other) if is_other.any() else index


def _by_local_clock(index: pd.DatetimeIndex, zone: str, file: Path, lines: Sequence[int]) -> pd.DatetimeIndex:
    """Times of local clocks, in the order of the file. Of times that come twice in a night, those are of winter time
    that follow a step back, or a step that only winter time makes as long as the usual one."""
    times = index.as_unit("ns").asi8
    first, second = (
        index.tz_localize(zone, ambiguous=np.full(len(index), is_summer), nonexistent="NaT")
        for is_summer in (True, False)
    )
    shift = np.where(first.isna(), 0, second.as_unit("ns").asi8 - first.as_unit("ns").asi8)
    step = np.diff(times)
    usual = np.median(step) if len(step) else 0
    is_again = np.zeros(len(times), dtype=bool)
    is_again[1:] = (step + shift[1:] <= usual) | (times[1:] <= np.maximum.accumulate(times)[:-1])
    is_again = pd.Series(is_again & (shift > 0)).groupby(index.normalize()).cummax().to_numpy()
    local = second.where(is_again, first)
    if local.hasnans:
        place = int(np.argmax(local.isna()))
        raise ValueError(
            f"{file}, line {lines[place]}: {index[place]} is no time in {zone}, as the clocks go forward then; "
            "expected the time zone of the logger's clock, such as 'Etc/GMT-1' for UTC+1 all year"
        )
    return local
