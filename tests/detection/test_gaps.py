"""Missing modes: indices that mean the same in every pattern."""

import functools

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import mahalanobis
from scipy.stats import chi
from sklearn.covariance import LedoitWolf

from skthermo.detection import DirectionalDetector, MahalanobisDetector
from tests.gappy_rows import COVARIANCE, MEAN, records, with_gaps

F = records(400)
GAPPY = with_gaps(F)


@functools.cache
def learned():
    return MahalanobisDetector().fit(GAPPY)


def test_a_mode_that_is_never_there_is_named():
    rows = GAPPY.copy()
    rows[:, 1] = np.nan
    with pytest.raises(ValueError, match="column 1 has no value in 400 rows"):
        MahalanobisDetector().fit(rows)


@pytest.mark.parametrize(("weights", "share"), [([1, 0, 0], 0.02), ([1, 0, 0], 0.5), ([1, 2, 3], 0.3)])
def test_a_mode_that_others_determine_is_found_in_spite_of_gaps(weights, share):
    rows = with_gaps(np.column_stack([F, F @ weights]), share)
    with pytest.raises(ValueError, match=r"singular \(rank 3\)"):
        MahalanobisDetector().fit(rows)


def test_complete_rows_have_the_plain_distance_whatever_the_baseline_lacks():
    detector = learned()
    covariance, level = detector.covariance_, detector.report_["level"].to_numpy()
    inverse = np.linalg.inv(covariance.covariance_)
    expected = [mahalanobis(row / level, covariance.location_, inverse) for row in F[:20]]
    np.testing.assert_allclose(detector.damage_index(F[:20]), expected, rtol=1e-9)
    np.testing.assert_allclose(detector.damage_index(np.vstack([F[:20], GAPPY]))[:20], expected, rtol=1e-9)
    np.testing.assert_allclose(covariance.mahalanobis(F[:20] / level), np.square(expected), rtol=1e-9)


@pytest.mark.parametrize("there", [[0], [1, 2], [0, 2]])
def test_a_distance_in_few_modes_is_as_rare_as_the_index_that_it_becomes(there):
    """Normal records exceed both equally often, to 2 % of the index."""
    detector = MahalanobisDetector().fit(records(20_000))
    rows = np.full((400, 3), np.nan)
    rows[:, there] = F[:, there]
    mean, covariance = MEAN[there], COVARIANCE[np.ix_(there, there)]
    distances = np.array([mahalanobis(row[there], mean, np.linalg.inv(covariance)) for row in rows])
    expected = chi.isf(chi.sf(distances, len(there)), 3)
    far = expected > 1
    np.testing.assert_allclose(detector.damage_index(rows)[far], expected[far], rtol=0.05)


@settings(max_examples=30)
@given(st.integers(0, 399), st.floats(1.01, 100))
def test_a_row_farther_away_in_the_same_direction_has_a_higher_index(row, factor):
    detector = learned()
    centre = detector.covariance_.location_ * detector.report_["level"].to_numpy()
    far = centre + factor * (GAPPY[[row]] - centre)
    assert detector.damage_index(far)[0] > detector.damage_index(GAPPY[[row]])[0]


def test_a_row_has_the_same_index_whatever_rows_are_with_it():
    for detector in (MahalanobisDetector().fit(GAPPY), DirectionalDetector().fit(GAPPY)):
        whole = detector.damage_index(GAPPY)
        alone = np.concatenate([detector.damage_index(GAPPY[i : i + 7]) for i in range(0, 400, 7)])
        np.testing.assert_allclose(alone, whole, rtol=1e-9)


def test_a_shrunk_covariance_evaluates_rows_with_gaps_and_learns_from_complete_ones():
    detector = MahalanobisDetector(covariance=LedoitWolf()).fit(GAPPY)
    complete = (GAPPY / detector.report_["level"].to_numpy())[~np.isnan(GAPPY).any(axis=1)]
    np.testing.assert_allclose(detector.covariance_.covariance_, LedoitWolf().fit(complete).covariance_, rtol=1e-12)
    assert not np.isnan(detector.damage_index(GAPPY)).any()
    never_whole = np.where(np.eye(3)[np.arange(400) % 3] > 0, np.nan, F)
    with pytest.raises(ValueError, match="0 of 400 rows have every mode"):
        MahalanobisDetector(covariance=LedoitWolf()).fit(never_whole)


def test_a_mode_that_is_stuck_teaches_as_if_it_were_missing_in_any_order_of_rows():
    stamps = pd.date_range("2025", periods=400, freq="h")
    stuck, missing = (pd.DataFrame(F, stamps, ["f1", "f2", "f3"]) for _ in range(2))
    stuck.iloc[100:180, 1], missing.iloc[100:180, 1] = F[100, 1], np.nan
    expected = MahalanobisDetector().fit(missing)
    for table in (stuck, stuck[::-1]):
        with pytest.warns(UserWarning, match="'f2'.*set-aside"):
            found = MahalanobisDetector().fit(table)
        assert found.report_["n_set_aside"].tolist() == [0, 80, 0]
        np.testing.assert_allclose(found.damage_index(missing), expected.damage_index(missing), rtol=1e-9)


def test_only_rows_without_any_mode_have_no_index_and_are_not_evaluated():
    stamps = pd.date_range("2025", periods=400, freq="h")
    frame = pd.DataFrame(GAPPY, stamps, ["f1", "f2", "f3"])
    frame.iloc[[3, 7]] = np.nan
    frame.iloc[8] = [np.nan, np.nan, 20.0]
    with pytest.warns(UserWarning, match="set-aside"):
        detector = MahalanobisDetector().fit(frame)
    assert detector.report_["n_set_aside"].tolist() == [0, 0, 1]
    index = detector.damage_index(frame)
    assert index.index.equals(stamps)
    np.testing.assert_array_equal(np.flatnonzero(index.isna()), [3, 7])
    with pytest.warns(UserWarning, match="2 of 400 .*row 3.*not-evaluated"):
        alarms = detector.predict(frame)
    np.testing.assert_array_equal(alarms[[3, 7, 8]], [0, 0, -1])


def test_false_alarms_are_alike_in_all_patterns():
    baseline, later = (with_gaps(records(n, n), 0.5, n) for n in (20_000, 50_000))
    learned = MahalanobisDetector().fit(baseline)
    level = learned.report_["level"].to_numpy()
    np.testing.assert_allclose(learned.covariance_.covariance_ * np.outer(level, level), COVARIANCE, atol=5e-4)
    for detector in (MahalanobisDetector(), DirectionalDetector()):
        alarms, missing = detector.fit(baseline).predict(later) == -1, np.isnan(later).sum(axis=1)
        rates = [alarms[missing == number].mean() for number in range(3)]
        assert max(abs(rate - 0.02) for rate in rates) < 0.015
