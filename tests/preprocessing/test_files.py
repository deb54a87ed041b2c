"""Files of many kinds are read rightly, with what is left out named, or are refused in one sentence: never wrongly."""

import io
import warnings
from dataclasses import dataclass

import numpy as np
import pandas as pd
import pytest

from skthermo.preprocessing import read_records

N = 200
SERIES = {
    "hours": pd.date_range("2025-02-25", periods=N, freq="h"),
    "quarters": pd.date_range("2025-03-14", periods=N, freq="15min"),
    "six hours": pd.date_range("2024-12-20", periods=N, freq="6h"),
}
DAY = pd.Timedelta("1D")


def records(index):
    random = np.random.default_rng(0)
    air = 10 + 6 * np.sin(2 * np.pi * np.arange(N) / 24) + random.normal(0, 0.5, N)
    table = {"T_air": air, "T_deck": air - 1 + random.normal(0, 0.3, N), "f1": 4 - 0.008 * air, "f2": 7 - 0.01 * air}
    return pd.DataFrame(table, index).round(4)


@dataclass(frozen=True)
class Written:
    """The content of a file, its ending, and the records that are in it."""

    content: bytes
    truth: pd.DataFrame
    ending: str = ".csv"


def lines(X, stamp, *, names=None, separator=",", head=(), below=(), values=None, ends=""):
    """A text; ``stamp`` writes a time, ``values`` are those that are written if these are in other units."""
    cells = (X if values is None else values).map(repr).to_numpy()
    rows = [f"{stamp(t)}{separator}{separator.join(row)}{ends}" for t, row in zip(X.index, cells, strict=True)]
    names = names or separator.join(["time", *X])
    return "\n".join([*head, names, *below, *rows, ""])


def text(stamp, truth=None, encoding="utf-8", **options):
    """A kind of texts: by a format or a function of stamps."""
    write = stamp if callable(stamp) else lambda t: t.strftime(stamp)
    return lambda X: Written(lines(X, write, **options).encode(encoding), X if truth is None else truth(X))


def at_midnight(usual, day):
    return lambda t: t.strftime(day if t.time() == pd.Timestamp("2025-01-01").time() else usual)


def as_24(day):
    return lambda t: (t - DAY).strftime(f"{day} 24:00") if t == t.normalize() else t.strftime(f"{day} %H:%M")


def since(start, factor=1):
    return lambda t: repr(round((t - pd.Timestamp(start)) / pd.Timedelta("1s") * factor))


def in_utc(hours=0):
    return lambda X: X.set_axis((X.index - pd.Timedelta(hours=hours)).tz_localize("UTC"))


def wrong_clock(start):
    """Some records have the stamps of a clock that was wrong."""

    def write(X):
        begin = X.index[80] + pd.Timedelta(weeks=1024) if start is None else pd.Timestamp(start)
        stamps = X.index.to_numpy().copy()
        stamps[80:84] = pd.date_range(begin, periods=4, freq=X.index[1] - X.index[0])
        return Written(lines(X.set_axis(stamps), str).encode(), X.drop(X.index[80:84]))

    return write


def in_units(names, units, factor, zero=0.0, what=("f1", "f2")):
    """Values in other units, which names, a line below them, or both tell."""

    def write(X):
        values = X.copy()
        values[list(what)] = values[list(what)] * factor + zero
        shown = {name: names.format(name, units) if name in what else name for name in X}
        below = [] if names != "{0}" else [",".join(["", *(units if name in what else "" for name in X)])]
        content = lines(X, str, names=",".join(["time", *shown.values()]), below=below, values=values).encode()
        return Written(content, X.rename(columns=shown))

    return write


def two_heads(first, second, head=lambda names: [",".join(["time", *names])], truth=None):
    """Parts with other columns, each below its own line of names."""

    def write(X):
        X = X.assign(T_new=X["T_air"] + 1)
        parts = [X[first(X)][:80], X[second(X)][80:]]
        texts = [lines(part, str, names="\n".join(head(list(part)))) for part in parts]
        return Written("".join(texts).encode(), X[truth or ["T_air", "T_deck", "f1", "f2"]])

    return write


def toa5(names):
    first = '"TOA5","Bridge","CR6","1","CR6.Std.12","CPU:b.CR6","5","Hourly"'
    return [first, ",".join(["time", *names]), ",".join(["TS", *("Hz" if n[0] == "f" else "Deg C" for n in names)]),
            ",".join(["", *("Avg" for _ in names)])]  # fmt: skip


def usual(X):
    return ["T_air", "T_deck", "f1", "f2"]


def more(X):
    return [*usual(X), "T_new"]


def swapped(X):
    return ["f2", "T_deck", "f1", "T_air"]


def blocks_of_columns(X):
    content = lines(X[["T_air", "T_deck"]], str) + lines(X[["f1", "f2"]], str)
    return Written(content.encode(), X)


def other_unit_within(X):
    below = [[",".join(["", unit, unit, "Hz", "Hz"])] for unit in ("degC", "degF")]
    return Written(
        "".join(lines(part, str, below=b) for part, b in zip((X[:80], X[80:]), below, strict=True)).encode(), X
    )


