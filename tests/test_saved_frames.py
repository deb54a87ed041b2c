"""Frames within saved objects come back as they were."""

import pickle

import numpy as np
import pandas as pd
import pytest

from skthermo._core.saved_frames import SavedTable, SavedTime, from_saved, to_saved

VALUES = np.arange(6.0).reshape(3, 2)
HOURS = pd.date_range("2025-01-01", periods=3, freq="h", name="time")
TABLES = {
    "range": pd.DataFrame(VALUES, columns=["f1", "f2"]),
    "whole numbers": pd.DataFrame(VALUES.astype("int64"), columns=["f1", 4]),
    "true or false": pd.DataFrame(VALUES > 2, HOURS),
    "hours": pd.DataFrame(VALUES, HOURS),
    "zone": pd.DataFrame(VALUES, HOURS.tz_localize("Europe/Brussels")),
    "seconds": pd.DataFrame(VALUES, HOURS.as_unit("s")),
    "gap": pd.DataFrame(VALUES, pd.DatetimeIndex(["2025-01-02", None, "2025-01-01"])),
    "names": pd.DataFrame(VALUES, ["a", "b", "c"]),
    "numbers": pd.DataFrame(VALUES, [3, 1, 2]),
    "mixed": pd.DataFrame(VALUES, pd.Index(["a", 1, ("b", 2)], tupleize_cols=False)),
    "series": pd.Series([1.0, np.nan], ["f1", "f2"], name="offset (%)"),
    "empty": pd.Series([], [], dtype="int64"),
    "no column": pd.DataFrame(index=HOURS),
    "series of texts": pd.Series(["x", None, "y"], HOURS),
    "texts": pd.DataFrame({"a": [1.0, 2.0], "b": ["x", None], "c": ["y", "z"]}),
    "times": pd.DataFrame({"from": HOURS, "to": HOURS.tz_localize("Europe/Brussels"), "rows": [1, 2, 3]}),
}
TIMES = [
    pd.Timestamp("2026-03-29 01:30"),
    pd.Timestamp("2026-10-25 02:30+01:00").tz_convert("Europe/Brussels"),
    pd.Timestamp("2026-10-25 01:30:00.000000001", tz="UTC"),
    pd.Timestamp("1890-01-01").as_unit("s"),
    pd.Timedelta("-7D"),
    pd.Timedelta("90min").as_unit("ms"),
]
OTHERS = {
    "levels": pd.DataFrame(VALUES, pd.MultiIndex.from_tuples([(1, 2), (3, 4), (5, 6)])),
    "periods": pd.DataFrame(VALUES, pd.period_range("2025", periods=3, freq="Y")),
    "array": VALUES,
}


def assert_same(got, expected):
    if isinstance(expected, pd.DataFrame):
        pd.testing.assert_frame_equal(got, expected, check_freq=True, check_index_type="exact", check_exact=True)
    else:
        pd.testing.assert_series_equal(got, expected, check_index_type="exact", check_exact=True)


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_a_table_is_exactly_the_frame_again(table):
    saved = pickle.loads(pickle.dumps(to_saved((table, 1.0))))
    assert isinstance(saved[0], SavedTable)
    got, number = from_saved(saved)
    assert number == 1.0
    assert_same(got, table)


@pytest.mark.parametrize("value", OTHERS.values(), ids=OTHERS)
def test_what_a_table_would_change_stays_as_it_is(value):
    assert to_saved(value) is value
    assert from_saved(value) is value


def test_frames_with_attributes_stay_as_they_are():
    table = TABLES["hours"].copy()
    table.attrs["unit"] = "Hz"
    assert to_saved(table) is table


@pytest.mark.parametrize("time", TIMES, ids=str)
def test_a_number_is_exactly_the_time_again(time):
    saved = pickle.loads(pickle.dumps(to_saved((time,))))
    assert isinstance(saved[0], SavedTime)
    (got,) = from_saved(saved)
    assert type(got) is type(time)
    assert (got, str(got), got.unit, getattr(got, "tz", None)) == (
        time,
        str(time),
        time.unit,
        getattr(time, "tz", None),
    )


def test_a_time_that_does_not_exist_stays_as_it_is():
    assert to_saved(pd.NaT) is pd.NaT
