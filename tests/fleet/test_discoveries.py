"""Events of many bridges: chances are p values, and of those that are called no more are false than asked for."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import kstest, norm

from skthermo.fleet._discoveries import _limits
from skthermo.monitoring._false_alarms import Tail

N_PEAKS, RATIO = 60, 0.7


def healthy(random, n=1, common=0.0, is_exponential=False):
    """P values of healthy bridges: squared peaks with an exponential tail, of a baseline and of a time like it.

    The highest new peaks share a normal factor with this correlation.
    """
    chances = []
    shared = random.normal() if common else 0.0
    for _ in range(n):
        base = np.sort(random.exponential(3.0, random.poisson(N_PEAKS)))[::-1]
        number = random.poisson(RATIO * N_PEAKS)
        z = np.sqrt(common) * shared + np.sqrt(1 - common) * random.normal()
        highest = 3.0 * -np.log(-np.expm1(norm.logcdf(z) / max(number, 1)))  # of so many exponential peaks
        tail = replace(Tail.of(base, 1.0), shape=0.0 if is_exponential else None)
        chances.append(tail.p_value(highest, RATIO) if number else 1.0)
    return np.array(chances)


def test_chances_of_healthy_bridges_are_p_values():
    p = healthy(np.random.default_rng(0), 2000, is_exponential=True)
    assert kstest(p[p < 0.99], "uniform", (0, 0.99)).pvalue > 0.01
    careful = healthy(np.random.default_rng(0), 2000)
    assert (careful >= p).all()
    assert 0.5 < (careful == p).mean() < 0.95


@pytest.mark.parametrize("x", [0.3, 1.0, 3.0])
def test_small_chances_are_those_of_a_long_simulation(x):
    random, tail, n = np.random.default_rng(1), Tail(10.0, (2.0,) * 4), 400_000
    rate, scale = random.gamma(5, size=n), 8.0 / random.gamma(4, size=n)
    expected = -np.expm1(-2.0 * rate * np.exp(-8.0 * x / scale))
    deviation = expected.std() / np.sqrt(n)
    assert tail.p_value(10.0 + 8.0 * x, 2.0) == pytest.approx(expected.mean(), abs=4 * deviation)


def test_chances_fall_with_height_and_grow_with_time():
    tail = Tail(10.0, (2.0,) * 20)
    chances = np.array([[tail.p_value(square, years) for square in (9, 11, 30, 200, 1e4)] for years in (0.1, 1, 10)])
    assert (np.diff(chances, axis=1) <= 0).all()
    assert (np.diff(chances[:, 1:], axis=0) > 0).all()
    assert (chances[:, 0] == 1).all()
    assert 0 < chances[0, -1] < 1e-20


@pytest.mark.nightly
@pytest.mark.parametrize("common", [0.0, 0.5])
def test_of_called_bridges_no_more_are_false_than_asked_for(common):
    random, false, found = np.random.default_rng(2), [], []
    for _ in range(150):
        p = healthy(random, 40, common)
        p[:6] = 10.0 ** -random.uniform(2, 8, 6)  # damaged
        called = p <= _limits(p, 0.1)[0]
        false.append(called[6:].sum() / max(called.sum(), 1))
        found.append(called[:6].mean())
    error = np.std(false) / np.sqrt(len(false))
    assert np.mean(false) <= 0.1 * 34 / 40 + 2 * error
    assert np.mean(found) > 0.7


def test_a_fleet_of_one_is_called_by_its_p_value():
    assert _limits(np.array([0.09]), 0.1) == (0.09, 0.1)
    assert _limits(np.array([0.11]), 0.1) == (-1.0, 0.1)
    assert _limits(np.array([]), 0.1) == (-1.0, 0.0)
    assert pd.Series(_limits(np.r_[0.001, 0.9, 0.9, 0.9], 0.1)).tolist() == [0.001, 0.025]


def test_a_baseline_with_an_outlier_makes_chances_larger():
    squares = np.sort(np.random.default_rng(3).exponential(3.0, 60))[::-1]
    odd = Tail.of(np.r_[200.0, squares[1:]], 1.0)
    plain = replace(odd, shape=0.0)
    for height in (200.0, 400.0, 2000.0):
        assert odd.p_value(height, 1.0) > 10 * plain.p_value(height, 1.0)
