"""The command of nightly jobs: what it says, its exit codes, and what a crash leaves."""

import copy
import shutil
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import skthermo.reporting
from skthermo.commands.main import main
from skthermo.monitoring import load_monitor
from tests.commands.folders import run
from tests.monitoring.nightly import DAMAGED, FIRST, assert_same_history

HEALTHY, ALARM, NOT_EVALUATED, FAILED = range(4)


@pytest.fixture(scope="module")
def saved(truss_monitor, records, tmp_path_factory):
    """A file of a monitor that has seen ten healthy days, and one whose alarm is open."""
    folder = tmp_path_factory.mktemp("saved")
    monitor = copy.deepcopy(truss_monitor)
    monitor.update(records[FIRST : FIRST + 10])
    monitor.save(folder / "healthy.joblib")
    monitor.update(records[FIRST + 10 : DAMAGED + 10])
    monitor.save(folder / "alarm.joblib")
    return folder


@pytest.fixture
def bridge(saved, tmp_path):
    """Runs commands on copies of these files as of their newest record, and gives what they did and the monitor."""

    def command(name, *options, state="healthy", new=None, **csv):
        file = tmp_path / f"{state}.joblib"
        if not file.exists():
            shutil.copy(saved / file.name, file)
        newest = load_monitor(file).last_
        if isinstance(new, pd.DataFrame):
            newest = max([newest, *new.index[new.index < newest + pd.Timedelta("100D")]])
            new = new.to_csv(**{"index_label": "time"} | csv)
        if new is not None:
            (tmp_path / "new.csv").write_text(new)
            options = (tmp_path / "new.csv", *options)
        now = () if "--now" in options else ("--now", newest)
        done = run(name, file, *options, *now)
        return SimpleNamespace(code=done.code, out=done.out, err=done.err, file=file, monitor=load_monitor(file))

    return command


@pytest.mark.nightly
def test_an_alarm_that_has_ended_within_the_new_records_is_one(bridge, records):
    loud, quiet = records[DAMAGED + 10 : DAMAGED + 20], records[FIRST + 10 : FIRST + 30].copy()
    quiet.index = pd.date_range(loud.index[-1] + pd.Timedelta("1D"), periods=20, freq="D")
    done = bridge("update", new=pd.concat([loud, quiet]))
    assert (done.monitor.status(done.monitor.last_).state, done.code) == ("healthy", ALARM)
    event = done.monitor.events_.loc[1]
    assert f"event 1: damage from {event['start']} to {event['end']}" in done.out
    assert event["modes"] in done.out
    assert bridge("status").code == HEALTHY


@pytest.mark.parametrize("new", ["known", "none", "too late"])
def test_without_a_new_evaluation_nothing_is_healthy(bridge, records, new):
    old = records[FIRST + 8 : FIRST + 10]
    rows = {
        "known": old,
        "none": old[:0],
        "too late": old.set_axis(pd.to_datetime(["2026-12-30", "2026-12-31"]) + pd.Timedelta("1h")),
    }[new]
    done = bridge("update", new=rows)
    assert done.code == NOT_EVALUATED
    assert "state: not evaluated" in done.out
    assert {"known": "2 repeated", "none": "new.csv: 0\n", "too late": "2 too late"}[new] in done.out


def test_status_and_acknowledge(bridge):
    assert bridge("status").code == HEALTHY
    status = bridge("status", state="alarm")
    assert status.code == ALARM
    assert "damage from" in status.out
    done = bridge("acknowledge", 1, "--harmless", "--note", "a heavy transport", state="alarm")
    assert (done.code, done.out.splitlines()[0]) == (0, "event 1 is acknowledged as harmless")
    event = done.monitor.events_.loc[1]
    assert (event["acknowledged"], event["harmless"], event["note"]) == (True, True, "a heavy transport")
    wrong = bridge("acknowledge", 7, "--damage", state="alarm")
    assert wrong.code == FAILED
    assert "event is 7; expected the number of one of the 1 events" in wrong.err


