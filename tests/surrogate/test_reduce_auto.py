"""Laws of ``reduce="auto"``: what is reduced, that results stay the same, and that the report says so."""

import pickle
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss
from skthermo.fem import CallableModel
from skthermo.surrogate import DataInformedFEM, TemperatureMapper, _simulator, refitted
from skthermo.surrogate._simulator import Simulator
from tests.fem.frames import portal

LARGE, SMALL = portal(4), make_truss()


def records(model, n_rows=60):
    """Air temperatures, and frequencies of a structure that warmth softens."""
    random, stamps = np.random.default_rng(0), pd.date_range("2025", periods=n_rows, freq="D")
    share = random.uniform(size=(n_rows, 1))
    theta = (1.05 - 0.1 * share) ** random.uniform(0.5, 1.0, len(model.parameter_names))
    F = model.frequencies(theta) * (1 + 0.001 * random.standard_normal((n_rows, model.n_modes)))
    return pd.DataFrame(30 * share, stamps, ["T"]), pd.DataFrame(F, stamps).add_prefix("f")


def chain(model, **options):
    return DataInformedFEM(model, mapper=TemperatureMapper(Ridge()), random_state=0, **options)


def predictions(fem, T):
    damage = dict.fromkeys(list(fem.model.groups)[:1], 0.2)
    return np.hstack([fem.predict_parameters(T), fem.predict(T), fem.simulate(T, damage=damage)])


@pytest.mark.nightly
def test_a_large_model_is_reduced_and_nothing_changes_but_the_time():
    T, F = records(LARGE)
    auto, reduced, full = (chain(LARGE, reduce=reduce).fit(T, F) for reduce in ("auto", True, False))
    np.testing.assert_array_equal(predictions(auto, T), predictions(reduced, T))
    np.testing.assert_allclose(auto.predict(T), full.predict(T), rtol=3e-5)
    size = auto.simulator_.reduced.basis_size_
    assert auto.report_.solved == (
        f"Solved by a reduced model of {size} coordinates (of {LARGE.n_dof}), accurate to 1e-05."
    )
    assert auto.report_.solved in repr(auto.report_)
    assert full.report_.solved == "Solved by the full model: reduce=False."


@pytest.mark.one_case
@pytest.mark.parametrize(
    "model",
    [SMALL, CallableModel(SMALL.frequencies, SMALL.parameter_names, SMALL.n_modes, vectorized=True)],
    ids=["small", "program"],
)
def test_what_a_reduced_model_would_not_speed_up_stays_full(model):
    T, F = records(model)
    auto, full = (chain(model, reduce=reduce).fit(T, F) for reduce in ("auto", False))
    np.testing.assert_array_equal(auto.predict(T), full.predict(T))
    assert auto.simulator_.reduced is None
    assert auto.report_.solved.startswith("Solved by the full model: ")


def test_the_decision_is_monotone_in_rows_and_in_size():
    rows = np.unique(np.logspace(0, 6, 40).astype(int))
    models = [portal(n) for n in (1, 2, 3, 4, 5, 8, 16, 40)]
    table = np.array([[model.reduction_pays(int(n)) for n in rows] for model in models])
    assert (np.diff(table.astype(int), axis=0) >= 0).all()
    assert (np.diff(table.astype(int), axis=1) >= 0).all()
    assert not table[0].any()
    assert not table[:, 0].any()
    assert table[-1, -1]


@pytest.mark.filterwarnings("ignore:.*few-rows")
def test_few_rows_do_not_pay_for_a_basis():
    T, F = records(LARGE, 12)
    fem = chain(LARGE).fit(T, F)
    assert fem.inverse_.simulator_.reduced is None
    assert fem.report_.solved == "Solved by the full model: a reduced model would save no time."


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*few-rows")
def test_an_inverse_follows_the_chain_unless_it_says_otherwise():
    T, F = records(LARGE, 12)
    assert chain(LARGE, reduce=True).fit(T, F).inverse_.reduce is True
    assert chain(LARGE, reduce=False).fit(T, F).inverse_.reduce is False
    own = chain(LARGE, reduce=True).set_params(inverse__reduce=False).fit(T, F)
    assert own.inverse_.simulator_.reduced is None
    assert own.simulator_.reduced is not None


