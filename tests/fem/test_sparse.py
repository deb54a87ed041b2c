"""Large models: shift-invert says what dense solvers say."""

import numpy as np
import pytest
import scipy.io
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

from skthermo.fem import AffineModel, Beam, Structure
from skthermo.fem.modal import ShiftInvertSolver
from tests.fem.frames import FRAME, SECTION, frame

THETA = np.random.default_rng(0).uniform(0.6, 1.5, (6, 4))


def dense_frequencies(model, theta):
    """1 / eigh(M, K), row by row: keeps the digits of the lowest modes."""
    found = []
    for row in theta:
        stiffness, mass = (matrix.toarray() for matrix in model.matrices(row))
        inverse = scipy.linalg.eigh(mass, stiffness, eigvals_only=True)[::-1][: model.n_modes]
        found.append(1 / np.sqrt(inverse) / (2 * np.pi))
    return np.array(found)


def test_sparse_frequencies_agree_with_a_dense_solver_alone_and_among_others():
    assert FRAME.n_dof > 200
    assert isinstance(FRAME._core.solver, ShiftInvertSolver)
    found = FRAME.frequencies(THETA[:3])
    np.testing.assert_allclose(found, dense_frequencies(FRAME, THETA[:3]), rtol=1e-9)
    np.testing.assert_array_equal(found, np.concatenate([FRAME.frequencies([row]) for row in THETA[:3]]))


def test_sparse_shapes_have_unit_modal_mass_and_solve_the_eigenproblem():
    for row, f, phi in zip(THETA, *FRAME.modes(THETA), strict=True):
        stiffness, mass = FRAME.matrices(row)
        eigenvalues = (2 * np.pi * f) ** 2
        np.testing.assert_allclose(phi.T @ (mass @ phi), np.eye(6), atol=1e-8)
        residual = stiffness @ phi - mass @ phi * eigenvalues
        assert np.abs(residual).max() < 1e-6 * np.abs(mass @ phi * eigenvalues).max()


@pytest.mark.one_case
@pytest.mark.parametrize("track", [False, True])
def test_sparse_jacobian_equals_central_differences(track):
    model, theta, step = frame(track=track), THETA[:2], 1e-4
    differences = [
        (model.frequencies(theta + step * unit) - model.frequencies(theta - step * unit)) / (2 * step)
        for unit in np.eye(4)
    ]
    np.testing.assert_allclose(model.jacobian(theta), np.stack(differences, axis=2), atol=1e-5)


def chain(n_dof):
    return scipy.sparse.diags_array([np.full(n_dof, 2.0), *-np.ones((2, n_dof - 1))], offsets=[0, 1, -1]).tocsc()


@pytest.mark.parametrize(("copies", "n_dof"), [(3, 100), (5, 200)])
def test_repeated_eigenvalues_are_all_found(copies, n_dof):
    """Equal chains side by side; that of one has frequencies sin(j pi / (2 n + 2)) / pi."""
    stiffness = scipy.sparse.block_diag([chain(n_dof)] * copies).tocsc()
    model = AffineModel({("k",): stiffness}, scipy.sparse.eye_array(n_dof * copies), n_modes=2 * copies)
    expected = np.repeat(np.sin(np.array([1, 2]) * np.pi / (2 * n_dof + 2)) / np.pi, copies)
    np.testing.assert_allclose(model.frequencies([[1.0]])[0], expected, rtol=1e-10)


def test_sparse_massless_degrees_of_freedom_have_no_modes():
    mass = scipy.sparse.diags_array(np.where(np.arange(300) % 3, 0.0, 1.0))
    model = AffineModel({("k",): chain(300)}, mass, n_modes=4)
    np.testing.assert_allclose(model.frequencies([[2.0]]), dense_frequencies(model, [[2.0]]), rtol=1e-10)
    with pytest.raises(ValueError, match="n_modes is 101, but 300 degrees of freedom, 200 of them massless, have only"):
        AffineModel({("k",): chain(300)}, mass, n_modes=101)


