"""Many bridges side by side: each fails alone, and all have the same bits."""

import json
import os
import pickle
import signal
import warnings
from functools import partial
from types import MappingProxyType

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline

from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.exceptions import RecordsWarning, SkthermoWarning
from skthermo.monitoring import Fleet, Monitor, fit_fleet

MODES = ["f1", "f2"]
pytestmark = pytest.mark.filterwarnings("ignore:.*bridges")


def year(seed, n=365, start="2025-01-01", step=0.0):
    """Temperatures and two frequencies that follow them; a step in the second makes an alarm."""
    random = np.random.default_rng(seed)
    stamps = pd.date_range(start, periods=n, freq="D")
    warm = 10 - 15 * np.cos(2 * np.pi * stamps.day_of_year.to_numpy() / 365) + random.normal(0, 3, n)
    F = np.column_stack([2 - 0.002 * warm, 5 - 0.004 * warm]) * (1 + random.normal(0, 0.002, (n, 2)))
    F[:, 1] *= 1 - step
    return pd.DataFrame({"air": warm}, stamps), pd.DataFrame(F, stamps, MODES)


def watch(chain):
    compensator = TemperatureCompensator(LinearRegression(), targets=MODES)
    return Monitor(make_pipeline(compensator, MahalanobisDetector()), sensors=False)


class Warns(LinearRegression):
    """Warns twice as a part of the package does, and keeps where it was fitted."""

    def fit(self, X, y):
        self.process_ = os.getpid()
        for _ in range(2):
            warnings.warn(RecordsWarning(f"{len(X)} records look odd", "odd records"), stacklevel=1)
        return super().fit(X, y)


def missing_file():
    raise FileNotFoundError("no records of this bridge")


def asked(names="abcd", **changed):
    """Makers and records of bridges."""
    makers = {name: LinearRegression() for name in names}
    records = {name: partial(year, seed) for seed, name in enumerate(names)}
    for name, (maker, record) in changed.items():
        makers[name] = maker or LinearRegression()
        records[name] = record or partial(year, 7)
    return makers, records


def bits(fleet, names=None):
    """All that was fitted, as numbers."""
    return [
        (fleet.chains[n].coef_.tolist(), fleet.chains[n].intercept_.tolist(), fleet.monitors[n].threshold_)
        for n in names or fleet.chains
    ]


@pytest.fixture(scope="module")
def fleet():
    """Fitted in this process; one bridge has no records, and one warns."""
    makers, records = asked(broken=(None, missing_file), odd=(Warns(), None))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = fit_fleet(makers, records, monitor=watch)
    made.caught = [str(one.message) for one in caught if issubclass(one.category, SkthermoWarning)]
    return made


def test_a_bridge_fails_alone_and_is_named_and_nothing_known_is_never_healthy(fleet):
    assert list(fleet.table.index) == ["a", "b", "c", "d", "broken", "odd"]
    assert fleet.table["is_fitted"].tolist() == [True] * 4 + [False, True]
    assert fleet.table["error"].tolist() == [""] * 4 + ["FileNotFoundError: no records of this bridge", ""]
    (row,) = fleet.errors.itertuples()
    assert (row.bridge, row.stage) == ("broken", "records")
    assert row.where.startswith("test_fleet.py:")
    assert row.where.endswith("in missing_file")
    assert "broken" not in {*fleet.chains, *fleet.monitors}
    assert set(fleet.table["state"]) == {"not evaluated", ""}
    text = fleet.summary()
    assert "5 of 6 bridges are fitted, 0 healthy." in text
    assert "Not fitted: 1 (broken)." in text
    assert "Without a record since the fit, state not known: 5 (a, b, c, d, odd)." in text
    assert repr(fleet) == "Fleet(6 bridges, 5 fitted)"


def test_warnings_of_all_bridges_are_one_and_counted_by_kind(fleet):
    numbers = fleet.warnings.set_index(["bridge", "kind"])["times"].to_dict()
    assert numbers == {("odd", "odd records"): 2}
    assert fleet.table["warnings odd records"].to_dict() == dict.fromkeys("abcd", 0) | {"broken": 0, "odd": 2}
    (found,) = fleet.caught
    assert "(broken), the first with FileNotFoundError: no records" in found
    assert "odd records (1 bridge)" in found


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*odd records")
@pytest.mark.parametrize("backend", ["loky", "threading"])
def test_other_processes_and_other_bridges_give_the_same_bits(fleet, backend):
    makers, records = asked(odd=(Warns(), None))
    some = ("odd", "c", "a")
    with joblib.parallel_config(backend):
        other = fit_fleet({n: makers[n] for n in some}, {n: records[n] for n in some}, monitor=watch, n_jobs=2)
    assert bits(other) == bits(fleet, some)
    assert (other.chains["odd"].process_ != os.getpid()) == (backend == "loky")
    if backend == "loky":
        pd.testing.assert_frame_equal(other.warnings, fleet.warnings)
    else:  # in threads, warnings are Python's
        assert other.warnings[["bridge", "kind"]].to_numpy().tolist() == [[name, "not-kept"] for name in some]


