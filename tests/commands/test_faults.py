"""Whatever goes wrong in a night, the state is that before or after it, and nothing is claimed that was not saved."""

import contextlib
import errno
import io
import json
import multiprocessing
import os
import shutil
import signal

import pandas as pd
import pytest

import skthermo.reporting
from skthermo.commands.main import main
from skthermo.monitoring import load_monitor
from tests.commands.folders import edit, run, write_day
from tests.monitoring.nightly import DAMAGED, FIRST, assert_same_history

HEALTHY, ALARM, NOT_EVALUATED, FAILED = range(4)
LAST = DAMAGED + 4  # the night in which an event opens


@pytest.fixture(scope="module")
def before(fitted, records, tmp_path_factory):
    """A bridge on the eve of an alarm, with the records of the next night in its folder."""
    folder = shutil.copytree(fitted, tmp_path_factory.mktemp("before") / "bridge")
    edit(folder / "monitor.toml", '# page = "status.html"', 'page = ""')
    edit(folder / "monitor.toml", "# metrics = ...", 'metrics = "metrics.prom"')
    assert run("update", folder / "monitor.toml", "--now", write_day(records, folder, FIRST, DAMAGED)).code == HEALTHY
    write_day(records, folder, DAMAGED, LAST)
    return folder


@pytest.fixture
def bridge(before, tmp_path):
    return shutil.copytree(before, tmp_path / "bridge")


def night(bridge, records, *options):
    return run("update", bridge / "monitor.toml", "--now", str(records.index[LAST - 1]), *options)


def transitions(bridge):
    file = bridge / "transitions.jsonl"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


@pytest.fixture(scope="module")
def after(before, records, tmp_path_factory):
    """The same bridge after an undisturbed night."""
    folder = shutil.copytree(before, tmp_path_factory.mktemp("after") / "bridge")
    assert night(folder, records).code == ALARM
    return folder


def assert_is_before_or_after(bridge, before, after):
    """The monitor is one of the two, and the transitions are no more than what it has saved."""
    monitor = load_monitor(bridge / "monitor.joblib")
    states = {load_monitor(one / "monitor.joblib").last_: one for one in (before, after)}
    assert_same_history(monitor, load_monitor(states[monitor.last_] / "monitor.joblib"))
    saved = [one["id"] for one in monitor.transitions()]
    log = (bridge / "transitions.jsonl").read_bytes() if (bridge / "transitions.jsonl").exists() else b""
    whole = [json.loads(line)["id"] for line in log[: log.rfind(b"\n") + 1].splitlines()]
    assert whole == saved[: len(whole)]
    return states[monitor.last_] == after


def assert_goes_on(bridge, records, after):
    """The next call ends as if nothing had happened, and leaves nothing behind."""
    assert night(bridge, records).code == ALARM
    left, expected = (load_monitor(one / "monitor.joblib") for one in (bridge, after))
    for name in ("evaluations_", "events_", "days_", "records_"):
        pd.testing.assert_frame_equal(getattr(left, name), getattr(expected, name), check_exact=True)
    assert [one["id"] for one in transitions(bridge)] == [one["id"] for one in transitions(after)] != []
    assert not list(bridge.glob(".*.unfinished"))


@pytest.mark.one_case
@pytest.mark.parametrize("write", range(4))
def test_a_disk_that_is_full_at_any_write(bridge, before, after, records, monkeypatch, write):
    calls = []

    def full(file):
        calls.append(file)
        if len(calls) > write:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        done = night(bridge, records, "--json")
    is_saved = assert_is_before_or_after(bridge, before, after)
    (said,) = done.json["bridges"]
    assert (said["state"], done.code) == (("alarm", ALARM) if is_saved and said["state"] else (None, FAILED))
    assert said["errors"] or done.json["errors"]
    assert len(said["transitions"]) <= len(transitions(bridge))
    assert_goes_on(bridge, records, after)


@pytest.mark.nightly
@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="needs processes that fork")
@pytest.mark.parametrize("write", range(9))
def test_a_kill_at_any_write(bridge, before, after, records, write):
    """Before or after the content of a file is on the disk, or its new name is."""

    def killed():
        calls, fsync = [], os.fsync

        def kill(file):
            calls.append(file)
            if len(calls) > write // 2:
                if write % 2:
                    fsync(file)
                os.kill(os.getpid(), signal.SIGKILL)
            fsync(file)

        os.fsync = kill
        with contextlib.redirect_stdout(io.StringIO()):
            main(["update", str(bridge / "monitor.toml"), "--now", str(records.index[LAST - 1])])

    process = multiprocessing.get_context("fork").Process(target=killed)
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    assert_is_before_or_after(bridge, before, after)
    assert_goes_on(bridge, records, after)


def test_a_line_of_transitions_that_was_cut_off_is_written_again(bridge, after, records):
    night(bridge, records)
    file = bridge / "transitions.jsonl"
    file.write_bytes(file.read_bytes()[:-20])
    assert_goes_on(bridge, records, after)
    file.unlink()
    assert_goes_on(bridge, records, after)


