"""Clocks that are set forward or back: days have a first moment, and monitors go on."""

import itertools
import pickle
import warnings
from functools import cache

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss_campaign
from skthermo.monitoring import Monitor

MODES = [f"f{i + 1}" for i in range(6)]
AT_MIDNIGHT = "Africa/Cairo"  # where clocks are changed
OTHERS = ["America/Santiago", "Australia/Lord_Howe", "Africa/Casablanca", "Europe/Dublin", "Pacific/Kiritimati"]
"""In the south at midnight; by half an hour; in Ramadan; back in winter by law; never, and fourteen hours ahead."""
PER_DAY, N_BASELINE = 4, 4 * 365


@cache
def campaign():
    two = make_truss_campaign(2, samples_per_year=N_BASELINE, samples_per_day=PER_DAY, noise=0.003, random_state=0)
    return two.temperatures.join(two.frequencies)


def in_zone(zone, start):
    """The campaign with stamps every six hours."""
    stamps = pd.date_range(start, periods=len(campaign()), freq="6h", tz="UTC").tz_convert(zone)
    return campaign().set_axis(stamps)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*(few-records|doubtful-values|not-evaluated)")
@pytest.mark.parametrize(("begin", "change"), [("2025-04-10", "2026-04-23"), ("2025-10-15", "2026-10-29")])
def test_records_about_a_change_of_clocks_give_the_same_in_one_batch_as_in_many(begin, change):
    records = in_zone(AT_MIDNIGHT, begin)[: N_BASELINE + 35 * PER_DAY]
    assert len({stamp.utcoffset() for stamp in records.index[N_BASELINE:]}) == 2
    at = records.index.searchsorted(pd.Timestamp(change, tz="UTC"))
    assert_same_in_batches(records, [at - 7, at + 2, at + 29])


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*(few-records|doubtful-values|not-evaluated)")
@pytest.mark.parametrize("zone", [AT_MIDNIGHT, *OTHERS])
def test_a_year_of_records_gives_the_same_in_one_batch_as_in_many(zone):
    assert_same_in_batches(in_zone(zone, "2025-01-01"), [N_BASELINE + day for day in (251, 602, 1001)])


def assert_same_in_batches(records, cuts):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        saved = pickle.dumps(Monitor(targets=MODES, random_state=0).fit(records[:N_BASELINE]))
    whole, parts = pickle.loads(saved), pickle.loads(saved)
    expected = whole.update(records[N_BASELINE:])
    said = [parts.update(records[a:b]) for a, b in itertools.pairwise([N_BASELINE, *cuts, len(records)])]
    np.testing.assert_array_equal(pd.concat(said)["index"], expected["index"])
    assert whole.days_["n_records"].sum() == len(records) - N_BASELINE
    assert (whole.days_.index == parts.days_.index).all()
    assert whole.status(now=records.index[-1]).state == whole.status(whole.last_).state


@pytest.mark.one_case
@pytest.mark.parametrize("start", ["1970-01-01", "1024 weeks later", "the beginning of a year"])
def test_records_of_a_wrong_clock_are_set_aside_in_fit(start):
    records = campaign()[:N_BASELINE]
    stamps = records.index.to_numpy().copy()
    begin = {"1024 weeks later": stamps[500] + pd.Timedelta(weeks=1024), "the beginning of a year": "2024-06-01"}
    stamps[500:520] = pd.date_range(begin.get(start, start), periods=20, freq="6h")
    with pytest.warns(UserWarning, match="wrong-stamps"):
        monitor = Monitor(targets=MODES, random_state=0).fit(records.set_axis(stamps))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = Monitor(targets=MODES, random_state=0).fit(records.drop(records.index[500:520]))
    assert monitor.last_ == records.index[-1]
    assert monitor.threshold_ == expected.threshold_
