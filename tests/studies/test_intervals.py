"""Intervals of rates of alarms, in simulation and against closed forms; `detectability_intervals.py` has more cases."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import beta, norm

from skthermo.studies.detectability._intervals import clopper_pearson, rate_of


def decisions(random, rate, correlation, n_repeats, n_records):
    """Serially correlated Gaussian decisions, negative at a rate that varies over the year, and that rate."""
    shocks = random.standard_normal((n_repeats, n_records + 200))
    noise = lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], shocks, axis=1)[:, 200:]
    season = 0.5 * np.sin(2 * np.pi * np.arange(n_records) / n_records) if n_repeats > 1 else np.zeros(n_records)
    limits = norm.ppf(rate) + season
    return noise - limits, norm.cdf(limits).mean()


@pytest.mark.parametrize(("n_repeats", "correlation", "rate"), [(20, 0.8, 0.02), (3, 0.5, 0.95), (1, 0.8, 0.3)])
def test_bounds_hold_the_rate_as_often_as_they_say(n_repeats, correlation, rate):
    random, held = np.random.RandomState(0), []
    for _ in range(150):
        values, truth = decisions(random, rate, correlation, n_repeats, 365)
        found = rate_of(values)
        held.append(found.lowest <= truth <= found.highest)
    assert np.mean(held) > 0.9  # 95 % asked, of 150: 2.8 standard errors


@pytest.mark.parametrize("n_repeats", [20, 1])
def test_effective_number_is_that_of_the_correlation_of_the_alarms(n_repeats):
    random = np.random.RandomState(0)
    ratios = []
    for _ in range(30):
        values, _ = decisions(random, 0.5, 0.8, n_repeats, 3650 // n_repeats + 365)
        found = rate_of(values)
        ratios.append(found.n_records / found.n_effective)
    lags = np.arange(1, 60)  # correlation of the signs of a Gaussian process: 2/pi arcsin(rho)
    expected = 1 + 2 * (2 / np.pi * np.arcsin(0.8**lags)).sum()
    assert np.median(ratios) == pytest.approx(expected, rel=0.25)


def test_independent_records_nearly_keep_their_number():
    values, _ = decisions(np.random.RandomState(0), 0.3, 0.0, 20, 365)
    found = rate_of(values)
    assert 0.9 * found.n_records < found.n_effective <= found.n_records
    deviation = np.sqrt(found.rate * (1 - found.rate) / found.n_records)
    assert found.highest - found.lowest == pytest.approx(2 * 1.96 * deviation, rel=0.15)


def test_bounds_are_quantiles_of_the_beta_distribution():
    assert clopper_pearson(0, 50, 0.95) == (0.0, pytest.approx(1 - 0.025 ** (1 / 50)))
    assert clopper_pearson(50, 50, 0.95) == (pytest.approx(0.025 ** (1 / 50)), 1.0)
    lowest, highest = clopper_pearson(7.5, 30.2, 0.9)
    assert beta.cdf(lowest, 7.5, 23.7) == pytest.approx(0.05)
    assert beta.sf(highest, 8.5, 22.7) == pytest.approx(0.05)


@pytest.mark.parametrize("sign", [-1, 1])
def test_rates_of_0_and_1_of_correlated_records_have_wide_bounds(sign):
    random = np.random.RandomState(0)
    independent, correlated = (decisions(random, 0.5, rho, 20, 365)[0] + sign * 20 for rho in (0.0, 0.9))
    first, second = rate_of(independent), rate_of(correlated)
    assert first.rate == second.rate == (sign < 0)
    assert first.n_effective > 0.9 * 7300
    assert second.n_effective == pytest.approx(7300 / 19, rel=0.3)  # (1 + 0.9) / (1 - 0.9)
    assert second.highest - second.lowest > 10 * (first.highest - first.lowest)


def test_records_without_a_decision_do_not_count():
    values, _ = decisions(np.random.RandomState(0), 0.3, 0.5, 4, 300)
    gaps = np.random.RandomState(1).uniform(size=values.shape) < 0.2
    gaps[:, 40:90] = True
    found = rate_of(np.where(gaps, np.nan, values))
    assert found.n_records == np.count_nonzero(~gaps)
    assert found.rate == np.mean(values[~gaps] < 0)
    assert found.lowest < found.rate < found.highest
    nothing = rate_of(np.full((2, 10), np.nan))
    assert nothing.n_records == 0
    assert np.isnan(nothing.rate)


def test_repeats_that_are_all_alike_count_once():
    once, _ = decisions(np.random.RandomState(0), 0.3, 0.5, 1, 365)
    single, repeated = rate_of(once), rate_of(np.repeat(once, 20, axis=0))
    assert repeated.n_effective == pytest.approx(single.n_effective)
    assert (repeated.lowest, repeated.highest) == pytest.approx((single.lowest, single.highest))


def test_repeats_with_other_damage_count_as_one_record_each():
    """Half of the repeats have alarms throughout, half have none: 20 coins, whatever the number of records."""
    decisions = np.repeat(np.where(np.arange(20) % 2, 1.0, -1.0)[:, np.newaxis], 400, axis=1)
    whole = rate_of(decisions, whole_repeats=True)
    assert whole.rate == 0.5
    assert 10 < whole.n_effective <= 20
    assert whole.lowest < 0.3
    assert whole.highest > 0.7
