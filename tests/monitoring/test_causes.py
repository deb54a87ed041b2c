"""Every alarm has a cause, and one cause is one event: outages, sensors at fault, slow and known damage."""

import copy

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.preprocessing import BlockedKFold, ExponentialMeans
from tests.monitoring.nightly import quietly

PER_DAY, MODES = 4, ["f1", "f2", "f3"]
N_BASELINE = 365 * PER_DAY
pytestmark = pytest.mark.filterwarnings("ignore:.*(few-records|doubtful-values|not-evaluated)")


def campaign(n, seed=5):
    """Six-hourly temperatures to a tenth of a degree, and frequencies that follow them, some with two days of delay."""
    random = np.random.default_rng(seed)
    t = np.arange(n)
    weather = pd.Series(random.normal(0, 3, n)).ewm(halflife=8).mean().to_numpy() * 2
    air = 10 - 12 * np.cos(2 * np.pi * t / 1461) + 4 * np.sin(np.pi * t / 2) + weather
    slow = pd.Series(air).ewm(halflife=8).mean().to_numpy()
    noise = random.normal(0, 0.002, (n, 3))
    F = np.array([2.0, 3.0, 5.0]) * (1 - 1e-3 * (air[:, None] * [1, 0.5, 0.2] + slow[:, None] * [1, 1.5, 2]) + noise)
    T = air[:, np.newaxis] + [0, 1, -1] + random.normal(0, 0.3, (n, 3))
    stamps = pd.date_range("2025-01-01", periods=n, freq="6h").as_unit("ns")
    return pd.DataFrame(np.hstack([T.round(1), F]), stamps, ["T1", "T2", "T3", *MODES])


ALL = campaign(N_BASELINE + 160 * PER_DAY)
SERVICE = ALL[N_BASELINE:]


@pytest.fixture(scope="module")
def fitted():
    regressor = make_pipeline(ExponentialMeans(half_lives=["2D"]), LinearRegression())
    detector = CompensatedDetector(MahalanobisDetector(), regressor, targets=MODES, window="1D", regimes=None)
    return quietly(Monitor(detector, false_alarms_per_year=0.1, watch_per_year=2).fit, ALL[:N_BASELINE])


def served(monitor, records, parts=1):
    one = copy.deepcopy(monitor)
    for rows in np.array_split(np.arange(len(records)), parts):
        one.update(records.iloc[rows])
    return one


def lowered(share, first=40 * PER_DAY, records=SERVICE):
    """Records whose first two modes fall by a share from a row on, or by shares of the rows."""
    changed, since = records.copy(), np.arange(len(records)) >= first
    changed[["f1", "f2"]] *= (1 - since * share)[:, np.newaxis]
    return changed


@pytest.mark.nightly
def test_an_outage_is_not_damage_and_records_after_it_say_so(fitted):
    before = served(fitted, SERVICE[: 30 * PER_DAY])
    for hours in (24, 48, 120):
        back = SERVICE.index[30 * PER_DAY] + pd.Timedelta(hours=hours)
        later = SERVICE[(SERVICE.index >= back) & (SERVICE.index < back + pd.Timedelta("15D"))]
        one = served(before, later)
        assert "damage" not in set(one.events_.loc[one.events_["start"] >= back, "kind"])
        answers = one.evaluations_.loc[back:]
        unknown = answers["state"] == "not evaluated"
        assert unknown[unknown].index.max() - back < pd.Timedelta("5D")
        assert answers["reason"][unknown].str.contains("since the outage of").all()


@pytest.fixture(scope="module")
def failing():
    """Records in which a thermometer holds its value, two modes are exchanged for a time, and the logger is silent."""
    records = SERVICE.copy()
    records.iloc[100:, 0] = records.iloc[100, 0]
    records.iloc[161:221, [3, 4]] = records.iloc[161:221, [4, 3]].to_numpy()
    return lowered(0.01, 400, records.drop(records.index[240:260]))


