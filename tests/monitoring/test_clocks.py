"""Clocks that are set forward or back: days have a first moment, and monitors go on."""

import itertools
import pickle

import numpy as np
import pandas as pd
import pytest

from skthermo.monitoring import Monitor
from tests.monitoring.nightly import quietly, six_hourly

MODES = [f"f{i + 1}" for i in range(6)]
ZONES = ["Africa/Cairo", "America/Santiago", "Australia/Lord_Howe", "Africa/Casablanca", "Europe/Dublin"]
"""At midnight, also in the south; by half an hour; in Ramadan; back in winter by law."""
N_BASELINE = 4 * 365
pytestmark = pytest.mark.filterwarnings("ignore:.*(few-records|doubtful-values|not-evaluated)")


@pytest.mark.nightly
@pytest.mark.parametrize("zone", [*ZONES, "Pacific/Kiritimati"])
def test_a_year_of_records_gives_the_same_in_one_batch_as_in_many(zone):
    stamps = pd.date_range("2025-01-01", periods=len(six_hourly()), freq="6h", tz="UTC").tz_convert(zone)
    records = six_hourly().set_axis(stamps)
    assert len({stamp.utcoffset() for stamp in stamps[N_BASELINE:]}) == (1 if "Kiritimati" in zone else 2)
    saved = pickle.dumps(quietly(Monitor(targets=MODES, random_state=0).fit, records[:N_BASELINE]))
    whole, parts = pickle.loads(saved), pickle.loads(saved)
    expected = whole.update(records[N_BASELINE:])
    cuts = [N_BASELINE, *(N_BASELINE + day for day in (251, 602, 1001)), len(records)]
    said = [parts.update(records[a:b]) for a, b in itertools.pairwise(cuts)]
    np.testing.assert_array_equal(pd.concat(said)["index"], expected["index"])
    assert whole.days_["n_records"].sum() == len(records) - N_BASELINE
    assert (whole.days_.index == parts.days_.index).all()
    assert whole.status(now=records.index[-1]).state == whole.status(whole.last_).state
    utc = quietly(Monitor(targets=MODES, random_state=0).fit, records[:N_BASELINE].tz_convert("UTC"))
    of_utc = utc.update(records[N_BASELINE : cuts[1]].tz_convert("UTC"))
    np.testing.assert_array_equal(of_utc["index"], expected["index"][: len(of_utc)])


@pytest.mark.one_case
@pytest.mark.parametrize("start", ["1970-01-01", "1024 weeks later", "the beginning of a year"])
def test_records_of_a_wrong_clock_are_set_aside_in_fit(start):
    records = six_hourly()[:400]
    stamps = records.index.to_numpy().copy()
    begin = {"1024 weeks later": stamps[200] + pd.Timedelta(weeks=1024), "the beginning of a year": "2024-06-01"}
    stamps[200:220] = pd.date_range(begin.get(start, start), periods=20, freq="6h")
    with pytest.warns(UserWarning, match="wrong-stamps"):
        monitor = Monitor(targets=MODES, random_state=0).fit(records.set_axis(stamps))
    expected = quietly(Monitor(targets=MODES, random_state=0).fit, records.drop(records.index[200:220]))
    assert monitor.last_ == records.index[-1]
    assert monitor.threshold_ == expected.threshold_
