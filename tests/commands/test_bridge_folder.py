"""A bridge by commands alone: from two CSV files to a page, night by night."""

import contextlib
import json
import os
import pickle
import shutil
from importlib.resources import files
from itertools import pairwise

import joblib
import numpy as np
import pandas as pd
import pytest

import skthermo.reporting
from skthermo.commands.main import COMMANDS, main
from skthermo.monitoring import Monitor, load_monitor
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


def test_the_schema_knows_each_command():
    assert set(SCHEMA["properties"]["command"]["enum"]) == set(COMMANDS)


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


def test_a_log_that_grows_is_read_where_it_grows_and_a_last_line_without_an_end_when_it_stays(bridge, records):
    log, text, numbers = bridge / "new" / "log.csv", records[FIRST : FIRST + 7].to_csv(index_label="time"), []
    third = text.index(str(records.index[FIRST + 3])[:10])
    for content in [text[:third].rstrip()] * 3 + [text + "2027-02-01,1."]:
        if not log.exists() or log.read_text() != content:
            log.write_text(content)
        run("update", bridge, "--now", str(records.index[FIRST + 6]))
        monitor = load_monitor(bridge / "monitor.joblib")
        numbers.append(len(monitor.records_))
    assert numbers == [2, 3, 3, 7]
    pd.testing.assert_frame_equal(monitor.records_, records[FIRST : FIRST + 7], check_freq=False)
    assert monitor.counts_["n_repeated"] == 0


@pytest.mark.nightly
def test_temperatures_wait_for_frequencies_of_the_same_time(bridge, records):
    T, f = (records[FIRST:].filter(regex=f"^{letter}") for letter in "Tf")
    for (first, last), (begin, end) in (((0, 5), (0, 3)), ((5, 8), (3, 8))):
        T[first:last].to_csv(bridge / "new" / f"T{first}.csv", index_label="time")
        f[begin:end].to_csv(bridge / "new" / f"f{begin}.csv", index_label="time")
        assert run("update", bridge, "--now", str(f.index[end - 1])).code == HEALTHY
        taken = load_monitor(bridge / "monitor.joblib").records_
        pd.testing.assert_frame_equal(taken, records[FIRST : FIRST + end], check_freq=False)


def test_stamps_between_the_records_of_the_other_file_wait_for_nothing(bridge, records):
    rows = records[FIRST : FIRST + 3]
    twice = rows.filter(regex="^T").resample("12h").interpolate()
    twice.to_csv(bridge / "new" / "T.csv", index_label="time")
    rows.filter(regex="^f").to_csv(bridge / "new" / "F.csv", index_label="time")
    now = str(rows.index[-1])
    first, second = (run("update", bridge, "--now", now, "--verbose") for _ in range(2))
    assert (first.code, "left out, between records and not in all files: 2" in first.out) == (HEALTHY, True)
    assert load_monitor(bridge / "monitor.joblib").counts_["n_records"] == 3
    assert not any(text in second.out for text in ("T.csv", "wait", "left out, between"))


def test_wrong_values_of_a_column_are_one_counted_line(bridge, records):
    wrong = records.copy()
    wrong.iloc[FIRST : FIRST + 9, 0] = -200.0 - np.arange(9)
    now = write_day(wrong, bridge, FIRST, FIRST + 9)
    lines = run("update", bridge, "--now", now, "--verbose").out.splitlines()
    counts = [int(line.rpartition(": ")[2]) for line in lines if line.startswith(("evaluated, ", "not evaluated, "))]
    assert sum(counts) >= 9 > 4 > len(counts)


def test_files_with_a_part_of_the_columns_are_read_where_what_was_taken_is_lost(bridge, records):
    assert run("update", bridge, "--now", write_day(records, bridge, FIRST)).code == HEALTHY
    (bridge / "monitor.joblib.taken.json").unlink()
    write_pair(records[FIRST + 1 : FIRST + 2], bridge / "new")
    now, files = str(records.index[FIRST + 1]), shutil.copytree(bridge / "baseline", bridge / "kept")
    shutil.rmtree(bridge / "baseline")
    lost = run("update", bridge, "--now", now)
    assert (lost.code, "taken.json is lost" in lost.err, "--replace" in lost.err) == (FAILED, True, True)
    shutil.copytree(files, bridge / "baseline")
    assert run("update", bridge, "--now", now).code == HEALTHY
    assert load_monitor(bridge / "monitor.joblib").counts_["n_records"] == 2


