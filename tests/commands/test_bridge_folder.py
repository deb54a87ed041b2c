"""A bridge by commands alone: from two CSV files to a page, night by night."""

import json
import os
import pickle
import shutil
import subprocess
import sys
from importlib.resources import files
from itertools import pairwise

import joblib
import pandas as pd
import pytest

import skthermo.reporting
from skthermo.monitoring import load_monitor
from tests.commands.folders import edit, run, write_day, write_pair
from tests.monitoring.nightly import DAMAGED, FIRST, assert_same_history

HEALTHY, ALARM, NOT_EVALUATED, FAILED = range(4)
SCHEMA = json.loads((files("skthermo.commands") / "output.schema.json").read_text(encoding="utf-8"))


@pytest.fixture
def bridge(fitted, tmp_path, monkeypatch):
    """A copy of the fitted bridge, whose page is a text; commands are started elsewhere."""
    folder = shutil.copytree(fitted, tmp_path / "bridge")
    monkeypatch.chdir(tmp_path)

    def page(monitor, path, **options):
        path.write_text(monitor.summary())
        return path

    monkeypatch.setattr(skthermo.reporting, "owner_report", page)
    return folder


def settings(bridge):
    return bridge / "monitor.toml"


def valid(said):
    """JSON of a command that its schema allows."""
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator(SCHEMA).validate(said)
    return said


@pytest.mark.nightly
def test_records_of_a_folder_are_taken_in_night_by_night_as_in_one_pass(bridge, records):
    whole = load_monitor(bridge / "monitor.joblib")
    whole.update(records[FIRST : DAMAGED + 10])
    transitions = []
    for start, stop in pairwise((FIRST, FIRST + 1, DAMAGED - 2, DAMAGED + 3, DAMAGED + 10)):
        now = write_day(records, bridge, start, stop)
        done = run("update", settings(bridge), "--now", now, "--json")
        (one,) = valid(done.json)["bridges"]
        assert one["records"]["new"] == stop - start
        assert done.code == one["exit_code"] == done.json["exit_code"]
        assert (bridge / "status.html").read_text() == load_monitor(bridge / "monitor.joblib").summary()
        transitions += one["transitions"]
    assert done.code == ALARM
    assert_same_history(load_monitor(bridge / "monitor.joblib"), whole)
    lines = [json.loads(line) for line in (bridge / "transitions.jsonl").read_text().splitlines()]
    assert lines == transitions
    assert [one["id"] for one in lines] == list(range(1, len(lines) + 1))
    assert lines[0]["what"] == "opened"
    again = run("update", bridge, "--now", now, "--json")  # the folder stands for its settings
    assert valid(again.json)["bridges"][0]["records"]["new"] == 0
    assert again.json["bridges"][0]["records"]["repeated"] == 0
    assert (again.code, again.json["bridges"][0]["transitions"]) == (ALARM, [])


@pytest.mark.nightly
def test_a_log_that_grows_is_read_where_it_grows(bridge, records):
    log = bridge / "new" / "log.csv"
    for stop in (3, 4, 9):
        text = records[FIRST : FIRST + stop].to_csv(index_label="time")
        log.write_text(text + "2027-02-01,1.")  # a line that the logger has not finished
        done = run("update", settings(bridge), "--now", str(records.index[FIRST + stop - 1]))
        assert done.code == HEALTHY
    monitor = load_monitor(bridge / "monitor.joblib")
    pd.testing.assert_frame_equal(monitor.records_, records[FIRST : FIRST + 9], check_freq=False)
    assert monitor.counts_["n_repeated"] == 0


def test_a_last_line_without_an_end_is_taken_when_it_stays_as_it_is(bridge, records):
    file = bridge / "new" / "a.csv"
    file.write_text(records[FIRST : FIRST + 3].to_csv(index_label="time").rstrip())
    numbers = []
    for _ in range(3):
        run("update", settings(bridge), "--now", str(records.index[FIRST + 2]))
        numbers.append(len(load_monitor(bridge / "monitor.joblib").records_))
    assert numbers == [2, 3, 3]


