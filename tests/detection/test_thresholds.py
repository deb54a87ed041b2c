"""Thresholds that keep a rate of false alarms, and the leave-one-out distances that they are set on."""

import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import beta, chi
from scipy.stats import f as f_law
from sklearn.covariance import EmpiricalCovariance, LedoitWolf

from skthermo._core.frames import correlation_time
from skthermo.detection import MahalanobisDetector
from skthermo.detection._base import conformal_threshold
from skthermo.detection._mahalanobis import factor_of_few
from skthermo.exceptions import FewRecordsWarning
from skthermo.residuals.folds import Neighbourhoods
from skthermo.residuals.gaussian import Gaussian

REMEMBERED = pytest.mark.filterwarnings("ignore:.*few-baseline-records")
FAR_ABOVE = pytest.mark.filterwarnings("ignore:.*high-threshold")
TOO_FEW = pytest.mark.filterwarnings("ignore:.*few-baseline-records")


def records(n_rows=120, n_modes=4, seed=0):
    random = np.random.default_rng(seed)
    return 5 + random.normal(size=(n_rows, n_modes)) @ random.normal(size=(n_modes, n_modes))


def with_gaps(rows, share=0.3):
    return np.where(np.random.default_rng(1).random(rows.shape) < share, np.nan, rows)


