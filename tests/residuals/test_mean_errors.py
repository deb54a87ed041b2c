"""Errors of the mean of residuals hold however long records remember, and where modes share what is slow."""

import numpy as np
import pytest
from scipy.signal import lfilter

from skthermo.residuals.mean_errors import MeanErrors, chance_of


def noise(random, kind, n_records, n_modes=4):
    """Residuals with memory of their own, or with a slow part that all modes share."""
    drawn, keeps = random.standard_normal((n_records, n_modes)), 0.9 if kind == "memory" else 0.0
    drawn = lfilter([np.sqrt(1 - keeps**2)], [1, -keeps], drawn, axis=0)
    if kind == "shared":
        slow = lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], random.standard_normal((n_records, 1)), axis=0)
        drawn = np.sqrt(0.7) * drawn + np.sqrt(0.3) * slow * [1.0, 0.8, 1.2, 0.5]
    return drawn


@pytest.mark.nightly
@pytest.mark.parametrize("kind", ["independent", "memory", "shared"])
def test_means_of_a_month_are_rarely_improbable(kind):
    random, chances = np.random.default_rng(0), []
    for _ in range(100):
        records = noise(random, kind, 500)[100:]
        errors = MeanErrors.learned(records[:365])
        mean = records[-30:].mean(axis=0)
        covariance, freedom = errors.of_mean(np.full(4, 30))
        chances.append(chance_of(mean @ np.linalg.solve(covariance, mean), 4, freedom))
    assert np.mean(np.array(chances) < 0.02) <= 0.06


def test_of_independent_records_the_covariance_is_that_of_a_mean_of_known_noise():
    records = np.random.default_rng(1).standard_normal((6000, 3)) * [1.0, 2.0, 3.0]
    covariance, freedom = MeanErrors.learned(records).stated(np.array([1.0, 2.0, 3.0])).of_mean(np.array([25, 25, 100]))
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), [0.2, 0.4, 0.3], rtol=0.01)
    assert freedom > 1000


def test_modes_without_records_have_no_errors():
    records = np.random.default_rng(2).standard_normal((400, 3))
    records[:390, 1] = np.nan
    covariance, _ = MeanErrors.learned(records).of_mean(np.array([10, 10, 0]))
    assert np.isnan(covariance[[1, 2]]).all()
    assert covariance[0, 0] > 0
