"""Alarms raised by several records in a row."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import lfilter
from scipy.stats import binom, chi

from skthermo.detection import MahalanobisDetector, WindowedAlarm
from skthermo.detection._windowed_alarm import CountLaw, MeanLaw, Windows, robust_means
from skthermo.metrics import time_to_detection
from tests.nights import by_day

RULES = ["mean", "m-of-n"]
each_rule = pytest.mark.parametrize("rule", RULES)
MIXED = np.array([[1.0, 0.3, 0.0], [0.0, 1.0, -0.4], [0.2, 0.0, 0.5]])


N_ROWS = 800


def stream(n_rows=N_ROWS, seed=0, correlation=0.0, shift=0.0):
    """Hourly records of three modes; ``correlation`` of neighbours in time, ``shift`` in standard deviations of f1."""
    noise = np.random.default_rng(seed).normal(size=(n_rows, 3))
    noise[1:] *= np.sqrt(1 - correlation**2)
    noise = lfilter([1.0], [1.0, -correlation], noise, axis=0)
    stamps = pd.date_range("2025", periods=n_rows, freq="h")
    return pd.DataFrame([4.0, 9.0, 12.0] + (noise + [shift, 0, 0]) @ MIXED, stamps, ["f1", "f2", "f3"])


@cache
def fitted(rule):
    """Windows of twelve records, for tests that only ask them."""
    return WindowedAlarm(12, rule=rule).fit(X)


X, LATER = stream(), stream(seed=1)
HOLED = LATER.mask(np.random.default_rng(0).random(LATER.shape) < 0.4)


# A call does not know the records before its first ones, whose windows therefore hold too few.
pytestmark = pytest.mark.filterwarnings("ignore:.*not-evaluated")


# The mean of a window


def test_a_window_of_one_record_is_close_to_the_mahalanobis_index():
    index = WindowedAlarm(1).fit(X).damage_index(LATER)
    np.testing.assert_allclose(index, MahalanobisDetector().fit(X).damage_index(LATER), rtol=1e-8)
    assert WindowedAlarm(1).fit(X).threshold_ == pytest.approx(MahalanobisDetector().fit(X).threshold_, rel=0.05)


def test_equal_records_raise_the_index_by_the_root_of_their_number():
    """As far as the records of the baseline do not depend on each other."""
    alarm = WindowedAlarm(9).fit(X)
    alarm.law_.correlation[:] = 0
    single = WindowedAlarm(1).fit(X)
    record = X.iloc[[5]]
    same = pd.concat([record] * 20).set_axis(X.index[:20])
    expected = single.damage_index(record).iloc[0] * np.sqrt(np.minimum(np.arange(1, 21), 9))
    expected[:4] = np.nan  # less than half a window
    np.testing.assert_allclose(alarm.damage_index(same), expected, rtol=1e-9)


def test_the_index_is_the_length_of_the_robust_mean_in_its_standard_deviations():
    alarm = WindowedAlarm(24).fit(X)
    white = alarm.law_.records.whiten(LATER.to_numpy())
    limits = 1.5 * np.sqrt(1 - alarm.law_.correlation)
    for row in (100, N_ROWS - 100):
        columns = white[row - 23 : row + 1].T
        mean = np.concatenate(
            [robust_means(column[np.newaxis], limit) for column, limit in zip(columns, limits, strict=True)]
        )
        variance = (1 + 23 * alarm.law_.correlation) / 24
        assert alarm.damage_index(LATER).iloc[row] == pytest.approx(np.sqrt((mean**2 / variance).sum()), rel=1e-9)


def test_m_is_for_m_of_n_only():
    with pytest.raises(ValueError, match="m is 3, but rule is 'mean'; expected m only with the rule 'm-of-n'"):
        WindowedAlarm(24, m=3).fit(X)


def test_the_correlation_in_a_window_is_that_of_its_pairs():
    lags, rows = np.arange(1, 12), np.arange(20_000)
    expected = 2 * ((12 - lags) * 0.7**lags).sum() / (12 * 11)
    steady, mixed = (
        MeanLaw.of(Windows.of(records, records.to_numpy(), 12), rows).correlation
        for records in (stream(20_000, 2, correlation=0.7), stream(20_000))
    )
    np.testing.assert_allclose(steady, expected, atol=0.03)
    np.testing.assert_allclose(mixed, 0, atol=0.01)


def how_many_count_as_one(alarm, index):
    """Windows for each independent one, from the rank of the threshold: (n_independent + 1)(1 - 0.01) of these."""
    return (np.searchsorted(np.sort(index), alarm._limit(index)) + 1) / (1 - 0.01) - len(index)


def test_windows_count_as_one_as_long_as_alarms_last_and_within_half_a_window():
    """With half a window, because few high windows hardly tell how long they last."""
    short, long = WindowedAlarm(2, contamination=0.01), WindowedAlarm(100, contamination=0.01)
    short.width_, long.width_ = 2, 100
    scattered = np.random.default_rng(0).random(20_000)
    in_runs = scattered + (np.arange(20_000) % 4000 < 40)
    assert how_many_count_as_one(short, in_runs) == pytest.approx(40, abs=2)
    assert how_many_count_as_one(long, in_runs) == pytest.approx(50, abs=2)
    assert how_many_count_as_one(short, scattered) < 3
    assert how_many_count_as_one(long, scattered) == pytest.approx(50, abs=2)


# m of n records


@each_rule
def test_a_mode_without_a_value_is_refused(rule):
    with pytest.raises(ValueError, match="'f2' is NaN in all 800 rows"):
        WindowedAlarm(8, rule=rule).fit(X.assign(f2=np.nan))


@each_rule
def test_implausible_records_of_the_baseline_are_reported_once_by_name(rule):
    baseline = X.copy()
    baseline.iloc[700, 1] = 900.0
    with pytest.warns(match="set-aside") as record:
        WindowedAlarm(8, rule=rule).fit(baseline)
    assert ["'f2' is 900" in str(one.message) for one in record if "[set-aside]" in str(one.message)] == [True]


@each_rule
def test_the_farther_the_records_the_higher_the_index_of_windows_with_gaps(rule):
    alarm = WindowedAlarm(8, rule=rule).fit(X)
    indices = [alarm.damage_index(HOLED[:200] + scale * X.std()).to_numpy() for scale in (3, 6, 12, 50, 200, 1e5)]
    indices = np.array(indices)[:, 8:]
    evaluated = np.isfinite(indices).all(axis=0)
    np.testing.assert_array_equal(evaluated, HOLED[:200].notna().any(axis=1).rolling(8).sum()[8:] >= alarm.fewest_)
    assert evaluated.sum() > 150
    assert (np.diff(indices[:, evaluated], axis=0) > 0).all()


@settings(max_examples=by_day(4, at_night=8), deadline=None)
@given(st.integers(1, 12), st.data())
def test_alarms_are_where_m_of_n_records_are_above_the_threshold(n, data):
    m, contamination = data.draw(st.integers(1, n)), data.draw(st.sampled_from([0.02, 0.1, 0.3]))
    alarm = WindowedAlarm(n, rule="m-of-n", m=m, contamination=contamination).fit(X[:300])
    single = alarm.law_.detector.damage_index(LATER.to_numpy())
    high = np.convolve(single > alarm.threshold_, np.ones(n), "full")[: len(LATER)]
    full = slice(n - 1, None)
    np.testing.assert_array_equal((alarm.predict(LATER) == -1)[full], (high >= m)[full])


def test_half_of_the_records_are_asked_for_by_default():
    assert [WindowedAlarm(n, rule="m-of-n").fit(X[:700]).law_.m for n in (1, 2, 5, 24)] == [1, 1, 3, 12]


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 24), st.data())
def test_windows_with_gaps_are_as_unlikely_by_the_binomial_law(n, data):
    """The m-th largest of n independent indices is above a value where at least m are: a binomial probability."""
    m, count = data.draw(st.integers(1, n)), data.draw(st.integers(1, n - 1))
    law = CountLaw(MahalanobisDetector().fit(X.to_numpy()), n, m)
    single = np.full((1, n), np.nan)
    single[0, n - count :] = np.random.default_rng(data.draw(st.integers(0, 99))).uniform(0.5, 4, count)
    scaled = max(int(np.rint(m * count / n)), 1)
    value = np.sort(single[0, n - count :])[-scaled]
    found = law._as_if_full(single, 3)[0]
    expected = binom.sf(scaled - 1, count, chi.sf(value, 3))
    assert binom.sf(m - 1, n, chi.sf(found, 3)) == pytest.approx(expected, rel=1e-6)


# Windows


@each_rule
def test_times_and_numbers_are_the_same_windows_on_a_regular_index(rule):
    by_number, by_time = (WindowedAlarm(window, rule=rule).fit(X) for window in (24, "24h"))
    assert by_time.threshold_ == by_number.threshold_
    pd.testing.assert_series_equal(by_time.damage_index(LATER), by_number.damage_index(LATER))


@each_rule
def test_a_window_of_time_holds_the_records_that_fall_into_it(rule):
    kept = LATER.drop(index=LATER.index[100:110])
    alarm = WindowedAlarm("6h", rule=rule).fit(X)
    as_gaps = LATER.copy()
    as_gaps.iloc[100:110] = np.nan
    index = alarm.damage_index(kept)
    np.testing.assert_allclose(index, alarm.damage_index(as_gaps)[kept.index], rtol=1e-9)
    np.testing.assert_allclose(index.iloc[102], alarm.damage_index(LATER.iloc[110:]).iloc[2], rtol=1e-9)
    assert np.isnan(index.iloc[101])


@each_rule
def test_windows_with_less_than_half_as_many_values_as_in_the_baseline_are_not_evaluated(rule):
    holed = LATER.copy()
    holed.iloc[200:230] = np.nan
    holed.iloc[213:216, 1] = 9.0  # one mode is enough for a record to count
    alarm = WindowedAlarm(6, rule=rule).fit(X)
    evaluated = holed.notna().any(axis=1).rolling(6, min_periods=1).sum() >= 3
    np.testing.assert_array_equal(alarm.damage_index(holed).notna(), evaluated)
    assert (~evaluated).sum() == 2 + (215 - 203) + (232 - 219)
    message = f"{(~evaluated).sum()} of 800 rows .*fewer than 3 records.*not-evaluated"
    with pytest.warns(UserWarning, match=message):
        alarms = alarm.predict(holed)
    np.testing.assert_array_equal(alarms == 0, ~evaluated)


@each_rule
def test_gaps_of_the_baseline_are_no_reason_not_to_evaluate(rule):
    """Every third record has a value, in the baseline as later."""
    baseline, later = (records.copy() for records in (X, LATER))
    is_gap = np.arange(N_ROWS) % 3 > 0
    baseline[is_gap] = later[is_gap] = np.nan
    alarm = WindowedAlarm(24, rule=rule).fit(baseline)
    assert alarm.fewest_ == 4
    assert (alarm.predict(later)[12:] != 0).all()


def test_sums_over_windows_are_those_of_pandas():
    values = np.random.default_rng(0).normal(size=(300, 2))
    stamps = pd.DatetimeIndex(
        np.sort(np.random.default_rng(1).choice(pd.date_range("2025", periods=900, freq="h"), 300))
    )
    frame = pd.DataFrame(values, stamps)
    for window in (7, "10h"):
        windows = Windows.of(frame, values, window)
        rolling = frame.rolling(window, min_periods=1)
        np.testing.assert_array_equal(windows.sizes, rolling.count()[0])
        np.testing.assert_allclose(windows.sums(values), rolling.sum(), atol=1e-12)


@pytest.mark.one_case
@each_rule
def test_the_order_of_modes_and_their_units_do_not_matter(rule):
    alarm = fitted(rule)
    for change in (lambda records: records[["f3", "f1", "f2"]], lambda records: records * [1.0, 1e3, 1e-6]):
        other = WindowedAlarm(12, rule=rule).fit(change(X))
        if rule == "m-of-n" or list(change(X)) != list(X):
            np.testing.assert_allclose(other.damage_index(change(HOLED)), alarm.damage_index(HOLED), rtol=1e-7)
            assert other.threshold_ == pytest.approx(alarm.threshold_, rel=1e-7)
        else:  # modes are whitened by a symmetric root, whose axes depend on units
            assert (other.predict(change(LATER)) == alarm.predict(LATER)).mean() > 0.97


@each_rule
def test_the_size_of_chunks_does_not_matter(rule, monkeypatch):
    alarm = fitted(rule)
    whole = alarm.damage_index(HOLED)
    monkeypatch.setattr("skthermo.residuals.weather.NUMBERS_AT_ONCE", 100)
    np.testing.assert_allclose(alarm.damage_index(HOLED), whole, rtol=1e-10)


@each_rule
def test_later_records_do_not_change_earlier_windows(rule):
    alarm = fitted(rule)
    whole, memory = alarm.damage_index(HOLED), 11
    np.testing.assert_allclose(alarm.damage_index(HOLED[:700]), whole[:700], rtol=1e-9)
    np.testing.assert_allclose(alarm.damage_index(HOLED[300:])[memory:], whole[300 + memory :], rtol=1e-7)


# Rates


@pytest.mark.one_case
@each_rule
def test_false_alarms_are_as_asked_in_spite_of_the_correlation_in_time(rule):
    """Windows beside others: tests/benchmarks/detection_thresholds.py."""
    rates = []
    for seed in range(3):
        alarm = WindowedAlarm(12, rule=rule, contamination=0.05).fit(stream(2500, seed, correlation=0.7))
        rates.append((alarm.predict(stream(5000, 100 + seed, correlation=0.7)) == -1).mean())
    assert 0.05 * 0.75 < np.mean(rates) < 0.05 * 1.25


@pytest.mark.one_case
@each_rule
def test_damage_is_found_that_single_records_miss(rule):
    damaged = stream(1500, 3, shift=1.6)
    baseline = stream(3000)
    single, windowed = MahalanobisDetector().fit(baseline), WindowedAlarm(24, rule=rule).fit(baseline)
    shares = [(detector.predict(damaged) == -1).mean() for detector in (single, windowed)]
    assert shares[0] < 0.25
    assert shares[1] > 0.75
    onset = pd.concat(
        [LATER, damaged.set_axis(damaged.index + (LATER.index[-1] - LATER.index[0]) + pd.Timedelta("1h"))]
    )
    wait = time_to_detection(windowed.damage_index(onset), windowed.threshold_, onset.index[len(LATER)])
    assert wait <= pd.Timedelta("48h")


@pytest.mark.one_case
@each_rule
def test_a_baseline_with_gaps_teaches_nearly_the_same(rule):
    holed = X.mask(np.random.default_rng(0).random(X.shape) < 0.2)
    alarms = [WindowedAlarm(12, rule=rule).fit(baseline) for baseline in (X, holed)]
    assert alarms[1].threshold_ == pytest.approx(alarms[0].threshold_, rel=0.2)
    for alarm in alarms:
        assert (alarm.predict(HOLED) == -1).mean() < 0.06


# As an estimator, and what is refused


@pytest.mark.parametrize(
    ("window", "records", "message"),
    [
        (
            "24h",
            X.to_numpy(),
            "window is '24h', a time, but the records are not a frame with a stamp for each; expected",
        ),
        ("24h", X.reset_index(drop=True), "not a frame with a stamp for each"),
        ("24", X, "window is '24'; expected a number of records, or a time such as '24h'"),
        ("24h", X[::-1], "row 1 .* is earlier than the row before it; expected records in order of time"),
        (24, X[::-1], "row 1 .* is earlier than the row before it"),
        (0, X, "'window' parameter of WindowedAlarm must be an int in the range"),
        (2.5, X, "'window' parameter of WindowedAlarm"),
        (3, X[:5], "has 5 rows, and windows hold up to 3 records; expected at least twice as many rows"),
        ("9h", X[:17], "has 17 rows, and windows hold up to 9 records"),
        (2, X[:5], "covariance of [0-9] baseline rows and 3 modes is singular"),
        (3, X.assign(f4=X["f1"] + X["f2"]), r"singular \(rank 3\)"),
    ],
)
@each_rule
def test_windows_and_records_that_do_not_serve_are_named(rule, window, records, message):
    with pytest.raises(ValueError, match=message):
        WindowedAlarm(window, rule=rule).fit(records)


@pytest.mark.parametrize("window", ["0h", "-3h", "NaT", "", "a day"])
def test_lengths_of_time_that_do_not_serve_are_named(window):
    with pytest.raises(ValueError, match=r"window is .*; expected"):
        WindowedAlarm(window).fit(X)


def test_more_records_than_a_window_has_cannot_be_asked_for():
    with pytest.raises(ValueError, match="m is 9, but windows hold 5 records; expected at most as many"):
        WindowedAlarm(5, rule="m-of-n", m=9).fit(X)


# Outliers in service


def test_outliers_among_the_records_raise_no_more_alarms_by_means():
    random = np.random.default_rng(0)
    baseline, later = (pd.DataFrame(random.normal(size=(4000, 4))) for _ in range(2))
    wrong = random.random(later.shape) < 0.005
    alarm = WindowedAlarm(12, contamination=0.005).fit(baseline)
    clean, dirty = (alarm.predict(rows) == -1 for rows in (later, later + 15 * wrong))
    assert clean.mean() < 0.01
    assert dirty.mean() < clean.mean() + 0.005
    assert (alarm.predict(later + 1.5) == -1).mean() > 0.95


@given(
    arrays(float, (3, 7), elements=st.floats(-10, 10) | st.just(np.nan)),
    st.floats(0, 5),
    arrays(float, (3, 7), elements=st.floats(0, 10)),
)
def test_robust_means_move_with_all_values_and_never_against_any(rows, shift, moves):
    means, known = robust_means(rows, 1.5), ~np.isnan(rows).all(axis=1)
    np.testing.assert_allclose(robust_means(rows + shift, 1.5)[known], means[known] + shift, atol=1e-9)
    assert (robust_means(rows + moves, 1.5)[known] >= means[known] - 1e-9).all()
    few = np.nan_to_num(rows[:, :2])
    np.testing.assert_allclose(robust_means(few, 1e3), few.mean(axis=1), atol=1e-9)
