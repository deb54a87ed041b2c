"""Models drawn from what calibration leaves open: exact where linear, and as wide as the prior where unknown."""

import warnings

import numpy as np
import pytest

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel
from skthermo.updating import ModelUpdater
from tests.fem.frames import portal

TRUSS = make_truss()
NAMES = TRUSS.parameter_names
TRUTH = np.array([0.9, 1.1, 0.95, 1.05])
MEASURED = TRUSS.frequencies([TRUTH])[0]
ONE = np.ones((1, 4))
EFFECTS = np.array([[3.0, 1.0, 0.5], [1.0, 4.0, 1.0]])  # of three parameters on two modes, in Hz


class Linear:
    parameter_names, n_modes = ("a", "b", "c"), 2

    def frequencies(self, theta):
        return theta @ EFFECTS.T

    def jacobian(self, theta):
        return np.broadcast_to(EFFECTS, (len(theta), 2, 3))


def calibrated(model=TRUSS, noise=0.005, **options):
    options = {"bounds": 0.7, "prior": 0.15} | options
    return ModelUpdater(model, **options).fit(MEASURED, frequency_std=noise * MEASURED)


def multipliers(models, model=TRUSS):
    """Stiffness of each group, from the stiffness matrices."""
    nominal = [change(model, group) for group in NAMES]
    return np.array([[change(m, group) / there for group, there in zip(NAMES, nominal, strict=True)] for m in models])


def change(model, group):
    """Trace of the stiffness that half of a group adds."""
    whole, half = (m.matrices(np.ones(len(m.parameter_names)))[0] for m in (model, model.damaged({group: 0.5})))
    return (whole - half).trace()


def test_draws_of_a_linear_model_have_the_posterior_mean_and_covariance():
    F, std, prior, n = np.array([4.6, 6.3]), np.array([0.05, 0.08]), np.array([0.1, 0.05, 0.15]), 400
    updater = ModelUpdater(Linear(), bounds=0.9, prior=prior).fit(F, frequency_std=std)
    models = updater.sample_models(n, random_state=0)
    columns = [(m.frequencies(np.ones((3, 3)) + np.eye(3)) - m.frequencies(np.ones((1, 3)))) for m in models]
    theta = np.array([(rows[:, 0] / EFFECTS[0]) for rows in columns])
    covariance = np.linalg.inv(EFFECTS.T @ np.diag(std**-2) @ EFFECTS + np.diag(prior**-2))
    mean = 1 + covariance @ EFFECTS.T @ ((F - EFFECTS.sum(axis=1)) / std**2)
    deviations = np.sqrt(np.diag(covariance))
    assert np.abs((theta.mean(axis=0) - mean) / deviations * np.sqrt(n)).max() < 3.5
    errors = np.cov(theta.T) / np.outer(deviations, deviations) - covariance / np.outer(deviations, deviations)
    assert np.abs(errors).max() < 3.5 * np.sqrt(2 / n)
    np.testing.assert_allclose(updater.theta_, mean, rtol=1e-6)


def test_stiffness_is_drawn_alike_whether_a_parameter_or_a_damage_group_scales_it():
    models = calibrated().sample_models(5, spread=0.15, random_state=0)
    others = calibrated(TRUSS.with_parameters(["bottom", "top"])).sample_models(5, spread=0.15, random_state=0)
    np.testing.assert_allclose(multipliers(models), multipliers(others), rtol=1e-3)
    alone = calibrated(TRUSS.with_parameters(["bottom", "top"])).sample_models(5, groups=[], random_state=0)
    np.testing.assert_allclose(multipliers(alone)[:, 2:], 1)
    one = calibrated(TRUSS.with_parameters(["bottom"])).sample_models(5, groups=["diagonal", "bottom"], random_state=0)
    assert (multipliers(one).std(axis=0) > 1e-4).tolist() == [True, False, True, False]
    damaged = [m.damaged({"vertical": 0.5}).frequencies([[1, 1]]) for m in others]
    np.testing.assert_allclose(damaged, [m.damaged({"vertical": 0.5}).frequencies(ONE) for m in models], rtol=1e-3)


