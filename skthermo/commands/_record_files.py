"""Files of records: CSV in any common form, Excel workbooks, and parquet."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import compress
from math import isfinite
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from skthermo._estimators.warnings import warn_user, without_warnings
from skthermo._tables.arrays import Array
from skthermo._validation import import_optional
from skthermo.exceptions import RecordsWarning

ISO, UNIX, UNIX_MS, EXCEL = "ISO8601", "unix", "unix_ms", "excel"
NUMERIC = {UNIX: ("s", "unix", 5e8, 4e9), UNIX_MS: ("ms", "unix", 5e11, 4e12), EXCEL: ("D", "1899-12-30", 3e4, 7.5e4)}
"""Stamps that are numbers: their unit, when they begin, and the least and the greatest that are taken for times."""
STAMP_TEXTS = {
    ISO: "one like 2026-01-31 13:00", UNIX: "seconds since 1970", UNIX_MS: "milliseconds since 1970",
    EXCEL: "a serial date of Excel, such as 46053.5417",
}  # fmt: skip
PARQUET, WORKBOOKS = (".parquet", ".pq"), (".xlsx", ".xlsm")
BINARY = (*PARQUET, *WORKBOOKS)
ENDINGS = (".csv", ".txt", ".dat", ".tsv", *BINARY)
NO_VALUE = re.compile(r"|-+|#.*|n/?a|<na>|null|none|[-+]?(nan|1[.,]#(qnan|snan|ind|inf)\d*)(\(\w*\))?", re.IGNORECASE)
BLANK = r"[ '\u2019\u00a0\u202f]"  # between thousands
DATE = re.compile(r"\d{4}-\d\d-\d\d")
OFFSET = re.compile(r":\d\d(:\d\d([.,]\d+)?)? ?(Z|[+-]\d\d(:?\d\d)?)$")

Line: TypeAlias = tuple[int, list[str]]
"""The number of a line, and its cells."""


@dataclass(frozen=True)
class CsvFormat:
    """How CSV files of records are written.

    Parameters
    ----------
    separator : str, default=","
        Sign between values.
    decimal : str, default="."
        Decimal sign of numbers.
    encoding : str, optional
        Encoding of the text, such as "latin-2". By default UTF-16 where a file begins with its mark, else UTF-8, or
        cp1252 where it is no UTF-8.
    names_line : int, default=1
        Line that holds the names of the columns; lines before it are left out.
    values_line : int, optional
        Line that holds the first record; by default the one after the names.
    stamp_columns : list of str, optional
        Columns that hold the stamp: one, or two with the date and the time of day. By default the first column.
    stamps : str, default="ISO8601"
        Format of stamps, such as "%d.%m.%Y %H:%M". "ISO8601" is 2026-01-31 13:00, "unix" and "unix_ms" are seconds and
        milliseconds since 1970, "excel" are serial dates of a spreadsheet, such as 46053.5417.
    time_zone : str, optional
        Time zone of the records, such as "Europe/Brussels" or "UTC". Stamps with an offset are converted to it, stamps
        without one are of its clocks. By default stamps have no time zone.
    missing : list of float, optional
        Numbers that stand for a missing value, such as -999.
    """

    separator: str = ","
    decimal: str = "."
    encoding: str | None = None
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

    A last line without a line break may be cut off: it is left out if asked for or if values are lacking, else there is
    a warning.
    """
    if file.suffix.lower() in PARQUET:
        table = _parquet(file).drop(columns=list(ignore), errors="ignore")
    else:
        table = _table(file, form, ignore, leave_unfinished)
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


def _table(file: Path, form: CsvFormat, ignore: Collection[str], leave_unfinished: bool) -> pd.DataFrame:
    """Numbers are read to the last bit; a stamp comes again with the same values or is an error."""
    rows, is_finished = rows_in(file, form)
    if leave_unfinished and not is_finished:
        rows, is_finished = rows[:-1], True
    names_line, names = _names(rows, form, file)
    if not is_finished:
        rows = rows[:-1] if len(rows[-1][1]) < len(names) else rows
        warn_user(
            f"{file} does not end with a line break. Its last value may be cut off, and a last line with fewer values "
            "than names is left out. Rename files when they are complete",
            RecordsWarning,
            "unfinished-file",
        )
    stamp_columns = list(form.stamp_columns) or names[:1]
    wanted = [name for name in names if name not in stamp_columns and name not in ignore]
    if len(names) < 2 or any(names.count(name) != 1 for name in [*wanted, *stamp_columns]):
        raise ValueError(
            f"{file}, line {names_line}: names {names}; expected stamps and columns, each once, with "
            f"{form.separator!r} between"
        )
    records = _records(rows, names_line, names, [names.index(name) for name in stamp_columns], form, file)
    lines = [line for line, _ in records]
    cells = dict(zip(names, zip(*(row for _, row in records), strict=True), strict=True)) if records else {}
    texts = [" ".join(parts) for parts in zip(*(cells.get(name, ()) for name in stamp_columns), strict=True)]
    decimal = "." if file.suffix.lower() in WORKBOOKS else form.decimal
    values = {name: _numbers(cells.get(name, ()), decimal, f"column {name!r}", file, lines) for name in wanted}
    table = pd.DataFrame(values, _times(texts, form, file, lines), dtype=float)
    again = table.index.duplicated()
    if again.any() and (is_other := again & ~table.reset_index().duplicated().to_numpy()).any():
        place = int(np.argmax(is_other))
        raise ValueError(
            f"{file}, line {lines[place]}: {table.index[place]} comes again with other values; expected each once. "
            "If the clocks go back then, --zone of init, or [csv] time_zone, says where"
        )
    return table


