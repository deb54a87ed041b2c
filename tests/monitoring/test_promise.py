"""Events of a damage index, and promises of their number in a year."""

import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.monitoring._promise import EventRule, EventState, find_events, promised_rule

DAY = pd.Timedelta("1D")


def stamps(n, step="1D", start="2025-01-01"):
    return pd.date_range(start, periods=n, freq=step)


def chi(random, shape, n_modes=6):
    """Damage indices of independent records of normally distributed modes."""
    return np.sqrt(random.chisquare(n_modes, shape))


def plain_events(index, times, rule):
    """Whether an event is open after each record, one after the other."""
    is_open, quiet_since, after = False, None, []
    for value, time in zip(index, times, strict=True):
        if value > rule.release:
            is_open, quiet_since = is_open or value > rule.threshold, None
        elif value <= rule.release:
            quiet_since = time if quiet_since is None else quiet_since
            is_open = is_open and time - quiet_since < rule.hold
        after.append(is_open)
    return after


series = st.lists(st.sampled_from([0.0, 1.0, 2.0, 3.0, np.nan]), max_size=40)
steps = st.lists(st.integers(1, 60), min_size=40, max_size=40)


@given(series, steps, st.lists(st.integers(0, 40), max_size=4), st.integers(0, 100))
@settings(max_examples=100, deadline=None)
def test_events_are_those_of_one_record_after_the_other_however_they_are_divided(index, hours, cuts, hold):
    index, rule = np.array(index, dtype=float), EventRule(2.5, 1.5, pd.Timedelta(hours=hold))
    times = pd.Timestamp("2025-01-01") + pd.to_timedelta(np.cumsum(hours)[: len(index)], unit="h")
    expected = plain_events(index, times, rule)
    state, after, ns = EventState(), [], times.as_unit("ns").asi8
    for part, at in zip(np.split(index, sorted(cuts)), np.split(ns, sorted(cuts)), strict=True):
        is_open, state = rule.follow(state, part, at)
        after.extend(is_open.tolist())
    assert after == expected
    events = find_events(index, times, rule)
    assert len(events) == np.count_nonzero(np.diff([False, *expected]) & np.array(expected, dtype=bool))
    assert (events["peak"] > rule.threshold).all()
    closed = events.dropna(subset="end")
    assert (closed["start"] < closed["end"]).all()
    assert len(events) - len(closed) == int(bool(expected) and expected[-1])


@given(st.integers(0, 2**31 - 1), st.floats(1.2, 3.0))
@settings(max_examples=50, deadline=None)
def test_the_number_of_events_is_that_of_excursions_with_a_higher_peak(seed, threshold):
    index, times = np.random.default_rng(seed).exponential(1, 300), stamps(300)
    excursions = find_events(index, times, EventRule(1.2, 1.2, DAY))
    events = find_events(index, times, EventRule(threshold, 1.2, DAY))
    assert len(events) == (excursions["peak"] > threshold).sum()


def test_silence_closes_no_event():
    index, times = np.array([0.0, 3.0, *[np.nan] * 20, 0.0, np.nan, 0.0]), stamps(25)
    events = find_events(index, times, EventRule(2.0, 1.0, DAY))
    assert events["end"].tolist() == [times[24]]
    assert find_events(index[:23], times[:23], EventRule(2.0, 1.0, DAY))["end"].isna().all()


def test_events_keep_the_time_zone():
    times = stamps(5).tz_localize("Europe/Brussels")
    events = find_events(np.array([3.0, 0, 0, 3, 0]), times, EventRule(2.0, 1.0, DAY))
    assert events["start"].tolist() == [times[0], times[3]]
    assert events["end"].isna().tolist() == [False, True]
    assert events["start"].dt.tz == events["end"].dt.tz == times.tz


@pytest.mark.nightly
@pytest.mark.parametrize("per_year", [0.5, 1.0, 12.0])
def test_a_healthy_year_has_as_many_events_as_promised_on_average(per_year):
    random, n, counts, promises = np.random.default_rng(0), 365, [], []
    for _ in range(40):
        promise = promised_rule(pd.Series(chi(random, n), stamps(n)), per_year)
        later = find_events(chi(random, 10 * n), stamps(10 * n), promise.rule)
        counts.append(len(later) / 10)
        promises.append((promise.lowest, promise.highest))
    assert 0.5 * per_year < np.mean(counts) < 1.5 * per_year
    assert promises[0][0] <= per_year <= promises[0][1]


