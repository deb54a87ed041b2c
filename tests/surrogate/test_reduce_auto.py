"""Laws of ``reduce="auto"``: what is reduced, that results stay the same, and that the report says so."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, CallableModel
from skthermo.surrogate import DataInformedFEM, TemperatureMapper
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


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*few-records")
def test_an_inverse_follows_the_chain_unless_it_says_otherwise():
    T, F = records(LARGE, 12)
    assert chain(LARGE, reduce=True).fit(T, F).inverse_.reduce is True
    assert chain(LARGE, reduce=False).fit(T, F).inverse_.reduce is False
    own = chain(LARGE, reduce=True).set_params(inverse__reduce=False).fit(T, F)
    assert own.inverse_.simulator_.reduced is None
    assert own.simulator_.reduced is not None


TRUSS = make_truss()
THETA = np.random.default_rng(0).uniform(0.92, 1.08, (5, 4))


def simulator_of(theta, reduce):
    """The simulator of a chain whose records are those of the truss at rows of theta."""
    share = np.linspace(0, 1, len(theta))[:, np.newaxis]
    order = np.argsort(theta[:, 0])
    stamps = pd.date_range("2025", periods=len(theta), freq="D")
    F = pd.DataFrame(TRUSS.frequencies(theta[order]), stamps).add_prefix("f")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of records that only serve as an example
        return chain(TRUSS, reduce=reduce).fit(pd.DataFrame(30 * share, stamps, ["T"]), F).simulator_


@pytest.fixture(scope="module")
def simulator():
    return simulator_of(np.random.default_rng(2).uniform(0.9, 1.1, (60, 1)) ** [1.0, 0.5, 0.8, 0.6], 1e-6)


CHANGES = [
    lambda one: one.damaged({"bottom": 0.1}),
    lambda one: one.damaged({"bottom": 0.2}),
    lambda one: one.damaged({"top": 0.1}),
    lambda one: one.changed("with_modes", [0, 1, 2]),
    lambda one: one.changed("with_added", stiffness=None, mass=np.eye(TRUSS.n_dof)),
    lambda one: one.changed("with_added", stiffness=None, mass=2 * np.eye(TRUSS.n_dof)),
    lambda one: one.with_damage_parameters(["top"], 0.0, 0.2),
    lambda one: one.with_damage_parameters(["top"], 0.0, 0.3),
    lambda one: one.with_damage_parameters(["bottom"], 0.0, 0.2),
]


@pytest.mark.parametrize("change", CHANGES)
def test_changes_are_those_of_the_model(simulator, change):
    made = change(simulator)
    theta = np.hstack([THETA, np.full((5, len(made.box) - 4), 0.95)])
    np.testing.assert_allclose(made.frequencies(theta), made.model.frequencies(theta), rtol=1e-6)
    np.testing.assert_array_equal(made.frequencies(theta), change(simulator).frequencies(theta))


USUAL = np.exp(np.random.default_rng(1).normal(0, 1, (300, 1)) * [0.02, -0.01, 0.015, 0.01])


def solved_rows(monkeypatch):
    """Numbers of rows that models solve, noted from here on."""
    numbers, solve = [], AffineModel.frequencies

    def noted(self, theta):
        numbers.append(len(theta))
        return solve(self, theta)

    monkeypatch.setattr(AffineModel, "frequencies", noted)
    return numbers


def test_most_of_many_rows_come_from_a_surface(monkeypatch):
    simulator = simulator_of(USUAL, 1e-5).damaged({"top": 0.2})
    later = np.vstack([np.repeat(USUAL, 8, axis=0), [[1.3, 1, 1, 1]], [[np.nan, 1, 1, 1]], 2 * USUAL[:3]])
    numbers = solved_rows(monkeypatch)
    found = simulator.frequencies(later)
    assert sum(numbers) < len(later) / 3
    exact = simulator.model.frequencies(later[~np.isnan(later).any(axis=1)])
    np.testing.assert_allclose(found[~np.isnan(found).any(axis=1)], exact, rtol=1.5e-5)
    assert np.isnan(found[2401]).all()


@pytest.mark.nightly
def test_few_rows_full_models_and_growing_damage_have_no_surface(monkeypatch):
    few, exact = simulator_of(USUAL, 1e-5), simulator_of(USUAL, False)
    rows = np.repeat(USUAL, 10, axis=0)
    growing = few.with_damage_parameters(["top"], 0.0, 0.2)
    for simulator, theta in (
        (few, USUAL),
        (exact, rows),
        (growing, np.hstack([rows, np.full((3000, 1), 0.9)])),
    ):
        numbers = solved_rows(monkeypatch)
        simulator.frequencies(theta)
        assert sum(numbers) == len(theta)
