"""Events and states of damage indices by the rule of persistence, release and hold."""

import copy
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator

from skthermo.monitoring import Monitor

RECORDED = Path(__file__).parent / "decisions"
LEVELS = {  # threshold, release and how often it was in alarm, of monitors of version 0.2.0
    "truss": (3.097216097929494, 2.698081871551195, 4),
    "girder": (2.68614313780444, 2.5081548920083763, 7),
    "z24": (4.46787049870998, 3.5971570058729503, 2),
    "kw51": (1.7780440805530546, 1.676511560763697, 2),
}
pytestmark = pytest.mark.filterwarnings("ignore:.*(few-records|doubtful-values|undetected-changes|not-evaluated)")


class GivenIndex(BaseEstimator):
    """A detector of records that are damage indices."""

    def fit(self, X, y=None):
        self.baseline_index_ = X["f"].to_numpy()
        return self

    def score_samples(self, X):
        return -X["f"].to_numpy()


@cache
def fitted(start, step, persistence):
    """A monitor of damage indices before some time."""
    rng, n = np.random.default_rng(0), max(100, int(pd.Timedelta("14D") / step))
    before = pd.DataFrame({"f": rng.uniform(1, 2, n)}, pd.date_range(end=start - step, periods=n, freq=step))
    return Monitor(GivenIndex(), targets=["f"], sensors=False, persistence=persistence).fit(before)


def after(indices, threshold=3.0, release=2.0, persistence=3, n_batches=1):
    """A monitor with given levels after a series of damage indices, and its answers."""
    first, second = indices.index[:2]
    monitor = copy.deepcopy(fitted(first, second - first, persistence))
    monitor.threshold_, monitor.clear_threshold_ = threshold, release
    parts = np.array_split(np.arange(len(indices)), n_batches)
    return monitor, pd.concat([monitor.update(indices.iloc[rows].to_frame("f")) for rows in parts])


@pytest.mark.parametrize("name", LEVELS)
def test_the_same_indices_give_the_states_and_events_of_version_0_2(name):
    recorded = pd.read_csv(RECORDED / f"{name}.csv.gz", index_col="time", parse_dates=True)
    threshold, release, n_events = LEVELS[name]
    monitor, answers = after(recorded["index"], threshold, release, n_batches=len(recorded) // 500 + 1)
    assert (answers["state"] == recorded["state"]).mean() > 0.999
    assert monitor.events_["n_times"].sum() == n_events


def answers_to(indices, **options):
    """The same of damage indices every six hours."""
    stamps = pd.date_range("2026-01-01", periods=len(indices), freq="6h")
    return after(pd.Series(np.asarray(indices, dtype=float), stamps), **options)


def test_three_of_five_records_above_the_threshold_open_an_event_and_two_do_not():
    quiet = [1.0] * 8
    for above, n_events in (([5, 1, 5, 1, 1], 0), ([5, 1, 5, 1, 5], 1), ([5, 5, 5], 1), ([9, np.nan, 9, np.nan, 9], 1)):
        monitor, answers = answers_to([*quiet, *above, *quiet])
        assert len(monitor.events_) == n_events
        if n_events:
            first = answers.index[len(quiet) + len(above) - 1]
            assert monitor.events_["start"].tolist() == [first]
    monitor, _ = answers_to([*quiet, 5, *quiet], persistence=1)
    assert len(monitor.events_) == 1


def alarms_by_the_rule(indices, number, among, threshold=3.0, release=2.0, a_day=4):
    """Whether an event is open after each record, one record after the other."""
    last, is_open, quiet_since, found = [0.0] * among, False, None, []
    for at, index in enumerate(indices):
        if not np.isnan(index):
            last = [*last[1:], index]
            is_quiet = sum(one > release for one in last) < number
            quiet_since = (at if quiet_since is None else quiet_since) if is_quiet else None
            is_over = is_quiet and at - quiet_since >= a_day
            is_open = sum(one > threshold for one in last) >= number or (is_open and not is_over)
        found.append(is_open)
    return np.array(found)


@pytest.mark.parametrize("rule", [(1, 1), (1, 4), (3, 5), (4, 6), (5, 6), (6, 6)])
def test_an_event_opens_by_a_number_of_the_last_records_that_were_evaluated(rule):
    rng = np.random.default_rng(6)
    bursts = np.repeat(rng.uniform(0.5, 4.5, 60), rng.integers(1, 16, 60))
    indices = np.maximum(bursts + rng.normal(0, 0.7, len(bursts)), 0.0)
    indices[rng.random(len(indices)) < 0.2] = np.nan
    _, answers = answers_to(indices, persistence=rule)
    expected = alarms_by_the_rule(indices, *rule) & ~np.isnan(indices)
    np.testing.assert_array_equal(answers["state"] == "alarm", expected)
    assert 0.05 < expected.mean() < 0.8


def test_a_number_of_records_is_that_many_of_twice_as_many_less_one():
    indices = np.random.default_rng(3).uniform(0, 5, 300)
    (one, answers), (two, same) = (answers_to(indices, persistence=rule) for rule in (3, (3, 5)))
    pd.testing.assert_frame_equal(answers, same)
    pd.testing.assert_frame_equal(one.events_, two.events_)
    assert one.smallest_changes_.as_dict() == two.smallest_changes_.as_dict()


def test_an_event_closes_a_day_after_its_levels_have_come_within_the_release():
    monitor, answers = answers_to([1, 1, 1, 5, 5, 5, *[2.5] * 20, *[1] * 10])
    event = monitor.events_.loc[1]
    within = answers.index[26 + 2]  # the third of five records
    assert event["end"] == within + pd.Timedelta("1D")
    assert event["n_alarms"] == (answers["state"] == "alarm").sum()
    assert (event["peak"], event["peak_time"]) == (5.0, answers.index[5])


def test_records_without_an_index_neither_open_nor_close_an_event():
    monitor, answers = answers_to([1, 1, 5, 5, 5, *[np.nan] * 40])
    assert set(answers["state"][5:]) == {"not evaluated"}
    assert monitor.events_["end"].isna().all()
    assert monitor.status(monitor.last_).state == "alarm"
