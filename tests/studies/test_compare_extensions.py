"""What would make smaller damage detectable."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.fem import CallableModel, add_noise
from skthermo.studies import Scenario, compare_extensions, pod_curve, sweep
from skthermo.surrogate import DataInformedFEM, InverseSurrogate
from tests.studies.studies import LATER, MODES, WEATHER, YEAR, ran, study_of

NO_OTHERS = {"modes": (), "baseline_factors": ()}


@pytest.fixture(scope="module")
def study(fem):
    scenarios = sweep(fem, (0.1, 0.2, 0.3), ["top"])
    study = ran(fem, scenarios, n_repeats=6)
    return study


@pytest.fixture(scope="module")
def table(study):
    with pytest.warns(UserWarning, match="mode 8.*undetermined"):
        return compare_extensions(study, WEATHER, baseline_factors=(2.0, 2.5))


@pytest.mark.nightly
def test_candidates_are_compared_with_the_same_present_and_the_best_is_first(table):
    assert set(table["candidate"]) == {"mode 7", "mode 8", "mode 9", "baseline x 2", "baseline x 2.5"}
    assert table["mdd_now"].nunique() == 1
    np.testing.assert_allclose(table["gain"], table["mdd_now"] - table["mdd_then"])
    assert table["gain"].is_monotonic_decreasing
    assert (table["ci_low"] < table["gain"]).all()
    assert (table["gain"] < table["ci_high"]).all()


@pytest.mark.nightly
def test_the_recommended_mode_gains_as_much_in_true_records(table):
    best = table[table["kind"] == "mode"].iloc[0]
    assert (best["candidate"], best["family"]) == ("mode 9", "top")
    assert best["gain"] > 0
    gains = []
    for seed in (10, 20, 30):
        healthy, later = (make_truss_campaign(random_state=seed + i) for i in range(2))
        model = healthy.model.with_modes([*range(6), 8])
        baseline = add_noise(model.frequencies(healthy.theta), 0.01, random_state=seed)
        severities = np.linspace(0.1, 0.4, 10)
        changed = [
            add_noise(model.damaged({"top": s}).frequencies(later.theta), 0.01, random_state=seed + 1)
            for s in severities
        ]
        smallest = []
        for n_modes in (6, 7):
            detector = MahalanobisDetector().fit(baseline[:, :n_modes])
            alarms = [(detector.predict(records[:, :n_modes]) == -1).sum() for records in changed]
            smallest.append(pod_curve(severities, alarms, np.full(10, 365)).a90)
        gains.append(smallest[0] - smallest[1])
    assert best["ci_low"] < np.mean(gains) < best["ci_high"]


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*few-records")  # without T3, residuals follow the season
def test_a_sensor_that_explains_the_frequencies_gains_more_than_one_that_does_not():
    known = YEAR.temperatures[["T1", "T2"]]
    inverse = InverseSurrogate(regressor=LinearRegression(), n_samples=300, noise=0.01)
    fem = DataInformedFEM(make_truss(), inverse=inverse, random_state=0).fit(known, YEAR.frequencies)
    detector = make_pipeline(TemperatureCompensator(LinearRegression(), targets=MODES), MahalanobisDetector())
    study = study_of(fem, detector, sweep(fem, (0.1, 0.2, 0.3), ["top"]))
    study.run(known)
    unrelated = np.random.RandomState(0).standard_normal(365)
    sensors = pd.DataFrame({"unrelated": unrelated, "T3": YEAR.temperatures["T3"]})
    table = compare_extensions(study, known, modes=(), baseline_factors=(), sensors=sensors)
    assert table["candidate"].tolist() == ["T3", "unrelated"]
    assert table["kind"].tolist() == ["sensor", "sensor"]
    assert table["gain"][0] > 0.01
    assert abs(table["gain"][1]) < 0.01


def test_a_family_of_other_changes_keeps_its_severities(fem):
    scenarios = [
        Scenario(f"{m} kg", mass=np.full(23, m), family="mass", severity=m / 1000) for m in (5.0, 10.0, 20.0, 40.0)
    ]
    study = ran(fem, scenarios, T=LATER.temperatures, n_repeats=3, noise="fitted")
    table = compare_extensions(study, LATER.temperatures, modes=[8], baseline_factors=())
    assert table["family"].tolist() == ["mass"]
    curve = study.pod_curve("mass")
    assert table["mdd_now"][0] == pytest.approx(curve.a90, rel=0.15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"modes": [5]}, r"modes \[5\] are measured already"),
        ({"modes": [99]}, "is none of the model's"),
        ({"baseline_factors": (1.0,)}, "expected numbers above 1"),
        (NO_OTHERS, "there is no candidate"),
        ({"noise": 2.0}, "noise is 2"),
        (NO_OTHERS | {"sensors": pd.DataFrame({"T4": YEAR.temperatures["T1"]})}, "the detector sees no temperatures"),
        (NO_OTHERS | {"sensors": YEAR.temperatures["T1"]}, "expected a frame with a column for each candidate"),
    ],
)
def test_impossible_candidates_are_errors(study, arguments, message):
    with pytest.raises(ValueError, match=message):
        compare_extensions(study, WEATHER, **arguments)


def test_sensors_must_have_the_training_rows_and_new_names(fem):
    detector = make_pipeline(TemperatureCompensator(LinearRegression(), targets=MODES), MahalanobisDetector())
    study = study_of(fem, detector, sweep(fem, (0.1, 0.3), ["top"]))
    with pytest.raises(ValueError, match="expected a call of run before"):
        compare_extensions(study, WEATHER)
    study.run(WEATHER)
    with pytest.raises(ValueError, match="has the name of a measured temperature"):
        compare_extensions(study, WEATHER, modes=(), sensors=YEAR.temperatures[["T1"]])
    with pytest.raises(ValueError, match="the temperatures of the training has 365 rows and sensors 99"):
        compare_extensions(study, WEATHER, modes=(), sensors=YEAR.temperatures[["T1"]][:99])


@pytest.mark.nightly
def test_a_model_without_other_modes_has_only_longer_baselines(fem):
    truss = make_truss()
    model = CallableModel(truss.frequencies, truss.parameter_names, 6)
    chain = DataInformedFEM(model, random_state=0).fit(YEAR.temperatures, YEAR.frequencies)
    scenarios = [Scenario(f"soft {s}", parameters={"top": 1 - s}, family="top", severity=s) for s in (0.2, 0.3, 0.4)]
    study = study_of(chain, MahalanobisDetector(), scenarios)
    study.run(WEATHER)
    assert compare_extensions(study, WEATHER)["kind"].tolist() == ["baseline"]
    with pytest.raises(ValueError, match="has no method 'with_modes'"):
        compare_extensions(study, WEATHER, modes=[6])
