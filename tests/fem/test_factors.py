"""Direct solvers say what LAPACK says."""

import importlib.util
import pickle
import sys

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

from skthermo.fem import AffineModel
from tests.fem.frames import FRAME, portal
from tests.fem.test_sparse import THETA as ROWS
from tests.fem.test_sparse import chain, dense_frequencies

THETA = ROWS[:3]
WITHOUT = pytest.mark.skipif(
    importlib.util.find_spec("rslab") is None, reason="rslab is not installed: the extra 'sparse' brings it"
)


@pytest.fixture(params=["superlu", pytest.param("rslab", marks=WITHOUT)])
def solver(request, monkeypatch):
    monkeypatch.setenv("SKTHERMO_SOLVER", request.param)
    return request.param


def test_frequencies_of_any_pattern_are_those_of_lapack(solver):
    random, n = np.random.default_rng(0), 250
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


def test_frequencies_do_not_depend_on_the_solver_and_a_model_that_is_sent_gives_the_same_bits_in_any_order(solver):
    model = portal()
    sent = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(sent.frequencies(THETA[::-1])[::-1], model.frequencies(THETA))
    np.testing.assert_allclose(model.frequencies(THETA), FRAME.frequencies(THETA), rtol=1e-9)
    np.testing.assert_allclose(model.jacobian(THETA[:2]), FRAME.jacobian(THETA[:2]), rtol=1e-6, atol=1e-6)
    reduced, theta = model.reduced(0.2, random_state=0), THETA[:1] ** 0.1
    np.testing.assert_allclose(reduced.frequencies(theta), model.frequencies(theta), rtol=1e-5)


def test_a_solver_that_is_missing_is_named(monkeypatch):
    monkeypatch.setenv("SKTHERMO_SOLVER", "rslab")
    monkeypatch.setitem(sys.modules, "rslab", None)
    with pytest.raises(ImportError, match="rslab"):
        portal()
    monkeypatch.setenv("SKTHERMO_SOLVER", "pardiso")
    with pytest.raises(ValueError, match="pardiso"):
        portal()
