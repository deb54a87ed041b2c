"""Laws of what the chain says about its own errors: spread, intervals, realistic noise."""

import pickle
from contextlib import nullcontext
from functools import cache

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import BlockedKFold, LagFeatures
from skthermo.surrogate import TemperatureMapper
from tests.residuals.series import autoregressive, residuals
from tests.surrogate.chains import F, T, as_measured, inverse, trained
from tests.surrogate.chains import chain as any_chain

# Vertical stiffness hardly moves the frequencies, so that its estimates scatter with the noise.
pytestmark = pytest.mark.filterwarnings("ignore:.*outside-bounds")

LATER = make_truss_campaign(random_state=1)
PLAIN = TemperatureMapper(LinearRegression())
SEARCHED = GridSearchCV(TemperatureMapper(Ridge()), {"regressor__alpha": [0.1, 1.0]}, cv=2)


def chain(mapper=PLAIN, **options):
    return any_chain(inverse=inverse(noise=0.01), mapper=mapper, **options)


@cache
def fitted():
    return chain().fit(T, F)


def test_residuals_are_those_of_mappers_fitted_to_other_weeks():
    fem = any_chain(inverse=trained(), mapper=PLAIN, discrepancy=None).fit(T, F)
    folds = BlockedKFold(block="7D")
    np.testing.assert_array_equal(fem.recorder_.residuals.folds, folds.fold_of(T))
    for fold, (train, test) in enumerate(folds.split(T)):
        theta = clone(fem.mapper_).fit(T.iloc[train], fem.parameters_.iloc[train]).predict(T.iloc[test])
        predicted = fem.aligner_.inverse_transform(fem.model.frequencies(theta))
        values = fem.recorder_.residuals.values[fem.recorder_.residuals.folds == fold]
        np.testing.assert_allclose(values, F.iloc[test].to_numpy() / predicted - 1, atol=1e-9)


@pytest.mark.nightly
def test_residuals_do_not_know_the_discrepancy_of_their_own_week():
    """A mode that one week alone moves: what is learned there is not in its residuals."""
    week = np.arange(365) // 7 == 20
    fem = chain().fit(T, F.assign(f2=F["f2"] * np.where(week, 1.02, 1.0)))
    of_week = fem.recorder_.residuals.values[week, 1] - fitted().recorder_.residuals.values[week, 1]
    np.testing.assert_allclose(of_week.mean(), 0.02, atol=0.002)


