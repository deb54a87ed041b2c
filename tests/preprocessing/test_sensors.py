"""Means of sensors by role: plain means, failing sensors, names, wrong roles."""

import numpy as np
import pandas as pd
from hypothesis import given, settings
from hypothesis import strategies as st
from pandas.testing import assert_frame_equal

from skthermo.preprocessing import SensorMeans

ROLES = {"T1": "air", "slab": "deck", "T3": "air", "T4": "air"}


def readings(n=200, seed=0):
    random = np.random.default_rng(seed)
    air, deck = random.normal(10, 6, (2, n))
    offsets = np.array([0.5, 0.0, -1.0, 2.0])
    return pd.DataFrame(np.column_stack([air, deck, air, air]) + offsets, columns=list(ROLES)), air, deck


def test_complete_rows_give_plain_means():
    T, air, deck = readings()
    means = SensorMeans(ROLES).fit_transform(T)
    np.testing.assert_allclose(means, np.column_stack([air + 0.5, deck]), atol=1e-12)
    ambient = SensorMeans().fit_transform(T)
    np.testing.assert_allclose(ambient["ambient"], T.mean(axis=1), atol=1e-12)


@settings(max_examples=20)
@given(st.integers(0, 1000), st.floats(0.0, 0.6))
def test_failing_sensors_do_not_move_the_mean(seed, share):
    T, air, _ = readings(seed=seed)
    gappy = T.mask(np.random.default_rng(seed).uniform(size=T.shape) < share)
    means = SensorMeans(ROLES).fit(gappy).transform(gappy)
    known = gappy[["T1", "T3", "T4"]].notna().any(axis=1)
    np.testing.assert_allclose(means.loc[known, "air"], air[known] + 0.5, atol=1e-9)
    assert means.loc[~known, "air"].isna().all()


def test_offsets_sum_to_zero_and_sensors_that_never_overlap_keep_their_level():
    T, _, _ = readings()
    transformer = SensorMeans(ROLES).fit(T)
    np.testing.assert_allclose(transformer.offsets_, [0.0, 0.0, -1.5, 1.5], atol=1e-9)
    apart = pd.DataFrame({"a": [1.0, 2.0, np.nan, np.nan], "b": [np.nan, np.nan, 5.0, 6.0]})
    np.testing.assert_array_equal(SensorMeans().fit_transform(apart)["ambient"], [1.0, 2.0, 5.0, 6.0])


def test_a_row_does_not_depend_on_other_rows_nor_on_the_order_of_columns():
    T, _, _ = readings()
    transformer = SensorMeans(ROLES).fit(T)
    assert_frame_equal(transformer.transform(T.iloc[[7]]), transformer.transform(T).iloc[[7]])
    shuffled = T[["T4", "slab", "T1", "T3"]]
    assert_frame_equal(SensorMeans(ROLES).fit_transform(shuffled), transformer.transform(T))


def test_roles_are_the_columns_and_arrays_go_by_position():
    T, _, _ = readings()
    transformer = SensorMeans(ROLES).fit(T)
    assert transformer.columns_ == {"air": [0, 2, 3], "deck": [1]}
    assert transformer.get_feature_names_out().tolist() == ["air", "deck"]
    by_position = SensorMeans(dict(enumerate(ROLES.values()))).fit_transform(T.to_numpy())
    np.testing.assert_array_equal(by_position, transformer.transform(T))
    without = SensorMeans(ROLES | {"slab": None}).fit(T)
    assert without.get_feature_names_out().tolist() == ["air"]
    assert list(without.set_output(transform="pandas").transform(T)) == ["air"]