def test_a_seed_depends_on_the_name_alone():
    network, records = MLPRegressor(hidden_layer_sizes=3, max_iter=20, tol=1.0, n_iter_no_change=2), year(0, 50)
    both = fit_fleet({"a": network, "b": network}, {"a": records, "b": records})
    alone = fit_fleet({"b": network}, {"b": records})
    other = fit_fleet({"b": network}, {"b": records}, random_state=1)
    weights = [one.coefs_[0].tolist() for one in (both.chains["a"], both.chains["b"])]
    assert weights[0] != weights[1] == alone.chains["b"].coefs_[0].tolist() != other.chains["b"].coefs_[0].tolist()
    assert network.random_state is None


@pytest.mark.nightly
def test_bridges_that_were_finished_when_a_process_was_killed_are_kept(fleet, tmp_path):
    def kill():
        os.kill(os.getpid(), signal.SIGKILL)

    makers, records = asked(killer=(kill, None))
    with pytest.raises(Exception, match=r"killed|terminated|abruptly"):
        fit_fleet(makers, records, monitor=watch, folder=tmp_path, n_jobs=2)
    kept = list(Fleet(tmp_path).chains)
    assert len(kept) >= 1
    again = fit_fleet(makers | {"killer": LinearRegression()}, records, monitor=watch, folder=tmp_path)
    assert bits(again, list("abcd")) == bits(fleet, list("abcd"))


@pytest.mark.nightly
def test_a_second_call_fits_only_what_has_changed(tmp_path, fleet):
    makers, records = asked(killed=(Warns(), missing_file))
    first = fit_fleet(makers, records, monitor=watch, folder=tmp_path)
    first.update({"a": year(20, 100, "2026-01-01")})
    before = {path.name: path.read_bytes() for path in tmp_path.glob("*.bridge")}
    makers["b"] = LinearRegression(positive=True)
    records |= {"c": partial(year, 9), "killed": partial(year, 5)}
    makers["e"], records["e"] = LinearRegression(), partial(year, 6)
    again = fit_fleet(makers, records, monitor=watch, folder=tmp_path)
    after = {path.name: path.read_bytes() for path in tmp_path.glob("*.bridge")}
    same = {name[0] for name in after if after[name] == before.get(name)}
    assert same == {"a", "d"}
    assert again.table["is_fitted"].all()
    assert again.table.loc["a", "n_evaluated"] == 100  # a monitor goes on with what it has seen
    pd.testing.assert_frame_equal(Fleet(tmp_path).table.loc[again.table.index], again.table)
    makers["a"], (evaluated,) = LinearRegression(positive=True), [after[name] for name in after if name[0] == "a"]
    with pytest.warns(UserWarning, match=r"fitted anew.*\(a\).*changed-settings"):
        anew = fit_fleet(makers, records, monitor=watch, folder=tmp_path)
    assert anew.table["n_evaluated"].eq(0).all()
    assert [file.read_bytes() for file in tmp_path.glob("*.replaced")] == [evaluated]
    assert len(Fleet(tmp_path)) == len(makers)