def _names(rows: Sequence[Line], form: CsvFormat, file: Path) -> tuple[int, list[str]]:
    """Line and names of the columns."""
    rows = [(line, row) for line, row in rows if line >= form.names_line]
    if not rows:
        raise ValueError(f"{file} is empty; expected a line of names, then a line for each record")
    line, names = rows[0]
    return line, names_of(names[: used_width([row for _, row in rows], len(names))])


def _records(
    rows: Sequence[Line], names_line: int, names: Sequence[str], places: Sequence[int], form: CsvFormat, file: Path
) -> list[Line]:
    """Lines with as many values as there are names, without comments and lines that repeat those above the first
    record, which may come earlier than in other files."""
    first = max(form.values_line or 0, names_line + 1)
    heads = [(line, row) for line, row in rows if names_line < line < first and len(row) >= len(names)]
    is_stamp = parsed([" ".join(row[place] for place in places) for _, row in heads], form.stamps).notna()
    first = min([first, *(line for line, _ in compress(heads, is_stamp))])
    above = [row for line, row in rows if line < first]
    records = [(line, without_margin(row, len(names))) for line, row in rows if line >= first and row not in above]
    records = [(line, row) for line, row in records if len(row) == len(names) or not row[0].startswith("#")]
    for line, row in records:
        if len(row) != len(names):
            raise ValueError(f"{file}, line {line}: values: {len(row)}; expected {len(names)} as named above")
        if "\n" in "".join(row):
            raise ValueError(f"{file}, line {line}: quotes hold several lines; expected quotes that close in theirs")
    return records


def rows_in(file: Path, form: CsvFormat) -> tuple[list[Line], bool]:
    """Cells of each line that is not empty, with the number of the line, and whether the last line is complete."""
    if file.suffix.lower() in WORKBOOKS:
        return _rows_of_workbook(file), True
    text = text_of(file, form.encoding)
    try:
        rows = rows_of(text, form.separator)
    except ValueError as error:
        raise ValueError(f"{file}, {error}") from error
    return rows, not rows or text.endswith(("\n", "\r")) or rows[-1][0] < len(text.splitlines())


def _rows_of_workbook(file: Path) -> list[Line]:
    """Cells of the first sheet as texts: dates as in ISO 8601, numbers with all of their digits."""
    try:
        import_optional("openpyxl", extra="excel")
        with without_warnings():
            sheet = pd.read_excel(file, header=None, dtype=object, na_filter=False, engine="openpyxl")
    except OSError:
        raise
    except ImportError as error:  # as of any other file that cannot be read: it keeps no other out
        raise ValueError(f"{file}: {error}") from error
    except Exception as error:
        raise ValueError(f"{file} is no Excel workbook: {error}; expected one, or a CSV file") from error
    rows = [[str(cell).strip().replace("\n", "").removesuffix(" 00:00:00") for cell in row] for row in sheet.to_numpy()]
    return [(line, row) for line, row in enumerate(rows, start=1) if any(row)]


def names_of(row: Sequence[str]) -> list[str]:
    """Names of columns, each as one line."""
    return [name.replace("\n", "") for name in row]


def used_width(rows: Sequence[Sequence[str]], width: int) -> int:
    """A width without the last columns in which no row has a cell, as separators at the ends of lines make them."""
    while width and not any(row[width - 1] for row in rows if len(row) >= width):
        width -= 1
    return width


def without_margin(row: list[str], width: int) -> list[str]:
    """A row without empty cells beyond a width."""
    return row if len(row) <= width or any(row[width:]) else row[:width]