def left_out(rows, **options):
    """Index of every row by a detector that is fitted on the others."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*few-baseline-records")
        return np.array(
            [
                MahalanobisDetector(**options).fit(np.delete(rows, i, axis=0)).damage_index(rows[[i]])[0]
                for i in range(len(rows))
            ]
        )


# The rules


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(0, 100), min_size=1, max_size=400), st.floats(0.001, 0.5), st.integers(0, 5))
def test_the_conformal_threshold_is_an_order_statistic(index, contamination, n_missing):
    padded = np.array(index + [np.nan] * n_missing)
    rank = int(np.ceil((len(index) + 1) * (1 - contamination) - 1e-9))
    if rank <= len(index):
        assert conformal_threshold(padded, contamination) == sorted(index)[rank - 1]
        assert (np.array(index) > conformal_threshold(padded, contamination)).mean() <= contamination
    else:
        with pytest.warns(UserWarning, match=f"{len(index)} .*few-baseline-records"):
            assert conformal_threshold(padded, contamination) == max(index)


@pytest.mark.parametrize(("n_rows", "contamination", "rank"), [(49, 0.02, 49), (99, 0.02, 98), (19, 0.05, 19)])
def test_ranks_do_not_depend_on_rounding(n_rows, contamination, rank):
    """Fewest records for a rate: 1 / contamination - 1."""
    assert conformal_threshold(np.arange(1.0, n_rows + 1), contamination) == rank


def test_too_few_records_are_said_with_the_number_that_would_do():
    with pytest.warns(UserWarning, match="48 .*expected 49 .*few-baseline-records"):
        assert conformal_threshold(np.arange(48.0), 0.02) == 47


def test_dependent_records_raise_the_threshold_as_if_there_were_fewer():
    index = np.arange(1.0, 1001)
    alone, shared = (conformal_threshold(index, 0.05, share) for share in (1.0, 0.1))
    assert (alone, shared) == (951, 960)  # ceil(1001 * 0.95), ceil(101 * 0.95 / 0.1)
    with pytest.warns(UserWarning, match="10 .*few-baseline-records"):
        assert conformal_threshold(index, 0.05, 0.01) == 1000


def test_the_quantile_leaves_out_records_without_an_index():
    index = np.random.default_rng(0).random(100)
    limit = MahalanobisDetector(threshold="quantile")._limit(np.append(index, np.nan))
    assert limit == np.quantile(index, 0.98)


def test_an_index_with_the_probability_asked_is_exceeded_by_a_new_one():
    """Of 49 exchangeable numbers, the largest is exceeded by the next with the probability 1 / 50."""
    drawn = np.random.default_rng(0).random((20_000, 50))
    thresholds = np.array([conformal_threshold(row[:49], 0.02) for row in drawn])
    assert (drawn[:, 49] > thresholds).mean() == pytest.approx(0.02, abs=0.003)


# In the detector


def test_conformal_is_the_default_and_takes_leave_one_out_distances():
    rows = records()
    detector, expected = MahalanobisDetector().fit(rows), left_out(rows)
    assert detector.threshold == "conformal"
    np.testing.assert_allclose(detector.baseline_index_, expected, rtol=1e-10)
    assert detector.threshold_ == pytest.approx(conformal_threshold(expected, 0.02), rel=1e-10)


def autoregressive(n_rows, correlation, seed=0, n_modes=4):
    """Records of unit variance that remember those before them."""
    noise = np.random.default_rng(seed).normal(size=(n_rows + 200, n_modes))
    return lfilter([np.sqrt(1 - correlation**2)], [1.0, -correlation], noise, axis=0)[200:]


def distances_without(rows, near):
    """Mahalanobis distance of every row from all that are not near it, by a fit without them."""
    found = []
    for row, out in zip(rows, near, strict=True):
        mean, covariance = rows[~out].mean(axis=0), np.cov(rows[~out].T, bias=True)
        found.append(np.sqrt((row - mean) @ np.linalg.solve(covariance, row - mean)))
    return np.array(found)


def within(places, reach):
    """Which records are near each."""
    return np.abs(np.subtract.outer(places, places)) <= reach


def two_correlation_times(rows):
    return np.ceil(2 * (np.mean([correlation_time(column) for column in rows.T]) - 1))


@REMEMBERED
@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.8])
def test_the_closed_form_leaves_out_two_correlation_times_on_either_side(correlation):
    rows = autoregressive(240, correlation) @ np.tri(4)
    reach = two_correlation_times(rows)
    assert (reach == 0) == (correlation == 0)
    index = MahalanobisDetector().fit(rows).baseline_index_
    np.testing.assert_allclose(index, distances_without(rows, within(np.arange(240), reach)), rtol=1e-9)


@REMEMBERED
def test_neighbours_are_those_in_time_where_there_are_stamps():
    """Rows in any order, and a month without records: those on its other side are no neighbours."""
    rows, hours = autoregressive(240, 0.7), np.arange(240) + 24 * 30 * (np.arange(240) >= 120)
    frame = pd.DataFrame(rows, pd.Timestamp("2025") + pd.to_timedelta(hours, "h")).rename(columns=str)
    index = MahalanobisDetector().fit(frame).baseline_index_
    np.testing.assert_allclose(index, distances_without(rows, within(hours, two_correlation_times(rows))), rtol=1e-9)
    order = np.random.default_rng(0).permutation(240)
    np.testing.assert_allclose(MahalanobisDetector().fit(frame.iloc[order]).baseline_index_, index[order], rtol=1e-9)


def test_four_fifths_of_the_records_stay_however_long_they_remember():
    rows = autoregressive(85, 0.98)
    baseline = Neighbourhoods(np.arange(85.0), rows)
    assert baseline.is_short
    index = baseline.distances(Gaussian.fitted(rows))
    np.testing.assert_allclose(index, distances_without(rows, within(np.arange(85), 8)), rtol=1e-9)


@pytest.mark.one_case
@REMEMBERED
@pytest.mark.parametrize("case", ["gaps", "shrunk covariance"])
def test_false_alarms_are_as_asked_where_records_remember_those_before(case):
    """More lengths and memories: tests/benchmarks/detection_thresholds.py."""
    rates, covariance = {"conformal": [], "quantile": []}, None if case == "gaps" else LedoitWolf()
    for seed in range(12):
        baseline, later = np.split(autoregressive(1365, 0.9, seed), [365])
        for threshold, found in rates.items():
            detector = MahalanobisDetector(0.05, threshold=threshold, covariance=covariance)
            detector.fit(with_gaps(baseline) if case == "gaps" else baseline)
            found.append((detector.damage_index(later) > detector.threshold_).mean())
    assert np.mean(rates["conformal"]) < 0.05 + 2 * np.std(rates["conformal"]) / np.sqrt(12)
    assert np.mean(rates["quantile"]) > 0.09


def test_few_independent_records_are_reported_with_their_number():
    with pytest.warns(UserWarning, match="365 .*few-baseline-records"):
        detector = MahalanobisDetector().fit(autoregressive(365, 0.9))
    assert 10 <= detector.n_independent_ < 40
    assert MahalanobisDetector().fit(records(365)).n_independent_ > 300


def test_the_papers_quantile_is_one_word_away():
    rows = records()
    detector = MahalanobisDetector(0.05, threshold="quantile").fit(rows)
    index = detector.damage_index(rows)
    assert detector.threshold_ == np.quantile(index, 0.95)
    assert (index > detector.threshold_).mean() == 0.05
    assert detector.threshold_ < MahalanobisDetector(0.05).fit(rows).threshold_


@pytest.mark.parametrize("n_modes", [1, 4])
def test_the_chi_square_threshold_does_not_depend_on_the_records(n_modes):
    for seed in (0, 1):
        detector = MahalanobisDetector(0.05, threshold="chi2").fit(records(60, n_modes, seed))
        assert detector.threshold_ == pytest.approx(chi(n_modes).isf(0.05), rel=1e-12)


def test_thresholds_agree_on_many_normal_records():
    rows = records(50_000)
    chosen = [MahalanobisDetector(threshold=name).fit(rows).threshold_ for name in ("quantile", "conformal", "chi2")]
    np.testing.assert_allclose(chosen, chosen[2], rtol=0.01)


@FAR_ABOVE
@TOO_FEW
def test_false_alarms_on_new_records_are_as_asked_where_the_baseline_is_small():
    rates = {"quantile": [], "conformal": []}
    for seed in range(80):
        random = np.random.default_rng(seed)
        baseline, later = random.normal(size=(60, 6)), random.normal(size=(400, 6))
        for name, found in rates.items():
            detector = MahalanobisDetector(threshold=name).fit(baseline)
            found.append((detector.damage_index(later) > detector.threshold_).mean())
    error = np.std(rates["conformal"]) / np.sqrt(80)
    assert np.mean(rates["conformal"]) < 0.02 + 2 * error
    assert np.mean(rates["quantile"]) > 0.05


@pytest.mark.parametrize("case", ["gaps", "shrunk covariance"])
def test_distances_without_a_closed_form_are_from_the_records_of_other_blocks(case):
    """A block of five records after the other to ten folds in turn."""
    rows, folds, index = records(123), np.arange(123) // 5 % 10, np.empty(123)
    if case == "gaps":
        rows[::3, 0] = np.nan
    detector = MahalanobisDetector(covariance=None if case == "gaps" else LedoitWolf(), threshold="chi2")
    for fold in range(10):
        index[folds == fold] = detector.fit(rows[folds != fold])._distances(rows[folds == fold])
    found = detector.fit(rows)._as_if_new(Neighbourhoods(np.arange(123.0), rows))
    np.testing.assert_allclose(found, index, rtol=1e-9)


@pytest.mark.parametrize("threshold", ["quantile", "chi2"])
def test_the_empirical_covariance_is_the_default(threshold):
    rows = records()
    default, given = (MahalanobisDetector(threshold=threshold, covariance=c) for c in (None, EmpiricalCovariance()))
    assert given.fit(rows).threshold_ == pytest.approx(default.fit(rows).threshold_, rel=1e-10)
    np.testing.assert_allclose(given.damage_index(rows), default.damage_index(rows), rtol=1e-10)


@TOO_FEW
def test_a_baseline_in_which_each_row_decides_alone_about_a_direction_is_refused():
    with pytest.raises(ValueError, match="5 baseline rows are too few for their number of modes"):
        MahalanobisDetector().fit(records(5))


# Short baselines whose records depend on each other


@FAR_ABOVE
@REMEMBERED
def test_a_short_dependent_baseline_still_lets_damage_be_found():
    """Of shifts by five standard deviations, the threshold that leaves neighbours out finds about half."""
    false, found, by_quantile = [], [], []
    for seed in range(20):
        rows = autoregressive(144 + 48, 0.95, seed)
        detector, plain = (MahalanobisDetector(threshold=one).fit(rows[:144]) for one in ("conformal", "quantile"))
        assert detector.threshold_ >= plain.threshold_
        false.append((detector.predict(rows[144:]) == -1).mean())
        by_quantile.append((plain.predict(rows[144:]) == -1).mean())
        found.append((detector.predict(rows[144:] + 2.5) == -1).mean())
    assert np.mean(false) < np.mean(by_quantile) / 3
    assert np.mean(found) > 0.8


def test_the_factor_of_a_few_independent_records_gives_their_rate():
    """By Hotelling's law for the distance of new records, and the beta law for that of a baseline's own."""
    n, p = 200, 3
    new = np.sqrt(p * (n * n - 1) / (n * (n - p)) * f_law.isf(0.02, p, n - p) * n / (n - 1))
    own = np.sqrt((n - 1) * beta.isf(0.02, p / 2, (n - p - 1) / 2))
    assert factor_of_few(n, p, 1.0, 0.02) == pytest.approx(new / own, rel=0.03)


@pytest.mark.parametrize("n_records", [100, 300, 1000])
def test_the_factor_grows_with_dependence_and_vanishes_with_records(n_records):
    factors = [factor_of_few(n_records, 4, time, 0.02) for time in (1.0, 3.0, 9.0, 19.0)]
    assert (np.diff(factors) > 0).all()
    assert factors[0] == pytest.approx(1, abs=16 / min(n_records, 400))


@REMEMBERED
def test_a_threshold_far_above_the_indices_of_its_baseline_is_reported_with_what_it_still_detects():
    rows = autoregressive(120, 0.97, 3)
    with pytest.warns(FewRecordsWarning, match="high-threshold"):
        MahalanobisDetector().fit(rows)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        MahalanobisDetector().fit(records(400))
