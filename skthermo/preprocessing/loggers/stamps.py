"""Stamps of records: formats that loggers and spreadsheets write, how that of a file is found, and wrong clocks."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.frames import DAY, YEAR, of_a_wrong_clock
from skthermo._core.text import counted
from skthermo.exceptions import RecordsWarning

MOST_LOOKED_AT = 2000  # lines, by which the form of a file is found
MOSTLY = 0.9  # share of the cells that are numbers, from which a column holds numbers
ISO, UNIX, UNIX_MS, EXCEL, EXCEL_1904 = "ISO8601", "unix", "unix_ms", "excel", "excel_1904"
NUMERIC_STAMPS = {
    UNIX: ("s", "1970-01-01", 5e8, 4e9), UNIX_MS: ("ms", "1970-01-01", 5e11, 4e12),
    "labview": ("s", "1904-01-01", 2.8e9, 6e9), "labview_ms": ("ms", "1904-01-01", 2.8e12, 6e12),
    "gps": ("s", "1980-01-06", 3e8, 3e9), "since_2000": ("s", "2000-01-01", 2.5e8, 3e9),
    EXCEL: ("D", "1899-12-30", 3e4, 7.5e4), EXCEL_1904: ("D", "1904-01-01", 2.85e4, 7.35e4),
}  # fmt: skip
"""Stamps that are numbers: their unit, when they begin, and the least and the greatest that are taken for times."""
EPOCHS = tuple(form for form in NUMERIC_STAMPS if form not in (EXCEL, EXCEL_1904))
ZONES = {
    "Z": 0, "UTC": 0, "GMT": 0, "WET": 0, "WEST": 60, "BST": 60, "CET": 60, "MEZ": 60, "CEST": 120, "MESZ": 120,
    "EET": 120, "EEST": 180, "EST": -300, "EDT": -240, "CST": -360, "CDT": -300, "MST": -420, "MDT": -360,
    "PST": -480, "PDT": -420,
}  # fmt: skip
"""Minutes by which clocks of a zone are ahead of UTC."""
ZONE_OPTIONS = "give the time zone (--zone of init and check, zone= of read_records, [csv] time_zone of settings)"
WITH_OFFSET = re.compile(
    rf"(?:(?<=:\d\d)|(?<=\d\.\d)|(?<=[.,]\d{{3}})|(?<=\d{{6}})|(?<=[AP]M)) ?"
    rf"(?:({'|'.join(ZONES)})|(?:UTC|GMT)?([+-]\d\d?)(?::?(\d\d))?)(?:\[[^]]*\])?$"
)
DAYS = (
    "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%y",
    "%d/%m/%y", "%m/%d/%y", "%y/%m/%d", "%d-%m-%y", "%y-%m-%d", "%d-%b-%Y", "%d %b %Y", "%d-%b-%y", "%Y%m%d",
    "%d %B %Y", "%B %d, %Y", "%Y %m %d", "%d %m %Y",
)  # fmt: skip
CLOCKS = (
    " %H:%M:%S", " %H:%M", "", " %H:%M:%S.%f", " %H:%M:%S,%f", " %I:%M:%S %p", " %I:%M %p", " %H %M %S", " %H %M",
    " %H",
)  # fmt: skip
TOGETHER = (
    "%Y%m%dT%H%M%S", "%Y%m%dT%H%M", "%Y%m%d %H%M%S", "%Y%m%d_%H%M%S", "%Y%m%d%H%M%S", "%Y%m%d %H%M", "%Y%m%d%H%M",
)  # fmt: skip
WRITTEN_STAMPS = (ISO, *(day + clock for day, clock in product(DAYS, CLOCKS)), *TOGETHER)


def parsed(texts: Sequence[str], form: str) -> pd.DatetimeIndex:
    """Texts as times, NaT for a text in another format; in UTC if they have offsets.

    24:00 is the midnight at the end of a day, and a date alone, among others with times, the one at its beginning.
    """
    if form in NUMERIC_STAMPS:
        unit, origin, least, most = NUMERIC_STAMPS[form]
        numbers = pd.to_numeric(pd.Series([text.replace(",", ".") for text in texts], dtype=object), errors="coerce")
        numbers = numbers.astype(float).where(numbers.between(least, most))
        times = pd.to_datetime(numbers, unit=unit, origin=origin, errors="coerce", utc=form in EPOCHS)
        index = pd.DatetimeIndex(times).as_unit("ns")
        if form == "gps":  # ahead of UTC by the leap seconds since 1980
            leaps = pd.DatetimeIndex(
                ["1999-01-01", "2006-01-01", "2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01"], tz="UTC"
            )
            index -= pd.to_timedelta(12 + leaps.searchsorted(index), unit="s")
        return index if form in EPOCHS else index.round("s")  # a serial date is cut after some decimals
    found = [WITH_OFFSET.search(text) for text in texts]
    plain = [text[: one.start()] if one else text for text, one in zip(texts, found, strict=True)]
    begun = [re.sub(r"(?<=[ T])24(?=:00(:00([.,]0+)?)?$)", "00", text) for text in plain]
    times = _in_nanoseconds(begun, form)
    if form == ISO:
        times = times.where([re.match(r"\d{4}-\d\d-\d\d", text) is not None for text in begun])
    elif ":" in form and times.notna().any() and times.isna().any():
        times = times.fillna(_in_nanoseconds(begun, form.partition(" ")[0]))
    times += pd.to_timedelta([int(here != there) for here, there in zip(plain, begun, strict=True)], unit="D")
    if any(found):
        times -= pd.to_timedelta([_minutes_ahead(one) for one in found], unit="min")
    index = pd.DatetimeIndex(times)
    return index.tz_localize("UTC") if any(found) else index


def _in_nanoseconds(texts: Sequence[str], form: str) -> pd.Series:
    times = pd.Series(pd.to_datetime(texts, format=form, errors="coerce"))
    return times.where(times.dt.year.between(1700, 2200)).dt.as_unit("ns")


def _minutes_ahead(offset: re.Match[str] | None) -> int:
    """Minutes by which an offset is ahead of UTC."""
    if offset is None:
        return 0
    zone, hours, minutes = offset.groups()
    return ZONES[zone] if zone else int(hours) * 60 + int(f"{hours[0]}{minutes or 0}")


def parsed_or_iso(texts: Sequence[str], form: str) -> pd.DatetimeIndex:
    """Texts as times in this format, or as in ISO 8601, which cannot be taken for another one: dates of a workbook."""
    index = parsed(texts, form)
    others = np.flatnonzero(index.isna())
    if form in (ISO, *NUMERIC_STAMPS) or not len(others):
        return index
    return _completed(index, others, parsed([texts[place] for place in others], ISO))


def otherwise_written(
    texts: Sequence[str], index: pd.DatetimeIndex, form: str, serial: str, where: str
) -> pd.DatetimeIndex:
    """Stamps of a workbook, where dates, serial dates and texts mean the same: those that are none in its format read
    by the only other one that they may have. Texts in two formats might be days and months that are exchanged."""
    others = np.flatnonzero(index.isna())
    rows = [[texts[place]] for place in others]
    for forms in (WRITTEN_STAMPS if form in (ISO, serial) else (), (serial,)) if rows else ():
        if fitting := _fitting(rows, (0,), forms):
            return _completed(index, others, times_in(rows, (0,), _certain(rows, (0,), fitting, where)[0]))
    return index


def _completed(index: pd.DatetimeIndex, places: NDArray[np.intp], found: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """Times with others in some places, if both have offsets from UTC or none has."""
    times = index.to_series(index=range(len(index)))
    if found.notna().any() and (found.tz is None) == (index.tz is None):
        times.iloc[places] = found
    return pd.DatetimeIndex(times)


def by_local_clock(index: pd.DatetimeIndex, zone: str, where: str, lines: Sequence[int]) -> pd.DatetimeIndex:
    """Times of local clocks, in the order of the file. Of times that come twice in a night, those are of winter time
    that follow a step back, or a step that only winter time makes as long as the usual one."""
    times = index.as_unit("ns").asi8
    if len(times) > 1 and np.median(np.diff(times)) < 0:  # the newest first
        return by_local_clock(index[::-1], zone, where, lines[::-1])[::-1]
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
            f"{where}, line {lines[place]}: {index[place]} is no time in {zone}, as the clocks go forward then; "
            "expected the time zone of the logger's clock, such as 'Etc/GMT-1' for UTC+1 all year"
        )
    return local


def of_the_right_clock(records: pd.DataFrame, file: Path) -> tuple[pd.DataFrame, list[RecordsWarning]]:
    """Records without those that a wrong clock has stamped, and findings that name these, or a clock that was not
    set."""
    is_wrong = of_a_wrong_clock(records.index)
    right, wrong, texts = records[~is_wrong], records.index[is_wrong], []
    if len(wrong):
        texts.append(
            f"the stamps of {counted(len(wrong), 'record')} of {file.name} are far from the others, {wrong.min()} to "
            f"{wrong.max()}. They are set aside, as of a wrong clock. Correct their stamps if they count"
        )
    stamps = right.index.tz_localize(None).sort_values()
    first, last, years = stamps.min(), stamps.max(), np.diff(stamps) / YEAR
    starts = (pd.Timestamp("1980-01-06"), pd.Timestamp("2000-01-01"))  # of clocks that were never set
    is_unset = first.year < 1990 or last > pd.Timestamp.now() + YEAR or any(0 <= (first - t) / DAY < 1 for t in starts)
    if is_unset or (years > 2).any():
        between = f", with {years.max():.1f} years between" if (years > 2).any() else ""
        texts.append(
            f"the stamps of {file.name} are from {first} to {last}{between}, as of a clock that was not set. They are "
            "taken as they are. Correct them, or give their format"
        )
    return right, [RecordsWarning(text, "wrong-stamps") for text in texts]


def find_stamps(
    rows: Sequence[Sequence[str]], file: Path, given: str | None, serial: str
) -> tuple[tuple[int, ...], str, list[str]]:
    """Places of the columns that hold the stamps, their format, and doubts about it."""
    looked = rows[:MOST_LOOKED_AT]
    for forms in [(given,)] if given else [WRITTEN_STAMPS, EPOCHS, (serial,)]:
        found = [(places, fitting) for places in _places(looked) if (fitting := _fitting(looked, places, forms))]
        if forms == (serial,) and len(found) > 1:  # whole numbers may be counts of records
            times = [times_in(looked, places, serial).dropna() for places, _ in found]
            varied = [one for one, index in zip(found, times, strict=True) if (index.normalize() != index).any()]
            found = varied or found
            if len(found) > 1:
                columns = " and ".join(str(places[0] + 1) for places, _ in found)
                raise ValueError(f"{file}: columns {columns} may all hold serial dates; expected one that does")
        if found:
            decide = _epoch_of if forms == EPOCHS else _certain
            return found[0][0], *decide(rows, *found[0], str(file))
    expected = f"in the format {given}" if given else "such as 2026-01-31 13:00 or 31.01.2026 13:00"
    values = max(rows[:MOST_LOOKED_AT], key=lambda row: sum(map(str.isdigit, "".join(row))), default=[])
    raise ValueError(f"{file}: no column holds stamps, {expected}; the first values are {list(values)!r:.200}")


def _epoch_of(
    rows: Sequence[Sequence[str]], places: Sequence[int], forms: Sequence[str], where: str
) -> tuple[str, list[str]]:
    """The beginning from which numbers count: 1970 where that gives stamps from 2000 until now, else the only other
    one that does, and a note where several do."""
    begins = {form: times.min() for form in forms if len(times := times_in(rows, places, form).dropna())}
    latest = pd.Timestamp.now("UTC") + YEAR
    likely = [form for form, begin in begins.items() if begin.year >= 2000 and begin < latest]
    dates = " or ".join(f"{form!r} ({begins[form]})" for form in (likely or begins))
    first = [form for form in likely if form.startswith(UNIX)] or likely
    if len(first) != 1:
        raise ValueError(ambiguous(where, rows, places, dates))
    others = f"; they might also be {dates}" if len(likely) > 1 else ""
    note = f"stamps of {Path(where).name} are read in the format {first[0]!r}, from {begins[first[0]]} on{others}"
    return first[0], [note] if others or not first[0].startswith(UNIX) else []


def ambiguous(where: str, rows: Sequence[Sequence[str]], places: Sequence[int], forms: str) -> str:
    """The error of stamps that have more than one format."""
    text = stamp_text(rows[-1], places)
    return f"{where}: stamps such as {text!r} may have the formats {forms}; expected --stamps with the right one"


def _places(rows: Sequence[Sequence[str]]) -> Iterator[tuple[int, ...]]:
    """Columns that may hold stamps: parts of dates side by side, each with the nearest time of day, and each alone."""
    columns = list(zip(*rows, strict=True))

    def are_mostly(form: str, share: float = MOSTLY) -> list[bool]:
        """Which columns hold cells of a form."""
        counts = [sum(re.fullmatch(form, cell) is not None for cell in cells) for cells in columns]
        n_cells = [sum(map(bool, cells)) for cells in columns]
        return [count > share * number for count, number in zip(counts, n_cells, strict=True)]

    are_days, are_hours = are_mostly(r"\d{1,4}([-./])\d{1,2}\1\d{1,4}"), are_mostly(r"[01]?\d|2[0-4]")
    for n in range(len(columns) - 1):
        if are_days[n] and are_hours[n + 1] and len(set(filter(str.isdecimal, columns[n + 1]))) > 2:  # no flag
            yield n, n + 1
    are_parts = are_mostly(r"\d{1,4}")
    for n, width in product(range(len(columns)), (6, 5, 4)):  # years, months, days, hours, or days first
        if n + width <= len(columns) and all(are_parts[n : n + width]):
            yield tuple(range(n, n + width))
    are_clocks = are_mostly(r"\d{1,2}:\d\d(:\d\d(\.\d+)?)?( ?[AaPp][Mm])?", 0.5)
    clocks = np.flatnonzero(are_clocks).tolist()
    for n in range(len(columns)):
        near = sorted((abs(clock - n), clock < n, clock) for clock in clocks if clock != n)
        yield from ((n, clock) for *_, clock in near[:1])
        yield (n,)


def stamp_text(row: Sequence[str], places: Sequence[int]) -> str:
    """The parts of a row's stamp as one text."""
    return " ".join(row[place] for place in places)


