"""Thresholds that keep a rate of false alarms."""

import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from scipy.stats import chi
from sklearn.covariance import EmpiricalCovariance, LedoitWolf

from skthermo.detection import DirectionalDetector, MahalanobisDetector
from skthermo.residuals.numbers import independent_records

DETECTORS = [MahalanobisDetector, pytest.param(DirectionalDetector, marks=pytest.mark.nightly)]
TOO_FEW = pytest.mark.filterwarnings("ignore:.*few-records")


def records(n_rows=120, n_modes=4, seed=0):
    random = np.random.default_rng(seed)
    return random.normal(size=(n_rows, n_modes)) @ random.normal(size=(n_modes, n_modes))


def autoregressive(n_rows, correlation, seed=0, n_modes=4):
    """Records of unit variance that remember those before them."""
    noise = np.random.default_rng(seed).normal(size=(n_rows + 200, n_modes))
    return lfilter([np.sqrt(1 - correlation**2)], [1.0, -correlation], noise, axis=0)[200:]


@TOO_FEW
@pytest.mark.parametrize(
    ("n_rows", "correlation", "n_folds", "covariance"),
    [(123, 0, 5, None), (60, 0, 20, LedoitWolf()), (400, 0.9, 5, None)],
)
def test_each_record_is_evaluated_by_records_of_other_blocks_that_it_does_not_remember(
    n_rows, correlation, n_folds, covariance
):
    rows, index, number = autoregressive(n_rows, correlation), np.empty(n_rows), np.arange(n_rows)
    n_independent = independent_records(rows)
    folds = number // int(n_rows / np.clip(n_independent / 4, 5, 50)) % n_folds
    for fold in np.unique(folds):
        distance = np.abs(number[:, np.newaxis] - np.flatnonzero(folds == fold)).min(axis=1)
        train = distance >= max(min(int(n_rows / n_independent), n_rows // 6), 1)
        others = MahalanobisDetector(covariance=covariance, threshold="chi2").fit(rows[train])
        index[folds == fold] = others.damage_index(rows[folds == fold])
    detector = MahalanobisDetector(0.02, covariance=covariance).fit(rows)
    np.testing.assert_allclose(detector.baseline_index_, index, rtol=1e-9)
    rank = int(np.ceil((n_rows + 1) * 0.98))
    assert detector.threshold_ == pytest.approx(np.sort(index)[rank - 1])


@TOO_FEW
@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize(
    ("n_rows", "correlation", "most"), [(365, 0.0, 0.03), (60, 0.9, 0.05), (100, 0.95, 0.1), (365, 0.95, 0.03)]
)
def test_false_alarms_are_few_however_long_records_remember(detector, n_rows, correlation, most):
    rates = []
    for seed in range(10):
        baseline, new = np.split(0.01 * autoregressive(n_rows + 1000, correlation, seed, 6), [n_rows])
        fitted = detector(contamination=0.02).fit(baseline)
        rates.append((fitted.damage_index(new) > fitted.threshold_).mean())
        assert fitted.findings_ or fitted.n_independent_ > 15
    assert np.mean(rates) < most


def test_blocks_are_of_time_whatever_the_order_of_rows():
    rows, order = records(500), np.random.default_rng(0).permutation(500)
    frame = pd.DataFrame(rows, pd.date_range("2025", periods=500, freq="h")).rename(columns=str)
    index = MahalanobisDetector().fit(frame).baseline_index_
    np.testing.assert_allclose(MahalanobisDetector().fit(frame.iloc[order]).baseline_index_, index[order], rtol=1e-9)


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


@pytest.mark.parametrize("threshold", ["quantile", "chi2"])
def test_the_empirical_covariance_is_the_default(threshold):
    rows = records()
    default, given = (MahalanobisDetector(threshold=threshold, covariance=c) for c in (None, EmpiricalCovariance()))
    assert given.fit(rows).threshold_ == pytest.approx(default.fit(rows).threshold_, rel=1e-10)
    np.testing.assert_allclose(given.damage_index(rows), default.damage_index(rows), rtol=1e-10)


@TOO_FEW
@pytest.mark.parametrize("detector", DETECTORS)
def test_false_alarms_on_new_records_are_near_what_is_asked_where_the_baseline_is_small(detector):
    rates = {"quantile": [], "conformal": []}
    for seed in range(30):
        random = np.random.default_rng(seed)
        baseline, later = random.normal(size=(80, 5)), random.normal(size=(400, 5))
        for name, found in rates.items():
            fitted = detector(contamination=0.02, threshold=name).fit(0.01 * baseline)
            found.append((fitted.damage_index(0.01 * later) > fitted.threshold_).mean())
    error = np.std(rates["conformal"]) / np.sqrt(30)
    assert np.mean(rates["conformal"]) < 0.02 + 3 * error
    assert np.mean(rates["quantile"]) > 0.03


@TOO_FEW
def test_false_alarms_are_near_what_is_asked_where_records_remember_those_before():
    rates = []
    for seed in range(20):
        baseline, later = np.split(autoregressive(3000, 0.8, seed), [1000])
        detector = MahalanobisDetector(0.05).fit(baseline)
        rates.append((detector.damage_index(later) > detector.threshold_).mean())
    assert np.mean(rates) == pytest.approx(0.05, abs=0.015)


def test_few_independent_records_are_reported():
    with pytest.warns(UserWarning, match="few-records"):
        detector = MahalanobisDetector().fit(np.repeat(records(12, 3), 40, axis=0) + 0.1 * records(480, 3, 1))
    assert detector.n_independent_ < 49
    assert [finding.kind for finding in detector.findings_] == ["few-records"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert MahalanobisDetector().fit(records(600)).n_independent_ > 100


@TOO_FEW
def test_a_baseline_in_which_a_few_rows_decide_alone_about_a_direction_is_refused():
    with pytest.raises(ValueError, match="5 baseline rows are too few for their number of modes"):
        MahalanobisDetector().fit(records(5))


@pytest.mark.nightly
def test_both_tests_of_directions_have_their_share_of_the_false_alarms():
    random = np.random.RandomState(0)
    rows, falls = 0.01 * random.standard_normal((100_000, 6)), -np.eye(6)[:2]
    for share in (0.2, 0.5):
        detector = DirectionalDetector(falls, omnibus=share).fit(rows)
        alone = DirectionalDetector(falls, omnibus=0.0).fit(rows).damage_index(rows) > detector.threshold_
        by_omnibus = (detector.damage_index(rows) > detector.threshold_) & ~alone
        assert alone.mean() == pytest.approx(0.02 * (1 - share), rel=0.3)
        assert by_omnibus.mean() == pytest.approx(0.02 * share, rel=0.4)
