"""Several detectors in one study, which all evaluate the same simulated records."""

import warnings
from collections import Counter

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, OutlierMixin, clone
from sklearn.ensemble import IsolationForest
from sklearn.exceptions import ConvergenceWarning

from skthermo.detection import MahalanobisDetector, OutlierDetector
from skthermo.exceptions import RecordsWarning
from skthermo.studies import DetectabilityStudy, Scenario
from tests.studies.studies import LATER, SIDE_BY_SIDE, compensated, ran, study_of

WEATHER = LATER.temperatures
SCENARIOS = [{}, {"bottom": 0.1}, {"top": 0.2}]


def detectors():
    return {
        "raw": MahalanobisDetector(),
        "forest": OutlierDetector(IsolationForest(n_estimators=10)),
        "lines": compensated(),
    }


class Trouble(OutlierMixin, BaseEstimator):
    """Fails in ``fit``, from the given call of ``decision_function`` on, or evaluates nothing."""

    def __init__(self, fails=None, first=0):
        self.fails = fails
        self.first = first

    def fit(self, X, y=None):
        if self.fails == "fit":
            raise KeyError("no such column")
        self.n_calls_ = 0
        return self

    def score_samples(self, X):
        return np.full(len(X), np.nan)

    def decision_function(self, X):
        self.n_calls_ += 1
        if self.fails == "predict" and self.n_calls_ > self.first:
            raise RuntimeError("out of order")
        return np.full(len(X), np.nan)


@pytest.fixture(scope="module")
def study(fem):
    study = ran(fem, SCENARIOS, detectors(), WEATHER, n_repeats=3)
    return study


@pytest.mark.nightly
def test_one_row_for_each_detector_and_scenario(study):
    results = study.results_.set_index(["detector", "scenario"])
    assert results.index.tolist() == [
        (name, scenario) for name in detectors() for scenario in ("healthy", "bottom 10 %", "top 20 %")
    ]
    assert (results["error"] == "").all()
    assert study.errors_ == {}
    assert list(study.detectors_) == list(study.thresholds_) == list(detectors())
    for (name, scenario, source), decisions in study.decisions_.items():
        assert (decisions.dtype, decisions.shape) == (np.float32, (3, 365))
        assert (decisions < 0).mean() == results.loc[(name, scenario), "rate"]
        index = study.thresholds_[name] - study.indices_[name, scenario, source]
        np.testing.assert_allclose(decisions[0], index, atol=1e-4)


@pytest.mark.one_case
@pytest.mark.parametrize("name", ["raw", "forest"])
def test_a_detector_gives_the_same_rates_alone_and_in_company(fem, study, name):
    alone = study_of(fem, detectors()[name], SCENARIOS, n_repeats=3)
    results = alone.run(WEATHER).drop(columns="detector")
    together = study.results_[study.results_["detector"] == name].drop(columns="detector").reset_index(drop=True)
    pd.testing.assert_frame_equal(results, together)
    for (_, scenario, source), decisions in alone.decisions_.items():
        np.testing.assert_array_equal(decisions, study.decisions_[name, scenario, source])
    for (_, source), decisions in alone.calibration_.items():
        np.testing.assert_array_equal(decisions, study.calibration_[name, source])


class CountedForest(IsolationForest):
    """Counts its fits."""

    n_fits = 0

    def fit(self, X, y=None, sample_weight=None):
        type(self).n_fits += 1
        return super().fit(X, y, sample_weight)


@pytest.mark.nightly
def test_a_study_with_a_memory_fits_no_detector_again_and_gives_the_same_bits(fem, tmp_path):
    forest = OutlierDetector(CountedForest(n_estimators=2))
    several = {"raw": forest, "residuals": compensated(forest), "distance": compensated()}
    without = study_of(fem, several, SCENARIOS)
    without.run(WEATHER, SIDE_BY_SIDE)
    once = CountedForest.n_fits
    for baseline in (SIDE_BY_SIDE, SIDE_BY_SIDE.copy()):
        study = study_of(fem, several, SCENARIOS, memory=str(tmp_path))
        pd.testing.assert_frame_equal(study.run(WEATHER, baseline), without.results_, check_exact=True)
        for key, decisions in without.decisions_.items():
            np.testing.assert_array_equal(study.decisions_[key], decisions)
        baseline.index.resolution  # noqa: B018 -- which pandas keeps in the index
    assert CountedForest.n_fits == 2 * once
    study.set_params(random_state=1).run(WEATHER, SIDE_BY_SIDE)
    study.run(WEATHER, SIDE_BY_SIDE[:-1])
    assert CountedForest.n_fits == 4 * once


@pytest.mark.nightly
def test_the_truth_is_asked_once_for_all_detectors(fem):
    asked = Counter()

    def truth(scenario, seed):
        asked[scenario.name, seed] += 1
        return fem.simulate(WEATHER, **scenario.changes(WEATHER), noise=0.01, random_state=seed)

    study = study_of(fem, detectors(), SCENARIOS)
    results = study.run(WEATHER, reference=truth)
    assert set(asked.values()) == {1}
    assert Counter(name for name, _ in asked) == {"healthy": 4, "bottom 10 %": 2, "top 20 %": 2}  # two calibrate
    assert (results["source"] == "reference").sum() == 9
    assert study.calibration_["lines", "reference"].shape == (2, 365)


