"""Weights of records reach the temperature mapper, with and without scikit-learn's metadata routing."""

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.base import clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.exceptions import UnsetMetadataPassedError
from sklearn.linear_model import LinearRegression, Ridge, RidgeCV
from sklearn.model_selection import GridSearchCV
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from skthermo.metrics.errors import complete_r2
from skthermo.preprocessing import HingeFeatures, LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper
from tests.surrogate.chains import TRUSS, YEAR

T, F = YEAR.temperatures.iloc[:360:3], YEAR.frequencies.iloc[:360:3]
WEIGHTS = np.random.default_rng(0).uniform(0.1, 2, len(T))
PLAIN = InverseSurrogate(TRUSS, Ridge(), bounds=0.2, noise=0.01, n_samples=100, random_state=0)
ROUTING = pytest.mark.parametrize("routing", [False, True], ids=["off", "on"])


def chain(mapper=None, **options):
    return DataInformedFEM(TRUSS, inverse=PLAIN, mapper=mapper or TemperatureMapper(LinearRegression()), **options)


@pytest.mark.nightly
@ROUTING
@pytest.mark.parametrize(
    "wrapped",
    [
        lambda mapper: mapper,
        lambda mapper: make_pipeline(LagFeatures(1), mapper),
        lambda mapper: make_pipeline(LagFeatures(1), make_pipeline("passthrough", mapper)),
        lambda mapper: GridSearchCV(make_pipeline(LagFeatures(1), mapper), {"lagfeatures__lags": [1]}, cv=2),
        lambda mapper: TransformedTargetRegressor(mapper, check_inverse=False),
        lambda mapper: TemperatureMapper(MultiOutputRegressor(mapper.regressor)),
        lambda mapper: TemperatureMapper(make_pipeline("passthrough", mapper.regressor)),
        lambda mapper: TemperatureMapper(TransformedTargetRegressor(mapper.regressor)),
    ],
)
def test_weights_reach_the_last_step(wrapped, routing):
    with config_context(enable_metadata_routing=routing):
        fit = chain(wrapped(TemperatureMapper(LinearRegression()))).fit(T, F, sample_weight=WEIGHTS)
    alone = TemperatureMapper(LinearRegression()).fit(T, fit.parameters_, sample_weight=WEIGHTS)
    np.testing.assert_allclose(fit.predict_parameters(T), alone.predict(T), rtol=1e-9)
    unweighted = TemperatureMapper(LinearRegression()).fit(T, fit.parameters_)
    assert np.abs(unweighted.predict(T) / alone.predict(T) - 1).to_numpy().max() > 1e-5


@pytest.mark.filterwarnings("ignore:.*other-weather")  # of every third day
def test_a_record_of_weight_0_counts_as_left_out():
    kept = WEIGHTS > 0.5
    fit = chain().fit(T, F, sample_weight=kept)
    alone = TemperatureMapper(LinearRegression()).fit(T[kept], fit.parameters_[kept])
    np.testing.assert_allclose(fit.predict_parameters(T), alone.predict(T), rtol=1e-9)
    assert fit.report_.rows.trained == kept.sum()
    ((reason, count),) = fit.report_.rows.left_out.items()
    assert reason.startswith("their weight is 0, ")
    assert count == (~kept).sum()
    assert len(fit.recorder_.residuals.values) == kept.sum()
    assert fit.training_range_.excess(T[kept]).max() == 0
    coldest = T["T1"].argsort().to_numpy()[0]
    warm = chain().fit(T, F, sample_weight=np.arange(len(T)) != coldest)
    assert warm.extrapolation_distance(T.iloc[[coldest]])["T1"].item() > 0


