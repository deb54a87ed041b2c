"""Modes that cross, and the criterion that tells them apart."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.fem import AffineModel, Beam, Structure, mac
from skthermo.fem.modal import may_be_missed, pair_modes, repeated_modes


def crossing(**options):
    """Three masses on springs of their own: mode j has frequency j times the root of its parameter."""
    keys = ("a", "b", "c", "d")
    terms = {(key,): np.diag(np.eye(4)[j] * (2 * np.pi * (j + 1)) ** 2) for j, key in enumerate(keys)}
    return AffineModel(terms, np.eye(4), n_modes=3, **options)


def test_sorted_columns_are_ranks_and_tracked_columns_are_modes():
    theta, tracked = [[9.0, 1.0, 1.0, 1.0], [1.0, 16.0, 1.0, 0.01]], crossing(track=True)
    np.testing.assert_allclose(crossing().frequencies(theta), [[2, 3, 3], [0.4, 1, 3]], atol=1e-12)
    np.testing.assert_allclose(tracked.frequencies(theta), [[3, 2, 3], [1, 8, 3]], atol=1e-12)
    slopes = np.hstack([np.diag([0.5 / np.sqrt(9.5), 1.0, 1.5]), np.zeros((3, 1))])
    np.testing.assert_allclose(tracked.jacobian(np.array([[9.5, 1.0, 1.0, 1.0]]))[0], slopes, atol=1e-12)
    nominal = tracked.modes(np.ones((1, 4)))[1][0]
    for shapes in tracked.modes(np.random.default_rng(0).uniform(0.1, 9, (20, 4)))[1]:
        np.testing.assert_allclose(mac(nominal, shapes), np.eye(3), atol=1e-12)
    damaged = tracked.damaged({"c": 1 - 1 / 36})  # columns stay those of the healthy model
    np.testing.assert_allclose(damaged.frequencies(np.ones((1, 4))), [[1, 2, 0.5]], atol=1e-12)


def test_modes_that_veer_are_followed_through_a_weak_coupling():
    """Two coupled oscillators swap shapes; the tracked frequency stays continuous to the coupling."""
    coupling = 0.2 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    model = AffineModel(
        {(): np.diag([0.0, 40.0]) + coupling, ("k",): np.diag([30.0, 0.0])}, np.eye(2), n_modes=2, track=True
    )
    theta = np.linspace(1, 2, 41)[:, np.newaxis]
    first = model.frequencies(theta)[:, 0]
    assert first[-1] > model.frequencies(theta)[-1, 1]
    np.testing.assert_allclose(first, np.sqrt(30 * theta[:, 0]) / (2 * np.pi), rtol=0.02)


def test_many_intruders_do_not_push_out_a_tracked_mode():
    """Twelve local modes fall below the one that is asked for."""
    stiffness = (2 * np.pi * np.arange(1.0, 14.0)) ** 2
    local = np.arange(13) > 0
    terms = {("own",): np.diag(stiffness * ~local), ("local",): np.diag(stiffness * local)}
    model = AffineModel(terms, np.eye(13), n_modes=2, track=True)
    np.testing.assert_allclose(model.frequencies([[400.0, 1.0], [1.0, 0.001]]), [[20, 2], [1, 2 * 0.001**0.5]])
    assert np.diagonal(model.nominal_mac(model.modes([[400.0, 1.0]])[1])[0]).min() > 0.99


@pytest.mark.parametrize("is_mass_varied", [False, True])
def test_following_a_mode_among_few_candidates_finds_the_same_as_among_all_modes(is_mass_varied):
    """A mode that rises through all others and mixes with each of them; five of the eight are examined first. With
    another mass, the MACs of a reference with all modes may add up to more than 1."""
    random = np.random.default_rng(0)
    shape = np.append(1, np.zeros(7) if is_mass_varied else 0.2 * random.standard_normal(7))
    terms = {("own",): np.outer(shape, shape), ("others",): np.diag(2 * np.arange(8.0))}
    roots = random.standard_normal((2, 8, 8))
    mass = {(name,): root @ root.T for name, root in zip(("near", "far"), roots, strict=True)}
    box = [[0.5, 0.8, 0.4, 0.4], [20, 1.25, 2.5, 2.5]] if is_mass_varied else [[0.5, 0.8], [20, 1.25]]
    theta, mass = random.uniform(*box, (500, len(box[0]))), mass if is_mass_varied else np.eye(8)
    frequencies, shapes = AffineModel(terms, mass, n_modes=8).modes(theta)
    followed = AffineModel(terms, mass, n_modes=1, track=True)
    macs = followed.nominal_mac(shapes)[:, 0]
    closest = macs.argmax(axis=1)
    assert np.count_nonzero(closest >= 5) > 100 or is_mass_varied
    assert (macs.sum(axis=1) > 1.2).any() == is_mass_varied
    expected = np.take_along_axis(frequencies, closest[:, np.newaxis], axis=1)
    np.testing.assert_allclose(followed.frequencies(theta), expected, rtol=1e-9)


@pytest.mark.parametrize("repeated", [np.eye(3, dtype=bool), repeated_modes(np.array([1.0, 4.0, 4.0]))])
def test_a_single_mode_beyond_the_candidates_is_missed_if_it_has_a_higher_mac_than_one_assigned(repeated):
    """Four orthogonal modes, three of them candidates: what is left of the MACs is the fourth mode's."""
    bases = np.linalg.qr(np.random.default_rng(0).standard_normal((2000, 4, 4)))[0]
    mac = bases[:, :3] ** 2
    order = pair_modes(mac[:, :, :3], repeated)
    assigned = np.take_along_axis(repeated @ mac, order[:, :, np.newaxis], axis=2)[:, :, 0]
    missed = ((repeated @ mac)[:, :, 3] > assigned).any(axis=1)
    assert 200 < missed.sum() < 1800
    np.testing.assert_array_equal(may_be_missed(mac[:, :, :3], order, repeated), missed)


