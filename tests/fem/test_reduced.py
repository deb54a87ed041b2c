"""Reduced models: as the full model within the box, to the tolerance they state, and never below it."""

import pickle
import warnings
from itertools import product

import numpy as np
import pytest
from sklearn.base import clone

from skthermo.datasets import make_truss, make_z24
from skthermo.fem import AffineModel, FEModel, mac, sample
from tests.fem.frames import FRAME, frame

RANDOM = np.random.default_rng(5)
THETA = RANDOM.uniform(0.7, 1.3, (40, 4))
REDUCED = frame(is_reduced=True)


@pytest.fixture(scope="module", params=[False, True], ids=["sorted", "tracked"])
def pair(request):
    """A model and its reduction."""
    return [frame(track=request.param, is_reduced=is_reduced) for is_reduced in (False, True)]


def test_frequencies_agree_within_tolerance_and_never_fall_below():
    error = REDUCED.frequencies(THETA) / FRAME.frequencies(THETA) - 1
    assert error.max() < 1e-5
    assert error.min() > -1e-8  # Rayleigh-Ritz, but for rounding
    assert REDUCED.basis_size_ < FRAME.n_dof / 5


def test_the_stated_error_is_that_at_the_check_points():
    points = REDUCED.check_points_
    at_corners = np.isin(points, [0.7, 1.3]).all(axis=1)
    assert (~at_corners).sum() == 10
    assert 0 < at_corners.sum() <= 10
    error = np.abs(REDUCED.frequencies(points) / FRAME.frequencies(points) - 1)
    assert REDUCED.error_ == pytest.approx(error.max(), rel=1e-3)
    assert REDUCED.error_ < 5e-6
    assert not (points[:, np.newaxis] == REDUCED.snapshot_points_).all(axis=2).any()


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("model", "seed"),
    [(FRAME, None), *((model, seed) for seed in (1, 2) for model in (FRAME, make_z24()))],
)
def test_the_tolerance_holds_at_every_corner_of_the_box(model, seed):
    corners = np.array([*product([0.7, 1.3], repeat=4)])
    reduced = REDUCED if seed is None else model.reduced(0.3, random_state=seed)
    assert np.abs(reduced.frequencies(corners) / model.frequencies(corners) - 1).max() < 1e-5


@pytest.mark.nightly
def test_no_point_is_one_of_a_sample_with_the_same_seed():
    drawn = sample(FRAME, 0.3, 128, random_state=0).theta
    for points in (REDUCED.check_points_, REDUCED.snapshot_points_, REDUCED.damaged({"soil": 0.99}).check_points_):
        assert not np.isclose(points[:, np.newaxis], drawn).all(axis=2).any()


@pytest.mark.nightly
@pytest.mark.parametrize("tol", [1e-3, 1e-7])
def test_tolerance_sets_the_size(tol):
    reduced = FRAME.reduced(0.3, tol=tol, random_state=0)
    assert (reduced.basis_size_ < REDUCED.basis_size_) == (tol > 1e-5)
    assert np.abs(reduced.frequencies(THETA) / FRAME.frequencies(THETA) - 1).max() < tol


def test_shapes_are_the_full_models_at_all_degrees_of_freedom(pair):
    model, reduced = pair
    for row, full, mine in zip(THETA[:3], model.modes(THETA[:3])[1], reduced.modes(THETA[:3])[1], strict=True):
        np.testing.assert_allclose(np.diag(mac(full, mine)), 1, atol=1e-4)
        mass = model.matrices(row)[1]
        np.testing.assert_allclose(np.einsum("im,im->m", mine, mass @ mine), 1, rtol=1e-8)
    assert reduced.n_dof == model.n_dof


def test_the_jacobian_is_exact_for_the_reduced_model_and_near_the_full_one(pair):
    (model, reduced), inner, step = pair, THETA[:2], 1e-4
    differences = [
        (reduced.frequencies(inner + step * unit) - reduced.frequencies(inner - step * unit)) / (2 * step)
        for unit in np.eye(4)
    ]
    np.testing.assert_allclose(reduced.jacobian(inner), np.stack(differences, axis=2), atol=1e-5)
    np.testing.assert_allclose(reduced.jacobian(inner), model.jacobian(inner), atol=1e-2)