@pytest.mark.nightly
def test_temperatures_wait_for_frequencies_of_the_same_time(bridge, records):
    T, f = (records.filter(regex=f"^{letter}") for letter in "Tf")
    for (first, last), (begin, end) in (((0, 5), (0, 3)), ((5, 8), (3, 8))):
        T[FIRST + first : FIRST + last].to_csv(bridge / "new" / f"T{first}.csv", index_label="time")
        f[FIRST + begin : FIRST + end].to_csv(bridge / "new" / f"f{begin}.csv", index_label="time")
        done = run("update", settings(bridge), "--now", str(records.index[FIRST + end - 1]))
        assert done.code == HEALTHY
        assert len(load_monitor(bridge / "monitor.joblib").records_) == end
    assert "they wait" not in done.out
    pd.testing.assert_frame_equal(
        load_monitor(bridge / "monitor.joblib").records_, records[FIRST : FIRST + 8], check_freq=False
    )


def test_a_file_without_one_of_its_columns_lacks_that_one_alone(bridge, records):
    night = records[FIRST : FIRST + 3]
    night.filter(regex="^T").to_csv(bridge / "new" / "T.csv", index_label="time")
    night[["f1", "f2", "f4", "f5", "f6"]].to_csv(bridge / "new" / "f.csv", index_label="time")
    done = run("update", bridge, "--now", str(night.index[-1]), "--json")
    (error,) = done.json["bridges"][0]["errors"]
    assert (done.code, "lacks the columns ['f3'];" in error) == (FAILED, True)


@pytest.mark.nightly
def test_a_wrong_file_keeps_no_other_out_and_is_named_until_it_is_mended(bridge, records):
    now = write_day(records, bridge, FIRST, FIRST + 3)
    broken = records[FIRST + 3 : FIRST + 5].rename(columns={"T1": "T9"})
    broken.to_csv(bridge / "new" / "wrong.csv", index_label="time")
    for _ in range(2):
        done = run("update", settings(bridge), "--now", now, "--json")
        assert done.code == FAILED
        (error,) = valid(done.json)["bridges"][0]["errors"]
        assert "wrong.csv" in error
        assert "T9" in error
        assert len(load_monitor(bridge / "monitor.joblib").records_) == 3
    write_day(records, bridge, FIRST + 3, FIRST + 5, "wrong.csv")
    assert run("update", settings(bridge), "--now", str(records.index[FIRST + 4])).code == HEALTHY
    assert len(load_monitor(bridge / "monitor.joblib").records_) == 5


@pytest.mark.nightly
@pytest.mark.usefixtures("one_detector")
def test_a_quiet_night_is_one_line(bridge, records):
    for row in (FIRST, FIRST + 1):
        now = write_day(records, bridge, row)
        done = run("update", bridge, "--now", now)
    assert done.out == f"state: healthy (newest record {now}); 1 new record, nothing has changed\n"
    now = write_day(records, bridge, FIRST + 2)
    assert "expected: " in run("update", bridge, "--now", now, "--verbose").out


def test_an_empty_file_and_a_text_without_records_are_named_once(bridge, records):
    (bridge / "new" / "empty.csv").touch()
    (bridge / "new" / "readme.txt").write_text("Files of the logger.\n", encoding="utf-8")
    done = run("update", bridge, "--now", write_day(records, bridge, FIRST))
    assert done.code == 0
    assert "empty.csv: the file is empty" in done.out
    assert "readme.txt: it names no column of the records" in done.out
    assert "no records in" not in run("update", bridge, "--now", write_day(records, bridge, FIRST + 1)).out


@pytest.mark.nightly
def test_a_file_whose_last_bits_have_changed_is_the_same(bridge, records):
    now = write_day(records, bridge, FIRST, FIRST + 3, name="log.csv")
    run("update", bridge, "--now", now)
    write_day(records * (1 + 2e-15), bridge, FIRST, FIRST + 3, name="log.csv")
    write_day(records * (1 - 1e-14), bridge, FIRST + 1, FIRST + 4)
    done = run("update", bridge, "--now", str(records.index[FIRST + 3]), "--json")
    assert (done.code, done.json["bridges"][0]["records"]["new"]) == (0, 1)
    write_day(records * 1.0001, bridge, FIRST + 1, name="wrong.csv")
    assert run("update", bridge).code == FAILED


