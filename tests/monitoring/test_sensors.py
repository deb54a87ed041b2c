"""Faults of sensors are named and dated, damage is not masked, and repaired sensors come back."""

import copy

import numpy as np
import pandas as pd
import pytest

from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor
from tests.monitoring.nightly import assert_same_history, quietly

N_BASELINE, N_DAYS, PER_DAY = 200, 50, 4
ONSET = N_BASELINE + 10
MODES = ["f1", "f2", "f3", "f4"]


def bridge(n_sensors=3, zone=None, seed=0, n_days=N_BASELINE + N_DAYS):
    """Records of a bridge whose thermometers follow one weather, each with its own noise."""
    random = np.random.default_rng(seed)
    n = n_days * PER_DAY
    index = pd.date_range("2026-01-01", periods=n, freq=pd.Timedelta(days=1) / PER_DAY, tz=zone).as_unit("ns")
    day = np.arange(n) / PER_DAY
    slow = np.repeat(np.convolve(random.normal(0, 2, n // PER_DAY + 6), np.ones(7) / 2, "valid"), PER_DAY)
    weather = 10 + 4 * np.sin(2 * np.pi * day) + slow
    T = pd.DataFrame(
        {f"T{j}": weather * (1 + 0.1 * j) + random.normal(0, 0.6, n) for j in range(n_sensors)}, index=index
    )
    F = [2.0, 3.0, 3.3, 5.0] * (1 - 0.001 * weather[:, np.newaxis]) * (1 + random.normal(0, 0.003, (n, 4)))
    return T.join(pd.DataFrame(F, index, MODES))


def fitted(records, **settings):
    monitor = Monitor(MahalanobisDetector(), targets=MODES, **settings)
    return quietly(monitor.fit, records[: N_BASELINE * PER_DAY])


@pytest.fixture(scope="module")
def records():
    return bridge()


@pytest.fixture(scope="module")
def monitor(records):
    return fitted(records)


def after_service(monitor, records, n_days=30):
    """The monitor after the days that follow the baseline; the last record closes the last of these."""
    monitor = copy.deepcopy(monitor)
    quietly(monitor.update, records[N_BASELINE * PER_DAY : (N_BASELINE + n_days) * PER_DAY + 1])
    return monitor


def late(records, day=ONSET):
    """Stamps from a day on."""
    return records.index[day * PER_DAY :]


def with_fault(records, kind):
    """Records with a fault from the onset on, and the columns concerned."""
    faulty, since = records.copy(), late(records)
    if kind == "dead":
        faulty.loc[since, "T1"] = np.nan
    elif kind == "stuck":
        faulty.loc[since, "T1"] = 11.5
    elif kind == "offset":
        faulty.loc[since, "T1"] += 3.0
    elif kind == "drift":
        faulty.loc[since, "T1"] += (since - since[0]) / pd.Timedelta(days=10)
    elif kind == "implausible":
        faulty.loc[since, "f4"] *= 1.4
        return faulty, ["f4"]
    elif kind == "swapped":
        faulty.loc[since, ["f2", "f3"]] = faulty.loc[since, ["f3", "f2"]].to_numpy()
        return faulty, ["f2", "f3"]
    return faulty, ["T1"]


def test_healthy_sensors_are_left_alone(monitor, records):
    served = after_service(monitor, records)
    assert served.faults_.empty
    pd.testing.assert_frame_equal(served.corrected_, records.loc[served.records_.index], check_freq=False)


@pytest.mark.one_case
@pytest.mark.parametrize("kind", ["dead", "stuck", "offset", "drift", "implausible", "swapped"])
def test_a_fault_is_named_dated_and_left_out(monitor, records, kind):
    faulty, columns = with_fault(records, kind)
    served = after_service(monitor, faulty, N_DAYS - 1 if kind == "drift" else 20)
    faults, onset = served.faults_, late(records)[0]
    assert faults["column"].tolist() == columns
    assert set(faults["kind"]) == {kind}
    assert faults["until"].isna().all()
    assert (abs(faults["since"] - onset) <= pd.Timedelta(days=20 if kind == "drift" else 1)).all()
    assert (faults["detected"] - onset <= pd.Timedelta(days=40 if kind == "drift" else 3)).all()
    kept = served.corrected_.loc[max(faults["detected"]) + pd.Timedelta("1D") :]
    if kind == "swapped":
        np.testing.assert_array_equal(kept[columns], records.loc[kept.index, columns])
    else:
        assert kept[columns].isna().all(axis=None)
    assert kept.drop(columns=columns).notna().all(axis=None)


@pytest.mark.one_case
@pytest.mark.parametrize("kind", ["dead", "stuck", "offset", "swapped"])
def test_a_repaired_sensor_comes_back(monitor, records, kind):
    faulty, columns = with_fault(records, kind)
    repaired = late(records, ONSET + 10)
    faulty.loc[repaired] = records.loc[repaired]
    served = after_service(monitor, faulty)
    faults = served.faults_
    assert faults["column"].tolist() == columns
    assert (abs(faults["until"] - repaired[0]) <= pd.Timedelta(days=2)).all()
    assert served.corrected_.iloc[-1].equals(records.loc[served.last_])


@pytest.mark.one_case
@pytest.mark.parametrize(
    "lost", [{"f1": 0.1}, {"f3": 0.1}, {"f1": 0.2, "f2": 0.02}, dict.fromkeys(["f1", "f2", "f3", "f4"], 0.1)]
)
def test_damage_is_not_taken_for_a_fault(monitor, records, lost):
    damaged = records.copy()
    for mode, share in lost.items():
        damaged.loc[late(records), mode] *= 1 - share
    served = after_service(monitor, damaged, 20)
    assert served.faults_.empty
    assert served.corrected_[MODES].equals(damaged.loc[served.records_.index, MODES])


@pytest.fixture(scope="module")
def four():
    """Records of four thermometers, of which T0 and T1 show nearly the same, and their monitor after a year."""
    random, truth = np.random.default_rng(1), bridge(4, n_days=365 + N_DAYS)
    for name, apart in (("T0", 0.2), ("T2", 8.0), ("T3", -6.0)):
        truth[name] = truth["T1"] + random.normal(apart, 0.6, len(truth))
    own = Monitor(MahalanobisDetector(), targets=MODES)
    own = quietly(own.fit, truth[: -N_DAYS * PER_DAY])
    return truth[-(N_BASELINE + N_DAYS) * PER_DAY :], own


def exchanged(records, *columns, day=ONSET):
    changed, columns = records.copy(), list(columns)
    changed.loc[late(records, day), columns] = records.loc[late(records, day), [*columns[1:], columns[0]]].to_numpy()
    return changed


@pytest.mark.parametrize("missing", [None, "T2"])
def test_exchanged_thermometers_are_named_and_put_back_in_place_until_they_are_again(four, missing):
    truth, own = four
    truth = truth.copy()
    truth.loc[late(truth, ONSET - 8), [missing] if missing else []] = np.nan
    truth.loc[late(truth)[1::9], "T1"] = np.nan
    changed = exchanged(exchanged(truth, "T1", "T3"), "T1", "T3", day=ONSET + 15)
    served, in_parts = after_service(own, changed), copy.deepcopy(own)
    for part in np.array_split(np.arange(N_BASELINE * PER_DAY, (N_BASELINE + 30) * PER_DAY + 1), 7):
        quietly(in_parts.update, changed.iloc[part])
    assert_same_history(served, in_parts)
    faults = served.faults_[served.faults_["kind"] != "dead"]
    assert faults[["column", "kind"]].to_numpy().tolist() == [["T1", "swapped"], ["T3", "swapped"]]
    assert "'T3'" in faults["detail"].iloc[0]
    for name, day in (("since", ONSET), ("until", ONSET + 15)):
        assert (faults[name] == late(truth, day)[0]).all()
    assert (faults["detected"] - faults["since"] <= pd.Timedelta(days=3)).all()
    assert served.corrected_[["T1", "T3"]].equals(truth.loc[served.records_.index, ["T1", "T3"]])


@pytest.mark.parametrize("case", ["twins", "three", "offset", "drift"])
def test_what_may_be_no_exchange_of_two_thermometers_is_not_named_as_one(four, case):
    truth, own = four
    changed, days = truth.copy(), (late(truth) - late(truth)[0]) / pd.Timedelta(days=1)
    if case == "offset":  # as far to the other side of T1 as it was
        changed.loc[late(truth), "T3"] += 12.0
    elif case == "drift":
        changed.loc[late(truth), "T3"] += 0.3 * days
    else:
        changed = exchanged(truth, *(["T0", "T1"] if case == "twins" else ["T1", "T3", "T2"]))
    faults = after_service(own, changed).faults_
    assert "swapped" not in set(faults["kind"])
    assert faults["column"].tolist() == ["T3"] or case in ("twins", "three")


@pytest.mark.nightly
@pytest.mark.parametrize("moved", [[6.0, -6.0, 20.0], [12.0, 12.0, 12.0]])
def test_where_most_thermometers_depart_none_is_left_out(monitor, records, moved):
    faulty = records.copy()
    faulty.loc[late(records), ["T0", "T1", "T2"]] += moved
    served = after_service(monitor, faulty)
    assert served.faults_.empty
    assert served.corrected_.equals(faulty.loc[served.records_.index])


@pytest.mark.one_case
@pytest.mark.parametrize("unit", ["degrees Fahrenheit", "kelvin"])
def test_temperatures_in_another_unit_than_the_baselines_are_refused(monitor, records, unit):
    twin, new, thermometers = copy.deepcopy(monitor), records[N_BASELINE * PER_DAY :][:20], ["T0", "T1", "T2"]
    wrong = new.copy()
    wrong[thermometers] = 1.8 * new[thermometers] + 32 if unit == "degrees Fahrenheit" else new[thermometers] + 273.15
    for batch in (wrong, wrong[:1]):
        with pytest.raises(ValueError, match=f"as in {unit}"):
            twin.update(batch)
    assert len(twin.records_) == 0
    twin.update(new)
    assert twin.last_ == new.index[-1]


@pytest.mark.nightly
def test_heat_and_a_thermometer_at_fault_are_no_other_unit(monitor, records):
    hot, faulty = records[N_BASELINE * PER_DAY :].copy(), records[N_BASELINE * PER_DAY :].copy()
    hot[["T0", "T1", "T2"]] += 9.0
    faulty["T1"] = 1.8 * faulty["T1"] + 32
    for batch in (hot, faulty):
        twin = copy.deepcopy(monitor)
        quietly(twin.update, batch)
        assert twin.last_ == batch.index[-1]


@pytest.mark.nightly
def test_of_two_thermometers_that_contradict_each_other_both_stay(monitor, records):
    """It is not known which is wrong: of two, or of two that are left."""
    two, left = bridge(2), records.copy()
    left.loc[late(records, N_BASELINE + 3), "T0"] = np.nan
    for faulty, own, kinds in ((two, fitted(two), []), (left, monitor, ["dead"])):
        faulty.loc[late(records), "T1"] += 3.0
        served = after_service(own, faulty)
        assert served.faults_["kind"].tolist() == kinds
        assert served.corrected_["T1"].equals(faulty.loc[served.records_.index, "T1"])


def test_a_reference_tells_which_thermometer_is_wrong_and_fills_it_on_days_of_the_records_time_zone():
    truth = bridge(2, zone="Europe/Brussels").rename(columns={"T1": "station"})
    own, onset, wrong = fitted(truth, reference=["station"]), late(truth), truth.copy()
    wrong.loc[onset, "T0"] += 3.0
    served = after_service(own, wrong)
    (fault,) = served.faults_.itertuples()
    assert (fault.column, fault.kind, str(fault.since.tz)) == ("T0", "offset", "Europe/Brussels")
    assert abs(fault.since.normalize() - onset[0].normalize()) <= pd.Timedelta(days=1)
    seen = served.corrected_["T0"][-60:]
    assert (seen - truth.loc[seen.index, "T0"]).abs().mean() < 1.5
    assert "station" not in served.corrected_
    assert "station" in served.records_
    assert after_service(own, truth.assign(T0=np.nan), 5).corrected_["T0"].notna().all()


@pytest.mark.nightly
def test_one_thermometer_can_still_be_dead_or_stuck():
    alone = bridge(1)
    own = fitted(alone)
    for value, kind in ((np.nan, "dead"), (9.0, "stuck")):
        alone.loc[late(alone), "T0"] = value
        assert after_service(own, alone).faults_["kind"].tolist() == [kind]


def test_where_two_thermometers_are_left_neither_is_blamed(records):
    random, near = np.random.default_rng(0), records.copy()
    near["T1"] = near["T0"] + random.normal(0, 0.1, len(near))
    near["T2"] = near["T0"] + np.repeat(random.normal(0, 3.0, len(near) // PER_DAY), PER_DAY)
    own = fitted(near)
    near.loc[late(near), "T1"] = 11.5
    assert after_service(own, near, N_DAYS - 1).faults_["column"].tolist() == ["T1"]


@pytest.mark.parametrize("n_days", [3, 8])
def test_an_offset_that_is_over_ends_and_keeps_its_first_day(monitor, records, n_days):
    faulty = records.copy()
    faulty.loc[late(records)[: n_days * PER_DAY], "T1"] += 2.0
    (fault,) = after_service(monitor, faulty, N_DAYS - 1).faults_.itertuples()
    assert fault.column == "T1"
    assert fault.since <= fault.detected < fault.until <= late(records, ONSET + n_days + 5)[0]


def test_outages_of_the_logger_and_empty_days_are_no_faults(monitor, records):
    outage = late(records)[: 10 * PER_DAY]
    empty = records.copy()
    empty.loc[outage] = np.nan
    assert after_service(monitor, empty, 22).faults_.empty
    assert after_service(monitor, records.drop(outage), 22).faults_.empty
