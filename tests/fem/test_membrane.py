"""Membranes against closed forms and laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from skthermo.fem import Bar, Membrane, Spring, Structure

PLATE = {"E": 210e9, "t": 0.015, "nu": 0.3, "density": 7850.0}
QUADRILATERAL = np.array([[0.0, 0.0, 0.0], [2.0, 0.3, 0.0], [1.7, 1.9, 0.0], [-0.2, 1.2, 0.0]])
AREA = 2.855  # by the shoelace formula


def matrix_of(kind, coordinates, **options):
    matrices = getattr(Membrane((0, 1, 2, 3), **(PLATE | options)), kind)(coordinates)
    return matrices["E" if kind == "stiffness" else "density", "t"]


def in_plane(strain):
    """Displacements of constant strain (exx, eyy, gamma_xy) at the quadrilateral's nodes."""
    exx, eyy, gamma = strain
    return (QUADRILATERAL @ [[exx, gamma / 2, 0], [gamma / 2, eyy, 0], [0, 0, 0]]).ravel()


@given(st.lists(st.floats(-1e-3, 1e-3), min_size=3, max_size=3), st.integers(0, 10**6))
@settings(max_examples=30)
def test_constant_strain_has_its_exact_energy_however_the_plate_is_turned(strain, seed):
    nu = PLATE["nu"]
    hooke = PLATE["E"] / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    energy = PLATE["t"] * AREA * np.array(strain) @ hooke @ strain
    turn = Rotation.random(random_state=seed)
    displacements = turn.apply(in_plane(strain).reshape(4, 3)).ravel()
    computed = displacements @ matrix_of("stiffness", turn.apply(QUADRILATERAL) + [3, -7, 2]) @ displacements
    np.testing.assert_allclose(computed, energy, rtol=1e-8, atol=1e-8)


def test_patch_of_distorted_membranes_stretches_evenly():
    """Pulled by the forces of constant stress, the patch's inner nodes move as the strain says."""
    outer = {0: (0, 0), 1: (4, 0), 2: (4, 3), 3: (0, 3)}
    inner = {4: (1, 0.8), 5: (2.9, 0.6), 6: (2.7, 2.1), 7: (1.2, 1.9)}
    patch = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)]
    points = np.array([*outer.values(), *inner.values()], dtype=float)
    total = np.zeros((16, 16))
    for corners in patch:
        dofs = np.array([[2 * c, 2 * c + 1] for c in corners]).ravel()
        total[np.ix_(dofs, dofs)] += matrix_of("stiffness", points[list(corners)])
    expected = (points @ [[1e-3, 3e-4], [2e-4, -5e-4]]).ravel()
    held, free = np.arange(8), np.arange(8, 16)
    found = np.linalg.solve(total[np.ix_(free, free)], -total[np.ix_(free, held)] @ expected[held])
    np.testing.assert_allclose(found, expected[free], rtol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_rigid_motion_strains_nothing_and_carries_the_mass(seed):
    rng = np.random.default_rng(seed)
    points = Rotation.random(random_state=seed).apply(QUADRILATERAL) + rng.normal(size=3)
    turning = np.stack([np.cross(axis, points).ravel() for axis in np.eye(3)], axis=1)
    shifting, matrix = np.tile(np.eye(3), (4, 1)), matrix_of("stiffness", points)
    np.testing.assert_allclose(matrix @ np.hstack([shifting, turning]), 0, atol=1e-9 * np.abs(matrix).max())
    total = PLATE["density"] * PLATE["t"] * AREA
    consistent, lumped = (matrix_of("mass", points, lumped=lumped) for lumped in (False, True))
    np.testing.assert_allclose(shifting.T @ consistent @ shifting, total * np.eye(3), atol=1e-9 * total)
    np.testing.assert_allclose(lumped, np.diag(consistent.sum(axis=1)), atol=1e-9 * total)
    np.testing.assert_allclose(shifting.T @ consistent @ turning, shifting.T @ lumped @ turning, atol=1e-8 * total)


def test_nothing_resists_motion_out_of_the_plane():
    matrix = matrix_of("stiffness", QUADRILATERAL)
    assert not matrix.reshape(4, 3, 4, 3)[:, 2].any()
    assert np.linalg.matrix_rank(matrix) == 8 - 3


def sheet(n, m, length, depth, held=lambda i, j: "" if i else "xy", springs=(), **options):
    """n x m membranes, clamped along the left edge if nothing else is said."""
    nodes = {(i, j): (length * i / n, depth * (j / m - 0.5)) for i in range(n + 1) for j in range(m + 1)}
    corners = {(i, j): ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)) for i in range(n) for j in range(m)}
    members = {name: Membrane(around, **(PLATE | options)) for name, around in corners.items()}
    return Structure(nodes, members | dict(springs), {node: held(*node) for node in nodes}, {"sheet": list(members)})


