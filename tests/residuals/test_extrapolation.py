"""Residuals outside the weather of a baseline."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.detection import CompensatedDetector, TemperatureCompensator
from skthermo.residuals.weather import Extrapolation, TrainingRange

WEATHER = np.linspace(-10.0, 30.0, 500)[:, np.newaxis]


def learned(residuals_of):
    return Extrapolation.learned(TrainingRange.spanned(WEATHER, slice(None)), WEATHER, residuals_of)


@pytest.mark.parametrize("growth", [0.0, 4.0, 400.0])
def test_the_growth_of_residuals_at_each_end_is_learned(growth):
    def residuals_of(others, fifth):
        beyond = np.minimum(
            np.abs(WEATHER[fifth] - WEATHER[others].min()), np.abs(WEATHER[fifth] - WEATHER[others].max())
        )
        share = beyond / np.ptp(WEATHER[others])
        is_cold = WEATHER[fifth].mean() < 10
        return np.sqrt(1 + (growth if is_cold else 0.0) * np.log1p(share**2)) * np.ones((len(fifth), 3))

    weight = 0.1  # of the usual growth
    cold, warm = learned(residuals_of).growth
    own = (np.log1p((0.2 / 0.8 * np.linspace(0, 1, 100)) ** 2) ** 2).sum()
    assert cold == pytest.approx((own * growth + weight * 9) / (own + weight), rel=0.05)
    assert warm == pytest.approx(weight * 9 / (own + weight), rel=0.05)


def test_variances_grow_with_the_distance_and_are_one_inside():
    found = learned(lambda others, fifth: np.ones((len(fifth), 1)))
    variances = found.variances(np.array([[np.nan], [-10.0], [10.0], [30.0], [50.0], [70.0], [-30.0]]))
    assert variances[:4] == pytest.approx(1)
    assert variances[4] == pytest.approx(1 + found.growth[1] * np.log(1.25))
    assert variances[5] > variances[4] > 1
    assert variances[6] == pytest.approx(1 + found.growth[0] * np.log(1.25))


def bent(temperature, random):
    """A frequency that stiffens in frost, where a straight line of warm records goes on."""
    return 10 - 0.01 * temperature + 0.1 * np.maximum(-temperature, 0) + random.normal(0, 0.01, len(temperature))


@pytest.mark.filterwarnings("ignore:temperatures are outside")
def test_residuals_of_new_weather_count_less_and_still_grow_with_damage():
    random = np.random.default_rng(0)
    T, colder = random.uniform(-5, 30, 400), random.uniform(-15, -5, 400)
    year, frost = (pd.DataFrame({"air": one, "f": bent(one, random)}) for one in (T, colder))
    detector = CompensatedDetector(regressor=LinearRegression(), targets=["f"], regimes=None).fit(year)
    residuals = TemperatureCompensator(LinearRegression(), targets=["f"]).fit(year).transform(frost)["f"]
    straight = LinearRegression().fit(year[["air"]], year["f"]).predict(frost[["air"]])
    plain = np.log(frost["f"] / straight)
    assert (np.abs(residuals) < np.abs(plain)).all()
    assert (np.sign(residuals) == np.sign(plain)).all()
    index = [detector.damage_index(frost.assign(f=frost["f"] * (1 - loss))) for loss in (0.1, 0.2, 0.3)]
    assert (np.diff(index, axis=0) > 0).all()
