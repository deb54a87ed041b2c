"""Mode shapes beside frequencies: posterior modes of frequencies and shapes, gaps, the chain."""

import pickle
import re
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import least_squares
from sklearn.base import clone

from skthermo.fem import AffineModel, CallableModel, evaluate_modes, sample, shape_components
from skthermo.surrogate import DataInformedFEM, PosteriorInverse
from skthermo.updating import identifiability
from tests.fem.frames import portal
from tests.surrogate.chains import TRUSS, YEAR

DOFS = [1, 3, 5, 7]
NOISE, SHAPE_NOISE = 0.001, 0.01
PRIOR = np.log(1.3 / 0.7) / np.sqrt(12)


def posterior(model=TRUSS, **options):
    defaults = {"noise": NOISE, "prior": PRIOR, "dofs": DOFS, "shape_noise": SHAPE_NOISE}
    inverse = PosteriorInverse(model, **(defaults | options))
    nominal = np.ones((1, len(model.parameter_names)))
    if inverse.dofs is None:
        return inverse.fit(model.frequencies(nominal))
    return inverse.fit(columns(*measured(nominal, model, inverse.dofs, noise=0, shape_noise=0)))


def measured(theta, model=TRUSS, dofs=DOFS, noise=NOISE, shape_noise=SHAPE_NOISE, seed=2):
    """Noisy frequencies (n_samples, n_modes) and shapes (n_samples, n_modes, n_sensors)."""
    rng = np.random.default_rng(seed)
    frequencies, shapes = evaluate_modes(model, theta, dofs)
    shapes = shapes.swapaxes(1, 2)
    size = np.sqrt((shapes**2).mean(axis=2, keepdims=True))
    frequencies = frequencies * (1 + noise * rng.standard_normal(frequencies.shape))
    return frequencies, shapes + shape_noise * size * rng.standard_normal(shapes.shape)


def columns(frequencies, shapes):
    return np.hstack([frequencies, shapes.reshape(len(shapes), -1)])


def drawn(n_rows, half_width=0.2, seed=1, model=TRUSS):
    return sample(model, half_width, n_rows, random_state=seed).theta


INVERSE = posterior()
THETA = drawn(40)
MEASURED = measured(THETA)
X = columns(*MEASURED)


def test_exact_rows_come_back_from_shapes_alone_and_from_both():
    """Shapes tell everything but the common factor of all stiffnesses, which the fixed bars set here."""
    theta = drawn(30)
    exact = columns(*measured(theta, noise=0, shape_noise=0))
    inverse = posterior(noise=1e-6, shape_noise=1e-6)
    for X in (exact, np.where(np.arange(exact.shape[1]) < 6, np.nan, exact)):
        found = inverse.invert(X)
        assert found.converged.all()
        np.testing.assert_allclose(found.theta, theta, rtol=1e-3)


def test_estimates_are_what_an_independent_optimiser_finds():
    F, shapes = MEASURED
    found = INVERSE.invert(X[:3])

    def residuals(x, f, u):
        frequencies, phi = evaluate_modes(TRUSS, np.exp(x)[np.newaxis], DOFS)
        v = phi[0].T / np.linalg.norm(phi[0].T, axis=1, keepdims=True)
        v *= np.sign((u * v).sum(axis=1, keepdims=True))
        return np.concatenate([np.log(f / frequencies[0]) / NOISE, 2 * ((u - v) / SHAPE_NOISE).ravel(), x / PRIOR])

    for i in range(3):
        u = shapes[i] / np.linalg.norm(shapes[i], axis=1, keepdims=True)
        best = least_squares(residuals, np.zeros(4), args=(F[i], u), xtol=1e-12, ftol=1e-12)
        np.testing.assert_allclose(np.log(found.theta[i]), best.x, atol=3e-3 * found.std[i].max())
        expected = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
        np.testing.assert_allclose(found.std[i] / found.theta[i], expected, rtol=0.01)


def test_errors_are_those_that_cramer_rao_allows():
    """With a wide prior, posterior modes scatter as `identifiability` says, by far less than without shapes."""
    theta = np.tile([1.0, 0.97, 1.02, 1.01], (300, 1))
    found = posterior(prior=1.0).invert(columns(*measured(theta)))
    known = identifiability(TRUSS, theta[0], noise=NOISE, dofs=DOFS, shape_noise=SHAPE_NOISE).deviations
    np.testing.assert_allclose(np.log(found.theta / theta).std(axis=0) / known, 1, atol=0.12)
    alone = identifiability(TRUSS, theta[0], noise=NOISE).deviations
    assert known["vertical"] < 0.6 * alone["vertical"]


