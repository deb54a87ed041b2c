"""Files of records in any common form are read as they were meant, to the last bit."""

import tomllib
from datetime import datetime

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from skthermo.preprocessing import read_records
from skthermo.preprocessing.loggers.logger_files import CsvFormat, look_at, read_file
from skthermo.preprocessing.loggers.stamps import DAYS
from tests.commands.folders import run
from tests.nights import by_day

RANDOM = np.random.default_rng(0)
RECORDS = pd.DataFrame(
    {"T air [°C]": RANDOM.normal(10, 8, 80).round(3), "f1 (Hz)": RANDOM.normal(4, 0.1, 80)},
    pd.date_range("2026-01-05 12:30", periods=80, freq="6h"),
)
RECORDS.iloc[5, 0] = np.nan


@pytest.mark.nightly
@given(
    separator=st.sampled_from([",", ";", "\t", "|"]),
    decimal=st.sampled_from([".", ","]),
    days=st.sampled_from(["%Y-%m-%d", *DAYS]),
    clock=st.sampled_from([" %H:%M", " %H:%M:%S"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    missing=st.sampled_from(["", "NaN", "-999", "n/a"]),
    head=st.sampled_from(["", "Logger 12\n", "station: bridge; serial 4, 7\nfirmware 3\n"]),
    units=st.booleans(),
    is_split=st.booleans(),
)
@settings(max_examples=by_day(15, at_night=40), deadline=None)
def test_every_form_is_found(
    tmp_path_factory, separator, decimal, days, clock, encoding, missing, head, units, is_split
):
    if separator == decimal:
        separator = ";"
    file = tmp_path_factory.mktemp("form") / "records.csv"
    texts = [[_text(value, decimal, missing) for value in row] for row in RECORDS.to_numpy()]
    stamps = [RECORDS.index.strftime(days), RECORDS.index.strftime(clock[1:])]
    stamps = (
        [*zip(*stamps, strict=True)] if is_split else [(f"{day} {time}",) for day, time in zip(*stamps, strict=True)]
    )
    names = [*(["Date", "Time"] if is_split else ["TIMESTAMP"]), *RECORDS, "state"]
    below = [["", *[""] * is_split, "degC", "Hz", ""]] if units else []
    rows = [names, *below, *([*stamp, *row, "ok"] for stamp, row in zip(stamps, texts, strict=True))]
    file.write_text(head + "\n".join(separator.join(row) for row in rows) + "\n", encoding=encoding)
    found = look_at(file)
    pd.testing.assert_frame_equal(found.records, RECORDS, check_exact=True, check_freq=False, check_index_type=False)
    assert found.ignored == {"state": "it holds text"}
    assert {name: unit.name for name, unit in found.units.items()} == {"T air [°C]": "°C", "f1 (Hz)": "Hz"}
    again = read_file(file, found.form, ignore=found.ignored)
    pd.testing.assert_frame_equal(again, found.records, check_exact=True)


def _text(value, decimal, missing):
    return missing if np.isnan(value) else repr(float(value)).replace(".", decimal)


def test_columns_that_are_named_are_used_whatever_they_hold(tmp_path):
    stuck, file, settings = RECORDS.assign(f2=5.0), tmp_path / "records.csv", tmp_path / "bridge"
    stuck.to_csv(file, index_label="time")
    done = run("init", file, "--into", settings, "--temperatures", "T air [°C]", "--responses", "f1 (Hz)", "f2")
    assert done.code == 0, done.err
    assert run("fit", settings).code == 0
    said = run("status", settings, "--json").json["bridges"][0]["status"]["faults"]
    assert [(fault["column"], fault["kind"]) for fault in said] == [("f2", "left out")]


@pytest.mark.parametrize("command", ["fit", "update", "status"])
@pytest.mark.parametrize("place", ["", "nowhere", "nowhere/monitor.toml"])
def test_without_settings_the_command_that_makes_them_is_named(command, place, tmp_path):
    done = run(command, tmp_path / place)
    assert done.code == 3
    folder = (tmp_path / place).parent if place.endswith(".toml") else tmp_path / place
    assert f"skthermo init T.csv F.csv --into {folder}" in done.err
    assert run("init", tmp_path / "T.csv", "--into", folder).code == 3


def test_python_reads_what_init_reads_and_says_what_it_leaves_out(tmp_path):
    file, table = tmp_path / "records.csv", RECORDS.assign(RECORD=range(100, 180), empty=np.nan)
    table.to_csv(file, index_label="time")
    with pytest.warns(UserWarning, match="'RECORD'.*'empty'") as given:
        T, F = read_records(str(file))
    assert [one.message.kind for one in given] == ["read-as"]
    expected = RECORDS.columns.tolist()
    assert [list(T), list(F)] == [expected[:1], expected[1:]]
    pd.testing.assert_frame_equal(T.join(F), RECORDS, check_freq=False, check_names=False, check_index_type=False)
    other = tmp_path / "other.csv"
    RECORDS[expected[1:]][10:].to_csv(other, index_label="time")
    RECORDS[expected[:1]].to_csv(file, index_label="time")
    with pytest.warns(UserWarning, match="different-rows"):
        T, F = read_records(file, other)
    assert T.index.equals(F.index)
    assert len(T) == len(RECORDS) - 10


@pytest.mark.parametrize("zone", ["Mars", "../UTC", "Europe"])
def test_a_time_zone_that_does_not_exist_is_refused_without_a_traceback(zone, tmp_path):
    RECORDS.to_csv(tmp_path / "a.csv", index_label="time")
    done = run("init", tmp_path / "a.csv", "--into", tmp_path / "b", "--zone", zone)
    assert done.code == 3
    assert len(done.err.splitlines()) == 1
    assert zone in done.err


def test_columns_that_cannot_be_used_are_named_where_others_are_lacking(tmp_path):
    table = RECORDS.set_axis(["Luft", "f1"], axis=1)
    table.assign(f1=table["f1"].map("{:.3f} Hz".format)).to_csv(tmp_path / "a.csv", index_label="time")
    with pytest.raises(ValueError, match="'f1'"):
        read_records(tmp_path / "a.csv")


ZONES = ["Europe/Brussels", "America/New_York", "Australia/Lord_Howe", "UTC", "Asia/Kolkata", "America/St_Johns"]


@pytest.mark.nightly
@given(
    zone=st.sampled_from(ZONES),
    start=st.datetimes(pd.Timestamp("2015-01-01"), pd.Timestamp("2026-12-01")),
    minutes=st.sampled_from([10, 20, 30, 60]),
)
@example(zone="Australia/Lord_Howe", start=datetime(2015, 3, 1), minutes=60)  # the clock goes back by half an hour
@example(zone="Australia/Lord_Howe", start=datetime(2015, 3, 1), minutes=20)
@settings(max_examples=by_day(5, at_night=15), deadline=None)
def test_local_clocks_are_followed_over_their_changes(tmp_path_factory, zone, start, minutes):
    year = pd.date_range(
        pd.Timestamp(start).floor("h"), periods=370 * 24 * 60 // minutes // 8, freq=f"{minutes}min", tz="UTC"
    )
    local = year.tz_convert(zone)
    file = tmp_path_factory.mktemp("zone") / "a.csv"
    pd.DataFrame({"T": range(len(local))}, local.tz_localize(None)).to_csv(file)
    assert (read_file(file, CsvFormat(time_zone=zone)).index == local).all()
    pd.DataFrame({"T": range(len(local))}, local).to_csv(file)
    assert (read_file(file, CsvFormat(time_zone=zone)).index == local).all()


@pytest.mark.usefixtures("one_detector")
def test_columns_find_their_roles_and_units(tmp_path):
    random = np.random.default_rng(0)
    days = pd.date_range("2025-01-01", periods=400)
    air = 10 - 10 * np.cos(2 * np.pi * np.arange(400) / 365) + random.normal(0, 3, 400)
    table = pd.DataFrame({"steel [K]": air + 273.15, "T_soil [degF]": air * 1.8 + 32, "f1": 4 - 0.01 * air}, days)
    table["f1"] += random.normal(0, 0.01, 400)
    table["station"] = air + random.normal(0, 1, 400)
    table.to_csv(tmp_path / "all.csv")
    done = run("init", tmp_path / "all.csv", "--into", tmp_path / "b", "--reference", "station")
    assert done.code == 0, done.err
    records = tomllib.loads((tmp_path / "b" / "monitor.toml").read_text(encoding="utf-8"))["records"]
    assert (records["temperatures"], records["responses"]) == (["steel [K]", "T_soil [degF]"], ["f1"])
    assert (records["reference"], records["convert"]) == (["station"], {"steel [K]": "K", "T_soil [degF]": "°F"})
    assert run("fit", tmp_path / "b" / "monitor.toml").code == 0
    from skthermo.monitoring import load_monitor

    baseline = load_monitor(tmp_path / "b" / "monitor.joblib").baseline_
    np.testing.assert_allclose(baseline[["steel [K]", "T_soil [degF]"]], np.column_stack([air, air]), atol=1e-9)
    assert run("init", tmp_path / "all.csv", "--into", tmp_path / "c", "--responses", "f9").code == 3


def test_outages_of_days_are_named(tmp_path):
    hours = pd.date_range("2025-03-01", periods=60 * 24, freq="h")
    air = 10 + np.random.default_rng(0).normal(0, 3, len(hours))
    table = pd.DataFrame({"T1": air, "f1": 4 - 0.01 * air}, hours).drop(hours[400:496])
    table.to_csv(tmp_path / "log.csv", index_label="time")
    lines = [line for line in run("check", tmp_path / "log.csv").out.splitlines() if line.startswith("outages")]
    assert len(lines) == 1
    assert f"{hours[399]} to {hours[496]}" in lines[0]


def test_two_forms_in_one_folder_are_an_error_in_words(one_detector, tmp_path):
    stamps = pd.date_range("2026-01-01", periods=50, freq="1h")
    T = pd.DataFrame({"Date": stamps.strftime("%Y-%m-%d"), "Time": stamps.strftime("%H:%M"), "air [°C]": 5.0})
    F = pd.DataFrame({"time": stamps, "f1 [Hz]": 4.0})
    T["air [°C]"] += np.arange(50) % 7 / 10
    F["f1 [Hz]"] += np.arange(50) % 5 / 100
    files = tmp_path / "T.csv", tmp_path / "F.csv"
    T.to_csv(files[0], index=False)
    F.to_csv(files[1], index=False)
    done = run("init", *files, "--into", tmp_path / "b")
    assert done.code == 3
    assert all(text in done.err for text in (*map(str, files), "the stamp: Date and Time in T.csv, the first in F.csv"))
    assert "sign between values" not in done.err  # which is the same in both
    assert not set("(){}[]='").intersection(done.err.split("differently (")[1].split("), and")[0])
