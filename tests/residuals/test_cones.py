"""Projections on cones, with SciPy's bounded least squares as an oracle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from skthermo.residuals.cones import project_on_cones


def directions_of(random, n_dimensions, n_directions, kind):
    found = random.standard_normal((n_dimensions, n_directions))
    if kind == "collinear" and n_directions > 2:
        found[:, 1], found[:, 2] = 2 * found[:, 0], found[:, 0] + 1e-4 * found[:, 2]
    if kind == "zero":
        found[:, 0] = 0.0
    return found


@settings(max_examples=60)
@given(
    st.integers(0, 10_000),
    st.integers(1, 7),
    st.integers(1, 9) | st.sampled_from([65, 140]),
    st.sampled_from(["random", "collinear", "zero"]),
)
def test_lengths_are_those_of_non_negative_least_squares(seed, n_dimensions, n_directions, kind):
    random = np.random.RandomState(seed)
    several = np.stack([directions_of(random, n_dimensions, n_directions, kind) for _ in range(3)])
    rows, which = random.standard_normal((10, n_dimensions)), random.randint(3, size=10)
    along = np.einsum("ij,ijk->ik", rows, several[which])
    amounts, lengths = project_on_cones(several.swapaxes(1, 2) @ several, along, which)
    assert (amounts >= 0).all()
    for row, cone, amount, length in zip(rows, which, amounts, lengths, strict=True):
        left = 2 * lsq_linear(several[cone], row, (0, np.inf), method="bvls").cost
        assert length**2 == pytest.approx(row @ row - left, abs=1e-6)
        explained = several[cone] @ amount
        acute = several[cone].T @ (row - explained) > 1e-4 * np.linalg.norm(several[cone])
        assert not acute.any()  # Moreau: what is left makes no acute angle with any direction


def test_a_row_does_not_depend_on_the_others():
    random = np.random.RandomState(0)
    white, rows = random.standard_normal((6, 4)), random.standard_normal((50, 6))
    products, all_alike = (white.T @ white)[np.newaxis], np.zeros(50, dtype=np.intp)
    together = project_on_cones(products, rows @ white, all_alike)[1]
    alone = [project_on_cones(products, row[np.newaxis] @ white, all_alike[:1])[1][0] for row in rows]
    assert together == pytest.approx(alone, abs=1e-12)


def test_rows_that_take_too_many_steps_are_solved_alone(monkeypatch):
    random = np.random.default_rng(1)
    white, rows = random.standard_normal((6, 4)), random.standard_normal((50, 6))
    problem = (white.T @ white)[np.newaxis], rows @ white, np.zeros(50, dtype=np.intp)
    amounts, lengths = project_on_cones(*problem)
    monkeypatch.setattr("skthermo.residuals.cones.MOST_STEPS", 0)
    for one, expected in zip(project_on_cones(*problem), (amounts, lengths), strict=True):
        np.testing.assert_allclose(one, expected, atol=1e-8)
