"""Exponentially weighted means: their definition, order, gaps, history and names."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.exceptions import FewRecordsWarning
from skthermo.preprocessing import ExponentialMeans

REACH = 6
HOURS = pd.date_range("2025-01-01", periods=400, freq="h")
T = pd.DataFrame(np.random.default_rng(0).normal(10, 5, (400, 2)), HOURS, ["air", "deck"])


def naive_mean(column, stamp, half_life):
    """The definition, one value at a time."""
    column = column.set_axis((stamp - column.index) / half_life)
    used = column[(column.index >= 0) & (column.index < REACH)].dropna()
    weights = 2.0 ** -used.index.to_numpy(dtype=float)
    return (used * weights).sum() / weights.sum() if len(used) else np.nan


@settings(max_examples=15)
@given(
    st.lists(st.integers(0, 300), min_size=2, max_size=25, unique=True),
    st.integers(1, 40),
    st.lists(st.integers(0, 24), max_size=5),
)
def test_means_follow_their_definition(hours, hours_to_half, gaps):
    index = pd.Timestamp("2025-03-01") + pd.to_timedelta(hours, unit="h")
    frame = pd.DataFrame({"a": np.random.default_rng(1).normal(size=len(hours))}, index=index)
    frame.iloc[[gap for gap in gaps if gap < len(hours)], 0] = np.nan
    means = ExponentialMeans(half_lives=[f"{hours_to_half}h"], recorded=0.0).fit_transform(frame)
    expected = [naive_mean(frame["a"], stamp, pd.Timedelta(hours=hours_to_half)) for stamp in index]
    np.testing.assert_allclose(means.iloc[:, 1], expected, rtol=1e-10, atol=1e-10)
    assert means.index.equals(index)


def test_current_values_come_first_and_names_tell_the_means():
    means = ExponentialMeans(half_lives=["6h", "2D"], sensors=["deck"]).fit(T)
    out = means.transform(T)
    assert list(out) == ["air", "deck", "deck_mean6h", "deck_mean2D"] == list(means.get_feature_names_out())
    pd.testing.assert_frame_equal(out[["air", "deck"]], T)


@pytest.mark.parametrize("rows", [slice(399, 400), slice(300, 400), slice(120, 140)])
def test_batches_have_the_means_that_they_have_among_all_records(rows):
    whole = ExponentialMeans(half_lives=["5h", "2D"]).fit_transform(T)
    history = T.drop(T.index[rows]).sample(frac=1, random_state=0)
    found = ExponentialMeans(half_lives=["5h", "2D"]).fit(history).transform(T[rows])
    np.testing.assert_allclose(found, whole[rows], rtol=1e-10)


@pytest.mark.parametrize("share", [0.5, 0.75, 0.9])
def test_a_mean_is_missing_until_its_share_of_the_weight_is_recorded(share):
    """After an outage of a year the share of a mean of h hours is 1 - 2 ** (-age / h)."""
    later = T.set_axis(T.index + pd.Timedelta("365D"))
    means = ExponentialMeans(half_lives=["10h"], recorded=share).fit(T)
    missing = means.transform(later)["air_mean10h"].isna()
    n_missing = int(missing.sum())
    assert missing[:n_missing].all()
    assert abs(n_missing + 1 + 10 * np.log2(1 - share)) < 2.1  # one record stands for three steps
    assert not means.transform(T)["air_mean10h"].isna().any()  # nothing is before the first record


def test_gaps_leave_no_row_out_and_short_ones_no_mean():
    gappy = T.copy()
    gappy.iloc[50:60, 0] = np.nan
    means = ExponentialMeans(half_lives=["2h", "3D"]).fit_transform(gappy)
    assert len(means) == len(T)
    assert means["air"].isna().sum() == 10
    assert 10 <= means["air_mean2h"].isna().sum() <= 13
    assert not means["air_mean3D"].isna().any()
    assert not means["deck_mean2h"].isna().any()
    late = gappy.drop(gappy.index[50:60])
    np.testing.assert_allclose(
        ExponentialMeans(half_lives=["3D"]).fit_transform(late)["air_mean3D"], means["air_mean3D"].drop(T.index[50:60])
    )


def test_rows_without_stamps_count_rows():
    by_row = ExponentialMeans(half_lives=[12]).fit_transform(T.to_numpy())
    np.testing.assert_allclose(by_row, ExponentialMeans(half_lives=["12h"]).fit_transform(T))


def test_records_after_an_outage_say_that_they_have_no_past():
    means = ExponentialMeans(half_lives=["1D"]).fit(T[:100])
    with pytest.warns(FewRecordsWarning, match="most rows have too few records in the 1 day before") as given:
        means.transform(T[300:320])
    assert given[0].message.kind == "no-earlier-records"
    means.transform(T[100:120])
    means.transform(T[:30])  # begin as the records of fit do
