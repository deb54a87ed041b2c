"""Degrees of freedom by label: the same results as by position, wherever shapes are given or wanted."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, evaluate_modes, linearise_modes, match_modes
from skthermo.surrogate import PosteriorInverse
from skthermo.updating import ModelUpdater, identifiability

TRUSS = make_truss()
NOMINAL = np.ones((1, 4))


@settings(max_examples=5)
@given(st.lists(st.integers(0, TRUSS.n_dof - 1), min_size=1, max_size=5, unique=True))
def test_labels_mean_their_positions(positions):
    labels = [TRUSS.dofs[i] for i in positions]
    for by_label, by_position in [
        (evaluate_modes(TRUSS, NOMINAL, labels), evaluate_modes(TRUSS, NOMINAL, positions)),
        (linearise_modes(TRUSS, NOMINAL, labels), linearise_modes(TRUSS, NOMINAL, positions)),
    ]:
        for one, other in zip(by_label, by_position, strict=True):
            np.testing.assert_array_equal(one, other)


def test_measured_shapes_at_labels():
    positions = [0, 3, 8, 11, 5]
    labels = [TRUSS.dofs[i] for i in positions]
    frequencies, (shapes,) = evaluate_modes(TRUSS, NOMINAL * 0.95, positions)
    X, updater = np.hstack([frequencies, shapes.T.reshape(1, -1)]), ModelUpdater(TRUSS, shape_weight=1.0)
    for found in (
        lambda dofs: match_modes(TRUSS, frequencies, shapes=shapes, dofs=dofs),
        lambda dofs: clone(updater).fit(frequencies, shapes=shapes, dofs=dofs).theta_,
        lambda dofs: identifiability(TRUSS, noise=0.01, dofs=dofs, shape_noise=0.01).deviations,
        lambda dofs: PosteriorInverse(TRUSS, dofs=dofs, noise=0.01, prior=0.1).fit_transform(X),
    ):
        np.testing.assert_array_equal(found(labels), found(positions))


def test_every_derived_model_keeps_its_labels():
    for model in (
        TRUSS.damaged({"top": 0.1}),
        TRUSS.with_modes([1, 0]),
        TRUSS.with_parameters(["top"]),
        TRUSS.rescaled([1.1, 1, 1, 1]),
        TRUSS.reduced(0.2, tol=1e-3, random_state=0),
    ):
        assert model.dofs == TRUSS.dofs


@pytest.mark.parametrize(
    ("dofs", "message"),
    [
        ([("nowhere", "x")], "nowhere"),
        ([TRUSS.dofs[0], TRUSS.dofs[0]], "more than once"),
        ([TRUSS.dofs[0], 3], "dofs"),
        ([(0, 1, 2)], "dofs"),
        ([([], "x")], "dofs"),
    ],
)
def test_unknown_labels_are_named(dofs, message):
    with pytest.raises(ValueError, match=message):
        evaluate_modes(TRUSS, NOMINAL, dofs)


def test_labels_need_a_model_that_has_them():
    model = AffineModel({("k",): np.diag([1.0, 2.0])}, np.eye(2), n_modes=1)
    assert model.dofs == ()
    with pytest.raises(ValueError, match="no labels"):
        evaluate_modes(model, [[1.0]], [(1, "x")])
