"""Files as loggers and spreadsheets write them are read to the last bit, or refused with file, line and column."""

import io
import re
import sys
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from skthermo.commands._bridge import check_layout, read_baseline, read_columns
from skthermo.commands._settings import read_settings
from skthermo.preprocessing import read_records
from tests.commands.folders import run
from tests.nights import by_day

FAILED = 3
N = 80  # records of a file
RANDOM = np.random.default_rng(0)
RECORDS = pd.DataFrame(
    {"T1": RANDOM.normal(10, 8, N).round(2), "f1": RANDOM.normal(4, 0.1, N).round(4)},
    pd.date_range("2026-01-05 12:30", periods=N, freq="9h"),
)
RECORDS["s1"] = (1000 + 20 * RECORDS["T1"] + RANDOM.normal(0, 5, N)).round(1)  # a strain, partly above 1000
RECORDS.iloc[5, 0] = np.nan
EARLY = RECORDS.set_axis(pd.date_range("2026-03-01", periods=N, freq="3h"))  # no day after the twelfth
DAILY = RECORDS.set_axis(pd.date_range("2026-01-05", periods=N))
LONE = RECORDS.set_axis(pd.date_range("2026-03-04", periods=N, freq="15min"))  # one day, 3 April or 4 March
UTC = RECORDS.tz_localize("UTC")
AUTUMN = RECORDS.set_axis(pd.date_range("2026-10-24 20:00", periods=N, freq="20min", tz="Europe/Brussels"))
HOURS = RECORDS.set_axis(pd.date_range("2026-01-05 12:00", periods=N, freq="h"))
BEGUN = RECORDS.where(np.arange(N)[:, None] * [1, 1, 1] > 1)
ISO, US, GERMAN = "%Y-%m-%d %H:%M:%S", "%m/%d/%Y %H:%M", "%d.%m.%Y %H:%M"
COUNTS = [str(n) for n in range(40000, 40000 + N)]
COMMENTS = ["# Logger 12", "# station, bridge, river, north"]


@dataclass(frozen=True)
class Log:
    """Files by name, the records that are in them, and the options of ``init`` that they need."""

    files: dict[str, bytes]
    truth: pd.DataFrame
    options: tuple[str, ...] = ()


def rows(records=RECORDS, *stamps, write=repr, missing=""):
    """Cells of the names and of each record, with a column for each format of stamps."""
    stamps = stamps or (ISO,)
    cells = [[*["time", "clock"][: len(stamps)], *records]]
    for stamp, values in zip(records.index, records.to_numpy(), strict=True):
        texts = [missing if np.isnan(value) else write(float(value)) for value in values]
        cells.append([*(one(stamp) if callable(one) else stamp.strftime(one) for one in stamps), *texts])
    return cells


def log(cells, separator=",", *, end="\n", encoding="utf-8", truth=RECORDS, options=(), name="log.csv"):
    """A log of one file; its cells are lists, or lines as they are."""
    lines = [line if isinstance(line, str) else separator.join(line) for line in cells]
    return Log({name: "".join(line + end for line in lines).encode(encoding)}, truth, options)


def comma(value):
    return repr(value).replace(".", ",")


def quoted(cells):
    return [[f'"{cell}"' for cell in row] for row in cells]


def thousands(group, decimal):
    return lambda value: f"{value:,}".translate(str.maketrans(",.", group + decimal))


def toa5(width, records=RECORDS):
    """Four header lines, the first of which is as long as the records if these have eight columns."""
    names, *cells = rows(records)
    more = [f"V{n}" for n in range(width - 5)]
    head = [["TOA5", "Bridge", "CR1000X", "1234", "CR1000X.Std.05", "CPU:bridge.CR1X", "5678", "Hourly"],
            ["TIMESTAMP", "RECORD", *names[1:], *more], ["TS", "RN", "Deg C", "Hz", "", *("Volts" for _ in more)],
            ["", "", "Avg", "Avg", "Avg", *("Smp" for _ in more)]]  # fmt: skip
    body = [[f'"{stamp}"', str(n), *(one or '"NAN"' for one in values), *("12.5" for _ in more)]
            for n, (stamp, *values) in enumerate(cells)]  # fmt: skip
    return quoted(head), body


