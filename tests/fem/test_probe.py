"""Affine terms recovered from programs, and programs that are not affine named for what they do."""

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, probe

N = 12
NAMES = ("E", "A", "rho")


def chain(values):
    """Springs in a row from the ground, as a tridiagonal sparse matrix."""
    values = np.append(values, 0.0)
    return scipy.sparse.diags_array([values[:-1] + values[1:], -values[1:-1], -values[1:-1]], offsets=[0, 1, -1])


FIRST, SECOND = np.repeat([1000.0, 0.0], N // 2), np.repeat([0.0, 3000.0], N // 2)


def affine_program(row):
    E, A, rho = row
    stiffness = chain(E * FIRST + A * SECOND + 1 / 3)
    return stiffness, scipy.sparse.diags_array((0.5 + rho) * np.ones(N))


def counted(program):
    """The program, and the rows that it was asked for."""
    rows = []
    return lambda row: rows.append(row.copy()) or program(row), rows


def test_one_call_for_each_term_and_one_for_each_check():
    program, rows = counted(affine_program)
    model = probe(program, NAMES, n_checks=4, random_state=0)
    assert len(rows) == 1 + 3 + 4
    np.testing.assert_array_equal(rows[:4], np.vstack([np.ones(3), 1 + np.eye(3)]))
    assert model.parameter_names == NAMES
    assert set(model.groups) == {"E", "A"}


PROBED = probe(affine_program, NAMES, random_state=0)


@settings(max_examples=20)
@given(theta=st.lists(st.floats(0.2, 5), min_size=3, max_size=3))
def test_the_models_matrices_are_the_programs(theta):
    for ours, theirs in zip(PROBED.matrices(theta), affine_program(theta), strict=True):
        theirs = theirs.toarray()
        np.testing.assert_allclose(ours.toarray(), theirs, rtol=1e-12, atol=1e-12 * theirs.max())


def test_sparse_stays_sparse_and_dense_gives_the_same():
    assert all(matrix.nnz <= 3 * N for matrix in PROBED.matrices(np.ones(3)))
    dense = probe(lambda row: tuple(m.toarray() for m in affine_program(row)), NAMES, random_state=0)
    theta = np.random.default_rng(0).uniform(0.5, 2, (4, 3))
    np.testing.assert_array_equal(dense.frequencies(theta), PROBED.frequencies(theta))


def test_rounding_makes_no_term():
    """0.1 E + 0.2 A + 0.7 E is not exact in binary, and yet there is no constant part."""
    model = probe(
        lambda row: (chain(0.1 * row[0] * FIRST + 0.2 * row[1] * SECOND + 0.7 * row[0] * FIRST), np.eye(N)),
        ["E", "A"],
        random_state=0,
    )
    halved = model.damaged({"E": 0.5, "A": 0.5}).frequencies([[1.0, 1.0]])
    np.testing.assert_allclose(halved, model.frequencies([[0.5, 0.5]]), rtol=1e-13)


def test_a_models_own_matrices_give_the_model_back():
    truss = make_truss()
    model = probe(truss.matrices, truss.parameter_names, track=True, random_state=0)
    theta = np.random.default_rng(0).uniform(0.7, 1.3, (10, 4))
    found = np.sort(model.frequencies(theta))
    np.testing.assert_allclose(found, truss.frequencies(theta), rtol=1e-10)
    assert model.track


def test_a_program_may_reuse_the_arrays_it_returns():
    stiffness = np.zeros((2, 2))

    def program(row):
        stiffness[:] = [[row[0] + row[1], -row[1]], [-row[1], row[1]]]
        row[:] = 0
        return stiffness, np.eye(2)

    model = probe(program, ["a", "b"], n_modes=2, random_state=0)
    expected = AffineModel({("a",): [[1.0, 0], [0, 0]], ("b",): [[1.0, -1], [-1, 1]]}, np.eye(2), n_modes=2)
    np.testing.assert_allclose(model.frequencies([[2.0, 3.0]]), expected.frequencies([[2.0, 3.0]]), rtol=1e-14)


@pytest.mark.parametrize(
    ("program", "names", "message"),
    [
        (lambda E, h: (chain(E * FIRST + h**3 * SECOND + 5), np.eye(N)), "Eh", "'h': its stiffness"),
        (lambda E, h: (chain(E * FIRST + SECOND / h + 5), np.eye(N)), "Eh", "'h': its stiffness"),
        (lambda E, b, h: (chain(E * FIRST + b * h * SECOND), E * np.eye(N)), "Ebh", "'b' and 'h' together"),
        (lambda E, r: (chain(E * FIRST + SECOND), r**2 * np.eye(N)), "Er", "not affine in 'r': its mass differs"),
        (
            lambda a, b, c: (
                chain(3000 + 100 * (a + b + c) + 1000 * (a - 1) * (b - 1) * (c - 1) + 0 * FIRST),
                np.eye(N),
            ),
            "abc",
            r"'c' acts together with two or more of \['a', 'b'\]",
        ),
    ],
)
def test_what_is_not_affine_is_named(program, names, message):
    program, rows = counted(lambda row, program=program: program(*row))
    with pytest.raises(ValueError, match=message):
        probe(program, list(names), n_checks=1, random_state=0)
    assert len(rows) <= 1 + len(names) + 1 + 2 * len(names)


def test_without_checks_the_program_is_believed():
    model = probe(lambda row: (chain(row[0] ** 2 * (FIRST + SECOND) + 1e4), np.eye(N)), ["h"], n_checks=0)
    assert model.parameter_names == ("h",)


def failing(row):
    if row[1] > 1.9:
        raise ZeroDivisionError("no such section")
    return affine_program(row)


@pytest.mark.parametrize(
    ("program", "arguments", "error", "message"),
    [
        (failing, {}, RuntimeError, r"failed at theta = {'E': 1.0, 'A': 2.0, 'rho': 1.0}: ZeroDivisionError: no such"),
        (lambda row: np.eye(N), {}, ValueError, "returned a ndarray at theta = {'E': 1.0.*expected .stiffness, mass"),
        (lambda row: (np.eye(2), np.eye(3)), {}, ValueError, r"mass .*shape \(3, 3\); expected \(2, 2\)"),
        (lambda row: (np.eye(1 + int(row[0])),) * 2, {}, ValueError, r"shape \(3, 3\); expected \(2, 2\).*'E': 2.0"),
        (lambda row: (np.diag(row) / (row[0] < 2), np.eye(3)), {}, ValueError, "not finite, at theta = {'E': 2.0"),
        (lambda row: (chain(row[0] * FIRST + row[1] * SECOND), np.eye(N)), {}, ValueError, "'rho' changes neither"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_what_is_wrong_is_named(program, arguments, error, message):
    with pytest.raises(error, match=message):
        probe(program, NAMES, random_state=0, **arguments)
