"""Sensitivities and what they say of identifiability."""

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, CallableModel
from skthermo.updating import identifiability, select_parameters, sensitivity
from tests.fem.frames import FRAME
from tests.fem.test_local_modes import building_frame

THETA = [0.9, 1.1, 1.05, 0.95]


@pytest.mark.parametrize("model", [make_truss(), FRAME], ids=["truss", "sparse frame"])
@pytest.mark.parametrize("theta", [None, THETA])
def test_exact_sensitivities_equal_central_differences(model, theta):
    exact = sensitivity(model, theta)
    central = sensitivity(model, theta, step=1e-4)
    pd.testing.assert_frame_equal(exact, central, rtol=0, atol=1e-6)
    assert list(exact.columns) == list(model.parameter_names)
    assert list(exact.index) == [f"f{i}" for i in range(1, 7)]


def test_sensitivities_sum_to_a_half_where_parameters_hold_all_stiffness():
    model = building_frame()
    np.testing.assert_allclose(sensitivity(model).sum(axis=1), 0.5, atol=1e-8)


def test_a_power_law_has_its_exponents_as_sensitivities():
    exponents = np.array([[0.5, -0.5], [0.2, 1.0], [0.0, 0.1]])
    model = CallableModel(lambda theta: np.exp(np.log(theta) @ exponents.T), ["k", "m"], 3, vectorized=True)
    S = sensitivity(model, [0.7, 2.0], step=1e-4)
    np.testing.assert_allclose(S, exponents, atol=1e-7)
    assert select_parameters(S) == ["k", "m"]
    assert select_parameters(S, threshold=0.6) == ["m"]
    assert select_parameters(S, threshold=2.0) == []
    known = identifiability(model, [0.7, 2.0], noise=0.01)
    covariance = np.linalg.inv(exponents.T @ exponents) * 0.01**2
    np.testing.assert_allclose(known.deviations, np.sqrt(np.diag(covariance)), rtol=1e-4)
    values = np.linalg.svd(exponents, compute_uv=False)
    np.testing.assert_allclose(known.singular_values, values, rtol=1e-4)
    assert known.condition_number == pytest.approx(values[0] / values[1], rel=1e-4)


def test_a_model_without_frequencies_has_no_sensitivities():
    with pytest.warns(UserWarning, match="NaN"), pytest.raises(ValueError, match="expected numbers"):
        sensitivity(CallableModel(lambda row: row[:1] * np.nan, ["k"], 1))


@pytest.mark.parametrize("n_modes", [1, 2, 3])
def test_shapes_tell_more_parameters_apart_than_there_are_modes(n_modes):
    model = make_truss(n_modes=n_modes)
    alone = identifiability(model, noise=0.001)
    assert alone.rank == n_modes
    assert "more modes, shapes, or a prior" in alone.summary()
    with_shapes = identifiability(model, noise=0.001, dofs=[3, 8, 13, 18], shape_noise=0.01)
    assert with_shapes.rank == 4
    assert with_shapes.summary().startswith(f"4 parameters, {n_modes} mode{'s' * (n_modes > 1)} with their shapes at 4")
    assert "are identifiable together." not in with_shapes.summary()


def test_what_only_some_parameters_share_leaves_the_others_known():
    terms = {("a",): np.diag([1.0, 0, 0]), ("twin",): np.diag([1.0, 0, 0]), ("b",): np.diag([0, 3.0, 5.0])}
    model = AffineModel(terms, np.eye(3), n_modes=3)
    known = identifiability(model, noise=0.001)
    assert np.isinf(known.deviations[["a", "twin"]]).all()
    assert known.collinear == [["a", "twin"]]
    assert known.condition_number == np.inf
    assert known.rank == len(known.recommended) == 2
    assert "b" in known.recommended
    assert "At most 2 of the 3 parameters are identifiable together." in known.summary()
    assert known.deviations["b"] == pytest.approx(2 * 0.001 / np.sqrt(2))
    assert identifiability(model, noise=0.0).deviations.tolist() == [np.inf, np.inf, 0.0]


@pytest.mark.parametrize("seed", range(2))
def test_the_bound_is_the_inverse_up_to_rounding_and_infinite_beyond(seed):
    """Of four parameters, two act almost alike: a difference of 1e-4 is information, one of 1e-9 is rounding."""
    random = np.random.default_rng(seed)
    shares, difference = random.uniform(0.2, 1.0, (8, 4)), random.uniform(-1, 1, 8)
    for size in (1e-4, 1e-9):
        shares[:, 3] = shares[:, 2] * (1 + size * difference)
        springs = {(name,): np.diag(column) for name, column in zip("abcd", shares.T, strict=True)}
        found = identifiability(AffineModel(springs, np.eye(8), n_modes=8), noise=0.001).deviations
        if size == 1e-4:
            slopes = shares / (2 * shares.sum(axis=1, keepdims=True))
            inverse = np.linalg.pinv(slopes)
            np.testing.assert_allclose(found, 0.001 * np.sqrt(np.diag(inverse @ inverse.T)), rtol=1e-4)
        else:
            assert np.isinf(found).tolist() == [False, False, True, True]


def test_noise_that_varies_weights_the_modes():
    model, noise = make_truss(), np.array([1, 2, 3, 1, 2, 3]) / 1000
    known = identifiability(model, noise=noise)
    rows = known.sensitivity.to_numpy() / noise[:, np.newaxis]
    np.testing.assert_allclose(known.deviations, np.sqrt(np.diag(np.linalg.inv(rows.T @ rows))), rtol=1e-9)
    same = identifiability(model, noise=0.002)
    np.testing.assert_allclose(same.singular_values, np.linalg.svd(same.sensitivity, compute_uv=False))


def shape_rows(model, dofs):
    """Derivatives of shapes scaled to a root mean square of 1 and held in direction, by central differences."""
    step, nominal = 1e-4, model.modes(np.ones((1, 4)))[1][0][dofs]
    ends = [[model.modes([1 + way * step * unit])[1][0][dofs] for way in (1, -1)] for unit in np.eye(4)]
    raised, lowered = (np.stack([end[i] / (end[i] * nominal).sum(axis=0) for end in ends]) for i in (0, 1))
    slopes = (raised - lowered) / (2 * step) * np.sqrt((nominal**2).sum(axis=0) * len(dofs))
    return slopes.reshape(4, -1).T


def test_shapes_add_information():
    model, dofs = make_truss(), np.arange(0, 20, 3)
    without = identifiability(model, noise=0.001).deviations
    known = identifiability(model, noise=0.001, dofs=dofs, shape_noise=0.01)
    assert (known.deviations < without).all()
    nothing = identifiability(model, noise=0.001, dofs=dofs, shape_noise=1e6)
    np.testing.assert_allclose(nothing.deviations, without, rtol=1e-6)
    finer = identifiability(model, noise=0.001, dofs=dofs, shape_noise=1e-6)
    rows = shape_rows(model, dofs) / 1e-6
    np.testing.assert_allclose(finer.deviations, np.sqrt(np.diag(np.linalg.inv(rows.T @ rows))), rtol=1e-4)
    other = CallableModel(model.frequencies, model.parameter_names, 6, vectorized=True)
    with pytest.raises(ValueError, match="has no method 'modes'; expected"):
        identifiability(other, noise=0.001, dofs=dofs, shape_noise=0.01)
