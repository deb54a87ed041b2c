"""Records in which a thermometer is missing are evaluated, and as strictly as others."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.detection import MahalanobisDetector, TemperatureCompensator

MODES = ["f1", "f2"]
EFFECT = np.array([[-0.02, 0.01], [-0.03, -0.04], [0.0, -0.02]])
pytestmark = pytest.mark.filterwarnings("ignore:.*faulty-sensor")


def campaign(n_rows=4000, seed=0, noise=0.02):
    """Hourly records of three thermometers and two modes that follow them."""
    random = np.random.default_rng(seed)
    air = 10 + 8 * np.sin(2 * np.pi * np.arange(n_rows) / 24) + random.normal(0, 4, n_rows)
    girder = 0.7 * air + random.normal(0, 1, n_rows)
    T = np.column_stack([air, girder, 0.5 * air + 0.4 * girder + random.normal(0, 1, n_rows)])
    F = [4.0, 9.0] + T @ EFFECT + random.normal(0, noise, (n_rows, 1)) + random.normal(0, noise, (n_rows, 2))
    stamps = pd.date_range("2025", periods=n_rows, freq="h")
    return pd.DataFrame(np.hstack([T, F]), stamps, ["air", "girder", "deck", *MODES])


BASELINE, LATER = campaign(), campaign(20_000, seed=1)


def fitted(records):
    compensator = TemperatureCompensator(LinearRegression(), targets=MODES)
    return make_pipeline(compensator, MahalanobisDetector(0.02)).fit(records)


@pytest.fixture(scope="module")
def detector():
    return fitted(BASELINE)


@pytest.mark.parametrize("dead", [["girder"], ["girder", "deck"]], ids=str)
def test_the_rate_of_false_alarms_holds_with_dead_thermometers(detector, dead):
    records = LATER.assign(**dict.fromkeys(dead, np.nan))
    assert 0.01 < (detector.predict(records) == -1).mean() < 0.026  # errors that modes share count for each alone
    filled = detector[0].sensors_.fill(records.drop(columns=MODES))[0]
    predicted = detector[0].estimator_.predict(pd.DataFrame(filled, columns=list(LATER)[:3]))
    assert (detector[1].predict(np.log(records[MODES] / predicted)) == -1).mean() > 0.05
    assert (detector.predict(records.assign(f1=LATER["f1"] - 0.3)) == -1).mean() > 0.9


def test_residuals_have_one_covariance_with_and_without_a_thermometer(detector):
    compensator = detector[0]
    alive, dead = (compensator.transform(records) for records in (LATER, LATER.assign(girder=np.nan)))
    np.testing.assert_allclose(alive.cov(), dead.cov(), rtol=0.1, atol=0.1 * np.diag(alive.cov()).max())


def test_rows_that_have_every_temperature_are_untouched(detector):
    compensator, holed = detector[0], LATER.copy()
    holed.iloc[::7, 1] = np.nan
    whole = np.arange(len(LATER)) % 7 > 0
    found, expected = (compensator.transform(records).to_numpy()[whole] for records in (holed, LATER))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_gaps_in_the_baseline_cost_no_false_alarms():
    holed = BASELINE.copy()
    holed.iloc[np.random.default_rng(2).random(len(holed)) < 0.2, 1] = np.nan
    detector = fitted(holed)
    assert (detector.predict(LATER) == -1).mean() == pytest.approx(0.02, abs=0.006)
    assert 0.01 < (detector.predict(LATER.assign(girder=np.nan)) == -1).mean() < 0.026
