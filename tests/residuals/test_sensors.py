"""Temperatures that other sensors predict."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss_campaign
from skthermo.detection import TemperatureCompensator
from skthermo.exceptions import RecordsWarning
from skthermo.residuals.sensors import SensorRegression
from tests.residuals.series import autoregressive
from tests.surrogate.chains import YEAR, F, T, fitted


def records(n_rows, seed=0):
    rng = np.random.default_rng(seed)
    air = rng.normal(10, 8, n_rows)
    return np.column_stack([air, 0.8 * air + rng.normal(2, 1, n_rows), 0.5 * air + rng.normal(0, 2, n_rows)])


def test_gaps_are_filled_and_departures_measured_by_a_linear_regression_on_the_other_sensors():
    T, new = records(500), records(50, seed=1)
    wanted = LinearRegression().fit(T[:, [0, 2]], T[:, 1])
    new[:, 1] = np.nan
    filled, deviations = SensorRegression.fitted(T).fill(new)
    assert filled[:, 1] == pytest.approx(wanted.predict(new[:, [0, 2]]))
    assert deviations[:, 1] == pytest.approx(np.std(T[:, 1] - wanted.predict(T[:, [0, 2]])))
    assert (filled[:, [0, 2]] == new[:, [0, 2]]).all()
    assert (deviations[:, [0, 2]] == 0).all()
    new = records(50, seed=2)
    departures = SensorRegression.fitted(T).departures(new)
    assert departures[:, 1] == pytest.approx(new[:, 1] - wanted.predict(new[:, [0, 2]]), abs=1e-6)
    new[:, [0, 2]] = np.nan
    assert np.isnan(SensorRegression.fitted(T).departures(new)).all()


def test_what_no_sensor_tells_stays_missing_and_a_sensor_without_values_says_nothing():
    T = np.column_stack([records(200), np.full(200, np.nan)])
    new = np.full((2, 4), np.nan)
    new[1, 0] = 5.0
    filled, deviations = SensorRegression.fitted(T).fill(new)
    assert np.isnan(filled[0, :3]).all()
    assert np.isnan(deviations[0, :3]).all()
    assert not np.isnan(filled[1]).any()
    new[:, 3] = [-20.0, 30.0]
    np.testing.assert_array_equal(SensorRegression.fitted(T).fill(new)[0][:, 3], filled[:, 3])


def dependent_records(n_rows, seed):
    """Records whose departures are autoregressive, as those of sun and shade are, beside a season."""
    season = 10 - 10 * np.cos(2 * np.pi * np.arange(n_rows) / n_rows)
    departures = 0.5 / np.sqrt(1 - 0.9**2) * autoregressive(n_rows, 0.9, seed, 3)
    return pd.DataFrame(season[:, np.newaxis] * [1.0, 0.8, 1.2] + departures, columns=["air", "girder", "cable"])


@pytest.mark.parametrize("n_rows", [40, 400, 3000])
def test_healthy_sensors_are_not_warned_of(n_rows):
    for seed in range(10):
        sensors = SensorRegression.fitted(dependent_records(3000, seed))
        assert not sensors.doubts(dependent_records(3000, seed + 100)[1000 : 1000 + n_rows])


def departing(sensors, T):
    """Names of the sensors that are found to depart from the others."""
    return [str(one).split("'")[1] for one in sensors.doubts(T) if one.kind == "faulty-sensor"]


def test_sensors_that_drift_or_are_stuck_are_named():
    sensors, new = SensorRegression.fitted(dependent_records(3000, 0)), dependent_records(3000, 1)
    stuck = new.assign(air=new["air"].where(new.index < 1500, new.loc[1500, "air"]))
    assert departing(sensors, stuck) == ["air"]
    new["girder"] += np.linspace(0, 6, len(new))
    assert departing(sensors, new) == ["girder"]
    assert departing(sensors, new[:300]) == []
    backwards = new.set_axis(pd.date_range("2024", periods=len(new), freq="h"))[::-1]
    assert departing(sensors, backwards) == ["girder"]


def test_weather_that_training_does_not_know_says_nothing_of_sensors():
    T, new = dependent_records(3000, 0), dependent_records(3000, 1)
    sensors, hottest = SensorRegression.fitted(T), pd.DataFrame([T.max()] * 400)
    assert departing(sensors, hottest + [-0.1, 4.0, -0.1]) == ["girder"]
    assert departing(sensors, hottest + [0.1, 4.0, 0.1]) == []
    assert departing(sensors, new + [0.0, 0.0, 8.0]) == ["cable"]
    new.loc[[5, 30, 800], "cable"] += 80  # which another warning tells
    assert departing(sensors, new) == []
    assert not SensorRegression.fitted(new[["air"]]).doubts(new[["air"]] + 40)


def test_compensator_and_chain_warn_of_a_sensor_that_departs():
    records, new = (one.temperatures.join(one.frequencies) for one in (YEAR, make_truss_campaign(random_state=1)))
    compensator = TemperatureCompensator(LinearRegression(), targets=list(F)).fit(records)
    new.iloc[200:, 0] += 15
    for evaluate in (lambda: compensator.transform(new), lambda: fitted().predict(new[list(T)])):
        with pytest.warns(RecordsWarning, match=f"'{records.columns[0]}'") as caught:
            evaluate()
        assert sum(warning.message.kind == "faulty-sensor" for warning in caught) == 1
