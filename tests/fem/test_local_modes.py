"""Derivatives of mode shapes, and models rescaled to another nominal state."""

import os
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, mac
from tests.fem.frames import frame, local_shapes, portal

ROW = np.array([0.9, 1.15, 1.05, 0.85])


def building_frame(n_modes=5):
    folder = os.environ.get("SKTHERMO_DATA")
    if not folder:
        pytest.skip("SKTHERMO_DATA is not set")
    data = scipy.io.loadmat(Path(folder) / "building_frame" / "ConcreteBuildingFrame.mat", spmatrix=False)
    names = [f"E_{i}" for i in range(1, 13)] + ["Influence_Link", "Influence_Rebar"]
    return AffineModel({(name,): data[name] for name in names}, data["M0"], n_modes=n_modes)


def chain_with_few_masses():
    """Twelve springs in a row, in four groups, with a mass in the middle of each group."""
    springs = np.diff(np.eye(13), axis=0)[:, 1:]
    groups = np.split(springs, 4)
    terms = {(name,): group.T @ group for name, group in zip("abcd", groups, strict=True)}
    return AffineModel(terms, np.diag(np.arange(12) % 3 == 1).astype(float), n_modes=2)


def central_differences(model, row, shapes, step, directions=None):
    """Of shapes, each with the sign of those given."""
    differences = []
    for unit in np.eye(len(row)) if directions is None else directions:
        ends = [model.modes([row + way * step * unit])[1][0] for way in (1, -1)]
        raised, lowered = (end * np.sign((end * shapes).sum(axis=0)) for end in ends)
        differences.append((raised - lowered) / (2 * step))
    return np.stack(differences, axis=2)


MODELS = {
    "truss": make_truss,
    "chain with massless degrees of freedom": chain_with_few_masses,
    "truss, all but two modes": lambda: make_truss(n_modes=21),
    "dense frame": lambda: portal(3, track=True),
    "sparse frame": frame,
    "sparse tracked frame": lambda: frame(track=True),
    "reduced frame": lambda: frame(track=True, is_reduced=True),
}


SMALL = [pytest.param(MODELS[name], id=name) for name in list(MODELS)[:2]]
LARGER = [pytest.param(MODELS[name], id=name, marks=pytest.mark.nightly) for name in list(MODELS)[2:]]


@pytest.mark.parametrize("make", SMALL + LARGER)
def test_shape_derivatives_equal_central_differences(make):
    model = make()
    shapes, derivatives = local_shapes(model, ROW)
    expected = central_differences(model, ROW, shapes, 1e-4)
    scale = np.abs(expected).max(axis=(0, 2), keepdims=True)
    np.testing.assert_allclose(derivatives / scale, expected / scale, atol=1e-4)
    some = [5, 2]
    np.testing.assert_allclose(np.abs(local_shapes(model, ROW, some)[1]), np.abs(derivatives[some]), rtol=1e-9)


@pytest.mark.nightly
def test_shape_derivatives_of_a_real_model_with_massless_degrees_of_freedom():
    model, random = building_frame(), np.random.default_rng(0)
    row, direction = random.uniform(0.8, 1.2, 14), random.standard_normal(14)
    shapes, derivatives = local_shapes(model, row)
    expected = central_differences(model, row, shapes, 1e-4, [direction])[:, :, 0]
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(derivatives @ direction / scale, expected / scale, atol=1e-4)


@pytest.mark.parametrize("track", [False, True])
def test_shapes_of_the_jacobian_are_the_models_columns(track):
    row = np.array([0.3, 3.0, 0.4, 0.2])
    for model in (portal(3, track=track), frame(track=track)):
        shapes = model.linearised_modes(row, range(model.n_dof))[2][0]
        np.testing.assert_allclose(np.diagonal(mac(shapes, model.modes([row])[1][0])), 1)


def test_unit_modal_mass_is_kept_where_mass_varies():
    model = portal(3)
    shapes, derivatives = local_shapes(model, ROW)
    step = 1e-5
    for p, unit in enumerate(np.eye(4)):
        mass = model.matrices(ROW + step * unit)[1]
        moved = shapes + step * derivatives[:, :, p]
        np.testing.assert_allclose(np.diag(moved.T @ (mass @ moved)), 1, atol=1e-8)


@pytest.mark.one_case
@pytest.mark.parametrize("make", MODELS.values(), ids=MODELS)
def test_a_rescaled_model_is_the_same_structure_seen_from_another_theta(make):
    model = make()
    origin, theta = np.array([0.95, 1.05, 1.1, 0.9]), np.array([[1.0, 1.0, 1.0, 1.0], [0.9, 1.1, 0.95, 1.05]])
    twin = model.rescaled(origin)
    assert twin.parameter_names == model.parameter_names
    assert twin.track == model.track
    np.testing.assert_allclose(twin.frequencies(theta), model.frequencies(theta * origin), rtol=1e-9)
    np.testing.assert_allclose(twin.jacobian(theta), model.jacobian(theta * origin) * origin, rtol=1e-5, atol=1e-9)
    again = twin.rescaled(1 / origin)
    np.testing.assert_allclose(again.frequencies(theta), model.frequencies(theta), rtol=1e-9)


def test_columns_of_a_rescaled_model_stay_the_nominal_modes_where_modes_swap():
    """Two masses on springs of their own: the first mode is the second one's frequency away from nominal."""
    stiffness = {("a",): np.diag([1.0, 0.0]), ("b",): np.diag([0.0, 1.5])}
    model = AffineModel(stiffness, {("m",): np.eye(2)}, n_modes=2, track=True)
    twin = model.rescaled([2.0, 1.0, 0.5])
    nominal = np.ones((1, 3))
    np.testing.assert_allclose((2 * np.pi * twin.frequencies(nominal)) ** 2, [[4.0, 3.0]])
    np.testing.assert_allclose(np.diagonal(twin.nominal_mac(twin.modes(nominal)[1])[0]), 1)
