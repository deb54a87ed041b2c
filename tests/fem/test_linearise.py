"""Frequencies and derivatives of many rows."""

import numpy as np
import pytest

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, CallableModel, linearise, sample

TRUSS = make_truss()
THETA = sample(TRUSS, 0.1, 40, random_state=0).theta


class OnlyJacobian:
    """A third-party model with derivatives."""

    parameter_names, n_modes = TRUSS.parameter_names, TRUSS.n_modes

    def frequencies(self, theta):
        return TRUSS.frequencies(theta)

    def jacobian(self, theta):
        return TRUSS.jacobian(theta)


def test_exact_derivatives_are_the_models_whichever_way_it_gives_them():
    frequencies, jacobian = linearise(TRUSS, THETA)
    np.testing.assert_array_equal(jacobian, TRUSS.jacobian(THETA))
    np.testing.assert_allclose(frequencies, TRUSS.frequencies(THETA), rtol=1e-11)
    for exact, other in zip((frequencies, jacobian), linearise(OnlyJacobian(), THETA), strict=True):
        np.testing.assert_allclose(other, exact, rtol=1e-9)


def test_differences_agree_with_exact_derivatives_to_second_order():
    program = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6, vectorized=True)
    exact = TRUSS.jacobian(THETA)
    errors = [np.abs(linearise(program, THETA, step=step)[1] - exact).max() for step in (0.04, 0.02, 0.01)]
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2, atol=0.1)


def test_rows_with_nan_are_nan_and_others_unchanged():
    gappy = THETA.copy()
    gappy[3, 1] = np.nan
    frequencies, jacobian = linearise(TRUSS, gappy)
    assert np.isnan(frequencies).all(axis=1).tolist() == [row == 3 for row in range(40)]
    assert np.isnan(jacobian).all(axis=(1, 2)).tolist() == [row == 3 for row in range(40)]
    np.testing.assert_allclose(np.delete(jacobian, 3, axis=0), TRUSS.jacobian(np.delete(THETA, 3, axis=0)), rtol=1e-9)
    assert np.isnan(linearise(TRUSS, np.full((2, 4), np.nan))[1]).all()


def test_differences_are_one_sided_beside_rows_without_frequencies():
    def buckles_above_one(theta):
        return np.where(theta > 1, np.nan, np.sqrt(theta))

    program = CallableModel(buckles_above_one, ["k"], 1, vectorized=True)
    with pytest.warns(UserWarning, match="no-solution"):
        jacobian = linearise(program, [[1.0]], step=1e-4)[1]
    np.testing.assert_allclose(jacobian, 0.5, rtol=1e-4)


def test_mass_parameters_have_derivatives_of_the_other_sign():
    model = AffineModel({("k",): [[4.0]]}, {("m",): [[1.0]]}, n_modes=1)
    frequencies, jacobian = linearise(model, [[2.0, 3.0]])
    np.testing.assert_allclose(jacobian[0, 0] / frequencies[0], [0.5 / 2.0, -0.5 / 3.0], rtol=1e-12)
    relative = linearise(model, [[2.0, 3.0], [0.5, 1.5]], relative=True)[1]
    np.testing.assert_allclose(relative[:, 0], [[0.5, -0.5], [0.5, -0.5]], rtol=1e-12)
