"""PFA, POD, minimum detectable damage, time to detection, error tables, scores."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.dummy import DummyRegressor
from sklearn.metrics import mean_absolute_percentage_error, r2_score
from sklearn.model_selection import cross_validate

from skthermo.exceptions import UnevaluatedRowsWarning
from skthermo.metrics import (
    error_table,
    frequency_scorer,
    mape,
    minimum_detectable_damage,
    probability_of_detection,
    probability_of_false_alarm,
    time_to_detection,
)
from skthermo.metrics.errors import complete_r2

RNG = np.random.default_rng(0)
MEASURED = RNG.uniform(3, 5, (60, 2))
PREDICTED = MEASURED * RNG.normal(1, 0.02, (60, 2))
TRUE, PRED = (pd.DataFrame(values, columns=["f1", "f2"]) for values in (MEASURED, PREDICTED))
INDEX = pd.Series([5.0, 1.0, 2.0, np.nan, 4.0, 5.0], pd.date_range("2025-01-01", periods=6, freq="h"))


@pytest.mark.filterwarnings("ignore:.*not-evaluated")
@settings(max_examples=40)
@given(st.lists(st.floats(0, 10), min_size=1), st.floats(0, 10), st.integers(0, 5))
def test_probabilities_are_shares_above_the_threshold(index, threshold, n_missing):
    expected = sum(value > threshold for value in index) / len(index)
    padded = index + [np.nan] * n_missing
    assert probability_of_detection(padded, threshold) == pytest.approx(expected)
    assert probability_of_false_alarm(padded, threshold) == pytest.approx(expected)


@settings(max_examples=40)
@given(st.lists(st.floats(0, 10) | st.just(np.nan), min_size=1, max_size=30), st.floats(0, 10), st.data())
def test_time_to_detection_is_the_number_of_records_until_the_first_alarm(index, threshold, data):
    onset = data.draw(st.integers(0, len(index) - 1))
    waits = [row - onset for row in range(onset, len(index)) if index[row] > threshold]
    for values in (index, pd.Series(index)):
        found = time_to_detection(values, threshold, onset)
        assert isinstance(found, float)
        np.testing.assert_equal(found, float(waits[0]) if waits else np.nan)


@pytest.mark.parametrize(
    ("onset", "expected"),
    [
        ("2025-01-01 00:00", "0h"),
        ("2025-01-01 01:00", "3h"),
        (pd.Timestamp("2025-01-01 01:20"), "2h 40min"),  # between two records
        (np.datetime64("2025-01-01T01:20"), "2h 40min"),
        (pd.Timestamp("2024-12-31 23:00"), "1h"),  # before the first record
        (INDEX.index[5], "0h"),
        (1, "3h"),
    ],
)
def test_a_series_on_stamps_gives_a_time(onset, expected):
    assert time_to_detection(INDEX, 3.0, onset) == pd.Timedelta(expected)


def test_no_alarm_on_stamps_is_no_time_and_the_first_record_is_the_onset_by_default():
    assert time_to_detection(INDEX, 5.0, INDEX.index[1]) is pd.NaT
    zoned = INDEX.tz_localize("Europe/Rome")
    assert time_to_detection(zoned, 3.0, zoned.index[1]) == pd.Timedelta("3h")
    assert time_to_detection(INDEX[1:], 3.0) == pd.Timedelta("3h")


def test_nothing_to_count_is_nan():
    with pytest.warns(UnevaluatedRowsWarning, match="not-evaluated"):
        assert np.isnan(probability_of_detection([np.nan], 1.0))


@pytest.mark.parametrize(
    ("pod", "expected"),
    [
        ([0.26, 0.95, 1.0], 0.2),
        ([0.9, 0.95, 1.0], 0.1),
        ([0.95, 0.5, 1.0], 0.3),  # found by luck at 0.1, missed at 0.2
        ([0.1, 0.2, 0.3], np.nan),
        ([0.95, np.nan, 1.0], 0.3),
    ],
)
def test_minimum_detectable_damage(pod, expected):
    np.testing.assert_equal(minimum_detectable_damage([0.1, 0.2, 0.3], pod), expected)
    np.testing.assert_equal(minimum_detectable_damage([0.3, 0.1, 0.2], np.take(pod, [2, 0, 1])), expected)
    np.testing.assert_equal(minimum_detectable_damage([-0.1, -0.2, -0.3], pod), -expected)


def test_mape_is_scikit_learns_on_complete_data_and_ignores_gaps():
    expected = 100 * mean_absolute_percentage_error(MEASURED, PREDICTED, multioutput="raw_values")
    np.testing.assert_allclose(mape(MEASURED, PREDICTED), expected)
    holed = np.vstack([MEASURED, [[np.nan, np.nan]]])
    np.testing.assert_allclose(mape(holed, np.vstack([PREDICTED, [[4.0, 4.0]]])), expected)


def test_error_table_has_a_row_for_each_scenario_in_order_and_averages():
    scenarios = np.repeat(["SH-0", "SB-50", "SD-50"], 20)
    index = pd.date_range("2025", periods=60, freq="D")
    frames = [pd.DataFrame(values, columns=["first", "second"], index=index) for values in (MEASURED, PREDICTED)]
    table = error_table(*frames, scenarios=scenarios)
    assert list(table.index) == ["SH-0", "SB-50", "SD-50", "Average"]
    assert list(table.columns) == ["first", "second", "Average"]
    np.testing.assert_allclose(table.loc["SB-50", ["first", "second"]], mape(MEASURED[20:40], PREDICTED[20:40]))
    assert table.loc["Average", "Average"] == pytest.approx(table.iloc[:3, :2].to_numpy().mean())
    assert list(error_table(*(frame.set_axis([0, 1], axis=1) for frame in frames)).columns) == [0, 1, "Average"]
    with pytest.raises(ValueError, match="row 0"):
        error_table(frames[0], frames[1].shift(freq="1D"))
    with pytest.raises(ValueError, match="scenarios"):
        error_table(*frames, scenarios=["a", "b"])
    with pytest.raises(ValueError, match="shape"):
        error_table(MEASURED, PREDICTED[:, :1])


def test_scorer_works_in_cross_validation_and_counts_the_rows_it_scored():
    holed = MEASURED.copy()
    holed[::3, 0] = np.nan
    T = RNG.normal(size=(60, 1))

    class Mean(DummyRegressor):
        def fit(self, X, y):
            return super().fit(X, np.nan_to_num(y, nan=4.0))

    scores = cross_validate(Mean(), T, holed, cv=3, scoring=frequency_scorer)
    np.testing.assert_allclose(scores["test_share_scored"], [13 / 20, 13 / 20, 14 / 20], rtol=1e-12)
    model = Mean().fit(T, holed)
    complete = ~np.isnan(holed).any(axis=1)
    scored = frequency_scorer(model, T, holed)
    assert scored["r2"] == pytest.approx(r2_score(holed[complete], model.predict(T)[complete]))
    assert scored["neg_mape"] == pytest.approx(-mape(holed[complete], model.predict(T)[complete]).mean())


@pytest.mark.parametrize("metric", [mape, error_table, complete_r2])
def test_columns_of_frames_are_paired_by_name(metric):
    np.testing.assert_array_equal(metric(TRUE, PRED[["f2", "f1"]]), metric(TRUE, PRED))
    np.testing.assert_array_equal(metric(TRUE, PREDICTED), metric(TRUE, PRED))
    for other in (PRED.set_axis(["f1", "f3"], axis=1), PRED.set_axis([0, 1], axis=1), PRED[["f1"]], PRED.assign(f3=4)):
        with pytest.raises(ValueError, match="columns"):
            metric(TRUE, other)


def test_scores_pair_columns_by_name():
    class Swapped(DummyRegressor):
        def predict(self, X):
            return PRED[["f2", "f1"]]

    T = np.zeros((60, 1))
    scores = frequency_scorer(Swapped().fit(T, MEASURED), T, TRUE)
    assert scores["neg_mape"] == pytest.approx(-mape(TRUE, PRED).mean())


def test_masked_and_missing_values_are_ignored():
    holed, (unknown, nothing) = MEASURED.copy(), (MEASURED.astype(object) for _ in range(2))
    holed[7, 1], unknown[7, 1], nothing[7, 1] = np.nan, pd.NA, None
    masked = np.ma.masked_array(MEASURED, np.isnan(holed))
    frame = pd.DataFrame(MEASURED).convert_dtypes().mask(np.isnan(holed))
    for missing in (masked, unknown, nothing, pd.DataFrame(unknown), frame):
        np.testing.assert_array_equal(mape(missing, PREDICTED), mape(holed, PREDICTED))
    index = np.ma.masked_array([1.0, 99.0, 3.0, 4.0], [False, True, False, False])
    with pytest.warns(UnevaluatedRowsWarning, match="not-evaluated"):
        assert probability_of_detection(index, 2.0) == pytest.approx(2 / 3)
