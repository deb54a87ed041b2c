"""Laws of posterior modes: exact inversion, what records teach, gaps, models without derivatives or solutions."""

import warnings

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import multivariate_normal

from skthermo.fem import AffineModel, Beam, CallableModel, Structure, linearise
from skthermo.surrogate import PosteriorInverse
from tests.surrogate.chains import TRUSS, F

LOWEST, HIGHEST = 0.7, 1.3
SPRING = AffineModel({("k",): [[400.0]]}, [[1.0]], n_modes=1)
BOX = np.log(HIGHEST / LOWEST) / np.sqrt(12)
"""Standard deviation of ln theta spread evenly between the lowest and the highest."""


def posterior(model=TRUSS, **options):
    nominal = model.frequencies(np.ones((1, len(model.parameter_names))))
    return PosteriorInverse(model, **({"prior": BOX, "noise": 0.0} | options)).fit(nominal)


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


def test_noise_free_rows_come_back():
    theta = drawn(300)
    found = posterior().invert(TRUSS.frequencies(theta))
    assert found.converged.all()
    np.testing.assert_allclose(found.theta, theta, rtol=3e-6)
    np.testing.assert_allclose(found.residuals, 0, atol=3e-7)


def test_rows_far_from_what_the_prior_expects_come_back():
    theta = drawn(50, lowest=0.6, highest=1.6)
    found = posterior(prior=0.1).invert(TRUSS.frequencies(theta))
    np.testing.assert_allclose(found.theta, theta, rtol=1e-5)
    far = np.array([[0.01], [100.0]])
    np.testing.assert_allclose(posterior(SPRING).invert(SPRING.frequencies(far)).theta, far, rtol=1e-6)


@pytest.mark.filterwarnings("ignore:.*mode-order")
def test_modes_that_swap_come_back_if_tracked_and_give_one_of_both_solutions_if_sorted():
    stiffness, theta = np.array([400.0, 420.0]), drawn(100, 2)
    tracked, ordered = (oscillators(*stiffness, track=track) for track in (True, False))
    solved = tracked.frequencies(theta)
    assert 0.2 < (solved[:, 0] > solved[:, 1]).mean() < 0.8
    np.testing.assert_allclose(posterior(tracked).transform(solved), theta, rtol=1e-7)
    solved = ordered.frequencies(theta)
    squared = (2 * np.pi * solved) ** 2
    both = np.stack([squared / stiffness, squared[:, ::-1] / stiffness])
    found = posterior(ordered).transform(solved)
    np.testing.assert_allclose((np.abs(found / both - 1).max(axis=2)).min(axis=0), 0, atol=1e-6)


def test_steps_that_raise_the_misfit_are_not_taken():
    """Full Gauss-Newton steps on an arctangent jump to and fro between its flat ends."""

    class Arctangent:
        parameter_names, n_modes = ("k",), 1

        def frequencies(self, theta):
            return 5 * np.exp(0.1 * np.arctan(np.log(theta) / 0.05))

        def jacobian(self, theta):
            slope = 0.1 / 0.05 / (1 + (np.log(theta) / 0.05) ** 2) / theta
            return (self.frequencies(theta) * slope)[:, :, np.newaxis]

    model, theta = Arctangent(), np.array([[1.0], [1.2], [0.8]])
    found = posterior(model).invert(model.frequencies(theta))
    np.testing.assert_allclose(found.theta, theta, rtol=1e-6)
    assert found.converged.all()


@pytest.mark.parametrize("prior", [0.05, [0.05], {"k": 0.05}])
def test_posterior_of_a_spring_is_gaussian(prior):
    """ln f = constant + ln theta / 2, so that the posterior of ln theta combines two Gaussians."""
    noise, width = 0.02, 0.05
    measured = SPRING.frequencies([[0.8], [1.0], [1.25]])
    found = posterior(SPRING, noise=noise, prior=prior).invert(measured)
    likeliest = 2 * np.log(measured / SPRING.frequencies([[1.0]]))
    precision = 0.25 / noise**2 + 1 / width**2
    mode = 0.25 / noise**2 * likeliest / precision
    np.testing.assert_allclose(np.log(found.theta), mode, atol=1e-5 / np.sqrt(precision))
    np.testing.assert_allclose(found.std, found.theta / np.sqrt(precision), rtol=1e-8)


def log_likelihood(F, theta, covariance, noise):
    """That of frequencies by the model linearised at theta, whose logarithms have a covariance about 0."""
    total = 0.0
    for measured, at, f, jacobian in zip(F, theta, *linearise(TRUSS, theta), strict=True):
        known = ~np.isnan(measured)
        J = (jacobian * at / f[:, np.newaxis])[known]
        misfit = np.log(measured[known] / f[known]) + J @ np.log(at)
        total += multivariate_normal.logpdf(misfit, cov=J @ covariance @ J.T + np.diag(noise[known] ** 2))
    return total


