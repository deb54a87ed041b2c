"""Shifts, effects and fits behind identified damage."""

import numpy as np
import pytest

from skthermo.residuals.weather import WeatherFunctions


def test_as_many_records_as_the_weights_say(fem):
    """Expected residuals of unit noise: their mean over rows varies as that of the number of records returned."""
    residuals = fem.recorder_.residuals
    inputs = residuals.weather[::9]
    number = residuals.n_expected(inputs)
    noise = np.random.RandomState(0).standard_normal((len(residuals.own), 600))
    means = residuals._similar_mean(noise, inputs).mean(axis=0)
    assert means.var() == pytest.approx(1 / number[0], rel=0.15)


def test_predictions_err_as_least_squares_on_the_weather_do(fem):
    """What depends on the weather by its functions is predicted exactly, and noise as much as the weights say."""
    residuals = fem.recorder_.residuals
    inputs = residuals.weather[:60]
    basis, weights = WeatherFunctions.fitted(residuals.weather), residuals.prediction_weights(inputs)
    functions = basis.values(inputs)
    law = np.random.RandomState(0).standard_normal((basis.size, 1))
    of_records = basis.values(residuals.weather) @ law
    np.testing.assert_allclose(weights.T @ of_records, np.full((6, 1), (functions @ law).mean()), atol=1e-9)
    np.testing.assert_allclose(weights.sum(axis=0), 1)
    similar = residuals.shares(inputs)
    assert (weights**2).sum() > (similar**2).sum()  # a cold season is known less well than its similar records say
