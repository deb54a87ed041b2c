"""Numbers of independent records, errors of means, trailing means and regimes of residuals."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.residuals.baseline import BaselineResiduals
from skthermo.residuals.mean_errors import MeanErrors, chance_of
from skthermo.residuals.numbers import independent_records
from skthermo.residuals.regimes import change_of_scatter
from skthermo.residuals.windows import WindowMeans
from tests.residuals.series import autoregressive


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_independent_records_are_the_variance_over_that_of_the_mean(correlation):
    """Of an autoregression of first order, n (1 - r) / (1 + r) in the limit of many records."""
    n, counts = 3000, [independent_records(autoregressive(3000, correlation, seed)[:, 0]) for seed in range(30)]
    assert np.median(counts) == pytest.approx(n * (1 - correlation) / (1 + correlation), rel=0.3)


def test_columns_together_tell_how_few_records_that_remember_for_long_are_worth():
    counts = [independent_records(autoregressive(60, 0.95, seed, 6)) for seed in range(30)]
    assert np.median(counts) < 8  # the mean of the records scatters as that of 1.5
    rows = autoregressive(600, 0.5, n_columns=3)
    assert independent_records(rows * [1.0, 1e3, 1e-3]) == pytest.approx(independent_records(rows))


def test_numbers_of_independent_records_have_bounds():
    drift = np.cumsum(np.random.default_rng(0).normal(size=500))
    assert 1 <= independent_records(drift) < 15
    assert independent_records(np.append(drift, np.nan)) == independent_records(drift)
    assert independent_records(np.arange(5.0)) == 5
    assert independent_records(np.array([])) == 1


def remembering(kind, seed):
    """Residuals with memory of their own, or with a slow part that all modes share."""
    drawn = autoregressive(400, 0.9 if kind == "memory" else 0.0, seed, 4)
    slow = autoregressive(400, 0.95, 1000 + seed) * [1.0, 0.8, 1.2, 0.5]
    return np.sqrt(0.7) * drawn + np.sqrt(0.3) * slow if kind == "shared" else drawn


@pytest.mark.nightly
@pytest.mark.parametrize("kind", ["independent", "memory", "shared"])
def test_means_of_a_month_are_rarely_improbable(kind):
    chances = []
    for seed in range(100):
        records = remembering(kind, seed)
        covariance, freedom = MeanErrors.learned(records[:365]).of_mean(np.full(4, 30))
        mean = records[-30:].mean(axis=0)
        chances.append(chance_of(mean @ np.linalg.solve(covariance, mean), 4, freedom))
    assert np.mean(np.array(chances) < 0.02) <= 0.06


def test_of_independent_records_the_covariance_is_that_of_a_mean_of_known_noise():
    records = np.random.default_rng(1).standard_normal((6000, 3)) * [1.0, 2.0, 3.0]
    covariance, freedom = MeanErrors.learned(records).stated(np.array([1.0, 2.0, 3.0])).of_mean(np.array([25, 25, 100]))
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), [0.2, 0.4, 0.3], rtol=0.01)
    assert freedom > 1000


def test_modes_without_records_have_no_errors():
    records = np.random.default_rng(2).standard_normal((400, 3))
    records[:390, 1] = np.nan
    covariance, _ = MeanErrors.learned(records).of_mean(np.array([10, 10, 0]))
    assert np.isnan(covariance[[1, 2]]).all()
    assert covariance[0, 0] > 0


@pytest.mark.nightly
@pytest.mark.parametrize("share", [0.2, 0.7])
def test_drawn_noise_has_the_slow_part_of_the_residuals_however_small(share):
    """Means over a week and a month scatter as those of the law: independent records, and a memory of 20 days."""
    weather, ratios = autoregressive(2920, 0.97, 9), []

    def monthly(values):
        return [np.sqrt(pd.DataFrame(values).rolling(length).mean().var().mean()) for length in (56, 240)]

    for seed in range(4):
        fast, slow = autoregressive(2920, 0.0, seed + 50, 4), autoregressive(2920, np.exp(-1 / 160), seed)
        own = 0.003 * (np.sqrt(1 - share**2) * fast + share * slow)
        learned = BaselineResiduals(weather, own, own, np.arange(2920) // 56 % 5)
        drawn = [monthly(learned.draw(weather, np.random.RandomState(number))) for number in range(3)]
        ratios.append(np.mean(drawn, axis=0) / monthly(own))
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1, atol=0.25)


def means(values, window, regime=None, share=0.5, index=None):
    table = pd.DataFrame(values, index)
    regime = np.zeros(len(table), dtype=np.intp) if regime is None else regime
    learned = WindowMeans.fitted(table, regime, window, share)
    return learned, learned(table, regime, is_baseline=True)


@settings(max_examples=12)
@given(st.integers(1, 12), st.integers(0, 1000))
def test_means_are_those_of_the_last_records_without_outliers(window, seed):
    values = np.random.default_rng(seed).uniform(-1, 1, (60, 2))  # within four robust deviations
    found = means(values, window)[1]
    for row in range(60):
        part = values[max(row - window + 1, 0) : row + 1]
        if len(part) >= window / 2:
            np.testing.assert_allclose(found[row], part.mean(axis=0), atol=1e-12)
        else:
            assert np.isnan(found[row]).all()


@pytest.mark.parametrize("window", [2, 3, 8])
def test_an_outlier_moves_a_mean_by_no_more_than_four_robust_deviations(window):
    values = np.random.default_rng(0).normal(size=(400, 1))
    spoiled = values.copy()
    spoiled[100] = 1e6
    quiet, loud = (means(rows, window)[1] for rows in (values, spoiled))
    assert np.nanmax(np.abs(loud - quiet)[window:]) < 8 / window
    assert (loud[np.abs(np.arange(400) - 104) > 8] == quiet[np.abs(np.arange(400) - 104) > 8])[8:].mean() > 0.9


def test_more_change_of_any_record_never_moves_a_mean_back():
    values = np.random.default_rng(0).normal(size=(50, 1))
    learned, found = means(values, 5)
    zero = np.zeros(50, dtype=np.intp)
    for size in (0.5, 2.0, 100.0):
        moved = learned(pd.DataFrame(values + size), zero, is_baseline=True)
        assert (moved - found)[4:].min() >= 0
        found = moved


@pytest.mark.parametrize(("window", "size"), [(1, -30.0), (2, 1e4), (5, -1e4), (24, 30.0)])
def test_a_change_that_lasts_counts_in_full(window, size):
    values = np.random.default_rng(0).normal(size=(200, 2))
    learned, found = means(values, window)
    moved = learned(pd.DataFrame(values + size), np.zeros(200, dtype=np.intp), is_baseline=True)
    np.testing.assert_allclose((moved - found)[window:], size, atol=3)  # the mean is near the median


def test_means_are_taken_within_a_regime_and_time():
    stamps = pd.date_range("2025", periods=48, freq="h")
    values, regime = np.random.default_rng(1).uniform(-1, 1, (48, 1)), np.arange(48) % 2
    found = means(values, "6h", regime, index=stamps)[1]
    np.testing.assert_allclose(found[20], values[[16, 18, 20]].mean(axis=0))
    np.testing.assert_allclose(found[21], values[[17, 19, 21]].mean(axis=0))


def test_the_records_of_the_baseline_are_the_history_of_later_ones():
    stamps, values = pd.date_range("2025", periods=60, freq="h"), np.random.default_rng(2).uniform(-1, 1, (60, 1))
    for window in (6, "6h"):
        learned, _ = means(values[:48], window, index=stamps[:48])
        later = learned(pd.DataFrame(values[48:], stamps[48:]), np.zeros(12, dtype=np.intp))
        whole = pd.DataFrame(values, stamps).rolling(6).mean()[48:]
        np.testing.assert_allclose(later, whole, atol=1e-12)


def frosty(seed, factor):
    """Residuals of ten modes over two years of days, which scatter more in frost."""
    random = np.random.default_rng(seed)
    T = 10 - 12 * np.cos(2 * np.pi * np.arange(730) / 365) + random.normal(0, 3, 730)
    scale = np.where(T < 0, factor, 1.0)[:, np.newaxis]
    weather = np.column_stack([random.normal(size=730), T])
    return weather, 0.01 * scale * random.normal(size=(730, 3)), np.arange(730) // 14 % 5


@pytest.mark.one_case
@pytest.mark.parametrize("seed", range(3))
def test_a_change_of_scatter_is_found_where_it_is_and_nowhere_else(seed):
    column, value = change_of_scatter(*frosty(seed, 3.0))
    assert column == 1
    assert -4 < value < 4
    assert change_of_scatter(*frosty(seed, 1.0)) is None


def test_one_cold_week_is_no_regime():
    weather, residuals, folds = frosty(0, 1.0)
    week = slice(140, 154)
    weather[week, 1] -= 60
    residuals[week] *= 5
    assert change_of_scatter(weather, residuals, folds) is None