@pytest.mark.one_case
@pytest.mark.parametrize("year", ["0001", "1970", "2062", "2300", "9999"])
def test_a_record_that_is_out_by_years_stops_no_night_after_it(bridge, records, year):
    write_day(records, bridge, FIRST, FIRST + 3, name="a.csv")
    edit(bridge / "new" / "a.csv", f"{records.index[FIRST + 1]:%Y-%m-%d}", f"{year}-01-05")
    first = run("update", bridge, "--now", str(records.index[FIRST + 2]))
    assert year in first.out + first.err
    now = write_day(records, bridge, FIRST + 3)
    done = run("update", bridge, "--now", now)
    assert "state: healthy" in done.out
    assert done.code == (HEALTHY if year in ("1970", "2062") else FAILED)  # a file with what is no time is named


def test_a_baseline_in_a_workbook_and_nights_in_any_text(tmp_path, records, one_detector):
    pytest.importorskip("openpyxl")
    records[:FIRST].to_excel(tmp_path / "years.xlsx", index_label="time")
    run("init", tmp_path / "years.xlsx", "--into", tmp_path / "bridge")
    assert run("fit", tmp_path / "bridge").code == 0
    night = records[FIRST : FIRST + 3]
    night = night.set_axis(night.index.strftime("%d.%m.%Y %H:%M"))
    night.to_csv(tmp_path / "bridge" / "new" / "n.csv", sep=";", decimal=",", index_label="Zeit")
    write_day(records, tmp_path / "bridge", FIRST + 3)
    done = run("update", tmp_path / "bridge", "--now", str(records.index[FIRST + 3]), "--json")
    assert done.json["bridges"][0]["records"]["new"] == 4


def test_later_records_of_the_baselines_files_are_new_ones(records, tmp_path):
    files = write_pair(records[: FIRST + 10], tmp_path)
    toml = tmp_path / "b" / "monitor.toml"
    run("init", *files, "--into", toml.parent, "--until", str(records.index[FIRST - 1]))
    edit(toml, '# page = "status.html"', 'page = ""')
    assert run("fit", toml).code == 0
    assert len(load_monitor(toml.parent / "monitor.joblib").baseline_) == FIRST
    assert run("update", toml, "--now", str(records.index[FIRST + 9])).code == HEALTHY
    assert len(load_monitor(toml.parent / "monitor.joblib").records_) == 10


@pytest.mark.nightly
def test_a_monitor_is_not_replaced_by_chance_and_the_old_one_is_kept(bridge, records):
    now = write_day(records, bridge, FIRST, DAMAGED + 10)
    run("update", settings(bridge), "--now", now)
    seen = load_monitor(bridge / "monitor.joblib")
    before = (bridge / "monitor.joblib").read_bytes()
    refused = run("fit", settings(bridge))
    assert (refused.code, (bridge / "monitor.joblib").read_bytes()) == (FAILED, before)
    assert run("fit", settings(bridge), "--replace").code == 0
    (kept,) = bridge.glob("monitor.replaced-*.joblib")
    assert kept.read_bytes() == before
    assert run("update", settings(bridge), "--now", now).code == ALARM  # of all records that the folder keeps
    assert_same_history(load_monitor(bridge / "monitor.joblib"), seen)
    lines = [json.loads(line) for line in (bridge / "transitions.jsonl").read_text().splitlines()]
    assert len({one["fitted"] for one in lines}) in (1, 2)  # the second fit may be of the same second


def test_a_fit_that_cannot_be_saved_leaves_the_monitor(bridge, monkeypatch):
    before = (bridge / "monitor.joblib").read_bytes()

    def write(monitor, stream):
        raise pickle.PicklingError("Can't pickle a function")

    monkeypatch.setattr(joblib, "dump", write)
    failed = run("fit", bridge, "--replace")
    assert (failed.code, "cannot be saved" in failed.err, "Traceback" in failed.err) == (FAILED, True, False)
    assert (bridge / "monitor.joblib").read_bytes() == before


def test_a_monitor_of_another_version_is_refused_by_name(bridge, records):
    now = write_day(records, bridge, FIRST, FIRST + 9)
    old = load_monitor(bridge / "monitor.joblib")
    old.versions_ = old.versions_ | {"skthermo": "0.0.1"}
    old.save(bridge / "monitor.joblib")
    refused = run("update", settings(bridge), "--now", now)
    assert (refused.code, "0.0.1" in refused.err, "--replace" in refused.err) == (FAILED, True, True)