def with_column(cells, name, values, place=None):
    place = len(cells[0]) if place is None else place
    return [[*row[:place], cell, *row[place:]] for row, cell in zip(cells, [name, *values], strict=True)]


def workbook(cells, truth=RECORDS, more=()):
    """An Excel workbook in which numbers are numbers and times are times."""
    openpyxl = pytest.importorskip("openpyxl")
    book, file = openpyxl.Workbook(), io.BytesIO()
    for row in cells:
        book.active.append([None if isinstance(cell, float) and np.isnan(cell) else cell for cell in row])
    for name in more:
        book.create_sheet(name).append(["notes"])
    book.save(file)
    return Log({"log.xlsx": file.getvalue()}, truth)


def in_cells(records=RECORDS, *stamps):
    """Names and records of a workbook."""
    stamps = stamps or (lambda stamp: stamp.to_pydatetime(),)
    values = zip(records.index, records.to_numpy().tolist(), strict=True)
    names = [*["time", "clock"][: len(stamps)], *records]
    return [names, *([*(one(stamp) for one in stamps), *row] for stamp, row in values)]


def with_commas(cells, *columns):
    """Numbers of some columns as texts with decimal commas."""
    return [[comma(c) if isinstance(c, float) and n in columns else c for n, c in enumerate(row)] for row in cells]


def with_texts_for_times(cells):
    """Every second time as text, as a spreadsheet leaves those that it does not recognise."""
    return [[row[0].strftime(GERMAN), *row[1:]] if n % 2 else row for n, row in enumerate(cells)]


def serial(stamp):
    """Excel's serial number of a time, as it is written into a CSV file."""
    return f"{(stamp - pd.Timestamp('1899-12-30')) / pd.Timedelta('1D'):.10f}"


def pair():
    """Temperatures with a degree sign and frequencies without, from one program."""
    truth = RECORDS.rename(columns={"T1": "T1 [°C]"})
    files = {name: log(rows(truth[columns], GERMAN, write=comma), ";", encoding="cp1252").files["log.csv"]
             for name, columns in (("T.csv", ["T1 [°C]"]), ("F.csv", ["f1", "s1"]))}  # fmt: skip
    return Log(files, truth)


def late_evidence():
    """Months first, in a log that tells so only beyond the lines that are looked at first."""
    index = pd.date_range("2026-02-03 02:00", periods=3000, freq="10s").append(pd.date_range("2026-02-20", periods=50))
    T = np.arange(len(index)) % 37 / 4
    truth = pd.DataFrame({"T1": T, "f1": 4 - T / 100}, index)
    return log(rows(truth, "%m/%d/%Y %H:%M:%S"), truth=truth)


def changed(place, value, column="T1", records=RECORDS):
    """Records with another value in one row."""
    records = records.copy()
    records.loc[records.index[place], column] = value
    return records


def marked(*texts, separator=",", write=repr):
    """Missing temperatures that are written in several ways."""
    truth = RECORDS.copy()
    truth.iloc[10 : 10 + len(texts), 0] = np.nan
    cells = rows(truth, write=write, missing="NaN")
    for row, text in zip(cells[11:], texts, strict=False):
        row[1] = text
    return log(cells, separator, truth=truth)


def toa5_log(width, again=None):
    head, body = toa5(width)
    lines = head + (body if again is None else body[:again] + head + body[again:])
    return log(lines)


def repeated(cells, *places):
    """Cells with the line of names again at some places."""
    return [line for n, row in enumerate(cells) for line in ([cells[0]] if n in places else []) + [row]]


