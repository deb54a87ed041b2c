"""M1 and M2, each on its own, and regressors of every kind inside them."""

import numpy as np
import pandas as pd
import pytest
from sklearn.ensemble import GradientBoostingRegressor
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, WhiteKernel
from sklearn.linear_model import BayesianRidge, LinearRegression, Ridge
from sklearn.metrics import r2_score
from sklearn.model_selection import GridSearchCV, ShuffleSplit
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler
from sklearn.utils._param_validation import InvalidParameterError

from skthermo.fem import AffineModel, CallableModel, add_noise, sample
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper
from tests.surrogate.chains import TRUSS, YEAR, F

QUADRATIC = make_pipeline(PolynomialFeatures(2), Ridge(1e-6))
LINEAR = LinearRegression()
HELD_OUT = sample(TRUSS, 0.2, 200, random_state=99)
ONE = TRUSS.frequencies(np.ones((1, 4)))
T = pd.DataFrame({"T1": np.linspace(-10, 40, 60), "T2": np.cos(np.arange(60))})
THETA = pd.DataFrame({"E": np.exp(-0.004 * T["T1"]), "k": 1 + 0.1 * T["T2"]})


def inverse(model=TRUSS, regressor=LINEAR, **options):
    return InverseSurrogate(model, regressor, **({"bounds": 0.2, "n_samples": 400, "random_state": 0} | options))


def test_inverse_recovers_the_parameters_of_other_simulations():
    fitted = inverse(regressor=QUADRATIC).fit()
    errors = np.abs(fitted.transform(HELD_OUT.frequencies) / HELD_OUT.theta - 1)
    assert errors.mean() < 0.005
    assert fitted.score(HELD_OUT.frequencies, HELD_OUT.theta) > 0.99
    np.testing.assert_array_equal(fitted.transform(HELD_OUT.frequencies), fitted.predict(HELD_OUT.frequencies))


def test_simulations_and_given_pairs_are_the_same_lesson():
    drawn = inverse().fit()
    given = InverseSurrogate(regressor=LinearRegression()).fit(drawn.samples_.frequencies, drawn.samples_.theta)
    np.testing.assert_allclose(given.predict(HELD_OUT.frequencies), drawn.predict(HELD_OUT.frequencies), rtol=1e-12)
    for needs_more in (given.round_trip, lambda: given.score(HELD_OUT.frequencies)):
        with pytest.raises(ValueError, match=r"has no model|expected y to score"):
            needs_more()
    assert given.score(HELD_OUT.frequencies, HELD_OUT.theta) > 0.5


def test_inverse_transform_is_the_fe_model_and_nan_flows_through():
    F = pd.DataFrame(HELD_OUT.frequencies, pd.date_range("2025", periods=200, freq="h")).add_prefix("f")
    F.iloc[5, 2] = np.nan
    fitted = inverse().fit(F)
    found = fitted.transform(F)
    assert list(found) == list(TRUSS.parameter_names)
    assert found.index.equals(F.index)
    np.testing.assert_array_equal(found.isna().sum(axis=1), np.where(np.arange(200) == 5, 4, 0))
    theta = np.vstack([HELD_OUT.theta, np.full(4, np.nan)])
    frame = pd.DataFrame(theta, columns=TRUSS.parameter_names, index=np.arange(201) + 5)
    back = fitted.inverse_transform(frame)
    np.testing.assert_array_equal(back[:-1], TRUSS.frequencies(HELD_OUT.theta))
    assert back.iloc[-1].isna().all()
    assert back.index.equals(frame.index)
    pd.testing.assert_frame_equal(fitted.inverse_transform(frame[frame.columns[::-1]]), back)
    with pytest.raises(ValueError, match=r"row 200, parameter 'bottom' is -1\.0"):
        fitted.inverse_transform(frame.fillna(-1.0))


def test_noise_by_mode_reaches_that_mode_only():
    """A mode that is pure noise in training is ignored: its coefficients vanish."""
    weights = np.abs(inverse(noise=[0, 0, 0, 0, 0, 0.9], n_samples=1000).fit().regressor_.coef_).max(axis=0)
    assert weights[5] < 0.2 * weights[:5].max()


