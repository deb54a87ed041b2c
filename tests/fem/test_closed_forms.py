"""Frequencies of structures that have closed forms."""

import numpy as np
import pytest

from skthermo.datasets import make_truss
from skthermo.fem import Bar, Beam, PointMass, Spring, Structure

E, A, DENSITY = 210e9, 0.01, 7850.0
NOMINAL = np.ones((1, 1))


def rod(n_elements, length=3.0, *, lumped=False):
    """A clamped-free rod as a chain of bars along x."""
    nodes = {i: (length * i / n_elements, 0.0) for i in range(n_elements + 1)}
    bars = {f"bar {i}": Bar(i, i + 1, E, A, DENSITY, lumped) for i in range(n_elements)}
    supports = {i: "xy" if i == 0 else "y" for i in nodes}
    return Structure(nodes, bars, supports, {"rod": list(bars)})


@pytest.mark.parametrize(("lumped", "factor"), [(False, 3.0), (True, 2.0)])
def test_one_bar_with_its_own_mass(lumped, factor):
    frequency = rod(1, length=2.0, lumped=lumped).assemble(["rod"], n_modes=1).frequencies(NOMINAL)
    np.testing.assert_allclose(frequency, [[np.sqrt(factor * E / DENSITY) / 2 / (2 * np.pi)]], rtol=1e-12)


def test_two_bar_truss():
    half_span, height, mass = 1.5, 2.0, 800.0
    length = np.hypot(half_span, height)
    structure = Structure(
        {"left": (-half_span, 0), "right": (half_span, 0), "apex": (0, height)},
        {"l": Bar("left", "apex", E, A), "r": Bar("right", "apex", E, A), "m": PointMass("apex", mass)},
        {"left": "xy", "right": "xy"},
        {"bars": ["l", "r"]},
    )
    stiffness = 2 * E * A / length**3 * np.array([half_span**2, height**2])
    frequencies = structure.assemble(["bars"], n_modes=2).frequencies(NOMINAL)
    np.testing.assert_allclose(frequencies[0], np.sqrt(stiffness / mass) / (2 * np.pi), rtol=1e-12)


def test_spring_in_three_dimensions():
    springs = {d: Spring("node", d, k) for d, k in (("x", 1e6), ("y", 4e6), ("z", 9e6))}
    structure = Structure({"node": (0, 0, 0)}, springs | {"m": PointMass("node", 100.0)}, {}, {"soil": ["x", "y", "z"]})
    frequencies = structure.assemble(["soil"], n_modes=3).frequencies(NOMINAL)[0]
    np.testing.assert_allclose(frequencies, np.array([100, 200, 300]) / (2 * np.pi), rtol=1e-12)


def test_tripod_in_three_dimensions():
    """Three bars at 120 degrees: equal stiffness in both horizontal directions."""
    feet = {f"foot {i}": (np.cos(a), np.sin(a), 0.0) for i, a in enumerate(2 * np.pi * np.arange(3) / 3)}
    bars = {f"leg {i}": Bar(foot, "top", E, A) for i, foot in enumerate(feet)}
    members, nodes = bars | {"m": PointMass("top", 100.0)}, feet | {"top": (0.0, 0.0, 2.0)}
    structure = Structure(nodes, members, dict.fromkeys(feet, "xyz"), {"legs": list(bars)})
    unit = E * A / np.sqrt(5) ** 3
    expected = np.sqrt(unit * np.array([1.5, 1.5, 12.0]) / 100) / (2 * np.pi)
    np.testing.assert_allclose(structure.assemble(["legs"], n_modes=3).frequencies(NOMINAL)[0], expected, rtol=1e-12)


@pytest.mark.parametrize(("lumped", "sign"), [(False, 1), (True, -1)])
def test_chain_of_bars_converges_to_the_rod_at_second_order_from_above_or_with_lumped_mass_from_below(lumped, sign):
    length, modes, sizes = 3.0, np.arange(1, 4), [32, 64]
    exact = (2 * modes - 1) / 4 * np.sqrt(E / DENSITY) / length
    chains = [rod(n, length, lumped=lumped).assemble(["rod"], n_modes=3) for n in sizes]
    errors = np.array([sign * (chain.frequencies(NOMINAL)[0] / exact - 1) for chain in chains])
    assert (errors > 0).all()
    np.testing.assert_allclose(np.log2(errors[0] / errors[1]), 2.0, atol=0.02)


def test_truss_has_the_published_frequencies():
    truss = make_truss()
    healthy = [7.48477, 27.500374, 37.842078, 62.614472, 67.170412, 95.411833]
    halved = [6.359491, 23.468491, 34.325975, 59.338728, 66.10077, 92.816677]
    nominal = np.ones((1, 4))
    np.testing.assert_allclose(truss.frequencies(nominal)[0], healthy, rtol=1e-6)
    np.testing.assert_allclose(truss.damaged({"bottom": 0.5}).frequencies(nominal)[0], halved, rtol=1e-6)
    assert truss.parameter_names == ("bottom", "top", "diagonal", "vertical")


@pytest.mark.parametrize("place", [0.0, 2.0])
def test_two_masses_on_springs_in_a_row(place):
    """The second spring joins two nodes; it does not matter whether these are apart or at one place."""
    k, m = np.array([4e6, 9e6]), np.array([100.0, 150.0])
    exact = np.linalg.eigvals(np.array([[k.sum(), -k[1]], [-k[1], k[1]]]) / m[:, np.newaxis])
    members = {"ground": Spring("a", "x", k[0]), "joint": Spring("a", "x", k[1], to="b")}
    members |= {f"mass {node}": PointMass(node, value) for node, value in zip("ab", m, strict=True)}
    structure = Structure({"a": (0, 0), "b": (place, 0)}, members, {"a": "y", "b": "y"}, {"joint": ["joint"]})
    frequencies = structure.assemble(["joint"], n_modes=2).frequencies(NOMINAL)[0]
    np.testing.assert_allclose(frequencies, np.sqrt(np.sort(exact)) / (2 * np.pi), rtol=1e-12)


def test_a_stiff_joint_is_none_and_a_soft_one_a_hinge():
    section = {"E": E, "G": 81e9, "A": A, "I_yy": 1e-5, "I_zz": 1e-5, "J": 2e-5, "density": DENSITY}

    def lowest(*joint, released=()):
        right = "right" if joint else "left"
        nodes = {"wall": (0, 0, 0), "left": (2, 0, 0), "end": (4, 0, 0), right: (2, 0, 0)}
        beams = {
            "first": Beam("wall", "left", **section, release_end=released),
            "second": Beam(right, "end", **section),
        }
        springs = {f"joint {along}": Spring("left", along, k, to="right") for along, k in joint}
        supports = dict.fromkeys(nodes, "z rx ry") | dict.fromkeys(["wall", "end"], "xyz rx ry rz")
        structure = Structure(nodes, beams | springs, supports, {"all": list(beams)})
        return structure.assemble(["all"], n_modes=2).frequencies(NOMINAL)[0]

    held = (("x", 1e14), ("y", 1e14))
    np.testing.assert_allclose(lowest(*held, ("rz", 1e12)), lowest(), rtol=1e-4)
    np.testing.assert_allclose(lowest(*held, ("rz", 1e-3))[0], lowest(released=("rz",))[0], rtol=1e-2)