@pytest.mark.nightly
def test_without_an_accurate_basis_the_full_model_solves_without_a_warning(monkeypatch):
    def fails(*args, **options):
        raise RuntimeError("after 4 rounds 9 basis vectors do not give frequencies to 1e-05")

    T, F = records(LARGE)
    full = chain(LARGE, reduce=False).fit(T, F)
    monkeypatch.setattr("skthermo.fem.affine._affine.grow_basis", fails)
    auto = chain(LARGE).fit(T, F)
    np.testing.assert_array_equal(predictions(auto, T), predictions(full, T))
    assert "no reduced model is accurate" in auto.report_.solved
    with pytest.warns(UserWarning, match="do not give frequencies"):
        chain(LARGE, reduce=True).fit(T, F)


@pytest.mark.nightly
def test_clones_memory_and_refits_decide_alike(tmp_path):
    T, F = records(LARGE)
    fem = chain(LARGE).fit(T, F)
    stored = clone(fem).set_params(memory=str(tmp_path))
    for again in (clone(fem).fit(T, F), stored.fit(T, F), clone(stored).fit(T, F)):
        np.testing.assert_array_equal(predictions(again, T), predictions(fem, T))
    np.testing.assert_allclose(refitted(fem).predict(T), fem.predict(T), rtol=1e-4)


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


USUAL = np.exp(np.random.default_rng(1).normal(0, 1, (300, 1)) * [0.02, -0.01, 0.015, 0.01])


def with_surfaces(known=None):
    return Simulator.around(TRUSS, USUAL, 1e-5, known)


def test_many_rows_come_from_a_surface_and_the_others_are_counted():
    simulator = with_surfaces().damaged({"top": 0.2})
    later = np.vstack([np.repeat(USUAL, 4, axis=0), [[1.3, 1, 1, 1]], [[np.nan, 1, 1, 1]], 2 * USUAL[:3]])
    with pytest.warns(UserWarning, match="4 of .*outside-reduced-model"):
        found = simulator.frequencies(later)
    exact = simulator.model.frequencies(later[~np.isnan(later).any(axis=1)])
    np.testing.assert_allclose(found[~np.isnan(found).any(axis=1)], exact, rtol=1.5e-5)
    assert np.isnan(found[1201]).all()
    (surface,) = simulator._known.surfaces.values()
    counts = simulator.solved
    assert counts["surface"] >= 1150
    assert sum(counts.values()) == 1204 + surface.n_solves_
    assert counts["full"] == 4


def test_a_surface_does_not_depend_on_what_was_asked_before():
    rows = np.repeat(USUAL, 8, axis=0)
    one, other = with_surfaces(), with_surfaces()
    one.frequencies(rows[:900])
    one.frequencies(USUAL[:1])
    np.testing.assert_array_equal(one.frequencies(rows), pickle.loads(pickle.dumps(other)).frequencies(rows))
    np.testing.assert_array_equal(one.frequencies(rows[:100], n_rows=2400), other.frequencies(rows, n_rows=2400)[:100])


def test_few_rows_full_models_and_growing_damage_have_no_surface():
    few, exact = with_surfaces(), Simulator.around(TRUSS, USUAL, False)
    full = Simulator.around(TRUSS, USUAL, "auto")
    rows = np.repeat(USUAL, 10, axis=0)
    few.frequencies(USUAL)
    exact.frequencies(rows, n_rows=30_000)
    full.frequencies(rows)
    growing = few.with_damage_parameters(["top"], 0.0, 0.2)
    growing.frequencies(np.hstack([rows, np.full((3000, 1), 0.9)]))
    assert all(one.solved["surface"] == 0 for one in (few, exact, full, growing))
    np.testing.assert_allclose(full.frequencies(rows, n_rows=30_000), TRUSS.frequencies(rows), rtol=4e-6)
    assert full.solved["surface"] > 2900


def test_those_asked_for_last_are_kept(simulator, monkeypatch):
    severities = [0.1, 0.2, 0.3]
    one, two, three = (simulator.damaged({"top": severity}) for severity in severities)
    monkeypatch.setattr(_simulator, "MOST_KEPT", three.size + one.size)
    assert simulator.damaged({"top": 0.1}) is one
    assert simulator.damaged({"top": 0.3}) is three
    assert simulator.damaged({"top": 0.1}) is one
    assert simulator.damaged({"top": 0.2}) is not two