@pytest.mark.nightly
def test_the_range_of_a_year_holds_nine_years_in_ten():
    random, n, within = np.random.default_rng(1), 365, []
    for _ in range(100):
        promise = promised_rule(pd.Series(chi(random, n), stamps(n)), 4.0)
        number = len(find_events(chi(random, n), stamps(n), promise.rule))
        within.append(promise.lowest <= number <= promise.highest)
    assert 0.85 < np.mean(within) <= 0.99


def test_fewer_alarms_need_a_higher_threshold():
    index = pd.Series(chi(np.random.default_rng(2), 730), stamps(730))
    thresholds = [promised_rule(index, rate).rule.threshold for rate in (30.0, 5.0, 1.0, 0.5)]
    assert thresholds == sorted(thresholds)
    assert thresholds[0] > promised_rule(index).rule.release


def test_as_many_alarms_as_excursions_come_from_their_order_alone():
    index = pd.Series(chi(np.random.default_rng(3), 365), stamps(365))
    promise = promised_rule(index, 30.0)
    events = find_events(index.to_numpy(), index.index, promise.rule)
    assert abs(len(events) - 30) <= 1


def test_gaps_and_records_that_are_not_evaluated_are_no_time_of_the_baseline():
    whole = pd.Series(chi(np.random.default_rng(4), 730), stamps(730))
    holes = whole.mask((whole.index > "2025-04-01") & (whole.index < "2025-10-01"))
    assert promised_rule(whole).n_years == pytest.approx(729 / 365.25)
    expected = (730 - holes.isna().sum()) / 365.25
    assert promised_rule(holes).n_years == pytest.approx(expected, abs=0.01)
    assert promised_rule(holes).rule == promised_rule(holes.dropna()).rule


def test_half_a_year_promises_nothing_for_the_other_half():
    index = pd.Series(chi(np.random.default_rng(5), 182), stamps(182))
    with pytest.warns(UserWarning, match=r"no record of 153 days of the year \(17 July to 16 December\)"):
        promise = promised_rule(index, 2.0)
    assert "17 July" in promise.unseen
    assert "not promised for 153 days" in str(promise)


@pytest.mark.filterwarnings("ignore:the baseline has no record of")
def test_a_threshold_far_beyond_the_baseline_is_said_to_be_one():
    index = pd.Series(chi(np.random.default_rng(6), 90), stamps(90))
    with pytest.warns(UserWarning, match="1 false alarm a year, and the baseline is 0.24 years long: .* extrapolated"):
        promise = promised_rule(index, 1.0)
    assert promise.rule.threshold > index.max()


def test_more_alarms_than_excursions_are_refused():
    index = pd.Series(chi(np.random.default_rng(7), 365), stamps(365))
    with pytest.raises(ValueError, match=r"false_alarms_per_year is 500, .* only \d+ excursions"):
        promised_rule(index, 500.0)
    with pytest.raises(ValueError, match="0 baseline records have a damage index, 0 of them"):
        promised_rule(index * np.nan)


def test_a_day_that_was_no_healthy_one_is_named():
    index = pd.Series(chi(np.random.default_rng(8), 365), stamps(365))
    spoilt = index.copy()
    spoilt.iloc[100] = 30.0
    with pytest.warns(UserWarning, match=r"highest excursion of the baseline, 2025-04-11 00:00:00, .* index 30, next"):
        raised = promised_rule(spoilt)
    assert raised.rule.threshold > 2 * promised_rule(index).rule.threshold


def test_few_healthy_baselines_are_said_to_have_such_a_day():
    random, told = np.random.default_rng(9), 0
    for _ in range(80):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            promised_rule(pd.Series(chi(random, 365), stamps(365)))
        told += len(caught)
    assert told <= 4


def test_one_is_singular():
    index = pd.Series(chi(np.random.default_rng(9), 366), stamps(366))
    assert str(promised_rule(index)).startswith("1 false alarm a year")
    assert str(promised_rule(index)).endswith("in 1 year of baseline")
    assert str(promised_rule(index, 2.0)).startswith("2 false alarms a year")
