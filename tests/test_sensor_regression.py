"""Temperatures that other sensors foretell."""

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skthermo._weather import SensorRegression


def records(n_rows, seed=0):
    rng = np.random.default_rng(seed)
    air = rng.normal(10, 8, n_rows)
    return np.column_stack([air, 0.8 * air + rng.normal(2, 1, n_rows), 0.5 * air + rng.normal(0, 2, n_rows)])


def test_a_gap_is_filled_as_by_a_linear_regression_on_the_other_sensors():
    T, new = records(500), records(50, seed=1)
    wanted = LinearRegression().fit(T[:, [0, 2]], T[:, 1])
    new[:, 1] = np.nan
    filled, deviations = SensorRegression.of(T).fill(new)
    assert filled[:, 1] == pytest.approx(wanted.predict(new[:, [0, 2]]))
    assert deviations[:, 1] == pytest.approx(np.std(T[:, 1] - wanted.predict(T[:, [0, 2]])))
    assert (filled[:, [0, 2]] == new[:, [0, 2]]).all()
    assert (deviations[:, [0, 2]] == 0).all()


def test_what_no_sensor_tells_stays_missing():
    T = np.column_stack([records(200), np.full(200, np.nan)])
    new = np.full((2, 4), np.nan)
    new[1, 0] = 5.0
    filled, deviations = SensorRegression.of(T).fill(new)
    assert np.isnan(filled[0]).all()
    assert np.isnan(deviations[0]).all()
    assert np.isnan(filled[1]).tolist() == [False, False, False, True]


def test_gaps_while_learning_do_not_matter():
    T = records(3000)
    gappy = np.where(np.random.default_rng(2).uniform(size=T.shape) < 0.2, np.nan, T)
    new = records(20, seed=3)
    new[:, 2] = np.nan
    full, half = (SensorRegression.of(table).fill(new)[0][:, 2] for table in (T, gappy))
    assert half == pytest.approx(full, abs=0.5)