DEGREES = RECORDS.rename(columns={"T1": "T1 [°C]", "f1": "f1 (Hz)"})
STATE = with_column(rows(), "status", ["OK"] * 40 + ["LOW BATTERY"] + ["OK"] * 39)

UNDERSTOOD = {
    "plain": lambda: log(rows()),
    "TOA5": lambda: toa5_log(5),
    "TOA5 with eight columns, as its first line": lambda: toa5_log(8),
    "TOA5, its four lines again": lambda: toa5_log(5, again=30),
    "degree signs in cp1252 in one of two files": pair,
    "one column, decimal commas": lambda: Log(
        {f"{name}.csv": log(rows(RECORDS[[name]], GERMAN, write=comma), ";").files["log.csv"] for name in RECORDS},
        RECORDS, ("--temperatures", "T1", "--responses", "f1", "s1")),
    "quoted decimal commas": lambda: log(quoted(rows(RECORDS, GERMAN, write=comma))),
    "units in the second line": lambda: log([rows()[0], ["-", "degC", "Hz", "um/m"], *rows()[1:]]),
    "marks within, from files put together": lambda: log(
        ["\ufeff" + ",".join(rows()[0]), *rows()[1:31], "\ufeff" + ",".join(rows()[0]), *rows()[31:]]),
    "a separator after each line": lambda: log([[*row, ""] for row in rows()]),
    "a separator after each record": lambda: log([rows()[0], *([*row, ""] for row in rows()[1:])]),
    "separators after a title": lambda: log([["Bridge", "", "", ""], ["Logger", "12", "", ""], *rows()], ";"),
    "separators to the width of a spreadsheet": lambda: log(
        [[*row, "", "", ""] for row in [["Bridge", "", "", ""], *rows()]]),
    "marks of missing values": lambda: marked(
        "#N/A", "#NA", "n/a", "NULL", "1.#QNAN", "-1.#IND", "1.#QNAN0", "-nan(ind)"),
    "1,#QNAN": lambda: marked("1,#QNAN", "-1,#IND00", separator=";", write=comma),
    "dashes, infinity and errors of a spreadsheet": lambda: marked(
        "-", "--", "---", "INF", "-INF", "1.#INF", "-1.#INF00", "#DIV/0!", "#VALUE!", "#REF!", "#NUM!"),
    "thousands in quotes": lambda: log(quoted(rows(write=thousands(",", ".")))),
    "thousands by points": lambda: log(rows(RECORDS, GERMAN, write=thousands(".", ",")), ";"),
    "thousands by narrow spaces": lambda: log(rows(RECORDS, GERMAN, write=thousands("\u202f", ",")), ";"),
    "thousands by apostrophes": lambda: log(rows(RECORDS, GERMAN, write=thousands("'", ".")), ";"),
    "a minus of typesetters": lambda: log(rows(write=lambda value: repr(value).replace("-", "\u2212"))),
    "a dash for a minus": lambda: log(rows(write=lambda value: repr(value).replace("-", "\u2013")), encoding="cp1252"),
    "twelve hours, the year first": lambda: log(rows(RECORDS, "%Y-%m-%d %I:%M %p")),
    "twelve hours in a column": lambda: log(rows(RECORDS, "%m/%d/%Y", "%I:%M:%S %p")),
    "twelve hours, small letters": lambda: log(rows(RECORDS, lambda one: one.strftime("%d/%m/%Y %I:%M %p").lower())),
    "the day first": lambda: log(rows(RECORDS, "%d/%m/%Y %H:%M")),
    "the month first": lambda: log(rows(RECORDS, US)),
    "the day first, none after the twelfth": lambda: log(rows(EARLY, "%d/%m/%Y %H:%M"), truth=EARLY),
    "the month first, none after the twelfth": lambda: log(rows(EARLY, US), truth=EARLY),
    "the month first, as later days show": late_evidence,
    "one day, its format given": lambda: log(rows(LONE, US), truth=LONE, options=("--stamps", US)),
    "years of two digits": lambda: log(rows(RECORDS, "%m/%d/%y %H:%M")),
    "no zeros before": lambda: log(rows(RECORDS, lambda one: f"{one.year}-{one.month}-{one.day} {one.hour}:{one:%M}")),
    "serial dates, decimal commas": lambda: log(rows(RECORDS, lambda one: comma(float(serial(one))), write=comma), ";"),
    "serial dates after counts like them": lambda: log(with_column(rows(RECORDS, serial), "RECORD", COUNTS, 0)),
    "seconds since 1970 after counts": lambda: log(
        with_column(rows(UTC, lambda one: f"{one.timestamp():.0f}"), "RECORD", COUNTS, 0), truth=UTC),
    "written dates after numbers like serial dates": lambda: log(with_column(rows(), "RECORD", COUNTS, 0)),
    "a workbook with titles and units": lambda: workbook(
        [["Bridge"], ["Logger", 12], [], in_cells()[0], [None, "degC", "Hz", "um/m"], *in_cells()[1:]], more=["Notes"]),
    "a workbook with dates and times": lambda: workbook(in_cells(RECORDS, pd.Timestamp.date, pd.Timestamp.time)),
    "a workbook with texts of two lines": lambda: workbook(with_column(in_cells(), "note", ["a\nb"] * N)),
    "a workbook with decimal commas as texts": lambda: workbook(with_commas(in_cells(), *range(9))),
    "a workbook with decimal commas in a column": lambda: workbook(with_commas(in_cells(), 2)),
    "a workbook in which some times are texts": lambda: workbook(with_texts_for_times(in_cells())),
    "names and units again": lambda: log([*rows()[:1], ["", "degC", "Hz", ""], *rows()[1:9], rows()[0],
                                          ["", "degC", "Hz", ""], *rows()[9:]]),
    "names again as the last line": lambda: log([*rows(), rows()[0]]),
    "a last line that is cut off": lambda: Log({"log.csv": log(rows()).files["log.csv"] + b"2026-02-04 0"}, RECORDS),
    "the time before the date": lambda: log(rows(RECORDS, "%H:%M", "%d.%m.%Y"), "\t"),
    "date and time apart": lambda: log([[a, c, b, *row] for a, b, c, *row in rows(RECORDS, "%Y-%m-%d", "%H:%M")]),
    "texts": lambda: log(with_column(STATE, "logger", ["CR1000"] * N, 0)),
    "quotes around all": lambda: log(quoted(rows(DEGREES)), truth=DEGREES),
    "names of two lines": lambda: log(
        ['"time","T1\n[°C]","f1"', *rows(RECORDS[["T1", "f1"]])[1:]],
        truth=RECORDS[["T1", "f1"]].set_axis(["T1[°C]", "f1"], axis=1)),
    "quotes with spaces around": lambda: log(quoted(rows()), " , "),
    "comments within": lambda: log([*COMMENTS, *rows()[:30], "# battery changed", *rows()[30:]]),
    "names in a comment": lambda: log(["# Logger 12", "# " + ",".join(rows()[0]), *rows()[1:]]),
    "bars, texts and thousands": lambda: log(with_column(STATE, "logger", ["A;1"] * N, 0), "|"),
    "T and Z": lambda: log(rows(UTC, "%Y-%m-%dT%H:%M:%SZ"), truth=UTC),
    "offsets of hours": lambda: log(rows(AUTUMN, lambda one: one.isoformat()[:-3]), truth=AUTUMN.tz_convert("UTC")),
    "blank lines": lambda: log(["", *rows()[:3], "", "  ", *rows()[3:], "", ""]),
    "CR": lambda: log(rows(), end="\r"),
    "CR LF": lambda: log(rows(), end="\r\n"),
    "NUL bytes after the end": lambda: Log({"log.csv": log(rows()).files["log.csv"] + bytes(512)}, RECORDS),
    "stamps in no order": lambda: log([rows()[0], *(rows()[1 + n] for n in RANDOM.permutation(N))]),
    "records twice": lambda: log([*rows(), *rows()[5:9]]),
    "a last column without a name": lambda: log(with_column(rows(), "", ["ok"] * N)),
    "separators after the names": lambda: log([[*rows()[0], ""], *rows()[1:]]),
    "a last column without values": lambda: log(with_column(rows(), "spare", [""] * N)),
    "a number as a name": lambda: log([["Bridge", "12", "", "", ""], *with_column(rows(), "7", ["ok"] * N)]),
    "a column without a name": lambda: log([["", *rows()[0][1:]], *rows()[1:]]),
    "clocks that change": lambda: log(rows(AUTUMN), truth=AUTUMN, options=("--zone", "Europe/Brussels")),
    "values that are missing at first": lambda: log(rows(BEGUN), truth=BEGUN),
}  # fmt: skip
"""Logs of one kind each, and all of their records."""

