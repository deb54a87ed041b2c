"""Polynomials for the frequencies of one structure near the parameters that its weather gives."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, FrequencySurface

TRUSS = make_truss()
TOL = 4e-6


def weather_rows(seed, n_rows=400, spread=0.08):
    """Rows of theta that follow two temperatures, with a knee in frost."""
    random = np.random.default_rng(seed)
    T = random.normal(8, 9, n_rows)
    inside = T + random.normal(0, 1.5, n_rows)
    frost = np.clip(-T, 0, None)
    slopes = spread / 40 * random.uniform(-1, 1, (3, 4))
    return np.exp(np.c_[T - 8, inside - 8, frost] @ slopes)


@settings(max_examples=4)
@given(st.integers(0, 999), st.sampled_from([{}, {"bottom": 0.2}, {"diagonal": 0.1, "top": 0.3}]))
def test_rows_that_are_served_have_the_exact_frequencies(seed, damage):
    model = TRUSS.damaged(damage)
    theta = weather_rows(seed)
    surface = FrequencySurface(model.frequencies, theta, tol=TOL)
    assert surface.error_ <= TOL
    assert surface.share_ > 0.9
    later = np.vstack([theta, weather_rows(seed, 200) * np.random.default_rng(seed).uniform(0.99, 1.01, (200, 4))])
    frequencies, served = surface.frequencies(later)
    exact = model.frequencies(later)
    assert served[:400].mean() > 0.9
    assert np.abs(frequencies[served] / exact[served] - 1).max() < 2 * TOL
    assert np.isnan(frequencies[~served]).all()


def test_parameters_and_modes_may_come_in_any_order():
    theta, parameters, modes = weather_rows(0), [2, 0, 3, 1], [4, 0, 5, 1, 2, 3]
    frequencies, served = FrequencySurface(TRUSS.frequencies, theta).frequencies(theta)
    back = np.argsort(parameters)
    other = FrequencySurface(lambda rows: TRUSS.frequencies(rows[:, back])[:, modes], theta[:, parameters])
    turned, served_too = other.frequencies(theta[:, parameters])
    both = served & served_too
    assert both.mean() > 0.9
    np.testing.assert_allclose(turned[both], frequencies[both][:, modes], rtol=2 * TOL)


def crossing(coupling, is_tracked):
    """A model of which two modes cross, or nearly so, at equal stiffness, and rows on both sides."""
    coupled = np.diag([0, 0, 9.0])
    coupled[0, 1] = coupled[1, 0] = coupling
    terms = {"a": np.diag([1.0, 0, 0]), "b": np.diag([0, 1.001, 0]), (): coupled}
    a = np.exp(np.random.default_rng(0).uniform(-0.2, 0.2, 600))
    return AffineModel(terms, np.eye(3), n_modes=3, track=is_tracked), np.c_[a, np.ones(600)]


@pytest.mark.parametrize(("coupling", "is_tracked"), [(0.0, True), (1e-4, False), (2e-2, True), (4e-2, False)])
def test_rows_on_both_sides_of_modes_that_cross_or_repel_each_other_are_served(coupling, is_tracked):
    model, theta = crossing(coupling, is_tracked)
    surface = FrequencySurface(model.frequencies, theta)
    frequencies, served = surface.frequencies(theta)
    exact = model.frequencies(theta)
    gap = np.abs(exact[:, 0] / exact[:, 1] - 1)
    assert surface.error_ <= TOL
    assert not served[gap < 0.0099].any()
    assert served[gap > 0.0101].mean() > 0.9
    assert np.abs(frequencies[served] / exact[served] - 1).max() < 2 * TOL


@pytest.mark.parametrize("share", [0.7, 0.9])
def test_modes_whose_columns_change_places_at_some_distance_are_not_served_there(share):
    model, theta = crossing(4e-2, False)
    border = np.quantile(theta[:, 0], share)  # where the columns change places, 4 % apart and more

    def solve(rows):
        modes = np.where(rows[:, :1] > border, [1, 0, 2], [0, 1, 2])
        return np.take_along_axis(model.frequencies(rows), modes, axis=1)

    frequencies, served = FrequencySurface(solve, theta).frequencies(theta)
    assert served.mean() > 0.5
    assert np.abs(frequencies[served] / solve(theta)[served] - 1).max() < 2 * TOL


def test_modes_whose_columns_are_not_known_have_no_surface():
    model, theta = crossing(5e-3, True)  # those of the nominal model are half one mode and half the other
    with pytest.raises(RuntimeError, match="check points"):
        FrequencySurface(model.frequencies, theta)


def test_modes_that_are_always_close_and_what_is_no_polynomial_have_no_surface():
    solved = []
    with pytest.raises(RuntimeError, match="check points"):
        FrequencySurface(lambda rows: solved.append(rows) or np.sqrt(rows[:, :1] * [1.0, 1.001]), weather_rows(0))
    assert sum(map(len, solved)) == 100
    with pytest.raises(RuntimeError, match="check points"):
        FrequencySurface(lambda theta: 1 + np.abs(theta[:, :1] - 1), weather_rows(0), highest_degree=4)


def test_rows_elsewhere_and_rows_with_gaps_are_not_served():
    theta, surface = weather_rows(0), FrequencySurface(TRUSS.frequencies, weather_rows(0))
    assert not surface.frequencies(theta[:5] * 1.5)[1].any()
    few = np.vstack([theta, np.full((1, 4), np.nan)])
    np.testing.assert_array_equal(
        FrequencySurface(TRUSS.frequencies, few).frequencies(theta)[0], surface.frequencies(theta)[0]
    )
    lowest = np.c_[theta.min(axis=0), np.median(theta, axis=0)]
    solved = []
    bounded = FrequencySurface(lambda rows: solved.append(rows) or TRUSS.frequencies(rows), theta, bounds=lowest)
    inside = ((lowest[:, 0] <= theta) & (theta <= lowest[:, 1])).all(axis=1)
    assert not bounded.frequencies(theta)[1][~inside].any()
    assert (np.vstack(solved) >= lowest[:, 0]).all()
    assert (np.vstack(solved) <= lowest[:, 1]).all()
    assert sum(map(len, solved)) == bounded.n_solves_


def test_the_same_rows_give_the_same_bits():
    theta = weather_rows(1)
    one, other = (FrequencySurface(TRUSS.frequencies, theta) for _ in range(2))
    np.testing.assert_array_equal(one.frequencies(theta)[0], pickle.loads(pickle.dumps(other)).frequencies(theta)[0])


def test_more_solves_allow_a_higher_degree_and_with_too_low_a_one_nothing_is_solved():
    degrees = [FrequencySurface.degree_within(n, 4) for n in (0, 169, 170, 240, 352, 520, 10_000)]
    assert degrees == [2, 2, 3, 4, 5, 6, 8]
    with pytest.raises(RuntimeError, match="degree 2"):
        FrequencySurface(lambda rows: pytest.fail("solved"), weather_rows(0), highest_degree=2)
