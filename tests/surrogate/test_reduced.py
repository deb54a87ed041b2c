"""Laws of chains on reduced models: what is reduced, that results stay the same, and that the report says so."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge

from skthermo.fem import AffineModel, CallableModel
from skthermo.fem.affine import ReducedModel
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from tests.fem.frames import portal
from tests.surrogate.chains import TRUSS

FRAME, NOISE = portal(4), 0.001
PROGRAM = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, TRUSS.n_modes, vectorized=True)


def measured(model, theta):
    """Air temperatures that rise with the rows of theta, and frequencies there."""
    stamps, n_rows = pd.date_range("2025", periods=len(theta), freq="D"), len(theta)
    F = model.frequencies(theta) * (1 + NOISE * np.random.default_rng(1).standard_normal((n_rows, model.n_modes)))
    return pd.DataFrame({"T": np.linspace(0, 30, n_rows)}, stamps), pd.DataFrame(F, stamps).add_prefix("f")


def records(model=FRAME, lowest=0.95, highest=1.05, n_rows=40):
    """Of a structure that warmth softens from one stiffness to the other."""
    powers = np.random.default_rng(0).uniform(0.5, 1.0, len(model.parameter_names))
    return measured(model, np.linspace(highest, lowest, n_rows)[:, np.newaxis] ** powers)


def chain(model=FRAME, **options):
    return DataInformedFEM(model, mapper=TemperatureMapper(Ridge()), random_state=0, **options)


def inverse(**options):
    return PosteriorInverse(FRAME, noise=NOISE, prior=0.06, **options)


def predictions(fem, T):
    damage = dict.fromkeys(list(fem.model.groups)[:1], 0.2)
    return np.hstack([fem.predict_parameters(T), fem.predict(T), fem.simulate(T, damage=damage)])


def is_same(found, other):
    """Whether estimates differ by less than a small part of their standard deviations."""
    return bool((np.abs(found.theta - other.theta) < 0.02 * other.std).to_numpy().all())


@pytest.mark.nightly
def test_a_large_model_is_reduced_and_nothing_changes_but_the_time():
    T, F = records(n_rows=60)
    auto, reduced, full = (chain(reduce=reduce).fit(T, F) for reduce in ("auto", True, False))
    np.testing.assert_array_equal(predictions(auto, T), predictions(reduced, T))
    np.testing.assert_allclose(auto.predict(T), full.predict(T), rtol=3e-5)
    assert f"a reduced model of {auto.simulator_.reduced.basis_size_} coordinates" in repr(auto.report_)
    assert "Solved by the full model" in repr(full.report_)
    assert reduced.simulator_.reduced is reduced.inverse_.simulator_.reduced is not None
    assert reduced.report_.parameters.n_by_full_model == 0
    own = chain(reduce=True).set_params(inverse__reduce=False).fit(T, F)
    assert own.inverse_.simulator_.reduced is None
    assert own.simulator_.reduced is not None


@pytest.mark.one_case
@pytest.mark.parametrize("model", [TRUSS, PROGRAM], ids=["small", "program"])
def test_what_a_reduced_model_would_not_speed_up_stays_full(model):
    T, F = records(model, n_rows=60)
    auto, full = (chain(model, reduce=reduce).fit(T, F) for reduce in ("auto", False))
    np.testing.assert_array_equal(auto.predict(T), full.predict(T))
    assert auto.simulator_.reduced is None
    assert "Solved by the full model" in repr(auto.report_)


def test_the_decision_is_monotone_in_rows_and_in_size():
    rows = np.unique(np.logspace(0, 6, 40).astype(int))
    table = np.array([[model.reduction_pays(int(n)) for n in rows] for model in map(portal, (1, 3, 5, 16, 40))])
    assert (np.diff(table.astype(int), axis=0) >= 0).all()
    assert (np.diff(table.astype(int), axis=1) >= 0).all()
    assert not table[0].any()
    assert not table[:, 0].any()
    assert table[-1, -1]


def simulator_of(theta, reduce):
    """The simulator of a chain whose records are those of the truss at rows of theta."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of records that only serve as an example
        return chain(TRUSS, reduce=reduce).fit(*measured(TRUSS, theta[np.argsort(theta[:, 0])])).simulator_


