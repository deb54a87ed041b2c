"""What a file of records looks like: its form, its columns and their units."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from skthermo._tables.frames import MARKERS
from skthermo.commands._record_files import (
    ISO,
    MISSING,
    OFFSET,
    PARQUET,
    UNIX,
    CsvFormat,
    number,
    parsed,
    read_file,
    rows_of,
    text_of,
)

SEPARATORS, DECIMALS = (",", ";", "\t", "|"), (".", ",")
DAYS = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%Y/%m/%d", "%d.%m.%y", "%Y%m%d")
CLOCKS = (" %H:%M:%S", " %H:%M", "", " %H:%M:%S.%f", " %I:%M:%S %p", " %I:%M %p")
STAMPS = (ISO, *(day + clock for day, clock in product(DAYS, CLOCKS)), UNIX)
TIME_OF_DAY = re.compile(r"\d{1,2}:\d\d(:\d\d(\.\d+)?)?( ?[AaPp][Mm])?$")
UNIT = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")
UNITS = {
    "°c": "°C", "degc": "°C", "deg c": "°C", "c": "°C", "k": "K", "kelvin": "K", "°f": "°F", "degf": "°F", "f": "°F",
    "hz": "Hz", "mm": "mm", "m": "m", "mrad": "mrad", "rad": "rad", "°": "°", "deg": "°", "µm/m": "µm/m", "%": "%",
}  # fmt: skip
MOST_LOOKED_AT = 2000  # lines, by which the form of a file is found
MOSTLY = 0.9  # share of the cells that are numbers, from which a column holds numbers
KELVIN = (200.0, 340.0)  # range of a temperature in kelvin


@dataclass(frozen=True)
class Look:
    """The form of a file, its records, and what else was found in it.

    ``ignored`` says why columns are no measurements; ``units`` has those that the file names; ``notes`` are sentences
    for the reader of the settings.
    """

    file: Path
    form: CsvFormat
    records: pd.DataFrame
    ignored: dict[str, str]
    units: dict[str, str]
    notes: tuple[str, ...]


def look_at(file: Path, zone: str | None = None) -> Look:
    """Find the form of a file and read it."""
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {str(file)!r}; expected a CSV or parquet file with records")
    if file.suffix.lower() in PARQUET:
        form, units, ignored, notes = CsvFormat(time_zone=zone), {}, {}, []
    else:
        form, units, ignored, notes = _look_at_csv(file, zone)
    records = read_file(file, form, ignore=ignored)
    ignored |= dict(_no_measurements(records))
    records = records.drop(columns=[name for name in records if name in ignored])
    marked = [marker for marker in MARKERS if records.isin([marker]).to_numpy().any()]
    if marked:
        records, form = records.mask(records.isin(marked)), replace(form, missing=marked)
    for name in records:
        named = UNIT.search(str(name))
        if named and named[1].lower() in UNITS:
            units[name] = UNITS[named[1].lower()]
    return Look(file, form, records, ignored, units, tuple(notes))


def _look_at_csv(file: Path, zone: str | None) -> tuple[CsvFormat, dict[str, str], dict[str, str], list[str]]:
    """Form of a CSV file, units of its columns as a line below the names has them, columns of text, and notes."""
    encoding, text = _decoded(file)
    head = "\n".join(text.splitlines()[:MOST_LOOKED_AT])
    separator, decimal, rows = _divided(head)
    width = len(rows[-1][1])
    is_record = [len(row) == width and _share_of_numbers(row[1:], decimal) > 0 for _, row in rows]
    if not any(is_record) or is_record[0]:
        raise ValueError(
            f"{file}: no line of names above the values was found, with {separator!r} between {width} columns and the "
            f"decimal sign {decimal!r}; expected one, then a line for each record"
        )
    first = is_record.index(True)
    above = [n for n in range(first) if len(rows[n][1]) == width]
    if not above:
        raise ValueError(f"{file}, line {rows[first][0]}: values: {width}; expected a line of as many names above it")
    names, records = rows[above[0]][1], [row for _, row in rows[first:] if len(row) == width]
    columns = dict(zip(names, zip(*records, strict=True), strict=True))
    stamp_columns, stamps, notes = _stamps_of(columns, file)
    places = [names.index(name) for name in stamp_columns]
    while first - 1 > above[0] and _are_stamps([" ".join(rows[first - 1][1][n] for n in places)], stamps):
        first -= 1  # a record without a value
    units = {}
    for n in above[1:]:
        units |= {
            name: UNITS[cell.lower()] for name, cell in zip(names, rows[n][1], strict=True) if cell.lower() in UNITS
        }
    texts = {
        name: "it holds text"
        for name, cells in columns.items()
        if name not in stamp_columns
        and _share_of_numbers(cells, decimal) < MOSTLY
        and set(map(str.lower, cells)) - MISSING
    }
    has_offsets = OFFSET.search(" ".join(columns[name][0] for name in stamp_columns)) is not None
    form = CsvFormat(
        separator,
        decimal,
        encoding,
        names_line=rows[above[0]][0],
        values_line=rows[first][0] if rows[first][0] != rows[above[0]][0] + 1 else None,
        stamp_columns=() if stamp_columns == names[:1] else stamp_columns,
        stamps=stamps,
        time_zone="UTC" if zone is None and (has_offsets or stamps == UNIX) else zone,
    )
    return form, units, texts, notes


def _decoded(file: Path) -> tuple[str, str]:
    """Encoding and text of a file."""
    start = file.read_bytes()[:3]
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16", text_of(file, "utf-16")
    try:
        return "utf-8", text_of(file, "utf-8")
    except ValueError:
        return "cp1252", text_of(file, "cp1252")


def _divided(text: str) -> tuple[str, str, list[tuple[int, list[str]]]]:
    """Separator and decimal sign by which most lines have equally many columns and most cells are numbers, and the
    lines so divided; the last one is a whole record."""
    found = []
    for rank, (separator, decimal) in enumerate(product(SEPARATORS, DECIMALS)):
        rows = rows_of(text, separator)
        widths = np.array([len(row) for _, row in rows])
        if not len(widths) or (separator == decimal and '"' not in text):
            continue
        width = int(np.bincount(widths).argmax())
        if width < 2:
            continue
        whole = [row for row in rows if len(row[1]) == width]
        shares = [_share_of_numbers(row[1:], decimal) for _, row in whole]
        last = max(n for n, row in enumerate(rows) if len(row[1]) == width)
        found.append((round(len(whole) / len(rows) * np.mean(shares), 2), -rank, separator, decimal, rows[: last + 1]))
    if not found or max(found)[0] == 0:
        raise ValueError(f"no columns of numbers were found; expected values with one of {SEPARATORS} between")
    return max(found)[2:]


def _share_of_numbers(cells: Sequence[str], decimal: str) -> float:
    given = [cell for cell in cells if cell.lower() not in MISSING]
    return sum(_is_number(cell, decimal) for cell in given) / len(given) if given else 0.0


def _is_number(cell: str, decimal: str) -> bool:
    try:
        return np.isfinite(number(cell, decimal))
    except ValueError:
        return False


def _stamps_of(columns: dict[str, Sequence[str]], file: Path) -> tuple[list[str], str, list[str]]:
    """Columns that hold the stamps, their format, and what is doubtful in it."""
    names = list(columns)
    for n, name in enumerate(names):
        texts, used = columns[name], [name]
        if n + 1 < len(names) and all(TIME_OF_DAY.match(cell) for cell in columns[names[n + 1]]):
            used = names[n : n + 2]
            texts = [" ".join(parts) for parts in zip(texts, columns[names[n + 1]], strict=True)]
        fitting = [form for form in STAMPS if _are_stamps(texts, form)]
        if fitting:
            best = min(fitting, key=lambda form: (_irregularity(parsed(texts, form)), STAMPS.index(form)))
            others = [form for form in fitting if not parsed(texts, form).equals(parsed(texts, best))]
            doubts = [
                f"stamps of {file.name} may also have the format {one}: see that {best} is right" for one in others
            ]
            return used, best, doubts[:1]
    raise ValueError(
        f"{file}: no column holds times, such as 2026-01-31 13:00 or 31.01.2026 13:00; the first values are "
        f"{[cells[0] for cells in columns.values()]!r:.200}"
    )


def _are_stamps(texts: Sequence[str], form: str) -> bool:
    if form == UNIX:
        numbers = pd.to_numeric(pd.Series(texts, dtype=object), errors="coerce")
        return bool(numbers.between(5e8, 4e9).all())  # from 1985 on
    return not parsed(texts[:1], form).hasnans and not parsed(texts, form).hasnans


def _irregularity(stamps: pd.DatetimeIndex) -> float:
    """Mean time between neighbouring records over the usual one: days and months that are exchanged make it large."""
    steps = np.abs(np.diff(stamps.as_unit("ns").asi8)).astype(float)
    usual = np.median(steps) if len(steps) else 0.0
    return round(float(steps.mean() / usual), 3) if usual else 1.0


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


def is_in_kelvin(column: pd.Series) -> bool:
    """Whether values can only be temperatures in kelvin."""
    return bool(column.between(*KELVIN).mean() > MOSTLY)