def test_rows_do_not_depend_on_other_rows_nor_on_scale_and_sign():
    rows = X[:20]
    whole, deviations = INVERSE.transform(rows, return_std=True)
    single = np.vstack([INVERSE.transform(row[np.newaxis]) for row in rows])
    assert (np.abs(single - whole) < 1e-3 * deviations).all()  # the share of the deviation at which steps end
    factors = np.random.default_rng(0).choice([-3.0, 0.2, 50.0], (20, 6))
    turned = np.hstack([rows[:, :6], rows[:, 6:] * np.repeat(factors, len(DOFS), axis=1)])
    assert (np.abs(INVERSE.transform(turned) - whole) < 1e-3 * deviations).all()


def test_modes_that_exchange_their_shapes_are_found():
    """Two coupled masses: where their frequencies meet, each mode turns into the other within a few percent."""
    stiffness = {("a",): np.diag([400.0, 0.0]), ("b",): np.diag([0.0, 420.0]), (): 8.0 * np.array([[1, -1], [-1, 1]])}
    model = AffineModel(stiffness, np.eye(2), n_modes=2, track=True)
    theta = drawn(300, 0.3, model=model)
    found = posterior(model, dofs=[0, 1]).invert(columns(*measured(theta, model, [0, 1])))
    assert found.converged.all()
    assert (np.abs(np.log(found.theta / theta)) < 0.02).all()


def test_missing_modes_and_missing_shapes_are_left_out():
    F, shapes = (array.copy() for array in MEASURED)
    complete = INVERSE.invert(X)
    no_shapes = INVERSE.invert(columns(F, np.full_like(shapes, np.nan)))
    alone = posterior(dofs=None).invert(F)
    assert (np.abs(no_shapes.theta - alone.theta) < 2e-3 * alone.std).all()
    np.testing.assert_allclose(no_shapes.std, alone.std, rtol=1e-3)
    assert (no_shapes.weight < complete.weight).all()
    np.testing.assert_allclose(complete.weight, 1)
    shapes[:, 2, 1] = np.nan  # one sensor in one mode
    some = INVERSE.invert(columns(F, shapes))
    assert (complete.weight > some.weight).all()
    assert (some.weight > no_shapes.weight).all()
    F[0], shapes[0] = np.nan, np.nan
    assert np.isnan(INVERSE.transform(columns(F, shapes))[0]).all()
    assert not np.isnan(INVERSE.transform(columns(F, shapes))[1:]).any()


@pytest.mark.nightly
def test_reduced_models_and_stored_inversions_give_the_same(tmp_path):
    model = portal(n_modes=3, track=True).with_parameters(["columns", "beams"])
    dofs = [40, 100, 160, 220]
    theta = drawn(12, 0.1, model=model)
    X = columns(*measured(theta, model, dofs))
    options = {"dofs": dofs, "noise": NOISE, "prior": 0.1, "shape_noise": SHAPE_NOISE}
    full = PosteriorInverse(model, reduce=False, **options).fit_transform(X)
    for _ in range(2):
        stored = PosteriorInverse(model, reduce=1e-6, memory=str(tmp_path), **options).fit(X)
        assert stored.simulator_.reduced is not None
        np.testing.assert_allclose(stored.transform(X), full, rtol=1e-4)


def test_clones_pickles_and_names():
    frame = pd.DataFrame(X[:5]).add_prefix("x")
    fitted = clone(INVERSE).fit(frame)
    assert list(fitted.transform(frame)) == list(TRUSS.parameter_names)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(fitted)).transform(frame), fitted.transform(frame))
    back = fitted.inverse_transform(pd.DataFrame(THETA[:5], columns=list(TRUSS.parameter_names)))
    assert list(back) == list(frame)
    clean = shape_components(measured(THETA[:5], shape_noise=0)[1], fitted.shape_inputs_.reference)
    np.testing.assert_allclose(back.to_numpy()[:, 6:], clean, atol=1e-9)


BEAM = AffineModel({("a",): np.diag([1.0, 0.0]), ("b",): np.diag([0.0, 2.0])}, np.eye(2), n_modes=2)
PROGRAM = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6)


@pytest.mark.parametrize(
    ("model", "options", "X", "message"),
    [
        (TRUSS, {"dofs": [1, 99]}, X, "dofs holds 99; expected 0 to 22"),
        (TRUSS, {"shape_noise": [0.01, 0.0]}, X, r"\[0.01 0.  \]; expected a relative standard deviation"),
        (PROGRAM, {}, X, "has no method 'modes'; expected a model that"),
        (TRUSS, {}, MEASURED[0], r"X has 6 columns; expected the 6 modes of .* at 4 sensors, 30 columns"),
        (BEAM, {"dofs": [0]}, np.ones((3, 4)), r"mode 1 does not move the degrees of freedom \[0\]"),
    ],
)
def test_impossible_shapes_are_named(model, options, X, message):
    with pytest.raises(ValueError, match=message):
        PosteriorInverse(model, **({"dofs": DOFS} | options)).fit(X)


