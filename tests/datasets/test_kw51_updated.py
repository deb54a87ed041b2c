"""The updated model of KW51 is the optimum that it is said to be."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skthermo.datasets import make_kw51

THETA = {  # multipliers that the third fit of examples/plot_kw51_updating.py ends at
    "E_bot": 1.3,
    "E_arc": 0.9,
    "E_br": 0.9,
    "E_con": 0.9,
    "E_pip": 0.942523,
    "A_c": 1.5,
    "I_22p": 0.5,
    "A_d": 1.031471,
    "I_22a": 1.128122,
    "A_a": 1.016123,
    "M_a": 0.711763,
}
MEASURED = np.array([0.51, 1.24, 1.89, 2.45, 2.58, 2.92])
AT_LOWER, AT_UPPER = ["E_arc", "E_br", "E_con", "I_22p"], ["E_bot", "A_c"]


@pytest.fixture(scope="module")
def updated():
    return make_kw51(list(THETA), updated=True)


def test_nominal_state_is_the_documented_theta(updated):
    frequencies = updated.frequencies(np.ones((1, 11)))
    assert_allclose(make_kw51(list(THETA)).frequencies([list(THETA.values())]), frequencies, rtol=1e-9)
    assert_allclose(frequencies[0], [0.507, 1.211, 1.888, 2.515, 2.581, 2.920], atol=5e-4)
    assert 0.008 < np.abs(frequencies[0] / MEASURED - 1).mean() < 0.01


def test_gradient_vanishes_or_points_out_of_the_bounds(updated):
    frequencies, jacobian = (part[0] for part in updated.linearised(np.ones((1, 11))))
    residuals = frequencies / MEASURED - 1
    gradient = dict(zip(THETA, (jacobian / MEASURED[:, np.newaxis]).T @ residuals, strict=True))
    largest = max(map(abs, gradient.values()))
    assert all(gradient[name] > 0 for name in AT_LOWER)
    assert all(gradient[name] < 0 for name in AT_UPPER)
    assert all(abs(gradient[name]) < 1e-3 * largest for name in set(THETA) - {*AT_LOWER, *AT_UPPER})


@pytest.mark.nightly
def test_other_parameters_are_of_the_same_bridge(updated):
    expected = updated.frequencies(np.ones((1, 11)))
    drawn, thermal, everything = make_kw51(), make_kw51(updated=True), make_kw51("all", updated=True)
    assert thermal.parameter_names == drawn.parameter_names
    assert thermal.groups.keys() == drawn.groups.keys()
    assert_allclose(thermal.frequencies(np.ones((1, 5))), expected, rtol=1e-9)
    assert_allclose(everything.frequencies(np.ones((1, 21))), expected, rtol=1e-9)