@pytest.mark.parametrize(("common", "own"), [(0.05, [0.004, 0.01, 0.02, 0.03]), (0.0, [0.03] * 4)])
def test_what_records_teach_is_likelier_than_what_they_were_drawn_from(common, own):
    random, noise = np.random.default_rng(0), np.array([0.002, 0.003, 0.002, 0.004, 0.002, 0.003])
    logs = common * random.standard_normal((300, 1)) + np.array(own) * random.standard_normal((300, 4))
    F = TRUSS.frequencies(np.exp(logs)) * (1 + noise * random.standard_normal((300, 6)))
    F[random.random(F.shape) < 0.1] = np.nan
    fitted = PosteriorInverse(TRUSS).fit(F)
    theta, true = fitted.transform(F), common**2 + np.diag(np.square(own))
    learned = log_likelihood(F, theta, fitted.prior_.covariance, fitted.noise_)
    drawn_from = log_likelihood(F, theta, true, noise)
    assert drawn_from - 11 < learned < drawn_from + 2 * 11  # of as many standard deviations
    np.testing.assert_allclose(fitted.noise_, noise, rtol=0.4)
    np.testing.assert_allclose(fitted.prior_.common, common, atol=0.006)
    np.testing.assert_allclose(fitted.prior_.covariance @ fitted.prior_.precision, np.eye(4), atol=1e-6)
    np.testing.assert_allclose(np.diag(fitted.prior_.covariance), fitted.prior_.deviations**2)


def three_spans():
    """A beam whose spans are of three materials."""
    groups = {"first": range(8), "second": range(8, 19), "third": range(19, 30)}
    section = {"E": 34e9, "G": 14e9, "A": 3.0, "I_yy": 0.8, "I_zz": 8.0, "J": 1.0, "density": 2500.0}
    members = {i: Beam(2.0 * i, 2.0 * (i + 1), **section) for i in range(30)}
    supports = {2.0 * i: "x y z rx rz" if i in (0, 8, 19, 30) else "x y rx rz" for i in range(31)}
    structure = Structure({x: (x, 0.0, 0.0) for x in supports}, members, supports, groups)
    return structure.assemble(list(groups), n_modes=5)


@pytest.mark.nightly
@pytest.mark.parametrize("noise", [0.003, 0.01])
def test_intervals_hold_where_each_parameter_follows_temperature_at_its_own_rate(noise):
    model, held = three_spans(), []
    for seed in range(3):
        random = np.random.default_rng(seed)
        weather = 12 * np.sin(2 * np.pi * np.arange(300) / 365) + 3 * random.standard_normal(300)
        theta = 1 + np.outer(weather, [-0.004, -0.002, -0.006])
        measured = model.frequencies(theta) * (1 + noise * random.standard_normal((300, 5)))
        found, std = PosteriorInverse(model).fit(measured).transform(measured, return_std=True)
        held.append((np.abs(found - theta) < 1.645 * std).mean(axis=0))
    assert (np.mean(held, axis=0) > 0.8).all()


def test_modes_that_the_model_cannot_follow_and_outliers_hardly_teach():
    """A mode that the weather moves in a way of its own counts as noisy, and does not drive the parameters."""
    random = np.random.default_rng(0)
    F = TRUSS.frequencies(np.exp(-0.03 * random.standard_normal((300, 1))) * np.ones(4))
    F = F * (1 + 0.002 * random.standard_normal((300, 6)))
    outliers, unlike = np.ones(F.shape), np.ones(F.shape)
    outliers[::29, 2], unlike[:, 4] = 1.5, 1 + 0.02 * random.standard_normal(300)
    clean, loud, wrong = (PosteriorInverse(TRUSS).fit(F * one) for one in (1, outliers, unlike))
    np.testing.assert_allclose(loud.prior_.common, clean.prior_.common, rtol=0.1)
    np.testing.assert_allclose(loud.noise_, clean.noise_, rtol=0.2)
    assert wrong.noise_[4] > 5 * clean.noise_[4]
    np.testing.assert_allclose(wrong.noise_[[0, 1, 2, 3, 5]], clean.noise_[[0, 1, 2, 3, 5]], rtol=0.3)
    np.testing.assert_allclose(wrong.transform(F * unlike)[:, :3], clean.transform(F * unlike)[:, :3], rtol=0.04)


def test_a_parameter_that_freezes_is_followed():
    """One of ten records has a spring seven times as stiff."""
    model, random = oscillators(400.0, 900.0, 1600.0, track=True), np.random.default_rng(0)
    theta = np.exp(0.01 * random.standard_normal((300, 3)))
    theta[::10, 1] *= 7
    F = model.frequencies(theta) * (1 + 0.003 * random.standard_normal(theta.shape))
    fitted = PosteriorInverse(model).fit(F)
    assert (np.abs(np.log(fitted.transform(F) / theta))[::10, 1] < 0.05).all()
    assert fitted.prior_.own[1] > 0.4 > 10 * fitted.prior_.own[0]


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_posterior_mode_is_the_one_that_scipy_finds(share):
    noise, width = 0.003, 0.1
    measured = holed(noisy(drawn(8), noise), share)
    found = posterior(noise=noise, prior=width).invert(measured)
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
    theta = np.exp(0.1 * np.random.default_rng(1).standard_normal((300, 4)))
    inverse = posterior(noise=0.002, prior=0.1)
    for share in (0.0, 0.5):
        mean, std = inverse.transform(holed(noisy(theta, 0.002), share), return_std=True)
        assert 0.85 <= (np.abs(mean - theta) < 1.645 * std).mean() <= 0.95