HIDDEN = [[row[0][:10], row[0][11:].replace(":", "h"), *row[1:]] for row in rows(HOURS)]
TWICE = pd.concat([RECORDS, changed(30, 55.5)[30:31]])

REFUSED = {
    "an empty file": (lambda: log([]), ""),
    "names alone": (lambda: log(rows()[:1]), ""),
    "names twice": (lambda: log([["time", "T1", "T1", "f1"], *rows()[1:]]), "line 1"),
    "the name of the stamps twice": (lambda: log([[*row[:3], row[0]] for row in rows()]), "line 1"),
    "NUL bytes within": (lambda: log([*rows()[:30], "\0" * 20 + ",".join(rows()[30]), *rows()[31:]]), "line 31"),
    "one day, the day or the month first": (lambda: log(rows(LONE, US)), ""),
    "long gaps, none after the twelfth": (lambda: log(rows(EARLY[::13], US), truth=EARLY[::13]), ""),
    "some with offsets": (lambda: log([*rows()[:30], *([row[0] + "Z", *row[1:]] for row in rows()[30:])]), "line 31"),
    "a clock that is not understood": (lambda: log([["date", "clock", *rows()[0][1:]], *HIDDEN[1:]]), ""),
    "a stamp with two records": (lambda: log(rows(TWICE)), ""),
    "clocks that change, and no zone": (lambda: log(rows(AUTUMN)), ""),
    "a skipped hour": (lambda: log(rows(HOURS.set_axis(pd.date_range("2026-03-28", periods=N, freq="h"))),
                                   options=("--zone", "Europe/Brussels")), "line 28"),
    "a line that is cut off within": (lambda: log([*rows()[:30], rows()[30][:2], *rows()[31:]]), "line 31"),
    "a text among numbers": (lambda: log([*rows()[:30], [*rows()[30][:2], "error", "1.0"], *rows()[31:]]),
                             "line 31, column 'f1'"),
    "a stamp that is none": (
        lambda: log([*rows()[:30], ["2026-01-32 00:00", *rows()[30][1:]], *rows()[31:]]), "line 31"),
    "thousands without quotes": (lambda: log(rows(write=thousands(",", "."))), ""),
    "a quote that does not close, among texts": (
        lambda: log([*STATE[:30], [*STATE[30][:-1], '"OK'], *STATE[31:]]), "line 81"),
    "a quote that does not close, among quotes": (
        lambda: log([*quoted(STATE[:30]), [*STATE[30][:-1], '"OK'], *quoted(STATE[31:])]), "line 32"),
    "two columns like serial dates": (
        lambda: log(with_column(rows(DAILY, serial), "n", COUNTS, 0)), ""),
    "an empty workbook": (lambda: workbook([]), ""),
    "a workbook of names": (lambda: workbook(in_cells()[:1]), ""),
    "no workbook": (lambda: Log({"log.xlsx": b"PK no workbook"}, RECORDS), ""),
}  # fmt: skip
"""Logs that are refused, and the place that is named."""

