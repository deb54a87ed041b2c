"""Beams against closed forms, laws and an independent program."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skthermo.fem import Beam, PointMass, Spring, Structure

SECTION = {"E": 210e9, "G": 81e9, "A": 0.02, "I_yy": 4e-5, "I_zz": 1e-5, "J": 3e-5, "density": 7850.0}
LENGTH = 4.0
CLAMPED = "xyz rx ry rz"
# Roots of the frequency equations of a uniform beam, beta L (Blevins, Formulas for Natural Frequency and Mode Shape).
CANTILEVER = np.array([1.8751040687, 4.6940911330, 7.8547574382])
FIXED = np.array([4.7300407449, 7.8532046241, 10.9956078380])
PINNED = np.pi * np.arange(1, 4)


def line(n_elements, supports, first=(), last=(), **options):
    """Beams in a row, of which the first and last may be released."""
    points = LENGTH * np.linspace(0, 1, n_elements + 1)[:, np.newaxis] * [1.0, 0.0, 0.0]
    beams = {}
    for i in range(n_elements):
        ends = {"release_start": first if i == 0 else (), "release_end": last if i == n_elements - 1 else ()}
        beams[f"beam {i}"] = Beam(i, i + 1, **(SECTION | ends | options))
    at = {0: supports[0], n_elements: supports[1]}
    return Structure(dict(enumerate(points)), beams, at, {"all": list(beams)})


def frequencies(structure, n_modes):
    return structure.assemble(["all"], n_modes=n_modes).frequencies([[1.0]])[0]


def bending(roots, inertia):
    return roots**2 / (2 * np.pi * LENGTH**2) * np.sqrt(SECTION["E"] * inertia / (SECTION["density"] * SECTION["A"]))


CASES = {
    "cantilever": (CANTILEVER, (CLAMPED, "")),
    "clamped": (FIXED, (CLAMPED, CLAMPED)),
    "simply supported": (PINNED, ("xyz rx", "yz")),
}


@pytest.mark.parametrize("case", CASES)
def test_bending_about_both_axes_converges_at_fourth_order(case):
    roots, supports = CASES[case]
    exact = np.sort(np.concatenate([bending(roots, SECTION[i])[:2] for i in ("I_yy", "I_zz")]))[:3]
    sizes = np.array([6, 12, 24])
    errors = np.array([frequencies(line(n, supports), 3) / exact - 1 for n in sizes])
    assert (errors > 0).all()
    assert errors[-1].max() < 1e-5
    np.testing.assert_allclose(np.diff(np.log(errors[:, 0])) / np.diff(np.log(1 / sizes)), 4.0, atol=0.1)


def test_torsion_and_tension():
    """Held against bending, a shaft of polar inertia I_p twists, and a rod stretches, as the wave equation says."""
    shaft = line(40, (CLAMPED, "yz ry rz"), I_p=7e-5)
    twist = np.sqrt(SECTION["G"] * SECTION["J"] / (SECTION["density"] * 7e-5)) / (4 * LENGTH)
    stretch = np.sqrt(SECTION["E"] / SECTION["density"]) / (4 * LENGTH)
    alone = frequencies(line(1, (CLAMPED, "yz ry rz"), I_p=7e-5), 2)
    np.testing.assert_allclose(alone, np.array([twist, stretch]) * 4 * np.sqrt(3) / (2 * np.pi))
    fine = frequencies(shaft, 20)
    for exact in (twist, stretch):
        assert np.abs(fine / exact - 1).min() < 1e-3


def test_lumped_mass_is_half_at_either_end_and_a_lumped_cantilever_converges_from_below():
    model = line(1, (CLAMPED, "xy rx ry rz"), lumped=True)
    stiffness = 12 * SECTION["E"] * SECTION["I_yy"] / LENGTH**3
    mass = SECTION["density"] * SECTION["A"] * LENGTH / 2
    np.testing.assert_allclose(frequencies(model, 1), np.sqrt(stiffness / mass) / (2 * np.pi), rtol=1e-12)
    coarse, fine = (frequencies(line(n, (CLAMPED, ""), lumped=True), 1)[0] for n in (8, 32))
    exact = bending(CANTILEVER, SECTION["I_zz"])[0]
    assert coarse < fine < exact
    assert fine > 0.999 * exact


def test_ends_released_from_clamped_nodes_are_simply_supported():
    released = line(64, (CLAMPED, CLAMPED), first=("ry", "rz"), last=("ry", "rz"))
    supported = line(64, ("xyz rx", "xyz rx"))
    np.testing.assert_allclose(frequencies(released, 4), frequencies(supported, 4), rtol=1e-5)


def test_a_beam_released_in_all_bending_is_a_bar():
    beam = Beam(0, 1, **SECTION, release_start=("rx", "ry", "rz"), release_end=("ry", "rz"))
    matrices = beam.stiffness(np.array([[0, 0, 0], [LENGTH, 0, 0.0]]))
    np.testing.assert_allclose(
        matrices["E", "A"][[0, 0], [0, 6]], SECTION["E"] * SECTION["A"] / LENGTH * np.array([1, -1])
    )
    for properties in (("G", "J"), ("E", "I_yy"), ("E", "I_zz")):
        np.testing.assert_allclose(matrices[properties], 0, atol=1e-6)


def rigid_motions(points):
    """Six rigid motions of two nodes: translations, and rotations about the origin."""
    motions = np.zeros((12, 6))
    for k, point in enumerate(points):
        motions[6 * k : 6 * k + 3, :3] = motions[6 * k + 3 : 6 * k + 6, 3:] = np.eye(3)
        motions[6 * k : 6 * k + 3, 3:] = np.cross(np.eye(3), point).T
    return motions


@pytest.mark.parametrize("seed", range(3))
def test_rigid_motion_strains_nothing_and_carries_the_mass(seed):
    rng = np.random.default_rng(seed)
    points, arms = rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
    beam = Beam(0, 1, **SECTION, orientation=tuple(rng.normal(size=3)), offset_start=arms[0], offset_end=arms[1])
    rigid = rigid_motions(points)
    for matrix in beam.stiffness(points).values():
        np.testing.assert_allclose(matrix @ rigid, 0, atol=1e-9 * np.abs(matrix).max())
        np.testing.assert_allclose(matrix, matrix.T, atol=1e-9 * np.abs(matrix).max())
    mass = rigid.T @ sum(beam.mass(points).values()) @ rigid
    ends = points + arms
    total = SECTION["density"] * SECTION["A"] * np.linalg.norm(ends[1] - ends[0])
    np.testing.assert_allclose(mass[:3, :3], total * np.eye(3), atol=1e-9 * total)
    centre = ends.mean(axis=0)
    np.testing.assert_allclose(mass[:3, 3:], total * np.cross(np.eye(3), centre).T, atol=1e-9 * total * 10)


def test_a_rigid_arm_is_a_very_stiff_beam():
    arm, nodes, tank = (0.0, 0.3, -0.5), {0: (0, 0, 0), 1: (LENGTH, 0, 0)}, {"tip": PointMass(1, 80.0)}
    offset = {"beam": Beam(0, 1, **SECTION, offset_end=arm)}
    stiff = SECTION | {name: 1e5 * SECTION[name] for name in ("A", "I_yy", "I_zz", "J")} | {"density": 0.0}
    linked = {"beam": Beam(0, 2, **SECTION), "arm": Beam(1, 2, **stiff)}
    ends = nodes | {2: np.add((LENGTH, 0, 0), arm)}
    models = [Structure(n, b | tank, {0: CLAMPED}, {"all": ["beam"]}) for n, b in ((nodes, offset), (ends, linked))]
    np.testing.assert_allclose(*(frequencies(model, 4) for model in models), rtol=1e-4)


def portal(rotation=None):
    """A frame in space with releases, arms, springs and a tank."""
    turn = Rotation.identity() if rotation is None else rotation
    points = {"a": (0, 0, 0), "b": (0, 0, 3), "c": (5, 1, 3), "d": (5, 1, 0)}
    column = SECTION | {"orientation": tuple(turn.apply([1.0, 0.5, 0.1]))}
    girder = SECTION | {"orientation": tuple(turn.apply([0.3, 0.2, 1.0])), "offset_start": turn.apply([0.2, 0, 0.1])}
    members = {
        "left": Beam("a", "b", **column),
        "beam": Beam("b", "c", **girder, release_end=("ry",)),
        "right": Beam("c", "d", **column, release_end=("rz",)),
        "tank": PointMass("c", 300.0),
    }
    nodes = {name: turn.apply(point) for name, point in points.items()}
    return Structure(nodes, members, {"a": CLAMPED, "d": CLAMPED}, {"beam": ["beam"], "columns": ["left", "right"]})


@pytest.mark.parametrize("seed", range(2))
def test_frames_do_not_know_where_north_is(seed):
    own, turned = (
        portal(turn).assemble(["beam", "columns"]).frequencies([[0.9, 1.2]])
        for turn in (None, Rotation.random(random_state=seed))
    )
    np.testing.assert_allclose(turned, own, rtol=1e-8)


def test_frequencies_are_homogeneous_in_stiffness_and_in_mass():
    nodes = {"a": (0, 0, 0), "b": (0, 0, 3), "c": (5, 1, 3)}
    members = {"column": Beam("a", "b", **SECTION), "beam": Beam("b", "c", **SECTION)}
    members |= {"rocking": Spring("a", "ry", 4e7), "bearing": Spring("c", "z", 2e7)}
    groups = {"frame": ["column", "beam"], "soil": ["rocking"], "bearing": ["bearing"], "beam": ["beam"]}
    parameters = {name: (name, "frame") for name in ("E", "G", "A", "I_yy", "I_zz", "J", "mass")}
    parameters |= {"soil": ("k", "soil"), "bearing": "bearing", "density": ("density", "beam")}
    structure = Structure(nodes, members, {"a": "xyz rx rz", "c": "y"}, groups)
    model = structure.assemble(parameters, n_modes=5)
    theta = np.random.default_rng(1).uniform(0.8, 1.2, (3, len(model.parameter_names)))
    relative = model.jacobian(theta) * theta[:, np.newaxis] / model.frequencies(theta)[:, :, np.newaxis]
    share = dict(zip(model.parameter_names, np.moveaxis(relative, 2, 0), strict=True))
    np.testing.assert_allclose(share["E"] + share["G"] + share["soil"] + share["bearing"], 0.5, rtol=1e-8)
    np.testing.assert_allclose(share["mass"], -0.5, rtol=1e-8)
