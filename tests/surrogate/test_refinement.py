"""Laws of refined estimates: exact inversion, posterior modes, gaps, models that fail."""

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import least_squares, lsq_linear
from sklearn.dummy import DummyRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.neighbors import KNeighborsRegressor

from skthermo.datasets import make_truss_campaign
from skthermo.fem import AffineModel, CallableModel, linearise
from skthermo.metrics import mape
from skthermo.surrogate import DataInformedFEM, InverseSurrogate
from skthermo.surrogate.inverse._refinement import SMALL_STEP, Local, Prior
from tests.fem.frames import FRAME, portal
from tests.surrogate.chains import TRUSS, F, T

LOWEST, HIGHEST = 0.7, 1.3
SPRING = AffineModel({("k",): [[400.0]]}, [[1.0]], n_modes=1)


def surrogate(model=TRUSS, regressor=None, **options):
    return InverseSurrogate(model, regressor or Ridge(), **({"n_samples": 100, "random_state": 0} | options)).fit()


def drawn(n_rows, n_parameters=4, seed=1, lowest=LOWEST, highest=HIGHEST):
    return np.random.default_rng(seed).uniform(lowest, highest, (n_rows, n_parameters))


def noisy(theta, noise, seed=2, model=TRUSS):
    return model.frequencies(theta) * (1 + noise * np.random.default_rng(seed).standard_normal((len(theta), 6)))


def oscillators(*stiffness, track):
    """Masses on springs of their own: the frequency of one depends on one parameter."""
    names = [f"k{i}" for i in range(len(stiffness))]
    terms = {(name,): np.diag(np.where(np.arange(len(names)) == i, stiffness, 0)) for i, name in enumerate(names)}
    return AffineModel(terms, np.eye(len(names)), n_modes=len(names), track=track)


def holed(frequencies, share, seed=3):
    """Frequencies with modes missing at random, at least one left in each row."""
    rng = np.random.default_rng(seed)
    missing = rng.random(frequencies.shape) < share
    missing[np.arange(len(missing)), rng.integers(frequencies.shape[1], size=len(missing))] = False
    return np.where(missing, np.nan, frequencies)


# Exact inversion


@pytest.mark.one_case
@pytest.mark.parametrize("regressor", [DummyRegressor(), Ridge(), KNeighborsRegressor(1)])
def test_noise_free_rows_come_back_from_any_regressor(regressor):
    theta = drawn(300)
    found = surrogate(regressor=regressor).invert(TRUSS.frequencies(theta))
    assert found.converged.all()
    np.testing.assert_allclose(found.theta, theta, rtol=3e-6)
    np.testing.assert_allclose(found.residuals, 0, atol=3e-7)


def test_rows_far_outside_the_box_come_back():
    theta = drawn(50, lowest=0.6, highest=1.6)
    found = surrogate(regressor=DummyRegressor(), bounds=0.2).invert(TRUSS.frequencies(theta))
    np.testing.assert_allclose(found.theta, theta, rtol=1e-5)


def test_estimates_stay_within_three_half_widths_of_the_box():
    found = surrogate(SPRING, bounds=0.2).invert(SPRING.frequencies([[0.01], [100.0]]))
    half = np.log(1.2 / 0.8) / 2
    np.testing.assert_allclose(np.log(found.theta[:, 0]), 3 * half * np.array([-1, 1]))
    assert found.converged.all()


def test_tracked_modes_that_swap_come_back():
    model = oscillators(400.0, 420.0, track=True)
    theta = drawn(100, 2)
    solved = model.frequencies(theta)
    assert 0.2 < (solved[:, 0] > solved[:, 1]).mean() < 0.8
    np.testing.assert_allclose(surrogate(model, DummyRegressor()).transform(solved), theta, rtol=1e-7)


@pytest.mark.filterwarnings("ignore:.*modes-cross")
@pytest.mark.parametrize("regressor", [DummyRegressor(), Ridge()])
def test_sorted_modes_that_cross_give_one_of_both_solutions(regressor):
    stiffness = np.array([400.0, 420.0])
    solved = oscillators(*stiffness, track=False).frequencies(drawn(200, 2))
    theta = surrogate(oscillators(*stiffness, track=False), regressor).transform(solved)
    squared = (2 * np.pi * solved) ** 2
    both = np.stack([squared / stiffness, squared[:, ::-1] / stiffness])
    np.testing.assert_allclose((np.abs(theta / both - 1).max(axis=2)).min(axis=0), 0, atol=1e-6)


