"""Direct solvers, and modes from guesses: both say what LAPACK says."""

import importlib.util
import pickle
import sys

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.fem import AffineModel
from skthermo.fem.modal import ShiftInvertSolver
from tests.fem.frames import FRAME, portal
from tests.fem.test_sparse import THETA, chain, dense_frequencies

WITHOUT = pytest.mark.skipif(
    importlib.util.find_spec("rslab") is None, reason="rslab is not installed: the extra 'sparse' brings it"
)


@pytest.fixture(params=["superlu", pytest.param("rslab", marks=WITHOUT)])
def solver(request, monkeypatch):
    monkeypatch.setenv("SKTHERMO_SOLVER", request.param)
    return request.param


@pytest.mark.parametrize("seed", range(3))
def test_frequencies_of_any_pattern_are_those_of_lapack(solver, seed):
    random, n = np.random.default_rng(seed), 250
    part = scipy.sparse.random_array((n, n), density=0.01, rng=random)
    own = scipy.sparse.diags_array(random.uniform(0.1, 1.0, n))
    model = AffineModel({("a",): part @ part.T, ("b",): own}, scipy.sparse.eye_array(n), n_modes=4)
    theta = random.uniform(0.5, 2.0, (3, 2))
    np.testing.assert_allclose(model.frequencies(theta), dense_frequencies(model, theta), rtol=1e-9)


def test_what_is_not_positive_definite_has_no_modes_and_changes_no_other_row(solver):
    terms = {("k",): chain(250), ("force",): -1e-5 * scipy.sparse.eye_array(250)}
    model = AffineModel(terms, scipy.sparse.eye_array(250), n_modes=3)
    with pytest.warns(UserWarning, match="no-solution"):
        frequencies = model.frequencies([[1.0, 1.0], [1.0, 1e4], [2.0, 1.0]])
    assert np.isnan(frequencies).any(axis=1).tolist() == [False, True, False]
    np.testing.assert_array_equal(frequencies[[0, 2]], model.frequencies([[1.0, 1.0], [2.0, 1.0]]))


def test_a_model_that_is_sent_gives_the_bits_of_its_own_in_any_order(solver):
    model = portal()
    sent = pickle.loads(pickle.dumps(model))
    expected = model.frequencies(THETA)
    np.testing.assert_array_equal(sent.frequencies(THETA[::-1])[::-1], expected)


def test_frequencies_do_not_depend_on_the_solver(solver):
    model = portal()
    np.testing.assert_allclose(model.frequencies(THETA), FRAME.frequencies(THETA), rtol=1e-9)
    np.testing.assert_allclose(model.jacobian(THETA), FRAME.jacobian(THETA), rtol=1e-6, atol=1e-6)
    reduced = model.reduced(0.2, random_state=0)
    np.testing.assert_allclose(reduced.frequencies(THETA[:1] ** 0.1), model.frequencies(THETA[:1] ** 0.1), rtol=1e-5)


def test_a_solver_that_is_missing_is_named(monkeypatch):
    monkeypatch.setenv("SKTHERMO_SOLVER", "rslab")
    monkeypatch.setitem(sys.modules, "rslab", None)
    with pytest.raises(ImportError, match="rslab"):
        portal()
    monkeypatch.setenv("SKTHERMO_SOLVER", "pardiso")
    with pytest.raises(ValueError, match="pardiso"):
        portal()


def frequencies_near(model, theta, guesses, tol=1e-10):
    """Frequencies and shapes from guesses, the same for all rows."""
    core = model._core
    guided = ShiftInvertSolver(
        core.stiffness, core.mass, lambda rows, _: np.broadcast_to(guesses, (len(rows), *guesses.shape)), tol
    )
    eigenvalues, shapes = guided.modes(theta, model.n_modes)
    return np.sqrt(eigenvalues) / (2 * np.pi), shapes


def nominal_shapes(model, n_modes):
    return model._core.solver.modes(np.ones((1, len(model.parameter_names))), n_modes)[1][0]


