"""Laws of what the chain says about its own errors: spread, intervals, realistic noise."""

import pickle
from contextlib import nullcontext
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import BlockedKFold, LagFeatures
from skthermo.residuals.baseline import BaselineResiduals, compared, order_statistic
from skthermo.surrogate import TemperatureMapper
from tests.surrogate.chains import F, T, as_measured, inverse, trained
from tests.surrogate.chains import chain as any_chain

# Vertical stiffness hardly moves the frequencies, so that its estimates scatter with the noise.
pytestmark = pytest.mark.filterwarnings("ignore:.*outside-bounds")

LATER = make_truss_campaign(random_state=1)
PLAIN = TemperatureMapper(LinearRegression())


def chain(mapper=PLAIN, **options):
    return any_chain(inverse=inverse(noise=0.01), mapper=mapper, **options)


@cache
def fitted():
    return chain().fit(T, F)


def residuals(weather, values, n_folds=5):
    folds = np.arange(len(values)) * n_folds // len(values)
    values = np.reshape(values, (len(values), -1))
    return BaselineResiduals(np.reshape(weather, (len(values), -1)), values, values, folds)


def autoregressive(n_records, rho, seed=0):
    noise, series = np.random.default_rng(seed).standard_normal(n_records), np.zeros(n_records)
    for record in range(1, n_records):
        series[record] = rho * series[record - 1] + np.sqrt(1 - rho**2) * noise[record]
    return series


# Order statistics and correlation times


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(0, 10), min_size=1, max_size=60), st.floats(0.05, 0.95))
def test_order_statistic_is_the_smallest_score_that_enough_scores_reach(scores, confidence):
    scores = np.array(scores)
    enough = [score for score in scores if (scores <= score).sum() >= (len(scores) + 1) * confidence]
    assert order_statistic(scores, confidence) == min(enough, default=np.inf)


@pytest.mark.parametrize("share_missing", [0.0, 0.3])
def test_correlation_time_of_an_autoregressive_series(share_missing):
    series = autoregressive(20_000, 0.8)
    series[np.random.default_rng(1).random(len(series)) < share_missing] = np.nan
    weather = np.random.default_rng(2).uniform(size=len(series))
    found = residuals(weather, series).correlation_time
    assert found == pytest.approx((1 + 0.8) / (1 - 0.8), rel=0.2)
    assert residuals(weather, 7 + 3 * series).correlation_time == pytest.approx(found)


def test_correlation_time_of_series_without_memory_is_one():
    weather, values = np.random.default_rng(0).standard_normal((2, 5000))
    assert residuals(weather, values).correlation_time == pytest.approx(1, abs=0.1)
    assert residuals(weather, np.ones(5000)).correlation_time == 1


# Spread


def test_spread_of_few_records_is_their_root_mean_square():
    rng = np.random.default_rng(0)
    weather, values = np.linspace(0, 20, 60), rng.normal(size=(60, 2))
    values[::3, 1] = np.nan
    spread = residuals(weather, values).spread(np.array([[0.0], [13.0], [30.0], [-10.0]]))
    rms = np.sqrt(np.nanmean(values**2, axis=0))
    np.testing.assert_allclose(spread, np.outer([1, 1, 1.5, 1.5], rms))


def test_spread_follows_the_weather():
    weather = np.random.default_rng(0).uniform(-10, 30, 1500)
    scale = np.where(weather < 0, 0.02, 0.005)
    spread = residuals(weather, scale * np.random.default_rng(1).standard_normal(1500)).spread(
        np.array([[-6.0], [20.0]])
    )
    np.testing.assert_allclose(spread[:, 0], [0.02, 0.005], rtol=0.25)


def test_spread_of_a_mode_that_is_always_missing_is_infinite():
    values = np.column_stack([np.ones(50), np.full(50, np.nan)])
    np.testing.assert_array_equal(residuals(np.arange(50.0), values).spread(np.array([[3.0]])), [[1, np.inf]])


