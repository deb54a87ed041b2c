"""The smallest changes that a threshold still detects."""

import copy
import warnings
from functools import cache

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.exceptions import FewRecordsWarning
from skthermo.monitoring import Monitor
from skthermo.surrogate import TemperatureMapper

MODES, PER_DAY = ["f1", "f2", "f3"], 4
pytestmark = pytest.mark.filterwarnings("ignore:.*(other-weather|not-evaluated|few-records)")


@cache
def bridge(n_days=500, noise=0.003, slope=1e-3, seed=0):
    """Two thermometers and three natural frequencies, six-hourly, from January on."""
    rng, n = np.random.default_rng(seed), n_days * PER_DAY
    day = np.arange(n) / PER_DAY
    slow = np.repeat(rng.normal(0, 2.5, n_days), PER_DAY)
    air = 10 - 12 * np.cos(2 * np.pi * day / 365.25) + 5 * np.sin(2 * np.pi * day) + slow
    T = air[:, np.newaxis] + [0, 1] + rng.normal(0, 0.3, (n, 2))
    F = np.array([2.0, 3.0, 5.0]) * (1 - slope * air[:, np.newaxis] + rng.normal(0, noise, (n, 3)))
    stamps = pd.date_range("2025-01-01", periods=n, freq="6h")
    return pd.DataFrame(np.hstack([T, F]), stamps, ["T1", "T2", *MODES])


def fitted(records, window="1D", **options):
    detector = CompensatedDetector(MahalanobisDetector(), LinearRegression(), targets=MODES, window=window)
    return Monitor(detector, **options).fit(records)


@cache
def of_a_year(window, rule):
    """Its monitor after a year, to be copied before it is changed."""
    return fitted(bridge()[:"2025"], window, persistence=rule)


DAILY = [(None, 3, MODES), (None, (4, 6), ["f3"])]
EACH = [(last, rule, modes) for last in (None, "1D") for rule in (3, (4, 6)) for modes in (MODES, ["f1"], ["f3"])]


@pytest.mark.parametrize(
    ("window", "rule", "modes"), [pytest.param(*one, marks=() if one in DAILY else pytest.mark.nightly) for one in EACH]
)
def test_a_larger_change_raises_an_alarm_in_time_and_a_smaller_one_leaves_most_records_below(window, rule, modes):
    monitor, share = copy.deepcopy(of_a_year(window, rule)), 0.5 if rule == 3 else 3.5 / 6
    changes = monitor.smallest_changes_
    size = changes.common if len(modes) > 1 else changes.single[modes[0]]
    new = bridge()["2026":"2026-02"].copy()
    above = []
    for factor in (0.7, 1.3):
        fallen = new.copy()
        fallen[modes] *= 1 - factor * size
        above.append((-monitor.detector_.score_samples(fallen)[8:] > monitor.threshold_).mean())
    assert above[0] < share < above[1]
    answers = monitor.update(fallen)
    assert (answers.loc[answers.index[0] + changes.within :, "state"] == "alarm").mean() > 0.9
    assert changes.within < pd.Timedelta("3D")


def test_memory_of_the_weather_delays_no_alarm():
    """A month of earlier temperatures moves no mean of residuals: an alarm follows within the window and five steps."""
    plain, remembering = LinearRegression(), TemperatureMapper(means=("20D",))
    for regressor, reach in ((plain, "1D"), (remembering, "100D")):
        whole = CompensatedDetector(MahalanobisDetector(), regressor, targets=MODES, window="1D", regimes=None)
        monitor = Monitor(whole, sensors=False).fit(bridge()[:"2025-08"])
        assert monitor.lookback_.duration(pd.Timedelta("6h")) >= pd.Timedelta(reach)
        assert monitor.smallest_changes_.within == pd.Timedelta("1D") + 5 * pd.Timedelta("6h")


@pytest.mark.nightly
def test_responses_about_zero_have_falls_in_their_units_and_none_in_common():
    about_zero = bridge()[:"2025"].copy()
    about_zero[MODES] -= about_zero[MODES].mean()
    first = fitted(about_zero).smallest_changes_
    about_zero[MODES] *= 10
    second = fitted(about_zero).smallest_changes_
    assert np.isnan(first.common)
    np.testing.assert_allclose(list(second.single.values()), 10 * np.array(list(first.single.values())), rtol=1e-6)
    assert first.as_dict()["common"] is None


def test_a_short_baseline_says_in_its_warning_what_is_seen():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        monitor = fitted(bridge(noise=0.01)[: 24 * PER_DAY], None)
    (found,) = [one for one in caught if "few-records" in str(one.message)]
    assert issubclass(found.category, FewRecordsWarning)
    assert str(monitor.smallest_changes_) in str(found.message)
