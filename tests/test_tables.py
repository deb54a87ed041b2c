"""Records in every container: names, missing values, units, and files that keep fitted objects."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.svm import OneClassSVM

from skthermo.detection import DamageDetector, MahalanobisDetector, OutlierDetector, TemperatureCompensator
from skthermo.fem import add_noise
from skthermo.preprocessing import BiasAligner, KNNGapImputer, LagFeatures
from skthermo.preprocessing.checks import Plausible

HOURS = pd.date_range("2025-01-01", periods=60, freq="h")
RECORDS = pd.DataFrame(
    np.random.default_rng(0).normal([10, 4, 9], 0.1, (60, 3)), index=HOURS, columns=["T1", "f1", "f2"]
)
TRANSFORMERS = [
    LagFeatures(2),
    KNNGapImputer(),
    BiasAligner(),
    BiasAligner(method="scale"),
    TemperatureCompensator(make_pipeline(LagFeatures(2), Ridge()), targets=[1, 2]),
]
DETECTORS = [MahalanobisDetector(), OutlierDetector(OneClassSVM())]
UNRELATED = pytest.mark.filterwarnings("ignore:.*(different-rows|not-evaluated)")  # of RECORDS
each_transformer = pytest.mark.parametrize("estimator", TRANSFORMERS, ids=lambda one: type(one).__name__)
each_estimator = pytest.mark.parametrize("estimator", TRANSFORMERS + DETECTORS, ids=lambda one: type(one).__name__)


def output(estimator, X):
    return getattr(estimator, "transform" if hasattr(estimator, "transform") else "damage_index")(X)


# Missing values


@pytest.mark.filterwarnings("ignore:2 of 60.*not-evaluated")
@UNRELATED
@each_estimator
def test_masked_values_are_missing_to_estimators(estimator):
    holed = RECORDS.to_numpy(copy=True)
    holed[[3, 8], [0, 1]] = np.nan
    masked = np.ma.masked_array(np.where(np.isnan(holed), 1e6, holed), np.isnan(holed))
    objects = np.where(np.isnan(holed), pd.NA, holed)
    expected = output(estimator.fit(holed), holed)
    for table in (masked, objects, pd.DataFrame(objects), pd.DataFrame(objects).convert_dtypes()):
        np.testing.assert_allclose(output(estimator.fit(table), table), expected, rtol=0, atol=1e-9)


@UNRELATED
@each_estimator
def test_tables_are_taken_as_scikit_learn_takes_them(estimator):
    halves = RECORDS.astype(np.float16)
    flags = RECORDS.assign(T1=RECORDS["T1"] > 10)
    for table, same in (
        (halves, halves.astype(float)),
        (halves.to_numpy(), halves.to_numpy().astype(float)),
        (flags, flags.astype(float)),
        (flags.astype({"T1": "boolean"}), flags.astype(float)),
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            expected = output(estimator.fit(same), same)
            np.testing.assert_array_equal(output(estimator.fit(table), table), expected)


@each_estimator
def test_tables_of_pyarrow_are_refused_in_one_sentence(estimator):
    arrow = pytest.importorskip("pyarrow").Table.from_pandas(RECORDS, preserve_index=False)
    with pytest.raises(ValueError, match="of pyarrow"):
        estimator.fit(arrow)


# What is not a real number


@pytest.mark.parametrize("seed", [np.random.default_rng(0), "seed", -1, 1.5, 2**33])
def test_seeds_of_another_kind_are_refused(seed):
    with pytest.raises(ValueError, match="random_state"):
        add_noise([[4.0]], 0.01, random_state=seed)


@pytest.mark.parametrize("times", [HOURS, HOURS.tz_localize("UTC"), HOURS - HOURS[0]], ids=["stamps", "zone", "spans"])
@each_estimator
def test_a_column_of_times_is_refused_by_name(estimator, times):
    with pytest.raises(ValueError, match=r"set_index\('stamp'\)"):
        estimator.fit(RECORDS.assign(stamp=times))


@each_estimator
def test_a_column_of_times_in_a_polars_frame_is_refused_by_name(estimator):
    polars = pytest.importorskip("polars")
    frame = polars.DataFrame({name: RECORDS[name].to_numpy() for name in RECORDS})
    with pytest.raises(ValueError, match="'stamp'"):
        estimator.fit(frame.with_columns(polars.Series("stamp", range(60)).cast(polars.Datetime)))


# Names and rows


@UNRELATED
@each_transformer
def test_columns_named_by_integers_keep_their_names(estimator):
    numbered = RECORDS.set_axis([0, 1, 2], axis=1)
    expected = {"LagFeatures": [f"{i}_lag{k}" for i in range(3) for k in range(2)], "TemperatureCompensator": [1, 2]}
    for table in (estimator.fit(numbered).transform(numbered), estimator.fit_transform(numbered)):
        assert list(table.columns) == expected.get(type(estimator).__name__, [0, 1, 2])
        assert table.index.equals(HOURS)


def test_indicators_of_gaps_have_names_beside_integers():
    holed = RECORDS.set_axis([5, 6, 7], axis=1)
    holed.iloc[3, 1] = np.nan
    assert list(KNNGapImputer(add_indicator=True).fit_transform(holed).columns) == [5, 6, 7, "missingindicator_x1"]


# Units of temperature


def temperatures(**changes):
    T = pd.DataFrame({"air": np.linspace(-15, 35, 40), "deck": np.linspace(-10, 60, 40)})
    for column, (rows, value) in changes.items():
        T.loc[rows, column] = value
    return T


@pytest.mark.parametrize(
    ("T", "counts"),
    [
        (temperatures() + 273.15, (40, 40)),
        (temperatures(deck=(slice(None), 293.0)), (0, 40)),
        (temperatures(air=([3, 9], -999)), (2, 0)),
        (temperatures(deck=([3, 4], 999.9), air=([0], np.nan)), (0, 2)),
        (temperatures(air=([3], -127)), (1, 0)),
        (temperatures(air=([0, 1, 5], [290.0, 295.0, 280.0])), (3, 0)),
        (temperatures(), (0, 0)),
        (temperatures(air=(slice(None), np.nan)), (0, 0)),
        (temperatures() * 1.8 + 32, (0, 0)),
    ],
)
def test_temperatures_far_from_known_ones_are_implausible(T, counts):
    known = Plausible.learned(temperatures(), [])
    assert tuple(known.implausible(T.to_numpy()).sum(axis=0)) == counts


# Polars


@UNRELATED
@each_transformer
def test_polars_frames_come_out_where_they_are_asked_for(estimator):
    polars = pytest.importorskip("polars")
    frame = polars.DataFrame({name: RECORDS[name].to_numpy() for name in RECORDS})
    asked = type(estimator)(**estimator.get_params(deep=False)).set_output(transform="polars")
    for table in (frame, RECORDS):
        for result in (asked.fit(table).transform(table), asked.fit_transform(table)):
            assert isinstance(result, polars.DataFrame)
            assert result.columns == list(asked.get_feature_names_out())


def test_polars_columns_are_paired_by_name():
    polars = pytest.importorskip("polars")
    from skthermo.metrics import mape

    frame = polars.DataFrame({"f1": [4.0, 4.1], "f2": [9.0, None]})
    np.testing.assert_array_equal(mape(frame, frame[["f2", "f1"]]), [0.0, 0.0])


# Files of fitted objects


@UNRELATED
@each_estimator
def test_objects_fitted_on_frames_are_saved_by_skops(estimator):
    io = pytest.importorskip("skops.io")
    fitted = type(estimator)(**estimator.get_params(deep=False)).fit(RECORDS)
    file = io.dumps(fitted)
    unknown = io.get_untrusted_types(data=file)
    assert all(name.startswith("skthermo.") for name in unknown)
    later = RECORDS.shift(freq="30h")
    np.testing.assert_array_equal(output(io.loads(file, trusted=unknown), later), output(fitted, later))


# What is no table


def no_tables(frame):
    """Bad tables, each with a word of the one sentence that says what is wrong."""
    levels = pd.MultiIndex.from_product([["a"], frame.columns])
    return {
        "infinite": (frame.mask(frame == frame.iloc[5, 1], np.inf), repr(frame.columns[1])),
        "infinite in an array": (frame.mask(frame == frame.iloc[5, 1], np.inf).to_numpy(), "1"),
        "levels": (frame.set_axis(levels, axis=1), "tuples"),
        "tuples": (frame.set_axis(pd.Index(list(levels), tupleize_cols=False), axis=1), "tuples"),
        "numbers and text": (frame.set_axis([0, *frame.columns[1:]], axis=1), "partly"),
        "a series": (frame.iloc[:, 0], "Series"),
        "one dimension": (frame.to_numpy()[:, 0], "shape"),
        "three dimensions": (frame.to_numpy()[np.newaxis], "dimensions"),
        "a mapping": (frame.to_dict("list"), "dict"),
        "complex": (frame + 1j, "complex"),
        "no columns": (frame.iloc[:, :0], "feature"),
        "no rows": (frame[:0], "sample"),
        "a generator": ((row for row in frame.to_numpy()), "generator"),
        "a class": (pd.DataFrame, "type"),
        "text": ("records.csv", "'records.csv'"),
        "None": (None, "None"),
    }


@each_estimator
@pytest.mark.parametrize("cause", no_tables(RECORDS))
def test_what_is_no_table_is_refused_in_one_sentence_of_ours(estimator, cause):
    values, word = no_tables(RECORDS)[cause]
    if cause.startswith("infinite") and isinstance(estimator, DamageDetector | TemperatureCompensator):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            estimator.fit(values)
        assert any(word in str(one.message) and "[set-aside]" in str(one.message) for one in caught)
        return
    with pytest.raises(ValueError, match=word) as refused:
        estimator.fit(values)
    assert "\n" not in str(refused.value)