def test_a_row_does_not_depend_on_the_others():
    measured, inverse = holed(noisy(drawn(60), 0.01), 0.3), posterior(noise=0.01)
    whole, order = inverse.invert(measured), np.random.default_rng(0).permutation(60)
    for rows in (order, order[:7], order[:1]):
        part = inverse.invert(measured[rows])
        for name in ("theta", "std", "weight", "residuals", "converged"):
            np.testing.assert_allclose(part[name], whole[name][rows], rtol=1e-9, atol=1e-12)


@pytest.mark.nightly
def test_parallel_jobs_give_the_same_bits():
    measured = holed(noisy(drawn(300), 0.01), 0.1)
    one, two = (PosteriorInverse(TRUSS, n_jobs=n_jobs).fit(measured).invert(measured) for n_jobs in (1, 2))
    for name in ("theta", "std", "residuals"):
        np.testing.assert_array_equal(two[name], one[name])


def test_fewer_modes_make_estimates_less_sure():
    complete = noisy(drawn(20), 0.005)
    gaps = complete.copy()
    gaps[:10, 1], gaps[10:15] = np.nan, np.nan
    inverse = posterior(noise=0.005)
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
    found = posterior(model, noise=noise, prior=width).invert([[model.frequencies([[1.0, 1.0]])[0, 0], np.nan]])
    assert found.theta[0, 1] == pytest.approx(1)  # otherwise gaps would bias whatever learns from all rows
    precision = 0.25 / noise**2 + 1 / width**2
    np.testing.assert_allclose(found.std / found.theta, [[precision**-0.5, width]], rtol=1e-9)
    np.testing.assert_allclose(found.weight, (1 + width**-2 / precision) / 2, rtol=1e-9)


def test_a_program_that_gives_frequencies_only_is_inverted_by_a_surface_of_few_runs():
    runs = []

    def program(theta):
        runs.append(len(theta))
        return TRUSS.frequencies(theta)

    model = CallableModel(program, TRUSS.parameter_names, 6, vectorized=True)
    fitted, exact = (PosteriorInverse(one).fit(F) for one in (model, TRUSS))
    assert sum(runs) == fitted.n_runs_ <= 1209
    assert exact.n_runs_ == 0
    np.testing.assert_allclose(fitted.prior_.deviations[:3], exact.prior_.deviations[:3], rtol=0.1)
    theta, std = exact.transform(F, return_std=True)
    assert (np.abs(fitted.transform(F) - theta) < 0.1 * std).all(axis=None)


def test_rows_where_the_model_fails_have_no_parameters_and_are_counted():
    """A spring whose program gives no frequency above 1.1 times the nominal stiffness."""

    class Failing:
        parameter_names, n_modes = ("k",), 1

        def frequencies(self, theta):
            return np.where(theta <= 1.1, 3.0 * np.sqrt(theta), np.nan)

        def jacobian(self, theta):
            return (self.frequencies(theta) / theta / 2)[:, :, np.newaxis]

    measured = 3.0 * np.sqrt([[0.9], [1.0], [1.2], [1.25]])
    inverse = posterior(Failing())
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        theta = inverse.transform(measured)
    assert [one.message.kind for one in caught if hasattr(one.message, "kind")].count("poor-fit") == 1
    assert (~inverse.invert(measured).converged).sum() == 2
    np.testing.assert_allclose(theta[:2, 0], [0.9, 1.0], rtol=1e-6)
    assert (np.isnan(theta[2:]) | (theta[2:] <= 1.1)).all()


def test_what_is_given_is_not_learned():
    prior = {"bottom": 0.01, "top": 0.02, "diagonal": 0.03, "vertical": 0.04}
    stated = PosteriorInverse(TRUSS, prior=prior, noise=0.02).fit(F)
    np.testing.assert_array_equal(stated.prior_.own, [0.01, 0.02, 0.03, 0.04])
    assert stated.prior_.common == 0
    assert (stated.noise_ == 0.02).all()
    for one in (PosteriorInverse(TRUSS, prior=0.05).fit(F), PosteriorInverse(TRUSS, noise=0.01).fit(F)):
        assert (one.noise_ == 0.01).all() == (one.prior_.common > 0)
    with pytest.raises(ValueError, match="prior"):
        PosteriorInverse(TRUSS, prior=[0.1, 0.2]).fit(F)