@pytest.mark.filterwarnings("ignore:.*modes-cross")
def test_sorted_modes_beyond_a_crossing_come_back():
    """A third mode tells the order of two that cross: steps from the other side of the crossing must get past it."""
    terms = {("k0",): np.diag([400.0, 0.0, 900.0]), ("k1",): np.diag([0.0, 420.0, 300.0])}
    model, theta = AffineModel(terms, np.eye(3), n_modes=3, track=False), drawn(200, 2, lowest=0.9, highest=1.1)
    found = surrogate(model, DummyRegressor()).invert(model.frequencies(theta))
    assert found.converged.all()
    np.testing.assert_allclose(found.theta, theta, rtol=1e-6)


def test_near_modes_that_do_not_cross_cost_one_more_solve_at_most():
    """Noise leaves a misfit in most records, and the fourth and fifth mode are within 10 %, but never exchanged."""
    measured = noisy(drawn(200, lowest=0.95, highest=1.05), 0.005)
    found = surrogate(bounds=0.2, noise=0.005, n_samples=500).invert(measured)
    assert found.converged.all()
    assert np.median(found.solves) <= 3
    again = surrogate(regressor=DummyRegressor(), bounds=0.2, noise=0.005, n_samples=500).invert(measured)
    np.testing.assert_allclose(found.theta, again.theta, rtol=1e-3)


def test_steps_that_raise_the_misfit_are_not_taken():
    """Full Gauss-Newton steps on an arctangent jump to and fro between its flat ends."""
    model = CallableModel(lambda theta: 5 * np.exp(0.1 * np.arctan(np.log(theta) / 0.05)), ["k"], 1)
    highest = DummyRegressor(strategy="quantile", quantile=1.0)
    found = surrogate(model, highest, refine=50).invert([[5.0]])
    np.testing.assert_allclose(found.theta, 1, rtol=1e-6)
    assert found.converged.all()


def test_a_step_beyond_a_limit_is_the_best_one_within_it():
    rng = np.random.default_rng(0)
    sensitivity, residual = 0.1 * rng.standard_normal((50, 6, 3)), 0.005 * rng.standard_normal((50, 6))
    gradient = -np.einsum("smp,sm->sp", sensitivity, residual)
    hessian = sensitivity.swapaxes(1, 2) @ sensitivity
    prior = Prior(np.zeros(3), np.ones(3), np.array([-0.02, -9.0, -9.0]), np.array([0.02, 9.0, 9.0]))
    here = Local(np.zeros((50, 3)), np.zeros(50), gradient, hessian, residual, sensitivity)
    limits = prior.lowest, prior.highest
    expected = [lsq_linear(a, b, limits, tol=1e-14).x for a, b in zip(sensitivity, residual, strict=True)]
    assert 10 < (np.abs(np.array(expected)[:, 0]) > 0.0199).sum() < 40
    np.testing.assert_allclose(here.step(prior, np.zeros(50)), expected, atol=1e-6)


# Posterior mode


@pytest.mark.parametrize("prior", [None, 0.05, [0.05], {"k": 0.05}])
def test_posterior_of_a_spring_is_gaussian(prior):
    """ln f = constant + ln theta / 2, so that the posterior of ln theta combines two Gaussians."""
    noise, width = 0.02, np.log(HIGHEST / LOWEST) / np.sqrt(12) if prior is None else 0.05
    measured = SPRING.frequencies([[0.8], [1.0], [1.25]])
    found = surrogate(SPRING, noise=noise, prior=prior, bounds=(HIGHEST - LOWEST) / 2).invert(measured)
    likeliest = 2 * np.log(measured / SPRING.frequencies([[1.0]]))
    precision = 0.25 / noise**2 + 1 / width**2
    mode = 0.25 / noise**2 * likeliest / precision
    np.testing.assert_allclose(np.log(found.theta), mode, atol=1e-5 / np.sqrt(precision))
    np.testing.assert_allclose(found.std, found.theta / np.sqrt(precision), rtol=1e-8)