def test_a_folder_of_new_records_that_is_missing_is_named(bridge, records):
    now = write_day(records, bridge, FIRST)
    assert run("update", bridge, "--now", now).code == HEALTHY
    shutil.rmtree(bridge / "new")
    gone = run("update", bridge, "--now", now)
    assert (gone.code, f"there is no folder {bridge / 'new'}" in gone.err) == (FAILED, True)


def test_a_file_without_a_column_is_named_until_it_is_mended_and_keeps_no_other_out(bridge, records):
    now, night = write_day(records, bridge, FIRST, FIRST + 3), records[FIRST + 3 : FIRST + 5]
    night.filter(regex="^T").to_csv(bridge / "new" / "T.csv", index_label="time")
    for columns, n_records in ([["f1", "f2", "f4", "f5", "f6"], 3], [list(night.filter(regex="^f")), 5]):
        night[columns].to_csv(bridge / "new" / "f.csv", index_label="time")
        done = run("update", bridge, "--now", now, "--json")
        errors = valid(done.json)["bridges"][0]["errors"]
        assert (done.code == FAILED, len(errors)) == ((True, 1) if n_records == 3 else (False, 0))
        assert all("f.csv" in error and "lacks the columns ['f3'];" in error for error in errors)
        assert len(load_monitor(bridge / "monitor.joblib").records_) == n_records


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


@pytest.mark.usefixtures("one_detector")
def test_a_baseline_in_a_workbook_its_later_records_and_nights_in_any_text(tmp_path, records):
    pytest.importorskip("openpyxl")
    until, last = str(records.index[FIRST - 1]), records.index[FIRST + 13]
    records[FIRST - 100 : FIRST + 10].to_excel(tmp_path / "months.xlsx", index_label="time")
    run("init", tmp_path / "months.xlsx", "--into", tmp_path / "bridge", "--until", until)
    edit(tmp_path / "bridge" / "monitor.toml", '# page = "status.html"', 'page = ""')
    assert run("fit", tmp_path / "bridge").code == 0
    night = records[FIRST + 10 : FIRST + 13]
    night = night.set_axis(night.index.strftime("%d.%m.%Y %H:%M"))
    night.to_csv(tmp_path / "bridge" / "new" / "n.csv", sep=";", decimal=",", index_label="Zeit")
    write_day(records, tmp_path / "bridge", FIRST + 13)
    assert run("update", tmp_path / "bridge", "--now", str(last)).code == HEALTHY
    monitor = load_monitor(tmp_path / "bridge" / "monitor.joblib")
    assert (len(monitor.baseline_), len(monitor.records_), monitor.last_) == (100, 14, last)


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
    before, known = (bridge / "monitor.joblib").read_bytes(), load_monitor(bridge / "monitor.joblib")

    def write(monitor, stream):
        raise pickle.PicklingError("Can't pickle a function")

    monkeypatch.setattr(Monitor, "fit", lambda monitor, records: known)
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
    def said(command, *options):
        done = run(command, bridge, *options, "--now", now, "--json")
        (one,) = valid(done.json)["bridges"]
        return done.code, one, [one["what"] for one in one["transitions"]]

    now = write_day(records, bridge, FIRST, DAMAGED + 30)
    assert said("update")[0] == ALARM
    assert said("discard", "--since", records.index[DAMAGED + 29])[::2] == (0, ["discarded"])
    assert said("discard", "--since", "2040-01-01")[0] == FAILED
    expected = load_monitor(bridge / "monitor.joblib")
    assert expected.last_ == records.index[DAMAGED + 28]
    code, _, what = said("refit", "--force")
    assert (code, what[0]) == (0, "refit")
    expected.refit(force=True)
    assert load_monitor(bridge / "monitor.joblib").threshold_ == expected.threshold_
    (event,) = [one for one in said("status")[1]["status"]["events"] if one["kind"] == "damage"]
    assert said("acknowledge", event["event"], "--harmless", "--note", "a repair")[2] == ["acknowledged"]
    code, _, what = said("rebaseline", "--since", str(records.index[DAMAGED]))
    assert (code, "rebaseline" in what) == (0, True)
    assert said("status")[0] != ALARM
    assert said("report", "--out", bridge / "other.html")[1]["written"] == [str(bridge / "other.html")]


