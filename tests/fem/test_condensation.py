"""Lowest modes by iterated condensation: as LAPACK finds them, with a certificate that no mode is missed."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ortho_group

from skthermo.fem._terms import DenseTerms
from skthermo.fem.modal import CondensationSolver, batch_solver, dense_solver
from skthermo.fem.modal._condensation import Ritz, certificate
from tests.fem.frames import FRAME, portal

N, N_MODES, TOL = 60, 5, 2e-7
NOMINAL = np.ones((1, 3))
ROTATION = ortho_group.rvs(N, random_state=1)


class Recorder:
    """LAPACK, with the number of rows that were left to it."""

    def __init__(self, lapack):
        self.lapack, self.n_rows = lapack, 0

    def eigenvalues(self, theta, n_modes):
        self.n_rows += len(theta)
        return self.lapack.eigenvalues(theta, n_modes)

    def modes(self, theta, n_modes):
        self.n_rows += len(theta)
        return self.lapack.modes(theta, n_modes)


def recorded(matrices, mass):
    stiffness = DenseTerms(np.array(matrices), np.eye(3, dtype=int))
    heavy = DenseTerms(mass[np.newaxis], np.zeros((1, 3), dtype=int))
    lapack = Recorder(dense_solver(stiffness, heavy, NOMINAL))
    solver = batch_solver(stiffness, heavy, NOMINAL, lapack, TOL)
    assert isinstance(solver, CondensationSolver)
    return solver, lapack


def solver_of(matrices, mass):
    return recorded(matrices, mass)[0]


def matrices_of(seed, mass_rank=N):
    """Three random stiffness terms whose sum has well spread eigenvalues, and a mass."""
    random = np.random.default_rng(seed)
    factors = random.standard_normal((3, N, N))
    terms = factors @ factors.swapaxes(1, 2)
    root = scipy.linalg.cholesky(terms.sum(axis=0), lower=True)
    spread = np.diag(np.cumsum(random.uniform(0.2, 1.0, N))) @ scipy.linalg.inv(root)
    terms = ROTATION @ (spread @ terms @ spread.T) @ ROTATION.T
    massive = np.zeros(N)
    massive[:mass_rank] = 1.0
    return terms, ROTATION @ np.diag(massive) @ ROTATION.T


def lowest(terms, mass, theta, n_modes=N_MODES):
    """By LAPACK, from the flexibility: 1 / lambda are the highest eigenvalues of (M, K)."""
    stiffness = np.tensordot(theta, terms, axes=1)
    return 1 / scipy.linalg.eigh(mass, stiffness, eigvals_only=True)[::-1][:n_modes]


@settings(max_examples=40)
@given(
    seed=st.integers(0, 5),
    theta=st.lists(st.floats(0.02, 50.0) | st.floats(0.7, 1.3), min_size=3, max_size=3),
    rank=st.sampled_from([N, 40, 9]),
)
def test_eigenvalues_are_those_of_lapack_within_the_tolerance_and_not_below(seed, theta, rank):
    terms, mass = matrices_of(seed, rank)
    solver = solver_of(terms, mass)
    expected = lowest(terms, mass, theta)
    row = np.array([theta])
    error = solver.eigenvalues(row, N_MODES)[0] / expected - 1
    assert -1e-11 < error.min() <= error.max() < TOL
    np.testing.assert_allclose(solver.modes(row, N_MODES)[0][0], expected, rtol=1e-11)


def test_most_rows_of_a_box_are_certified_and_shapes_solve_the_eigenproblem():
    terms, mass = matrices_of(0)
    (solver, lapack), theta = recorded(terms, mass), np.random.default_rng(2).uniform(0.7, 1.3, (50, 3))
    eigenvalues, shapes = solver.modes(theta, N_MODES)
    assert lapack.n_rows < 5
    for row, values, phi in zip(theta, eigenvalues, shapes, strict=True):
        stiffness = np.tensordot(row, terms, axes=1)
        np.testing.assert_allclose(phi.T @ mass @ phi, np.eye(N_MODES), atol=1e-10)
        residual = stiffness @ phi - mass @ phi * values
        assert np.abs(residual).max() < 1e-4 * np.abs(stiffness @ phi).max()


def test_a_beam_on_an_elastic_foundation_has_its_closed_form():
    # m w'' + EI w'''' + k w = 0 between pinned ends: lambda_j = (EI (j pi / L)^4 + k) / m, in a turned sine basis
    bending = np.arange(1, N + 1) ** 4.0
    terms = [ROTATION @ np.diag(diagonal) @ ROTATION.T for diagonal in (bending, np.full(N, 7.0), 0.1 * bending)]
    (solver, lapack), theta = recorded(terms, np.eye(N)), np.array([[1.2, 0.8, 0.9], [0.75, 1.3, 1.1]])
    closed = np.array([(a + 0.1 * c) * bending[:N_MODES] + 7.0 * b for a, b, c in theta])
    np.testing.assert_allclose(solver.eigenvalues(theta, N_MODES), closed, rtol=1e-9)
    assert lapack.n_rows == 0


def test_repeated_eigenvalues_of_a_symmetric_structure_are_all_found():
    half, _ = matrices_of(3)
    twin = [ROTATION @ scipy.linalg.block_diag(t[:30, :30], t[:30, :30]) @ ROTATION.T for t in half]
    mass, theta = np.eye(N), np.array([[0.8, 1.2, 1.1], [1.0, 1.0, 1.0]])
    solver = solver_of(twin, mass)
    found, shapes = solver.modes(theta, 6)
    np.testing.assert_allclose(found, [lowest(twin, mass, row, 6) for row in theta], rtol=1e-11)
    np.testing.assert_allclose(found[:, ::2], found[:, 1::2], rtol=1e-11)
    np.testing.assert_allclose(shapes.swapaxes(1, 2) @ shapes, [np.eye(6)] * 2, atol=1e-10)


@pytest.mark.parametrize("missed", range(N_MODES))
def test_the_certificate_finds_a_missed_mode(missed):
    mu, m = 1 / np.arange(1.0, N + 1) ** 2, 9
    turn, _ = np.linalg.qr(np.eye(N) + 0.002 * np.random.default_rng(4).standard_normal((N, N)))
    # exact modes of K = turn diag(1) turn' and M = diag(mu), scaled; the certificate sees residuals of zero
    stiffness = turn @ turn.T
    eigenvalues, vectors = scipy.linalg.eigh(stiffness, np.diag(mu))
    for columns, expected in ((range(m), True), ([i for i in range(m + 1) if i != missed], False)):
        x, lam = vectors[:, columns].T[np.newaxis], eigenvalues[np.newaxis, columns]
        ritz = Ritz.with_residuals(lam, x, x @ stiffness, mu)
        assert np.abs(ritz.residuals).max() < 1e-10
        assert certificate(ritz, mu, np.array([0.99]), m, N_MODES, TOL)[0] == expected


def test_a_stiffness_that_is_not_positive_definite_gives_nan_and_changes_no_other_row():
    terms, mass = matrices_of(1)
    terms = np.array([terms[0] + terms[2], terms[1], -0.3 * terms[2]])
    solver = solver_of(terms, mass)
    theta = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 90.0], [0.9, 1.1, 1.0]])
    moved = np.where(theta > 50, 1.05, theta)
    for solve in (solver.eigenvalues, lambda rows, n: solver.modes(rows, n)[0]):
        eigenvalues, others = solve(theta, N_MODES), solve(moved, N_MODES)
        np.testing.assert_array_equal(np.isnan(eigenvalues).any(axis=1), [False, True, False])
        np.testing.assert_array_equal(eigenvalues[[0, 2]], others[[0, 2]])


def test_small_or_varying_matrices_are_left_to_lapack():
    terms, mass = matrices_of(0)
    stiffness = DenseTerms(terms, np.eye(3, dtype=int))
    heavy = DenseTerms(mass[np.newaxis], np.ones((1, 3), dtype=int))
    lapack = dense_solver(stiffness, heavy, NOMINAL)
    assert batch_solver(stiffness, heavy, NOMINAL, lapack, TOL) is lapack
    few = np.eye(N, 20)
    small = stiffness.projected(few), DenseTerms((few.T @ mass @ few)[np.newaxis], np.zeros((1, 3), dtype=int))
    lapack = dense_solver(*small, NOMINAL)
    assert batch_solver(*small, NOMINAL, lapack, TOL) is lapack


@pytest.fixture(scope="module", params=[False, True], ids=["sorted", "tracked"])
def reduced(request):
    """A frame whose mass is constant."""
    frame = portal(track=True) if request.param else FRAME
    return frame.with_parameters(["columns", "beams", "soil"]).reduced(0.3, tol=1e-7, random_state=0)


@pytest.mark.one_case
@pytest.mark.parametrize("severity", [0.95, -2.0])
def test_a_severely_damaged_model_is_solved_around_its_own_nominal_state(reduced, severity):
    damaged = reduced.damaged({"soil": severity})
    theta = np.random.default_rng(8).uniform(0.7, 1.3, (20, 3))
    expected = damaged.full.frequencies(theta)
    np.testing.assert_allclose(damaged.frequencies(theta), expected, rtol=1e-7)
