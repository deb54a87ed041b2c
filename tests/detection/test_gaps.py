"""Missing modes: normal distributions by expectation maximisation, and indices that mean the same in every pattern."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import mahalanobis
from scipy.stats import chi, multivariate_normal
from sklearn.covariance import LedoitWolf

from skthermo.detection import MahalanobisDetector
from skthermo.detection._mahalanobis import as_if_complete
from skthermo.residuals.gaussian import Gaussian, patterns

MEAN = np.array([4.0, 9.0, 12.0])
COVARIANCE = 0.01 * np.array([[1.0, 0.6, 0.2], [0.6, 2.0, 0.3], [0.2, 0.3, 0.5]])


def records(n_rows, seed=0):
    return np.random.default_rng(seed).multivariate_normal(MEAN, COVARIANCE, n_rows)


def with_gaps(rows, share=0.3, seed=0):
    """Rows of which a share of the entries is missing; at least one is left in each."""
    gaps = np.random.default_rng(seed).random(rows.shape) < share
    gaps[np.arange(len(rows)), np.arange(len(rows)) % rows.shape[1]] = False
    return np.where(gaps, np.nan, rows)


F = records(400)
GAPPY = with_gaps(F)
LEARNED = Gaussian.fitted(GAPPY)


def log_likelihood(rows, mean, covariance):
    """Of the modes that are there."""
    total = 0.0
    for row in rows:
        there = ~np.isnan(row)
        total += multivariate_normal.logpdf(row[there], mean[there], covariance[np.ix_(there, there)])
    return total


# The normal distribution of rows with gaps


def test_complete_rows_give_mean_and_covariance():
    learned = Gaussian.fitted(F)
    np.testing.assert_allclose(learned.mean, F.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(learned.covariance, np.cov(F.T, bias=True), rtol=1e-11)


def test_the_likelihood_is_flat_at_the_solution():
    rows = GAPPY[:100]
    learned, step = Gaussian.fitted(rows), 1e-5
    deviations = np.sqrt(np.diag(learned.covariance))
    for i in range(3):
        shift = step * deviations * (np.arange(3) == i)
        pair = [log_likelihood(rows, learned.mean + sign * shift, learned.covariance) for sign in (1, -1)]
        assert abs(pair[0] - pair[1]) / (2 * step) < 1e-4
        for j in range(i + 1):
            bump = np.zeros((3, 3))
            bump[i, j] = bump[j, i] = step * deviations[i] * deviations[j]
            pair = [log_likelihood(rows, learned.mean, learned.covariance + sign * bump) for sign in (1, -1)]
            assert abs(pair[0] - pair[1]) / (2 * step) < 1e-4


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.floats(-9, 9), min_size=3, max_size=3),
    st.lists(st.floats(-100, 100), min_size=3, max_size=3),
    st.permutations(range(3)),
    st.integers(0, 99),
)
def test_units_and_the_order_of_rows_and_modes_do_not_matter(exponents, shift, modes, seed):
    scale, order = 10.0 ** np.array(exponents), np.random.default_rng(seed).permutation(len(GAPPY))
    other = Gaussian.fitted((scale * (GAPPY + shift))[order][:, modes])
    np.testing.assert_allclose(other.mean, (scale * (LEARNED.mean + shift))[modes], rtol=1e-7, atol=1e-9 * scale.max())
    expected = (LEARNED.covariance * np.outer(scale, scale))[np.ix_(modes, modes)]
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(other.covariance / size, expected / size, atol=1e-6)


def test_the_truth_is_found_where_half_of_the_entries_are_missing():
    rows = with_gaps(records(40_000), 0.6)
    assert np.isnan(rows).mean() > 0.39
    learned = Gaussian.fitted(rows)
    size = np.sqrt(np.outer(np.diag(COVARIANCE), np.diag(COVARIANCE)))
    np.testing.assert_allclose((learned.mean - MEAN) / np.sqrt(np.diag(COVARIANCE)), 0, atol=0.03)
    np.testing.assert_allclose((learned.covariance - COVARIANCE) / size, 0, atol=0.03)


def test_gaps_that_follow_another_mode_do_not_bias_the_mean():
    """A mode that is missed where another one is high: its own mean over the records that have it would be off."""
    rows = records(20_000)
    rows[rows[:, 1] > MEAN[1], 0] = np.nan
    deviation = np.sqrt(COVARIANCE[0, 0])
    assert abs(np.nanmean(rows[:, 0]) - MEAN[0]) > 0.3 * deviation
    assert Gaussian.fitted(rows).mean[0] == pytest.approx(MEAN[0], abs=0.03 * deviation)


def test_second_moments_have_the_covariance_as_their_mean():
    np.testing.assert_allclose(LEARNED.second_moments(GAPPY).mean(axis=0), LEARNED.covariance, rtol=1e-6)


def test_whitened_rows_have_unit_spread_and_their_lengths_are_the_distances():
    rows = with_gaps(records(20_000))
    white = Gaussian(MEAN, COVARIANCE).whiten(rows)
    np.testing.assert_array_equal(np.isnan(white), np.isnan(rows))
    for pattern in patterns(~np.isnan(rows))[0]:
        same = (~np.isnan(rows) == pattern).all(axis=1)
        spread, error = np.cov(white[same][:, pattern].T), np.sqrt(2 / same.sum())
        np.testing.assert_allclose(spread, np.eye(pattern.sum()), atol=4 * error)
    distances = [
        mahalanobis(row[there], MEAN[there], np.linalg.inv(COVARIANCE[np.ix_(there, there)]))
        for row in rows[:50]
        for there in [~np.isnan(row)]
    ]
    np.testing.assert_allclose(np.sqrt(np.nansum(white[:50] ** 2, axis=1)), distances, rtol=1e-10)


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 20), st.integers(0, 1000))
def test_patterns_are_the_different_rows_of_a_mask(n_modes, seed):
    mask = np.random.default_rng(seed).random((40, n_modes)) < 0.7
    masks, of_row = patterns(mask)
    np.testing.assert_array_equal(masks[of_row], mask)
    assert len(masks) == len(np.unique(mask, axis=0))


# Baselines that cannot be learned from


def test_a_mode_that_is_never_there_is_named():
    rows = GAPPY.copy()
    rows[:, 1] = np.nan
    with pytest.raises(ValueError, match="'f2' is NaN in all 400 rows"):
        MahalanobisDetector().fit(rows)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.5])
@pytest.mark.parametrize("weights", [[1, 0, 0], [1, 2, 3]], ids=["copy", "sum"])
def test_a_mode_that_others_determine_is_found_in_spite_of_gaps(weights, share):
    rows = with_gaps(np.column_stack([F, F @ weights]), share)
    with pytest.raises(ValueError, match=r"singular \(rank 3\)"):
        MahalanobisDetector().fit(rows)


def test_a_mode_with_a_single_value_has_no_variance():
    rows = F.copy()
    rows[1:, 2] = np.nan
    with pytest.raises(ValueError, match=r"singular|one value"):
        MahalanobisDetector().fit(rows)


def test_modes_that_are_never_there_together_leave_the_rest_as_it_is():
    """Records do not say how the two are correlated: any number that fits the rest is as likely, and one is taken."""
    rows = records(20_000)
    rows[::2, 0] = rows[1::2, 1] = np.nan
    learned = Gaussian.fitted(rows).covariance
    assert np.linalg.eigvalsh(learned).min() > 0
    size = np.sqrt(np.outer(np.diag(COVARIANCE), np.diag(COVARIANCE)))
    seen = np.array([[1, 0, 1], [0, 1, 1], [1, 1, 1]], dtype=bool)
    np.testing.assert_allclose((learned / size)[seen], (COVARIANCE / size)[seen], atol=0.05)


# The index


def test_complete_rows_have_the_plain_distance_whatever_the_baseline_lacks():
    detector = MahalanobisDetector().fit(GAPPY)
    learned = detector.covariance_
    inverse = np.linalg.inv(learned.covariance_)
    expected = [mahalanobis(row, learned.location_, inverse) for row in F[:20]]
    np.testing.assert_allclose(detector.damage_index(F[:20]), expected, rtol=1e-9)
    np.testing.assert_allclose(detector.damage_index(np.vstack([F[:20], GAPPY]))[:20], expected, rtol=1e-9)
    np.testing.assert_allclose(learned.mahalanobis(F[:20]), np.square(expected), rtol=1e-9)
    np.testing.assert_allclose(learned.precision_, inverse, rtol=1e-9)


def test_a_baseline_without_gaps_evaluates_rows_with_gaps_by_their_own_modes():
    """All patterns have the factor 1: the baseline does not say otherwise."""
    detector = MahalanobisDetector().fit(F)
    for there in ([0], [1, 2], [0, 2]):
        rows = np.full((30, 3), np.nan)
        rows[:, there] = F[:30, there]
        inverse = np.linalg.inv(detector.covariance_.covariance_[np.ix_(there, there)])
        distances = [mahalanobis(row[there], detector.covariance_.location_[there], inverse) for row in rows]
        expected = as_if_complete(np.array(distances), np.full(30, len(there)), 3)
        np.testing.assert_allclose(detector.damage_index(rows), expected, rtol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 399), st.floats(1.01, 100))
def test_a_row_farther_away_in_the_same_direction_has_a_higher_index(row, factor):
    detector = MahalanobisDetector().fit(GAPPY)
    near = GAPPY[[row]]
    far = LEARNED.mean + factor * (near - LEARNED.mean)
    assert detector.damage_index(far)[0] > detector.damage_index(near)[0]


def test_rows_of_any_number_at_once_have_the_same_index(monkeypatch):
    detector = MahalanobisDetector().fit(GAPPY)
    whole = detector.damage_index(GAPPY)
    monkeypatch.setattr("skthermo.detection._mahalanobis.ROWS_AT_ONCE", 7)
    np.testing.assert_allclose(detector.damage_index(GAPPY), whole, rtol=1e-9)


def test_a_shrunk_covariance_evaluates_rows_with_gaps_and_learns_from_complete_ones():
    detector = MahalanobisDetector(covariance=LedoitWolf()).fit(GAPPY)
    complete = GAPPY[~np.isnan(GAPPY).any(axis=1)]
    np.testing.assert_allclose(detector.covariance_.covariance_, LedoitWolf().fit(complete).covariance_, rtol=1e-12)
    assert not np.isnan(detector.damage_index(GAPPY)).any()
    with pytest.raises(
        ValueError, match="0 of 400 rows have every mode; expected at least 2 for the covariance Ledoit"
    ):
        MahalanobisDetector(covariance=LedoitWolf()).fit(np.where(np.eye(3)[np.arange(400) % 3] > 0, np.nan, F))


def test_only_rows_without_any_mode_have_no_index_and_are_not_evaluated():
    stamps = pd.date_range("2025", periods=400, freq="h")
    frame = pd.DataFrame(GAPPY, stamps, ["f1", "f2", "f3"])
    frame.iloc[[3, 7]] = np.nan
    frame.iloc[8] = [np.nan, np.nan, 20.0]
    with pytest.warns(UserWarning, match="'f3' is 20 .* in 1 of 400 rows.*set-aside"):
        detector = MahalanobisDetector().fit(frame)
    index = detector.damage_index(frame)
    assert index.index.equals(stamps)
    np.testing.assert_array_equal(np.flatnonzero(index.isna()), [3, 7])
    with pytest.warns(UserWarning, match="2 of 400 .*row 3.*not-evaluated"):
        alarms = detector.predict(frame)
    np.testing.assert_array_equal(alarms[[3, 7, 8]], [0, 0, -1])


# From few modes to many


@pytest.mark.parametrize("n_modes", [1, 2, 3, 6, 12])
def test_distances_in_few_modes_become_as_unlikely_ones_in_many(n_modes):
    chances = np.array([0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.001])
    for n_present in range(1, n_modes + 1):
        mapped = as_if_complete(chi.isf(chances, n_present), np.full(len(chances), n_present), n_modes)
        np.testing.assert_allclose(mapped, chi.isf(chances, n_modes), rtol=0.02)


@pytest.mark.parametrize(("n_present", "n_modes"), [(1, 2), (1, 6), (3, 4), (5, 6), (1, 30)])
def test_the_map_to_complete_rows_keeps_order_and_gives_numbers(n_present, n_modes):
    distances = np.concatenate([[0.0], np.geomspace(1e-6, 1e6, 1000)])
    mapped = as_if_complete(distances, np.full(1001, n_present), n_modes)
    assert (np.diff(mapped) >= 0).all()
    assert (np.diff(mapped[distances > 1e-3]) > 0).all()


def test_the_map_leaves_complete_rows_as_they_are():
    distances = np.linspace(0, 9, 100)
    np.testing.assert_array_equal(as_if_complete(distances, np.full(100, 4), 4), distances)
    assert np.isnan(as_if_complete(np.array([1.0]), np.array([0]), 4)[0])


# Alarms by pattern


def alarm_rates(detector, rows):
    masks, of_row = patterns(~np.isnan(rows))
    alarms = detector.damage_index(rows) > detector.threshold_
    return {tuple(mask): alarms[of_row == i].mean() for i, mask in enumerate(masks)}


def test_false_alarms_are_alike_in_all_patterns():
    baseline, later = (with_gaps(records(n, n), 0.5, n) for n in (20_000, 50_000))
    rates = alarm_rates(MahalanobisDetector().fit(baseline), later)
    assert len(rates) == 7
    assert max(abs(rate - 0.02) for rate in rates.values()) < 0.01


def test_patterns_with_twice_the_variance_raise_as_many_alarms_as_others():
    """Modes are missed where excitation is weak, and then the others are noisier too."""

    def weakly_excited(n_rows, seed):
        rows = with_gaps(records(n_rows, seed), 0.4, seed)
        noisy = np.isnan(rows).any(axis=1)
        rows[noisy] = MEAN + np.sqrt(2) * (rows[noisy] - MEAN)
        return rows

    baseline, later = weakly_excited(30_000, 1), weakly_excited(60_000, 2)
    detector = MahalanobisDetector().fit(baseline)
    rates = alarm_rates(detector, later)
    assert max(abs(rate - 0.02) for rate in rates.values()) < 0.01
    detector.pattern_scale_ = MahalanobisDetector().fit(F).pattern_scale_  # factors of 1
    before = alarm_rates(detector, later)
    assert min(rate for pattern, rate in before.items() if not all(pattern)) > 0.04


def test_one_noisy_pattern_of_several_raises_as_many_alarms_as_others():
    """The first mode is missed where all others are noisier, the second whenever."""

    def first_in_noise(n_rows, seed):
        rows, drawn = records(n_rows, seed), np.random.default_rng(seed).random(n_rows)
        rows[drawn < 0.2] = MEAN + 1.4 * (rows[drawn < 0.2] - MEAN)
        rows[drawn < 0.2, 0] = rows[drawn > 0.8, 1] = np.nan
        return rows

    rates = alarm_rates(MahalanobisDetector().fit(first_in_noise(20_000, 1)), first_in_noise(40_000, 2))
    assert len(rates) == 3
    assert max(abs(rate - 0.02) for rate in rates.values()) < 0.008


def test_patterns_alike_get_no_factors():
    """Differences that chance explains are left alone."""
    masks = np.array([[1, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]], dtype=bool)
    fits = (MahalanobisDetector().fit(with_gaps(records(2000, seed), 0.5, seed)) for seed in range(20))
    factors = np.array([detector.pattern_scale_(masks) for detector in fits])
    assert (factors == 1).all(axis=1).mean() > 0.7
    np.testing.assert_allclose(factors, 1, atol=0.15)


@pytest.mark.filterwarnings("ignore:.*few-baseline-records", "ignore:.*high-threshold")
def test_rare_patterns_get_no_factors():
    rare = F.copy()
    rare[:40, 0] = np.nan
    rare[:40, 1:] += 0.3
    np.testing.assert_array_equal(MahalanobisDetector().fit(rare).pattern_scale_(~np.isnan(rare)), 1)