def book(*sheets, epoch_1904=False):
    """A workbook; each sheet is a name and a function that makes its rows."""

    def write(X):
        openpyxl = pytest.importorskip("openpyxl")
        one, file = openpyxl.Workbook(), io.BytesIO()
        one.remove(one.active)
        if epoch_1904:
            one.epoch = openpyxl.utils.datetime.CALENDAR_MAC_1904
        for name, rows in sheets:
            sheet = one.create_sheet(name)
            for row in rows(X):
                sheet.append(row)
            for cell in sheet["A"]:
                if isinstance(cell.value, float) and name.startswith("dates"):
                    cell.number_format = "yyyy-mm-dd hh:mm"
        one.save(file)
        return Written(file.getvalue(), X, ".xlsx")

    return write


def cells(part=slice(None), columns=None, stamp=lambda t: t.to_pydatetime(), above=()):
    def rows(X):
        X = X[part] if columns is None else X[part][columns]
        return [
            *above,
            ["time", *X],
            *([stamp(t), *row] for t, row in zip(X.index, X.to_numpy().tolist(), strict=True)),
        ]

    return rows


def serial(start, digits=10):
    return lambda t: round((t - pd.Timestamp(start)) / DAY, digits)


def notes(X):
    return [["a report"], ["of the bridge"]]


def months(X):
    """A sheet for each month."""
    parts = [(f"{month}", cells(X.index.to_period("M") == month)) for month in X.index.to_period("M").unique()]
    return book(*parts)(X)


def parts(form, names):
    return text(lambda t: t.strftime(form).replace(",0", ","), names=f"{names},T_air,T_deck,f1,f2")


ISO = "%Y-%m-%d %H:%M:%S"
KINDS = {
    "ISO 8601": text(ISO),
    "German": text("%d.%m.%Y %H:%M"),
    "American": text("%m/%d/%Y %I:%M %p"),
    "midnight without its time, German": text(at_midnight("%d.%m.%Y %H:%M", "%d.%m.%Y")),
    "24:00": text(as_24("%d.%m.%Y")),
    "compact, of two columns": text("%Y%m%d,%H:%M:%S", names="date,time,T_air,T_deck,f1,f2"),
    "GMT+1 behind": text("%Y-%m-%d %H:%M GMT+1", in_utc(1)),
    "an offset, German": text("%d.%m.%Y %H:%M+0100", in_utc(1)),
    "year, month, day, hour, minute": parts("%Y,%m,%d,%H,%M", "year,month,day,hour,minute"),
    "since 1970": text(since("1970-01-01"), in_utc()),
    "since 1904": text(since("1904-01-01"), in_utc()),
    "serial dates": text(lambda t: f"{serial('1899-12-30')(t):.8f}"),
    "the newest first": lambda X: Written(lines(X[::-1], str).encode(), X),
    "a clock at 1970": wrong_clock("1970-01-01"),
    "a clock 1024 weeks ahead": wrong_clock(None),
    "another order within": two_heads(usual, swapped),
    "a column more within TOA5": two_heads(usual, more, toa5),
    "names again within": two_heads(usual, usual),
    "columns in two blocks": blocks_of_columns,
    "spaces in columns": text(
        " %d.%m.%Y   %H:%M:%S", names="Date  Time  T_air T_deck f1  f2", separator="   "),
    "tabs": text(ISO, separator="\t"),
    "UTF-16 without a mark": text(ISO, encoding="utf-16-le"),
    "three lines of a head": text(ISO, below=[",degC,degC,Hz,Hz", ",Avg,Avg,Smp,Smp"]),
    "mHz in brackets": in_units("{0} [{1}]", "mHz", 1e3),
    "mHz behind": in_units("{0}_{1}", "mHz", 1e3),
    "fahrenheit below": in_units("{0}", "Deg F", 1.8, 32.0, ["T_air"]),
    "kelvin, as values tell": in_units("{0}_{1}", "1", 1.0, 273.15, ["T_air", "T_deck"]),
    "dates of six decimals": book(("dates", cells(stamp=serial("1899-12-30", 6)))),
    "serial dates since 1904": book(("log", cells(stamp=serial("1904-01-01"))), epoch_1904=True),
    "a sheet for each month": months,
    "two sheets below titles": book(("1", cells(slice(0, 120), above=[["Bridge"]])), ("2", cells(slice(120, N)))),
    "T and F on sheets": book(("T", cells(columns=["T_air", "T_deck"])), ("F", cells(columns=["f1", "f2"]))),
    "a sheet of notes": book(("notes", notes), ("log", cells()), ("more", notes)),
}  # fmt: skip
"""Kinds that are read rightly."""

