"""Shifts, effects and fits behind identified damage."""

import numpy as np
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem.damage import read_groups
from skthermo.residuals.weather import WeatherFunctions
from skthermo.studies.identification._causes import Cause
from skthermo.studies.identification._curves import Part, ShiftComparison
from skthermo.studies.identification._evidence import Explanation, Posterior
from skthermo.studies.identification._identified import cosines, errors_alone, indistinguishable_groups
from skthermo.studies.identification._shift import measured_shift, outlying, record_shifts

YEAR, LATER = (make_truss_campaign(random_state=seed) for seed in (0, 1))
WEATHER = LATER.temperatures[::12]
GROUPS = ["bottom", "top", "diagonal"]


def test_parts_are_independent_and_modes_without_measurement_left_out():
    random = np.random.RandomState(0)
    root, effects = random.standard_normal((7, 7)), random.standard_normal((7, 3))
    covariance, measured = root @ root.T, random.standard_normal(7)
    measured[2] = np.nan
    linear = Part(lambda amounts: (amounts @ effects.T, effects), measured, covariance, 20.0)
    comparison = ShiftComparison([linear, Part(linear.effects, np.ones(7), np.eye(7))])
    known, observed = [0, 1, 3, 4, 5, 6], comparison.observed()
    inner = np.linalg.inv(covariance[np.ix_(known, known)])
    np.testing.assert_allclose((observed.rotation.T @ observed.rotation)[:6, :6], inner, rtol=1e-6)
    np.testing.assert_allclose(observed.rotation[6:, 6:] @ observed.rotation[6:, 6:].T, np.eye(7), atol=1e-12)
    np.testing.assert_array_equal(observed.rotation[6:, :6], 0)
    assert observed.is_scaled.tolist() == [True] * 6 + [False] * 7
    np.testing.assert_allclose(comparison.slopes(3), observed.rotation @ np.vstack([effects[known], effects]))


def test_groups_that_imitate_each_other():
    lengths = np.array([50.0, 40.0, 30.0, 60.0])
    directions = np.array([[1.0, 0, 0, 0], [1, 1e-3, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]).T
    slopes = directions * lengths
    assert indistinguishable_groups(slopes) == [(0, 1)]
    sum_of_two = np.column_stack([slopes[:, [0, 2, 3]], slopes[:, 0] + slopes[:, 2]])
    assert indistinguishable_groups(sum_of_two) == [(0, 1, 3)]
    assert indistinguishable_groups(slopes[:, :1]) == []
    np.testing.assert_allclose(errors_alone(slopes), 1 / np.linalg.norm(slopes, axis=0))
    np.testing.assert_allclose(np.diag(cosines(slopes)), 1)


def test_default_groups_are_the_smallest():
    assert list(read_groups(make_truss(), None)) == ["bottom", "top", "diagonal", "vertical"]

    class Model:
        groups = {"deck": (0, 1), "plate": (0,), "ribs": (1,), "arch": (2,), "all": (0, 1, 2), "half": (1, 2)}

        def damaged(self, damage):
            return self

    assert list(read_groups(Model(), None)) == ["plate", "ribs", "arch"]
    assert read_groups(Model(), {"both": ("plate", "arch"), "deck": "deck"}) == {
        "both": ["plate", "arch"],
        "deck": ["deck"],
    }


def test_shift_of_known_records(fem):
    inputs = fem.weather(WEATHER).inputs
    residuals, weights = fem.recorder_.residuals.expected(inputs), fem.recorder_.residuals.prediction_weights(inputs)
    number = 1 / (weights**2).sum(axis=0)
    F = (fem.predict(WEATHER) * (1 + residuals) * np.linspace(0.97, 1.02, 6)).to_numpy(copy=True)
    F[::2, 3] = np.nan
    theta = fem.predict_parameters(WEATHER).to_numpy()
    shifts = record_shifts(fem, WEATHER, theta, F)
    shift = measured_shift(fem, WEATHER, shifts, "fitted")
    np.testing.assert_allclose(shift.mean, np.log(np.linspace(0.97, 1.02, 6)), atol=1e-12)
    stated = measured_shift(fem, WEATHER, shifts, 0.02)
    counts = (~np.isnan(F)).sum(axis=0)
    np.testing.assert_allclose(np.diag(stated.covariance), 0.02**2 * (1 / counts + 1 / number))
    assert (number > 0).all()
    assert (number <= len(YEAR.frequencies)).all()
    assert shift.n_records.tolist() == counts.tolist()
    few = measured_shift(fem, WEATHER[:3], shifts[:3], "fitted")
    assert (np.diag(few.covariance) > np.diag(shift.covariance)).all()
    with pytest.raises(ValueError, match="noise is 'gaussian'; expected \"fitted\""):
        measured_shift(fem, WEATHER, shifts, "gaussian")


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


def test_records_far_from_the_others():
    random = np.random.RandomState(0)
    shifts = 0.01 * random.standard_normal((60, 4))
    deviations = np.full(4, 0.01)
    assert not outlying(shifts, deviations).any()
    shifts[[3, 40], [1, 2]] = 0.2, -0.2
    shifts[:, 3] = np.nan
    assert np.flatnonzero(outlying(shifts, deviations)).tolist() == [3, 40]
    assert not outlying(shifts, 10 * deviations).any()  # known to scatter so
    assert not outlying(shifts[:7], deviations).any()  # too few to tell
    shifts[::2, 0] += 0.5  # two states: neither is an outlier
    assert not outlying(shifts[:, :1], deviations[:1]).any()
    np.testing.assert_array_equal(outlying(shifts[::-1], deviations)[::-1], outlying(shifts, deviations))


def test_no_probability_is_above_1():
    random = np.random.default_rng(0)
    for n_draws in range(1, 200):
        shares = random.dirichlet(np.ones(5))
        draws = random.random((n_draws, 1))
        found = Posterior([Explanation(("a",), float(share), draws, np.zeros(1), 0.0) for share in shares])
        assert found.table([Cause("a")])["probability"].item() == pytest.approx(1)
        assert max(found.table([Cause("a")])["probability"].item(), found.probability_of("a")) <= 1
