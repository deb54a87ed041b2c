"""Residuals of a baseline: their spread by weather, and noise that is drawn from them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.residuals.baseline import compared, order_statistic
from tests.residuals.series import autoregressive, residuals


@settings(max_examples=40)
@given(st.lists(st.floats(0, 10), min_size=1, max_size=60), st.floats(0.05, 0.95))
def test_order_statistic_is_the_smallest_score_that_enough_scores_reach(scores, confidence):
    scores = np.array(scores)
    enough = [score for score in scores if (scores <= score).sum() >= (len(scores) + 1) * confidence]
    assert order_statistic(scores, confidence) == min(enough, default=np.inf)


@pytest.mark.parametrize("share_missing", [0.0, 0.3])
def test_correlation_time_of_an_autoregressive_series(share_missing):
    series = autoregressive(16_000, 0.8)[:, 0]
    series[np.random.default_rng(1).random(len(series)) < share_missing] = np.nan
    weather = np.random.default_rng(2).uniform(size=len(series))
    found = residuals(weather, series).correlation_time
    assert found == pytest.approx((1 + 0.8) / (1 - 0.8), rel=0.2)
    assert residuals(weather, 7 + 3 * series).correlation_time == pytest.approx(found)


def test_correlation_time_of_series_without_memory_is_one():
    weather, values = np.random.default_rng(0).standard_normal((2, 5000))
    assert residuals(weather, values).correlation_time == pytest.approx(1, abs=0.1)
    assert residuals(weather, np.ones(5000)).correlation_time == 1


def test_spread_of_few_records_is_their_root_mean_square_and_that_of_a_missing_mode_infinite():
    values = np.random.default_rng(0).normal(size=(60, 3))
    values[::3, 1] = values[:, 2] = np.nan
    spread = residuals(np.linspace(0, 20, 60), values).spread(np.array([[0.0], [13.0], [30.0], [-10.0]]))
    rms = np.sqrt(np.nanmean(values[:, :2] ** 2, axis=0))
    np.testing.assert_allclose(spread, np.outer([1, 1, 1.5, 1.5], [*rms, np.inf]))


def test_spread_follows_the_weather():
    weather = np.random.default_rng(0).uniform(-10, 30, 1500)
    values = np.where(weather < 0, 0.02, 0.005) * np.random.default_rng(1).standard_normal(1500)
    spread = residuals(weather, values).spread(np.array([[-6.0], [20.0]]))
    np.testing.assert_allclose(spread[:, 0], [0.02, 0.005], rtol=0.25)


def test_quantiles_measure_each_period_by_the_others():
    """Residuals of one period are twice those of the others, which all have one size."""
    values = np.ones(50)
    values[:10] = 2.0
    found = residuals(np.tile(np.arange(10.0), 5), values)
    others = np.sqrt((30 + 4 * 10) / 40)
    np.testing.assert_allclose(found.quantiles(0.5), 1 / others)
    np.testing.assert_allclose(found.quantiles(0.95), 2.0)


def drawn_records(found, weather, seed=0):
    """Which record the noise of each row begins with; its gaps are those of that record."""
    taken = found._taken(found._similar(weather), np.random.RandomState(seed))
    values = found.draw(weather, np.random.RandomState(seed))
    np.testing.assert_array_equal(np.isnan(values), np.isnan(found.values[taken]))
    return taken


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
    found = residuals(weather, autoregressive(2000, 0.5, n_columns=3))

    def weeks(noise):
        return noise[: 7 * (len(noise) // 7)].reshape(-1, 7, 3).mean(axis=1).var()

    drawn = np.mean([weeks(found.draw(later, np.random.RandomState(seed))) for seed in range(10)])
    assert drawn == pytest.approx(weeks(found.values), rel=0.1)


def test_runs_of_noise_are_scaled_to_the_weather_of_the_rows():
    weather, later = np.random.default_rng(0).uniform(-10, 30, (2, 3000, 1))
    deviation = 1 + (weather < 0)  # twice as large in frost, whatever the record before
    found = residuals(weather, deviation * autoregressive(3000, 0.5))
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


def test_modes_that_are_missing_are_drawn_given_those_that_are_there():
    rng = np.random.default_rng(0)
    weather, later = rng.uniform(-10, 30, (3000, 1)), rng.uniform(-10, 30, (3000, 1))
    values = rng.multivariate_normal([0, 0], [[1, 0.8], [0.8, 1]], 3000)
    complete = residuals(weather, values)
    np.testing.assert_array_equal(
        complete.draw_complete(later, np.random.RandomState(0), False), complete.draw(later, np.random.RandomState(0))
    )
    values[rng.random(3000) < 0.5, 1] = np.nan
    drawn = residuals(weather, values).draw_complete(later, np.random.RandomState(0), True)
    np.testing.assert_allclose(np.cov(drawn.T), [[1, 0.8], [0.8, 1]], atol=0.1)


def test_standard_deviations_of_normal_residuals_are_known_to_a_root_of_their_number():
    values = np.random.default_rng(0).standard_normal((2000, 2))
    found = residuals(np.random.default_rng(1).uniform(size=2000), values)
    np.testing.assert_allclose(found.level_errors, 1 / np.sqrt(2 * 2000), rtol=0.15)
    assert np.isnan(found.outliers).mean() > 0.98


@settings(max_examples=40)
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
    weather, wanted = rng.uniform(-10, 30, (300, 2)), rng.uniform(-10, 30, (20, 2))
    values = np.where(rng.random((300, 3)) < 0.2, np.nan, rng.standard_normal((300, 3)))
    found = residuals(weather, values)

    def results():
        drawn = found.draw(wanted, np.random.RandomState(0))
        return np.hstack([found.expected(wanted), found.spread(wanted), drawn])

    whole = results()
    monkeypatch.setattr("skthermo.residuals.weather.NUMBERS_AT_ONCE", numbers)
    np.testing.assert_allclose(results(), whole, rtol=1e-12)