def test_slender_sheet_is_a_bernoulli_cantilever():
    """Too stiff, by an error that falls with the square of the mesh."""
    length, depth = 8.0, 0.4
    inertia, area = PLATE["t"] * depth**3 / 12, PLATE["t"] * depth
    exact = 1.8751040687**2 / (2 * np.pi * length**2) * np.sqrt(PLATE["E"] * inertia / (PLATE["density"] * area))
    sheets = [sheet(n, m, length, depth).assemble(["sheet"], n_modes=1) for n, m in ((20, 1), (40, 2))]
    coarse, fine = (model.frequencies([[1.0]])[0, 0] / exact - 1 for model in sheets)
    assert 0 < fine < coarse
    np.testing.assert_allclose(fine + (fine - coarse) / 3, 0, atol=0.01)


def test_without_lateral_contraction_a_strip_is_a_row_of_bars():
    strip = sheet(6, 1, 6.0, 0.8, held=lambda i, j: "y" if i else "xy", nu=0.0, lumped=True)
    bars = {i: Bar(i, i + 1, E=PLATE["E"], A=0.8 * PLATE["t"], density=PLATE["density"], lumped=True) for i in range(6)}
    nodes = {i: (float(i), 0.0) for i in range(7)}
    rod = Structure(nodes, bars, {i: "y" if i else "xy" for i in nodes}, {"sheet": range(6)})
    found, expected = (one.assemble(["sheet"], n_modes=1).frequencies([[1.0]]) for one in (strip, rod))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_every_property_may_be_a_parameter():
    springs = {("spring", i, j): Spring((i, j), "x", 1e9) for i in range(1, 5) for j in range(3)}
    parameters = {"E": ("E", "sheet"), "t": ("t", "sheet"), "t_K": ("t", "sheet", "stiffness")}
    parameters |= {"rho": ("density", "sheet"), "t_M": ("t", "sheet", "mass")}
    model = sheet(4, 2, 2.0, 1.0, springs=springs).assemble(parameters, n_modes=3)
    for theta, twin in (
        ([1.3, 1, 1, 1, 1], {"E": 1.3 * PLATE["E"]}),
        ([1, 0.7, 1, 1, 1], {"t": 0.7 * PLATE["t"]}),
        ([1, 1, 1.2, 1, 1], {"E": 1.2 * PLATE["E"]}),
        ([1, 1, 1, 0.8, 1.1], {"density": 0.8 * 1.1 * PLATE["density"]}),
    ):
        expected = sheet(4, 2, 2.0, 1.0, springs=springs, **twin).assemble(["sheet"], n_modes=3).frequencies([[1.0]])
        np.testing.assert_allclose(model.frequencies([theta]), expected, rtol=1e-9)


WARPED = QUADRILATERAL + [[0, 0, 0], [0, 0, 0], [0, 0, 0.1], [0, 0, 0]]


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        (WARPED, {}, "expected four nodes in one plane"),
        (QUADRILATERAL[[0, 2, 1, 3]], {}, "expected a convex quadrilateral"),
        (np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]), {}, "expected a convex quadrilateral"),
        (QUADRILATERAL, {"corners": (0, 0, 1, 2)}, "expected a convex quadrilateral"),
    ],
)
def test_bad_membranes_are_named(points, options, message):
    with pytest.raises(ValueError, match=message):
        Structure(dict(enumerate(points)), {"m": Membrane(**(PLATE | {"corners": (0, 1, 2, 3)} | options))}, {0: "xyz"})