LATER = {
    "a new column": (lambda: log(with_column(rows(), "T9", ["1.5"] * N)), "T9"),
    "a column less": (lambda: log(rows(RECORDS[["T1", "f1"]])), "s1"),
    "another decimal sign": (lambda: log(rows(write=comma), ";"), "line 1"),
    "a single group of thousands": (lambda: log(quoted(rows(changed(9, 1234.0, "s1"), write=lambda one: f"{one:,g}"))),
                                    "column 's1'"),
    "a text": (lambda: log([*rows()[:3], [*rows()[3][:3], "warm"], *rows()[4:]]), "line 4, column 's1'"),
    "an empty file": (lambda: log([]), ""),
    "a text in UTF-32": (lambda: log(rows(), encoding="utf-32"), ""),
    "columns in another order": (lambda: log(rows(RECORDS[["s1", "T1", "f1"]])), None),
    "another encoding": (lambda: log(rows(), encoding="utf-16"), None),
    "a separator after each record": (lambda: log([rows()[0], *([*row, ""] for row in rows()[1:])]), None),
    "names again": (lambda: log(repeated(rows(), 7)), None),
    "a status": (lambda: log(STATE), "status"),
}  # fmt: skip
"""Logs that come after a plain one: the place that is named, or None for those that are read."""


