"""Faults of sensors are named and dated, damage is not masked, and repaired sensors come back."""

import pickle

import numpy as np
import pandas as pd
import pytest

from skthermo.monitoring.sensors import SensorWatch

N_BASELINE, N_DAYS, PER_DAY = 200, 50, 4
ONSET = N_BASELINE + 10


def bridge(n_sensors=3, zone=None, seed=0):
    """Records of a bridge whose thermometers follow one weather, each with its own noise."""
    random = np.random.default_rng(seed)
    n = (N_BASELINE + N_DAYS) * PER_DAY
    index = pd.date_range("2026-01-01", periods=n, freq=pd.Timedelta(days=1) / PER_DAY, tz=zone)
    day = np.arange(n) / PER_DAY
    slow = np.repeat(np.convolve(random.normal(0, 2, n // PER_DAY + 6), np.ones(7) / 2, "valid"), PER_DAY)
    weather = 10 + 4 * np.sin(2 * np.pi * day) + slow
    T = pd.DataFrame(
        {f"T{j}": weather * (1 + 0.1 * j) + random.normal(0, 0.6, n) for j in range(n_sensors)}, index=index
    )
    F = [2.0, 3.0, 3.3, 5.0] * (1 - 0.001 * weather[:, np.newaxis]) * (1 + random.normal(0, 0.003, (n, 4)))
    return T, pd.DataFrame(F, index=index, columns=["f1", "f2", "f3", "f4"])


@pytest.fixture(scope="module")
def records():
    return bridge()


@pytest.fixture(scope="module")
def watch(records):
    return SensorWatch.of(*(table.iloc[: N_BASELINE * PER_DAY] for table in records))


def service(watch, T, F, n_days=30):
    """The state after the days that follow the baseline."""
    state = watch.start()
    for day in range(N_BASELINE, N_BASELINE + n_days):
        rows = slice(day * PER_DAY, (day + 1) * PER_DAY)
        state = watch.advance(state, T.iloc[rows], F.iloc[rows])
    return state


def masked(watch, state, T, F):
    """Temperatures and responses without what sensors at fault show."""
    seen = watch.masked(state, T, F)
    return seen.T, seen.F


def after(table, n_days=ONSET):
    """Rows from a day on."""
    return table.index[n_days * PER_DAY :]


def with_fault(records, kind):
    """Records with a fault from the onset on, and the columns concerned."""
    T, F = (table.copy() for table in records)
    late = after(T)
    if kind == "dead":
        T.loc[late, "T1"] = np.nan
    elif kind == "stuck":
        T.loc[late, "T1"] = 11.5
    elif kind == "offset":
        T.loc[late, "T1"] += 3.0
    elif kind == "drift":
        T.loc[late, "T1"] += (late - late[0]) / pd.Timedelta(days=10)
    elif kind == "implausible":
        F.loc[late, "f4"] *= 1.4
        return T, F, ["f4"]
    elif kind == "swapped":
        F.loc[late, ["f2", "f3"]] = F.loc[late, ["f3", "f2"]].to_numpy()
        return T, F, ["f2", "f3"]
    return T, F, ["T1"]


def test_healthy_sensors_are_left_alone(watch, records):
    state = service(watch, *records)
    assert watch.faults(state).empty
    for kept, given in zip(masked(watch, state, *records), records, strict=True):
        pd.testing.assert_frame_equal(kept, given)


@pytest.mark.parametrize("kind", ["dead", "stuck", "offset", "drift", "implausible", "swapped"])
def test_a_fault_is_named_dated_and_left_out(watch, records, kind):
    T, F, columns = with_fault(records, kind)
    state = service(watch, T, F, N_DAYS if kind == "drift" else 30)
    faults = watch.faults(state)
    assert faults["column"].tolist() == columns
    assert set(faults["kind"]) == {kind}
    assert faults["until"].isna().all()
    onset = after(T)[0]
    assert (abs(faults["since"] - onset) <= pd.Timedelta(days=20 if kind == "drift" else 1)).all()
    assert (faults["detected"] - onset <= pd.Timedelta(days=40 if kind == "drift" else 3)).all()
    kept = pd.concat(masked(watch, state, T, F), axis=1).loc[after(T, ONSET + 5)]
    if kind == "swapped":
        np.testing.assert_array_equal(kept[columns], records[1].loc[kept.index, columns])
    else:
        assert kept[columns].isna().all(axis=None)
    assert kept.drop(columns=columns).notna().all(axis=None)


@pytest.mark.one_case
@pytest.mark.parametrize("kind", ["dead", "stuck", "offset", "swapped"])
def test_a_repaired_sensor_comes_back(watch, records, kind):
    T, F, columns = with_fault(records, kind)
    repaired = after(T, ONSET + 10)
    T.loc[repaired], F.loc[repaired] = (table.loc[repaired] for table in records)
    state = service(watch, T, F)
    faults = watch.faults(state)
    assert faults["column"].tolist() == columns
    assert (abs(faults["until"] - repaired[0]) <= pd.Timedelta(days=2)).all()
    kept = pd.concat(masked(watch, state, *records), axis=1)
    pd.testing.assert_frame_equal(kept, pd.concat(records, axis=1))


@pytest.mark.one_case
@pytest.mark.parametrize(
    "lost", [{"f1": 0.1}, {"f3": 0.1}, {"f1": 0.2, "f2": 0.02}, dict.fromkeys(["f1", "f2", "f3", "f4"], 0.1)]
)
def test_damage_is_not_taken_for_a_fault(watch, records, lost):
    T, F = records[0], records[1].copy()
    for mode, share in lost.items():
        F.loc[after(F), mode] *= 1 - share
    state = service(watch, T, F)
    assert watch.faults(state).empty
    pd.testing.assert_frame_equal(masked(watch, state, T, F)[1], F)


@pytest.mark.one_case
@pytest.mark.parametrize("moved", [[6.0, -6.0, 20.0], [-6.0, 20.0, 20.0], [25.0, 25.0, 25.0]])
def test_where_most_thermometers_depart_none_is_left_out(watch, records, moved):
    T = records[0].copy()
    T.loc[after(T), ["T0", "T1", "T2"]] += moved
    state = service(watch, T, records[1], 30)
    assert set(watch.faults(state)["kind"]) <= {"disagree"}
    pd.testing.assert_frame_equal(masked(watch, state, T, records[1])[0], T)


def test_two_thermometers_disagree_and_both_stay():
    T, F = bridge(2)
    watch = SensorWatch.of(T.iloc[: N_BASELINE * PER_DAY], F.iloc[: N_BASELINE * PER_DAY])
    T.loc[after(T), "T1"] += 3.0
    state = service(watch, T, F)
    faults = watch.faults(state)
    assert set(faults["column"]) == {"T0", "T1"}
    assert set(faults["kind"]) == {"disagree"}
    pd.testing.assert_frame_equal(masked(watch, state, T, F)[0], T)


def test_two_that_are_left_disagree(watch, records):
    T = records[0].copy()
    T.loc[after(T, N_BASELINE + 3), "T0"] = np.nan
    T.loc[after(T), "T1"] += 3.0
    state = service(watch, T, records[1])
    faults = watch.faults(state)
    assert faults.groupby("kind")["column"].apply(sorted).to_dict() == {"dead": ["T0"], "disagree": ["T1", "T2"]}
    assert masked(watch, state, T, records[1])[0]["T1"].equals(T["T1"])


def test_one_thermometer_can_still_be_dead_or_stuck():
    T, F = bridge(1)
    watch = SensorWatch.of(T.iloc[: N_BASELINE * PER_DAY], F.iloc[: N_BASELINE * PER_DAY])
    T.loc[after(T), "T0"] = np.nan
    assert watch.faults(service(watch, T, F))["kind"].tolist() == ["dead"]
    T.loc[after(T), "T0"] = 9.0
    assert watch.faults(service(watch, T, F))["kind"].tolist() == ["stuck"]


def test_lags_of_a_thermometer_are_left_out_with_it(watch, records):
    T, F, _ = with_fault(records, "offset")
    lagged = pd.concat([T, T.shift(1).add_suffix("_lag1")], axis=1).bfill()
    both = SensorWatch.of(lagged.iloc[: N_BASELINE * PER_DAY], F.iloc[: N_BASELINE * PER_DAY])
    state = service(both, lagged, F, 30)
    assert both.faults(state)["column"].tolist() == ["T1"]
    late = masked(both, state, lagged, F)[0].loc[after(T)]
    assert late.columns[late.isna().all()].tolist() == ["T1", "T1_lag1"]


def test_what_cannot_be_is_left_out_at_once(watch, records):
    T, F = (table.copy() for table in records)
    row = T.index[-1]
    T.loc[row, "T2"], F.loc[row, "f1"] = -999.0, 20.0
    kept = pd.concat(masked(watch, watch.start(), T, F), axis=1)
    assert kept.loc[row].isna().sum() == 2
    assert kept.isna().sum().sum() == 2


def test_outages_of_the_logger_and_empty_days_are_no_faults(watch, records):
    T, F = (table.copy() for table in records)
    outage = slice(T.index[ONSET * PER_DAY], T.index[(ONSET + 10) * PER_DAY])
    T.loc[outage], F.loc[outage] = np.nan, np.nan
    state = service(watch, T, F)
    assert watch.faults(state).empty
    assert watch.advance(state, T.iloc[:0], F.iloc[:0]) is state


def test_states_are_immutable_bounded_and_can_be_saved(watch, records):
    T, F, _ = with_fault(records, "offset")
    first = service(watch, T, F, 20)
    before = pickle.dumps(first)
    again = service(watch, T, F)
    assert pickle.dumps(first) == before
    assert len(pickle.dumps(again)) < 4 * len(before)
    restored = pickle.loads(pickle.dumps((watch, first)))
    for day in range(N_BASELINE + 20, N_BASELINE + 30):
        rows = slice(day * PER_DAY, (day + 1) * PER_DAY)
        restored = restored[0], restored[0].advance(restored[1], T.iloc[rows], F.iloc[rows])
    pd.testing.assert_frame_equal(restored[0].faults(restored[1]), watch.faults(again))


def test_days_are_those_of_the_records_time_zone():
    T, F, _ = with_fault(bridge(zone="Europe/Brussels"), "offset")
    watch = SensorWatch.of(T.iloc[: N_BASELINE * PER_DAY], F.iloc[: N_BASELINE * PER_DAY])
    faults = watch.faults(service(watch, T, F))
    assert faults["column"].tolist() == ["T1"]
    assert str(faults["since"].dt.tz) == "Europe/Brussels"
    assert abs(faults["since"][0] - after(T)[0]) <= pd.Timedelta(days=1)
