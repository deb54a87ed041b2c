"""A monitored truss whose bottom chord is damaged from 2027-02-01 on, with a record a day."""

import warnings
from functools import cache

import pandas as pd
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss_campaign
from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.monitoring import Monitor

FIRST = 730  # row of the first record after the baseline, 2027-01-01
DAMAGED = FIRST + 31


def joined(campaign):
    return campaign.temperatures.join(campaign.frequencies)


def truss_records():
    return joined(make_truss_campaign(3, damage={"bottom": 0.3}, damage_from="2027-02-01", random_state=0))


@cache
def six_hourly():
    """Two healthy years."""
    campaign = make_truss_campaign(2, samples_per_year=4 * 365, samples_per_day=4, noise=0.003, random_state=0)
    return joined(campaign)


def quietly(call, *args, **named):
    """Without warnings, such as those of few records."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return call(*args, **named)


def fitted_monitor(records, regressor=None, **parameters):
    targets = [name for name in records if name.startswith("f")]
    regressor = regressor or LinearRegression()
    detector = CompensatedDetector(MahalanobisDetector(), regressor, targets=targets, window="5D", regimes=None)
    return Monitor(detector, **parameters).fit(records[:FIRST])


def assert_same_history(one, other):
    """Two monitors have said the same, to the last bit."""
    for name in ("evaluations_", "events_", "days_", "faults_", "records_", "baseline_"):
        pd.testing.assert_frame_equal(getattr(one, name), getattr(other, name), check_exact=True, check_freq=False)
    assert one.counts_ == other.counts_
    assert one.summary() == other.summary()
