"""Laws of all detectors: units, order of columns, other weather, labels of damage."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_fleet, make_truss_campaign
from skthermo.detection import (
    CompensatedDetector,
    DirectionalDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
)
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
    "compensated": CompensatedDetector(regressor=LinearRegression(), targets=MODES, window="3D"),
    "pipeline": make_pipeline(TemperatureCompensator(targets=MODES), DirectionalDetector(directions())),
}


def seen(name, campaign):
    return joined(campaign) if "comp" in name or name == "pipeline" else campaign.frequencies


@pytest.mark.parametrize("name", DETECTORS)
def test_scores_do_not_depend_on_units_or_on_the_order_of_columns(name):
    baseline, later = seen(name, YEAR)[::2], seen(name, LATER)
    expected = DETECTORS[name].fit(baseline).decision_function(later)
    in_kilohertz = (table.assign(**{mode: table[mode] / 1000 for mode in MODES}) for table in (baseline, later))
    first, second = (table[[*reversed(table.columns)]] for table in in_kilohertz)
    found = DETECTORS[name].fit(first).decision_function(second)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.nightly
@WARM
@pytest.mark.parametrize("is_chain", [False, True])
def test_who_learned_a_winter_says_so_in_summer_and_not_in_the_next_winter(is_chain):
    bridge = make_fleet(1, kinds=("girder",), random_state=3)["bridge 000"]
    options = {"samples_per_day": 2, "gaps": 0.0, "outliers": 0.0, "random_state": 1}
    first, second = (bridge.records(365, f"{year}-01-01", **options) for year in (2024, 2025))
    modes = list(first.frequencies)
    detector = DataInformedFEM(bridge.model, random_state=0) if is_chain else CompensatedDetector(targets=modes)
    year, later = (
        campaign.temperatures if is_chain else campaign.temperatures.join(campaign.frequencies)
        for campaign in (first, second)
    )
    winter, summer = slice(None, "2024-02-11"), slice("2024-06-15", "2024-08-15")

    def fitted(part):
        return detector.fit(year[part], first.frequencies[part]) if is_chain else detector.fit(year[part])

    fitted(winter)
    with pytest.warns(UserWarning, match="other-weather"):
        detector.predict(year[summer])
    if not is_chain:
        assert detector.compensator_.extrapolated(year[summer]).mean() > 0.9
        assert detector.compensator_.extrapolated(year[winter]).sum() == 0
    fitted(slice(None))
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*other-weather")
        healthy = detector.predict(later)
    assert is_chain or (healthy == 1).mean() > 0.9


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


@pytest.mark.parametrize(
    "detector", [MahalanobisDetector(), CompensatedDetector(targets=MODES)], ids=["alone", "whole"]
)
def test_labels_that_leave_nothing_healthy_are_refused(detector):
    records = YEAR.frequencies if isinstance(detector, MahalanobisDetector) else joined(YEAR)
    with pytest.raises(ValueError, match="365 rows"):
        detector.fit(records, -np.ones(365))