def test_settings_that_change_after_a_fit_are_reported_until_the_next_fit(bridge):
    assert "changed-settings" not in run("status", bridge).err
    edit(settings(bridge), "watch_per_year = 12.0", "watch_per_year = 6.0")
    warned = valid(run("status", bridge, "--json").json)["warnings"]
    assert any("[monitor] watch_per_year" in one and "changed-settings" in one for one in warned)
    assert "changed-settings" not in run("fit", bridge, "--replace").err
    assert "changed-settings" not in run("status", bridge).err


def test_silence_is_never_healthy_by_the_clock(bridge, records):
    now = write_day(records, bridge, FIRST)
    assert run("update", bridge, "--now", now).code == run("status", bridge, "--now", now).code == HEALTHY
    for wrong in ("2029-01-01", "2026-06-01"):
        said = run("status", bridge, "--now", wrong, "--json")
        assert (said.code, valid(said.json)["bridges"][0]["state"]) == (NOT_EVALUATED, "not evaluated")
    edit(settings(bridge), "# max_age = ...", 'max_age = "3650D"')
    assert run("status", bridge, "--now", "2029-01-01").code == HEALTHY


def test_several_bridges_are_a_fleet(bridge, records, tmp_path):
    second, third = (shutil.copytree(bridge, tmp_path / name) for name in ("second", "third"))
    hurt = records.copy()
    hurt.iloc[FIRST + 3 :, 3:] *= 0.95
    files = [settings(one) for one in (bridge, second, third)]
    early, now = (write_day(hurt, bridge, FIRST, FIRST + stop) for stop in (3, 12))
    for one in (second, third):
        write_day(records, one, FIRST, FIRST + 3)
    healthy_only = run("update", *files[1:], "--now", early, "--json")
    assert (healthy_only.code, len(valid(healthy_only.json)["bridges"])) == (HEALTHY, 2)
    page, metrics = tmp_path / "fleet.html", tmp_path / "m.prom"
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
    shutil.rmtree(second)
    gone = run("status", bridge, second, third, "--now", now, "--json", "--metrics", metrics, "--report", page)
    assert {one["name"]: len(one["errors"]) for one in gone.json["bridges"]} == {"bridge": 0, "second": 1, "third": 1}
    assert (gone.code, gone.json["errors"], "second" in gone.json["fleet"]["summary"]) == (ALARM, [], True)
    assert 'skthermo_up{bridge="second"} 0' in metrics.read_text()


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
    stuck = records[:200].copy()
    files = write_pair(stuck, tmp_path)
    assert run("check", *files).code == 0
    stuck.iloc[100:140, 0] = 7.0
    write_pair(stuck, tmp_path)
    checked = run("check", *files, "--json")
    assert (checked.code, valid(checked.json)["findings"][0]["what"]) == (1, "stuck")
    made = run("init", *files, "--into", tmp_path / "b", "--json")
    assert (made.code, valid(made.json)["findings"]) == (0, checked.json["findings"])
    assert "stuck" in (tmp_path / "b" / "monitor.toml").read_text()
    again = run("init", *files, "--into", tmp_path / "b")
    assert (again.code, "already" in again.err) == (FAILED, True)
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


def test_a_reader_that_has_gone_changes_neither_output_nor_exit_code(fitted, capsys):
    reads, writes = os.pipe()
    os.close(reads)
    with os.fdopen(writes, "w") as gone, contextlib.redirect_stdout(gone):
        code = main(["status", str(settings(fitted)), "--json"])
    assert (code, capsys.readouterr().err) == (NOT_EVALUATED, "")


@pytest.mark.parametrize("command", ["fit", "update", "status", "report", "check"])
def test_a_missing_file_is_named_in_words(command, tmp_path):
    missing = [tmp_path / "nowhere.toml"] if command != "check" else [tmp_path / "T.csv", tmp_path / "F.csv"]
    done = run(command, *missing)
    assert (done.code, str(missing[0]) in done.err, "Errno" in done.err) == (FAILED, True, False)
