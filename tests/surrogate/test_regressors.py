"""Regressors of every kind inside the surrogates."""

import numpy as np
import pandas as pd
import pytest
from sklearn.ensemble import GradientBoostingRegressor
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, WhiteKernel
from sklearn.linear_model import BayesianRidge, LinearRegression, Ridge
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils._param_validation import InvalidParameterError

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

# A linear or quadratic inverse scatters with the noise, and folds of contiguous rows predict weather not seen.
pytestmark = pytest.mark.filterwarnings("ignore:.*(outside-bounds|other-weather)")

TRUSS = make_truss()
T = pd.DataFrame({"T1": np.linspace(-10, 40, 60), "T2": np.cos(np.arange(60))})
THETA = pd.DataFrame({"E": np.exp(-0.004 * T["T1"]), "k": 1 + 0.1 * T["T2"]})


@pytest.mark.parametrize(
    "one_output",
    [
        GradientBoostingRegressor(n_estimators=10, random_state=0),
        make_pipeline(StandardScaler(), GradientBoostingRegressor(n_estimators=10, random_state=0)),
        BayesianRidge(),
    ],
    ids=["boosting", "pipeline", "bayesian ridge"],
)
def test_a_regressor_of_one_output_is_fitted_once_for_each_parameter(one_output):
    mapper = TemperatureMapper(one_output).fit(T, THETA)
    assert len(mapper.regressor_.estimators_) == 2
    by_hand = TemperatureMapper(MultiOutputRegressor(one_output)).fit(T, THETA)
    np.testing.assert_array_equal(mapper.predict(T), by_hand.predict(T))


@pytest.mark.parametrize("wrap", [lambda part: part, lambda part: make_pipeline(StandardScaler(), part)])
def test_standard_deviations_of_a_regressor_pass_through_scales_and_logarithms(wrap):
    """Log theta is Gaussian about a line; so theta's relative deviation is that of its logarithm."""
    noise = np.array([0.01, 0.03])
    random = np.random.default_rng(0)
    x = random.uniform(-1, 1, (4000, 1))
    theta = np.exp(0.1 * x + noise * random.standard_normal((4000, 2)))
    mapper = TemperatureMapper(wrap(BayesianRidge())).fit(x, theta)
    mean, std = mapper.predict(x[:50], return_std=True)
    np.testing.assert_array_equal(mean, mapper.predict(x[:50]))
    np.testing.assert_allclose(std / mean, np.broadcast_to(noise, (50, 2)), rtol=0.05)


def test_standard_deviations_come_as_frames_and_are_nan_where_an_input_is():
    gappy = T.copy()
    gappy.iloc[3, 0] = np.nan
    process = GaussianProcessRegressor(RBF() + WhiteKernel(1e-4), optimizer=None)
    std = TemperatureMapper(process).fit(T, THETA).predict(gappy, return_std=True)[1]
    assert list(std.columns) == list(THETA.columns)
    assert std.index.equals(T.index)
    assert std.isna().all(axis=1).tolist() == [row == 3 for row in range(60)]
    assert (std.drop(3) > 0).all().all()
    alone = TemperatureMapper(process).fit(T, THETA["E"])
    vector, vector_std = alone.predict(T, return_std=True)
    assert vector.shape == vector_std.shape == (60,)


YEAR = make_truss_campaign(random_state=0)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"aligner": BiasAligner(method="scael")}, "'method' parameter of BiasAligner"),
        ({"mapper": TemperatureMapper(Ridge(alpha=-1))}, "'alpha' parameter of Ridge"),
        ({"mapper": make_pipeline(LagFeatures(lags=0), TemperatureMapper())}, "'lags' parameter of LagFeatures"),
        ({"inverse": InverseSurrogate(n_samples=1)}, "'n_samples' parameter of InverseSurrogate"),
        ({"inverse": InverseSurrogate(regressor=Ridge(-1), bounds=0.1, n_samples=20)}, "'alpha' parameter of Ridge"),
    ],
)
def test_nested_estimators_are_checked(parts, message):
    defaults = {"inverse": InverseSurrogate(regressor=LinearRegression(), bounds=0.1, n_samples=20, random_state=0)}
    with pytest.raises(InvalidParameterError, match=message):
        DataInformedFEM(TRUSS, **(defaults | parts)).fit(YEAR.temperatures, YEAR.frequencies)


@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_parameters_of_new_records_are_what_the_chain_learned_from():
    inverse = InverseSurrogate(regressor=LinearRegression(), bounds=0.1, n_samples=50, random_state=0)
    chain = DataInformedFEM(TRUSS, inverse=inverse, mapper=TemperatureMapper(Ridge()), aligner=BiasAligner(TRUSS))
    chain.fit(YEAR.temperatures, YEAR.frequencies)
    estimates = chain.estimate_parameters(YEAR.frequencies)
    pd.testing.assert_frame_equal(estimates, chain.parameters_)
    aligned = YEAR.frequencies - YEAR.frequencies.mean() + TRUSS.frequencies(np.ones(4))[0]
    np.testing.assert_allclose(estimates, chain.inverse_.transform(aligned), rtol=1e-9)
    with pytest.raises(ValueError, match="feature names should match"):
        chain.estimate_parameters(YEAR.frequencies.rename(columns={"f2": "f9"}))
