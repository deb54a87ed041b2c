"""What a file of records looks like: its form, its columns and their units."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress, product
from pathlib import Path

import numpy as np
import pandas as pd

from skthermo._tables.frames import MARKERS
from skthermo.commands._record_files import (
    EXCEL,
    ISO,
    OFFSET,
    PARQUET,
    UNIX,
    UNIX_MS,
    WORKBOOKS,
    CsvFormat,
    names_of,
    number,
    parsed,
    read_file,
    rows_in,
    rows_of,
    text_of,
    used_width,
    without_margin,
)

SEPARATORS, DECIMALS = (";", "\t", "|", ","), (".", ",")  # a comma last, as it may be a decimal sign
DAYS = (
    "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%y",
    "%d/%m/%y", "%m/%d/%y", "%y/%m/%d", "%d-%m-%y", "%y-%m-%d", "%d-%b-%Y", "%d %b %Y", "%d-%b-%y", "%Y%m%d",
)  # fmt: skip
CLOCKS = (" %H:%M:%S", " %H:%M", "", " %H:%M:%S.%f", " %I:%M:%S %p", " %I:%M %p")
WRITTEN = (ISO, *(day + clock for day, clock in product(DAYS, CLOCKS)))
YEARS = (1970, 2100)  # of stamps
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


def look_at(file: Path, zone: str | None = None, stamps: str | None = None, wanted: Collection[str] = ()) -> Look:
    """Find the form of a file and read it, in a time zone and with a format of its stamps if these are known. Columns
    that are wanted are used, whatever they hold."""
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {str(file)!r}; expected records as CSV, .xlsx or parquet")
    if file.suffix.lower() in PARQUET:
        form, units, ignored, notes = CsvFormat(time_zone=zone), {}, {}, []
    else:
        form, units, ignored, notes = _look_at_table(file, zone, stamps)
    records = read_file(file, form, ignore=ignored)
    ignored |= {name: why for name, why in _no_measurements(records) if name not in wanted}
    records = records.drop(columns=[name for name in records if name in ignored])
    marked = [marker for marker in MARKERS if records.isin([marker]).to_numpy().any()]
    if marked:
        records, form = records.mask(records.isin(marked)), replace(form, missing=marked)
    for name in records:
        named = UNIT.search(str(name))
        if named and named[1].lower() in UNITS:
            units[name] = UNITS[named[1].lower()]
    return Look(file, form, records, ignored, units, tuple(notes))


def _look_at_table(
    file: Path, zone: str | None, stamps: str | None
) -> tuple[CsvFormat, dict[str, str], dict[str, str], list[str]]:
    """Form of a CSV file or workbook, units of its columns as a line below the names has them, columns of text, and
    notes."""
    separator, decimal = (",", ".") if file.suffix.lower() in WORKBOOKS else _division(text_of(file), file)
    rows, _ = rows_in(file, CsvFormat(separator))
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
        name: UNITS[cell.lower()]
        for line, row in above
        if line > names_line
        for name, cell in zip(names, row, strict=True)
        if cell.lower() in UNITS
    }
    texts = {
        name: "it holds text"
        for name, cells in columns.items()
        if name not in stamp_columns and _share_of_numbers(cells, decimal) < MOSTLY
    }
    has_offsets = OFFSET.search(_stamp_text(cells[first], places)) is not None
    form = CsvFormat(
        separator,
        decimal,
        names_line=names_line,
        values_line=rows[first][0] if rows[first][0] != names_line + 1 else None,
        stamp_columns=() if stamp_columns == names[:1] else stamp_columns,
        stamps=stamps,
        time_zone="UTC" if zone is None and (has_offsets or stamps.startswith(UNIX)) else zone,
    )
    return form, units, texts, notes


def _division(text: str, file: Path) -> tuple[str, str]:
    """Separator and decimal sign by which lines of the usual number of columns have the most numbers."""
    head, found = "\n".join(text.splitlines()[:MOST_LOOKED_AT]), []
    for rank, (separator, decimal) in enumerate(product(SEPARATORS, DECIMALS)):
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
        raise ValueError(f"{file}: no columns of numbers were found; expected values with one of {SEPARATORS} between")
    return max(found)[2:]


def _usual_width(rows: Sequence[Sequence[str]]) -> int:
    widths = [len(row) for row in rows]
    return max(set(widths), key=widths.count, default=0)


def _share_of_numbers(cells: Sequence[str], decimal: str) -> float:
    """Share of numbers among the cells that have a value."""
    given = [kind for cell in cells if (kind := _is_number(cell, decimal)) is not None]
    return sum(given) / len(given) if given else 1.0


def _is_number(cell: str, decimal: str) -> bool | None:
    """Whether a cell has a number; None where it has no value."""
    try:
        return None if np.isnan(number(cell, decimal)) else True
    except ValueError:
        return False


def _stamps_of(rows: Sequence[Sequence[str]], file: Path, given: str | None) -> tuple[tuple[int, ...], str, list[str]]:
    """Places of the columns that hold the stamps, their format, and what is doubtful in it."""
    looked = rows[:MOST_LOOKED_AT]
    for forms in [(given,)] if given else [WRITTEN, (UNIX, UNIX_MS), (EXCEL,)]:
        tried = [(places, _fitting(looked, places, forms)) for places in _places(looked)]
        found = [one for one in tried if one[1]]
        if forms == (EXCEL,) and len(found) > 1:  # whole numbers may be counts of records
            found = [one for one in found if not _are_days(_times_in(looked, one[0], EXCEL))] or found
            if len(found) > 1:
                columns = " and ".join(str(places[0] + 1) for places, _ in found)
                raise ValueError(f"{file}: columns {columns} may all hold serial dates; expected one that does")
        if found:
            return found[0][0], *_certain(rows, *found[0], file)
    expected = f"in the format {given}" if given else "such as 2026-01-31 13:00 or 31.01.2026 13:00"
    raise ValueError(f"{file}: no column holds times, {expected}; the first values are {list(*rows[:1])!r:.200}")


def _places(rows: Sequence[Sequence[str]]) -> Iterator[tuple[int, ...]]:
    """Columns that may hold stamps: each with the nearest time of day, and alone."""
    columns = list(zip(*rows, strict=True))
    clocks = [n for n, cells in enumerate(columns) if 2 * sum(map(bool, map(TIME_OF_DAY.match, cells))) > len(cells)]
    for n in range(len(columns)):
        near = sorted((abs(clock - n), clock < n, clock) for clock in clocks if clock != n)
        yield from ((n, clock) for *_, clock in near[:1])
        yield (n,)


def _stamp_text(row: Sequence[str], places: Sequence[int]) -> str:
    return " ".join(row[place] for place in places)


def _times_in(rows: Sequence[Sequence[str]], places: Sequence[int], form: str) -> pd.DatetimeIndex:
    """Stamps in some columns of rows, NaT where there is none that is plausible."""
    index = parsed([_stamp_text(row, places) for row in rows], form)
    return index.where((index.year >= YEARS[0]) & (index.year <= YEARS[1]))


def _fitting(rows: Sequence[Sequence[str]], places: Sequence[int], forms: Sequence[str]) -> list[str]:
    """Formats by which the most rows have a stamp, if these are most rows, and their stamps are not all the same."""
    sample = rows[len(rows) // 2 :: max(len(rows) // 8, 1)]
    signs = {sign for row in sample for sign in _stamp_text(row, places)}
    likely = [form for form in forms if signs.issuperset(re.sub(r"%.|\w", "", form))]
    found = {form: _times_in(rows, places, form) for form in likely if _times_in(sample, places, form).notna().any()}
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


def _are_days(stamps: pd.DatetimeIndex) -> bool:
    return bool((stamps.dropna().normalize() == stamps.dropna()).all())


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


def is_in_kelvin(column: pd.Series) -> bool:
    """Whether values can only be temperatures in kelvin."""
    return bool(column.between(*KELVIN).mean() > MOSTLY)
