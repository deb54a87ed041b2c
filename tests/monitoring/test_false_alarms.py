"""Events of a damage index, and their expected number in a year."""

import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from skthermo.monitoring._events import EventRule, EventState, find_events
from skthermo.monitoring._threshold import FEW_PEAKS, estimate_false_alarms, quiet_levels, seasonal_scale

DAY = pd.Timedelta("1D")


def stamps(n, step="1D", start="2025-01-01"):
    return pd.date_range(start, periods=n, freq=step)


def chi(random, shape, n_modes=6):
    """Damage indices of independent records of normally distributed modes."""
    return np.sqrt(random.chisquare(n_modes, shape))


def slow_chi(random, n):
    """The same of modes that are correlated by 0.9 from one record to the next."""
    noise = random.normal(0.0, np.sqrt(1 - 0.9**2), (n + 200, 6))
    return np.linalg.norm(lfilter([1.0], [1.0, -0.9], noise, axis=0)[200:], axis=1)


def plain_events(index, times, rule):
    """Whether an event is open after each record, one after the other."""
    is_open, quiet_since, after, last = False, None, [], [0.0] * (2 * rule.persistence - 1)
    for value, time in zip(index, times, strict=True):
        if not np.isnan(value):
            last = [*last[1:], value]
            value = sorted(last)[rule.persistence - 1]
        if value > rule.release:
            is_open, quiet_since = is_open or value > rule.threshold, None
        elif value <= rule.release:
            quiet_since = time if quiet_since is None else quiet_since
            is_open = is_open and time - quiet_since < rule.hold
        after.append(is_open)
    return after


series = st.lists(st.sampled_from([0.0, 1.0, 2.0, 3.0, np.nan]), max_size=40)
steps = st.lists(st.integers(1, 60), min_size=40, max_size=40)


@given(series, steps, st.lists(st.integers(0, 40), max_size=4), st.integers(0, 100), st.integers(1, 4))
@settings(max_examples=100, deadline=None)
def test_events_are_those_of_one_record_after_the_other_however_they_are_divided(index, hours, cuts, hold, persistence):
    index, rule = np.array(index, dtype=float), EventRule(2.5, 1.5, pd.Timedelta(hours=hold), persistence)
    times = pd.Timestamp("2025-01-01") + pd.to_timedelta(np.cumsum(hours)[: len(index)], unit="h")
    expected = plain_events(index, times, rule)
    state, after, ns = EventState(), [], times.as_unit("ns").asi8
    for part, at in zip(np.split(index, sorted(cuts)), np.split(ns, sorted(cuts)), strict=True):
        is_open, _, state = rule.follow(state, part, at)
        after.extend(is_open.tolist())
    assert after == expected
    events = find_events(index, times, rule)
    assert len(events) == np.count_nonzero(np.diff([False, *expected]) & np.array(expected, dtype=bool))
    assert (events["peak"] > rule.threshold).all()
    closed = events.dropna(subset="end")
    assert (closed["start"] < closed["end"]).all()
    assert len(events) - len(closed) == int(bool(expected) and expected[-1])


@given(st.integers(0, 2**31 - 1), st.floats(1.2, 3.0), st.integers(1, 3))
@settings(max_examples=50, deadline=None)
def test_the_number_of_events_is_that_of_excursions_with_a_higher_peak(seed, threshold, persistence):
    index, times = np.random.default_rng(seed).exponential(1, 300), stamps(300)
    excursions = find_events(index, times, EventRule(1.2, 1.2, DAY, persistence))
    events = find_events(index, times, EventRule(threshold, 1.2, DAY, persistence))
    assert len(events) == (excursions["peak"] > threshold).sum()


@given(series, steps, st.lists(st.floats(0, 3), min_size=40, max_size=40), st.integers(1, 4))
@settings(max_examples=50, deadline=None)
def test_more_change_is_never_less_alarm(index, hours, more, persistence):
    index, rule = np.array(index, dtype=float), EventRule(2.5, 1.5, pd.Timedelta(hours=20), persistence)
    times = np.cumsum(hours)[: len(index)] * 3600 * 10**9
    before, after = (rule.follow(EventState(), one, times)[0] for one in (index, index + more[: len(index)]))
    assert (after >= before).all()


