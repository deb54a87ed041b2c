"""Equal records give equal results, in whatever container and order of memory they are."""

import pickle
import warnings

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import (
    BiasAligner,
    ExponentialMeans,
    HampelFilter,
    HingeFeatures,
    KNNGapImputer,
    LagFeatures,
    SensorMeans,
    check_records,
)

YEAR = make_truss_campaign(random_state=0)
RECORDS = YEAR.temperatures.join(YEAR.frequencies).astype(np.float32).astype(float)
RECORDS = RECORDS.mask(np.random.default_rng(0).random(RECORDS.shape) < 0.05)
VALUES = RECORDS.to_numpy(copy=True, dtype=float)
TRANSFORMERS = [
    BiasAligner(),
    BiasAligner(method="scale"),
    ExponentialMeans(half_lives=[3, 20]),
    HampelFilter(),
    HampelFilter(targets=[3, 4, 5]),
    HingeFeatures(),
    KNNGapImputer(weights="distance"),
    LagFeatures([0, 2]),
    SensorMeans(),
]
each_transformer = pytest.mark.parametrize("transformer", TRANSFORMERS, ids=repr)


def part_of_more(values):
    """The same values as every second row and column of a larger array."""
    larger = np.zeros((2 * values.shape[0], 2 * values.shape[1]))
    larger[::2, ::2] = values
    return larger[::2, ::2]


ARRAYS = {
    "copy": VALUES.copy(),
    "Fortran order": np.asfortranarray(VALUES),
    "part of a larger array": part_of_more(VALUES),
    "lists": VALUES.tolist(),
    "single precision": VALUES.astype(np.float32),
    "masked": np.ma.masked_invalid(VALUES),
    "objects": np.where(np.isnan(VALUES), None, VALUES),
}
FRAMES = {
    "copy": RECORDS.copy(),
    "single precision": RECORDS.astype(np.float32),
    "nullable": RECORDS.astype("Float64"),
    "of an array": pd.DataFrame(np.asfortranarray(VALUES), RECORDS.index, RECORDS.columns),
    "column by column": pd.DataFrame({name: RECORDS[name].to_numpy() for name in RECORDS}, RECORDS.index),
    "pickled": pickle.loads(pickle.dumps(RECORDS)),
    "rows of more": RECORDS.reindex(pd.date_range("2025-01-01", periods=400))[: len(RECORDS)],
}


def fitted_and_transformed(transformer, table):
    """What a clone gives for its own rows and for some of them, as an array of its bits."""
    fitted = type(transformer)(**transformer.get_params()).fit(table)
    rows = table[200:300] if not hasattr(table, "iloc") else table.iloc[200:300]
    return [np.asarray(fitted.transform(part), dtype=float) for part in (table, rows)]


@pytest.mark.filterwarnings("ignore:.*no-earlier-records")
@each_transformer
@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays_with_equal_values_give_equal_bits(transformer, kind):
    for found, expected in zip(
        fitted_and_transformed(transformer, ARRAYS[kind]), fitted_and_transformed(transformer, VALUES), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.filterwarnings("ignore:.*no-earlier-records")
@each_transformer
@pytest.mark.parametrize("kind", FRAMES)
def test_frames_with_equal_values_give_equal_bits(transformer, kind):
    if isinstance(transformer, ExponentialMeans):
        transformer = ExponentialMeans(half_lives=["3D", "20D"])
    for found, expected in zip(
        fitted_and_transformed(transformer, FRAMES[kind]), fitted_and_transformed(transformer, RECORDS), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.filterwarnings("ignore:.*no-earlier-records")
@each_transformer
def test_polars_frames_give_the_values_of_arrays(transformer):
    polars = pytest.importorskip("polars")
    frame = polars.DataFrame({name: RECORDS[name].to_numpy() for name in RECORDS})
    found = fitted_and_transformed(transformer, frame)
    for one, expected in zip(found, fitted_and_transformed(transformer, VALUES), strict=True):
        np.testing.assert_array_equal(one, expected)
    result = type(transformer)(**transformer.get_params()).set_output(transform="polars").fit_transform(frame)
    assert isinstance(result, polars.DataFrame)
    np.testing.assert_array_equal(np.asarray(result), found[0])


@pytest.mark.parametrize("kind", ARRAYS)
def test_checks_of_arrays_with_equal_values_find_the_same(kind):
    whole = np.ma.asarray if kind == "masked" else np.asarray
    T, F = np.split(whole(ARRAYS[kind]), [3], axis=1)
    found, expected = check_records(T, F), check_records(*np.split(VALUES, [3], axis=1))
    pd.testing.assert_frame_equal(found.table, expected.table)
    pd.testing.assert_frame_equal(found.outliers, expected.outliers)


@pytest.mark.parametrize("kind", FRAMES)
def test_checks_of_frames_with_equal_values_find_the_same(kind):
    T, F = FRAMES[kind].iloc[:, :3], FRAMES[kind].iloc[:, 3:]
    found, expected = check_records(T, F), check_records(RECORDS.iloc[:, :3], RECORDS.iloc[:, 3:])
    pd.testing.assert_frame_equal(found.table, expected.table)
    np.testing.assert_array_equal(found.outliers, expected.outliers)


def test_polars_frames_come_out_of_the_gate_with_their_names():
    polars = pytest.importorskip("polars")
    T, F = (
        polars.DataFrame({name: table[name].to_numpy() for name in table})
        for table in (YEAR.temperatures, YEAR.frequencies)
    )
    found = check_records(T, F)
    pd.testing.assert_frame_equal(found.frequencies, YEAR.frequencies.reset_index(drop=True))
    assert list(found.temperatures) == list(YEAR.temperatures)


def test_each_line_that_fits_warns_and_the_fitted_object_holds_what_is_doubtful():
    spoiled = RECORDS.copy()
    spoiled.iloc[3, 4] = -999.0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        first = BiasAligner().fit(spoiled)
        second = BiasAligner().fit(spoiled.copy())
    assert [one.message.kind for one in caught] == ["doubtful-values"] * 2
    assert caught[0].lineno + 1 == caught[1].lineno
    assert [str(one) for one in first.findings_] == [str(one) for one in second.findings_] == [str(caught[0].message)]
