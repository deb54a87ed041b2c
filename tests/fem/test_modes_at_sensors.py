"""Mode shapes at sensors: many theta at once, their derivatives, and components free of scale, sign and phase."""

import numpy as np
import pytest

from skthermo.datasets import make_truss
from skthermo.fem import (
    AffineModel,
    evaluate_modes,
    linearise,
    linearise_modes,
    mac,
    sample,
    shape_components,
)
from tests.fem.frames import frame, local_shapes

TRUSS = make_truss()
THETA = sample(TRUSS, 0.2, 30, random_state=0).theta
DOFS = [1, 3, 5, 10, 22]
SPRINGS = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
FIRST, LAST = np.diag([400.0, 0.0, 0.0]), np.diag([0.0, 0.0, 50.0])


HEAVY = {("m",): np.diag([1.0, 0.0, 0.0]), (): np.diag([1.0, 2.0, 3.0])}
MODELS = {
    "dense": lambda: TRUSS,
    "varying mass": lambda: AffineModel({(): 300 * SPRINGS, ("k",): FIRST}, HEAVY, n_modes=2),
    "massless": lambda: AffineModel({("k",): 300 * SPRINGS, ("foot",): LAST}, np.diag([1.0, 2.0, 0.0]), n_modes=2),
    "reduced": lambda: frame(track=True, is_reduced=True),
    "sparse": lambda: frame(track=True),
}


@pytest.mark.parametrize("kind", MODELS)
def test_derivatives_are_those_of_one_theta_at_a_time(kind):
    model = MODELS[kind]()
    theta = sample(model, 0.1, 3, random_state=1).theta
    dofs = DOFS if model.n_dof > 5 else [0, 2]
    frequencies, jacobian, shapes, slopes = model.linearised_modes(theta, dofs)
    for exact, found in zip(linearise(model, theta), (frequencies, jacobian), strict=True):
        np.testing.assert_allclose(found, exact, rtol=1e-8, atol=1e-9 * np.abs(exact).max())
    for row, phi, slope in zip(theta, shapes, slopes, strict=True):
        expected, derivatives = local_shapes(model, row, dofs)
        signs = np.sign((expected * phi).sum(axis=0))
        np.testing.assert_allclose(phi * signs, expected, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(slope * signs[:, np.newaxis], derivatives, atol=1e-5 * np.abs(derivatives).max())


class OnlyModes:
    """A third-party model that gives shapes, and no derivatives."""

    parameter_names, n_modes = TRUSS.parameter_names, TRUSS.n_modes

    def frequencies(self, theta):
        return TRUSS.frequencies(theta)

    def modes(self, theta):
        frequencies, shapes = TRUSS.modes(theta)
        return frequencies, shapes * np.where(np.arange(len(theta)) % 2, 1.0, -1.0)[:, np.newaxis, np.newaxis]


def test_differences_agree_with_exact_derivatives_to_second_order():
    exact = linearise_modes(TRUSS, THETA, DOFS)
    signs = np.sign((exact[2] * evaluate_modes(OnlyModes(), THETA, DOFS)[1]).sum(axis=1))[:, np.newaxis, :, np.newaxis]
    errors = []
    for step in (0.008, 0.004, 0.002):
        found = linearise_modes(OnlyModes(), THETA, DOFS, step=step)
        errors.append(np.abs(found[3] * signs - exact[3]).max())
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2, atol=0.15)


def test_rows_with_nan_are_nan_and_jobs_change_nothing():
    theta = np.tile(THETA, (12, 1))
    theta[5, 2] = np.nan
    for function in (evaluate_modes, linearise_modes):
        one, two = (function(TRUSS, theta, DOFS, n_jobs=n_jobs) for n_jobs in (1, 2))
        for left, right in zip(one, two, strict=True):
            np.testing.assert_array_equal(left, right)
            assert np.isnan(left[5]).all()
            assert not np.isnan(np.delete(left, 5, axis=0)).any()


def test_samples_have_shapes_of_their_own_frequencies():
    drawn = sample(TRUSS, 0.2, 20, dofs=DOFS, random_state=0)
    frequencies, shapes = TRUSS.modes(drawn.theta)
    np.testing.assert_allclose(drawn.frequencies, frequencies)
    np.testing.assert_allclose(drawn.shapes, shapes[:, DOFS])
    np.testing.assert_array_equal(drawn.theta, sample(TRUSS, 0.2, 20, random_state=0).theta)


def test_components_are_free_of_scale_sign_and_phase():
    rng = np.random.default_rng(0)
    shapes = evaluate_modes(TRUSS, THETA, DOFS)[1].swapaxes(1, 2)
    reference = evaluate_modes(TRUSS, np.ones((1, 4)), DOFS)[1][0]
    factors = rng.uniform(0.1, 10, (30, 6, 1)) * np.exp(1j * rng.uniform(0, 2 * np.pi, (30, 6, 1)))
    components = shape_components(shapes, reference)
    np.testing.assert_allclose(shape_components(factors * shapes, reference), components, atol=1e-12)
    np.testing.assert_allclose(shape_components(components.reshape(shapes.shape), reference), components)
    parts = components.reshape(shapes.shape)
    np.testing.assert_allclose((parts**2).mean(axis=2), 1)
    assert (np.einsum("smd,dm->sm", parts, reference) >= 0).all()
    for row, shape in zip(parts[:3], shapes[:3], strict=True):
        np.testing.assert_allclose(np.diag(mac(row.T, shape.T)), 1)


def test_components_of_a_missing_mode_are_nan():
    shapes = evaluate_modes(TRUSS, THETA[:2], DOFS)[1].swapaxes(1, 2)
    reference, clean = shapes[0].T, shape_components(shapes, shapes[0].T)
    shapes[0, 1, 3], shapes[1, 4] = np.nan, 0.0
    found, missing = shape_components(shapes, reference), np.zeros((2, 6, 5), dtype=bool)
    missing[0, 1] = missing[1, 4] = True
    np.testing.assert_array_equal(np.isnan(found), missing.reshape(2, -1))
    np.testing.assert_array_equal(found[~missing.reshape(2, -1)], clean[~missing.reshape(2, -1)])


def test_repeated_frequencies_have_finite_derivatives():
    """Two equal oscillators: the bordered equations are singular."""
    model = AffineModel({("a",): np.diag([400.0, 0.0]), ("b",): np.diag([0.0, 400.0])}, np.eye(2), n_modes=2)
    slopes = model.linearised_modes([[1.0, 1.0], [1.0, 1.2]], [0, 1])[3]
    np.testing.assert_allclose(slopes, 0, atol=1e-9)
