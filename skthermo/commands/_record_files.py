"""Files of new records: CSV and parquet."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import RecordsWarning

ISO = "ISO8601"
PARQUET = (".parquet", ".pq")
MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none"}  # texts without a value, in small letters
DATE = re.compile(r"\d{4}-\d\d-\d\d")
OFFSET = re.compile(r":.*(Z|[+-]\d\d:?\d\d)$")


def read_file(
    file: Path, *, separator: str = ",", decimal: str = ".", stamps: str = ISO, zone: Any = None
) -> pd.DataFrame:
    """Records on their stamps in a time zone; what is no stamp or number is an error that names its line."""
    table = _parquet(file) if file.suffix.lower() in PARQUET else _csv(file, separator, decimal, stamps)
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


def _csv(file: Path, separator: str, decimal: str, stamps: str) -> pd.DataFrame:
    """Numbers are read to the last bit, and each line has as many values as the first."""
    text = file.read_bytes().decode("utf-8-sig")
    lines = csv.reader(text.splitlines(), delimiter=separator, skipinitialspace=True)
    rows = [(lines.line_num, [cell.strip() for cell in row]) for row in lines if any(map(str.strip, row))]
    if not rows:
        raise ValueError(f"{file} is empty; expected a line of names, then a line for each record")
    (_, names), *records = rows
    if len(names) < 2 or len(set(names[1:])) < len(names) - 1:
        raise ValueError(
            f"{file}: the first line names {names}; expected stamps and columns, each once, with {separator!r} between"
        )
    for line, row in records:
        if len(row) != len(names):
            raise ValueError(f"{file}, line {line}: values: {len(row)}; expected {len(names)} as named above")
    if not text.endswith(("\n", "\r")):
        warn_user(
            f"{file} does not end with a line break: its last value may be cut off", RecordsWarning, "unfinished file"
        )
    numbers = [line for line, _ in records]
    cells = list(zip(*(row for _, row in records), strict=True)) or [()] * len(names)
    values = [_numbers(column, decimal, file, numbers) for column in cells[1:]]
    return pd.DataFrame(np.transpose(values), _times(cells[0], stamps, file, numbers), names[1:])


def _numbers(texts: Sequence[str], decimal: str, file: Path, lines: Sequence[int]) -> Array:
    values = np.full(len(texts), np.nan)
    for place, text in enumerate(texts):
        if text.lower() not in MISSING:
            try:
                values[place] = _number(text, decimal)
            except ValueError as error:
                expected = f"a number with the decimal sign {decimal!r}, or nothing"
                raise ValueError(f"{file}, line {lines[place]}: {text!r:.100}; expected {expected}") from error
    return values


def _number(text: str, decimal: str) -> float:
    """A number; with another decimal sign, a point would stand for thousands."""
    if "_" in text or (decimal != "." and "." in text):
        raise ValueError(text)
    return float(text.replace(decimal, "."))


def _times(texts: Sequence[str], form: str, file: Path, lines: Sequence[int]) -> pd.DatetimeIndex:
    """Texts as times, in UTC if they have offsets from it."""
    n_offsets = sum(OFFSET.search(text) is not None for text in texts)
    if n_offsets not in (0, len(texts)):
        raise ValueError(f"{file}: {n_offsets} of {len(texts)} stamps have an offset from UTC; expected all or none")
    index = pd.DatetimeIndex(pd.to_datetime(texts, format=form, errors="coerce", utc=n_offsets > 0))
    is_wrong = np.array([form == ISO and DATE.match(text) is None for text in texts], dtype=bool) | index.isna()
    if is_wrong.any():
        place = int(np.argmax(is_wrong))
        expected = "2026-01-31 13:00" if form == ISO else f"the format {form}"
        raise ValueError(
            f"{file}, line {lines[place]}: {texts[place]!r:.100} is no time; expected one like {expected}; "
            f"{is_wrong.sum()} of {len(texts)} stamps are wrong"
        )
    return index