@pytest.mark.parametrize(("bounds", "nearest"), [(0.3, 1.0), ([[1.1, 1.3]] * 4, 1.1)])
def test_the_round_trip_is_what_inversion_and_solution_leave(bounds, nearest):
    fitted, there = inverse(regressor=QUADRATIC, bounds=bounds).fit(), TRUSS.frequencies(np.full((1, 4), nearest))
    np.testing.assert_allclose(fitted.round_trip(), (TRUSS.frequencies(fitted.transform(there)) / there - 1)[0])
    assert np.abs(fitted.round_trip()).max() > 1e-6


def test_a_chain_reports_the_round_trip_and_warns_where_records_scatter_less():
    air = np.random.default_rng(1).uniform(-5, 30, (300, 1))
    healthy = TRUSS.frequencies(1 - 0.002 * (air - 10) * np.ones(4))
    linear = TemperatureMapper(LinearRegression())
    bad = InverseSurrogate(regressor=KNeighborsRegressor(), n_samples=100, bounds=0.2)
    with pytest.warns(UserWarning, match=r"'f\d' .*uncalibrated-model"):
        rough = DataInformedFEM(TRUSS, inverse=bad, mapper=linear, random_state=0).fit(air, healthy)
    np.testing.assert_allclose(rough.report_.modes["round trip"], 100 * rough.inverse_.round_trip())
    assert "round trip (%)" in repr(rough.report_)
    assert DataInformedFEM(TRUSS, mapper=linear).fit(air, healthy).report_.modes.get("round trip") is None


def test_models_that_cannot_be_recognised_are_not_remembered(tmp_path):
    model = CallableModel(lambda theta: TRUSS.frequencies(theta), TRUSS.parameter_names, 6)
    with pytest.raises(ValueError, match=r"cannot recognise CallableModel.*expected an object that can be pickled"):
        inverse(model, n_samples=5, memory=str(tmp_path)).fit()


def test_more_parameters_than_modes_warns():
    with pytest.warns(UserWarning, match="more parameters than modes.*undetermined"):
        inverse(TRUSS.with_modes([0, 1, 2]), n_samples=20).fit()


def test_mapper_learns_positive_multipliers_and_keeps_names():
    mapper = TemperatureMapper(LinearRegression()).fit(T, THETA)
    predicted = mapper.predict(T * 100)
    assert (predicted > 0).all(axis=None)
    assert list(predicted.columns) == ["E", "k"]
    np.testing.assert_allclose(mapper.predict(T)["E"], THETA["E"], rtol=0.01)


def test_mapper_leaves_incomplete_rows_out_of_fit_and_keeps_them_in_predict():
    holed_T, holed_theta = T.copy(), THETA.copy()
    holed_T.iloc[3, 0] = np.nan
    holed_theta.iloc[8, 1] = np.nan
    fitted = TemperatureMapper(LinearRegression()).fit(holed_T, holed_theta)
    complete = T.index.difference([3, 8])
    reference = TemperatureMapper(LinearRegression()).fit(T.loc[complete], THETA.loc[complete])
    np.testing.assert_allclose(fitted.predict(T), reference.predict(T), rtol=1e-12)
    assert fitted.predict(holed_T).isna().all(axis=1).sum() == 1
    assert fitted.score(holed_T, THETA) == pytest.approx(reference.score(T.drop(3), THETA.drop(3)))


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
def test_seeds_reach_parts_without_one_and_leave_the_others():
    own = TemperatureMapper(MLPRegressor(hidden_layer_sizes=(4,), random_state=7, max_iter=5), random_state=0)
    none = TemperatureMapper(MLPRegressor(hidden_layer_sizes=(4,), max_iter=5), random_state=0)
    assert own.fit(T, THETA).regressor_.random_state == 7
    first, second = (none.fit(T, THETA).regressor_.random_state for _ in range(2))
    assert isinstance(first, int)
    assert first == second


def test_linear_regression_of_logarithms_is_exact_where_all_stiffness_scales_together():
    """f is proportional to the square root of a common factor, which no linear map of f itself is."""
    chain = np.diag([2.0, 2, 1]) - np.eye(3, k=1) - np.eye(3, k=-1)
    model = AffineModel({("k",): chain}, np.eye(3), n_modes=2)
    theta = np.array([[0.2], [0.5], [2.5]])
    fitted = inverse(model, bounds=0.9, n_samples=20).fit()
    np.testing.assert_allclose(fitted.transform(model.frequencies(theta)), theta, rtol=1e-9)


