"""Thresholds that keep a rate of false alarms, and the leave-one-out distances that they are set on."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi
from sklearn.covariance import EmpiricalCovariance, LedoitWolf
from sklearn.model_selection import KFold

from skthermo.detection import MahalanobisDetector
from skthermo.detection._patterns import as_if_complete
from skthermo.detection._thresholds import conformal_threshold, quantile_threshold

TOO_FEW = pytest.mark.filterwarnings("ignore:.* independent baseline records are too few")


def records(n_rows=120, n_modes=4, seed=0):
    random = np.random.default_rng(seed)
    return 5 + random.normal(size=(n_rows, n_modes)) @ random.normal(size=(n_modes, n_modes))


def with_gaps(rows, share=0.3):
    return np.where(np.random.default_rng(1).random(rows.shape) < share, np.nan, rows)


def left_out(rows, **options):
    """Index of every row by a detector that is fitted on the others."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".* independent baseline records are too few")
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
        with pytest.warns(UserWarning, match=f"{len(index)} independent baseline records are too few"):
            assert conformal_threshold(padded, contamination) == max(index)


@pytest.mark.parametrize(("n_rows", "contamination", "rank"), [(49, 0.02, 49), (99, 0.02, 98), (19, 0.05, 19)])
def test_ranks_do_not_depend_on_rounding(n_rows, contamination, rank):
    """Fewest records for a rate: 1 / contamination - 1."""
    assert conformal_threshold(np.arange(1.0, n_rows + 1), contamination) == rank


def test_too_few_records_are_said_with_the_number_that_would_do():
    message = (
        "48 independent baseline records are too few for a rate of false alarms of 0.02: the threshold is the largest "
        "index, which later ones exceed at a rate of about 0.02; expected at least 49"
    )
    with pytest.warns(UserWarning, match=message):
        assert conformal_threshold(np.arange(48.0), 0.02) == 47


def test_dependent_records_raise_the_threshold_as_if_there_were_fewer():
    index = np.arange(1.0, 1001)
    alone, shared = (conformal_threshold(index, 0.05, share) for share in (1.0, 0.1))
    assert (alone, shared) == (951, 960)  # ceil(1001 * 0.95), ceil(101 * 0.95 / 0.1)
    with pytest.warns(UserWarning, match="10 independent baseline records"):
        assert conformal_threshold(index, 0.05, 0.01) == 1000


def test_the_quantile_leaves_out_records_without_an_index():
    index = np.random.default_rng(0).random(100)
    assert quantile_threshold(np.append(index, np.nan), 0.02) == np.quantile(index, 0.98)


def test_an_index_with_the_probability_asked_is_exceeded_by_a_new_one():
    """Of 49 exchangeable numbers, the largest is exceeded by the next with the probability 1 / 50."""
    drawn = np.random.default_rng(0).random((20_000, 50))
    thresholds = np.array([conformal_threshold(row[:49], 0.02) for row in drawn])
    assert (drawn[:, 49] > thresholds).mean() == pytest.approx(0.02, abs=0.003)


# In the detector


def test_conformal_is_the_default_and_takes_leave_one_out_distances():
    rows = records()
    expected = conformal_threshold(left_out(rows), 0.02)
    assert MahalanobisDetector().threshold == "conformal"
    assert MahalanobisDetector().fit(rows).threshold_ == pytest.approx(expected, rel=1e-10)


def test_the_closed_form_equals_refits_without_each_row():
    rows = records()
    np.testing.assert_allclose(MahalanobisDetector().fit(rows).baseline_index_, left_out(rows), rtol=1e-10)


def test_leave_one_out_distances_of_rows_with_gaps_are_close_to_refits(monkeypatch):
    """Their closed form counts the records that have the rarest mode of a row; refits without a row are the truth."""
    monkeypatch.setattr(
        "skthermo.detection._mahalanobis.PatternScale.__call__", lambda _, present: np.ones(len(present))
    )
    rows = with_gaps(records(200))
    present, detector = ~np.isnan(rows), MahalanobisDetector().fit(rows)
    in_sample = detector.damage_index(rows)
    closed = as_if_complete(detector._left_out(rows, detector._distances(rows)), present.sum(axis=1), 4)
    there, expected = present.any(axis=1), left_out(rows)
    errors, before = (np.abs(index / expected - 1)[there] for index in (closed, in_sample))
    assert np.median(errors) < 0.003
    assert errors.max() < 0.05
    assert np.median(before) > 0.01


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


def test_a_covariance_estimator_is_fitted_on_the_other_periods():
    rows = records(123)
    index = np.empty(123)
    for rest, fold in KFold(10).split(rows):
        index[fold] = np.sqrt(LedoitWolf().fit(rows[rest]).mahalanobis(rows[fold]))
    detector = MahalanobisDetector(covariance=LedoitWolf()).fit(rows)
    assert detector.threshold_ == pytest.approx(conformal_threshold(index, 0.02), rel=1e-12)
    np.testing.assert_allclose(detector.covariance_.covariance_, LedoitWolf().fit(rows).covariance_, rtol=1e-12)


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


@pytest.mark.parametrize("threshold", ["paper", None, 3.0])
def test_other_thresholds_are_named(threshold):
    with pytest.raises(ValueError, match="'threshold' parameter of MahalanobisDetector must be a str among"):
        MahalanobisDetector(threshold=threshold).fit(records())