VARIANTS = {
    "with a T": text("%Y-%m-%dT%H:%M:%S"),
    "names of months": text("%d %b %Y %H:%M:%S"),
    "midnight without its time, ISO": text(at_midnight("%Y-%m-%d %H:%M", "%Y-%m-%d")),
    "24:00, the year first": text(as_24("%Y-%m-%d")),
    "compact, with a T": text("%Y%m%dT%H%M%S"),
    "compact": text("%Y%m%d%H%M%S"),
    "UTC behind": text("%Y-%m-%d %H:%M:%S UTC", in_utc()),
    "CET behind": text("%Y-%m-%d %H:%M:%S CET", in_utc(1)),
    "MEZ behind": text("%d.%m.%Y %H:%M MEZ", in_utc(1)),
    "an offset and a zone": text("%Y-%m-%dT%H:%M:%S+01:00[Europe/Berlin]", in_utc(1)),
    "Tag, Monat, Jahr, Stunde, Minute": parts("%d,%m,%Y,%H,%M", "Tag,Monat,Jahr,Stunde,Minute"),
    "milliseconds since 1970": text(since("1970-01-01", 1000), in_utc()),
    "a clock at the beginning of a year": wrong_clock("2024-01-01"),
    "a column less within": two_heads(more, usual),
    "UTF-16 without a mark, big end first": text(ISO, encoding="utf-16-be"),
    "rad/s below": in_units("{0}", "rad/s", 2 * np.pi),
    "a minute's cycles": in_units("{0} [{1}]", "1/min", 60.0),
    "fahrenheit in brackets": in_units("{0} [{1}]", "°F", 1.8, 32.0, ["T_air", "T_deck"]),
    "kelvin below": in_units("{0}", "K", 1.0, 273.15, ["T_air", "T_deck"]),
    "dates of formulas": book(("dates", cells(stamp=serial("1899-12-30", 12)))),
    "dates since 1904": book(("dates", cells()), epoch_1904=True),
}  # fmt: skip
"""More of them, which take the same ways through the reader."""

DOUBTFUL = {
    "GPS": text(since("1980-01-06"), in_utc()),
    "since 2000": text(since("2000-01-01"), in_utc()),
    "another unit within": other_unit_within,
    "sheets of other times": book(("T", cells(slice(0, 100), ["T_air"])), ("F", cells(slice(100, N), ["f1", "f2"]))),
    "a head without a column": text("%Y-%m-%d %H:%M", names="time T_air T_deck f1 f2", separator=" "),
    "records above the names": lambda X: Written(
        (lines(X, str).partition("\n")[2][:2000] + "\n" + lines(X, str)).encode(), X
    ),
    "a zone for some": lambda X: Written(lines(X, lambda t: f"{t} CET" if t.hour else str(t)).encode(), X),
    "a sheet of daily means": lambda X: book(("log", cells()), ("means", cells(slice(0, N, 24), ["T_air", "f1"])))(X),
    "a second stamp of a stopped clock": lambda X: Written(lines(X, lambda t: str(t.normalize())).encode(), X),
}
"""Kinds that may be refused."""


def verdict(kind, series, folder):
    """Whether a file is read rightly, in part and so that it is said, refused, or wrongly."""
    written = {**KINDS, **VARIANTS, **DOUBTFUL}[kind](records(SERIES[series]))
    file = folder / f"log{written.ending}"
    file.write_bytes(written.content)
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        try:
            T, F = read_records(file)
        except ValueError as error:
            return "refused" if "\n" not in str(error) else "wrong"
    found, texts = T.join(F), " ".join(str(one.message) for one in given)
    is_right = list(found) == list(written.truth) and len(found) == len(written.truth)
    if is_right and found.index.equals(written.truth.index.sort_values()):
        is_right = np.allclose(found, written.truth.sort_index(), rtol=1e-9, atol=1e-9)
        if is_right and ("clock" not in kind or "set aside" in texts):
            return "right"
    return "said" if any(word in texts for word in ("left out", "set aside", "might also be", "not used")) else "wrong"


def of_each(kinds):
    """A test of each kind of files and each series; by day one of the series, another one for the next kind."""
    each = [(kind, series, (place + number) % len(SERIES) == 0)
            for place, kind in enumerate(kinds) for number, series in enumerate(SERIES)]  # fmt: skip
    return pytest.mark.parametrize(
        ("kind", "series"), [pytest.param(*one, marks=() if day else pytest.mark.nightly) for *one, day in each]
    )


@of_each(KINDS)
def test_files_are_read_as_they_are(kind, series, tmp_path):
    assert verdict(kind, series, tmp_path) == "right"


@pytest.mark.nightly
@of_each(VARIANTS)
def test_more_files_are_read_as_they_are(kind, series, tmp_path):
    assert verdict(kind, series, tmp_path) == "right"


@of_each(DOUBTFUL)
def test_what_is_not_certain_is_said_or_refused(kind, series, tmp_path):
    assert verdict(kind, series, tmp_path) in ("right", "said", "refused")


@pytest.mark.filterwarnings("ignore:.*'lane' is not used")
def test_a_flag_beside_a_date_is_no_time_of_day(tmp_path):
    days = records(pd.date_range("2025-01-05", periods=N)).assign(lane=np.arange(N) % 2)
    file = tmp_path / "log.csv"
    file.write_text(lines(days[["lane", "T_air", "T_deck", "f1", "f2"]], lambda t: f"{t:%Y-%m-%d}"))
    T, F = read_records(file)
    assert T.index.equals(F.index)
    assert (T.index == days.index).all()
