"""Two levels by their false alarms a year, and records that are taken back."""

import copy

import numpy as np
import pandas as pd
import pytest

from skthermo.monitoring import load_monitor
from tests.monitoring.nightly import DAMAGED, FIRST, fitted_monitor, quietly
from tests.monitoring.test_status import replayed

LEVELS = {"healthy": 0, "not evaluated": 0, "watch": 1, "alarm": 2}
pytestmark = pytest.mark.filterwarnings("ignore:.*not-evaluated")


@pytest.fixture(scope="module")
def two_levels(records):
    return fitted_monitor(records, watch_per_year=12)


@pytest.fixture(scope="module")
def whole(two_levels, records):
    """The monitor with two levels and its answers, after the truss was damaged for weeks."""
    return served(two_levels, records[FIRST + 10 : DAMAGED + 14])


def served(monitor, new):
    monitor = copy.deepcopy(monitor)
    return monitor, quietly(monitor.update, new)


def lowered(records, share, n_days=20):
    """Healthy records of the first weeks in service, with all responses lower by a share."""
    new = records[FIRST : FIRST + n_days].copy()
    new[[name for name in new if name.startswith("f")]] *= 1 - share
    return new


@pytest.mark.nightly
def test_the_lower_level_changes_no_alarm(truss_monitor, two_levels, whole, records):
    assert two_levels.threshold_ == truss_monitor.threshold_
    assert truss_monitor.watch_threshold_ is None
    assert max(two_levels.clear_threshold_, two_levels.watch_threshold_) < two_levels.threshold_
    (one, answers), (two, with_watch) = served(truss_monitor, records[FIRST + 10 : DAMAGED + 14]), whole
    assert (with_watch["state"] == "alarm").equals(answers["state"] == "alarm")
    pd.testing.assert_series_equal(with_watch["index"], answers["index"])
    events = two.events_[two.events_["kind"] != "watch"].reset_index(drop=True)
    pd.testing.assert_frame_equal(events, one.events_.reset_index(drop=True))
    assert "alarm" in set(with_watch["state"])
    two, with_watch = served(two_levels, lowered(records, 0.005))
    is_watch = with_watch["state"] == "watch"
    assert is_watch.any()
    assert with_watch.loc[is_watch, "event"].isin(two.events_.index[two.events_["kind"] == "watch"]).all()


def test_a_watch_becomes_an_alarm_and_does_not_stand_beside_it(whole):
    monitor, _ = whole
    events = monitor.events_
    watch = events[events["kind"] == "watch"]
    for _, alarm in events[events["kind"] == "damage"].iterrows():
        assert not ((watch["start"] <= alarm["start"]) & ~(watch["end"] <= alarm["start"])).any()
    status = monitor.status(monitor.last_)
    assert status.state == "alarm"
    assert status.as_dict()["watch_threshold"] == monitor.watch_threshold_
    assert [one["kind"] for one in status.events] == ["damage"]


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3))
def test_more_change_never_lowers_the_level(two_levels, records, seed):
    shares = sorted([*np.random.default_rng(seed).uniform(0, 0.05, 3), 0.01, 0.1])
    ends = [served(two_levels, lowered(records, share))[0] for share in shares]
    levels = [LEVELS[monitor.status(monitor.last_).state] for monitor in ends]
    assert levels == sorted(levels)
    assert levels[-1] == 2


@pytest.mark.nightly
def test_a_watch_that_is_silent_is_not_evaluated_and_a_higher_rate_is_expected(two_levels, records):
    tried = (served(two_levels, lowered(records, share))[0] for share in np.arange(0.002, 0.02, 0.001))
    monitor = next(one for one in tried if one.status(one.last_).state == "watch")
    assert monitor.status(monitor.last_ + pd.Timedelta("30D")).state == "not evaluated"
    assert "watch: opens above" in monitor.summary()
    with pytest.raises(ValueError, match="watch_per_year"):
        fitted_monitor(records, watch_per_year=1)
    many = fitted_monitor(records, watch_per_year=5000)
    assert many.watch_threshold_ <= monitor.watch_threshold_


def assert_as_if_never_come(monitor, other):
    for name in ("evaluations_", "events_", "days_", "faults_", "records_", "corrected_"):
        pd.testing.assert_frame_equal(getattr(monitor, name), getattr(other, name), check_exact=True, check_freq=False)
    assert (monitor.status(monitor.last_).state, monitor.last_) == (other.status(other.last_).state, other.last_)
    n_taken = [one.counts_["n_records"] - one.counts_["n_too_late"] for one in (monitor, other)]
    assert n_taken[0] == n_taken[1]  # true records that came meanwhile were refused


@pytest.mark.nightly
@pytest.mark.parametrize("ahead", ["3653D", "5D"])
def test_discarded_records_are_as_if_they_had_never_come(truss_monitor, records, ahead, tmp_path):
    new = records[FIRST : FIRST + 60]
    wrong = new[40:50].set_axis(new.index[40:50] + pd.Timedelta(ahead)) * [1, 1, 1, *[0.97] * (new.shape[1] - 3)]
    monitor, _ = served(truss_monitor, new[:30])
    monitor.update(wrong, confirm=True)
    assert monitor.last_ == wrong.index[-1]
    quietly(monitor.update, new[30:32])  # true stamps are too late, or other days of the same time
    monitor.save(tmp_path / "monitor.joblib")
    monitor = load_monitor(tmp_path / "monitor.joblib")
    assert monitor.discard(wrong.index[0], wrong.index[-1]) == len(wrong)
    n_known = len(monitor.transitions())
    assert monitor.transitions()[-1]["what"] in ("discarded", "withdrawn")
    for start, stop in ((30, 36), (36, 60)):
        monitor.update(new[start:stop])
    other, _ = served(truss_monitor, new)
    assert_as_if_never_come(monitor, other)
    assert len(monitor.transitions()) >= n_known
    events, _ = replayed(monitor.transitions())
    assert events == set(monitor.events_.index[monitor.events_["end"].isna()])


def test_all_records_since_the_baseline_may_be_discarded_and_those_of_the_baseline_not(truss_monitor, records):
    before, _ = served(truss_monitor, records[FIRST : FIRST + 5])
    later = records[FIRST + 5 : DAMAGED + 6].copy()
    later.iloc[5:, 0] = later.iloc[5, 0]  # a thermometer that is stuck
    monitor, _ = served(before, later)
    assert monitor.status(monitor.last_).state == "alarm"
    assert len(monitor.faults_) == 1
    assert monitor.discard(records.index[FIRST + 5]) == DAMAGED - FIRST + 1
    assert_as_if_never_come(monitor, before)
    assert "put back" in {one["what"] for one in monitor.transitions()}
    assert monitor.discard(records.index[FIRST]) == 5
    assert monitor.status(monitor.last_).state == "not evaluated"
    assert monitor.last_ == records.index[FIRST - 1]
    for wrong in ({"start": records.index[5], "end": records.index[9]}, {"start": "2100-01-01"}, {"start": "soon"}):
        with pytest.raises(ValueError, match="expected"):
            monitor.discard(**wrong)
