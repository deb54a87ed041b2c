"""Laws that every structure obeys."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, Bar, Beam, PointMass, Spring, Structure

TRUSS = make_truss()
THETAS = st.lists(st.floats(0.3, 3.0), min_size=4, max_size=4).map(lambda row: np.array([row]))
FEW = settings(max_examples=8)


STEEL = {"E": 70e9, "A": 2e-3, "density": 2700.0}
ENDS = [(0, 2), (1, 2), (2, 3), (3, 0), (1, 3)]
CORNERS = np.array([[0, 0], [4, 0], [4, 3], [0, 3.0]])


def square(rotation=((1, 0), (0, 1)), shift=(0.0, 0.0), order=(0, 1, 2, 3)):
    """A braced square, pinned at two corners, with its nodes listed in any order."""
    corners = CORNERS @ np.asarray(rotation).T + shift
    bars, groups = {j: Bar(*ends, **STEEL) for j, ends in enumerate(ENDS)}, {"frame": [1, 2, 3], "braces": [0, 4]}
    structure = Structure({i: corners[i] for i in order}, bars, {0: "xy", 1: "xy"}, groups)
    return structure.assemble(["frame", "braces"], n_modes=4)


BRACED = [[0.9, 1.2]]
SQUARE = square().frequencies(BRACED)


@FEW
@given(THETAS, st.floats(0.1, 10.0))
def test_frequencies_are_the_generalised_solvers_and_grow_with_the_square_root_of_stiffness(theta, factor):
    stiffness, mass = TRUSS.matrices(theta)
    eigenvalues = scipy.linalg.eigh(stiffness.toarray(), mass.toarray(), eigvals_only=True)
    expected = np.sqrt(eigenvalues[:6]) / (2 * np.pi)
    np.testing.assert_allclose(TRUSS.frequencies(theta)[0], expected, rtol=1e-10)
    scaled = AffineModel({(): stiffness * 0, ("all",): stiffness}, mass)
    np.testing.assert_allclose(scaled.frequencies([[factor]])[0], np.sqrt(factor) * expected, rtol=1e-10)


@FEW
@given(st.permutations(range(4)))
def test_frequencies_do_not_depend_on_the_order_of_nodes(order):
    np.testing.assert_allclose(square(order=order).frequencies(BRACED), SQUARE, rtol=1e-10)


@FEW
@given(st.floats(-np.pi, np.pi), st.floats(-100, 100), st.floats(-100, 100))
def test_frequencies_do_not_depend_on_the_frame_of_reference(angle, x, y):
    rotation = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    np.testing.assert_allclose(square(rotation, (x, y)).frequencies(BRACED), SQUARE, rtol=1e-9)


def product_model(**options):
    """Stiffness E * A, mass A: every kind of term."""
    bars = {j: Bar(*ends, **STEEL) for j, ends in enumerate(ENDS)}
    members = bars | {"tank": PointMass(2, 50.0), "soil": Spring(1, "x", 3e7)}
    groups = {"frame": [1, 2, 3], "braces": [0, 4], "tank": ["tank"], "soil": ["soil"]}
    parameters = {"E": ("E", "frame"), "A": ("A", "frame"), "braces": "braces", "tank": ("m", "tank")}
    structure = Structure(dict(enumerate(CORNERS)), members, {0: "xy", 1: "y"}, groups)
    return structure.assemble(parameters | {"soil": ("k", "soil")}, n_modes=4, **options)


def massless_model():
    """Four nodes in a row on springs, every other one without mass."""
    chain = np.diag([2.0, 2, 2, 1]) - np.diag([1.0, 1, 1], 1) - np.diag([1.0, 1, 1], -1)
    ends = np.diag([1.0, 0, 0, 0])
    return AffineModel({("chain",): chain - ends, ("support",): ends}, np.diag([0.0, 2, 0, 1]), n_modes=2)


MODELS = [TRUSS, product_model(), product_model(track=True), massless_model()]


@pytest.mark.parametrize("model", MODELS, ids=repr)
def test_shapes_have_unit_modal_mass_and_solve_the_eigenproblem(model):
    theta = np.random.default_rng(2).uniform(0.5, 2.0, (10, len(model.parameter_names)))
    for row, f, phi in zip(theta, *model.modes(theta), strict=True):
        stiffness, mass = model.matrices(row)
        eigenvalues = (2 * np.pi * f) ** 2
        np.testing.assert_allclose(phi.T @ mass @ phi, np.eye(model.n_modes), atol=1e-9)
        np.testing.assert_allclose(phi.T @ stiffness @ phi, np.diag(eigenvalues), atol=1e-9 * eigenvalues.max())
        residual = stiffness @ phi - mass @ phi * eigenvalues
        assert np.abs(residual).max() < 1e-9 * np.abs(stiffness @ phi).max()


@pytest.mark.parametrize("model", MODELS, ids=repr)
def test_jacobian_equals_central_differences(model):
    theta, step = np.random.default_rng(0).uniform(0.8, 1.2, (3, len(model.parameter_names))), 1e-5
    differences = [
        (model.frequencies(theta + step * unit) - model.frequencies(theta - step * unit)) / (2 * step)
        for unit in np.eye(theta.shape[1])
    ]
    scale = model.frequencies(theta)[:, :, np.newaxis]
    np.testing.assert_allclose(model.jacobian(theta) / scale, np.stack(differences, axis=2) / scale, atol=1e-6)


def test_sensitivities_to_stiffness_sum_to_one_half():
    """f is homogeneous of degree 1/2 in stiffness (Euler's theorem)."""
    structure = square()
    theta = np.random.default_rng(1).uniform(0.5, 1.5, (4, 2))
    total = (structure.jacobian(theta) * theta[:, np.newaxis]).sum(axis=2) / structure.frequencies(theta)
    np.testing.assert_allclose(total, 0.5, rtol=1e-9)


def test_damage_multiplies_stiffness_leaves_mass_and_accumulates():
    theta = np.array([[0.9, 1.1, 1.0, 1.2]])
    damaged = TRUSS.damaged({"bottom": 0.3, "top": -0.15})
    np.testing.assert_allclose(damaged.frequencies(theta), TRUSS.frequencies(theta * [0.7, 1.15, 1, 1]), rtol=1e-12)
    assert (damaged.matrices(theta)[1] != TRUSS.matrices(theta)[1]).nnz == 0
    assert damaged.groups == TRUSS.groups
    twice = TRUSS.damaged({"top": 0.5}).damaged({"top": 0.5})
    np.testing.assert_allclose(twice.frequencies(theta), TRUSS.damaged({"top": 0.75}).frequencies(theta), rtol=1e-12)
    np.testing.assert_array_equal(TRUSS.damaged({}).frequencies(theta), TRUSS.frequencies(theta))
    model, theta = product_model(), np.array([[1.1, 0.9, 1.0, 1.2, 0.8]])
    weaker = model.damaged({"frame": 0.25}).frequencies(theta)
    np.testing.assert_allclose(weaker, model.frequencies(theta * [0.75, 1, 1, 1, 1]), rtol=1e-12)
    assert "tank" not in model.groups


def test_damage_of_a_property_is_that_property_smaller():
    section = {"E": 37.5e9, "G": 16e9, "A": 4.4, "I_yy": 0.6, "I_zz": 17.0, "J": 1.2, "density": 2700.0}
    nodes, beams = {i: (5.0 * i, 0, 0) for i in range(5)}, {i: Beam(i, i + 1, **section) for i in range(4)}
    structure = Structure(nodes, beams, {0: "xyz rx ry rz"}, {"girder": range(4)})
    properties = {"bending": ("E", "girder"), "torsion": ("G", "girder")}
    groups = properties | {"all": "girder", "lateral": ("I_zz", "girder")}
    model = structure.assemble(properties, groups=groups, n_modes=6)
    lateral = structure.assemble({"I_zz": ("I_zz", "girder")}, n_modes=6)
    thetas = {"bending": [0.6, 1], "torsion": [1, 0.6], "all": [0.6, 0.6], "lateral": [0.6]}
    for damage, theta in thetas.items():
        expected = (lateral if damage == "lateral" else model).frequencies([theta])
        np.testing.assert_allclose(model.damaged({damage: 0.4}).frequencies([[1, 1]]), expected, rtol=1e-9)


def test_massless_degrees_of_freedom_follow_statically():
    """A massless node between two springs: springs in series."""
    k1, k2, m = 3e5, 6e5, 10.0
    model = AffineModel({("k",): np.array([[k1 + k2, -k2], [-k2, k2]])}, np.diag([0.0, m]), n_modes=1, track=True)
    expected = np.sqrt(1 / (1 / k1 + 1 / k2) / m) / (2 * np.pi)
    np.testing.assert_allclose(model.frequencies([[1.0], [4.0]])[:, 0], [expected, 2 * expected], rtol=1e-12)


def test_wide_spectra_keep_the_lowest_modes_digits():
    """A light mass beside a heavy one: the spectrum spans ten orders, the stiffness is well conditioned."""
    light = 1e-10
    model = AffineModel({("k",): [[2.0, -1.0], [-1.0, 2.0]]}, np.diag([1.0, light]), n_modes=1)
    half_trace = 1 + light
    eigenvalue = 3 / (half_trace + np.sqrt(half_trace**2 - 3 * light))
    np.testing.assert_allclose(model.frequencies([[1.0]]), [[np.sqrt(eigenvalue) / (2 * np.pi)]], rtol=1e-13)


@pytest.mark.parametrize("track", [False, True])
@pytest.mark.parametrize("mass", [np.eye(2), np.diag([1.0, 0.0])], ids=["standard", "flexibility"])
def test_a_sample_without_modes_is_nan_and_the_others_stay(mass, track):
    """A compressive force whose parameter can outgrow the elastic stiffness."""
    terms = {("elastic",): np.eye(2), ("force",): np.diag([-0.5, 0.0])}
    model = AffineModel(terms, mass, n_modes=1, track=track)
    for method in (model.frequencies, model.modes, model.jacobian):
        with pytest.warns(UserWarning, match="some rows of theta .*no-solution"):
            result = method([[1.0, 1.0], [1.0, 3.0], [1.0, 0.5]])
        values = result[0] if isinstance(result, tuple) else result
        assert np.isnan(values[1]).all()
        assert np.isfinite(values[[0, 2]]).all()
    np.testing.assert_allclose(model.frequencies([[1.0, 0.5]]), np.sqrt(0.75) / (2 * np.pi))
