"""Scores of compensators and detectors: likelihoods that can be compared, by which searches need no damage."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal
from sklearn.base import clone
from sklearn.covariance import LedoitWolf
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression
from sklearn.mixture import GaussianMixture
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import KernelDensity, KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import (
    FusedDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
    WindowedAlarm,
)
from skthermo.preprocessing import BlockedKFold

pytestmark = [  # folds of few records predict weather not seen, and raw frequencies follow the season
    pytest.mark.filterwarnings("ignore:.*weather-of-one-fold"),
    pytest.mark.filterwarnings("ignore:.*outside-training-weather"),
    pytest.mark.filterwarnings("ignore:.*few-baseline-records"),
    pytest.mark.filterwarnings("ignore:.*frequency-outliers"),
    pytest.mark.filterwarnings("ignore:.*filled-temperatures"),
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
    expected = multivariate_normal(mean, covariance).logpdf(NEW[MODES])
    assert detector.score(NEW[MODES]) == pytest.approx(expected.mean() / len(MODES))
    shrunk = MahalanobisDetector(covariance=LedoitWolf()).fit(X[MODES])
    assert shrunk.score(NEW[MODES]) == pytest.approx(shrunk.covariance_.score(NEW[MODES].to_numpy()) / len(MODES))


def test_with_gaps_it_is_that_of_the_modes_that_are_there():
    detector, holed = MahalanobisDetector().fit(X[MODES]), HOLED[MODES].to_numpy()
    mean, covariance = detector.covariance_.location_, detector.covariance_.covariance_
    known = ~np.isnan(holed)
    parts = [(mean[k], covariance[np.ix_(k, k)], row[k]) for row, k in zip(holed, known, strict=True) if k.any()]
    expected = sum(multivariate_normal(m, c).logpdf(row) for m, c, row in parts) / known.sum()
    assert detector.score(HOLED[MODES]) == pytest.approx(expected)
    half = NEW[MODES].copy()
    half.iloc[: len(half) // 2 + 1] = np.nan
    with pytest.warns(UserWarning, match="182 of 365.*rows-not-scored"):
        assert detector.score(half) == pytest.approx(detector.score(half.dropna()))


def test_units_shift_the_score_by_their_logarithm():
    one, other = (MahalanobisDetector().fit(scale * X[MODES]).score(scale * HOLED[MODES]) for scale in (1, 1000))
    assert one - other == pytest.approx(np.log(1000))


@pytest.mark.one_case
@pytest.mark.parametrize("records", [NEW, HOLED], ids=["complete", "with gaps"])
def test_what_residuals_are_divided_by_does_not_change_the_score(records):
    plain, whitened = (pipeline(whiten=whiten).fit(X) for whiten in (None, "global"))
    scores = [one.score(records) for one in (plain, whitened, plain[0], whitened[0])]
    np.testing.assert_allclose(scores, scores[0], rtol=1e-9)


@pytest.mark.one_case
@pytest.mark.parametrize("whiten", [None, "global", "local"])
@pytest.mark.parametrize("output", ["default", "pandas"])
def test_volumes_reach_the_detector_in_arrays_and_frames(whiten, output):
    by_position = TemperatureCompensator(LinearRegression(), targets=range(3, 9), whiten=whiten).set_output(
        transform=output
    )
    arrays = make_pipeline(by_position, MahalanobisDetector()).fit(X.to_numpy())
    own = arrays[0].score(NEW.to_numpy())
    assert arrays.score(NEW.to_numpy()) == pytest.approx(own, abs=1e-3)  # of all detectors of residuals near normal


@pytest.mark.nightly
def test_a_covariance_by_weather_is_likelier_where_residuals_scatter_more_in_frost():
    def frosty(seed):
        random = np.random.default_rng(seed)
        T = 10 - 12 * np.cos(2 * np.pi * np.arange(1000) / 365) + random.normal(0, 3, 1000)
        noise = random.normal(size=(1000, 2)) * np.where(T < 0, 0.3, 0.05)[:, np.newaxis]
        return pd.DataFrame(
            np.column_stack([T, [5.0, 9.0] - 0.02 * T[:, np.newaxis] + noise]), columns=["T", "f1", "f2"]
        )

    grid = {"whiten": [None, "global", "local"]}
    frost = TemperatureCompensator(LinearRegression(), targets=["f1", "f2"])
    search = GridSearchCV(frost, grid, cv=BlockedKFold(4)).fit(frosty(0))
    assert search.best_params_ == {"whiten": "local"}
    plain, whitened, local = search.cv_results_["mean_test_score"]
    assert plain == pytest.approx(whitened)
    detectors = [
        make_pipeline(clone(frost).set_params(whiten=whiten), MahalanobisDetector()) for whiten in ("global", "local")
    ]
    of_global, of_local = (detector.fit(frosty(0)).score(frosty(1)) for detector in detectors)
    assert of_local - of_global == pytest.approx(local - plain, abs=0.05)
    assert of_local - of_global > 0.2


@pytest.mark.nightly
def test_a_search_without_damage_chooses_what_predicts_best():
    grid = {"temperaturecompensator__estimator__n_neighbors": [1, 15]}
    search = GridSearchCV(pipeline(KNeighborsRegressor()), grid, cv=BlockedKFold(3)).fit(X)
    assert search.best_params_ == {"temperaturecompensator__estimator__n_neighbors": 15}
    assert search.score(NEW) == search.best_estimator_.score(NEW)
    alone = GridSearchCV(compensator(KNeighborsRegressor()), {"estimator__n_neighbors": [1, 15]}, cv=BlockedKFold(3))
    np.testing.assert_allclose(
        alone.fit(X).cv_results_["mean_test_score"], search.cv_results_["mean_test_score"], rtol=1e-6
    )


def test_filled_temperatures_widen_the_distribution():
    broken = NEW.copy()
    broken.loc[broken.index[::2], "T1"] = np.nan
    for whiten in (None, "global"):
        whole = pipeline(whiten=whiten).fit(X)
        assert whole.score(broken) == pytest.approx(whole[0].score(broken), rel=1e-6)
        assert whole.score(broken) < whole.score(NEW)


def test_rows_that_nothing_predicts_are_not_scored():
    fitted, blind = pipeline().fit(X), NEW.copy()
    blind.iloc[:3, :3] = np.nan
    with pytest.warns(UserWarning, match="3 of 365 .*not-predicted"):
        score = fitted.score(blind)
    assert score == pytest.approx(fitted.score(NEW.iloc[3:]))


@pytest.mark.filterwarnings("ignore:.*high-threshold")
def test_densities_of_other_packages_serve():
    for density in (GaussianMixture(random_state=0), KernelDensity(bandwidth=0.2)):
        detector = OutlierDetector(density).fit(X[MODES])
        expected = detector.estimator_.score_samples(NEW[MODES].to_numpy()).mean() / len(MODES)
        assert detector.score(NEW[MODES]) == pytest.approx(expected)
        assert np.isfinite(detector.score(HOLED[MODES]))  # of its complete rows
    single = OutlierDetector(GaussianMixture(random_state=0)).fit(X[MODES])
    assert single.score(NEW[MODES]) == pytest.approx(MahalanobisDetector().fit(X[MODES]).score(NEW[MODES]), rel=1e-3)


def test_detectors_without_a_distribution_have_no_score():
    others = OutlierDetector(IsolationForest()), WindowedAlarm(2), FusedDetector([("one", MahalanobisDetector())])
    assert not any(hasattr(detector, "score") for detector in others)
    with pytest.raises(TypeError, match="should have a 'score' method"):
        GridSearchCV(WindowedAlarm(2), {"window": [2, 3]}).fit(X[MODES])