def square_mast(**options):
    """A cantilever as stiff one way as the other: its modes come in pairs."""
    section = {"E": 210e9, "G": 81e9, "A": 0.02, "I_yy": 1e-5, "I_zz": 1e-5, "J": 2e-5, "density": 7850.0}
    beams = {i: Beam(i, i + 1, **section) for i in range(4)}
    mast = Structure({i: (0, 0, 1.0 * i) for i in range(5)}, beams, {0: "xyz rx ry rz"}, {"mast": list(beams)})
    return mast.assemble({"one way": ("I_yy", "mast"), "other": ("I_zz", "mast")}, n_modes=4, track=True, **options)


def test_modes_of_a_repeated_frequency_are_followed_together():
    """Shapes of a pair are arbitrary at the nominal state, so within the pair the lower comes first."""
    mast = square_mast()
    nominal = mast.frequencies([[1.0, 1.0]])[0]
    np.testing.assert_allclose(nominal[[0, 2]], nominal[[1, 3]], rtol=1e-9)
    for theta in ([[1.2, 0.9]], [[0.9, 1.2]]):
        expected = nominal * np.sqrt([0.9, 1.2, 0.9, 1.2])
        np.testing.assert_allclose(mast.frequencies(theta)[0], expected, rtol=1e-9)


def test_a_pair_that_swaps_with_another_mode_is_followed_as_a_pair():
    repeated = np.array([[True, False, False], [False, True, True], [False, True, True]])
    macs = np.array([[[0.02, 0.95, 0.03], [0.48, 0.02, 0.5], [0.5, 0.03, 0.47]]])
    np.testing.assert_array_equal(pair_modes(macs, repeated), [[1, 0, 2]])


def test_modes_are_followed_where_mass_changes():
    """Three masses on springs of their own, the first nine times as heavy: its mode is the lowest still."""
    springs = {("k",): np.diag((2 * np.pi * np.array([1.0, 2.0, 3.0])) ** 2)}
    masses = {(name,): np.diag(row) for name, row in zip("abc", np.eye(3), strict=True)}
    model = AffineModel(springs, masses, n_modes=3, track=True, parameter_names=["k", *"abc"])
    theta = np.array([[1.0, 9.0, 1.0, 1.0], [1.0, 1.0, 16.0, 0.04], [1.0, 0.01, 1.0, 25.0]])
    np.testing.assert_allclose(model.frequencies(theta), [1, 2, 3] / np.sqrt(theta[:, 1:]), rtol=1e-12)
    np.testing.assert_allclose(
        model.nominal_mac(model.modes(theta)[1]), np.broadcast_to(np.eye(3), (3, 3, 3)), atol=1e-12
    )


def test_the_sum_of_the_macs_is_the_highest_that_distinct_candidates_have():
    macs = np.random.default_rng(0).uniform(size=(200, 3, 4))
    order = pair_modes(macs, np.eye(macs.shape[1], dtype=bool))
    found = np.take_along_axis(macs, order[:, :, np.newaxis], axis=2).sum(axis=(1, 2))
    choices = [macs[:, range(3), choice].sum(axis=1) for choice in permutations(range(4), 3)]
    np.testing.assert_allclose(found, np.max(choices, axis=0), rtol=1e-12)
    assert (np.diff(np.sort(order, axis=1), axis=1) > 0).all()


shapes = st.integers(0, 2**31).map(lambda seed: np.random.default_rng(seed).standard_normal((5, 3, 2)) @ [1, 1j])


@settings(max_examples=25)
@given(shapes, st.complex_numbers(min_magnitude=0.1, max_magnitude=10))
def test_mac_ignores_scale_and_phase(phi, scale):
    np.testing.assert_allclose(np.diag(mac(phi, scale * phi)), 1, rtol=1e-10)
    values = mac(phi, phi)
    assert ((values >= 0) & (values <= 1 + 1e-12)).all()
    np.testing.assert_allclose(values, values.T, rtol=1e-10)
