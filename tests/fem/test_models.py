"""How models live: immutable, shared by clones, the same bits however they are spread."""

import pickle

import joblib
import numpy as np
import pytest
import scipy.sparse
from sklearn.base import clone
from threadpoolctl import threadpool_limits

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, CallableModel, FEModel, add_noise, mac, sample


def test_clone_shares_and_pickle_copies_and_damaged_leaves_the_model_as_it_was():
    truss, theta = make_truss(), [[0.9, 1.0, 1.1, 1.2]]
    before = truss.frequencies(theta)
    assert clone(truss) is truss
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(truss)).frequencies(theta), before)
    truss.damaged({"top": 0.5})
    np.testing.assert_array_equal(truss.frequencies(theta), before)


def test_a_model_keeps_its_own_copy_of_matrices():
    matrix = np.eye(2)
    model = AffineModel({("k",): matrix}, np.eye(2), n_modes=1)
    matrix[0, 0] = 100.0
    np.testing.assert_allclose(model.frequencies([[1.0]]), 1 / (2 * np.pi))
    with pytest.raises(ValueError, match="read-only"):
        model._core.stiffness.matrices[0, 0, 0] = 5.0


@pytest.mark.parametrize("method", ["uniform", "lhs", "sobol"])
def test_samples_fill_the_box_and_repeat_with_their_seed(method):
    bounds = np.array([[0.5, 0.6], [0.9, 1.5], [1.0, 2.0], [0.1, 3.0]])
    first, second = (sample(make_truss(), bounds, 128, method=method, random_state=5) for _ in range(2))
    np.testing.assert_array_equal(first.theta, second.theta)
    np.testing.assert_array_equal(first.frequencies, second.frequencies)
    assert ((first.theta > bounds[:, 0]) & (first.theta < bounds[:, 1])).all()
    unit = (first.theta - bounds[:, 0]) / np.ptp(bounds, axis=1)
    np.testing.assert_allclose(unit.mean(axis=0), 0.5, atol=0.06)


@pytest.mark.nightly
@pytest.mark.parametrize("n_dof", [400, 3000])
def test_same_bits_however_samples_of_a_large_model_are_spread(n_dof):
    """More than 1 MB, so that joblib hands it to workers as a read-only memory map; dense and sparse."""
    offsets = np.arange(1, 21)
    springs = [2 * (1.0 / offsets).sum(), *np.tile(-1.0 / offsets, 2)]
    chain = scipy.sparse.diags_array(springs, offsets=[0, *offsets, *-offsets], shape=(n_dof, n_dof))
    left = scipy.sparse.diags_array((np.arange(n_dof) < n_dof // 2).astype(float))
    full = 1e-6 * np.ones((n_dof, n_dof)) if n_dof == 400 else 0 * chain
    terms = {"left": left @ chain @ left + left + full, "right": chain + full}
    model = AffineModel(terms, scipy.sparse.eye_array(n_dof), n_modes=3)
    n_samples = 3 * model.rows_per_chunk // 2
    with threadpool_limits(2, "blas"):
        alone = sample(model, 0.2, n_samples, random_state=0)
    with joblib.parallel_config("loky"):
        spread = sample(model, 0.2, n_samples, n_jobs=2, random_state=0)
    np.testing.assert_array_equal(spread.theta, alone.theta)
    np.testing.assert_array_equal(spread.frequencies, alone.frequencies)


def test_a_program_is_damaged_by_its_parameters(tmp_path):
    """As the affine model with the same stiffness: severities multiply parameters, one after the other."""
    truss = make_truss()
    rows = np.random.default_rng(0).uniform(0.8, 1.2, (4, 4))
    asked = []

    def program(theta):
        asked.append(theta)
        return truss.frequencies(theta)

    names, cache = truss.parameter_names, tmp_path / "solved"
    model = CallableModel(program, names, 6, vectorized=True, cache=cache)
    assert list(model.groups) == list(names)
    assert clone(model) is model
    assert isinstance(model, FEModel)
    for damage in ({"bottom": 0.2}, {"top": -0.15, "diagonal": 0.4}, {}):
        expected = truss.damaged(damage).frequencies(rows)
        np.testing.assert_array_equal(model.damaged(damage).frequencies(rows), expected)
    twice = model.damaged({"bottom": 0.2}).damaged({"bottom": 0.5})
    np.testing.assert_allclose(twice.frequencies(rows), truss.damaged({"bottom": 0.6}).frequencies(rows), rtol=1e-12)
    np.testing.assert_array_equal(model.frequencies(rows), truss.frequencies(rows))
    n_asked = len(asked)
    again = CallableModel(program, names, 6, vectorized=True, cache=cache, groups={"chords": ["bottom", "top"]})
    np.testing.assert_array_equal(again.damaged({}).frequencies(rows), truss.frequencies(rows))
    assert len(asked) == n_asked  # one cache for all states
    both = again.damaged({"chords": 0.1}).frequencies(rows)
    np.testing.assert_array_equal(both, truss.damaged({"bottom": 0.1, "top": 0.1}).frequencies(rows))
    with pytest.raises(ValueError, match="unknown damage group 'bottom'"):
        again.damaged({"bottom": 0.1})


def test_noise_is_relative_gaussian_and_by_mode():
    clean = np.full((40_000, 2), [5.0, 50.0])
    noisy = add_noise(clean, [0.01, 0.02], random_state=0)
    np.testing.assert_allclose((noisy / clean - 1).std(axis=0), [0.01, 0.02], rtol=0.02)
    np.testing.assert_array_equal(add_noise(clean, 0.0), clean)


def test_no_rows_in_no_rows_out():
    frequencies, shapes = make_truss().modes(np.empty((0, 4)))
    assert frequencies.shape == (0, 6)
    assert shapes.shape == (0, 23, 6)


@pytest.mark.parametrize("dtype", [np.int8, np.uint8])
def test_mac_of_integers_is_that_of_floats(dtype):
    a, b = np.array([[100, 3], [100, 0], [0, 7]]).astype(dtype), np.array([100, 90, 7]).astype(dtype)
    np.testing.assert_array_equal(mac(a, b), mac(a.astype(float), b.astype(float)))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("scale", [1e200, 1e-200, 1e-320, 1e300 * (1 + 1j), 1.5e308])
def test_mac_does_not_depend_on_the_scale(scale):
    phi = np.array([[0.5, 0.1], [1.0, -0.2], [-0.3, 0.9]])
    np.testing.assert_allclose(mac(phi * scale, phi[:, ::-1] * scale), mac(phi, phi[:, ::-1]), rtol=1e-3)
    np.testing.assert_allclose(mac(phi * [scale, 1.0], phi), mac(phi, phi), rtol=1e-3)


def test_a_small_model_gives_all_its_modes_and_a_larger_one_its_lowest_six():
    stiffness = 2 * np.eye(8) - np.eye(8, k=1) - np.eye(8, k=-1)
    assert AffineModel({("k",): stiffness[:3, :3]}, np.eye(3)).n_modes == 3
    assert AffineModel({("k",): stiffness}, np.eye(8)).n_modes == 6