def test_calibration_records_are_healthy_and_have_noise_of_their_own(study):
    for name in detectors():
        calibration, healthy = (study.calibration_[name, "simulated"], study.decisions_[name, "healthy", "simulated"])
        assert calibration.shape == healthy.shape
        assert (calibration == healthy).mean() < 0.05
        assert np.median(calibration) == pytest.approx(np.median(healthy), abs=0.1 * float(np.std(healthy)))


def test_a_mapping_of_groups_to_severities_is_a_scenario(fem):
    given = [{}, {"bottom": 0.18, "top": 0.05}, pd.Series({"top": -0.1}), Scenario("other", {"top": 0.2})]
    study = study_of(fem, MahalanobisDetector(), given, n_repeats=1)
    results = study.run(WEATHER)
    assert results["scenario"].tolist() == ["healthy", "bottom 18 %, top 5 %", "top -10 %", "other"]
    assert results["measure"].tolist() == ["PFA", "POD", "POD", "POD"]
    scenarios = [Scenario(name, one.damage) for name, one in zip(results["scenario"], study.scenarios_, strict=True)]
    pd.testing.assert_frame_equal(study.set_params(scenarios=scenarios).run(WEATHER), results)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("trouble", "message"),
    [
        (Trouble("fit"), "KeyError: 'no such column'"),
        (Trouble("predict"), "RuntimeError: out of order"),
        (Trouble("predict", 5), "RuntimeError: out of order"),
        (Trouble(), "ValueError: none of 365 records of scenario 'healthy'"),
    ],
    ids=["in fit", "in the first repeat", "in a later repeat", "evaluates nothing"],
)
@pytest.mark.parametrize("n_jobs", [None, 2])
def test_a_detector_that_fails_is_a_row_with_its_error(fem, study, trouble, message, n_jobs):
    some = {"bad": trouble} | detectors()
    beside = study_of(fem, some, SCENARIOS, n_repeats=3, n_jobs=n_jobs)
    results = beside.run(WEATHER)
    bad, others = results.iloc[0], results.iloc[1:].reset_index(drop=True)
    assert bad["detector"] == "bad"
    assert bad["error"].startswith(message)
    assert beside.errors_ == {"bad": bad["error"]}
    assert bad.drop(["detector", "error"]).isna().all()
    pd.testing.assert_frame_equal(others, study.results_, check_dtype=False)
    assert "bad" not in beside.detectors_
    assert not [key for key in (*beside.decisions_, *beside.indices_, *beside.calibration_) if key[0] == "bad"]
    assert beside.minimum_detectable_damage().index.unique("detector").tolist() == list(detectors())
    with pytest.raises(ValueError, match=r"detector is 'bad'; expected the name of one of \['raw'"):
        beside.pod_curve("top", detector="bad")
    alone = study_of(fem, {"bad": trouble}, SCENARIOS, n_repeats=3)
    with pytest.raises((ValueError, KeyError, RuntimeError), match=message.split(": ")[1]):
        alone.run(WEATHER)


def test_what_is_asked_of_one_of_several_detectors(study):
    with pytest.raises(ValueError, match=r"detector is None; expected the name of one of \['raw', 'forest', 'lines'\]"):
        study.detector_name()
    for ask in (study.pod_curve, study.is_undetected):
        with pytest.raises(ValueError, match="detector is None"):
            ask("top")
    assert not study.is_undetected("top", detector="lines")
    smallest = study.minimum_detectable_damage(0.3)
    assert smallest.index.names == ["detector", "family", "source"]
    one = study.minimum_detectable_damage(0.3, detector="lines")
    assert one.index.names == ["family", "source"]
    pd.testing.assert_frame_equal(one, smallest.loc["lines"])


class Doubtful(MahalanobisDetector):
    """Has doubts about its baseline and about every record that it evaluates."""

    def fit(self, X, y=None):
        warnings.warn("no convergence in 7 steps", ConvergenceWarning, stacklevel=2)
        return super().fit(X)

    def decision_function(self, X):
        warnings.warn(RecordsWarning(f"{len(X)} odd records", "odd"), stacklevel=2)
        return super().decision_function(X)


def test_one_warning_of_each_kind_and_those_of_other_packages_pass(fem):
    study = study_of(fem, {"raw": MahalanobisDetector(), "first": Doubtful(), "second": Doubtful(0.05)}, SCENARIOS)
    with pytest.warns(UserWarning, match=r"odd|convergence") as caught:
        study.run(WEATHER[::3])
    (evaluated,) = (one for one in caught if one.category is RecordsWarning)
    others = [one for one in caught if one is not evaluated]
    assert [evaluated.message.args[0].count(name) for name in ("'raw'", "'first'", "'second'")] == [0, 1, 1]
    assert evaluated.filename == __file__
    assert study.warnings_ == [str(evaluated.message)]
    assert {(one.category, str(one.message)) for one in others} == {(ConvergenceWarning, "no convergence in 7 steps")}


def test_parameters_of_detectors_by_name_are_reached(fem):
    study = DetectabilityStudy(fem, {"a": MahalanobisDetector(), "b": MahalanobisDetector()}, [{}])
    study.set_params(detectors__a__contamination=0.1, n_repeats=3)
    assert [study.detectors[name].contamination for name in "ab"] == [0.1, MahalanobisDetector().contamination]
    assert (study.get_params()["detectors__a__contamination"], study.n_repeats) == (0.1, 3)
    assert clone(study).detectors["a"].contamination == 0.1
    with pytest.raises(ValueError, match="'c'"):
        study.set_params(detectors__c__contamination=0.1)
