"""Shifts, effects and fits behind identified damage."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from skthermo.studies.identification._bounded_fit import (
    fit_severities,
    p_of_damage,
    p_of_group,
    p_of_misfit,
    redrawn,
    widening_of,
)

from skthermo._changes import Changes
from skthermo._frequency_effects import FrequencyEffects, read_groups
from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies.identification._comparison import Comparison, Part
from skthermo.studies.identification._separability import confused_groups, cosines, errors_alone, merge_confused
from skthermo.studies.identification._shift import measured_shift

YEAR, LATER = (make_truss_campaign(random_state=seed) for seed in (0, 1))
WEATHER = LATER.temperatures[::12]
GROUPS = ["bottom", "top", "diagonal"]
AT = np.array([0.1, 0.35, 0.0])


def differences(function, at, step=1e-4):
    steps = step * np.eye(len(at))
    return np.column_stack([(function(at + h) - function(at - h)) / (2 * step) for h in steps])


def test_effects_are_the_changes_of_simulated_records(fem):
    F = fem.simulate(WEATHER).to_numpy(copy=True)
    F[::2, 1], F[:, 4] = np.nan, np.nan
    effects = FrequencyEffects.of(
        fem, fem.predict_parameters(WEATHER).to_numpy(), F, Changes.of_damage(fem.model, GROUPS)
    )
    change, slopes = effects(AT)
    damaged = fem.simulate(WEATHER, damage=dict(zip(GROUPS, AT, strict=True))).to_numpy()
    ratios = np.log(damaged / fem.simulate(WEATHER).to_numpy())
    expected = np.where(np.isnan(F), np.nan, ratios)
    expected[:, 4] = ratios[:, 4]  # a mode that was not measured counts in all rows
    np.testing.assert_allclose(change, np.nanmean(expected, axis=0), atol=1e-9)
    np.testing.assert_allclose(slopes, differences(lambda at: effects(at)[0], AT), rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(effects(np.zeros(3))[0], 0, atol=1e-12)


def quadratic(severities):
    matrix = np.random.RandomState(0).standard_normal((7, 3))
    return matrix @ severities - matrix**2 @ severities**2, matrix - 2 * matrix**2 * severities


@pytest.mark.parametrize(
    "incidence", [[[1, 0], [1, 0], [0, 1]], [[1, 1], [1, 0], [0, 1]], [[1, 1], [1, 1], [0, 1]]], ids=str
)
def test_severities_and_derivatives_of_joined_and_overlapping_groups(incidence):
    incidence, at = np.array(incidence, dtype=float), np.array([0.2, 0.3])
    comparison = Comparison([Part(quadratic, np.zeros(7), np.eye(7))], incidence)
    remaining = [np.prod([1 - s for s, inside in zip(at, row, strict=True) if inside]) for row in incidence]
    np.testing.assert_allclose(comparison.members(at), 1 - np.array(remaining))
    np.testing.assert_allclose(comparison.members(np.tile(at, (4, 1))), np.tile(comparison.members(at), (4, 1)))
    change, slopes = comparison.effects(at)
    np.testing.assert_allclose(change, quadratic(comparison.members(at))[0])
    np.testing.assert_allclose(slopes, differences(lambda s: comparison.effects(s)[0], at), rtol=1e-6, atol=1e-8)
    assert comparison.of([]).fit().misfit == pytest.approx(0.0)
    merged = comparison.of([[0, 1]])
    np.testing.assert_array_equal(merged.incidence, incidence.max(axis=1, keepdims=True))


def test_parts_are_whitened_and_modes_without_measurement_left_out():
    random = np.random.RandomState(0)
    root = random.standard_normal((7, 7))
    covariance, measured = root @ root.T, random.standard_normal(7)
    measured[2] = np.nan
    comparison = Comparison([Part(quadratic, measured, covariance), Part(quadratic, np.ones(7), np.eye(7))], np.eye(3))
    known = [0, 1, 3, 4, 5, 6]
    whitening = comparison.whitening
    assert whitening.shape == (13, 13)
    inner = np.linalg.inv(covariance[np.ix_(known, known)])
    np.testing.assert_allclose((whitening.T @ whitening)[:6, :6], inner, rtol=1e-8)
    np.testing.assert_allclose(whitening[6:, 6:], np.eye(7))
    np.testing.assert_array_equal(whitening[:6, 6:], 0)


def test_a_linear_fit_is_bounded_least_squares():
    random = np.random.RandomState(1)
    matrix, shift = 30 * random.standard_normal((6, 4)), 10 * random.standard_normal(6)
    fit = fit_severities(lambda s: (matrix @ s, matrix), shift, np.eye(6), 4)
    stacked = np.vstack([matrix, np.eye(4)])
    oracle = lsq_linear(stacked, np.append(shift, np.zeros(4)), bounds=(0, 0.95)).x
    np.testing.assert_allclose(fit.severities, oracle, atol=1e-6)
    assert fit.converged
    assert fit.misfit == pytest.approx(((shift - matrix @ fit.severities) ** 2).sum())
    np.testing.assert_allclose(fit.target, shift)


def linear_fit(slopes, shift):
    return fit_severities(lambda s: (slopes @ s, slopes), shift, np.eye(len(shift)), slopes.shape[1])


def test_p_values_of_healthy_structures_are_uniform():
    """Errors alone, known covariance: p-values are below 5 % in 5 % of cases."""
    random = np.random.RandomState(0)
    slopes = 50 * np.eye(6)[:, :3]
    fits = [linear_fit(slopes, random.standard_normal(6)) for _ in range(400)]
    assert np.mean([p_of_misfit(fit, 1e4) < 0.05 for fit in fits]) == pytest.approx(0.05, abs=0.03)
    without = [linear_fit(slopes[:, 1:], fit.target) for fit in fits]
    p_values = [p_of_group(*both, 1e4, 0, slopes) for both in zip(fits, without, strict=True)]
    assert np.mean(np.less(p_values, 0.05)) == pytest.approx(0.05, abs=0.03)
    assert np.mean([p_of_damage(fit, 1e4, 100, random) < 0.05 for fit in fits[:200]]) < 0.08
    few = linear_fit(slopes[:2], random.standard_normal(2) + slopes[:2].sum(axis=1))
    assert np.isnan(p_of_misfit(few, 1e4)) == (np.count_nonzero(few.severities) >= 2)


def test_errors_widened_by_a_misfit_make_it_likely():
    slopes, wild = np.eye(6)[:, :1], np.array([8.0, 3.0, -3.0, 3.0, -3.0, 3.0])

    def fit(shift):
        return fit_severities(lambda severities: (slopes @ severities, slopes), shift, np.eye(6), 1)

    assert widening_of(fit(wild)) == pytest.approx(np.sqrt(fit(wild).misfit / 5))
    assert p_of_misfit(fit(wild), 1e4) < 0.01 < p_of_misfit(fit(wild / widening_of(fit(wild))), 1e4)
    assert widening_of(fit(0.1 * wild)) == 1
    draws = (redrawn(40 * slopes, 16 * slopes[:, 0], 500, np.random.RandomState(0), widening=w) for w in (2.0, 1.0))
    wide, usual = (draw.std() for draw in draws)
    assert wide == pytest.approx(2 * usual)


def test_redrawn_fits_scatter_as_least_squares_says():
    slopes = np.array([[40.0, 10.0], [5.0, 30.0], [10.0, 20.0]])
    draws = redrawn(slopes, slopes @ [0.4, 0.5], 4000, np.random.RandomState(0))
    np.testing.assert_allclose(draws.mean(axis=0), [0.4, 0.5], atol=2e-3)
    np.testing.assert_allclose(np.cov(draws.T), np.linalg.inv(slopes.T @ slopes + np.eye(2)), atol=1e-4)
    assert redrawn(slopes[:, :0], slopes[:, 0], 3, np.random.RandomState(0)).shape == (3, 0)


def test_groups_that_imitate_each_other():
    lengths = np.array([50.0, 40.0, 30.0, 60.0])
    directions = np.array([[1.0, 0, 0, 0], [1, 1e-3, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]).T
    slopes = directions * lengths
    assert confused_groups(slopes) == [(0, 1)]
    assert merge_confused(slopes, [(0,), (1,), (2,), (3,)]) == [(0, 1), (2,), (3,)]
    sum_of_two = np.column_stack([slopes[:, [0, 2, 3]], slopes[:, 0] + slopes[:, 2]])
    assert confused_groups(sum_of_two) == [(0, 1, 3)]
    assert confused_groups(slopes[:, :1]) == []
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
    residuals, number = fem.expected_residuals(WEATHER, return_number=True)
    F = (fem.predict(WEATHER) * (1 + residuals) * np.linspace(0.97, 1.02, 6)).to_numpy(copy=True)
    F[::2, 3] = np.nan
    theta = fem.predict_parameters(WEATHER).to_numpy()
    shift = measured_shift(fem, WEATHER, theta, F, "fitted")
    np.testing.assert_allclose(shift.mean, np.log(np.linspace(0.97, 1.02, 6)), atol=1e-12)
    stated = measured_shift(fem, WEATHER, theta, F, 0.02)
    counts = (~np.isnan(F)).sum(axis=0)
    np.testing.assert_allclose(np.diag(stated.covariance), 0.02**2 * (1 / counts + 1 / number))
    assert (number > 0).all()
    assert (number <= len(YEAR.frequencies)).all()
    assert shift.n_records.tolist() == counts.tolist()
    few = measured_shift(fem, WEATHER[:3], theta[:3], F[:3], "fitted")
    assert (np.diag(few.covariance) > np.diag(shift.covariance)).all()
    with pytest.raises(ValueError, match="noise is 'gaussian'; expected \"fitted\""):
        measured_shift(fem, WEATHER, theta, F, "gaussian")


def test_as_many_records_as_the_weights_say(fem):
    """Expected residuals of unit noise: their mean over rows varies as that of the number of records returned."""
    residuals = fem.residuals_
    inputs = residuals.weather[::9]
    number = residuals.n_expected(inputs)
    rows = np.ones(len(residuals.own), dtype=bool)
    noise = np.random.RandomState(0).standard_normal((len(rows), 600))
    means = residuals._similar_mean(noise, inputs, rows).mean(axis=0)
    assert means.var() == pytest.approx(1 / number[0], rel=0.15)