def test_quantiles_measure_each_period_by_the_others():
    """Residuals of one period are twice those of the others, which all have one size."""
    values = np.ones(50)
    values[:10] = 2.0
    found = residuals(np.tile(np.arange(10.0), 5), values)
    others = np.sqrt((30 + 4 * 10) / 40)
    np.testing.assert_allclose(found.quantiles(0.5), 1 / others)
    np.testing.assert_allclose(found.quantiles(0.95), 2.0)


# Realistic noise


def drawn_records(found, weather, seed=0):
    """Which record the noise of each row begins with; its gaps are those of that record."""
    taken = found._taken(found._similar(weather), np.random.RandomState(seed))
    values = found.draw(weather, np.random.RandomState(seed))
    np.testing.assert_array_equal(np.isnan(values), np.isnan(found.values[taken]))
    return taken


def test_noise_is_whole_records_gaps_included():
    rng = np.random.default_rng(0)
    values = rng.normal(size=(400, 3))
    values[:, 1:][rng.random((400, 2)) < 0.3] = np.nan
    found = residuals(rng.uniform(-10, 30, (400, 2)), values)
    weather = rng.uniform(-10, 30, (500, 2))
    taken = drawn_records(found, weather)
    np.testing.assert_array_equal(taken, drawn_records(found, weather))
    assert (taken != drawn_records(found, weather, seed=1)).mean() > 0.5
    assert len(set(taken)) > 150


def test_noise_comes_from_similar_weather():
    rng = np.random.default_rng(0)
    weather, wanted = rng.uniform(-10, 30, 600), rng.uniform(-10, 30, 300)
    taken = drawn_records(residuals(weather, rng.normal(size=600)), wanted[:, np.newaxis])
    distance = np.abs(weather[taken] - wanted)
    assert distance.mean() < 0.1 * np.abs(rng.permutation(weather)[:300] - wanted).mean()
    assert distance.max() < 4  # a tenth of the weather


def test_noise_keeps_the_serial_correlation_of_the_records():
    weather = 10 + 15 * np.sin(np.arange(1500) * 2 * np.pi / 500)
    later = weather[:, np.newaxis]
    for rho, lowest, highest in ((0.8, 0.7, 1.0), (0.0, 0.0, 0.15)):
        found = residuals(weather, autoregressive(1500, rho))
        taken = drawn_records(found, later)
        assert lowest <= (np.diff(taken) == 1).mean() <= highest
        drawn = found.draw(later, np.random.RandomState(0))[:, 0]
        assert np.corrcoef(drawn[1:], drawn[:-1])[0, 1] == pytest.approx(rho, abs=0.15)


