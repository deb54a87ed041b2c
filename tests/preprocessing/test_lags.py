"""Lagged temperatures, by row and by time."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from skthermo.exceptions import FewRecordsWarning
from skthermo.preprocessing import LagFeatures

HOURS = pd.date_range("2025-01-01", periods=30, freq="h")
T = pd.DataFrame({"T1": np.arange(30.0), "T2": np.arange(30.0) ** 2}, index=HOURS)


def naive_lag(column, stamp, lag, tolerance, padding):
    """The definition, one value at a time, by the hour."""
    wanted = stamp - lag * pd.Timedelta("1h")
    past = column[column.index <= wanted].sort_index()
    if past.empty:
        return column.sort_index().iloc[0] if padding == "edge" else np.nan
    return past.iloc[-1] if wanted - past.index[-1] <= tolerance else np.nan


@settings(max_examples=15)
@given(
    st.lists(st.integers(0, 200), min_size=2, max_size=25, unique=True),
    st.lists(st.integers(0, 12), min_size=1, max_size=4, unique=True),
    st.integers(1, 10),
    st.sampled_from(["edge", "nan"]),
    st.integers(0, 24),
)
@example([0, 24], [0, 1], 1, "edge", 24)
def test_lags_by_time_follow_their_definition(hours, lags, tolerance, padding, missing):
    index = pd.Timestamp("2025-03-01") + pd.to_timedelta(hours, unit="h")
    frame = pd.DataFrame({"a": np.arange(len(hours), dtype=float)}, index=index)
    frame.iloc[missing : missing + 1] = np.nan
    tolerance = pd.Timedelta(hours=tolerance)
    lagged = LagFeatures(lags, freq="1h", tolerance=tolerance, padding=padding).fit_transform(frame)
    expected = [[naive_lag(frame["a"], stamp, lag, tolerance, padding) for lag in lags] for stamp in index]
    np.testing.assert_array_equal(lagged.to_numpy(), expected)
    assert lagged.index.equals(index)


@settings(max_examples=15)
@given(st.integers(1, 40), st.integers(1, 8), st.sampled_from(["edge", "nan"]))
def test_lags_by_row_are_shifts(n_rows, n_lags, padding):
    X = np.random.default_rng(0).standard_normal((n_rows, 2))
    frame = pd.DataFrame(X)
    columns = []
    for sensor in range(2):
        for lag in range(n_lags):
            shifted = frame[sensor].shift(lag)
            columns.append(shifted.fillna(X[0, sensor]) if padding == "edge" else shifted)
    np.testing.assert_array_equal(LagFeatures(n_lags, padding=padding).fit_transform(X), np.column_stack(columns))


def test_a_regular_index_gives_the_same_as_rows():
    by_time = LagFeatures(5).fit_transform(T)
    np.testing.assert_array_equal(by_time.to_numpy(), LagFeatures(5).fit_transform(T.to_numpy()))
    assert list(by_time.columns) == [f"{s}_lag{k}" for s in ("T1", "T2") for k in range(5)]


@pytest.mark.parametrize("freq", ["1h", "2h", "90min"])
@pytest.mark.parametrize("padding", ["edge", "nan"])
def test_evenly_spaced_records_of_fit_take_a_shortcut_to_the_same_values(freq, padding):
    """Without its last row, the frame is not that of fit, and the shortcut is not taken."""
    lags = LagFeatures([0, 1, 3], freq=freq, padding=padding).fit(T)
    pd.testing.assert_frame_equal(lags.transform(T).iloc[:-1], lags.transform(T.iloc[:-1]), check_freq=False)


@pytest.mark.parametrize("tolerance", ["0h", "3h"])
@pytest.mark.parametrize("rows", [slice(0, 4), slice(40, 43), slice(90, 95), slice(95, 100)])
def test_a_batch_has_the_lags_that_it_has_among_all_records(rows, tolerance):
    random = np.random.default_rng(0)
    hours = pd.Timestamp("2025-01-01") + pd.to_timedelta(np.sort(random.choice(160, 100, replace=False)), "h")
    frame = pd.DataFrame(random.normal(size=(100, 2)), hours)
    options = {"lags": [0, 1, 5, 12], "freq": "1h", "tolerance": tolerance}
    history, batch = frame.iloc[random.permutation(95)], frame[rows]
    found = LagFeatures(**options).fit(history).transform(batch)
    np.testing.assert_array_equal(found, LagFeatures(**options).fit_transform(frame)[rows])


def test_a_new_value_at_a_known_stamp_replaces_the_old_one():
    lags = LagFeatures(2, freq="1h").fit(T)
    corrected = T.iloc[[4, 5]] + 100
    np.testing.assert_array_equal(lags.transform(corrected)["T1_lag1"], [3, 104])


def test_time_zones_and_resolutions():
    local = T.tz_localize("Europe/Brussels")
    np.testing.assert_array_equal(LagFeatures(3).fit_transform(local), LagFeatures(3).fit_transform(T))
    coarse = T.set_axis(T.index.as_unit("s"))
    np.testing.assert_array_equal(LagFeatures(3).fit(T).transform(coarse), LagFeatures(3).fit_transform(T))
    with pytest.raises(ValueError, match="Europe/Brussels"):
        LagFeatures(3).fit(T).transform(local)


def test_the_step_is_the_usual_one_and_frames_without_stamps_are_rows():
    assert LagFeatures().fit(T.iloc[[0, 1, 2, 3, 9, 10]]).freq_ == pd.Timedelta("1h")
    numbered = T.reset_index(drop=True)
    assert LagFeatures().fit(numbered).freq_ is None
    assert LagFeatures(2).fit_transform(numbered).shape == (30, 4)


@pytest.mark.parametrize(
    "index",
    [HOURS.to_period("h"), pd.Index(HOURS.to_pydatetime(), dtype=object), HOURS.astype(object)],
    ids=["periods", "datetimes", "timestamps"],
)
def test_other_indices_of_stamps_go_by_time(index):
    rows = [0, 1, 2, 8, 9, 29]
    expected = LagFeatures([0, 3], freq="1h").fit(T.iloc[rows])
    lags = LagFeatures([0, 3], freq="1h").fit(T.set_axis(index).iloc[rows])
    lagged = lags.transform(T.set_axis(index).iloc[10:20])
    np.testing.assert_array_equal(lagged, expected.transform(T.iloc[10:20]))
    assert lagged.index.equals(index[10:20])


@pytest.mark.parametrize("index", [list("abc" * 10), range(30), np.arange(30) * 0.5], ids=["text", "range", "numbers"])
def test_other_labels_are_rows(index):
    np.testing.assert_array_equal(LagFeatures(2).fit_transform(T.set_axis(index)), LagFeatures(2).fit_transform(T))


def test_new_rows_without_stamps_are_padded_with_a_warning():
    X = T.to_numpy(copy=True)
    lags = LagFeatures(25).fit(X)
    lags.transform(X)  # the training rows, whose padding fit documents
    lags.transform(X[:10].copy())
    with pytest.warns(FewRecordsWarning, match="24 rows back.*padded"):
        lags.transform(X[20:25])
    with pytest.warns(FewRecordsWarning, match="24 rows back.*lack lags"):
        LagFeatures(25, padding="nan").fit(X).transform(X[1:])
    X[0] = -1.0  # what fit keeps is a copy
    with pytest.warns(FewRecordsWarning, match="padded"):
        lags.transform(X)


def test_a_batch_without_its_past_says_so():
    training = T[:12]
    lags = LagFeatures([0, 6], freq="1h", tolerance="0h").fit(training)
    day = T[24:]
    with pytest.warns(FewRecordsWarning, match="6 hours back, and most rows lack lags"):
        assert lags.transform(day)["T1_lag6"].isna().all()
    assert lags.transform(T[18:])["T1_lag6"].notna().sum() == 6  # given the 6 hours before
    lags.transform(training[6:])  # rows of fit, whose gaps are its own


@pytest.mark.parametrize(
    ("index", "freq"),
    [
        (pd.date_range("2025-01-01", periods=400, tz="Europe/Berlin"), None),  # days of 23 and 25 hours
        (pd.date_range("2025-01-01 07:00", periods=400, tz="America/New_York"), "1D"),
        (pd.date_range("2025-01-01", periods=40, freq="MS"), None),
        (pd.date_range("2025-01-31", periods=40, freq="ME"), None),
        (pd.date_range("2025-01-01", periods=40, freq="MS", tz="Europe/Berlin"), "MS"),
        (pd.date_range("2025-01-01", periods=40, freq="QS"), "QS"),
    ],
)
def test_lags_step_as_the_calendar_does(index, freq):
    table = pd.DataFrame({"T1": np.arange(len(index), dtype=float)}, index)
    lagged = LagFeatures([0, 1, 3], freq=freq, padding="nan").fit(table[:20]).transform(table)
    expected = pd.concat([table.shift(lag) for lag in (0, 1, 3)], axis=1)
    np.testing.assert_array_equal(lagged, expected)
