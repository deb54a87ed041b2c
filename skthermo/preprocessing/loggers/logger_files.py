"""Files of records: CSV in any common form, Excel workbooks, and parquet; their form and their contents."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import product
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

import skthermo.preprocessing.loggers.stamps as clocks
from skthermo._core.arrays import Array
from skthermo._core.estimators import import_optional
from skthermo._core.frames import MISSING_CODES
from skthermo._core.text import counted
from skthermo._core.warnings import warn_each
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing._quantities import Unit, unit_called, unit_in

PARQUET, WORKBOOKS = (".parquet", ".pq"), (".xlsx", ".xlsm")
NO_TEXT_FILES = (*PARQUET, *WORKBOOKS)
DECIMAL_SIGNS = (".", ",")
SEPARATORS = (";", "\t", "|", ",", " ")  # a comma late, as it may be a decimal sign

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
        milliseconds since 1970, "labview" and "labview_ms" since 1904, "gps" seconds since 6 January 1980 with leap
        seconds, "since_2000" seconds since 2000, "excel" are serial dates of a spreadsheet, such as 46053.5417.
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
    stamps: str = clocks.ISO
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
        blocks, findings = blocks_of_records(file, form)
        tables = [_table(block, form, ignore, leave_unfinished, findings) for block in blocks]
        table = _one_table([part for parts in tables for part in parts], file, findings)
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


class Block(NamedTuple):
    """Lines of a text or of a sheet: what messages call it, whether its last line is complete, and how serial dates
    are counted there."""

    where: str
    rows: list[Line]
    is_finished: bool = True
    serial: str = clocks.EXCEL
    is_sheet: bool = False
    names_line: int | None = None


class Section(NamedTuple):
    """Records below a line of names, and the lines between."""

    line: int
    names: list[str]
    below: list[list[str]]
    records: list[Line]


def _table(
    block: Block, form: CsvFormat, ignore: Collection[str], leave_unfinished: bool, findings: list[RecordsWarning]
) -> list[pd.DataFrame]:
    """Numbers to the last bit, a table for each line of names; findings of a last line that may be cut off and of other
    names. A stamp that comes again with other values is an error."""
    if leave_unfinished and not block.is_finished:
        block = block._replace(rows=block.rows[:-1], is_finished=True)
    sections = sections_of(block, form)
    if not block.is_finished:
        *_, last = sections
        if last.records and len(last.records[-1][1]) < len(last.names):
            last.records.pop()
        text = (
            f"{block.where} does not end with a line break. Its last value may be cut off, and a last line with fewer "
            "values than names is left out. Rename files when they are complete"
        )
        findings.append(RecordsWarning(text, "read-as"))
    others = [section for section in sections[1:] if set(section.names) != set(sections[0].names)]
    if others:
        lines = ", ".join(f"{section.line} ({len(section.records)} records)" for section in others)
        text = (
            f"{block.where} has other names from line {lines} on. Records are joined by name. Check that this is meant"
        )
        findings.append(RecordsWarning(text, "read-as"))
    return [_part(section, block, form, ignore) for section in sections]


def _part(section: Section, block: Block, form: CsvFormat, ignore: Collection[str]) -> pd.DataFrame:
    """Records below one line of names."""
    names, where = section.names, block.where
    stamp_columns = list(form.stamp_columns) or names[:1]
    wanted = [name for name in names if name not in stamp_columns and name not in ignore]
    width = len(names)
    if width < 2 or any(names.count(name) != 1 for name in [*wanted, *stamp_columns]):
        expected = f"stamps and columns, each once, with {form.separator!r} between"
        raise ValueError(f"{where}, line {section.line}: names {names}; expected {expected}")
    records = [(line, without_margin(row, width)) for line, row in section.records]
    records = [(line, row) for line, row in records if len(row) == width or not row[0].startswith("#")]  # no comments
    for line, row in records:
        if len(row) != width:
            raise ValueError(f"{where}, line {line}: values: {len(row)}; expected {width} as named above")
        if "\n" in "".join(row):
            raise ValueError(f"{where}, line {line}: quotes hold several lines; expected quotes that close in theirs")
    lines = [line for line, _ in records]
    cells = dict(zip(names, zip(*(row for _, row in records), strict=True), strict=True)) if records else {}
    texts = [" ".join(parts) for parts in zip(*(cells.get(name, ()) for name in stamp_columns), strict=True)]
    values = {name: _numbers(cells.get(name, ()), form.decimal, f"column {name!r}", where, lines) for name in wanted}
    table = pd.DataFrame(values, _times(texts, form, block, lines), dtype=float)
    once(table, f"{where}: ")
    return table


def _one_table(parts: list[pd.DataFrame], file: Path, findings: list[RecordsWarning]) -> pd.DataFrame:
    """Parts of a file, one below the other where they share columns, else side by side by their stamps."""
    groups: list[list[pd.DataFrame]] = []
    for part in parts:
        alike = [group for group in groups if any(set(part).intersection(other) for other in group)]
        groups = [group for group in groups if not any(group is one for one in alike)]
        groups.append([*(other for group in alike for other in group), part])
    tables = [group[0] if len(group) == 1 else pd.concat(group) for group in groups]
    if len(tables) < 2:
        return tables[0]
    whole, others = side_by_side(tables)
    if not len(whole):
        raise ValueError(f"{file}: the sheets or parts have no stamp in common; expected records of the same times")
    if len(others):
        findings.append(lonely_stamps(others, f"sheets or parts of {file}", whole))
    return whole


def lonely_stamps(stamps: pd.DatetimeIndex, where: str, whole: pd.DataFrame) -> RecordsWarning:
    """The finding of stamps that are left out, as they are not everywhere."""
    text = (
        f"{counted(len(stamps), 'stamp')} are not in all {where}, the first {stamps.min()}. They are left out; "
        f"{len(whole)} records have all columns. If they are many, compare the loggers' clocks"
    )
    return RecordsWarning(text, "different-rows")


def side_by_side(tables: Sequence[pd.DataFrame]) -> tuple[pd.DataFrame, pd.DatetimeIndex]:
    """Records with the columns of all tables, by their stamps, and the stamps that are not in all."""
    tables = [once(table) for table in tables]
    whole, every = pd.concat(tables, axis=1, join="inner"), tables[0].index
    for table in tables[1:]:
        every = every.union(table.index)
    return whole, every.difference(whole.index)


def once(table: pd.DataFrame, where: str = "") -> pd.DataFrame:
    """Records that come twice with the same values, up to the last bits, are one; others are an error."""
    again = table.index.duplicated()
    if not again.any():
        return table
    first, more = table[~again], table[again]
    is_other = ~np.isclose(more, first.loc[more.index], rtol=1e-9, atol=0.0, equal_nan=True).all(axis=1)
    if is_other.any():
        raise ValueError(
            f"{where}{counted(is_other.sum(), 'stamp')} of {list(table)} come twice with other values, the first "
            f"{more.index[is_other][0]}; expected each once. If the clocks go back then, {clocks.ZONE_OPTIONS}"
        )
    return first


def sections_of(block: Block, form: CsvFormat) -> list[Section]:
    """Records below each line of names: the first one, and those below that name the stamps again.

    Lines of units between names and records, and those above names as at the beginning, belong to neither.
    """
    first = block.names_line or form.names_line
    rows = [(line, row) for line, row in block.rows if line >= first]
    if not rows:
        raise ValueError(f"{block.where} is empty; expected a line of names, then a line for each record")
    titles = {row[0] for line, row in block.rows if line < first}
    n_lines = (form.values_line or form.names_line + 1) - form.names_line
    stamps, usual = list(form.stamp_columns) or names_of(rows[0][1][:1]), set(filter(None, rows[0][1]))
    heads = [
        place
        for place, (_, row) in enumerate(rows)
        if not place
        or (stamps[0] and all(name in row for name in stamps))
        or (not stamps[0] and not row[0] and 2 * len(usual.intersection(row)) > len(usual))
    ]
    sections: list[Section] = []
    for head, end in zip(heads, [*heads[1:], len(rows)], strict=True):
        line, names = rows[head]
        below = rows[head + 1 : end]
        while end < len(rows) and below and _is_title(below[-1][1], len(names), titles):
            below.pop()
        places = [names.index(name) for name in stamps if name in names]
        least = first + n_lines if not sections and block.names_line is None else None
        n_between = _n_above_records(below, places, form, least)
        width = used_width([row for _, row in rows[head:end]], len(names))
        found = Section(line, names_of(names[:width]), [row for _, row in below[:n_between]], below[n_between:])
        if sections and found.names == sections[-1].names:
            sections[-1].records.extend(found.records)
        else:
            sections.append(found)
    return sections


def _n_above_records(below: list[Line], places: list[int], form: CsvFormat, least: int | None) -> int:
    """How many lines below the names are no records: without a stamp, and before a line or, if none is known, without
    numbers, as units are."""
    for count, (line, row) in enumerate(below):
        is_record = any(_is_number(cell, form.decimal) for cell in row) if least is None else line >= least
        has_places = len(row) > max(places, default=0)
        if is_record or (has_places and clocks.parsed_or_iso([clocks.stamp_text(row, places)], form.stamps).notna()[0]):
            return count
    return len(below)


def _is_title(row: list[str], width: int, titles: set[str]) -> bool:
    """Whether a line above names is no record: it begins as at the top of the file, or with a letter."""
    return row[0] in titles or (len(row) != width and row[0][:1].isalpha())


def blocks_in(file: Path, form: CsvFormat) -> list[Block]:
    """Cells of each line that is not empty, with the number of the line: of a text, or of each sheet."""
    if file.suffix.lower() in WORKBOOKS:
        sheets, serial = sheets_of(file)
        rows = {name: _rows_of_cells(cells, form.decimal) for name, cells in sheets.items()}
        names = [f"{file}, sheet {name!r}" for name in sheets] if len(sheets) > 1 else [str(file)]
        return [Block(*one, serial=serial, is_sheet=True) for one in zip(names, rows.values(), strict=True)]
    text = text_of(file, form.encoding)
    try:
        rows = rows_of(text, form.separator)
    except ValueError as error:
        raise ValueError(f"{file}, {error}") from error
    is_finished = not rows or text.endswith(("\n", "\r")) or rows[-1][0] < len(text.splitlines())
    return [Block(str(file), rows, is_finished)]


def blocks_of_records(file: Path, form: CsvFormat) -> tuple[list[Block], list[RecordsWarning]]:
    """Blocks that name the stamps as the longest one does, from that line on, and a finding that tells which sheets
    these are."""
    blocks = blocks_in(file, form)
    if len(blocks) == 1:
        return blocks, []
    longest = max(blocks, key=lambda block: len(block.rows))
    names = next((row for line, row in longest.rows if line >= form.names_line), [])
    found, read, others = [], [], []
    for block in blocks:
        line = None if block is longest else _line_of_names(block, form, names)
        is_read = block is longest or line is not None
        found += [block._replace(names_line=line)] if is_read else []
        (read if is_read else others).append(block.where.rpartition("sheet ")[2])
    text = f"sheets of {file.name} that are read: {', '.join(read)}"
    if others:
        text += f"; not {', '.join(others)}, without stamps as on the longest"
    return found, [RecordsWarning(f"{text}. Name the stamps alike on each sheet that holds records", "read-as")]


def _line_of_names(block: Block, form: CsvFormat, names: Sequence[str]) -> int | None:
    """The line of names of a sheet: one that names the stamps as the longest sheet does, or the one above stamps in the
    first column; None where there is neither."""
    stamps = list(form.stamp_columns) or names[:1]
    if named := [line for line, row in block.rows if stamps != [""] and all(name in row for name in stamps)]:
        return named[0]
    is_stamp = clocks.parsed_or_iso([row[0] for _, row in block.rows], form.stamps).notna()
    first = int(is_stamp.argmax()) if len(is_stamp) else 0
    if form.stamp_columns or not first or 2 * is_stamp.sum() < len(is_stamp):
        return None
    return max(block.rows[:first], key=lambda one: sum(map(bool, one[1])))[0]


def sheets_of(file: Path) -> tuple[dict[str, Any], str]:
    """Cells of each sheet that is not empty, by its name, and how serial dates are counted."""
    try:
        import_optional("openpyxl", extra="excel")
        with pd.ExcelFile(file, engine="openpyxl") as book:
            sheets = {
                name: pd.read_excel(book, sheet_name=name, header=None, dtype=object, na_filter=False).to_numpy()
                for name in book.sheet_names
            }
            serial = clocks.EXCEL_1904 if book.book.epoch.year == 1904 else clocks.EXCEL
    except OSError:
        raise
    except Exception as error:  # of a workbook that is none, or without openpyxl
        raise ValueError(f"{file} cannot be read: {error}; expected an Excel workbook, or a CSV file") from error
    return {name: cells for name, cells in sheets.items() if cells.size} or {"": np.empty((0, 0))}, serial


def _rows_of_cells(cells: Any, decimal: str) -> list[Line]:
    """Cells of a sheet as texts: dates as in ISO 8601, numbers with all of their digits."""
    rows = [[_text_of_cell(cell, decimal) for cell in row] for row in cells]
    return [(line, row) for line, row in enumerate(rows, start=1) if any(row)]


def _text_of_cell(cell: Any, decimal: str) -> str:
    if isinstance(cell, float):
        return str(cell).replace(".", decimal)
    if isinstance(cell, datetime) and cell.microsecond:  # a formula, such as =A2+1/24, is not exact
        cell = pd.Timestamp(cell).round("s")
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
    for one, others in (("utf-16-le", content[1:400:2]), ("utf-16-be", content[:400:2])):
        if len(content) % 2 == 0 and 2 * others.count(0) > len(others):
            found = [one]
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


def _numbers(texts: Sequence[str], decimal: str, column: str, where: str, lines: Sequence[int]) -> Array:
    values = np.full(len(texts), np.nan)
    for place, text in enumerate(texts):
        try:
            values[place] = number(text, decimal)
        except ValueError as error:
            expected = f"a number with the decimal sign {decimal!r}, or nothing"
            raise ValueError(f"{where}, line {lines[place]}, {column}: {text!r:.100}; expected {expected}") from error
    return values


def number(text: str, decimal: str) -> float:
    """A number, NaN for a text that stands for none or for infinity. With another decimal sign, a point would stand for
    thousands; a single group of them, as in 1,234, might also be decimals, and is refused."""
    if "_" not in text and (decimal == "." or "." not in text):
        with suppress(ValueError):
            value = float(text.replace(decimal, "."))
            return value if isfinite(value) else np.nan
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


def _times(texts: Sequence[str], form: CsvFormat, block: Block, lines: Sequence[int]) -> pd.DatetimeIndex:
    """Texts as times: in the time zone of the records; without one, in UTC if they have offsets."""
    has_offset = [clocks.WITH_OFFSET.search(text) is not None for text in texts]
    if 0 < sum(has_offset) < len(texts):
        place = has_offset.index(not has_offset[0])
        raise ValueError(
            f"{block.where}, line {lines[place]}: {texts[place]!r:.100}; {sum(has_offset)} of {len(texts)} stamps have "
            "an offset from UTC; expected all or none"
        )
    stamps = block.serial if form.stamps in (clocks.EXCEL, clocks.EXCEL_1904) else form.stamps
    index = clocks.parsed_or_iso(texts, stamps)
    if block.is_sheet:
        index = clocks.otherwise_written(texts, index, stamps, block.serial, block.where)
    if index.hasnans:
        wrong = np.flatnonzero(index.isna())
        expected = "one such as 2026-01-31 13:00" if form.stamps == clocks.ISO else f"one in the format {form.stamps}"
        raise ValueError(
            f"{block.where}, line {lines[wrong[0]]}: {texts[wrong[0]]!r:.100} is no time; expected {expected}; "
            f"{len(wrong)} of {len(texts)} stamps are wrong"
        )
    if form.time_zone is not None and index.tz is None:
        return clocks.by_local_clock(index, form.time_zone, block.where, lines)
    return index if form.time_zone is None else index.tz_convert(form.time_zone)


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
        form, notes = _form_of(file, zone, stamps)
        units, ignored = _units_and_texts(file, form, wanted)
    records, findings = read_and_doubted(file, form, ignore=ignored)
    ignored |= {name: why for name, why in _no_measurements(records) if name not in wanted}
    records = records.drop(columns=[name for name in records if name in ignored])
    marked = [marker for marker in MISSING_CODES if records.isin([marker]).to_numpy().any()]
    if marked:
        records, form = records.mask(records.isin(marked)), replace(form, missing=marked)
    units |= {name: unit for name in records if (unit := unit_in(name))}
    records, aside = clocks.of_the_right_clock(records, file)
    return FileLook(file, form, records, ignored, units, tuple(notes), (*findings, *aside))


def _form_of(file: Path, zone: str | None, stamps: str | None) -> tuple[CsvFormat, list[str]]:
    """Form of a CSV file or workbook, and notes."""
    separator, decimal = _division(file)
    block = max(blocks_in(file, CsvFormat(separator, decimal)), key=lambda block: len(block.rows))
    width = used_width(
        [row for _, row in block.rows], _usual_width([row for _, row in block.rows[: clocks.MOST_LOOKED_AT]])
    )
    rows = [(line, without_margin(row, width)) for line, row in block.rows]
    cells = [row for _, row in rows if len(row) == width]
    places, stamps, notes = clocks.find_stamps(cells, file, stamps, block.serial)
    looked = [row if len(row) > max(places) else [""] * (max(places) + 1) for _, row in rows[: clocks.MOST_LOOKED_AT]]
    is_record = clocks.times_in(looked, places, stamps).notna()
    titles = [
        (place, [one for one in rows[:place] if len(one[1]) == len(rows[place][1]) and one[1][0] != "TOA5"])
        for place in np.flatnonzero(is_record)[:100]
    ]
    first, above = next(((place, above) for place, above in titles if above), (0, []))
    above = [one for one in above if not one[1][0].startswith("#")] or above
    if not above:
        raise ValueError(
            f"{file}: no line of names above the values was found, with {separator!r} between {width} columns and the "
            f"decimal sign {decimal!r}; expected one, then a line for each record"
        )
    names_line, names = max(above, key=lambda one: sum(map(bool, one[1])))  # a title has fewer cells
    lost = [place for place in np.flatnonzero(is_record[:first]) if sum(map(bool, rows[place][1])) > 1 + len(places)]
    if lost:
        raise ValueError(f"{block.where}, line {rows[lost[0]][0]} has a stamp above the names; expected names above it")
    stamp_columns = [names_of(names)[place] for place in places]
    has_offsets = clocks.WITH_OFFSET.search(clocks.stamp_text(rows[first][1], places)) is not None
    form = CsvFormat(
        separator,
        decimal,
        names_line=names_line,
        values_line=rows[first][0] if rows[first][0] != names_line + 1 else None,
        stamp_columns=() if stamp_columns == names_of(names)[:1] else stamp_columns,
        stamps=stamps,
        time_zone="UTC" if zone is None and (has_offsets or stamps in clocks.EPOCHS) else zone,
    )
    return form, notes


def _units_and_texts(file: Path, form: CsvFormat, wanted: Collection[str]) -> tuple[dict[str, Unit], dict[str, str]]:
    """Units of columns as lines below the names have them, and why columns are no numbers, or not of all records."""
    units: dict[str, Unit] = {}
    kinds: dict[str, list[bool]] = {}
    sections = [section for block in blocks_of_records(file, form)[0] for section in sections_of(block, form)]
    for section in sections:
        for row in section.below:
            for name, cell in zip(section.names, row, strict=False):
                unit = unit_called(cell)
                if unit and units.setdefault(name, unit) != unit:
                    text = f"{name!r} is in {unit.name} and in {units[name].name}"
                    raise ValueError(f"{file}, line {section.line}: {text}; expected one unit of a column")
        stamps = list(form.stamp_columns) or section.names[:1]
        for _, row in section.records[: clocks.MOST_LOOKED_AT]:
            for name, cell in zip(section.names, row, strict=False):
                if name not in stamps and (is_number := _is_number(cell, form.decimal)) is not None:
                    kinds.setdefault(name, []).append(is_number)
    ignored = {name: "it holds text" for name, found in kinds.items() if sum(found) < clocks.MOSTLY * len(found)}
    shared = [section for section in sections if len(set(section.names) & set(sections[0].names)) > len(stamps)]
    if len(shared) == len(sections):
        n_records = sum(len(section.records) for section in sections)
        for name in kinds:
            n_own = sum(len(section.records) for section in sections if name in section.names)
            if n_own < n_records and name not in wanted:
                ignored.setdefault(name, f"only {n_own} of {n_records} records have it")
    return units, ignored


def _division(file: Path) -> tuple[str, str]:
    """Separator and decimal sign by which lines of the usual number of columns have the most numbers."""
    if file.suffix.lower() in WORKBOOKS:
        sheet = max(sheets_of(file)[0].values(), key=len)[: clocks.MOST_LOOKED_AT]
        ways = {(",", decimal): _rows_of_cells(sheet, decimal) for decimal in DECIMAL_SIGNS}
    else:
        head, ways = "\n".join(text_of(file).splitlines()[: clocks.MOST_LOOKED_AT]), {}
        for separator, decimal in product(SEPARATORS, DECIMAL_SIGNS):
            with suppress(ValueError):
                ways[separator, decimal] = rows_of(head, separator) if separator != decimal or '"' in head else []
    shares = {("", ""): 0.0}
    for (separator, decimal), lines in ways.items():
        width = _usual_width([row for _, row in lines])
        numbers = [_is_number(cell, decimal) for _, row in lines if len(row) == width for cell in row[1:]]
        share = numbers.count(True) / max(len(lines), 1)
        shares[separator, decimal] = share / 1.5 if separator == " " else share  # dates have spaces, too
    best = max(shares, key=lambda way: shares[way])
    if not shares[best]:
        raise ValueError(f"{file}: no columns of numbers were found; expected values with one of {SEPARATORS} between")
    return best


def _usual_width(rows: Sequence[Sequence[str]]) -> int:
    widths = [len(row) for row in rows]
    return max(set(widths), key=widths.count, default=0)


def _is_number(cell: str, decimal: str) -> bool | None:
    """Whether a cell has a number; None where it has no value."""
    try:
        return None if np.isnan(number(cell, decimal)) else True
    except ValueError:
        return False


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
