"""Several detectors as one."""

import pickle
from functools import cache

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import KNeighborsRegressor, LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.svm import OneClassSVM

from skthermo.datasets import make_truss_campaign
from skthermo.detection import (
    FusedDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
    WindowedAlarm,
)


def records(seed, damage=None, n_years=2):
    campaign = make_truss_campaign(n_years, damage=damage, random_state=seed)
    return campaign.temperatures.join(campaign.frequencies)


BASELINE, LATER, DAMAGED = records(0), records(1), records(2, {"top": 0.15})
MODES = [f"f{i}" for i in range(1, 7)]


def behind(regressor, detector=None):
    compensator = TemperatureCompensator(regressor, targets=MODES)
    return make_pipeline(compensator, MahalanobisDetector() if detector is None else detector)


def fused(**options):
    detectors = [("lines", behind(LinearRegression())), ("neighbours", behind(KNeighborsRegressor(10)))]
    return FusedDetector(detectors, **options)


@cache
def fitted():
    return fused().fit(BASELINE)


@cache
def alone(name):
    return dict(fused().detectors)[name].fit(BASELINE)


def test_the_index_is_the_mean_of_the_indices_over_their_thresholds():
    expected = np.zeros(len(LATER))
    for detector in map(alone, ("lines", "neighbours")):
        expected += -detector.score_samples(LATER) / detector[-1].threshold_ / 2
    np.testing.assert_allclose(fitted().damage_index(LATER), expected)
    assert fitted().damage_index(LATER).index.equals(LATER.index)


def test_one_detector_alone_raises_its_own_alarms():
    only = FusedDetector([("lines", behind(LinearRegression()))]).fit(BASELINE)
    np.testing.assert_array_equal(only.predict(DAMAGED), alone("lines").predict(DAMAGED))
    assert only.threshold_ == pytest.approx(1.0)


def test_false_alarms_are_as_asked_and_more_damage_is_found_than_on_average():
    found = [(alone(name).predict(DAMAGED) == -1).mean() for name in ("lines", "neighbours")]
    assert (fitted().predict(LATER) == -1).mean() == pytest.approx(0.02, abs=0.015)
    assert (fitted().predict(DAMAGED) == -1).mean() > np.mean(found)
    assert (fused(contamination=0.1).fit(BASELINE).predict(LATER) == -1).mean() == pytest.approx(0.1, abs=0.035)


def test_what_one_detector_cannot_evaluate_the_others_do():
    holed = LATER.copy()
    holed.iloc[:5, holed.columns.get_loc("f1")] = np.nan
    forest = behind(LinearRegression(), OutlierDetector(IsolationForest(random_state=0)))
    mixed = FusedDetector([("lines", behind(LinearRegression())), ("forest", forest)]).fit(BASELINE)
    lines = mixed.detectors_[0]
    index = mixed.damage_index(holed)
    np.testing.assert_allclose(index[:5], -lines.score_samples(holed)[:5] / lines[-1].threshold_)
    with pytest.warns(match="730 of 730 .*not-evaluated") as given:
        found = mixed.predict(holed.assign(**dict.fromkeys(MODES, np.nan)))
    assert (found == 0).all()
    causes = ["no column has a value there", "this detector needs every column", "none of the 2 detectors can evaluate"]
    assert [cause in str(one.message) for cause, one in zip(causes, given, strict=True)] == [True] * 3


def test_parameters_are_set_through_it_and_pickles_keep_indices():
    changed = fused().set_params(lines__mahalanobisdetector__contamination=0.1, contamination=0.05)
    assert changed.get_params()["lines__mahalanobisdetector__contamination"] == 0.1
    assert dict(changed.detectors)["lines"][-1].contamination == 0.1
    assert not hasattr(clone(fitted()), "detectors_")
    np.testing.assert_array_equal(
        pickle.loads(pickle.dumps(fitted())).damage_index(LATER), fitted().damage_index(LATER)
    )


def test_windows_and_records_can_be_fused():
    week = behind(LinearRegression(), WindowedAlarm(7))
    mixed = FusedDetector([("records", behind(LinearRegression())), ("weeks", week)]).fit(BASELINE)
    assert (mixed.predict(DAMAGED) != 0).all()  # the first rows by single records alone
    assert (mixed.predict(DAMAGED) == -1).mean() > (fitted().predict(DAMAGED) == -1).mean()


@pytest.mark.parametrize(
    ("detectors", "message"),
    [
        ([], "detectors is an empty list"),
        (
            [("a", behind(LinearRegression())), ("a", behind(LinearRegression()))],
            "with names of their own",
        ),
        ([("forest", behind(LinearRegression(), IsolationForest()))], "detector 'forest' ends with IsolationForest"),
        (
            [("svm", behind(LinearRegression(), OutlierDetector(OneClassSVM(nu=0.5))))],
            "detector 'svm' ends with OutlierDetector.*expected a detector of this package with a positive threshold",
        ),
        (None, "'detectors' parameter of FusedDetector must be an instance of 'list'"),
    ],
)
def test_detectors_that_cannot_be_fused_are_named(detectors, message):
    with pytest.raises(ValueError, match=message):
        FusedDetector(detectors).fit(BASELINE)


def test_local_outlier_factors_serve():
    lof = behind(LinearRegression(), OutlierDetector(LocalOutlierFactor(novelty=True)))
    assert np.isfinite(FusedDetector([("lof", lof)]).fit(BASELINE).damage_index(LATER)).all()