@pytest.mark.nightly
def test_known_damage_is_a_state_of_records_that_were_evaluated(bridge, records):
    bridge("acknowledge", 1, "--damage", state="alarm")
    new = records[DAMAGED + 10 : DAMAGED + 14].copy()
    new.iloc[-1] = np.nan
    done = bridge("update", state="alarm", new=new)
    assert (done.code, done.monitor.status(done.monitor.last_).state) == (HEALTHY, "known damage")
    assert f"state: known damage (newest record {done.monitor.last_})" in done.out


@pytest.mark.nightly
def test_other_forms_of_files(bridge, records):
    new = records[FIRST + 10 : FIRST + 12]
    form = {"sep": ";", "decimal": ",", "date_format": "%d.%m.%Y %H:%M"}
    options = ("--separator", ";", "--decimal", ",", "--stamps", "%d.%m.%Y %H:%M")
    done = bridge("update", *options, new=new, **form)
    assert done.code == HEALTHY
    np.testing.assert_array_equal(done.monitor.records_[-2:], new)
    assert (done.monitor.records_.index[-2:] == new.index).all()
    point = bridge("update", *options, new=records[FIRST + 12 : FIRST + 13], **form | {"decimal": "."})
    assert (point.code, "with the decimal sign ','" in point.err) == (FAILED, True)


def test_a_file_that_may_be_cut_off_is_reported(bridge, records):
    text = records[FIRST + 10 : FIRST + 12].to_csv(index_label="time").rstrip()
    done = bridge("update", "--now", records.index[FIRST + 11], new=text)
    assert done.code == HEALTHY
    assert done.err.startswith("warning: ")
    assert "read-as" in done.err


@pytest.mark.nightly
def test_records_that_are_set_aside_are_not_healthy(bridge, records):
    new = records[FIRST + 10 : FIRST + 12].assign(f2=lambda table: 2 * table["f2"])
    done = bridge("update", new=new)
    assert done.code == bridge("status").code == NOT_EVALUATED
    late = new[:1].set_axis(new.index[:1] + pd.Timedelta("800D"))
    ahead = bridge("update", new=pd.concat([records[FIRST + 12 : FIRST + 16], late]))  # which hides healthy ones
    assert (ahead.code, "set aside, stamped too far ahead: 1" in ahead.out) == (NOT_EVALUATED, True)
    confirmed = bridge("update", "--confirm", new=records[FIRST + 16 : FIRST + 17])
    assert confirmed.monitor.last_ == new.index[0] + pd.Timedelta("800D")


@pytest.mark.nightly
def test_the_report_shows_the_updated_monitor(bridge, records, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(skthermo.reporting, "owner_report", lambda *given, **named: shown.append((given, named)))
    done = bridge("update", "--report", tmp_path / "a.html", "--title", "Truss", new=records[FIRST + 10 : FIRST + 12])
    ((monitor, file), named), *others = shown
    assert (done.code, file, others) == (HEALTHY, tmp_path / "a.html", [])
    options = {"title": "Truss", "now": str(records.index[FIRST + 11]), "identified": None}
    assert named == options | {"settings": str(done.file)}
    assert_same_history(monitor, done.monitor)


def test_an_error_of_any_kind_has_its_own_exit_code(bridge, records, monkeypatch):
    def fails(*args, **named):
        raise KeyError("a mistake of ours")

    monkeypatch.setattr("skthermo.monitoring._monitor.Monitor.update", fails)
    done = bridge("update", new=records[FIRST + 10 : FIRST + 12])
    assert done.code == FAILED
    assert "Traceback" in done.err
    assert "a mistake of ours" in done.err


@pytest.mark.parametrize("arguments", [[], ["updates"], ["acknowledge", "b.skops", "1"]])
def test_wrong_arguments_are_not_taken_for_a_monitor_that_is_not_evaluated(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == FAILED
    assert capsys.readouterr().err.startswith("usage: skthermo")


@pytest.mark.parametrize("files", [["bridge.joblib"], ["new.csv"], ["a.toml", "b.toml", "new.csv"]])
def test_files_that_do_not_belong_together_are_an_error(files):
    done = run("update", *files)
    assert (done.code, "expected" in done.err) == (FAILED, True)