def test_after_a_fit_that_saw_no_frequencies_frames_are_welcome_and_numbers_must_be_positive():
    fitted, F = inverse(n_samples=20).fit(), pd.DataFrame(np.vstack([ONE] * 3), columns=list("abcdef"))
    np.testing.assert_array_equal(fitted.transform(F), fitted.transform(F.to_numpy()))
    F.iloc[1, 2] = 0.0
    with pytest.raises(ValueError, match=r"row 1 of 'c' is 0; expected positive frequencies in Hz, NaN where"):
        fitted.transform(F)


def test_in_a_pipeline_the_labels_are_for_the_last_step():
    """They could be taken for the multipliers otherwise."""
    one = TRUSS.with_parameters(["bottom"])
    severities = np.linspace(0.0, 0.4, 30)
    F = one.frequencies(1 - severities[:, np.newaxis])
    pipeline = make_pipeline(inverse(one, QUADRATIC, bounds=0.5), LinearRegression()).fit(F, severities)
    np.testing.assert_allclose(pipeline.predict(F), severities, atol=0.01)
    taken = InverseSurrogate(None, LinearRegression()).fit_transform(F, 1 - severities)
    np.testing.assert_allclose(taken[:, 0], 1 - severities, atol=0.01)


REGRESSORS = {"regressor": [KNeighborsRegressor(), LinearRegression(), QUADRATIC]}


@pytest.mark.one_case
@pytest.mark.parametrize("noise", ["auto", 0.0, 0.002])
def test_a_search_chooses_the_regressor_that_errs_least_on_new_simulations(noise):
    one_fold = ShuffleSplit(1, random_state=0)
    search = GridSearchCV(inverse(n_samples=300, noise=noise), REGRESSORS, cv=one_fold, refit=False).fit(F)
    scores, new = search.cv_results_["mean_test_score"], sample(TRUSS, 0.2, 2000, random_state=9)
    stated = 0.0 if noise == "auto" else noise
    measured = add_noise(new.frequencies, stated, random_state=9)
    true = [
        r2_score(np.log(new.theta), np.log(inverse(regressor=one, n_samples=300, noise=noise).fit().predict(measured)))
        for one in REGRESSORS["regressor"]
    ]
    np.testing.assert_allclose(scores, true, atol=0.03)
    assert list(np.argsort(scores)) == list(np.argsort(true)) == [0, 1, 2]


BOOSTING = GradientBoostingRegressor(n_estimators=10, random_state=0)


@pytest.mark.parametrize("one_output", [BOOSTING, make_pipeline(StandardScaler(), BOOSTING), BayesianRidge()])
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


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"aligner": BiasAligner(method="scael")}, "'method' parameter of BiasAligner"),
        ({"mapper": TemperatureMapper(Ridge(alpha=-1))}, "'alpha' parameter of Ridge"),
        ({"mapper": make_pipeline(LagFeatures(lags=0), TemperatureMapper())}, "'lags' parameter of LagFeatures"),
        ({"inverse": inverse(None, n_samples=1)}, "'n_samples' parameter of InverseSurrogate"),
        ({"inverse": inverse(None, Ridge(-1), n_samples=20)}, "'alpha' parameter of Ridge"),
    ],
)
def test_nested_estimators_are_checked(parts, message):
    defaults = {"inverse": inverse(None, n_samples=20)}
    with pytest.raises(InvalidParameterError, match=message):
        DataInformedFEM(TRUSS, **(defaults | parts)).fit(YEAR.temperatures, F)


@pytest.mark.filterwarnings("ignore:.*(uncalibrated-model|outside-bounds|other-weather)")
def test_parameters_of_new_records_are_what_the_chain_learned_from():
    options = {"inverse": inverse(None, bounds=0.1, n_samples=50), "mapper": TemperatureMapper(Ridge())}
    chain = DataInformedFEM(TRUSS, **options, aligner=BiasAligner(TRUSS)).fit(YEAR.temperatures, F)
    estimates = chain.estimate_parameters(F)
    pd.testing.assert_frame_equal(estimates, chain.parameters_)
    aligned = F - F.mean() + ONE
    np.testing.assert_allclose(estimates, chain.inverse_.transform(aligned), rtol=1e-9)
    with pytest.raises(ValueError, match="feature names should match"):
        chain.estimate_parameters(F.rename(columns={"f2": "f9"}))