def test_monitors_evaluate_new_records_each_alone(fleet):
    made = pickle.loads(pickle.dumps(fleet))  # also a pickled fleet goes on
    new = {"a": year(31, 60, "2026-01-01"), "b": partial(year, 32, 60, "2026-01-01", step=0.05), "c": missing_file}
    answers = made.update(new | {"d": year(33, 60, "2026-01-01")[1]})
    states = answers.groupby(["bridge", "state"]).size().to_dict()
    assert states[("b", "alarm")] > 50
    assert states[("c", "not evaluated")] == states[("d", "not evaluated")] == 1
    assert answers.loc[answers["bridge"] == "c", "reason"].item() == "FileNotFoundError: no records of this bridge"
    alone = pickle.loads(pickle.dumps(fleet)).monitors["b"]
    alone.update(new["b"]()[0].join(new["b"]()[1]))
    pd.testing.assert_frame_equal(made.monitors["b"].events_, alone.events_)
    table = made.table
    assert table["state"].to_dict() | {"a": ""} == {
        "a": "", "b": "alarm", "c": "not evaluated", "d": "not evaluated", "broken": "", "odd": "not evaluated"
    }  # fmt: skip
    assert table.loc["b", ["n_events", "n_open"]].tolist() == [1, 1]
    assert table.loc["b", "alarm_rate"] == alone.days_["n_alarms"].sum() / alone.days_["n_evaluated"].sum()
    assert made.events.loc[made.events["bridge"] == "b", "event"].tolist() == [1]
    status = made.status("2026-03-02")
    assert list(status) == list(table.index)
    assert status["b"].state == "alarm"
    assert status["a"] == made.monitors["a"].status("2026-03-02")
    assert status["c"].reason == "FileNotFoundError: no records of this bridge"
    assert {status[name].state for name in ("c", "d", "broken", "odd")} == {"not evaluated"}
    late = made.status("2027-01-01")
    assert [late[name].state for name in "ab"] == ["not evaluated", "alarm"]
    json.dumps({name: one.as_dict() for name, one in status.items()}, allow_nan=False)
    found = made.discoveries()
    assert found.bridges == ["b"]
    assert {"c", "d", "odd"} == set(found.not_evaluated)
    assert found.false_alarms_per_year == 5.0


def test_what_is_in_a_folder_is_kept_and_a_damaged_file_is_fitted_anew(tmp_path):
    makers, records = asked("abc")
    first = fit_fleet(makers, records, monitor=watch, folder=tmp_path)
    first.update({name: year(seed, 30, "2026-01-01", 0.1 * (name == "a")) for seed, name in enumerate("ab")})
    lost = fit_fleet(makers, records | {"a": missing_file, "b": missing_file}, monitor=watch, folder=tmp_path)
    assert lost.table["state"].to_dict() == {"a": "alarm", "b": "not evaluated", "c": "not evaluated"}
    assert lost.table["is_fitted"].all()
    assert lost.errors["bridge"].tolist() == ["a", "b"]
    file = next(tmp_path.glob("c-*.bridge"))
    file.write_bytes(file.read_bytes()[:100])
    assert Fleet(tmp_path).table["is_fitted"].sum() == 2
    found = fit_fleet(makers, records, monitor=watch, folder=tmp_path)
    assert not len(found.errors)
    assert bits(found) == bits(first)
    assert found.table["state"].to_dict() == {"a": "alarm", "b": "healthy", "c": "not evaluated"}
    assert found.discoveries().bridges == ["a"]
    found.acknowledge("a", 1, harmless=True, note="a train stood on it")
    for known in (found, Fleet(tmp_path)):
        assert known.events["note"].tolist() == ["a train stood on it"]
        assert known.discoveries().bridges == []
    with pytest.raises(ValueError, match="'x' is no bridge with a monitor"):
        found.acknowledge("x", 1, harmless=True)


@pytest.mark.nightly
def test_monitors_that_were_fitted_one_by_one_are_a_fleet_like_any_other(fleet):
    single = {name: pickle.loads(pickle.dumps(fleet.monitors[name])) for name in "abc"}
    new = {
        name: pd.concat(year(seed, 60, "2026-01-01", 0.1 * (name == "b")), axis=1) for seed, name in enumerate("abc")
    }
    for name, monitor in single.items():
        monitor.update(new[name])
    fitted = fit_fleet(*(dict(list(one.items())[:3]) for one in asked()), monitor=watch)
    fitted.update(new)
    made = Fleet.of_monitors(single)
    columns = ["is_fitted", "state", "last", "n_evaluated", "alarm_rate", "n_events", "n_open"]
    pd.testing.assert_frame_equal(made.table[columns], fitted.table[columns])
    pd.testing.assert_frame_equal(made.events, fitted.events)
    assert made.discoveries().bridges == fitted.discoveries().bridges == ["b"]
    elsewhere = Fleet.of_monitors(MappingProxyType(single))  # asked for each monitor again
    pd.testing.assert_frame_equal(elsewhere.discoveries().table, made.discoveries().table)
    broken = Fleet.of_monitors(single, {"a": ValueError("no sensor"), "b": OSError("no file"), "d": OSError("lost")})
    assert broken.table["state"].to_dict() == {"a": "not evaluated", "b": "alarm", "c": "healthy", "d": ""}
    assert set(broken.errors["bridge"]) == {"a", "b", "d"}
    with pytest.raises(ValueError, match="monitors"):
        Fleet.of_monitors({})
