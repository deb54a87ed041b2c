"""Errors of the mean of some records' residuals, and the probability of such a mean by chance."""

import numpy as np
import pytest

from skthermo.residuals.mean_errors import MeanErrors, chance_of
from tests.residuals.series import autoregressive

ROOT = np.array([[1.0, 0.0], [0.6, 0.8]])  # two modes with a correlation of 0.6
N, N_NEW, N_MEANS = 20_000, 60, 400


def residuals(correlation, n=N, seed=0):
    return 0.01 * autoregressive(n, correlation, seed, 2) @ ROOT.T


def new_means(correlation):
    return residuals(correlation, N_NEW * N_MEANS, 1).reshape(N_MEANS, N_NEW, 2).mean(axis=1)


@pytest.mark.parametrize("correlation", [0.0, 0.7])
def test_means_of_new_records_scatter_as_their_errors_say(correlation):
    errors, _ = MeanErrors.learned(residuals(correlation)).of_mean(np.full(2, N_NEW))
    size = np.sqrt(np.outer(np.diag(errors), np.diag(errors)))
    np.testing.assert_allclose(np.cov(new_means(correlation).T) / size, errors / size, atol=0.25)


def test_chances_of_means_of_healthy_records_are_uniform():
    covariance, freedom = MeanErrors.learned(residuals(0.5)).of_mean(np.full(2, N_NEW))
    means = new_means(0.5)
    misfits = np.einsum("ij,ij->i", means, np.linalg.solve(covariance, means.T).T)
    chances = np.array([chance_of(misfit, 2, freedom) for misfit in misfits])
    assert np.mean(chances < 0.1) == pytest.approx(0.1, abs=0.04)
    assert np.mean(chances) == pytest.approx(0.5, abs=0.05)


def test_a_mode_with_few_values_is_not_known_and_an_outlier_does_not_count():
    values = residuals(0.0, 3000)
    few, loud = values.copy(), values.copy()
    few[19:, 1], loud[7, 0] = np.nan, 1e3
    assert np.isnan(MeanErrors.learned(few).deviations[1])
    np.testing.assert_allclose(MeanErrors.learned(loud).deviations, MeanErrors.learned(values).deviations, rtol=0.01)


def test_stated_deviations_are_those_of_independent_records():
    learned = MeanErrors.learned(residuals(0.7)).stated(np.array([0.02, 0.03]))
    covariance, _ = learned.of_mean(np.array([16, 16]))
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), np.array([0.02, 0.03]) / 4, rtol=0.01)
    assert covariance[0, 1] == 0


def test_nothing_that_is_free_has_no_chance():
    assert np.isnan(chance_of(1.0, 0, 10.0))
