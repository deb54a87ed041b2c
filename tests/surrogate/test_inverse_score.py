"""Scores of an inverse without targets, by which searches compare regressors, alone and within a chain."""

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.metrics import r2_score
from sklearn.model_selection import GridSearchCV, ShuffleSplit
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.fem import add_noise, sample
from skthermo.surrogate import InverseSurrogate
from tests.surrogate.chains import TRUSS, F

ONE_FOLD = ShuffleSplit(1, random_state=0)
QUADRATIC = make_pipeline(PolynomialFeatures(2), Ridge(1e-6))
REGRESSORS = {"regressor": [KNeighborsRegressor(), LinearRegression(), QUADRATIC]}


def inverse(**options):
    return InverseSurrogate(**({"model": TRUSS, "bounds": 0.2, "n_samples": 300, "random_state": 0} | options))


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


def test_an_inverse_of_given_parameters_needs_targets():
    given = sample(TRUSS, 0.2, 100, random_state=0)
    learned = InverseSurrogate(regressor=LinearRegression()).fit(given.frequencies, given.theta)
    with pytest.raises(ValueError, match="expected y to score"):
        learned.score(given.frequencies)
    assert learned.score(given.frequencies, given.theta) > 0.5