def test_each_change_is_there_once_in_a_folder_that_is_renamed_or_has_lost_what_was_taken(after, records, tmp_path):
    renamed, now = shutil.copytree(after, tmp_path / "renamed"), str(records.index[LAST - 1])
    (event,) = [one for one in load_monitor(renamed / "monitor.joblib").status().events if one["kind"] == "damage"]
    for _ in range(2):
        n_before = len(transitions(renamed))
        assert run("acknowledge", renamed, event["event"], "--damage", "--now", now).code == 0
        assert [(one["bridge"], one["what"]) for one in transitions(renamed)[n_before:]] == [
            ("renamed", "acknowledged")
        ]
        (renamed / "monitor.joblib.taken.json").unlink()
        assert len({one["fitted"] for one in transitions(renamed)}) == 1


def test_a_damaged_line_of_transitions_is_named_and_what_a_killed_run_has_left_is_removed(bridge, records):
    (bridge / "transitions.jsonl").write_text('{"bridge": "another", "id": 1}\nnonsense\n', encoding="utf-8")
    left = [bridge / f".metrics.prom.{name}.unfinished" for name in ("old", "new")]
    for file in left:
        file.touch()
    os.utime(left[0], (0, 0))
    done = night(bridge, records)
    assert (done.code, "line 2 of" in done.err, "transitions.jsonl is damaged" in done.err) == (ALARM, True, True)
    assert [file.exists() for file in left] == [False, True]  # another process may be at work on a new one


def test_bridges_of_one_name_hide_no_alarm(after, records, tmp_path):
    copied, metrics = shutil.copytree(after, tmp_path / after.name), tmp_path / "fleet.prom"
    done = run("status", after, copied, "--now", str(records.index[LAST - 1]), "--metrics", metrics, "--json")
    assert (done.code, metrics.exists(), done.json["fleet"]) == (ALARM, False, None)
    assert [one["state"] for one in done.json["bridges"]] == ["alarm", "alarm"]
    texts = f"{after} and {copied}", str(copied / "monitor.toml")
    assert [all(text in error for text in texts) for error in done.json["errors"]] == [True, True]


@pytest.mark.nightly
def test_two_at_once(bridge, before, after, records):
    fcntl = pytest.importorskip("fcntl")
    with open(bridge / ".monitor.joblib.lock", "a+") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        lock.write("process 1")
        lock.flush()
        for command in ("update", "fit", "acknowledge"):
            more = {"acknowledge": ["1", "--damage"], "fit": ["--replace"]}.get(command, [])
            done = run(command, bridge / "monitor.toml", *more, "--wait", "0.1")
            assert (done.code, "is in use by process" in done.err) == (FAILED, True)
        assert run("status", bridge / "monitor.toml", "--now", str(records.index[DAMAGED - 1])).code == HEALTHY
    assert not assert_is_before_or_after(bridge, before, after)
    assert_goes_on(bridge, records, after)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written(bridge, before, after, records):
    bridge.chmod(0o555)
    try:
        done = night(bridge, records)
        assert (done.code, done.out) == (FAILED, "")
        assert run("status", bridge / "monitor.toml", "--now", str(records.index[DAMAGED - 1])).code == HEALTHY
    finally:
        bridge.chmod(0o755)
    assert not assert_is_before_or_after(bridge, before, after)
    assert_goes_on(bridge, records, after)


@pytest.mark.nightly
def test_a_page_that_cannot_be_written_hides_no_alarm(bridge, after, records, monkeypatch):
    def fails(*_, **options):
        raise OSError("no space left")

    edit(bridge / "monitor.toml", 'page = ""', 'page = "status.html"')
    with monkeypatch.context() as patched:
        patched.setattr(skthermo.reporting, "owner_report", fails)
        done = night(bridge, records)
        assert (done.code, "status.html was not written" in done.err) == (ALARM, True)
        report = run("report", bridge / "monitor.toml", "--now", "2026-01-01")
        assert (report.code, "state: alarm" in report.out) == (FAILED, True)
    monkeypatch.setattr(skthermo.reporting, "owner_report", lambda monitor, path, **options: path)
    assert_goes_on(bridge, records, after)


@pytest.mark.nightly
@pytest.mark.parametrize("clock", ["2020-01-01", "2050-01-01"])
def test_a_wrong_clock_of_the_computer_changes_no_evaluation(bridge, after, records, monkeypatch, clock):
    """The monitor itself asks the clock whether a jump in the stamps is plausible."""
    monkeypatch.setattr(pd.Timestamp, "now", classmethod(lambda cls, tz=None: pd.Timestamp(clock, tz=tz)))
    done = run("update", bridge / "monitor.toml")
    assert done.code == ALARM
    monkeypatch.undo()
    assert_goes_on(bridge, records, after)