GUESSES = {
    "nominal modes": lambda modes: modes,
    "a mode lacks": lambda modes: np.delete(modes, 1, axis=1),
    "two modes lack": lambda modes: np.delete(modes, [0, 4], axis=1),
    "too few": lambda modes: modes[:, :2],
    "one mode many times": lambda modes: modes[:, [0] * 8],
    "noise": lambda modes: np.random.default_rng(3).standard_normal(modes.shape),
    "zeros": np.zeros_like,
    "no numbers": lambda modes: np.full_like(modes, np.nan),
}


@pytest.mark.one_case
@pytest.mark.parametrize("kind", GUESSES)
def test_modes_near_guesses_are_those_of_lapack(kind):
    guesses = GUESSES[kind](nominal_shapes(FRAME, 8))
    frequencies, shapes = frequencies_near(FRAME, THETA, guesses)
    np.testing.assert_allclose(frequencies, dense_frequencies(FRAME, THETA), rtol=1e-9)
    for row, f, phi in zip(THETA, frequencies, shapes, strict=True):
        stiffness, mass = FRAME.matrices(row)
        np.testing.assert_allclose(phi.T @ (mass @ phi), np.eye(6), atol=1e-8)
        residual = stiffness @ phi - mass @ phi * (2 * np.pi * f) ** 2
        assert np.abs(residual).max() < 1e-4 * np.abs(stiffness @ phi).max()


@settings(max_examples=15)
@given(lacks=st.integers(0, 5), mixed=st.integers(0, 2**32 - 1), tol=st.sampled_from([1e-4, 1e-6, 1e-8]))
def test_the_error_stays_below_what_is_asked(lacks, mixed, tol):
    """Symmetric structures: guesses of one symmetry hold nothing of the modes of the other."""
    random = np.random.default_rng(mixed)
    modes = np.delete(nominal_shapes(FRAME, 8), lacks, axis=1)
    guesses = modes @ random.standard_normal((7, 7)) + 1e-3 * random.standard_normal(modes.shape)
    eigenvalues = frequencies_near(FRAME, THETA[:2], guesses, tol)[0] ** 2
    np.testing.assert_allclose(eigenvalues, dense_frequencies(FRAME, THETA[:2]) ** 2, rtol=tol)


@pytest.mark.parametrize("copies", [2, 3])
def test_repeated_eigenvalues_are_found_from_guesses_of_one_copy(copies):
    stiffness = scipy.sparse.block_diag([chain(120)] * copies).tocsc()
    model = AffineModel({("k",): stiffness}, scipy.sparse.eye_array(120 * copies), n_modes=2 * copies)
    expected = np.repeat(np.sin(np.array([1, 2]) * np.pi / 242) / np.pi, copies)
    one = np.zeros((120 * copies, 4))
    one[:120] = np.sin(np.outer(np.arange(1, 121), np.arange(1, 5)) * np.pi / 121)
    np.testing.assert_allclose(frequencies_near(model, np.ones((1, 1)), one)[0][0], expected, rtol=1e-9)


@settings(max_examples=10)
@given(share=st.floats(0.03, 0.5), n_modes=st.integers(1, 5), guards=st.integers(0, 3), n=st.sampled_from([120, 300]))
def test_a_mode_of_a_part_that_neither_guesses_nor_nominal_modes_move_is_found(share, n_modes, guards, n):
    """Two chains that nothing joins; the second is stiff at theta = 1, and soft where modes are sought."""
    nothing = scipy.sparse.csc_array((n, n))
    first, second = (scipy.sparse.block_diag(pair) for pair in ((chain(n), nothing), (nothing, 40 * chain(n))))
    model = AffineModel({("a",): first, ("b",): second}, scipy.sparse.eye_array(2 * n), n_modes=n_modes)
    guesses = np.zeros((2 * n, n_modes + guards))
    guesses[:n] = np.sin(np.outer(np.arange(1, n + 1), np.arange(1, n_modes + guards + 1)) * np.pi / (n + 1))
    theta = np.array([[1.0, share]])
    found = frequencies_near(model, theta, guesses, 1e-6)[0]
    np.testing.assert_allclose(found, dense_frequencies(model, theta), rtol=1e-6)