def test_change_that_lasts_is_found_by_as_many_records_as_asked_for():
    index, times = np.r_[np.zeros(20), np.full(20, 9.0)], stamps(40)
    for persistence in (1, 2, 5):
        (start,) = find_events(index, times, EventRule(3.0, 1.0, DAY, persistence))["start"]
        assert start == times[20 + persistence - 1]


@pytest.mark.parametrize("persistence", [2, 3, 4])
def test_change_of_every_second_record_is_found_and_isolated_ones_are_not(persistence):
    index, times = np.tile([9.0, 0.0], 20), stamps(40)
    assert len(find_events(index, times, EventRule(3.0, 1.0, DAY, persistence))) == 1
    alone = np.where(np.arange(40) % (2 * persistence - 1) < persistence - 1, 9.0, 0.0)
    assert find_events(alone, times, EventRule(3.0, 1.0, DAY, persistence)).empty


def test_a_season_with_more_noise_has_its_scale_and_others_have_that_of_chance():
    random, n = np.random.default_rng(10), 2 * 365
    index, is_winter = chi(random, n), np.isin(stamps(n).month, [12, 1, 2])
    assert seasonal_scale(pd.Series(index, stamps(n))).between(0.85, 1.15).all()
    scale = seasonal_scale(pd.Series(np.where(is_winter, 2, 1) * index, stamps(n)))
    ratio = scale[stamps(n).month == 1].mean() / scale[stamps(n).month == 7].mean()
    assert 3.2 < ratio < 4.2


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
def test_a_healthy_year_has_as_many_events_as_expected_on_average(per_year):
    random, n, counts, ranges = np.random.default_rng(0), 365, [], []
    for _ in range(40):
        estimate = estimate_false_alarms(pd.Series(chi(random, n), stamps(n)), per_year)
        later = find_events(chi(random, 10 * n), stamps(10 * n), estimate.rule)
        counts.append(len(later) / 10)
        ranges.append((estimate.lowest, estimate.highest))
    assert 0.5 * per_year < np.mean(counts) < 1.5 * per_year
    assert ranges[0][0] <= per_year <= ranges[0][1]


@pytest.mark.nightly
def test_the_range_of_a_year_holds_nine_years_in_ten():
    random, n, within = np.random.default_rng(1), 365, []
    for _ in range(100):
        estimate = estimate_false_alarms(pd.Series(chi(random, n), stamps(n)), 4.0)
        number = len(find_events(chi(random, n), stamps(n), estimate.rule))
        within.append(estimate.lowest <= number <= estimate.highest)
    assert 0.85 < np.mean(within) <= 0.99


def test_fewer_alarms_need_a_higher_threshold():
    index = pd.Series(chi(np.random.default_rng(2), 730), stamps(730))
    thresholds = [estimate_false_alarms(index, rate).rule.threshold for rate in (30.0, 5.0, 1.0, 0.5)]
    assert thresholds == sorted(thresholds)
    assert thresholds[0] > quiet_levels(index)[0]


def test_an_index_that_is_mostly_zero_has_a_threshold():
    random = np.random.default_rng(5)
    index = pd.Series(np.maximum(random.normal(-1, 1, 365), 0.0), stamps(365))  # of one mode that can only fall
    assert index.max() / 2 < estimate_false_alarms(index, persistence=1).rule.threshold < 2 * index.max()
    with pytest.raises(ValueError, match="peak"):
        estimate_false_alarms(0 * index)


def test_as_many_alarms_as_excursions_come_from_their_order_alone():
    index = pd.Series(chi(np.random.default_rng(3), 365), stamps(365))
    estimate = estimate_false_alarms(index, 30.0)
    until_usual = replace(estimate.rule, release=quiet_levels(index)[0])
    excursions, events = (find_events(index.to_numpy(), index.index, rule) for rule in (until_usual, estimate.rule))
    assert abs(len(excursions) - 30) <= 1
    assert len(excursions) <= len(events) <= 1.15 * len(excursions)  # an excursion may be two events


