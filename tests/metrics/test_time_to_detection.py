"""Time from the onset of damage to the first alarm."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skthermo.metrics import time_to_detection

NAN = float("nan")
INDEX = [5.0, 1.0, 2.0, NAN, 4.0, 5.0]
SERIES = pd.Series(INDEX, pd.date_range("2025-01-01", periods=6, freq="h"))


@given(st.lists(st.floats(0, 10) | st.just(NAN), min_size=1, max_size=30), st.floats(0, 10), st.data())
def test_it_is_the_number_of_records_until_the_first_alarm(index, threshold, data):
    onset = data.draw(st.integers(0, len(index) - 1))
    waits = [row - onset for row in range(onset, len(index)) if index[row] > threshold]
    np.testing.assert_equal(time_to_detection(index, threshold, onset), float(waits[0]) if waits else NAN)


@pytest.mark.parametrize(
    ("onset", "threshold", "expected"), [(0, 3.0, 0), (1, 3.0, 3), (1, 4.0, 4), (3, 3.0, 1), (1, 5.0, NAN)]
)
def test_alarms_before_the_onset_and_missing_indices_do_not_count(onset, threshold, expected):
    found = time_to_detection(INDEX, threshold, onset)
    assert isinstance(found, float)
    np.testing.assert_equal(found, expected)
    np.testing.assert_equal(time_to_detection(pd.Series(INDEX), threshold, onset), expected)


@pytest.mark.parametrize(
    ("onset", "expected"),
    [
        ("2025-01-01 00:00", "0h"),
        ("2025-01-01 01:00", "3h"),
        (pd.Timestamp("2025-01-01 01:20"), "2h 40min"),  # between two records
        (np.datetime64("2025-01-01T01:20"), "2h 40min"),
        (pd.Timestamp("2024-12-31 23:00"), "1h"),  # before the first record
        (SERIES.index[5], "0h"),
        (1, "3h"),
    ],
)
def test_a_series_on_stamps_gives_a_time(onset, expected):
    assert time_to_detection(SERIES, 3.0, onset) == pd.Timedelta(expected)


def test_no_alarm_on_stamps_is_no_time():
    assert time_to_detection(SERIES, 5.0, SERIES.index[1]) is pd.NaT
    zoned = SERIES.tz_localize("Europe/Rome")
    assert time_to_detection(zoned, 3.0, zoned.index[1]) == pd.Timedelta("3h")


def test_the_first_record_is_the_onset_by_default_also_on_stamps():
    assert time_to_detection(SERIES[1:], 3.0) == pd.Timedelta("3h")
