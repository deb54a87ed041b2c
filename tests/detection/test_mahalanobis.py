"""The damage index and its alarms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import mahalanobis
from sklearn.covariance import LedoitWolf, ledoit_wolf

from skthermo.detection import MahalanobisDetector

RNG = np.random.default_rng(0)
COVARIANCE = np.array([[1.0, 0.6, 0.2], [0.6, 2.0, 0.3], [0.2, 0.3, 0.5]])
F = RNG.multivariate_normal([4, 9, 12], 0.01 * COVARIANCE, 400)


def test_scores_form_one_chain():
    detector = MahalanobisDetector().fit(F)
    index = detector.damage_index(F)
    np.testing.assert_array_equal(detector.score_samples(F), -index)
    np.testing.assert_array_equal(detector.decision_function(F), detector.threshold_ - index)
    np.testing.assert_array_equal(detector.predict(F) == -1, index > detector.threshold_)


@settings(max_examples=8)
@given(st.lists(st.floats(-12, 12), min_size=3, max_size=3))
def test_index_does_not_depend_on_units(exponents):
    scale = 10.0 ** np.array(exponents)
    scaled, plain = MahalanobisDetector().fit(F * scale), MahalanobisDetector().fit(F)
    np.testing.assert_allclose(scaled.damage_index(F * scale), plain.damage_index(F), rtol=1e-9)


@pytest.mark.parametrize("ask", ["damage_index", "decision_function", "predict"])
def test_a_call_in_which_nothing_can_be_evaluated_says_so_once(ask):
    detector = MahalanobisDetector().fit(F)
    with pytest.warns(UserWarning, match="24 of 24 rows.*not-evaluated") as given:
        found = getattr(detector, ask)(np.full((24, 3), np.nan))
    assert len(given) == 1
    assert (found == 0).all() if ask == "predict" else np.isnan(found).all()


def test_rows_without_any_mode_do_not_enter_the_baseline():
    holed = np.vstack([F, np.full((5, 3), np.nan)])
    with_them, without = (MahalanobisDetector().fit(rows) for rows in (holed, F))
    assert with_them.threshold_ == pytest.approx(without.threshold_, rel=1e-9)
    np.testing.assert_allclose(with_them.damage_index(F), without.damage_index(F), rtol=1e-6)


def test_rows_with_some_modes_enter_the_baseline():
    high = F[:, 1:].mean(axis=0) + 3 * F[:, 1:].std(axis=0)
    holed = np.vstack([F, [[np.nan, *high]]])
    detector = MahalanobisDetector().fit(holed)
    mean = detector.covariance_.location_ * detector.report_["level"].to_numpy()
    np.testing.assert_allclose(mean[1:], holed[:, 1:].mean(axis=0))
    assert mean[0] != pytest.approx(F[:, 0].mean(), rel=1e-5)


@pytest.mark.parametrize(
    ("X", "message"),
    [
        (F[:3], r"covariance of 3 baseline rows and 3 modes is singular \(rank 2\)"),
        (np.column_stack([F, F[:, 0] * 1e-9]), r"singular \(rank 3\)"),
        (np.column_stack([F, np.full(len(F), 4.1)]), "column 3 has a single value"),
        (np.column_stack([F, F[:, 0] + F[:, 1]]), r"400 baseline rows and 4 modes is singular \(rank 3\)"),
        (F[:1], "1 sample"),
        (np.vstack([F[:1], np.full((5, 3), np.nan)]), "has a single value"),
    ],
)
def test_bad_baselines_are_named(X, message):
    with pytest.raises(ValueError, match=message):
        MahalanobisDetector().fit(X)


@pytest.mark.filterwarnings("ignore:.*few-records")
def test_few_records_do_with_a_shrunk_covariance():
    detector = MahalanobisDetector(0.02, covariance=LedoitWolf(), threshold="quantile").fit(F[:3])
    relative = F[:3] / F[:3].mean(axis=0)
    inverse = np.linalg.inv(ledoit_wolf(relative)[0])
    expected = [mahalanobis(row, np.ones(3), inverse) for row in relative]
    assert detector.threshold_ == pytest.approx(np.quantile(expected, 0.98), rel=1e-10)
