"""Scores of an inverse without targets, by which searches compare regressors, and searches that change nothing."""

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.metrics import r2_score
from sklearn.model_selection import GridSearchCV, KFold, ShuffleSplit
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.datasets import make_truss
from skthermo.fem import add_noise, sample
from skthermo.surrogate import DataInformedFEM, InverseSurrogate
from skthermo.surrogate.inverse._training import held_out
from tests.surrogate.chains import TRUSS, F, T

ONE_FOLD = ShuffleSplit(1, random_state=0)
QUADRATIC = make_pipeline(PolynomialFeatures(2), Ridge(1e-6))
REGRESSORS = {"regressor": [KNeighborsRegressor(), LinearRegression(), QUADRATIC]}


def inverse(**options):
    return InverseSurrogate(
        **({"model": TRUSS, "bounds": 0.2, "n_samples": 300, "refine": 0, "random_state": 0} | options)
    )


@pytest.mark.one_case
@pytest.mark.parametrize("noise", ["auto", 0.0, 0.002])
def test_a_search_chooses_the_regressor_that_errs_least_on_new_simulations(noise):
    search = GridSearchCV(inverse(noise=noise), REGRESSORS, cv=ONE_FOLD, refit=False).fit(F)
    scores, new = search.cv_results_["mean_test_score"], sample(TRUSS, 0.2, 2000, random_state=9)
    stated = 0.0 if noise == "auto" else noise
    measured = add_noise(new.frequencies, stated, random_state=9)
    true = [
        r2_score(np.log(new.theta), np.log(inverse(regressor=one, noise=noise).fit().predict(measured)))
        for one in REGRESSORS["regressor"]
    ]
    np.testing.assert_allclose(scores, true, atol=0.03)
    assert list(np.argsort(scores)) == list(np.argsort(true)) == [0, 1, 2]


def test_the_score_is_of_the_regressor_and_not_of_refined_estimates():
    plain, refined = (inverse(regressor=LinearRegression(), noise=0.0, refine=steps).fit() for steps in (0, None))
    assert refined.n_steps_ > 0
    assert plain.score() == refined.score() < 0.98
    new = sample(TRUSS, 0.2, 50, random_state=1)
    assert refined.score(new.frequencies, new.theta) > 0.999  # with targets, that of `predict`


def test_held_out_simulations_are_new_within_the_bounds_and_always_the_same(tmp_path):
    fitted = inverse(memory=str(tmp_path)).set_params(regressor=LinearRegression()).fit()
    other = inverse(regressor=QUADRATIC, random_state=1).fit()
    (inputs, theta), (same, again) = held_out(fitted, 0.01), held_out(other, 0.01)
    np.testing.assert_array_equal(theta, again)
    np.testing.assert_array_equal(inputs, same)
    assert 0.8 < theta.min() < 0.81 < 1.19 < theta.max() < 1.2
    assert not np.isin(theta, fitted.samples_.theta).any()
    np.testing.assert_allclose((inputs / TRUSS.frequencies(theta)).std(axis=0), 0.01, rtol=0.1)


def test_scores_read_shapes_and_reduced_models():
    with_shapes = inverse(regressor=LinearRegression(), dofs=[1, 3, 5, 7], shape_noise=0.001, noise=0.002).fit()
    assert with_shapes.score() > inverse(regressor=LinearRegression(), noise=0.002).fit().score()
    small = inverse(regressor=LinearRegression(), reduce=True).fit()
    assert small.score() == pytest.approx(inverse(regressor=LinearRegression()).fit().score(), abs=1e-3)


def test_an_inverse_of_given_parameters_needs_targets():
    given = sample(TRUSS, 0.2, 100, random_state=0)
    learned = InverseSurrogate(regressor=LinearRegression()).fit(given.frequencies, given.theta)
    with pytest.raises(ValueError, match="expected y to score"):
        learned.score(given.frequencies)
    assert learned.score(given.frequencies, given.theta) > 0.5


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*outside-training-weather")
def test_a_search_over_what_refining_makes_inert_says_so():
    chain = DataInformedFEM(make_truss(), inverse=inverse(refine=None, model=None, noise=0.01), random_state=0)
    search = GridSearchCV(chain, {"inverse__regressor": [LinearRegression(), QUADRATIC]}, cv=KFold(2), refit=False)
    with pytest.warns(UserWarning, match="inverse__regressor.*inert-search") as given:
        search.fit(T, F)
    assert sum("is searched" in str(one.message) for one in given) == 1
    np.testing.assert_allclose(*search.cv_results_["mean_test_score"], rtol=1e-3)
    search.set_params(estimator__inverse__refine=0).fit(T, F)  # which changes what is found, and says nothing
    assert abs(np.diff(search.cv_results_["mean_test_score"])) > 1e-3
    GridSearchCV(chain, {"inverse__noise": [0.01, 0.02]}, cv=KFold(2), refit=False).fit(T, F)
    chain.set_params(inverse__regressor=QUADRATIC)  # outside a search