pytestmark = [pytest.mark.usefixtures("one_detector"), pytest.mark.filterwarnings("ignore:.*read-as")]


def write(one, folder):
    """Write the files of a log; its paths."""
    for name, content in one.files.items():
        (folder / name).write_bytes(content)
    return [folder / name for name in one.files]


def begin(one, folder):
    """The command ``init``, and the settings that it writes."""
    files, roles = write(one, folder), ()
    if "--temperatures" not in one.options and len(files) == 1:
        names = list(one.truth)
        roles = ("--temperatures", names[0], "--responses", *names[1:])
    done = run("init", *files, "--into", folder / "bridge", *roles, *one.options)
    return done, folder / "bridge" / "monitor.toml"


def assert_read(found, truth):
    """All records are there, each once, to the last bit."""
    pd.testing.assert_frame_equal(
        found[list(truth)].sort_index(), truth.sort_index(), check_exact=True, check_freq=False, check_names=False,
        check_index_type=False,
    )  # fmt: skip


def assert_settings_read(file, truth):
    """The baseline of the settings has all records."""
    made = read_settings(file)
    baseline, _ = read_baseline(list(map(made.path, made.records.baseline)), made.csv, made.records)
    assert_read(baseline, truth)
    assert list(baseline) == [*made.records.temperatures, *made.records.responses] == list(truth)


@pytest.mark.parametrize("kind", UNDERSTOOD)
def test_what_loggers_write_is_read_as_it_was_meant(kind, tmp_path):
    one = UNDERSTOOD[kind]()
    names = list(one.truth)
    chosen = {name[2:]: value for name, value in pairwise(one.options) if name in ("--zone", "--stamps")}
    T, F = read_records(*write(one, tmp_path), temperatures=names[:1], responses=names[1:], **chosen)
    assert_read(T.join(F), one.truth)
    assert [list(T), list(F)] == [names[:1], names[1:]]


@pytest.mark.parametrize("kind", by_day([*UNDERSTOOD][::4], at_night=UNDERSTOOD))
def test_the_settings_of_what_loggers_write_read_it_again(kind, tmp_path):
    one = UNDERSTOOD[kind]()
    done, file = begin(one, tmp_path)
    assert done.code == 0, done.err
    assert_settings_read(file, one.truth)


@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_read_with_certainty_is_refused_in_one_sentence(kind, tmp_path):
    one, place = REFUSED[kind]
    done, file = begin(one(), tmp_path)
    if done.code == 0:  # the files have a form, in which their records are wrong
        done = run("fit", file)
    assert done.code == FAILED
    assert_one_error(done.err, tmp_path, place)


