"""A monitored truss whose bottom chord is damaged from 2027-02-01 on, with a record a day."""

import pandas as pd
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss_campaign
from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.monitoring import Monitor

FIRST = 730  # row of the first record after the baseline, 2027-01-01
DAMAGED = FIRST + 31


def truss_records():
    campaign = make_truss_campaign(3, damage={"bottom": 0.3}, damage_from="2027-02-01", random_state=0)
    return campaign.temperatures.join(campaign.frequencies)


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