@pytest.mark.one_case
@ROUTING
def test_weights_of_a_series_go_by_the_index_of_the_records(routing):
    with config_context(enable_metadata_routing=routing):
        series = pd.Series(WEIGHTS, T.index).sample(frac=1, random_state=0)
        by_name, by_position = (chain().fit(T, F, sample_weight=weights) for weights in (series, WEIGHTS))
    np.testing.assert_array_equal(by_name.predict(T), by_position.predict(T))
    assert by_name.score(T, F, sample_weight=series) == complete_r2(F, by_name.predict(T), WEIGHTS)
    assert by_name.score(T, F, sample_weight=series) != by_name.score(T, F)


@pytest.mark.parametrize(
    ("weights", "mapper", "message"),
    [
        (np.where(np.arange(120) == 7, np.nan, 1.0), None, "is nan in row 7, and .* in 1 of 120 rows"),
        (np.zeros(120), None, "sample_weight is zero in all 120 rows"),
        (pd.Series(WEIGHTS), None, "120 of them unknown to X, and lacks 120 of its 120; expected the index of X"),
        (pd.Series(WEIGHTS[:50], T.index[:50]), None, "has 50 rows, 0 of them unknown to X, and lacks 70 of its 120"),
        (WEIGHTS, TemperatureMapper(KNeighborsRegressor()), r"fit of TemperatureMapper\(regressor=.* takes no"),
        (WEIGHTS, make_pipeline(LagFeatures(2), KNeighborsRegressor()), r"(?s)fit of Pipeline.* takes no weights"),
    ],
)
def test_wrong_weights_are_named(weights, mapper, message):
    for routing in (False, True):
        with config_context(enable_metadata_routing=routing), pytest.raises(ValueError, match=message):
            chain(mapper).fit(T, F, sample_weight=weights)


def test_with_routing_the_steps_that_request_weights_get_them():
    theta = np.exp(-0.004 * T.to_numpy())
    lines = make_pipeline(HingeFeatures(2), RidgeCV())
    with pytest.raises(ValueError, match=r"fit of KNeighborsRegressor\(\) takes no weights"):
        TemperatureMapper(KNeighborsRegressor()).fit(T, theta, sample_weight=WEIGHTS)
    with config_context(enable_metadata_routing=True):
        asked = clone(lines)
        for _, step in asked.steps:
            step.set_fit_request(sample_weight=True)
        both = TemperatureMapper(asked).fit(T, theta, sample_weight=WEIGHTS)
        last = TemperatureMapper(lines).fit(T, theta, sample_weight=WEIGHTS)
        refusing = make_pipeline(HingeFeatures(2), Ridge())
        refusing[0].set_fit_request(sample_weight=False)
        refusing[1].set_fit_request(sample_weight=False)
        refused = chain(make_pipeline(LagFeatures(1), refusing))
        with pytest.raises(ValueError, match=r"takes no weights; expected .* by set_fit_request"):
            refused.fit(T, F, sample_weight=WEIGHTS)
        refused.fit(T, F)
        half = clone(lines)
        half[0].set_fit_request(sample_weight=True)
        with pytest.raises(UnsetMetadataPassedError, match="RidgeCV"):
            TemperatureMapper(half).fit(T, theta, sample_weight=WEIGHTS)
    inputs = both.inputs_.transform(T.to_numpy())
    np.testing.assert_array_equal(both.regressor_[0].knots_, HingeFeatures(2).fit(inputs, sample_weight=WEIGHTS).knots_)
    np.testing.assert_array_equal(last.regressor_[0].knots_, HingeFeatures(2).fit(inputs).knots_)


@pytest.mark.parametrize("mapper", [None, TemperatureMapper()])
def test_neither_the_scale_of_weights_nor_routing_changes_a_result(mapper):
    expected = chain(mapper, random_state=0).fit(T, F).predict(T)
    for scale in (0.01, 100.0):
        with config_context(enable_metadata_routing=scale > 1):
            found = chain(mapper, random_state=0).fit(T, F, sample_weight=np.full(len(T), scale)).predict(T)
        np.testing.assert_allclose(found, expected, rtol=1e-9)