@pytest.mark.nightly
def test_commands_that_an_engineer_uses(bridge, records):
    now = write_day(records, bridge, FIRST, DAMAGED + 30)
    assert run("update", settings(bridge), "--now", now).code == ALARM
    written = run("report", settings(bridge), "--now", now, "--out", bridge / "alarm.html", "--json")
    assert (written.code, valid(written.json)["bridges"][0]["state"]) == (0, "alarm")
    status = run("status", settings(bridge), "--now", now, "--json")
    opened = valid(status.json)["bridges"][0]["status"]["events"]
    (event,) = [one for one in opened if one["kind"] == "damage"]
    said = run("acknowledge", settings(bridge), event["event"], "--harmless", "--note", "a repair", "--json")
    assert [one["what"] for one in valid(said.json)["bridges"][0]["transitions"]] == ["acknowledged"]
    new = run("rebaseline", settings(bridge), "--since", str(records.index[DAMAGED]), "--now", now, "--json")
    assert (new.code, "rebaseline" in [one["what"] for one in valid(new.json)["bridges"][0]["transitions"]]) == (
        0,
        True,
    )
    assert run("status", settings(bridge), "--now", now).code != ALARM
    report = run("report", settings(bridge), "--now", now, "--out", bridge / "other.html", "--json")
    assert valid(report.json)["bridges"][0]["written"] == [str(bridge / "other.html")]


@pytest.mark.nightly
def test_records_are_taken_back_and_learned(bridge, records):
    now = write_day(records, bridge, FIRST, FIRST + 40)
    run("update", settings(bridge), "--now", now)
    last = records.index[FIRST + 30]
    back = run("discard", settings(bridge), "--since", records.index[FIRST + 31], "--now", now, "--json")
    (said,) = valid(back.json)["bridges"]
    assert (back.code, said["transitions"][0]["what"]) == (0, "discarded")
    expected = load_monitor(bridge / "monitor.joblib")
    assert expected.last_ == last
    learned = run("refit", settings(bridge), "--force", "--now", now, "--json")
    assert (learned.code, valid(learned.json)["bridges"][0]["transitions"][0]["what"]) == (0, "refit")
    expected.refit(force=True)
    assert load_monitor(bridge / "monitor.joblib").threshold_ == expected.threshold_
    assert run("discard", settings(bridge), "--since", "2040-01-01").code == FAILED


def test_settings_that_change_after_a_fit_are_reported_until_the_next_fit(bridge, records):
    now = write_day(records, bridge, FIRST, FIRST + 10)
    assert "changed-settings" not in run("update", settings(bridge), "--now", now).err
    edit(settings(bridge), "watch_per_year = 12.0", "watch_per_year = 6.0")
    changed = run("status", settings(bridge), "--now", now, "--json")
    assert any(
        "[monitor] watch_per_year" in one and "changed-settings" in one for one in valid(changed.json)["warnings"]
    )
    assert "changed-settings" not in run("fit", settings(bridge), "--replace").err
    assert "changed-settings" not in run("status", settings(bridge), "--now", now).err


@pytest.mark.nightly
def test_status_by_the_clock_says_what_the_page_says(bridge, records):
    now = write_day(records, bridge, FIRST, FIRST + 10)
    assert run("update", settings(bridge), "--now", now).code == HEALTHY
    assert run("status", settings(bridge), "--now", now).code == HEALTHY
    late = run("status", settings(bridge), "--now", "2029-01-01", "--json")
    assert (late.code, valid(late.json)["bridges"][0]["state"]) == (NOT_EVALUATED, "not evaluated")
    early = run("status", settings(bridge), "--now", "2026-06-01")
    assert (early.code, "state: not evaluated" in early.out) == (NOT_EVALUATED, True)
    edit(settings(bridge), "# max_age = ...", 'max_age = "3650D"')
    assert run("status", settings(bridge), "--now", "2029-01-01").code == HEALTHY