WEATHER = YEAR.temperatures
LAW = np.exp(-0.002 * (WEATHER.to_numpy()[:, [0, 1, 2, 1]] - 20))


@pytest.mark.nightly
def test_the_chain_learns_weak_parameters_from_shapes():
    F, shapes = measured(LAW, seed=3)
    F, rng = pd.DataFrame(F, index=WEATHER.index, columns=list(YEAR.frequencies)), np.random.default_rng(4)
    shapes = shapes * rng.uniform(0.1, 9, (len(F), 6, 1)) * np.exp(1j * rng.uniform(0, 6, (len(F), 6, 1)))
    shapes[:20] = np.nan
    inverses = PosteriorInverse(noise=NOISE), PosteriorInverse(noise=NOISE, dofs=DOFS)
    alone, chain = (DataInformedFEM(TRUSS, inverse=one, aligner="passthrough", random_state=0) for one in inverses)
    alone.fit(WEATHER, F)
    chain.fit(WEATHER, F, shapes=shapes)
    for learned in (lambda fem: fem.parameters_, lambda fem: fem.predict_parameters(WEATHER)):
        errors = [np.abs(np.log(learned(fem) / LAW)).mean()["vertical"] for fem in (chain, alone)]
        assert errors[0] < errors[1]
    clean = TRUSS.frequencies(LAW)
    errors = [np.abs(fem.predict(WEATHER) / clean - 1).to_numpy().mean() for fem in (chain, alone)]
    assert errors[0] < 1.1 * errors[1] < 5e-4
    pd.testing.assert_frame_equal(chain.estimate_parameters(F, shapes), chain.parameters_)
    assert chain.estimate_parameters(F).notna().all(axis=None)  # from frequencies alone
    assert len(chain.recorder_.residuals.values) == len(F)


def test_the_chain_names_shapes_that_are_missing_or_not_wanted():
    T, (F, shapes) = WEATHER[:60], measured(LAW[:60])
    with pytest.raises(ValueError, match="the inverse has no dofs; expected PosteriorInverse"):
        DataInformedFEM(TRUSS).fit(T, F, shapes=shapes)
    chain = DataInformedFEM(TRUSS, inverse=PosteriorInverse(dofs=DOFS))
    with pytest.raises(ValueError, match=r"expected fit\(T, F, shapes=shapes\)"):
        chain.fit(T, F)
    with pytest.raises(ValueError, match="shapes have 9 rows and frequencies 60"):
        chain.fit(T, F, shapes=shapes[:9])


N_CHANGED = 100


def chain_of(change):
    """What a chain warns of that is fitted to measured shapes that are changed."""
    air = np.linspace(-5, 30, N_CHANGED)[:, np.newaxis]
    frequencies, shapes = measured(1 - 0.003 * (air - 10) * [1.0, 0.7, 0.3, 1.3])
    inverse = PosteriorInverse(noise=NOISE, dofs=DOFS)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        DataInformedFEM(TRUSS, inverse=inverse, random_state=0).fit(air, frequencies, shapes=change(shapes))
    return [str(one.message) for one in caught]


def test_right_shapes_of_any_scale_and_phase_give_no_warning_and_a_failed_sensor_is_counted():
    turned = np.exp(1j * np.arange(N_CHANGED))[:, np.newaxis, np.newaxis]
    assert chain_of(lambda shapes: 3 * shapes * turned) == []
    message = chain_of(lambda shapes: np.where(np.arange(4) == 2, np.nan, shapes))[0]
    assert message.startswith("most measured modes lack a component of their shape at some sensor")


@pytest.mark.nightly
@pytest.mark.parametrize(
    "change",
    [
        lambda shapes: shapes * np.array([1.0, 1.0, 1.5, 1.0]),
        lambda shapes: shapes * np.array([1.0, -1.0, 1.0, 1.0]),
        lambda shapes: shapes[:, :, [0, 1, 3, 2]],
        lambda shapes: shapes[:, [1, 0, 2, 3, 4, 5]],
    ],
    ids=["gain", "sign", "sensors swapped", "modes swapped"],
)
def test_shapes_of_other_sensors_are_named(change):
    texts = chain_of(change)
    named = r"measured shapes of 'f\d' are unlike those of the model .*doubtful-shapes"
    assert any(re.search(named, text) for text in texts)
