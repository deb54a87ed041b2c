"""M1 and M2, each on its own."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.metrics import r2_score
from sklearn.model_selection import GridSearchCV, ShuffleSplit
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, CallableModel, add_noise, sample
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper
from tests.surrogate.chains import TRUSS, YEAR

QUADRATIC = make_pipeline(PolynomialFeatures(2), Ridge(1e-6))


HELD_OUT = sample(TRUSS, 0.2, 200, random_state=99)
T = pd.DataFrame({"T1": np.linspace(-10, 40, 60), "T2": np.cos(np.arange(60))})
THETA = pd.DataFrame({"E": np.exp(-0.004 * T["T1"]), "k": 1 + 0.1 * T["T2"]})


def test_inverse_recovers_the_parameters_of_other_simulations():
    inverse = InverseSurrogate(TRUSS, QUADRATIC, bounds=0.2, random_state=0).fit()
    errors = np.abs(inverse.transform(HELD_OUT.frequencies) / HELD_OUT.theta - 1)
    assert errors.mean() < 0.005
    assert inverse.score(HELD_OUT.frequencies, HELD_OUT.theta) > 0.99
    np.testing.assert_array_equal(inverse.transform(HELD_OUT.frequencies), inverse.predict(HELD_OUT.frequencies))


def test_simulations_and_given_pairs_are_the_same_lesson():
    drawn = InverseSurrogate(TRUSS, LinearRegression(), random_state=0, bounds=0.2).fit()
    given = InverseSurrogate(regressor=LinearRegression()).fit(drawn.samples_.frequencies, drawn.samples_.theta)
    np.testing.assert_allclose(given.predict(HELD_OUT.frequencies), drawn.predict(HELD_OUT.frequencies), rtol=1e-12)


def test_inverse_transform_is_the_fe_model():
    inverse = InverseSurrogate(TRUSS, LinearRegression(), bounds=0.2, random_state=0).fit()
    theta = np.vstack([HELD_OUT.theta, np.full(4, np.nan)])
    np.testing.assert_array_equal(inverse.inverse_transform(theta)[:-1], TRUSS.frequencies(HELD_OUT.theta))
    assert np.isnan(inverse.inverse_transform(theta)[-1]).all()
    frame = pd.DataFrame(theta, columns=TRUSS.parameter_names, index=np.arange(201) + 5)
    assert inverse.inverse_transform(frame).index.equals(frame.index)
    pd.testing.assert_frame_equal(
        inverse.inverse_transform(frame[frame.columns[::-1]]), inverse.inverse_transform(frame)
    )
    with pytest.raises(ValueError, match=r"row 200, parameter 'bottom' is -1\.0"):
        inverse.inverse_transform(frame.fillna(-1.0))


def test_noise_by_mode_reaches_that_mode_only():
    """A mode that is pure noise in training is ignored: its coefficients vanish."""
    noise = [0, 0, 0, 0, 0, 0.9]
    inverse = InverseSurrogate(TRUSS, LinearRegression(), bounds=0.2, noise=noise, random_state=0).fit()
    weights = np.abs(inverse.regressor_.coef_).max(axis=0)
    assert weights[5] < 0.2 * weights[:5].max()


def test_frames_in_frames_out_and_nan_flows_through():
    index = pd.date_range("2025", periods=200, freq="h")
    F = pd.DataFrame(HELD_OUT.frequencies, index=index, columns=[f"f{i}" for i in range(6)])
    F.iloc[5, 2] = np.nan
    theta = InverseSurrogate(TRUSS, LinearRegression(), bounds=0.2, random_state=0).fit(F).transform(F)
    assert list(theta.columns) == list(TRUSS.parameter_names)
    assert theta.index.equals(index)
    np.testing.assert_array_equal(np.flatnonzero(theta.isna().all(axis=1)), [5])
    assert theta.drop(index=index[5]).notna().all(axis=None)


ONE = TRUSS.frequencies(np.ones((1, 4)))


def test_the_round_trip_is_what_inversion_and_solution_leave():
    fitted = InverseSurrogate(TRUSS, QUADRATIC, n_samples=400, random_state=0).fit()
    np.testing.assert_allclose(fitted.round_trip(), (TRUSS.frequencies(fitted.transform(ONE)) / ONE - 1)[0])
    assert np.abs(fitted.round_trip()).max() > 1e-6
    beside = InverseSurrogate(TRUSS, QUADRATIC, bounds=[[1.1, 1.3]] * 4, n_samples=400, random_state=0).fit()
    nearest = TRUSS.frequencies(np.full((1, 4), 1.1))
    np.testing.assert_allclose(beside.round_trip(), (TRUSS.frequencies(beside.transform(nearest)) / nearest - 1)[0])
    given = InverseSurrogate(regressor=LinearRegression()).fit(HELD_OUT.frequencies, HELD_OUT.theta)
    with pytest.raises(ValueError, match="has no model"):
        given.round_trip()


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
    with pytest.raises(
        ValueError, match=r"memory cannot recognise CallableModel.*expected an object that can be pickled"
    ):
        InverseSurrogate(model, LinearRegression(), n_samples=5, memory=str(tmp_path)).fit()


def test_more_parameters_than_modes_warns():
    with pytest.warns(UserWarning, match="more parameters than modes.*undetermined"):
        InverseSurrogate(make_truss(n_modes=3), LinearRegression(), bounds=0.2, n_samples=20, random_state=0).fit()


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
    inverse = InverseSurrogate(model, LinearRegression(), bounds=0.9, n_samples=20, random_state=0).fit()
    theta = np.array([[0.2], [0.5], [2.5]])
    np.testing.assert_allclose(inverse.transform(model.frequencies(theta)), theta, rtol=1e-9)


def test_after_a_fit_that_saw_no_frequencies_frames_are_welcome_and_numbers_must_be_positive():
    inverse = InverseSurrogate(TRUSS, LinearRegression(), n_samples=20, bounds=0.1, random_state=0).fit()
    F = pd.DataFrame(TRUSS.frequencies(np.ones((3, 4))), columns=list("abcdef"))
    np.testing.assert_array_equal(inverse.transform(F), inverse.transform(F.to_numpy()))
    F.iloc[1, 2] = 0.0
    with pytest.raises(ValueError, match=r"row 1 of 'c' is 0; expected positive frequencies in Hz, NaN where"):
        inverse.transform(F)


def test_in_a_pipeline_the_labels_are_for_the_last_step():
    """They could be taken for the multipliers otherwise."""
    one = TRUSS.with_parameters(["bottom"])
    severities = np.linspace(0.0, 0.4, 30)
    F = one.frequencies(1 - severities[:, np.newaxis])
    inverse = InverseSurrogate(one, QUADRATIC, bounds=0.5, random_state=0)
    pipeline = make_pipeline(inverse, LinearRegression()).fit(F, severities)
    np.testing.assert_allclose(pipeline.predict(F), severities, atol=0.01)
    taken = InverseSurrogate(None, LinearRegression()).fit_transform(F, 1 - severities)
    np.testing.assert_allclose(taken[:, 0], 1 - severities, atol=0.01)


# Scores without targets, by which searches compare regressors


ONE_FOLD = ShuffleSplit(1, random_state=0)
REGRESSORS = {"regressor": [KNeighborsRegressor(), LinearRegression(), QUADRATIC]}


def scored(**options):
    return InverseSurrogate(**({"model": TRUSS, "bounds": 0.2, "n_samples": 300, "random_state": 0} | options))


@pytest.mark.one_case
@pytest.mark.parametrize("noise", ["auto", 0.0, 0.002])
def test_a_search_chooses_the_regressor_that_errs_least_on_new_simulations(noise):
    search = GridSearchCV(scored(noise=noise), REGRESSORS, cv=ONE_FOLD, refit=False).fit(YEAR.frequencies)
    scores, new = search.cv_results_["mean_test_score"], sample(TRUSS, 0.2, 2000, random_state=9)
    stated = 0.0 if noise == "auto" else noise
    measured = add_noise(new.frequencies, stated, random_state=9)
    true = [
        r2_score(np.log(new.theta), np.log(scored(regressor=one, noise=noise).fit().predict(measured)))
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