def test_means_of_a_week_scatter_as_those_of_the_records_whatever_the_weather_does():
    rng = np.random.default_rng(0)
    weather, later = rng.uniform(-10, 30, (2000, 3)), rng.uniform(-10, 30, (2000, 3))
    found = residuals(weather, np.column_stack([autoregressive(2000, 0.5, seed) for seed in range(3)]))

    def weeks(noise):
        return noise[: 7 * (len(noise) // 7)].reshape(-1, 7, 3).mean(axis=1).var()

    drawn = np.mean([weeks(found.draw(later, np.random.RandomState(seed))) for seed in range(10)])
    assert drawn == pytest.approx(weeks(found.values), rel=0.1)


def test_runs_of_noise_are_scaled_to_the_weather_of_the_rows():
    rng = np.random.default_rng(0)
    weather, later = rng.uniform(-10, 30, (3000, 1)), rng.uniform(-10, 30, (3000, 1))
    deviation = 1 + (weather < 0)  # twice as large in frost, whatever the record before
    found = residuals(weather, deviation * autoregressive(3000, 0.5)[:, np.newaxis])
    drawn = found.draw(later, np.random.RandomState(0))
    assert drawn[later < -2].std() == pytest.approx(2.0, rel=0.15)
    assert drawn[later > 2].std() == pytest.approx(1.0, rel=0.1)


def test_noise_is_not_bounded_by_the_largest_residual_and_keeps_its_covariance():
    rng = np.random.default_rng(0)
    found = residuals(rng.uniform(-10, 30, (200, 2)), rng.multivariate_normal([0, 0], [[1, 0.8], [0.8, 1]], 200))
    later = rng.uniform(-10, 30, (20_000, 2))
    drawn = found.draw(later, np.random.RandomState(0))
    assert np.abs(drawn).max() > np.abs(found.values).max()
    np.testing.assert_allclose(np.cov(drawn.T), np.cov(found.values.T), rtol=0.1)


@pytest.mark.nightly
def test_simulations_scatter_like_the_training_records():
    holed = F.mask(np.random.default_rng(0).random(F.shape) < 0.1)
    fem = chain().fit(T, holed)
    clean, noisy = fem.predict(T), fem.simulate(T, noise="fitted", random_state=0)
    records = fem.recorder_.residuals.values
    assert {tuple(row) for row in np.isnan(noisy.to_numpy())} <= {tuple(row) for row in np.isnan(records)}
    pd.testing.assert_frame_equal(noisy, fem.simulate(T, noise="fitted", random_state=0))
    assert noisy.isna().mean(axis=None) == pytest.approx(0.1, abs=0.03)
    np.testing.assert_allclose((noisy / clean).std(), np.nanstd(records, axis=0), rtol=0.2)
    damaged = fem.simulate(T, damage={"top": 0.3}, noise="fitted", random_state=0)
    np.testing.assert_allclose(damaged / fem.simulate(T, damage={"top": 0.3}), noisy / clean, rtol=1e-12)


def test_noise_of_shuffled_records_is_that_of_records_in_order_of_time():
    shuffled = T.sample(frac=1, random_state=0)
    expected = fitted().simulate(T, noise="fitted", random_state=0)
    pd.testing.assert_frame_equal(
        fitted().simulate(shuffled, noise="fitted", random_state=0).sort_index(), expected, check_freq=False
    )


# Residuals of the chain


def test_residuals_are_those_of_mappers_fitted_to_other_weeks():
    fem = any_chain(inverse=trained(), mapper=PLAIN, discrepancy=None).fit(T, F)
    folds = BlockedKFold(block="7D")
    np.testing.assert_array_equal(fem.recorder_.residuals.folds, folds.fold_of(T))
    for fold, (train, test) in enumerate(folds.split(T)):
        theta = clone(fem.mapper_).fit(T.iloc[train], fem.parameters_.iloc[train]).predict(T.iloc[test])
        predicted = fem.aligner_.inverse_transform(fem.model.frequencies(theta))
        values = fem.recorder_.residuals.values[fem.recorder_.residuals.folds == fold]
        np.testing.assert_allclose(values, F.iloc[test].to_numpy() / predicted - 1, atol=1e-9)


def test_residuals_do_not_know_the_discrepancy_of_their_own_week():
    """A mode that one week alone moves: what is learned there is not in its residuals."""
    week = np.arange(365) // 7 == 20
    fem = chain().fit(T, F.assign(f2=F["f2"] * np.where(week, 1.02, 1.0)))
    of_week = fem.recorder_.residuals.values[week, 1] - fitted().recorder_.residuals.values[week, 1]
    np.testing.assert_allclose(of_week.mean(), 0.02, atol=0.002)


def test_blocks_are_five_correlation_times_long_where_that_is_more_than_a_week():
    hours = pd.date_range("2025", periods=5000, freq="h")
    for rho, table in (
        (0.5, pd.DataFrame(index=hours)),
        (0.99, pd.DataFrame(index=hours)),
        (0.99, np.empty((5000, 1))),
    ):
        time = (1 + rho) / (1 - rho)
        rows = 5 * residuals(np.random.default_rng(1).uniform(size=5000), autoregressive(5000, rho)).correlation_time
        assert rows == pytest.approx(5 * time, rel=0.4)
        block = BlockedKFold().remembering(table, rows).length(table)
        is_timed, rows = isinstance(table, pd.DataFrame), min(rows, 5000 // 10)  # each fold keeps two blocks
        assert block == (max(pd.Timedelta("7D"), np.ceil(rows) * pd.Timedelta("1h")) if is_timed else np.ceil(rows))


def test_blocks_of_a_chain_are_longer_than_a_week_where_noise_lasts():
    lasting = F * (1 + 0.01 * autoregressive(365, 0.9)[:, np.newaxis])
    blocks = [
        np.diff(np.flatnonzero(np.diff(one.recorder_.residuals.folds))) for one in (fitted(), chain().fit(T, lasting))
    ]
    assert set(blocks[0]) == {7}
    assert min(blocks[1]) > 20


def test_folds_in_unseen_weather_are_named(monkeypatch):
    short = chain().fit(T[:150], F[:150])
    monkeypatch.setattr(BlockedKFold, "fold_of", lambda self, X: np.arange(len(X)) // 30)  # contiguous ones
    for _ in range(2):  # each time, also where residuals are known
        with pytest.warns(UserWarning, match="lack: 'T1', 'T2'.*other-weather"):
            short.predict(T[:150], return_std=True)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*wrong-stamps")
@pytest.mark.parametrize("mapper", [PLAIN, make_pipeline(LagFeatures(2), PLAIN)])
def test_residuals_do_not_depend_on_the_order_of_rows(mapper):
    order = np.random.default_rng(0).permutation(len(T))
    sorted_rows, shuffled = (chain(mapper=mapper).fit(T.iloc[rows], F.iloc[rows]) for rows in (slice(None), order))
    np.testing.assert_allclose(shuffled.recorder_.residuals.values, sorted_rows.recorder_.residuals.values, atol=1e-6)
    np.testing.assert_allclose(shuffled.recorder_.residuals.weather, sorted_rows.recorder_.residuals.weather)


@pytest.mark.nightly
@pytest.mark.parametrize(
    "mapper",
    [
        make_pipeline(LagFeatures(2, padding="nan"), PLAIN),
        GridSearchCV(TemperatureMapper(Ridge()), {"regressor__alpha": [0.1, 1.0]}, cv=2),
        LinearRegression(),
    ],
)
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
    for one, other in zip(twin.predict_interval(T), fitted().predict_interval(T), strict=True):
        pd.testing.assert_frame_equal(one, other)
    assert not hasattr(clone(fitted()), "_residuals")
    refitted = pickle.loads(pickle.dumps(fitted())).fit(T[:200], F[:200])
    assert len(refitted.recorder_.residuals.values) == 200


# Standard deviations and intervals


def test_standard_deviations_are_spreads_in_hertz():
    frequencies, std = fitted().predict(T, return_std=True)
    pd.testing.assert_frame_equal(frequencies, fitted().predict(T))
    np.testing.assert_allclose(std / frequencies, fitted().recorder_.residuals.spread(T.to_numpy()))
    assert (std > 0).all(axis=None)
    np.testing.assert_allclose((std / frequencies).mean(), 0.01, rtol=0.2)  # the noise of the campaign
    assert isinstance(chain().fit(T.to_numpy(), F.to_numpy()).predict(T[:3].to_numpy(), True)[1], np.ndarray)


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


@pytest.mark.filterwarnings("ignore:1 of 365.*not-evaluated")
@pytest.mark.filterwarnings("ignore:.*not-evaluated")
def test_rows_without_any_temperature_have_no_interval():
    holed = T.copy()
    holed.iloc[3] = np.nan
    tables = (
        *fitted().predict_interval(holed),
        fitted().predict(holed, True)[1],
        fitted().simulate(holed, noise="fitted"),
    )
    for table in tables:
        np.testing.assert_array_equal(table.isna().all(axis=1), np.arange(365) == 3)
        assert table.notna().all(axis=1).sum() == 364


@pytest.mark.nightly
def test_intervals_of_exchangeable_records_hold_the_share_asked():
    temperatures, frequencies = np.vstack([T, LATER.temperatures]), np.vstack([F, LATER.frequencies])
    order = np.random.default_rng(0).permutation(len(temperatures))
    train, test = order[:365], order[365:]
    fem = chain().fit(temperatures[train], frequencies[train])
    for confidence in (0.5, 0.9):
        lowest, highest = fem.predict_interval(temperatures[test], confidence)
        held = (lowest < frequencies[test]) & (frequencies[test] < highest)
        assert held.mean() == pytest.approx(confidence, abs=0.05)


@pytest.mark.filterwarnings("ignore:.*other-weather")
def test_intervals_widen_beyond_the_training_weather():
    middle, beyond = T.mean().to_frame().T, T.max().to_frame().T + 30
    widths = [(highest / lowest).to_numpy() for lowest, highest in map(fitted().predict_interval, (middle, beyond))]
    assert (widths[1] > widths[0]).all()


# Missing temperatures


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
    moved = [
        fitted().predict(pd.DataFrame(filled + side, weather.index, weather.columns))
        for side in (-deviations, deviations)
    ]
    change = np.sqrt(np.mean([np.log(one / predicted) ** 2 for one in moved], axis=0))
    spread = fitted().recorder_.residuals.spread(filled)
    np.testing.assert_allclose(std, predicted * np.hypot(spread, change), rtol=1e-9)


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


def test_a_day_whose_lags_reach_back_too_far_is_counted():
    lagged = chain(mapper=make_pipeline(LagFeatures([0, 1, 5], padding="nan"), PLAIN)).fit(T, F)
    day = LATER.temperatures.set_axis(LATER.temperatures.index + pd.Timedelta("900D"))
    day.iloc[8] = np.nan
    message = "rows without any temperature, and rows with lags .*not-evaluated"
    with pytest.warns(UserWarning, match=message):
        assert lagged.predict(day).isna().any(axis=1).sum() == 8


# Many records


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.integers(1, 60))
def test_of_many_records_the_most_complete_one_of_each_part_counts_for_all_modes(seed, n_records, most):
    random = np.random.default_rng(seed)
    values = np.where(random.random((n_records, 3)) < 0.3, np.nan, random.normal(size=(n_records, 3)))
    there, counts = ~np.isnan(values), compared(values, most)
    assert not (counts & ~there).any()
    n_there = there.sum(axis=1)
    rows, chosen = np.flatnonzero(n_there), np.flatnonzero(counts.any(axis=1))
    assert np.array_equal(counts[chosen], there[chosen])
    assert len(chosen) == min(most, len(rows))
    if len(rows) > most:
        parts = [rows[np.arange(len(rows)) * most // len(rows) == part] for part in range(most)]
        assert all(one in part and n_there[one] == n_there[part].max() for one, part in zip(chosen, parts, strict=True))


def test_few_of_many_records_tell_as_much(monkeypatch):
    """Neighbours among a part of the records, which bounds their number, give the same means but for chance."""
    rng = np.random.default_rng(0)
    weather, wanted = rng.uniform(-10, 30, (6000, 2)), rng.uniform(-8, 28, (200, 2))
    values = 0.01 * np.column_stack([weather[:, 0] / 10, rng.standard_normal(6000)])
    found = residuals(weather, values)
    expected, spread = found.expected(wanted), found.spread(wanted)
    monkeypatch.setattr("skthermo.residuals.baseline.MOST_PLACES", 2000)
    monkeypatch.setattr("skthermo.residuals.baseline.MOST_SIMILAR", 200)
    few = residuals(weather, values)
    np.testing.assert_allclose(few.expected(wanted), expected, atol=0.003)
    np.testing.assert_allclose(few.spread(wanted), spread, atol=0.004)


@pytest.mark.parametrize("numbers", [1, 700])
def test_results_do_not_depend_on_how_many_rows_are_held_in_memory(monkeypatch, numbers):
    rng = np.random.default_rng(0)
    weather, wanted = rng.uniform(-10, 30, (300, 2)), rng.uniform(-10, 30, (50, 2))
    values = np.where(rng.random((300, 3)) < 0.2, np.nan, rng.standard_normal((300, 3)))
    found = residuals(weather, values)

    def results():
        drawn = found.draw(wanted, np.random.RandomState(0))
        return np.hstack([found.expected(wanted), found.spread(wanted), drawn])

    whole = results()
    monkeypatch.setattr("skthermo.residuals.weather.NUMBERS_AT_ONCE", numbers)
    np.testing.assert_allclose(results(), whole, rtol=1e-12)