def test_prior_of_a_box_is_about_its_middle_with_the_variance_of_logarithms_spread_evenly():
    prior = Prior.of_box(np.array([[0.5, 1.5], [0.9, 1.2]]))
    for parameter, (lowest, highest) in enumerate([(0.5, 1.5), (0.9, 1.2)]):
        logarithms = np.linspace(np.log(lowest), np.log(highest), 100_001)
        assert np.exp(prior.mean[parameter]) == pytest.approx((lowest + highest) / 2)
        assert prior.width[parameter] == pytest.approx(logarithms.std(), rel=1e-4)


def test_rows_that_tell_nothing_about_a_parameter_give_its_nominal_value():
    """Otherwise gaps in the records would bias whatever learns from all rows."""
    measured = TRUSS.frequencies(np.ones((1, 4)))
    measured[:, 1:] = np.nan
    found = surrogate(noise=0.01).invert(measured)
    np.testing.assert_allclose(found.theta, 1, atol=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_posterior_mode_is_the_one_that_scipy_finds(share):
    noise, width = 0.003, 0.1
    measured = holed(noisy(drawn(8), noise), share)
    found = surrogate(noise=noise, prior=width).invert(measured)
    for row, theta, std in zip(measured, found.theta, found.std, strict=True):
        known = ~np.isnan(row)

        def deviations(x, row=row, known=known):
            misfit = np.log(row / TRUSS.frequencies(np.exp(x)[np.newaxis])[0])[known] / noise
            return np.append(misfit, x / width)

        oracle = least_squares(deviations, np.zeros(4), jac="3-point", xtol=1e-12, ftol=1e-12, gtol=1e-12)
        laplace = np.sqrt(np.diag(np.linalg.inv(oracle.jac.T @ oracle.jac)))
        assert (np.abs(np.log(theta) - oracle.x) < 0.003 * laplace).all()
        np.testing.assert_allclose(std / theta, laplace, rtol=1e-3)


def test_intervals_hold_the_truth_though_half_of_the_modes_are_missing():
    theta = drawn(500)
    inverse = surrogate(noise=0.002)
    for share in (0.0, 0.5):
        mean, std = inverse.predict(holed(noisy(theta, 0.002), share), return_std=True)
        assert 0.85 <= (np.abs(mean - theta) < 1.645 * std).mean() <= 0.95


def test_a_row_does_not_depend_on_the_others():
    measured, inverse = holed(noisy(drawn(60), 0.01), 0.3), surrogate(noise=0.01)
    whole, order = inverse.invert(measured), np.random.default_rng(0).permutation(60)
    for rows in (order, order[:7], order[:1]):
        part = inverse.invert(measured[rows])
        for name in ("theta", "std", "weight", "residuals", "converged"):
            np.testing.assert_allclose(part[name], whole[name][rows], rtol=1e-9, atol=1e-12)


def test_order_of_the_columns_of_a_tracked_model_does_not_matter():
    model, order = oscillators(400.0, 420.0, 800.0, track=True), [2, 0, 1]
    theta = drawn(30, 3)
    measured = holed(model.frequencies(theta) * (1 + 0.01 * np.random.default_rng(0).standard_normal((30, 3))), 0.2)
    first, second = (
        surrogate(each, DummyRegressor(), noise=0.01).invert(columns)
        for each, columns in ((model, measured), (model.with_modes(order), measured[:, order]))
    )
    np.testing.assert_allclose(second.theta, first.theta, rtol=1e-9)
    np.testing.assert_allclose(second.residuals, first.residuals[:, order], atol=1e-9)


def test_parallel_jobs_give_the_same_bits():
    measured = holed(noisy(drawn(300), 0.01), 0.1)
    one, two = (surrogate(noise=0.01, n_jobs=n_jobs).invert(measured) for n_jobs in (1, 2))
    for name in ("theta", "std", "residuals"):
        np.testing.assert_array_equal(two[name], one[name])


@pytest.mark.parametrize("model", [portal(track=True), CallableModel(FRAME.frequencies, list("abcd"), 6)])
def test_derivatives_in_parallel_are_the_same(model):
    theta = drawn(3)
    theta[1, 2] = np.nan
    for one, two in zip(linearise(model, theta, n_jobs=1), linearise(model, theta, n_jobs=2), strict=True):
        np.testing.assert_array_equal(two, one)


# Gaps


def test_fewer_modes_make_estimates_less_sure():
    complete = noisy(drawn(20), 0.005)
    gaps = complete.copy()
    gaps[:10, 1], gaps[10:15] = np.nan, np.nan
    inverse = surrogate(noise=0.005)
    full, found = inverse.invert(complete), inverse.invert(gaps)
    assert (full.weight == 1).all()
    assert (found.std[:10].mean(axis=0) > full.std[:10].mean(axis=0)).all()
    assert ((found.weight[:10] > 0) & (found.weight[:10] < 1)).all()
    assert np.isnan(found.residuals[:10, 1]).all()
    np.testing.assert_array_equal(found.weight[10:], [0] * 5 + [1] * 5)
    np.testing.assert_array_equal(np.isnan(found.theta).all(axis=1), [False] * 10 + [True] * 5 + [False] * 5)
    empty = inverse.invert(np.full((3, 6), np.nan))
    assert np.isnan(empty.theta).all()
    assert not empty.weight.any()
    assert not empty.converged.any()


def test_weight_of_a_parameter_without_its_mode_is_that_of_the_prior():
    """Of two oscillators one is missing: its parameter deviates as the prior, the other as with all modes."""
    model, noise, width = oscillators(400.0, 900.0, track=True), 0.01, 0.1
    found = surrogate(model, noise=noise, prior=width).invert([[model.frequencies([[1.0, 1.0]])[0, 0], np.nan]])
    precision = 0.25 / noise**2 + 1 / width**2
    np.testing.assert_allclose(found.std / found.theta, [[precision**-0.5, width]], rtol=1e-9)
    np.testing.assert_allclose(found.weight, (1 + width**-2 / precision) / 2, rtol=1e-9)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*rows-left-out")
def test_years_with_gaps_teach():
    """A year that lacks three of ten values leaves errors as one with half of the records would."""
    later = make_truss_campaign(random_state=1)
    year = F.mask(np.random.default_rng(0).random(F.shape) < 0.3)
    inverse = InverseSurrogate(regressor=Ridge(1e-6), n_samples=200)
    gappy, complete = (DataInformedFEM(TRUSS, inverse=inverse, random_state=0).fit(T, one) for one in (year, F))
    assert gappy.parameters_.notna().all(axis=1).mean() > 0.99
    errors = [mape(later.clean_frequencies, fem.predict(later.temperatures)).mean() for fem in (gappy, complete)]
    assert errors[0] < np.sqrt(2) * errors[1]


# Models without derivatives, models that fail, settings


def test_models_without_derivatives_are_refined_on_request():
    model = CallableModel(lambda theta: 7.5 * theta**0.5 + theta[::-1] / 2, ["a", "b"], 2)
    theta = drawn(10, 2)
    assert surrogate(model).n_steps_ == 0
    refined = surrogate(model, DummyRegressor(), refine=8)
    assert refined.n_steps_ == 8
    np.testing.assert_allclose(refined.transform(model.frequencies(theta)), theta, rtol=1e-5)


def test_no_steps_leave_the_regressors_estimate():
    measured, plain = noisy(drawn(20), 0.01), surrogate(refine=0)
    guess = plain.regressor_.predict(plain.inputs_.transform(measured))
    np.testing.assert_array_equal(plain.transform(measured), plain.targets_.inverse_transform(guess))
    with pytest.raises(ValueError, match="refine is 0, which means no steps"):
        plain.invert(measured)


def failing_model():
    """A spring whose program gives no frequency above 1.1 times the nominal stiffness."""
    return CallableModel(lambda theta: 3.0 * np.sqrt(theta) if theta[0] <= 1.1 else np.array([np.nan]), ["k"], 1)


def test_rows_where_the_model_fails_keep_the_guess_and_are_counted():
    measured = 3.0 * np.sqrt([[0.9], [1.0], [1.2], [1.25]])
    with pytest.warns(UserWarning, match="20 of 60 .*no-solution"):
        inverse = InverseSurrogate(failing_model(), Ridge(1e-6), n_samples=60, refine=5, random_state=0).fit()
    with pytest.warns(UserWarning, match="2 of 4 .*not-converged"):
        theta = inverse.transform(measured)
    guess = inverse.targets_.inverse_transform(inverse.regressor_.predict(inverse.inputs_.transform(measured))[:, None])
    np.testing.assert_allclose(theta[:2, 0], [0.9, 1.0], rtol=1e-6)
    np.testing.assert_array_equal(theta[2:], guess[2:])


def test_rows_out_of_steps_are_counted():
    with pytest.warns(UserWarning, match="20 of 20 .*not-converged"):
        surrogate(regressor=DummyRegressor(), refine=1, n_samples=20).transform(TRUSS.frequencies(drawn(20)))


def test_standard_deviations_are_frames_for_frames():
    measured = pd.DataFrame(noisy(drawn(5), 0.01), index=list("abcde"), columns=F.columns)
    inverse = InverseSurrogate(TRUSS, Ridge(), n_samples=50, noise=0.01, random_state=0).fit(measured)
    for table in (*inverse.predict(measured, return_std=True), inverse.invert(measured).std):
        assert list(table.columns) == list(TRUSS.parameter_names)
        assert table.index.equals(measured.index)
    theta, std = surrogate(noise=0.01).predict(measured.to_numpy(), return_std=True)
    np.testing.assert_allclose(theta / inverse.predict(measured), 1, rtol=1e-4)
    assert (std > 0).all()


@pytest.mark.nightly
def test_scatter_is_the_noise_given_or_what_the_model_leaves():
    def scatter(model, frequencies, noise=0.0):
        options = {"bounds": 0.2, "n_samples": 100, "noise": noise, "random_state": 0}
        return InverseSurrogate(model, Ridge(), **options).fit(frequencies).scatter_

    theta = drawn(365, lowest=0.85, highest=1.15)
    np.testing.assert_array_equal(scatter(TRUSS, F, noise=0.01), 0.01)
    np.testing.assert_allclose(scatter(TRUSS, noisy(theta, 0.001)), 0.001, rtol=0.1)
    # Where estimates end at their limits, fewer than four parameters fit the six modes.
    np.testing.assert_array_less(0.009, scatter(TRUSS, F))
    np.testing.assert_array_less(scatter(TRUSS, F), 0.01 * np.sqrt(3 / 2) * 1.1)
    np.testing.assert_array_equal(scatter(TRUSS.with_modes([0, 1, 2, 3]), F.iloc[:, :4]), 1e-3)
    np.testing.assert_array_equal(surrogate().scatter_, 1e-3)
    mixed = scatter(TRUSS, F, noise=[0.02, 0, 0, 0, 0, 0])
    assert mixed[0] == 0.02
    assert (mixed[1:] == mixed[1]).all()


def test_rows_that_fit_has_refined_are_not_refined_again(monkeypatch):
    from skthermo.surrogate.inverse import _refinement

    refined = []

    def counted(objective, start, *arguments, **options):
        refined.append(len(start))
        return refine(objective, start, *arguments, **options)

    refine = _refinement.refine
    monkeypatch.setattr(_refinement, "refine", counted)
    model, random = TRUSS, np.random.RandomState(0)
    theta = random.uniform(0.85, 1.15, (30, 4))
    F = model.frequencies(theta) * (1 + 0.001 * random.standard_normal((30, 6)))
    F[3, 1] = np.nan
    inverse = InverseSurrogate(model, LinearRegression(), bounds=0.2, n_samples=100, noise=0, random_state=0).fit(F)
    rows = np.append(np.arange(30)[::-1], [5, 5])
    others = model.frequencies(random.uniform(0.85, 1.15, (4, 4)))
    first, again = (inverse.invert(np.vstack([F[rows], others])) for _ in range(2))
    assert refined == [29, 5, 36]
    np.testing.assert_array_equal(first.converged, again.converged)
    # Which of two states, the last small step apart, is the last one may depend on the rows that are solved together.
    np.testing.assert_allclose(np.log(first.theta), np.log(again.theta), rtol=0, atol=2 * SMALL_STEP)
    np.testing.assert_allclose(first.residuals, again.residuals, rtol=0, atol=4 * SMALL_STEP)
    np.testing.assert_allclose(first["std"], again["std"], rtol=1e-3)
