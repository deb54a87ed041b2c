"""Reduced models of changed structures: made once for each change of a simulator, and never for another."""

import pickle
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from skthermo.datasets import make_truss
from skthermo.surrogate import _simulator
from skthermo.surrogate._simulator import Simulator

TRUSS = make_truss()
BOX = np.tile([0.9, 1.1], (4, 1))
THETA = np.random.default_rng(0).uniform(0.92, 1.08, (5, 4))


@pytest.fixture
def simulator():
    return Simulator(TRUSS, TRUSS.reduced(BOX, tol=1e-6, random_state=0), BOX, 1e-6)


CHANGES = [
    lambda one: one.damaged({"bottom": 0.1}),
    lambda one: one.damaged({"bottom": 0.2}),
    lambda one: one.damaged({"top": 0.1}),
    lambda one: one.changed("with_modes", [0, 1, 2]),
    lambda one: one.changed("with_added", stiffness=None, mass=np.eye(TRUSS.n_dof)),
    lambda one: one.changed("with_added", stiffness=None, mass=2 * np.eye(TRUSS.n_dof)),
    lambda one: one.with_columns(["top"], {}, np.vstack([BOX, [[0.8, 1.0]]])),
    lambda one: one.with_columns(["top"], {}, np.vstack([BOX, [[0.7, 1.0]]])),
    lambda one: one.with_columns(["bottom"], {}, np.vstack([BOX, [[0.8, 1.0]]])),
    lambda one: one.with_columns([], {"deck": np.eye(TRUSS.n_dof)}, np.vstack([BOX, [[0.8, 1.2]]])),
]


def test_each_change_is_made_once_and_is_no_other(simulator):
    first, again = ([change(simulator) for change in CHANGES] for _ in range(2))
    assert all(one is other for one, other in zip(first, again, strict=True))
    assert len({id(one) for one in first}) == len(CHANGES)
    for made, change in zip(first, CHANGES, strict=True):
        theta = np.hstack([THETA, np.full((5, len(made.box) - 4), 0.95)])
        fresh = change(Simulator(TRUSS, simulator.reduced, BOX, 1e-6))
        np.testing.assert_array_equal(made.frequencies(theta), fresh.frequencies(theta))
        np.testing.assert_allclose(made.frequencies(theta), made.model.frequencies(theta), rtol=1e-6)


def test_a_simulator_of_another_model_knows_none(simulator):
    damaged = simulator.damaged({"bottom": 0.1})
    other = TRUSS.damaged({"top": 0.3})
    twin = replace(simulator, model=other, reduced=other.reduced(BOX, tol=1e-6, random_state=0))
    changed = twin.damaged({"bottom": 0.1})
    assert changed is not damaged
    expected = other.damaged({"bottom": 0.1}).frequencies(THETA)
    np.testing.assert_allclose(changed.frequencies(THETA), expected, rtol=1e-6)


def test_copies_are_small_and_make_the_same(simulator):
    size = len(pickle.dumps(simulator))
    damaged = simulator.damaged({"bottom": 0.1})
    assert len(pickle.dumps(simulator)) == size
    for twin in (pickle.loads(pickle.dumps(simulator)), deepcopy(simulator)):
        again = twin.damaged({"bottom": 0.1})
        assert again is not damaged
        np.testing.assert_array_equal(again.frequencies(THETA), damaged.frequencies(THETA))


def test_a_chain_on_a_model_that_was_reduced_by_hand_has_them_too():
    simulator = Simulator(TRUSS.reduced(BOX, random_state=0))
    assert simulator.damaged({"top": 0.1}) is simulator.damaged({"top": 0.1})


def test_full_models_are_not_kept():
    simulator = Simulator(TRUSS)
    assert simulator.damaged({"top": 0.1}) is not simulator.damaged({"top": 0.1})


def test_those_asked_for_last_are_kept(simulator, monkeypatch):
    severities = [0.1, 0.2, 0.3]
    one, two, three = (simulator.damaged({"top": severity}) for severity in severities)
    monkeypatch.setattr(_simulator, "MOST_KEPT", three.size + one.size)
    assert simulator.damaged({"top": 0.1}) is one
    assert simulator.damaged({"top": 0.3}) is three
    assert simulator.damaged({"top": 0.1}) is one
    assert simulator.damaged({"top": 0.2}) is not two
