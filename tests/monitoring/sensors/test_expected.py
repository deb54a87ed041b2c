"""The statistic of an offset or a drift is that of generalised least squares, and rare in noise."""

import numpy as np
from numpy.testing import assert_allclose

from skthermo.monitoring.sensors._expected import BEYOND, LONGEST, SEASONAL, Departures, ThermometerNoise


def departures(random, n, correlation):
    """A healthy series, with gaps."""
    noise = random.standard_normal(n)
    for day in range(1, n):
        noise[day] = correlation * noise[day - 1] + np.sqrt(1 - correlation**2) * noise[day]
    noise[random.random(n) < 0.1] = np.nan
    return Departures(np.arange(n), noise, random.uniform(0.5, 1.5, n), np.full(n, 0.01), random.normal(0, 0.2, n))


def test_a_change_is_what_dense_least_squares_finds():
    random = np.random.default_rng(0)
    noise = ThermometerNoise(1.2, 0.5, 0.3, 4.0)
    given = departures(random, 40, 0.5)
    given.values[25:] += 3.0 / given.deviations[25:]
    found = noise.change(given)
    known = given.known()
    lag = np.abs(known.days[:, np.newaxis] - known.days)
    covariance = np.outer(known.deviations, known.deviations) * 1.2**2 * 0.5**lag
    level = 0.3**2 + (1 + 0.5) / (1 - 0.5) * 1.2**2 * 0.01
    line = 2 * (known.days - known.days[0]) / LONGEST - 1
    covariance += level * np.outer(known.deviations, known.deviations)
    covariance += SEASONAL**2 * (1 + np.outer(line, line)) + BEYOND**2 * np.outer(known.beyond, known.beyond)
    inverse = np.linalg.inv(covariance)
    shape = (known.days >= found.first).astype(float)
    size = shape @ inverse @ (known.values * known.deviations) / (shape @ inverse @ shape)
    assert found.rate == 0
    assert abs(found.first - 25) <= 1
    assert_allclose(found.size, size)
    assert_allclose(found.weight, abs(size) * np.sqrt(shape @ inverse @ shape))


def test_noise_is_learned():
    noise = ThermometerNoise.of(departures(np.random.default_rng(1), 4000, 0.6), 0.1)
    assert_allclose([noise.scale, noise.correlation], [1.0, 0.6], atol=0.05)
    assert noise.wander < 0.1
