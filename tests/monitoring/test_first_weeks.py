"""Laws of a monitor whose baseline is a few weeks, and whose regression knows what it does not know."""

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline

from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.monitoring import Monitor
from tests.bayesian import MEAN, NOISE, WIDTH, BayesianLogs, Logs, records_of

MODES = ["f1", "f2"]
WEEKS, YEAR = 60, 365

pytestmark = [
    pytest.mark.filterwarnings(f"ignore:.*{message}")
    for message in (
        "few-records",
        "other-weather",
        "doubtful-values",
        "not-evaluated",
    )
]


def served(seed, days=WEEKS + YEAR, damage=0.0):
    records = records_of(seed, days, np.eye(2))
    records.loc[records.index[WEEKS + 100 :], MODES] *= 1 - damage * np.array([1.0, 0.3])
    return records


def monitor_of(regressor=BayesianLogs, **options):
    estimator = regressor(MEAN, WIDTH, NOISE)
    compensator = TemperatureCompensator(estimator, targets=MODES, **options)
    return Monitor(make_pipeline(compensator, MahalanobisDetector()), sensors=False)


def test_a_record_in_unknown_weather_is_healthy_only_if_a_large_fall_would_be_seen_there():
    records = served(1)
    monitor = monitor_of().fit(records[:WEEKS])
    share = max(3 * monitor.smallest_changes_.common, 0.05)
    answers = monitor.update(records[WEEKS:])
    fallen = records.copy()
    fallen[MODES] *= 1 - share
    is_seen = -monitor.detector_.score_samples(fallen)[WEEKS:] > monitor.threshold_
    is_healthy, is_far = answers["state"] == "healthy", answers["reason"].str.contains("extrapolated")
    assert is_seen[is_healthy & is_far].all()
    blind = answers[is_far & ~is_seen]
    assert 0 < len(blind) < is_healthy.sum()
    assert set(blind["state"]) == {"not evaluated"}


@pytest.mark.nightly
def test_winter_weeks_keep_the_false_alarm_rate_of_a_year_and_find_damage():
    events, unaware, found = [], [], []
    for seed in range(6):
        records, damaged = served(seed), served(seed, damage=0.1)
        monitor = monitor_of().fit(records[:WEEKS])
        monitor.update(records[WEEKS:])
        events.append(len(monitor.events_))
        hurt = monitor_of().fit(damaged[:WEEKS])
        hurt.update(damaged[WEEKS:])
        found.append((hurt.events_["start"] >= damaged.index[WEEKS + 100]).any())
        silent = monitor_of(Logs).fit(records[:WEEKS])
        silent.update(records[WEEKS:])
        unaware.append(len(silent.events_))
    assert np.mean(events) < 1  # in a year, as asked
    assert np.mean(events) < np.mean(unaware)
    assert np.mean(found) > 0.8