@pytest.mark.nightly
def test_tracked_columns_are_the_full_models():
    wide = np.random.default_rng(0).uniform(0.3, 1.7, (40, 4))
    full = frame(track=True).frequencies(wide)
    assert (full != np.sort(full, axis=1)).any()
    np.testing.assert_allclose(frame(track=True).reduced(0.7, random_state=0).frequencies(wide), full, rtol=1e-5)


@pytest.mark.nightly
@pytest.mark.parametrize("damage", [{"columns": 0.9}, {"soil": 0.99}, {"beams": -0.15, "columns": 0.2}, {}])
def test_damage_beyond_the_box_grows_the_basis(damage):
    reduced = REDUCED.damaged(damage)
    np.testing.assert_allclose(reduced.frequencies(THETA), FRAME.damaged(damage).frequencies(THETA), rtol=1e-5)
    assert reduced.error_ < 5e-6
    assert (reduced.basis_size_ > REDUCED.basis_size_) == bool(damage)
    assert reduced.groups == FRAME.groups


def test_theta_outside_the_bounds_warns_once_a_call():
    with pytest.warns(UserWarning, match="theta of .*outside-bounds") as caught:
        REDUCED.frequencies([[1.0] * 4, [1.0, 1.0, 1.31, 1.0], [0.69] * 4])
    assert len(caught) == 1
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        REDUCED.frequencies([[0.7] * 4, [1.3] * 4])


def test_a_rescaled_model_keeps_its_box():
    origin = np.array([0.8, 1.0, 1.2, 1.1])
    rescaled = REDUCED.rescaled(origin)
    np.testing.assert_allclose(rescaled.frequencies(THETA / origin), REDUCED.frequencies(THETA), rtol=1e-9)
    with pytest.warns(UserWarning, match="outside-bounds"):
        rescaled.frequencies([[0.8, 1.0, 1.0, 1.0]])


def test_a_reduced_model_is_a_model_like_any():
    assert FRAME.reduction_pays(10**6)
    assert not REDUCED.reduction_pays(10**6)
    assert isinstance(REDUCED, FEModel)
    assert clone(REDUCED) is REDUCED
    copied = pickle.loads(pickle.dumps(REDUCED))
    np.testing.assert_array_equal(copied.frequencies(THETA), REDUCED.frequencies(THETA))
    assert "basis vectors, error" in repr(REDUCED)
    assert (REDUCED.matrices(THETA[0])[0] != FRAME.matrices(THETA[0])[0]).nnz == 0


def test_small_dense_models_and_varying_mass_reduce_too():
    truss = make_truss()
    theta = np.random.default_rng(0).uniform(0.8, 1.2, (50, 4))
    reduced = truss.reduced(0.2, random_state=0)
    np.testing.assert_allclose(reduced.frequencies(theta), truss.frequencies(theta), rtol=1e-5)
    assert reduced.reduced(0.1, random_state=0).full is truss
    terms = {"k": np.diag([2.0, 2, 1]) - np.eye(3, k=1) - np.eye(3, k=-1), "s": np.diag([0.0, 0, 1])}
    massless = AffineModel(terms, {"m": np.diag([1.0, 0.0, 2.0])}, n_modes=2)
    theta = np.random.default_rng(0).uniform(0.8, 1.2, (50, 3))
    np.testing.assert_allclose(massless.reduced(0.2).frequencies(theta), massless.frequencies(theta), rtol=1e-5)


def test_an_error_that_no_basis_reaches_is_said():
    terms = {"a": np.eye(6) + np.ones((6, 6)), "b": np.diag(10.0 ** np.arange(6))}
    with pytest.raises(RuntimeError, match=r"after \d+ rounds .* do not give frequencies to 1e-15"):
        AffineModel(terms, np.eye(6), n_modes=2).reduced(0.2, tol=1e-15)