def test_several_bridges_are_a_fleet(bridge, records, tmp_path):
    second, third = (shutil.copytree(bridge, tmp_path / name) for name in ("second", "third"))
    write_day(records, bridge, FIRST, FIRST + 40)  # its alarm is open
    healthy = records[FIRST : DAMAGED - 1]
    for one in (second, third):
        healthy.to_csv(one / "new" / "a.csv", index_label="time")
    files = [settings(one) for one in (bridge, second, third)]
    now = str(records.index[DAMAGED - 2])
    healthy_only = run("update", *files[1:], "--now", now, "--json")
    assert (healthy_only.code, len(valid(healthy_only.json)["bridges"])) == (HEALTHY, 2)
    page, metrics = tmp_path / "fleet.html", tmp_path / "m.prom"
    now = str(records.index[FIRST + 39])
    run("update", files[0], "--now", now)
    done = run("status", *files, "--now", now, "--json", "--metrics", metrics, "--report", page)
    assert done.code == ALARM
    states = {one["name"]: one["state"] for one in valid(done.json)["bridges"]}
    assert states == {"bridge": "alarm", "second": "not evaluated", "third": "not evaluated"}
    assert {one["bridge"] for one in done.json["fleet"]["discoveries"]} == {"bridge"}
    assert 'skthermo_state{bridge="bridge",state="alarm"} 1' in metrics.read_text()
    (second / "monitor.joblib").write_bytes(b"")
    edit(files[2], "[monitor]", "[monitr]")
    failed = run("status", *files, "--now", now, "--json", "--metrics", metrics)
    assert failed.code == ALARM  # which the errors of others do not hide
    assert [len(one["errors"]) for one in valid(failed.json)["bridges"]] == [0, 1, 1]
    assert 'skthermo_up{bridge="second"} 0' in metrics.read_text()
    assert run("status", *files[1:], "--now", now).code == FAILED
    run_twice = run("status", files[0], files[0], "--now", now)
    assert (run_twice.code, "another name" in run_twice.err) == (FAILED, True)


@pytest.mark.nightly
def test_bridges_in_one_file_of_metrics_and_each_in_its_own(bridge, records):
    edit(settings(bridge), "# metrics = ...", 'metrics = "own.prom"')
    now = write_day(records, bridge, FIRST, DAMAGED + 10)
    run("update", settings(bridge), "--now", now, "--metrics", bridge / "given.prom")
    own, given = ((bridge / f"{name}.prom").read_text() for name in ("own", "given"))
    assert own == given or len(own) == len(given)  # written at different times
    samples = dict(line.rsplit(" ", 1) for line in own.splitlines() if line[0] != "#")
    monitor = load_monitor(bridge / "monitor.joblib")
    assert float(samples['skthermo_threshold{bridge="bridge"}']) == pytest.approx(monitor.threshold_)
    assert samples['skthermo_open_events{bridge="bridge",kind="damage"}'] == "1"
    assert float(samples['skthermo_record_age_seconds{bridge="bridge"}']) == 0
    newest = pd.Timestamp(now).to_pydatetime().timestamp()
    assert float(samples['skthermo_newest_record_timestamp_seconds{bridge="bridge"}']) == newest
    names = {line.split()[2] for line in own.splitlines() if line.startswith("# TYPE")}
    assert all(any(sample.startswith(name) for name in names) for sample in samples)
    metrics = (bridge / "own.prom").stat().st_mtime_ns
    run("status", settings(bridge), "--now", now)
    assert (bridge / "own.prom").stat().st_mtime_ns == metrics  # status writes only what it is asked for


def test_what_is_done_is_logged(bridge, records, tmp_path):
    now = write_day(records, bridge, FIRST, FIRST + 2)
    done = run("update", settings(bridge), "--now", now, "--log", tmp_path / "log.txt")
    assert done.err == ""
    text = (tmp_path / "log.txt").read_text()
    assert "skthermo.commands: update bridge: state healthy, exit code 0" in text
    assert run("status", settings(bridge), "--log", tmp_path).code == FAILED  # no file


@pytest.mark.usefixtures("one_detector")
def test_check_and_init_say_what_they_found(records, tmp_path):
    stuck = records.copy()
    stuck.iloc[300:340, 0] = 7.0
    files = write_pair(stuck[:FIRST], tmp_path)
    checked = run("check", *files, "--json")
    assert (checked.code, valid(checked.json)["findings"][0]["what"]) == (1, "stuck")
    made = run("init", *files, "--into", tmp_path / "b", "--json")
    assert (made.code, valid(made.json)["findings"]) == (0, checked.json["findings"])
    assert "stuck" in (tmp_path / "b" / "monitor.toml").read_text()
    again = run("init", *files, "--into", tmp_path / "b")
    assert (again.code, "already" in again.err) == (FAILED, True)
    write_pair(records[:FIRST], tmp_path)
    assert run("check", *files).code == 0
    missing = run("check", tmp_path / "no.csv", "--json")
    assert (missing.code, len(valid(missing.json)["errors"])) == (FAILED, 1)


