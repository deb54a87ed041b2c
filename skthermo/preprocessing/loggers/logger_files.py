"""Files of records: CSV in any common form, Excel workbooks, and parquet; their form and their contents."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress, product
from math import isfinite
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from skthermo._core.arrays import Array
from skthermo._core.estimators import import_optional
from skthermo._core.frames import MISSING_CODES
from skthermo._core.warnings import warn_each
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing._quantities import Unit, unit_called, unit_in

ISO, UNIX, UNIX_MS, EXCEL = "ISO8601", "unix", "unix_ms", "excel"
NUMERIC_STAMPS = {
    UNIX: ("s", "unix", 5e8, 4e9), UNIX_MS: ("ms", "unix", 5e11, 4e12), EXCEL: ("D", "1899-12-30", 3e4, 7.5e4),
}  # fmt: skip
"""Stamps that are numbers: their unit, when they begin, and the least and the greatest that are taken for times."""
PARQUET, WORKBOOKS = (".parquet", ".pq"), (".xlsx", ".xlsm")
NO_TEXT_FILES = (*PARQUET, *WORKBOOKS)
WITH_OFFSET = re.compile(r":\d\d(:\d\d([.,]\d+)?)? ?(Z|[+-]\d\d(:?\d\d)?)$")
DECIMAL_SIGNS = (".", ",")
DAYS = (
    "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%y",
    "%d/%m/%y", "%m/%d/%y", "%y/%m/%d", "%d-%m-%y", "%y-%m-%d", "%d-%b-%Y", "%d %b %Y", "%d-%b-%y", "%Y%m%d",
)  # fmt: skip
CLOCKS = (" %H:%M:%S", " %H:%M", "", " %H:%M:%S.%f", " %I:%M:%S %p", " %I:%M %p")
WRITTEN_STAMPS = (ISO, *(day + clock for day, clock in product(DAYS, CLOCKS)))
MOST_LOOKED_AT = 2000  # lines, by which the form of a file is found
MOSTLY = 0.9  # share of the cells that are numbers, from which a column holds numbers

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
    """Records on their stamps in the order of the file; a text that is no stamp or number is an error that names its
    line.

    A last line without a line break may be cut off: it is left out if asked for or if values are lacking, else there is
    a warning.
    """
    table, findings = read_and_doubted(file, form, ignore=ignore, leave_unfinished=leave_unfinished)
    warn_each(findings)
    return table


def read_and_doubted(
    file: Path, form: CsvFormat, *, ignore: Collection[str] = (), leave_unfinished: bool = False
) -> tuple[pd.DataFrame, list[RecordsWarning]]:
    """Records as `read_file` gives them, and doubts about them."""
    if file.suffix.lower() in PARQUET:
        table, findings = _parquet(file).drop(columns=list(ignore), errors="ignore"), []
    else:
        table, findings = _table(file, form, ignore, leave_unfinished)
    return table.mask(table.isin(list(form.missing))) if len(form.missing) else table, findings


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
    try:
        table = pd.read_parquet(file)
    except ImportError as error:  # as of any other file that cannot be read: it keeps no other out
        raise ValueError(f"{file}: 'pyarrow' is not installed; get it with: pip install pyarrow") from error
    table = table if isinstance(table.index, pd.DatetimeIndex) else table.set_index(table.columns[0])
    if not isinstance(table.index, pd.DatetimeIndex):
        raise ValueError(f"{file}: the first column holds {table.index.dtype}; expected times")
    return table


def _table(
    file: Path, form: CsvFormat, ignore: Collection[str], leave_unfinished: bool
) -> tuple[pd.DataFrame, list[RecordsWarning]]:
    """Numbers to the last bit, and a finding of a last line that may be cut off; a stamp that comes again with other
    values is an error."""
    rows, is_finished = rows_in(file, form)
    if leave_unfinished and not is_finished:
        rows, is_finished = rows[:-1], True
    names_line, names = _names(rows, form, file)
    findings = []
    if not is_finished:
        rows = rows[:-1] if len(rows[-1][1]) < len(names) else rows
        text = (
            f"{file} does not end with a line break. Its last value may be cut off, and a last line with fewer values "
            "than names is left out. Rename files when they are complete"
        )
        findings.append(RecordsWarning(text, "read-as"))
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
    values = {name: _numbers(cells.get(name, ()), form.decimal, f"column {name!r}", file, lines) for name in wanted}
    table = pd.DataFrame(values, _times(texts, form, file, lines), dtype=float)
    again = table.index.duplicated()
    if again.any() and (is_other := again & ~table.reset_index().duplicated().to_numpy()).any():
        place = int(np.argmax(is_other))
        raise ValueError(
            f"{file}, line {lines[place]}: {table.index[place]} comes again with other values; expected each once. "
            "If the clocks go back then, --zone of init, or [csv] time_zone, says where"
        )
    return table, findings


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
    is_stamp = parsed_or_iso([" ".join(row[place] for place in places) for _, row in heads], form.stamps).notna()
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
        return _rows_of_cells(_longest_sheet(file)[0], form.decimal), True
    text = text_of(file, form.encoding)
    try:
        rows = rows_of(text, form.separator)
    except ValueError as error:
        raise ValueError(f"{file}, {error}") from error
    return rows, not rows or text.endswith(("\n", "\r")) or rows[-1][0] < len(text.splitlines())


def _longest_sheet(file: Path) -> tuple[Any, list[str]]:
    """Cells of the sheet with the most rows, as others are covers or notes; which one of several it is, in words."""
    try:
        import_optional("openpyxl", extra="excel")
        with pd.ExcelFile(file, engine="openpyxl") as book:
            longest = max(book.sheet_names, key=lambda name: book.book[name].max_row or 0)
            cells = pd.read_excel(book, sheet_name=longest, header=None, dtype=object, na_filter=False).to_numpy()
    except OSError:
        raise
    except ImportError as error:  # as of any other file that cannot be read: it keeps no other out
        raise ValueError(f"{file}: {error}") from error
    except Exception as error:
        raise ValueError(f"{file} is no Excel workbook: {error}; expected one, or a CSV file") from error
    n_sheets = len(book.sheet_names)
    note = f"{file.name} has {n_sheets} sheets; the one with the most rows, {longest!r}, is read"
    return cells, [note] * (n_sheets > 1)


def _rows_of_cells(cells: Any, decimal: str) -> list[Line]:
    """Cells of a sheet as texts: dates as in ISO 8601, numbers with all of their digits."""
    rows = [[_text_of_cell(cell, decimal) for cell in row] for row in cells]
    return [(line, row) for line, row in enumerate(rows, start=1) if any(row)]


def _text_of_cell(cell: Any, decimal: str) -> str:
    if isinstance(cell, float):
        return str(cell).replace(".", decimal)
    return str(cell).strip().replace("\n", "").removesuffix(" 00:00:00")


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
    signs = str.maketrans("\u2212\u2013", "--")  # a minus of typesetters, and a dash in its place
    if (plain := text.translate(signs)) != text:
        return number(plain, decimal)
    no_value = r"|-+|#.*|n/?a|k\.? ?a\.?|<na>|null|none|[-+]?(nan|1[.,]#(qnan|snan|ind|inf)\d*)(\(\w*\))?"
    if re.fullmatch(no_value, text, re.IGNORECASE):
        return np.nan
    point, sign = re.escape(decimal), "," if decimal == "." else r"\."
    blank = r"[ '\u2019\u00a0\u202f]"  # between thousands
    groups = rf"({blank})\d{{3}}(\2\d{{3}})*({point}\d*)?|({sign}\d{{3}})+{point}\d+|({sign}\d{{3}}){{2,}}"
    if re.fullmatch(rf"[-+]?\d{{1,3}}({groups})", text):
        return float(re.sub(rf"[^-+\d{point}]", "", text).replace(decimal, "."))
    raise ValueError(text)


def _times(texts: Sequence[str], form: CsvFormat, file: Path, lines: Sequence[int]) -> pd.DatetimeIndex:
    """Texts as times: in the time zone of the records; without one, in UTC if they have offsets."""
    has_offset = [WITH_OFFSET.search(text) is not None for text in texts]
    if 0 < sum(has_offset) < len(texts):
        place = has_offset.index(not has_offset[0])
        raise ValueError(
            f"{file}, line {lines[place]}: {texts[place]!r:.100}; {sum(has_offset)} of {len(texts)} stamps have an "
            "offset from UTC; expected all or none"
        )
    index = parsed_or_iso(texts, form.stamps)
    if file.suffix.lower() in WORKBOOKS:
        index = _otherwise_written(texts, index, form.stamps, file)
    is_wrong = np.array(index.isna())
    if is_wrong.any():
        place = int(np.argmax(is_wrong))
        stamp_texts = {
            ISO: "one like 2026-01-31 13:00", UNIX: "seconds since 1970", UNIX_MS: "milliseconds since 1970",
            EXCEL: "a serial date of Excel, such as 46053.5417",
        }  # fmt: skip
        raise ValueError(
            f"{file}, line {lines[place]}: {texts[place]!r:.100} is no time; expected "
            f"{stamp_texts.get(form.stamps, f'one like the format {form.stamps}')}; "
            f"{is_wrong.sum()} of {len(texts)} stamps are wrong"
        )
    if form.time_zone is None:
        return index
    return index.tz_convert(form.time_zone) if index.tz else _by_local_clock(index, form.time_zone, file, lines)


def parsed(texts: Sequence[str], form: str) -> pd.DatetimeIndex:
    """Texts as times, NaT for a text in another format; in UTC if they have offsets."""
    if form in NUMERIC_STAMPS:
        unit, origin, least, most = NUMERIC_STAMPS[form]
        numbers = pd.to_numeric(pd.Series([text.replace(",", ".") for text in texts], dtype=object), errors="coerce")
        numbers = numbers.astype(float).where(numbers.between(least, most))
        times = pd.to_datetime(numbers, unit=unit, origin=origin, errors="coerce", utc=form != EXCEL)
        index = pd.DatetimeIndex(times).as_unit("ns")
        return index.round("s") if form == EXCEL else index  # a serial date is cut after some decimals
    has_offsets = any(WITH_OFFSET.search(text) for text in texts)
    index = pd.DatetimeIndex(pd.to_datetime(list(texts), format=form, errors="coerce", utc=has_offsets))
    is_other = np.array([form == ISO and re.match(r"\d{4}-\d\d-\d\d", text) is None for text in texts], dtype=bool)
    return index.where(~is_other) if is_other.any() else index


def parsed_or_iso(texts: Sequence[str], form: str) -> pd.DatetimeIndex:
    """Texts as times in this format, or as in ISO 8601, which cannot be taken for another one: dates of a workbook."""
    index = parsed(texts, form)
    others = np.flatnonzero(index.isna())
    if form in (ISO, *NUMERIC_STAMPS) or not len(others):
        return index
    times, iso = index.to_series(index=range(len(index))), parsed([texts[place] for place in others], ISO)
    if iso.notna().any() and (iso.tz is None) == (index.tz is None):
        times.iloc[others] = iso
    return pd.DatetimeIndex(times)


def _otherwise_written(texts: Sequence[str], index: pd.DatetimeIndex, form: str, file: Path) -> pd.DatetimeIndex:
    """Stamps of a workbook, where dates, serial dates and texts mean the same: those that are none in its format read
    by the only other one that they may have. Texts in two formats might be days and months that are exchanged."""
    others = np.flatnonzero(index.isna())
    rows = [[texts[place]] for place in others]
    for forms in (WRITTEN_STAMPS if form in (ISO, EXCEL) else (), (EXCEL,)) if rows else ():
        if fitting := _fitting(rows, (0,), forms):
            times = index.to_series(index=range(len(index)))
            found = _times_in(rows, (0,), _certain(rows, (0,), fitting, file)[0])
            if (found.tz is None) == (index.tz is None):
                times.iloc[others] = found
            return pd.DatetimeIndex(times)
    return index


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


@dataclass(frozen=True)
class FileLook:
    """The form of a file, its records, and what else was found in it.

    ``ignored`` says why columns are no measurements; ``units`` are the units that the file names; ``notes`` are
    sentences for the reader of the settings; ``findings`` are doubts about the records.
    """

    file: Path
    form: CsvFormat
    records: pd.DataFrame
    ignored: dict[str, str]
    units: dict[str, Unit]
    notes: tuple[str, ...]
    findings: tuple[RecordsWarning, ...] = ()


def look_at(file: Path, zone: str | None = None, stamps: str | None = None, wanted: Collection[str] = ()) -> FileLook:
    """Find the form of a file and read it, in a time zone and with a format of its stamps if these are known. Columns
    that are wanted are used, whatever they hold."""
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {str(file)!r}; expected records as CSV, .xlsx or parquet")
    if file.suffix.lower() in PARQUET:
        form, units, ignored, notes = CsvFormat(time_zone=zone), {}, {}, []
    else:
        form, units, ignored, notes = _look_at_table(file, zone, stamps)
    records, findings = read_and_doubted(file, form, ignore=ignored)
    ignored |= {name: why for name, why in _no_measurements(records) if name not in wanted}
    records = records.drop(columns=[name for name in records if name in ignored])
    marked = [marker for marker in MISSING_CODES if records.isin([marker]).to_numpy().any()]
    if marked:
        records, form = records.mask(records.isin(marked)), replace(form, missing=marked)
    units |= {name: unit for name in records if (unit := unit_in(name))}
    return FileLook(file, form, records, ignored, units, tuple(notes), tuple(findings))


def _look_at_table(
    file: Path, zone: str | None, stamps: str | None
) -> tuple[CsvFormat, dict[str, Unit], dict[str, str], list[str]]:
    """Form of a CSV file or workbook, units of its columns as a line below the names has them, columns of text, and
    notes."""
    if file.suffix.lower() in WORKBOOKS:
        sheet, sheets = _longest_sheet(file)
        separator, decimal = ",", _decimal_of(sheet)
        rows = _rows_of_cells(sheet, decimal)
    else:
        (separator, decimal), sheets = _division(text_of(file), file), []
        rows, _ = rows_in(file, CsvFormat(separator, decimal))
    width = used_width([row for _, row in rows], _usual_width([row for _, row in rows[:MOST_LOOKED_AT]]))
    rows = [(line, without_margin(row, width)) for line, row in rows]
    rows = [(line, row) for line, row in rows if len(row) == width]
    cells = [row for _, row in rows]
    places, stamps, notes = _stamps_of(cells, file, stamps)
    is_record = _times_in(cells[:MOST_LOOKED_AT], places, stamps).notna()
    first = int(np.argmax(is_record))
    above = [one for one in rows[:first] if one[1][0] != "TOA5"]
    above = [one for one in above if not one[1][0].startswith("#")] or above
    if not above:
        raise ValueError(
            f"{file}: no line of names above the values was found, with {separator!r} between {width} columns and the "
            f"decimal sign {decimal!r}; expected one, then a line for each record"
        )
    names_line, names = max(above, key=lambda one: sum(map(bool, one[1])))  # a title has fewer cells
    names = names_of(names)
    columns = dict(zip(names, zip(*compress(cells, is_record), strict=True), strict=True))
    stamp_columns = [names[place] for place in places]
    units = {
        name: unit
        for line, row in above
        if line > names_line
        for name, cell in zip(names, row, strict=True)
        if (unit := unit_called(cell))
    }
    texts = {}
    for name, column in columns.items():
        kinds = [kind for cell in column if (kind := _is_number(cell, decimal)) is not None]
        if name not in stamp_columns and sum(kinds) < MOSTLY * len(kinds):
            texts[name] = "it holds text"
    has_offsets = WITH_OFFSET.search(_stamp_text(cells[first], places)) is not None
    form = CsvFormat(
        separator,
        decimal,
        names_line=names_line,
        values_line=rows[first][0] if rows[first][0] != names_line + 1 else None,
        stamp_columns=() if stamp_columns == names[:1] else stamp_columns,
        stamps=stamps,
        time_zone="UTC" if zone is None and (has_offsets or stamps.startswith(UNIX)) else zone,
    )
    return form, units, texts, [*sheets, *notes]


def _decimal_of(sheet: Any) -> str:
    """The decimal sign by which the most cells of a sheet are numbers."""

    def n_numbers(decimal: str) -> int:
        rows = _rows_of_cells(sheet[:MOST_LOOKED_AT], decimal)
        return sum(_is_number(cell, decimal) is True for _, row in rows for cell in row)

    return max(DECIMAL_SIGNS, key=n_numbers)


def _division(text: str, file: Path) -> tuple[str, str]:
    """Separator and decimal sign by which lines of the usual number of columns have the most numbers."""
    head, found = "\n".join(text.splitlines()[:MOST_LOOKED_AT]), []
    separators = (";", "\t", "|", ",")  # a comma last, as it may be a decimal sign
    for rank, (separator, decimal) in enumerate(product(separators, DECIMAL_SIGNS)):
        try:
            rows = [row for _, row in rows_of(head, separator)]
        except ValueError:
            continue
        if not rows or (separator == decimal and '"' not in head):
            continue
        width = _usual_width(rows)
        numbers = [_is_number(cell, decimal) for row in rows if len(row) == width for cell in row[1:]]
        found.append((numbers.count(True) / len(rows), -rank, separator, decimal))
    if not found or max(found)[0] == 0:
        raise ValueError(f"{file}: no columns of numbers were found; expected values with one of {separators} between")
    return max(found)[2:]


def _usual_width(rows: Sequence[Sequence[str]]) -> int:
    widths = [len(row) for row in rows]
    return max(set(widths), key=widths.count, default=0)


def _is_number(cell: str, decimal: str) -> bool | None:
    """Whether a cell has a number; None where it has no value."""
    try:
        return None if np.isnan(number(cell, decimal)) else True
    except ValueError:
        return False


def _stamps_of(rows: Sequence[Sequence[str]], file: Path, given: str | None) -> tuple[tuple[int, ...], str, list[str]]:
    """Places of the columns that hold the stamps, their format, and doubts about it."""
    looked = rows[:MOST_LOOKED_AT]
    for forms in [(given,)] if given else [WRITTEN_STAMPS, (UNIX, UNIX_MS), (EXCEL,)]:
        tried = [(places, _fitting(looked, places, forms)) for places in _places(looked)]
        found = [one for one in tried if one[1]]
        if forms == (EXCEL,) and len(found) > 1:  # whole numbers may be counts of records
            times = [_times_in(looked, places, EXCEL).dropna() for places, _ in found]
            found = [
                one for one, index in zip(found, times, strict=True) if (index.normalize() != index).any()
            ] or found
            if len(found) > 1:
                columns = " and ".join(str(places[0] + 1) for places, _ in found)
                raise ValueError(f"{file}: columns {columns} may all hold serial dates; expected one that does")
        if found:
            return found[0][0], *_certain(rows, *found[0], file)
    expected = f"in the format {given}" if given else "such as 2026-01-31 13:00 or 31.01.2026 13:00"
    raise ValueError(f"{file}: no column holds stamps, {expected}; the first values are {list(*rows[:1])!r:.200}")


def _places(rows: Sequence[Sequence[str]]) -> Iterator[tuple[int, ...]]:
    """Columns that may hold stamps: each with the nearest time of day, and alone."""
    columns = list(zip(*rows, strict=True))
    time_of_day = re.compile(r"\d{1,2}:\d\d(:\d\d(\.\d+)?)?( ?[AaPp][Mm])?$")
    clocks = [n for n, cells in enumerate(columns) if 2 * sum(map(bool, map(time_of_day.match, cells))) > len(cells)]
    for n in range(len(columns)):
        near = sorted((abs(clock - n), clock < n, clock) for clock in clocks if clock != n)
        yield from ((n, clock) for *_, clock in near[:1])
        yield (n,)


def _stamp_text(row: Sequence[str], places: Sequence[int]) -> str:
    return " ".join(row[place] for place in places)


def _times_in(rows: Sequence[Sequence[str]], places: Sequence[int], form: str) -> pd.DatetimeIndex:
    """Stamps in some columns of rows, NaT where there is none that is plausible."""
    index = parsed_or_iso([_stamp_text(row, places) for row in rows], form)
    return index.where((index.year >= 1970) & (index.year <= 2100))


def _fitting(rows: Sequence[Sequence[str]], places: Sequence[int], forms: Sequence[str]) -> list[str]:
    """Formats by which the most rows have a stamp, if these are most rows, and their stamps are not all the same."""
    half = len(rows) // 2
    sample = [*rows[half :: max(len(rows) // 8, 1)], *rows[half : half + 4]]
    signs = {sign for row in sample for sign in _stamp_text(row, places)}
    likely = [form for form in forms if signs.issuperset(re.sub(r"%.|\w", "", form))]
    texts = [_stamp_text(row, places) for row in sample]
    found = {form: _times_in(rows, places, form) for form in likely if parsed(texts, form).notna().any()}
    least = max([len(rows) / 2, *(index.notna().sum() for index in found.values())])
    return [
        form
        for form, index in found.items()
        if index.notna().sum() == least
        and 2 * index.nunique() >= least
        and (form != EXCEL or _is_in_order(index))  # other numbers are as large
    ]


def _certain(
    rows: Sequence[Sequence[str]], places: Sequence[int], forms: Sequence[str], file: Path
) -> tuple[str, list[str]]:
    """Of several formats, the one by which the most rows have a stamp, or else the only one by which they follow each
    other regularly, which must also be that of the shortest time: days and months that are exchanged lengthen it."""
    found: dict[str, pd.DatetimeIndex] = {}
    for form in forms:
        index = _times_in(rows, places, form)
        if not any(index.equals(other) for other in found.values()):
            found[form] = index
    most = max(index.notna().sum() for index in found.values())
    readings = [form for form, index in found.items() if index.notna().sum() == most]
    shortest = min(readings, key=lambda form: found[form].max() - found[form].min())
    certain = readings if len(readings) == 1 else [form for form in readings if _is_regular(found[form])]
    if certain != [shortest]:
        raise ValueError(
            f"{file}: stamps such as {_stamp_text(rows[-1], places)!r} may have the formats "
            f"{' or '.join(map(repr, readings))}; expected --stamps with the right one"
        )
    others = [form for form in readings if form not in certain]
    return certain[0], [
        f"stamps of {file.name} may also have the format {form}: by {certain[0]}, they follow each other regularly"
        for form in others[:1]
    ]


def _is_in_order(stamps: pd.DatetimeIndex) -> bool:
    known = stamps.dropna()
    return known.is_monotonic_increasing or known.is_monotonic_decreasing


def _is_regular(stamps: pd.DatetimeIndex) -> bool:
    """Whether stamps are in order, with few gaps."""
    steps = np.abs(np.diff(stamps.dropna().asi8))
    return _is_in_order(stamps) and (not len(steps) or bool(steps.mean() <= 1.5 * np.median(steps)))


def _no_measurements(records: pd.DataFrame) -> Iterator[tuple[str, str]]:
    """Columns of numbers that are none, and why."""
    for name, column in records.items():
        known = column.dropna()
        steps = np.diff(known)
        if not len(known):
            yield str(name), "it has no value"
        elif len(known) > 2 and np.ptp(known) == 0:
            yield str(name), "it has one value only"
        elif len(steps) > 1 and (steps >= 1).all() and (known % 1 == 0).all():
            yield str(name), "it counts the records"