def test_a_large_mechanism_is_named():
    loose = chain(400).tolil()
    loose[0, 0] = loose[-1, -1] = 1.0
    with pytest.raises(ValueError, match=r"mechanism: degree of freedom .* and 394 more can move"):
        AffineModel({("k",): loose}, scipy.sparse.eye_array(400))
    nodes = {i: (0.5 * i, 0, 0) for i in range(61)}
    beams = {i: Beam(i, i + 1, **SECTION) for i in range(60)}
    with pytest.raises(ValueError, match=r"node \d+ along rx, .* can move"):
        Structure(nodes, beams, {0: "xyz", 60: "yz"}, {"all": list(beams)}).assemble(["all"])


def test_large_indefinite_matrices_are_refused():
    ones, skew = scipy.sparse.eye_array(300), chain(300).tolil()
    hidden = scipy.sparse.diags_array(np.arange(300) < 9, dtype=float).tolil()
    hidden[200, 201] = hidden[201, 200] = 0.1
    skew[3, 7] = 0.5
    negative = 1.0 - 2.0 * (np.arange(300) == 7)
    for stiffness, mass, message in (
        (chain(300) - 0.1 * ones, ones, "mechanism"),
        (chain(300), chain(300) - 0.1 * ones, "mass has a negative eigenvalue"),
        (chain(300), scipy.sparse.diags_array(negative), "negative at degree of freedom 7;"),
        (chain(300), np.diag(negative), "negative at degree of freedom 7;"),
        (chain(300), hidden, "mass has a negative eigenvalue"),
        (skew, ones, r"not symmetric: entries \((3, 7|7, 3)\) and"),
    ):
        with pytest.raises(ValueError, match=message):
            AffineModel({"k": stiffness}, mass, n_modes=2)


@pytest.mark.one_case
@pytest.mark.parametrize(("n_masses", "track"), [(3, False), (12, True), (41, False), (80, True)])
def test_few_masses_on_many_degrees_of_freedom(n_masses, track):
    """Storey masses of a building: a Krylov space is no larger than there are masses."""
    masses = np.zeros(320)
    masses[:: 320 // n_masses] = np.arange(1.0, len(masses[:: 320 // n_masses]) + 1)
    n_modes = min(n_masses, 6)
    model = AffineModel({("k",): chain(320)}, scipy.sparse.diags_array(masses), n_modes=n_modes, track=track)
    theta = [[0.5], [2.0]]
    np.testing.assert_allclose(model.frequencies(theta), dense_frequencies(model, theta), rtol=1e-9)
    reduced = model.reduced(0.3, random_state=0)
    np.testing.assert_allclose(reduced.frequencies([[0.8]]), model.frequencies([[0.8]]), rtol=1e-5)


def test_a_mass_that_couples_few_degrees_of_freedom_has_as_many_modes_as_its_rank():
    rigid = np.zeros((300, 2))
    rigid[100:110, 0], rigid[100:110, 1] = 1.0, np.arange(-4.5, 5.0)
    mass = scipy.sparse.csc_array(rigid @ rigid.T)
    model = AffineModel({("k",): chain(300)}, mass, n_modes=2)
    flexibility = rigid.T @ np.linalg.solve(chain(300).toarray(), rigid)
    expected = 1 / np.sqrt(np.linalg.eigvalsh(flexibility)[::-1]) / (2 * np.pi)
    np.testing.assert_allclose(model.frequencies([[1.0]])[0], expected, rtol=1e-9)
    with pytest.raises(ValueError, match="have only 2 modes"):
        AffineModel({("k",): chain(300)}, mass, n_modes=3)


def test_all_modes_of_a_large_model_are_found():
    model = AffineModel({("k",): chain(201)}, scipy.sparse.eye_array(201), n_modes=201)
    expected = np.sin(np.arange(1, 202) * np.pi / 404) / np.pi
    np.testing.assert_allclose(model.frequencies([[1.0]])[0], expected, rtol=1e-9)
    many = AffineModel({("k",): chain(240)}, np.eye(240), n_modes=59, track=True)
    assert np.isfinite(many.frequencies([[1.2]])).all()
