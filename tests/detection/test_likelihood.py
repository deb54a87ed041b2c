"""Scores of compensators and detectors: likelihoods that can be compared, by which searches need no damage."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from sklearn.covariance import LedoitWolf
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression
from sklearn.mixture import GaussianMixture
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import KernelDensity
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import (
    CompensatedDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
)

pytestmark = [  # folds of few records predict weather not seen, and raw frequencies follow the season
    pytest.mark.filterwarnings("ignore:.*other-weather"),
    pytest.mark.filterwarnings("ignore:.*few-records"),
    pytest.mark.filterwarnings("ignore:.*doubtful-values"),
    pytest.mark.filterwarnings("ignore:.*faulty-sensor"),
]

BASELINE, LATER = (make_truss_campaign(random_state=seed) for seed in (0, 1))
MODES = list(BASELINE.frequencies)
X, NEW = (campaign.temperatures.join(campaign.frequencies) for campaign in (BASELINE, LATER))
HOLED = NEW.mask(np.random.default_rng(0).random(NEW.shape) < 0.1)


def compensator(estimator=None, **options):
    return TemperatureCompensator(LinearRegression() if estimator is None else estimator, targets=MODES, **options)


def pipeline(*arguments, **options):
    return make_pipeline(compensator(*arguments, **options), MahalanobisDetector())


def test_the_score_is_the_log_likelihood_of_each_value():
    detector = MahalanobisDetector().fit(X[MODES])
    mean, covariance = detector.covariance_.location_, detector.covariance_.covariance_
    relative = NEW[MODES].to_numpy() / detector.report_["level"].to_numpy()
    expected = multivariate_normal(mean, covariance).logpdf(relative)
    assert detector.score(NEW[MODES]) == pytest.approx(expected.mean() / len(MODES))
    shrunk = MahalanobisDetector(covariance=LedoitWolf()).fit(X[MODES])
    assert shrunk.score(NEW[MODES]) == pytest.approx(shrunk.covariance_.score(relative) / len(MODES))


def test_with_gaps_it_is_that_of_the_modes_that_are_there():
    detector, holed = MahalanobisDetector().fit(X[MODES]), HOLED[MODES].to_numpy()
    holed = holed / detector.report_["level"].to_numpy()
    mean, covariance = detector.covariance_.location_, detector.covariance_.covariance_
    known = ~np.isnan(holed)
    parts = [(mean[k], covariance[np.ix_(k, k)], row[k]) for row, k in zip(holed, known, strict=True) if k.any()]
    expected = sum(multivariate_normal(m, c).logpdf(row) for m, c, row in parts) / known.sum()
    assert detector.score(HOLED[MODES]) == pytest.approx(expected)
    half = NEW[MODES].copy()
    half.iloc[: len(half) // 2 + 1] = np.nan
    with pytest.warns(UserWarning, match="not-evaluated"):
        assert detector.score(half) == pytest.approx(detector.score(half.dropna()))


def test_a_pipeline_a_whole_detector_and_its_compensator_score_alike():
    whole = CompensatedDetector(MahalanobisDetector(), LinearRegression(), targets=MODES, regimes=None).fit(X)
    behind = pipeline().fit(X)
    assert whole.score(HOLED) == pytest.approx(behind.score(HOLED), rel=1e-9)
    assert behind[0].score(HOLED) == pytest.approx(behind.score(HOLED), rel=1e-3)


def test_rows_that_nothing_predicts_are_not_scored():
    fitted, blind = pipeline().fit(X), NEW.copy()
    blind.iloc[:3, :3] = np.nan
    with pytest.warns(UserWarning, match="not-evaluated"):
        score = fitted.score(blind)
    assert score == pytest.approx(fitted.score(NEW.iloc[3:]))


def test_densities_of_other_packages_serve():
    for density in (GaussianMixture(random_state=0), KernelDensity(bandwidth=0.2)):
        detector = OutlierDetector(density).fit(X[MODES])
        relative = NEW[MODES].to_numpy() / detector.report_["level"].to_numpy()
        expected = detector.estimator_.score_samples(relative).mean() / len(MODES)
        assert detector.score(NEW[MODES]) == pytest.approx(expected)
        assert np.isfinite(detector.score(HOLED[MODES]))  # of its complete rows
    single = OutlierDetector(GaussianMixture(random_state=0)).fit(X[MODES])
    assert single.score(NEW[MODES]) == pytest.approx(MahalanobisDetector().fit(X[MODES]).score(NEW[MODES]), rel=1e-3)


def test_detectors_without_a_distribution_have_no_score():
    forest = OutlierDetector(IsolationForest())
    for detector in (forest, CompensatedDetector(forest, targets=MODES)):
        assert not hasattr(detector, "score")
        with pytest.raises(TypeError, match="should have a 'score' method"):
            GridSearchCV(detector, {"contamination": [0.1]}).fit(X)