@pytest.mark.parametrize("rho", [0.5, 0.99])
def test_blocks_are_five_correlation_times_long_where_that_is_more_than_a_week(rho):
    hours = pd.DataFrame(index=pd.date_range("2025", periods=5000, freq="h"))
    rows = 5 * residuals(np.random.default_rng(1).uniform(size=5000), autoregressive(5000, rho)).correlation_time
    assert rows == pytest.approx(5 * (1 + rho) / (1 - rho), rel=0.4)
    lasting, own = np.ceil(min(rows, 5000 // 10)), BlockedKFold().remembering  # each fold keeps two blocks
    assert own(hours, rows).length(hours) == max(pd.Timedelta("7D"), lasting * pd.Timedelta("1h"))
    untimed = np.zeros((5000, 1))
    assert own(untimed, rows).length(untimed) == max(BlockedKFold().length(untimed), lasting)


@pytest.mark.nightly
def test_blocks_of_a_chain_are_longer_than_a_week_where_noise_lasts():
    lasting = F * (1 + 0.01 * autoregressive(365, 0.9))
    usual, longer = (one.recorder_.residuals.folds for one in (fitted(), chain().fit(T, lasting)))
    assert set(np.diff(np.flatnonzero(np.diff(usual)))) == {7}
    assert min(np.diff(np.flatnonzero(np.diff(longer)))) > 20


def test_folds_in_unseen_weather_are_named(monkeypatch):
    short = chain().fit(T[:150], F[:150])
    monkeypatch.setattr(BlockedKFold, "fold_of", lambda self, X: np.arange(len(X)) // 30)  # contiguous ones
    for _ in range(2):  # each time, also where residuals are known
        with pytest.warns(UserWarning, match="lack: 'T1', 'T2'.*other-weather"):
            short.predict(T[:150], return_std=True)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*wrong-stamps")
def test_residuals_and_noise_do_not_depend_on_the_order_of_rows():
    order, mapper = np.random.default_rng(0).permutation(len(T)), make_pipeline(LagFeatures(2), PLAIN)
    sorted_rows, shuffled = (chain(mapper=mapper).fit(T.iloc[rows], F.iloc[rows]) for rows in (slice(None), order))
    noisy, of_shuffled = (fitted().simulate(one, noise="fitted", random_state=0) for one in (T, T.iloc[order]))
    pd.testing.assert_frame_equal(of_shuffled.sort_index(), noisy, check_freq=False)
    np.testing.assert_allclose(shuffled.recorder_.residuals.values, sorted_rows.recorder_.residuals.values, atol=1e-6)
    np.testing.assert_allclose(shuffled.recorder_.residuals.weather, sorted_rows.recorder_.residuals.weather)


@pytest.mark.nightly
@pytest.mark.parametrize("mapper", [make_pipeline(LagFeatures(2, padding="nan"), PLAIN), SEARCHED, LinearRegression()])
def test_any_mapper_has_residuals(mapper):
    fem = chain(mapper=mapper).fit(T, F)
    lagged = 1 if hasattr(mapper, "steps") else 0
    assert fem.recorder_.residuals.values.shape == (365 - lagged, 6)
    with pytest.warns(UserWarning, match="not-evaluated") if lagged else nullcontext():
        std = fem.predict(T, return_std=True)[1]
    np.testing.assert_array_equal(std.isna().all(axis=1), np.arange(365) < lagged)


@pytest.mark.filterwarnings("ignore:.*few-records")
def test_few_records_have_no_residuals():
    with pytest.warns(UserWarning, match="few-records"):
        fem = chain().fit(T[:9], F[:9])
    with pytest.raises(ValueError, match="9 records have parameters; expected at least 10"):
        fem.predict(T[:9], return_std=True)


def test_pickles_keep_residuals_and_clones_do_not():
    twin = pickle.loads(pickle.dumps(fitted()))
    np.testing.assert_array_equal(twin.recorder_.residuals.values, fitted().recorder_.residuals.values)
    for one, other in zip(twin.predict_interval(T[:50]), fitted().predict_interval(T[:50]), strict=True):
        pd.testing.assert_frame_equal(one, other)
    assert not hasattr(clone(fitted()), "_residuals")
    assert len(twin.fit(T[:100], F[:100]).recorder_.residuals.values) == 100


def test_standard_deviations_are_spreads_in_hertz():
    frequencies, std = fitted().predict(T, return_std=True)
    pd.testing.assert_frame_equal(frequencies, fitted().predict(T))
    np.testing.assert_allclose(std / frequencies, fitted().recorder_.residuals.spread(T.to_numpy()))
    assert (std > 0).all(axis=None)
    np.testing.assert_allclose((std / frequencies).mean(), 0.01, rtol=0.2)  # the noise of the campaign


def test_intervals_grow_with_confidence_and_hold_the_prediction():
    predicted = fitted().predict(T)
    inner = (predicted, predicted)
    for confidence in (0.2, 0.5, 0.8, 0.9, 0.99):
        outer = fitted().predict_interval(T, confidence)
        assert (outer[0] <= inner[0]).all(axis=None)
        assert (outer[1] >= inner[1]).all(axis=None)
        assert (outer[0] > 0).all(axis=None)
        np.testing.assert_allclose(sum(outer) / 2, predicted)
        inner = outer


def test_intervals_are_infinite_where_records_are_too_few():
    fem = chain().fit(T[::5], F[::5])
    lowest, highest = fem.predict_interval(T[:3], 0.99)
    assert (lowest == 0).all(axis=None)
    assert np.isinf(highest).all(axis=None)
    assert np.isfinite(fem.predict_interval(T[:3], 0.9)[1]).all(axis=None)


@pytest.mark.filterwarnings("ignore:.*not-evaluated")
def test_rows_without_any_temperature_have_no_interval():
    holed = T.copy()
    holed.iloc[3] = np.nan
    noisy = fitted().simulate(holed, noise="fitted")
    for table in (*fitted().predict_interval(holed), fitted().predict(holed, True)[1], noisy):
        np.testing.assert_array_equal(table.isna().all(axis=1), np.arange(365) == 3)
        assert table.notna().all(axis=1).sum() == 364


@pytest.mark.filterwarnings("ignore:.*other-weather")
def test_intervals_widen_beyond_the_training_weather():
    middle, beyond = T.mean().to_frame().T, T.max().to_frame().T + 30
    widths = [(highest / lowest).to_numpy() for lowest, highest in map(fitted().predict_interval, (middle, beyond))]
    assert (widths[1] > widths[0]).all()


def without(sensor):
    return LATER.temperatures.assign(**{sensor: np.nan})


def test_a_missing_temperature_is_what_the_other_sensors_predict():
    wanted = LinearRegression().fit(T[["T1", "T3"]], T["T2"])
    complete = LATER.temperatures.assign(T2=wanted.predict(LATER.temperatures[["T1", "T3"]]))
    with pytest.warns(UserWarning, match="the other sensors: 'T2'. Standard deviations"):
        predicted = fitted().predict(without("T2"))
    np.testing.assert_allclose(predicted, fitted().predict(complete), rtol=1e-6)
    with pytest.warns(UserWarning, match="faulty-sensor"):
        theta = fitted().predict_parameters(without("T2"))
    numerical = fitted().model.frequencies(theta.to_numpy())
    np.testing.assert_allclose(predicted, as_measured(fitted(), numerical, without("T2")), rtol=1e-12)
    assert fitted().extrapolation_distance(without("T2")).notna().all(axis=None)


@pytest.mark.filterwarnings("ignore:.*faulty-sensor")
@pytest.mark.parametrize("sensor", list(T))
def test_intervals_hold_their_share_where_a_sensor_died_after_training(sensor):
    lowest, highest = fitted().predict_interval(without(sensor))
    held = ((lowest < LATER.frequencies) & (LATER.frequencies < highest)).to_numpy().mean()
    assert held == pytest.approx(0.9, abs=0.04)


@pytest.mark.filterwarnings("ignore:.*faulty-sensor")
def test_standard_deviations_add_the_change_by_a_filled_temperature_in_quadrature():
    weather = without("T2")
    filled, deviations = fitted().sensors_.fill(weather)
    predicted, std = fitted().predict(weather, return_std=True)
    sides = (pd.DataFrame(filled + side, T.index, T.columns) for side in (-deviations, deviations))
    moved = [fitted().predict(side.set_axis(weather.index)) for side in sides]
    change = np.sqrt(np.mean([np.log(one / predicted) ** 2 for one in moved], axis=0))
    spread = fitted().recorder_.residuals.spread(filled)
    np.testing.assert_allclose(std, predicted * np.hypot(spread, change), rtol=1e-9)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*faulty-sensor")
def test_a_filled_temperature_costs_wherever_a_lag_reaches_it():
    lagged = chain(mapper=make_pipeline(LagFeatures([0, 2]), PLAIN)).fit(T, F)
    holed = LATER.temperatures.copy()
    holed.iloc[100:103, 1] = np.nan
    std = lagged.predict(holed, True)[1]
    plain = lagged.predict(holed)
    inputs = lagged.mapper_[:-1].transform(pd.DataFrame(lagged.sensors_.fill(holed)[0], holed.index, holed.columns))
    wider = (std > plain * lagged.recorder_.residuals.spread(inputs.to_numpy()) * (1 + 1e-9)).any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(wider), np.arange(100, 105))