def assert_one_error(text, folder, *parts):
    """A single line that names a file and all parts, and no traceback."""
    lines = [line for line in text.splitlines() if not line.startswith("warning:")]
    assert len(lines) == 1, text
    assert lines[0].startswith("error: ")
    assert re.search(r"log\.\w+", lines[0].replace(str(folder), "")), lines[0]
    for part in parts:
        assert part in lines[0]


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Settings that were made of a plain log."""
    return read_settings(begin(log(rows()), tmp_path_factory.mktemp("plain"))[1])


@pytest.mark.parametrize("kind", LATER)
def test_later_files_of_another_form_are_read_or_refused(kind, plain, tmp_path):
    make, place = LATER[kind]
    (later,) = write(make(), tmp_path)
    if place is None:
        table = read_columns(later, plain.csv, plain.records)
        check_layout(table, later, plain.records, [])
        assert_read(table, RECORDS)
        return
    with pytest.raises(ValueError, match=re.escape(str(later))) as refused:
        check_layout(read_columns(later, plain.csv, plain.records), later, plain.records, [])
    assert place in str(refused.value)
    assert "\n" not in str(refused.value)


IN_CELLS = {
    "dates": lambda stamp: stamp.to_pydatetime(),
    "texts": lambda stamp: stamp.strftime(GERMAN),
    "serial dates": lambda stamp: (stamp - pd.Timestamp("1899-12-30")) / pd.Timedelta("1D"),
}


@pytest.mark.parametrize("first", IN_CELLS)
def test_dates_serial_dates_and_texts_of_a_workbook_mean_the_same(first, tmp_path):
    done, file = begin(workbook(in_cells(RECORDS, IN_CELLS[first])), tmp_path)
    assert done.code == 0, done.err
    settings = read_settings(file)
    for then in IN_CELLS.values():
        cells = in_cells(RECORDS, then)
        cells[5:20] = in_cells(RECORDS, IN_CELLS["dates"])[5:20]
        (later,) = write(workbook(cells), tmp_path)
        assert_read(read_columns(later, settings.csv, settings.records), RECORDS)


@pytest.mark.one_case
@pytest.mark.parametrize("kind", IN_CELLS)
def test_a_workbook_beside_a_text_of_another_form_is_read(kind, tmp_path):
    text = log(rows(RECORDS[["T1"]], GERMAN, write=comma), ";", name="T.csv")
    book = workbook(in_cells(RECORDS[["f1", "s1"]], IN_CELLS[kind]))
    files = text.files | {"F.xlsx": book.files["log.xlsx"]}
    for order in (files, dict(reversed(files.items()))):
        place = tmp_path / next(iter(order))[0]
        place.mkdir()
        done, file = begin(Log(order, RECORDS, ("--temperatures", "T1", "--responses", "f1", "s1")), place)
        assert done.code == 0, done.err
        assert_settings_read(file, RECORDS)


@pytest.mark.parametrize("first", ["dates", "serial dates"])
def test_days_and_months_of_later_texts_that_may_be_exchanged_are_refused(first, tmp_path):
    _, file = begin(workbook(in_cells(LONE, IN_CELLS[first])), tmp_path)
    settings = read_settings(file)
    (later,) = write(workbook(in_cells(LONE, lambda stamp: stamp.strftime(US))), tmp_path)
    with pytest.raises(ValueError, match=re.escape(str(later))):
        read_columns(later, settings.csv, settings.records)


def test_a_record_is_not_lost_where_a_later_file_has_no_units(tmp_path):
    _, file = begin(UNDERSTOOD["units in the second line"](), tmp_path)
    settings = read_settings(file)
    assert settings.csv.values_line == 3
    (later,) = write(log(rows()), tmp_path)
    assert_read(read_columns(later, settings.csv, settings.records), RECORDS)


def test_without_openpyxl_a_workbook_is_named_with_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    done, _ = begin(Log({"log.xlsx": b""}, RECORDS), tmp_path)
    assert done.code == FAILED
    assert_one_error(done.err, tmp_path, "openpyxl", "[excel]")