def text_of(file: Path, encoding: str | None = None) -> str:
    """The text of a file, without marks of its encoding, and without NUL bytes at its end."""
    content = file.read_bytes()
    found = ["utf-16"] if content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else ["utf-8", "cp1252"]
    for one in [encoding] if encoding else found:
        try:
            text = content.decode(one).replace("\ufeff", "").rstrip("\0")
            break
        except (UnicodeDecodeError, LookupError) as error:
            wrong = error
    else:
        raise ValueError(f"{file} is no text in the encoding {one!r}: {wrong}") from wrong
    if "\0" in text:
        line = len(text[: text.index("\0") + 1].splitlines())
        raise ValueError(f"{file}, line {line}: NUL bytes, as after a power failure; expected text")
    return text


def rows_of(text: str, separator: str) -> list[Line]:
    """Cells of each line that is not empty, with the number of the line; quotes may hold several lines."""
    ended = (f"{line}\n" for line in text.splitlines())
    lines = csv.reader(ended, delimiter=separator, skipinitialspace=separator != "\t")
    try:
        return [(lines.line_num, [cell.strip() for cell in row]) for row in lines if any(map(str.strip, row))]
    except csv.Error as error:
        raise ValueError(f"line {lines.line_num}: {error}; expected quotes that close") from error


def _numbers(texts: Sequence[str], decimal: str, column: str, file: Path, lines: Sequence[int]) -> Array:
    values = np.full(len(texts), np.nan)
    for place, text in enumerate(texts):
        try:
            values[place] = number(text, decimal)
        except ValueError as error:
            expected = f"a number with the decimal sign {decimal!r}, or nothing"
            raise ValueError(f"{file}, line {lines[place]}, {column}: {text!r:.100}; expected {expected}") from error
    return values


def number(text: str, decimal: str) -> float:
    """A number, NaN for a text that stands for none or for infinity. With another decimal sign, a point would stand for
    thousands; a single group of them, as in 1,234, might also be decimals, and is refused."""
    if "_" not in text and (decimal == "." or "." not in text):
        try:
            value = float(text.replace(decimal, "."))
            return value if isfinite(value) else np.nan
        except ValueError:
            pass
    if NO_VALUE.fullmatch(text):
        return np.nan
    point, sign = re.escape(decimal), "," if decimal == "." else r"\."
    groups = rf"({BLANK})\d{{3}}(\2\d{{3}})*({point}\d*)?|({sign}\d{{3}})+{point}\d+|({sign}\d{{3}}){{2,}}"
    if re.fullmatch(rf"[-+]?\d{{1,3}}({groups})", text):
        return float(re.sub(rf"[^-+\d{point}]", "", text).replace(decimal, "."))
    raise ValueError(text)


def _times(texts: Sequence[str], form: CsvFormat, file: Path, lines: Sequence[int]) -> pd.DatetimeIndex:
    """Texts as times: in the time zone of the records; without one, in UTC if they have offsets."""
    has_offset = [OFFSET.search(text) is not None for text in texts]
    if 0 < sum(has_offset) < len(texts):
        place = has_offset.index(not has_offset[0])
        raise ValueError(
            f"{file}, line {lines[place]}: {texts[place]!r:.100}; {sum(has_offset)} of {len(texts)} stamps have an "
            "offset from UTC; expected all or none"
        )
    index = parsed(texts, form.stamps)
    is_wrong = np.array(index.isna())
    if is_wrong.any():
        place = int(np.argmax(is_wrong))
        raise ValueError(
            f"{file}, line {lines[place]}: {texts[place]!r:.100} is no time; expected "
            f"{STAMP_TEXTS.get(form.stamps, f'one like the format {form.stamps}')}; "
            f"{is_wrong.sum()} of {len(texts)} stamps are wrong"
        )
    if form.time_zone is None:
        return index
    return index.tz_convert(form.time_zone) if index.tz else _by_local_clock(index, form.time_zone, file, lines)


def parsed(texts: Sequence[str], form: str) -> pd.DatetimeIndex:
    """Texts as times, NaT for what is none in this format; in UTC if they have offsets."""
    if form in NUMERIC:
        unit, origin, least, most = NUMERIC[form]
        numbers = pd.to_numeric(pd.Series([text.replace(",", ".") for text in texts], dtype=object), errors="coerce")
        numbers = numbers.astype(float).where(numbers.between(least, most))
        times = pd.to_datetime(numbers, unit=unit, origin=origin, errors="coerce", utc=form != EXCEL)
        index = pd.DatetimeIndex(times).as_unit("ns")
        return index.round("s") if form == EXCEL else index  # a serial date is cut after some decimals
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
