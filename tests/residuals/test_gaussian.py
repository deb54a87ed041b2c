"""Normal distributions of rows with gaps: expectation maximisation and densities, with SciPy as an oracle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from skthermo.residuals.gaussian import Gaussian
from tests.gappy_rows import COVARIANCE, MEAN, records, with_gaps

F = records(400)
GAPPY = with_gaps(F)
LEARNED = Gaussian.fitted(GAPPY)


def log_likelihood(rows, mean, covariance):
    """Of the modes that are there."""
    total = 0.0
    for row in rows:
        there = ~np.isnan(row)
        total += multivariate_normal.logpdf(row[there], mean[there], covariance[np.ix_(there, there)])
    return total


def test_complete_rows_give_mean_and_covariance():
    learned = Gaussian.fitted(F)
    np.testing.assert_allclose(learned.mean, F.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(learned.covariance, np.cov(F.T, bias=True), rtol=1e-11)


def test_the_likelihood_is_flat_at_the_solution():
    rows = GAPPY[:40]
    learned, step = Gaussian.fitted(rows), 1e-5
    deviations = np.sqrt(np.diag(learned.covariance))
    for i in range(3):
        shift = step * deviations * (np.arange(3) == i)
        pair = [log_likelihood(rows, learned.mean + sign * shift, learned.covariance) for sign in (1, -1)]
        assert abs(pair[0] - pair[1]) / (2 * step) < 1e-4
        for j in range(i + 1):
            bump = np.zeros((3, 3))
            bump[i, j] = bump[j, i] = step * deviations[i] * deviations[j]
            pair = [log_likelihood(rows, learned.mean, learned.covariance + sign * bump) for sign in (1, -1)]
            assert abs(pair[0] - pair[1]) / (2 * step) < 1e-4


@settings(max_examples=20)
@given(
    st.lists(st.floats(-9, 9), min_size=3, max_size=3),
    st.lists(st.floats(-100, 100), min_size=3, max_size=3),
    st.permutations(range(3)),
    st.integers(0, 99),
)
def test_units_and_the_order_of_rows_and_modes_do_not_matter(exponents, shift, modes, seed):
    scale, order = 10.0 ** np.array(exponents), np.random.default_rng(seed).permutation(len(GAPPY))
    other = Gaussian.fitted((scale * (GAPPY + shift))[order][:, modes])
    np.testing.assert_allclose(other.mean, (scale * (LEARNED.mean + shift))[modes], rtol=1e-7, atol=1e-9 * scale.max())
    expected = (LEARNED.covariance * np.outer(scale, scale))[np.ix_(modes, modes)]
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(other.covariance / size, expected / size, atol=1e-6)


def test_the_truth_is_found_where_half_of_the_entries_are_missing():
    rows = with_gaps(records(40_000), 0.6)
    assert np.isnan(rows).mean() > 0.39
    learned = Gaussian.fitted(rows)
    size = np.sqrt(np.outer(np.diag(COVARIANCE), np.diag(COVARIANCE)))
    np.testing.assert_allclose((learned.mean - MEAN) / np.sqrt(np.diag(COVARIANCE)), 0, atol=0.03)
    np.testing.assert_allclose((learned.covariance - COVARIANCE) / size, 0, atol=0.03)


def test_gaps_that_follow_another_mode_do_not_bias_the_mean():
    """A mode that is missed where another one is high: its own mean over the records that have it would be off."""
    rows = records(20_000)
    rows[rows[:, 1] > MEAN[1], 0] = np.nan
    deviation = np.sqrt(COVARIANCE[0, 0])
    assert abs(np.nanmean(rows[:, 0]) - MEAN[0]) > 0.3 * deviation
    assert Gaussian.fitted(rows).mean[0] == pytest.approx(MEAN[0], abs=0.03 * deviation)


def test_distances_and_densities_are_those_of_the_modes_that_are_there():
    rows = GAPPY[:50]
    distances, densities = LEARNED.distances(rows), LEARNED.log_densities(rows)
    for row, distance, density in zip(rows, distances, densities, strict=True):
        there = ~np.isnan(row)
        own = multivariate_normal(LEARNED.mean[there], LEARNED.covariance[np.ix_(there, there)])
        assert density == pytest.approx(own.logpdf(row[there]))
        assert density == pytest.approx(own.logpdf(own.mean) - distance**2 / 2)
    assert np.isnan(LEARNED.distances(np.full((1, 3), np.nan))[0])


def test_modes_that_are_never_there_together_leave_the_rest_as_it_is():
    """Records do not say how the two are correlated: any number that fits the rest is as likely, and one is taken."""
    rows = records(20_000)
    rows[::2, 0] = rows[1::2, 1] = np.nan
    learned = Gaussian.fitted(rows).covariance
    assert np.linalg.eigvalsh(learned).min() > 0
    size = np.sqrt(np.outer(np.diag(COVARIANCE), np.diag(COVARIANCE)))
    seen = np.array([[1, 0, 1], [0, 1, 1], [1, 1, 1]], dtype=bool)
    np.testing.assert_allclose((learned / size)[seen], (COVARIANCE / size)[seen], atol=0.05)