@pytest.mark.parametrize("names", [NAMES, ["top"]])
def test_models_drawn_from_a_reduced_model_are_those_of_the_full_one(names):
    model = TRUSS.with_parameters(names).reduced(0.7, random_state=0)
    models = calibrated(model).sample_models(3, random_state=0)
    full = calibrated(TRUSS.with_parameters(model.parameter_names)).sample_models(3, random_state=0)
    for drawn, same in zip(models, full, strict=True):
        assert type(drawn) is type(model)
        assert drawn.parameter_names == model.parameter_names
        assert drawn.groups == model.groups
        assert drawn.track == model.track
        one = np.ones((1, len(model.parameter_names)))
        np.testing.assert_allclose(drawn.frequencies(one), same.frequencies(one), rtol=2e-5)


def test_models_that_follow_their_modes_do_so_when_they_are_drawn():
    model = portal(2, track=True).with_modes([0, 1, 3, 2, 4, 5])
    truth = [1.0, 1.0, 1.0, 1.02]
    F = model.frequencies([truth])[0]
    updater = ModelUpdater(model, bounds=0.7, prior=0.15).fit(F, frequency_std=0.01 * F)
    for drawn in updater.sample_models(3, random_state=0):
        assert drawn.track
        np.testing.assert_allclose(drawn.frequencies(ONE)[0], F, rtol=0.05)
    for groups in (None, ["beams"]), ([], ["columns", "soil"]):  # no parameter scales the torsion of the beams
        same = [updater.sample_models(3, groups=some, random_state=0) for some in groups]
        for one, other in zip(*same, strict=True):
            np.testing.assert_array_equal(one.frequencies(ONE), other.frequencies(ONE))


def test_a_warning_counts_models_in_which_sorted_modes_swap_places():
    sorted_ = AffineModel({("a",): np.diag([1.0, 0.0]), ("b",): np.diag([0.0, 1.1])}, np.eye(2), n_modes=2)
    F = sorted_.frequencies([[1.0, 1.0]])[0]
    updater = ModelUpdater(sorted_, bounds=0.7, prior=0.15).fit(F, frequency_std=0.05 * F)
    with pytest.warns(UserWarning, match=r"\d+ of 15 .*mode-order"):
        updater.sample_models(15, random_state=0)


def test_same_seed_same_models_whatever_the_number_of_jobs():
    jobs_and_seeds = (None, 0), (2, 0), (None, 1)
    drawn = (calibrated(n_jobs=n_jobs).sample_models(3, random_state=seed) for n_jobs, seed in jobs_and_seeds)
    found = [[model.frequencies(ONE) for model in models] for models in drawn]
    np.testing.assert_array_equal(found[0], found[1])
    assert not np.allclose(found[0], found[2], rtol=1e-4)


def test_each_warning_counts_the_models():
    bounds = dict.fromkeys(NAMES, 0.7) | {"vertical": 0.1}
    with pytest.warns(UserWarning, match=r"'vertical' \(\d+ of 15\).*poor-fit"):
        calibrated(bounds=bounds).sample_models(15, random_state=0)
    with pytest.warns(UserWarning, match="optimum"):
        hasty = calibrated(max_iter=1)
    with pytest.warns(UserWarning, match="5 of 5 .*poor-fit"):
        hasty.sample_models(5, random_state=0)
    narrow = TRUSS.reduced(0.1, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        updater = calibrated(narrow)
    with pytest.warns(UserWarning, match="outside-bounds"):
        updater.sample_models(6, random_state=0)
    with pytest.raises(ValueError, match="fit was called without frequency_std"):
        ModelUpdater(TRUSS).fit(MEASURED).sample_models(2)