MODEL = """from skthermo.datasets import make_truss, truss_structure


def make_model():
    return make_truss()


def make_structure():
    return truss_structure()
"""


@pytest.mark.nightly
def test_an_fe_model_of_a_python_file_follows_drift_and_is_drawn(bridge, records, monkeypatch):
    monkeypatch.undo()  # of the short page
    (bridge / "model.py").write_text(MODEL)
    text = settings(bridge).read_text()
    named = '[fem]\nmodel = "model.py:make_model"\nrandom_state = 0'
    text = text.replace('# [fem]\n# model = "model.py:make_model"\n# random_state = 0', named)
    text = text.replace("# [page]", "[page]").replace("# structure = ", "structure = ")
    settings(bridge).write_text(text)
    assert run("fit", settings(bridge), "--replace").code == 0
    monitor = load_monitor(bridge / "monitor.joblib")
    assert monitor.drift_ is not None
    assert set(monitor.smallest_changes_.groups) == {"bottom", "top", "diagonal", "vertical"}
    assert run("report", settings(bridge)).code == 0
    assert "Drawing of the structure. Smallest losses" in (bridge / "status.html").read_text()
    edit(settings(bridge), "make_structure", "make_strcture")
    failed = run("report", settings(bridge))
    assert (failed.code, "make_strcture" in failed.err) == (FAILED, True)
    edit(settings(bridge), "make_model", "make_modl")
    failed = run("fit", settings(bridge), "--replace")
    assert (failed.code, "make_modl" in failed.err) == (FAILED, True)


def test_a_python_file_imports_those_beside_it_and_its_errors_have_a_line(bridge, tmp_path, monkeypatch):
    drawn = []

    def page(subject, path, *, structure=None, **options):
        drawn.append(structure)
        return path

    monkeypatch.setattr(skthermo.reporting, "owner_report", page)
    other = shutil.copytree(bridge, tmp_path / "other")
    for number, folder in enumerate((bridge, other)):
        (folder / "parts.py").write_text(f"SPANS = {number}\n")
        (folder / "model.py").write_text("from parts import SPANS\n\n\ndef make_structure():\n    return SPANS\n")
        text = settings(folder).read_text().replace("# [page]", "[page]").replace("# structure = ", "structure = ")
        settings(folder).write_text(text)
    run("report", bridge, other)
    assert drawn == [0, 1]
    (bridge / "parts.py").write_text("\nSPANS = {}['main']\n")
    failed = run("report", bridge)
    assert (failed.code, "parts.py, line 2: KeyError" in failed.err) == (FAILED, True)


def test_the_page_is_written_from_the_templates_that_the_settings_name(bridge, monkeypatch):
    pytest.importorskip("jinja2")
    monkeypatch.undo()  # of the short page
    monkeypatch.setattr("skthermo.reporting._page._svg", lambda figure: b"<svg/>")
    text = settings(bridge).read_text().replace("# [page]", "[page]").replace("# templates = ", "templates = ")
    settings(bridge).write_text(text)
    failed = run("report", settings(bridge))
    assert (failed.code, "status.html was not written" in failed.err) == (FAILED, True)
    assert str(bridge / "templates") in failed.err
    (bridge / "templates").mkdir()
    template = bridge / "templates" / "monitor.html.j2"
    template.write_text('{% extends "skthermo/monitor.html.j2" %}{% block today %}<p>Ask Anna.</p>{% endblock %}')
    assert run("report", settings(bridge)).code != FAILED
    assert "<p>Ask Anna.</p>" in (bridge / "status.html").read_text()


def test_a_reader_that_has_gone_changes_neither_output_nor_exit_code(fitted):
    reads, writes = os.pipe()
    os.close(reads)
    with os.fdopen(writes, "w") as gone:
        command = [sys.executable, "-m", "skthermo", "status", str(settings(fitted)), "--json"]
        done = subprocess.run(command, stdout=gone, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (NOT_EVALUATED, "")


@pytest.mark.parametrize("command", ["fit", "update", "status", "report", "check"])
def test_a_missing_file_is_named_in_words(command, tmp_path):
    missing = [tmp_path / "nowhere.toml"] if command != "check" else [tmp_path / "T.csv", tmp_path / "F.csv"]
    done = run(command, *missing)
    assert (done.code, str(missing[0]) in done.err, "Errno" in done.err) == (FAILED, True, False)
