"""Projections on cones, with SciPy's non-negative least squares as an oracle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from skthermo.detection._cone import Cones, Detectability, JoinedTests, Tail


def directions_of(random, n_dimensions, n_directions, kind):
    found = random.standard_normal((n_dimensions, n_directions))
    if kind == "collinear" and n_directions > 2:
        found[:, 1], found[:, 2] = 2 * found[:, 0], found[:, 0] + 1e-4 * found[:, 2]
    if kind == "zero":
        found[:, 0] = 0.0
    return found


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10_000),
    st.integers(1, 7),
    st.integers(1, 9),
    st.sampled_from(["random", "collinear", "zero"]),
)
def test_lengths_are_those_of_non_negative_least_squares(seed, n_dimensions, n_directions, kind):
    random = np.random.RandomState(seed)
    several = np.stack([directions_of(random, n_dimensions, n_directions, kind) for _ in range(3)])
    rows, which = random.standard_normal((30, n_dimensions)), random.randint(3, size=30)
    along = np.einsum("ij,ijk->ik", rows, several[which])
    amounts, lengths = Cones.of(several).project(along, which)
    assert (amounts >= 0).all()
    for row, cone, amount, length in zip(rows, which, amounts, lengths, strict=True):
        left = nnls(several[cone], row)[1]
        assert length**2 == pytest.approx(row @ row - left**2, abs=1e-6)
        explained = several[cone] @ amount
        assert (
            several[cone].T @ (row - explained) == pytest.approx(0, abs=1e-4 * np.linalg.norm(several[cone]))
            or (several[cone].T @ (row - explained) <= 1e-4 * np.linalg.norm(several[cone])).all()
        )  # Moreau: what is left makes no acute angle with any direction


def test_a_row_does_not_depend_on_the_others():
    random = np.random.RandomState(0)
    white, rows = random.standard_normal((6, 4)), random.standard_normal((50, 6))
    cones, all_alike = Cones.of(white), np.zeros(50, dtype=np.intp)
    together = cones.project(rows @ white, all_alike)[1]
    alone = [cones.project(row[np.newaxis] @ white, all_alike[:1])[1][0] for row in rows]
    assert together == pytest.approx(alone, abs=1e-12)


def test_each_test_has_its_share_of_the_false_alarms():
    random = np.random.RandomState(0)
    cone, omnibus = np.sqrt(random.chisquare(2, 400_000)), np.sqrt(random.chisquare(8, 400_000))
    tests = JoinedTests.of(cone, omnibus, 0.2)
    joined = tests(cone, omnibus)
    threshold = np.quantile(joined, 0.98)
    by_cone, by_omnibus = (cone > threshold).mean(), (tests(np.zeros_like(cone), omnibus) > threshold).mean()
    assert by_cone == pytest.approx(0.016, rel=0.15)
    assert by_omnibus == pytest.approx(0.004, rel=0.4)
    assert tests(cone[:5], omnibus[:5] + 3) == pytest.approx(np.maximum(tests(cone[:5], omnibus[:5] + 3), joined[:5]))
    assert JoinedTests.of(cone, omnibus, 0.0)(cone, omnibus) is cone
    assert JoinedTests.of(cone, omnibus, 1.0)(cone, omnibus) is omnibus


def test_one_direction_is_found_as_a_one_sided_normal_test_says():
    from scipy.stats import norm

    only = JoinedTests(Tail(0.0, 1.0), Tail(0.0, 1.0), 0.0)
    found = Detectability(only, np.array([[20.0], [0.0]]), ["one"], threshold=2.0, largest=1.0)
    losses = np.array([0.0, 0.05, 0.1, 0.2])
    assert found.pod(losses)["one"].to_numpy() == pytest.approx(norm.cdf(20 * losses - 2), abs=0.03)
    assert found.smallest(0.9)["one"] == pytest.approx((2 + norm.ppf(0.9)) / 20, abs=0.005)
    assert Detectability(only, np.array([[0.1], [0.0]]), ["one"], 2.0, 1.0).smallest(0.9)["one"] == np.inf
    given = Detectability(only, np.array([[0.1], [0.0]]), ["one"], 2.0, np.inf)
    assert given.smallest(0.9)["one"] == pytest.approx((2 + norm.ppf(0.9)) / 0.1, rel=0.02)
