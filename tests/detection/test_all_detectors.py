"""Laws of all detectors: units, order of columns, other weather, labels of damage."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.ensemble import IsolationForest
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_fleet, make_truss, make_truss_campaign
from skthermo.detection import (
    CompensatedDetector,
    DirectionalDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
)
from skthermo.studies import detection_task
from skthermo.surrogate import DataInformedFEM

YEAR = make_truss_campaign(random_state=0)
LATER = make_truss_campaign(damage={"bottom": 0.1}, random_state=1)
MODES, SENSORS = list(YEAR.frequencies), list(YEAR.temperatures)
WARM = pytest.mark.filterwarnings(
    "ignore:.*(few-records|other-weather|not-evaluated|set-aside|faulty-sensor|uncalibrated-model)"
)


def joined(campaign):
    return campaign.temperatures.join(campaign.frequencies)


def directions(names=MODES, scale=1.0):
    """A mode falls as another does not: relative, so without a unit."""
    return pd.DataFrame(-np.eye(6)[:3] - 0.2, ["a", "b", "c"], MODES)[list(names)] * scale


DETECTORS = {
    "Mahalanobis": MahalanobisDetector(),
    "softening": DirectionalDetector(),
    "directions": DirectionalDetector(directions()),
    "outliers": OutlierDetector(LocalOutlierFactor(novelty=True)),
    "compensated": CompensatedDetector(targets=MODES),
    "compensated, by day, outliers": CompensatedDetector(
        OutlierDetector(LocalOutlierFactor(novelty=True)), targets=MODES, window="3D"
    ),
    "pipeline": make_pipeline(TemperatureCompensator(targets=MODES), DirectionalDetector(directions())),
}


def seen(name, campaign):
    return joined(campaign) if "comp" in name or name == "pipeline" else campaign.frequencies


@pytest.mark.parametrize("name", DETECTORS)
def test_scores_do_not_depend_on_units_or_on_the_order_of_columns(name):
    baseline, later = seen(name, YEAR)[::2], seen(name, LATER)
    expected = DETECTORS[name].fit(baseline).decision_function(later)
    in_kilohertz = [table.assign(**{mode: table[mode] / 1000 for mode in MODES}) for table in (baseline, later)]
    others = [table[[*reversed(table.columns)]] for table in (baseline, later)]
    for first, second in (in_kilohertz, others):
        found = DETECTORS[name].fit(first).decision_function(second)
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


def other_weather():
    """Six weeks of winter, a summer, and a normal second year of a bridge."""
    bridge = make_fleet(1, kinds=("girder",), random_state=3)["bridge 000"]
    years = [
        joined(bridge.records(365, f"{year}-01-01", samples_per_day=2, gaps=0.0, outliers=0.0, random_state=1))
        for year in (2024, 2025)
    ]
    return bridge, years[0][:"2024-02-11"], years[0]["2024-06-15":"2024-08-15"], years


@pytest.mark.nightly
@WARM
@pytest.mark.parametrize("kind", ["compensated", "by day", "pipeline", "chain"])
def test_who_learned_a_winter_says_so_in_summer_and_not_in_the_next_winter(kind):
    bridge, winter, summer, (year, second) = other_weather()
    sensors = [name for name in winter if "temp" in name or "_" in name]
    modes = [name for name in winter if name not in sensors]
    detector = {
        "compensated": CompensatedDetector(targets=modes),
        "by day": CompensatedDetector(targets=modes, window="1D"),
        "pipeline": make_pipeline(TemperatureCompensator(targets=modes), MahalanobisDetector()),
        "chain": DataInformedFEM(bridge.model, random_state=0),
    }[kind]

    def fitted(records):
        return detector.fit(records[sensors], records[modes]) if kind == "chain" else detector.fit(records)

    def asked(records):
        return detector.predict(records[sensors] if kind == "chain" else records)

    fitted(winter)
    with pytest.warns(UserWarning, match="other-weather"):
        asked(summer)
    compensator = getattr(detector, "compensator_", detector[0] if kind == "pipeline" else None)
    if compensator is not None:
        assert compensator.extrapolated(summer).mean() > 0.9
        assert compensator.extrapolated(winter).sum() == 0
    fitted(year)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*other-weather")
        healthy = asked(second)
    if kind != "chain":
        assert (healthy == 1).mean() > 0.9


@pytest.mark.one_case
@WARM
@pytest.mark.parametrize("name", ["Mahalanobis", "outliers", "compensated", "pipeline"])
def test_what_labels_call_damaged_is_not_learned(name):
    healthy, later = seen(name, YEAR), seen(name, LATER)
    later = later.set_axis(later.index + (healthy.index[-1] - later.index[0]) + (healthy.index[1] - healthy.index[0]))
    both, labels = pd.concat([healthy, later]), np.repeat([1, -1], [len(healthy), len(later)])
    found = {
        kind: (DETECTORS[name].fit(records, y).predict(later) == -1).mean()
        for kind, records, y in (
            ("labelled", both, labels),
            ("without labels", both, np.ones(len(both))),
            ("alone", healthy, None),
        )
    }
    assert found["labelled"] == pytest.approx(found["alone"], abs=0.1)
    assert found["without labels"] < 0.6 * found["labelled"]


@WARM
@pytest.mark.nightly
@pytest.mark.parametrize(
    "refit", [True, lambda results: int(np.argmax(results["mean_test_score"]))], ids=["best", "own"]
)
def test_a_search_refits_its_best_detector_on_healthy_records_alone(refit):
    fem = DataInformedFEM(make_truss(), random_state=0).fit(YEAR.temperatures, YEAR.frequencies)
    weather = make_truss_campaign(random_state=2).temperatures
    task = detection_task(fem, weather, [{}, {"bottom": 0.1}], n_repeats=2, random_state=0)
    detector = make_pipeline(TemperatureCompensator(targets=MODES), DirectionalDetector())
    grid = {"directionaldetector__omnibus": [0.2, 0.5]}
    search = GridSearchCV(detector, grid, cv=task.cv, scoring=task.scoring, refit=refit).fit(task.X, task.y)
    found, own = ((one.predict(joined(LATER)) == -1).mean() for one in (search.best_estimator_, task.refit(search)))
    assert found == pytest.approx(own, abs=0.1)
    assert own > 0.5
    healthy = joined(make_truss_campaign(random_state=5))
    assert (search.best_estimator_.predict(healthy) == -1).mean() < 0.06


def test_who_takes_no_labels_is_named_after_a_search():
    fem = DataInformedFEM(make_truss(), random_state=0).fit(YEAR.temperatures, YEAR.frequencies)
    weather = make_truss_campaign(random_state=2).temperatures
    task = detection_task(fem, weather, [{}, {"bottom": 0.1}], columns=MODES, n_repeats=2, random_state=0)
    forest = IsolationForest(n_estimators=10, random_state=0)
    search = GridSearchCV(forest, {"max_samples": [50]}, cv=task.cv, scoring=task.scoring).fit(task.X, task.y)
    with pytest.warns(UserWarning, match="search-refits"):
        task.refit(search)


@pytest.mark.parametrize(
    "detector", [MahalanobisDetector(), CompensatedDetector(targets=MODES)], ids=["alone", "whole"]
)
def test_labels_that_leave_nothing_healthy_are_refused(detector):
    records = YEAR.frequencies if isinstance(detector, MahalanobisDetector) else joined(YEAR)
    with pytest.raises(ValueError, match="365 rows"):
        detector.fit(records, -np.ones(365))