def test_gaps_and_records_that_are_not_evaluated_are_no_time_of_the_baseline():
    whole = pd.Series(chi(np.random.default_rng(4), 730), stamps(730))
    holes = whole.mask((whole.index > "2025-04-01") & (whole.index < "2025-10-01"))
    assert estimate_false_alarms(whole).n_years == pytest.approx(729 / 365.25)
    expected = (730 - holes.isna().sum()) / 365.25
    assert estimate_false_alarms(holes).n_years == pytest.approx(expected, abs=0.01)
    assert estimate_false_alarms(holes).rule == estimate_false_alarms(holes.dropna()).rule


def test_half_a_year_gives_no_estimate_for_the_other_half():
    index = pd.Series(chi(np.random.default_rng(5), 182), stamps(182))
    with pytest.warns(UserWarning, match="153 days of the year .17 July to 16 December.*missing-seasons"):
        estimate = estimate_false_alarms(index, 2.0)
    assert "17 July" in estimate.missing_season
    assert "no estimate for 153 days" in str(estimate)


@pytest.mark.filterwarnings("ignore:.*(missing-seasons|extrapolated-threshold|baseline-peak)")
def test_a_month_of_few_excursions_has_the_false_alarms_asked_for_from_its_days():
    random, n, counts = np.random.default_rng(9), 120, []
    later = pd.Series(slow_chi(random, 20_000), pd.date_range("2025-01-01", periods=20_000, freq="6h"))
    for _ in range(20):
        estimate = estimate_false_alarms(pd.Series(slow_chi(random, n), later.index[:n]), 1.0, persistence=3)
        assert estimate.tail.k + 1 >= FEW_PEAKS
        counts.append(len(find_events(later.to_numpy(), later.index, estimate.rule)) / (20_000 / 1461))
    assert 0.2 < np.mean(counts) < 2
    with pytest.raises(ValueError, match="2 peaks"):
        estimate_false_alarms(later[:8], 1.0)


@pytest.mark.filterwarnings("ignore:.*missing-seasons")
def test_a_threshold_far_beyond_the_baseline_is_said_to_be_one():
    index = pd.Series(chi(np.random.default_rng(6), 90), stamps(90))
    with pytest.warns(UserWarning, match="1 false alarm a year.*0.24 years.*extrapolated-threshold"):
        estimate = estimate_false_alarms(index, 1.0)
    assert estimate.rule.threshold > index.max()


def test_of_more_alarms_than_excursions_there_are_as_many_as_these():
    index = pd.Series(chi(np.random.default_rng(7), 365), stamps(365))
    with pytest.warns(UserWarning, match=r"false_alarms_per_year is 500, .* only \d+ peaks .*few-peaks"):
        many = estimate_false_alarms(index, 500.0)
    n_excursions = len(find_events(index, index.index, many.rule))
    assert many.expected == pytest.approx(n_excursions, rel=0.1)
    assert many.rule.threshold < estimate_false_alarms(index, 0.9 * many.expected).rule.threshold
    with pytest.raises(ValueError, match="expected at least"):
        estimate_false_alarms(index[:2], 500.0)
    with pytest.raises(ValueError, match="0 baseline records have a damage index, 0 of them"):
        estimate_false_alarms(index * np.nan)


def test_a_day_that_was_no_healthy_one_is_named():
    index = pd.Series(chi(np.random.default_rng(8), 365), stamps(365))
    spoilt = index.copy()
    spoilt.iloc[100] = 30.0
    with pytest.warns(UserWarning, match="2025-04-11 00:00:00.* 30,.*baseline-peak"):
        raised = estimate_false_alarms(spoilt)
    assert raised.rule.threshold > 2 * estimate_false_alarms(index).rule.threshold


def test_few_healthy_baselines_are_said_to_have_such_a_day():
    random, warned = np.random.default_rng(9), 0
    for _ in range(80):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            estimate_false_alarms(pd.Series(chi(random, 365), stamps(365)))
        warned += len(caught)
    assert warned <= 4


def test_one_is_singular():
    index = pd.Series(chi(np.random.default_rng(9), 366), stamps(366))
    assert str(estimate_false_alarms(index)).startswith("1 false alarm a year")
    assert str(estimate_false_alarms(index)).endswith("in 1 year of baseline")
    assert str(estimate_false_alarms(index, 2.0)).startswith("2 false alarms a year")
