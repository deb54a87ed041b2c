"""The field's detectors: laws of those that scikit-learn lacks, and the rate of false alarms of each."""

import sys

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.distance import cdist
from sklearn.covariance import EmpiricalCovariance
from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from tests.examples.pages import recipes

FIELD = recipes("detector")
RECORDS = np.random.default_rng(0).multivariate_normal([0, 1, 2], [[2, 1, 0], [1, 2, 1], [0, 1, 3]], 200)


@pytest.fixture(scope="module")
def baseline():
    year = make_truss_campaign(random_state=0)
    return year.temperatures.join(year.frequencies)


@pytest.fixture(scope="module")
def targets(baseline):
    return [name for name in baseline if name.startswith("f")]


def test_there_are_many_with_and_without_temperatures(targets):
    names = list(FIELD.field_detectors(targets))
    assert len(names) >= 17
    assert sum(name.startswith("raw") for name in names) >= 8
    assert not [name for name in names if name.startswith("chain")]
    few = FIELD.field_detectors(["f1", "f2"])
    assert "raw, less 1 component" in few
    assert "raw, less 2 components" not in few


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*(not-evaluated|few-records)")  # trees leave residuals that follow the season
def test_gaps_are_not_evaluated_by_those_that_need_complete_rows(baseline, targets):
    later = make_truss_campaign(samples_per_year=6, random_state=1)
    gaps = later.temperatures.join(later.frequencies)
    gaps.loc[gaps.index[1], "f2"], gaps.iloc[3] = np.nan, np.nan
    for name, detector in FIELD.field_detectors(targets, Ridge()).items():
        sees = targets if name.startswith("raw") else list(baseline)
        if name.startswith("boosted trees"):
            detector.set_params(regressor__estimator__n_estimators=10)
        with pytest.warns(UserWarning, match="not-evaluated"):
            decisions = detector.fit(baseline[sees]).predict(gaps[sees])
        last = getattr(detector, "detector", detector)
        unknown = [3] if isinstance(last, MahalanobisDetector) else [1, 3]
        np.testing.assert_array_equal(np.flatnonzero(decisions == 0), unknown, err_msg=name)


def test_the_distance_to_the_kth_neighbour_is_that_of_sorted_distances():
    new = RECORDS[:5] + 0.1
    scores = FIELD.NeighbourDistance(7).fit(RECORDS).score_samples(new)
    np.testing.assert_allclose(scores, -np.sort(cdist(new, RECORDS))[:, 6])


def test_components_that_are_left_out_do_not_count():
    whole = EmpiricalCovariance().fit(RECORDS).mahalanobis(RECORDS) * (len(RECORDS) - 1) / len(RECORDS)
    np.testing.assert_allclose(FIELD.MinorComponents(0).fit(RECORDS).score_samples(RECORDS), -np.sqrt(whole))
    first = np.linalg.eigh(np.cov(RECORDS.T))[1][:, -1]
    less = FIELD.MinorComponents(1).fit(RECORDS)
    np.testing.assert_allclose(less.score_samples(RECORDS + 9 * first), less.score_samples(RECORDS))


def test_a_factor_common_to_all_columns_counts_little():
    random, loadings = np.random.default_rng(0), np.array([1.0, -2.0, 1.5, 1.0])
    rows = random.normal(size=(500, 1)) * loadings + 0.1 * random.normal(size=(500, 4))
    specific = FIELD.SpecificFactors().fit(rows)
    across = np.array([2.0, 1.0, 0.0, 0.0])
    along, other = -specific.score_samples(np.array([3 * loadings, 3 * across]))
    assert along < 0.1 * other
    length = np.sqrt(8 / np.pi)  # mean of that of three unit deviations: the factor takes one of four
    assert -specific.score_samples(rows).mean() == pytest.approx(length, rel=0.05)


def test_a_conditional_covariance_is_that_of_records_in_similar_weather():
    """The scatter grows in frost: the same departure counts there less."""
    random = np.random.default_rng(0)
    T = np.r_[np.full(300, -5.0), np.full(300, 10.0)] + random.normal(size=600)
    F = np.where(T < 2, 3.0, 1.0)[:, np.newaxis] * random.normal(size=(600, 2)) + np.outer(T, [1.0, 2.0])
    detector = FIELD.ConditionalCovariance(["f1", "f2"], n_neighbors=100).fit(np.column_stack([T, F]))
    frost, mild = -detector.score_samples([[-5.0, -5.0 + 6, -10.0], [10.0, 10.0 + 6, 20.0]])
    assert frost == pytest.approx(6 / 3, rel=0.25)
    assert mild == pytest.approx(6 / 1, rel=0.25)


def test_columns_that_wander_together_are_evaluated_by_what_keeps_them_together():
    random = np.random.default_rng(0)
    walk = random.normal(size=600).cumsum()
    noise = random.normal(size=600)
    rows = np.column_stack([walk, 2 * walk + noise])
    together = FIELD.Cointegration().fit(rows)
    assert together.vector_[0] / together.vector_[1] == pytest.approx(-2, rel=0.02)
    expected = np.abs(noise - noise.mean()) / noise.std()
    np.testing.assert_allclose(-together.score_samples(rows), expected, atol=0.2)
    moved = together.score_samples(rows + [[50.0, 100.0]])
    np.testing.assert_allclose(moved, together.score_samples(rows), atol=1)


def test_without_statsmodels_the_error_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "statsmodels.tsa.vector_ar.vecm", None)
    with pytest.raises(ImportError, match="cointegration needs statsmodels; get it with: pip install statsmodels"):
        FIELD.Cointegration().fit(RECORDS)


def test_blocks_are_as_long_as_wanted(targets):
    stamps = pd.date_range("2025", periods=400, freq="h")
    rows = pd.DataFrame(np.random.default_rng(0).normal(size=(400, 6)), stamps, targets)
    for name, detector in FIELD.field_detectors(targets, block="1D").items():
        if "neighbours" in name:
            last = getattr(detector, "detector", detector)
            assert last.block == "1D"
    FIELD.field_detectors(targets, block="1D")["raw, 20 neighbours"].fit(rows)
