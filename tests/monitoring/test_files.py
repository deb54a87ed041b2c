"""A saved monitor goes on where it stopped, and what is no whole monitor is refused."""

import json
import sys
import zipfile
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss
from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor, load_monitor
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from tests.monitoring.nightly import DAMAGED, FIRST, assert_same_history, fitted_monitor

ENDINGS = ("joblib", "skops")
each_form = pytest.mark.parametrize("ending", ENDINGS)


class OwnRegression(LinearRegression):
    """A regressor of a package that skthermo does not know."""


@pytest.fixture
def path(tmp_path, ending):
    if ending == "skops":
        pytest.importorskip("skops.io")
    return tmp_path / f"bridge.{ending}"


@pytest.mark.one_case
@each_form
@pytest.mark.parametrize("stop", [FIRST + 3, DAMAGED + 8], ids=["in a window", "in an event"])
def test_a_monitor_goes_on_where_it_stopped(monitor, records, path, stop):
    late = [stop + 1, stop - 2]  # both come after the monitor was loaded
    monitor.update(records[FIRST:stop].drop(records.index[late], errors="ignore"))
    assert (monitor.status(monitor.last_).state == "alarm") is (stop > DAMAGED)
    monitor.save(path)
    loaded = load_monitor(path)
    assert_same_history(loaded, monitor)
    batches = [records[stop : stop + 4].drop(records.index[late], errors="ignore"), records.iloc[late]]
    for batch in [*batches, records[stop + 2 : stop + 12]]:
        pd.testing.assert_frame_equal(loaded.update(batch), monitor.update(batch), check_exact=True)
    for one in (monitor, loaded) if stop > DAMAGED else ():
        one.acknowledge(1, harmless=False)
    assert_same_history(loaded, monitor)


@pytest.mark.parametrize("ending", ["skops"])
def test_drift_and_faulty_sensors_go_on_where_they_stopped(records, path):
    baseline, targets = records[:FIRST], [name for name in records if name.startswith("f")]
    inverse = PosteriorInverse(noise=0.01)
    fem = DataInformedFEM(make_truss(), inverse=inverse, mapper=TemperatureMapper(LinearRegression()), random_state=0)
    monitor = fitted_monitor(records, fem=fem.fit(baseline.drop(columns=targets), baseline[targets]))
    records = records[FIRST : FIRST + 20].copy()
    records.iloc[2:, 0] = 20.0
    monitor.update(records[:15])
    assert set(monitor.faults_["column"]) == {records.columns[0]}
    monitor.save(path)
    loaded = load_monitor(path)
    for one in (monitor, loaded):
        one.update(records[15:])
    pd.testing.assert_frame_equal(loaded.drift_, monitor.drift_, check_exact=True)
    assert_same_history(loaded, monitor)


@each_form
def test_a_file_that_was_cut_off_or_has_a_changed_bit_is_refused(monitor, path):
    monitor.save(path)
    content = path.read_bytes()
    values = monitor.baseline_.to_numpy()[0].tobytes()
    place = len(content) // 3 if path.suffix == ".joblib" else content.index(values[:8])
    changed = content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]
    for damaged in (b"", content[: len(content) // 3], content[:-9], changed):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=rf"{path.name} cannot be read: .*; expected the whole file of a monitor"):
            load_monitor(path)


@each_form
def test_something_else_is_no_monitor(path, ending):
    if ending == "joblib":
        joblib.dump(LinearRegression(), path)
    else:
        pytest.importorskip("skops.io").dump(LinearRegression(), path)
    with pytest.raises(ValueError, match="holds 'LinearRegression'; expected a fitted Monitor"):
        load_monitor(path)


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("os", "system"),
        ("numpy", "memmap"),  # a class that can write a file
        ("skthermo._core.files", "write_when_complete"),  # a function
        ("skthermo.monitoring._files", "Path"),  # another package's class by a name of this one
        ("skthermo.monitoring", "NoSuchClass"),
    ],
)
def test_a_file_of_skops_runs_nothing_of_others(monitor, tmp_path, module, name):
    pytest.importorskip("skops.io")
    path = tmp_path / "bridge.skops"
    monitor.save(path)
    with zipfile.ZipFile(path) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    schema = json.loads(members["schema.json"])
    schema["content"]["content"]["note_"] = {"__class__": name, "__module__": module, "__loader__": "TypeNode"}
    with zipfile.ZipFile(path, "w") as archive:
        for member, content in (members | {"schema.json": json.dumps(schema)}).items():
            archive.writestr(member, content)
    with pytest.raises(ValueError, match=rf"\['{module}.{name}'\] are no classes of this skthermo or scikit-learn"):
        load_monitor(path)


def test_a_part_that_skops_could_not_read_again_is_refused_at_once(records, tmp_path):
    pytest.importorskip("skops.io")
    monitor = fitted_monitor(records, OwnRegression())
    with pytest.raises(ValueError, match=r"would hold \[.*OwnRegression'\].*; expected a path that ends with .joblib"):
        monitor.save(tmp_path / "bridge.skops")
    assert not list(tmp_path.iterdir())
    monitor.save(tmp_path / "bridge.joblib")
    assert_same_history(load_monitor(tmp_path / "bridge.joblib"), monitor)


def test_what_is_not_there_is_neither_saved_nor_read(monitor, tmp_path):
    with pytest.raises(FileNotFoundError):
        load_monitor(tmp_path / "bridge.joblib")
    with pytest.raises(NotFittedError):
        clone(monitor).save(tmp_path / "bridge.joblib")


def test_a_missing_skops_is_named(monitor, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "skops.io", None)
    (tmp_path / "bridge.skops").write_bytes(b"")
    for function in (monitor.save, load_monitor):
        with pytest.raises(ImportError, match=r"'skops\.io' is not installed"):
            function(tmp_path / "bridge.skops")


@pytest.mark.filterwarnings("ignore:.*(few-records|doubtful-values)")
def test_a_file_of_version_0_2_is_refused_in_one_sentence_and_its_acknowledgements_are_kept(tmp_path):
    old = Path(__file__).with_name("monitor_of_0_2.joblib")
    with pytest.raises(ValueError, match=r"another version of skthermo; .* skthermo fit FOLDER --replace"):
        load_monitor(old)
    rng = np.random.default_rng(0)
    F = np.array([2.0, 3.0]) + 0.01 * rng.normal(size=(90, 2))
    F[75:] *= 0.95
    records = pd.DataFrame(F, pd.date_range("2025-01-01", periods=90), ["f1", "f2"])
    monitor = Monitor(MahalanobisDetector(), targets=["f1", "f2"], sensors=False).fit(records[:60])
    assert monitor.keep_acknowledgements(old) == 1
    monitor.update(records[60:])
    assert monitor.events_["note"].tolist()[-1] == "crack found"
    monitor.save(tmp_path / "new.joblib")
    later = Monitor(MahalanobisDetector(), targets=["f1", "f2"], sensors=False).fit(records[:60])
    assert later.keep_acknowledgements(tmp_path / "new.joblib") == 1