@pytest.mark.nightly
def test_values_since_a_fault_began_are_left_out_and_no_alarm_rests_on_them(fitted, failing):
    one = served(fitted, failing)
    faults = one.faults_.set_index("column")
    assert faults["kind"].to_dict() == {"T1": "stuck", "f1": "swapped", "f2": "swapped"}
    assert faults.loc["T1", "since"] == failing.index[100]
    assert (faults.loc[["f1", "f2"], "since"] == failing.index[161]).all()
    assert (faults.loc[["f1", "f2"], "until"] == SERVICE.index[221]).all()
    assert one.corrected_.loc[failing.index[100] :, "T1"].isna().all()
    np.testing.assert_array_equal(one.corrected_.iloc[161:221, [3, 4]], SERVICE.iloc[161:221, [3, 4]])
    events = one.events_
    begin, end = failing.index[[100, 230]]
    assert not ((events["kind"] == "damage") & (events["start"] >= begin) & (events["start"] < end)).any()
    fault = events[events["kind"] == "fault"].iloc[0]
    assert "f1" in fault["modes"]
    assert (one.evaluations_.loc[fault["start"] : fault["peak_time"], "state"] != "alarm").all()


@pytest.mark.nightly
def test_a_loss_that_creeps_is_a_drift_which_becomes_damage_under_the_same_number(fitted):
    n = len(SERVICE)
    one = served(fitted, lowered(np.maximum(np.arange(n) - 100, 0) / n * 0.008, 100), parts=10)
    states = one.evaluations_["state"]
    assert states[states == "drift"].index[0] < states[states == "alarm"].index[0]
    assert one.status(one.last_).state == "alarm"
    (event,) = one.events_[one.events_["kind"] == "damage"].itertuples()
    assert event.modes.startswith(("f1", "f2"))
    said = [change["detail"].partition(":")[0] for change in one.transitions() if change["event"] == event.Index]
    assert "damage, was drift" in said
    healthy = served(fitted, SERVICE)
    assert not (healthy.weeks_["level"] > 1).any()


def test_a_mean_of_a_month_is_compared_with_months_that_the_regression_had_not_learned(fitted):
    detector = clone(fitted.detector).set_params(cv=BlockedKFold(block="30D"))
    months = quietly(Monitor(detector, false_alarms_per_year=0.1).fit, ALL[:N_BASELINE])
    own, other = (served(one, SERVICE[: 45 * PER_DAY]).weeks_["level"] for one in (fitted, months))
    assert own.notna().sum() >= 2
    np.testing.assert_allclose(own, other)


@pytest.mark.nightly
def test_damage_that_comes_and_goes_is_one_event_and_then_known_until_it_grows(fitted):
    records = SERVICE.copy()
    for first in range(160, 460, 60):  # ten days of each fifteen
        records.iloc[first : first + 40] = lowered(0.01).iloc[first : first + 40]
    one = served(fitted, records[:460])
    (event,) = one.events_[one.events_["kind"] == "damage"].itertuples()
    assert event.n_times >= 3
    assert event.start < SERVICE.index[170]
    one.acknowledge(event.Index, harmless=False, note="crack")
    assert one.status(one.last_).state == "known damage"
    assert set(one.update(lowered(0.01)[460:520])["state"]) <= {"known damage", "watch"}
    assert {open_["acknowledged"] for open_ in one.status(one.last_).events if open_["kind"] == "damage"} == {True}
    one.update(lowered(0.04)[520:640])
    assert one.status(one.last_).state in ("drift", "alarm")
    assert not all(open_["acknowledged"] for open_ in one.status(one.last_).events)  # an answer is wanted again


@pytest.mark.nightly
def test_damage_that_is_known_soon_is_no_drift_while_its_mean_fills(fitted):
    """The mean of 30 days goes on to rise after an answer that came sooner."""
    onset, answer = 160, 225
    changed = pd.concat([SERVICE[:onset], lowered(0.01)[onset:440]])
    one = served(fitted, changed[:answer])
    (event,) = one.events_[one.events_["kind"] == "damage"].itertuples()
    assert changed.index[answer] - event.start < pd.Timedelta("25D")
    one.acknowledge(event.Index, harmless=False, note="crack")
    assert set(one.update(changed[answer:])["state"]) <= {"known damage", "watch", "not evaluated"}
