"""Scatter of records: what is learned of independent and of lasting parts, and how uncertain it leaves means."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.sparse import csr_array

from skthermo.residuals.baseline import Scatter

ROOT = np.array([[1.0, 0.0], [0.6, 0.8]])  # of the correlations of two modes
NEAR = 25  # number of neighbours in weather


def noise(memory, n_records, random, n_columns=2):
    """First-order autoregressions of unit variance."""
    shocks = random.standard_normal((300 + n_records, n_columns)) * np.sqrt(1 - memory**2)
    return lfilter([1.0], [1.0, -memory], shocks, axis=0)[300:]


@cache
def neighbours(n_records, season):
    """Averages over the records with the most similar weather, which has a season and weather of the day."""
    days, random = np.arange(n_records), np.random.RandomState(0)
    weather = np.cos(2 * np.pi * days / season) + 0.3 * random.standard_normal(n_records)
    near = np.abs(weather[:, np.newaxis] - weather).argsort(axis=1)[:, :NEAR].ravel()
    return csr_array((np.full(near.size, 1 / NEAR), near, np.arange(0, near.size + 1, NEAR)), (n_records, n_records))


def residuals(values, season=300):
    """Residuals of records, and what similar weather takes away."""
    similar = neighbours(len(values), season)

    def less_similar(table):
        return table - similar @ table

    return SimpleNamespace(values=values, own=values, is_overfitted=False, less_similar=less_similar)


def correlations(memory, n_records):
    return toeplitz(float(memory) ** np.arange(n_records))


@pytest.mark.nightly
def test_means_of_autoregressions_have_the_variance_of_the_closed_form():
    """Also after similar weather, often of neighbours in time, has taken its share of the slow noise."""
    random = np.random.RandomState(1)
    for memory in (0.0, 0.6, 0.9):
        ratios = []
        for _ in range(12):
            scatter = Scatter.estimated(residuals(noise(memory, 1000, random) @ ROOT.T))
            weights = np.full((60, 2), 1 / 60)
            found = scatter.of_sums(weights, np.arange(60)).sum(axis=0)
            ratios.append(found / (correlations(memory, 60).sum() / 60**2))
        np.testing.assert_allclose(np.mean(ratios, axis=0), ROOT @ ROOT.T, atol=0.15)


def test_independent_records_have_no_lasting_part():
    random = np.random.RandomState(2)
    found = [Scatter.estimated(residuals(noise(0.0, 500, random))) for _ in range(20)]
    assert np.mean([scatter.memory == 0.0 for scatter in found]) >= 0.9
    assert all((scatter.parts[1] == 0).all() for scatter in found if scatter.memory == 0.0)
    assert np.mean([scatter.variances for scatter in found]) == pytest.approx(1, abs=0.03)


def test_a_small_part_that_lasts_is_seen():
    """A tenth of the variance that lasts for twenty records makes the variance of long means three times as large."""
    random = np.random.RandomState(3)
    table = np.sqrt(0.9) * noise(0.0, 1500, random) + np.sqrt(0.1) * noise(0.9, 1500, random)
    scatter = Scatter.estimated(residuals(table))
    assert 0.75 < scatter.memory < 0.97
    fading = np.diag(scatter.parts[1]) * correlations(scatter.memory, 300).sum() / 300**2  # in the mean of 300 records
    expected = 0.9 / 300 + 0.1 * correlations(0.9, 300).sum() / 300**2
    np.testing.assert_allclose((np.diag(scatter.parts[0]) / 300 + fading) / expected, 1, atol=0.5)


def test_modes_with_gaps_and_modes_that_hardly_any_record_has():
    random = np.random.RandomState(5)
    table = noise(0.0, 400, random, 3) * [1.0, 3.0, 1.0]
    table[::3, 0], table[10:, 2] = np.nan, np.nan
    given = residuals(table)
    given.less_similar = lambda values: values
    scatter = Scatter.estimated(given)
    np.testing.assert_allclose(scatter.variances, [1, 9, 0], rtol=0.2)
    assert scatter.variances[2] == 0  # of ten records nothing is said
    assert np.linalg.eigvalsh(scatter.parts[0][:2, :2]).min() > 0


def test_residuals_of_a_mapper_that_has_learned_noise_are_not_trusted():
    random = np.random.RandomState(6)
    given = residuals(noise(0.0, 400, random))
    given.own, given.is_overfitted = 0.1 * given.values, True
    assert Scatter.estimated(given).variances.mean() == pytest.approx(1, abs=0.15)
    given.is_overfitted = False
    assert Scatter.estimated(given).variances.mean() < 0.2