def times_in(rows: Sequence[Sequence[str]], places: Sequence[int], form: str) -> pd.DatetimeIndex:
    """Stamps in some columns of rows, NaT where there is none that is plausible."""
    index = parsed_or_iso([stamp_text(row, places) for row in rows], form)
    return index.where((index.year >= 1970) & (index.year <= 2100))


def _fitting(rows: Sequence[Sequence[str]], places: Sequence[int], forms: Sequence[str]) -> list[str]:
    """Formats by which the most rows have a stamp, if these are most rows, and their stamps are not all the same."""
    half = len(rows) // 2
    sample = [*rows[half :: max(len(rows) // 8, 1)], *rows[half : half + 4]]
    texts = [stamp_text(row, places) for row in sample]
    signs = {re.sub(r"\w+", "", WITH_OFFSET.sub("", " ".join(text.split()))) for text in texts}
    likely = [form for form in forms if form == ISO or form in NUMERIC_STAMPS or re.sub(r"%.|\w", "", form) in signs]
    if forms == WRITTEN_STAMPS and all(re.fullmatch(r"[-+]?\d{0,7}([.,]\d*)?", text) for text in texts):
        return []  # measurements
    found = {form: times_in(rows, places, form) for form in likely if parsed(texts, form).notna().any()}
    n_above = min((int(index.notna().argmax()) for index in found.values() if index.notna().any()), default=0)
    least = max([(len(rows) - n_above) / 2, *(index.notna().sum() for index in found.values())])
    return [
        form
        for form, index in found.items()
        if index.notna().sum() == least
        and 2 * index.nunique() >= least
        and (form not in (EXCEL, EXCEL_1904) or _is_in_order(index))  # other numbers are as large
    ]


def _certain(
    rows: Sequence[Sequence[str]], places: Sequence[int], forms: Sequence[str], where: str
) -> tuple[str, list[str]]:
    """Of several formats, the one by which the most rows have a stamp, or else the only one by which they follow each
    other regularly, which must also be that of the shortest time: days and months that are exchanged lengthen it."""
    found: dict[str, pd.DatetimeIndex] = {}
    for form in forms:
        index = times_in(rows, places, form)
        if not any(index.equals(other) for other in found.values()):
            found[form] = index
    most = max(index.notna().sum() for index in found.values())
    readings = [form for form, index in found.items() if index.notna().sum() == most]
    shortest = min(readings, key=lambda form: found[form].max() - found[form].min())
    certain = readings if len(readings) == 1 else [form for form in readings if _is_regular(found[form])]
    if certain != [shortest]:
        raise ValueError(ambiguous(where, rows, places, " or ".join(map(repr, readings))))
    others = [form for form in readings if form not in certain]
    name, why = Path(where).name, f"by {certain[0]}, they follow each other regularly"
    return certain[0], [f"stamps of {name} may also have the format {form}: {why}" for form in others[:1]]


def _is_in_order(stamps: pd.DatetimeIndex) -> bool:
    known = stamps.dropna()
    return known.is_monotonic_increasing or known.is_monotonic_decreasing


def _is_regular(stamps: pd.DatetimeIndex) -> bool:
    """Whether stamps are in order, with few gaps."""
    steps = np.abs(np.diff(stamps.dropna().asi8))
    return _is_in_order(stamps) and (not len(steps) or bool(steps.mean() <= 1.5 * np.median(steps)))