CHANGES = [
    *(lambda one, group=group, lost=lost: one.damaged({group: lost}) for group, lost in (("top", 0.1), ("top", 0.2))),
    lambda one: one.damaged({"bottom": 0.1}),
    lambda one: one.changed("with_modes", [0, 1, 2]),
    *(lambda one, mass=mass: one.changed("with_added", stiffness=None, mass=mass * np.eye(23)) for mass in (1, 2)),
    *(lambda one, most=most: one.with_damage_parameters(["top"], 0.0, most) for most in (0.2, 0.3)),
    lambda one: one.with_damage_parameters(["bottom"], 0.0, 0.2),
]


def test_changes_are_those_of_the_model():
    theta = np.random.default_rng(0).uniform(0.92, 1.08, (5, 4))
    simulator = simulator_of(np.random.default_rng(2).uniform(0.9, 1.1, (60, 1)) ** [1.0, 0.5, 0.8, 0.6], 1e-6)
    for change in CHANGES:
        made = change(simulator)
        rows = np.hstack([theta, np.full((5, len(made.box) - 4), 0.95)])
        np.testing.assert_allclose(made.frequencies(rows), made.model.frequencies(rows), rtol=1e-6)
        np.testing.assert_array_equal(made.frequencies(rows), change(simulator).frequencies(rows))


def test_most_of_many_rows_come_from_a_surface(monkeypatch):
    usual = np.exp(np.random.default_rng(1).normal(0, 1, (300, 1)) * [0.02, -0.01, 0.015, 0.01])
    simulator = simulator_of(usual, 1e-5).damaged({"top": 0.2})
    later = np.vstack([np.repeat(usual, 8, axis=0), [[1.3, 1, 1, 1]], [[np.nan, 1, 1, 1]], 2 * usual[:3]])
    exact = simulator.model.frequencies(later[~np.isnan(later).any(axis=1)])
    numbers, solve = [], AffineModel.frequencies
    monkeypatch.setattr(
        AffineModel, "frequencies", lambda self, theta: [numbers.append(len(theta)), solve(self, theta)][1]
    )
    found = simulator.frequencies(later)
    assert sum(numbers) < len(later) / 3
    np.testing.assert_allclose(found[~np.isnan(found).any(axis=1)], exact, rtol=1.5e-5)
    assert np.isnan(found[2401]).all()


@pytest.mark.nightly
def test_the_box_is_where_records_are():
    F = records(lowest=0.7, highest=0.95, n_rows=20)[1]
    found, exact = (inverse(reduce=reduce).fit(F) for reduce in (True, False))
    theta = exact.transform(F).to_numpy()
    assert not found.simulator_.outside(theta).any()
    assert np.abs(np.log(found.simulator_.box / np.array([theta.min(axis=0), theta.max(axis=0)]).T)).max() < 0.3
    assert not found.invert(F).by_full_model.any()
    assert is_same(found.invert(F), exact.invert(F))


def test_rows_that_end_outside_the_box_are_solved_by_the_full_model_and_counted():
    usual = records(n_rows=12)[1]
    F = usual.copy()
    F.iloc[[4, 7, 9]] = FRAME.frequencies(np.full((3, 4), 0.7))
    reduced, exact = inverse(reduce=True).fit(usual), inverse(reduce=False).fit(usual).invert(F)
    found = reduced.invert(F)
    outside = reduced.simulator_.outside(found.theta.to_numpy())
    np.testing.assert_array_equal(np.flatnonzero(outside), [4, 7, 9])
    np.testing.assert_array_equal(found.by_full_model, outside)
    assert is_same(found, exact)


@pytest.mark.nightly
def test_where_no_basis_is_accurate_the_full_model_is_solved(monkeypatch):
    def refuse(self, bounds, **options):
        raise RuntimeError("after 4 rounds, errors are larger")

    for cls in (AffineModel, ReducedModel):
        monkeypatch.setattr(cls, "reduced", refuse)
    T, F = records(lowest=0.7, n_rows=20)
    with pytest.warns(UserWarning, match="(?s).*"):
        fem = chain(inverse=inverse(), aligner="passthrough", discrepancy=None, reduce=True).fit(T, F)
    assert "no reduced model is accurate" in fem.report_.solved
    assert fem.inverse_.simulator_.reduced is fem.simulator_.reduced is None
    assert fem.report_.parameters.n_by_full_model == 0  # beside a reduced model
    assert is_same(fem.inverse_.invert(F), inverse(reduce=False).fit(F).invert(F))
    np.testing.assert_allclose(fem.predict(T), FRAME.frequencies(fem.predict_parameters(T)), rtol=1e-9)
