"""Damage as parameters, and added matrices."""

import numpy as np
import pytest

from skthermo.datasets import make_truss, make_z24
from skthermo.fem import AffineModel

Z24 = make_z24()
MODELS = {"dense": make_truss(), "sparse, tracked": Z24, "reduced": Z24.reduced(0.1, tol=1e-7, random_state=0)}
each_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def rows(model, n_rows):
    return np.random.RandomState(0).uniform(0.93, 1.07, size=(n_rows, len(model.parameter_names)))


@pytest.mark.one_case
@each_model
def test_damage_parameters_give_the_damaged_model(model):
    groups = list(model.groups)[:2]
    severities = np.array([[0.2, 0.0], [0.1, 0.3], [-0.05, 0.4]])
    extended = model.with_damage_parameters(groups)
    found = extended.frequencies(np.hstack([rows(model, 3), 1 - severities]))
    expected = [
        model.damaged(dict(zip(groups, row, strict=True))).frequencies(theta[np.newaxis])[0]
        for theta, row in zip(rows(model, 3), severities, strict=True)
    ]
    np.testing.assert_allclose(found, expected, rtol=3e-7)


@each_model
def test_derivatives_by_severity_are_those_of_differences(model):
    extended, step = model.with_damage_parameters([list(model.groups)[1]]), 1e-4
    theta = np.hstack([rows(model, 2), np.full((2, 1), 0.8)])
    unit = np.eye(theta.shape[1])[-1] * step
    slopes = (extended.frequencies(theta + unit) - extended.frequencies(theta - unit)) / (2 * step)
    np.testing.assert_allclose(extended.jacobian(theta)[:, :, -1], slopes, rtol=1e-4, atol=1e-6)


def test_damage_parameters_of_a_changed_model():
    truss = make_truss()
    heavy = truss.damaged({"top": 0.1}).with_added(mass=np.full(truss.n_dof, 20.0)).with_modes([0, 2, 1])
    found = heavy.with_damage_parameters(["bottom"]).frequencies([[1, 1, 1, 1, 0.7]])
    expected = heavy.damaged({"bottom": 0.3}).frequencies([[1, 1, 1, 1]])
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_damage_parameters_refuse_unknown_groups_and_taken_names():
    with pytest.raises(ValueError, match=r"damage groups names \['deck'\]"):
        make_truss().with_damage_parameters(["deck"])
    with pytest.raises(ValueError, match="each name once"):
        make_truss().with_damage_parameters(["top"]).with_damage_parameters(["top"])


@each_model
def test_added_matrices_give_the_model_built_with_them(model):
    random = np.random.RandomState(1)
    mass = random.uniform(10, 50, model.n_dof)
    stiffness = np.diag(random.uniform(0, 1e6, model.n_dof))
    changed = model.with_added(stiffness=stiffness, mass=mass)
    row = rows(model, 1)
    K, M = (matrix.toarray() for matrix in model.matrices(row))
    modes = 3 if model.track else model.n_modes  # the lowest three do not swap here
    built = AffineModel({("all",): K + stiffness}, M + np.diag(mass), n_modes=6).frequencies([[1.0]])
    np.testing.assert_allclose(changed.frequencies(row)[0, :modes], built[0, :modes], rtol=1e-6)


def test_columns_stay_the_healthy_modes_where_added_mass_swaps_them():
    springs = {(name,): np.diag(k) for name, k in (("a", [100.0, 0.0]), ("b", [0.0, 110.0]))}
    model = AffineModel(springs, np.eye(2), n_modes=2, track=True)
    first, second = model.with_added(mass=[0.0, 0.5]).frequencies([[1.0, 1.0]])[0] * 2 * np.pi
    np.testing.assert_allclose([first**2, second**2], [100.0, 110.0 / 1.5])
