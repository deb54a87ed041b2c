"""Residuals in standard deviations: one covariance, or that of similar weather."""

import warnings
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import TimeSeriesSplit
from sklearn.pipeline import make_pipeline

from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.residuals.spread import Smoothing
from skthermo.residuals.weather import nearest
from skthermo.surrogate import TemperatureMapper

MODES = ["f1", "f2"]
FROZEN = 0.1 * np.array([[2.0, 0.0], [1.0, 1.0]])
THAWED = 0.1 * np.array([[1.0, 0.0], [-0.5, 0.4]])


def campaign(n_rows=1200, seed=0, frozen=FROZEN):
    """Hourly records of two modes, whose spread is another one below 0 degrees."""
    random, hours = np.random.default_rng(seed), np.arange(n_rows)
    air = 12 * np.sin(2 * np.pi * hours / 300) + 4 * np.sin(2 * np.pi * hours / 24) + random.normal(0, 1, n_rows)
    T = np.column_stack([air, 0.8 * air + random.normal(0, 0.5, n_rows)])
    spread = np.where(air[:, np.newaxis, np.newaxis] < 0, frozen, THAWED)
    noise = np.einsum("ijk,ik->ij", spread, random.normal(size=(n_rows, 2)))
    values = np.column_stack([T, [4.0, 9.0] - T @ [[0.01, 0.02], [0.0, 0.01]] + noise])
    return pd.DataFrame(values, pd.date_range("2025", periods=n_rows, freq="h"), ["T1", "T2", *MODES])


def compensator(whiten="local", estimator=None, **options):
    return TemperatureCompensator(estimator or LinearRegression(), whiten=whiten, **({"targets": MODES} | options))


X, LATER = campaign(), campaign(3000, 1)
SOURCE = "skthermo.residuals.spread"


@cache
def locally():
    return compensator().fit(X)


@pytest.fixture(autouse=True)
def few_candidates(monkeypatch):
    """To be quick: how the smoothing is chosen is tested by itself."""
    monkeypatch.setattr(f"{SOURCE}.CANDIDATES", (Smoothing(50, 5), Smoothing(100, 5), Smoothing(100, 15)))


def spreads(white, records):
    """Covariance of whitened residuals, frozen and not, away from the edge between them."""
    return [np.cov(white[rows].to_numpy().T) for rows in (records["T1"] < -3, records["T1"] > 3)]


# What whitening does


def test_local_residuals_have_unit_spread_in_every_regime():
    for white, records in ((compensator().fit_transform(X), X), (locally().transform(LATER), LATER)):
        for spread in spreads(white, records):
            np.testing.assert_allclose(spread, np.eye(2), atol=0.3)
    assert locally().spread_.smoothing is not None


def test_global_residuals_have_unit_spread_on_the_whole_only():
    white = compensator("global").fit_transform(X)
    np.testing.assert_allclose(np.cov(white.T, bias=True), np.eye(2), atol=1e-10)
    frozen, thawed = spreads(white, X)
    assert (np.diag(frozen) > 1.3).all()
    assert (np.diag(thawed) < 0.7).all()


def test_false_alarms_are_alike_in_every_regime_with_local_whitening():
    rates = {}
    for whiten in (None, "global", "local"):
        alarms = make_pipeline(compensator(whiten), MahalanobisDetector(0.05)).fit(X).predict(LATER) == -1
        rates[whiten] = [alarms[rows].mean() for rows in (LATER["T1"] < -3, LATER["T1"] > 3)]
    assert rates[None] == rates["global"]
    assert rates["global"][0] > 0.07
    assert rates["global"][1] < 0.02
    np.testing.assert_allclose(rates["local"], 0.05, atol=0.03)


def test_global_whitening_multiplies_by_the_symmetric_inverse_root():
    residuals = compensator(None).fit_transform(X).to_numpy()
    values, vectors = np.linalg.eigh(np.cov(residuals.T, bias=True))
    root = vectors @ np.diag(values**-0.5) @ vectors.T
    expected = (residuals - residuals.mean(axis=0)) @ root
    np.testing.assert_allclose(compensator("global").fit_transform(X), expected, rtol=1e-9, atol=1e-9)


def test_the_index_of_globally_whitened_residuals_is_that_of_the_residuals():
    plain, white = (make_pipeline(compensator(s), MahalanobisDetector()).fit(X) for s in (None, "global"))
    inside = LATER[(compensator("global").fit(X).extrapolation_distance(LATER) == 0).all(axis=1)]
    indices = [pipeline[-1].damage_index(pipeline[0].transform(inside)) for pipeline in (plain, white)]
    np.testing.assert_allclose(*indices, rtol=1e-9)
    assert white[-1].threshold_ == pytest.approx(plain[-1].threshold_, rel=1e-9)


@pytest.mark.one_case
@pytest.mark.parametrize("whiten", ["global", "local"])
def test_columns_stay_the_modes_that_they_were(whiten):
    white, residuals = compensator(whiten).fit_transform(X), compensator(None).fit_transform(X)
    for mode in MODES:
        assert np.corrcoef(white[mode], residuals[mode])[0, 1] > 0.7
    swapped = compensator(whiten, targets=MODES[::-1]).fit_transform(X)
    assert list(swapped) == MODES[::-1]
    np.testing.assert_allclose(swapped[MODES], white, rtol=1e-7, atol=1e-9)


def test_units_of_the_modes_change_the_axes_but_not_the_length():
    scaled = X.assign(f2=1e6 * X["f2"])
    lengths = [np.linalg.norm(compensator().fit_transform(records), axis=1) for records in (X, scaled)]
    np.testing.assert_allclose(*lengths, rtol=1e-6)


def test_a_baseline_of_equal_spread_loses_nothing():
    same, later = campaign(frozen=THAWED), campaign(3000, 1, frozen=THAWED)
    damaged = later.assign(f1=later["f1"] - 0.2)
    found = []
    for whiten in ("global", "local"):
        pipeline = make_pipeline(compensator(whiten), MahalanobisDetector()).fit(same)
        healthy_index, index = (pipeline[-1].damage_index(pipeline[0].transform(r)) for r in (later, damaged))
        found.append((index > healthy_index.quantile(0.98)).mean())
    assert 0.3 < found[0] < 0.9
    assert found[1] > found[0] - 0.02


# Baselines of any length


def test_some_of_a_long_baseline_tell_the_spread_of_all(monkeypatch):
    monkeypatch.setattr("skthermo.residuals.spread.MOST_PLACES", 600)
    fitted = compensator()
    white = fitted.fit_transform(X)
    assert len(fitted.spread_.by_weather.nearest.places) == 600
    for spread in spreads(white, X):
        np.testing.assert_allclose(spread, np.eye(2), atol=0.3)


@pytest.mark.filterwarnings("ignore:.*weather-of-one-fold")
def test_few_records_have_one_covariance():
    few = X.iloc[:90]
    assert compensator().fit(few).spread_.smoothing is None
    np.testing.assert_array_equal(compensator().fit_transform(few), compensator("global").fit_transform(few))


# Weather that the baseline does not know


@cache
def by_default():
    return compensator("auto").fit(X)


def larger(one, other):
    """The smallest eigenvalue of each difference of covariances."""
    return np.linalg.eigvalsh(one - other).min(axis=-1)


def test_in_the_weather_of_the_baseline_the_covariance_follows_the_weather():
    weather = LATER[["T1", "T2"]].to_numpy()
    by_weather, places = by_default().spread_.by_weather, locally().spread_.by_weather.nearest.places
    distances = nearest(places, by_weather.coordinates.transform(weather), by_weather.smoothing.n_neighbors)[0]
    familiar = (distances.mean(axis=1) < by_weather.familiar) & (by_default().extrapolation_distance(LATER) == 0).all(
        axis=1
    )
    assert familiar.mean() > 0.9
    ours, local = (fitted.spread_.covariances(weather[familiar]) for fitted in (by_default(), locally()))
    np.testing.assert_allclose(ours, local)


@settings(max_examples=30, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3))
def test_outside_the_weather_of_the_baseline_the_covariance_is_no_smaller_than_that_of_all(first, second):
    lowest, width = X[["T1", "T2"]].min().to_numpy(), np.ptp(X[["T1", "T2"]].to_numpy(), axis=0)
    weather = (lowest + np.array([first, second]) * width)[np.newaxis]
    local, ours = (fitted.spread_.covariances(weather) for fitted in (locally(), by_default()))
    assert (larger(ours, local) > -1e-12).all()
    if max(abs(first - 0.5), abs(second - 0.5)) > 0.75:
        assert (larger(ours, by_default().spread_.overall.covariance) > -1e-12).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, len(LATER) - 1), st.floats(-2, 2), arrays(float, 2, elements=st.floats(-1, 1)), st.floats(1, 100))
def test_a_larger_shift_is_never_a_smaller_index(row, warmer, shift, factor):
    record = LATER.iloc[[row]].copy()
    record[["T1", "T2"]] += warmer * np.ptp(X["T1"])
    healthy = by_default().estimator_.predict(record[["T1", "T2"]]) + by_default().spread_.overall.mean
    indices = []
    for size in (1.0, factor):
        record[MODES] = healthy + size * shift
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            indices.append(np.linalg.norm(by_default().transform(record)))
    assert indices[1] >= indices[0] * (1 - 1e-9) - 1e-9


def test_an_end_of_the_weather_is_wider_where_the_baseline_shows_that_predictions_err_there():
    random = np.random.default_rng(0)
    stamps = pd.date_range("2025-01-01", periods=2000, freq="6h")
    T = 12 * np.sin(2 * np.pi * np.arange(2000) / 1460) + random.normal(0, 3, 2000)
    frozen = 0.05 * np.maximum(-6 - T, 0)
    records = pd.DataFrame({"T1": T, "f1": 4 - 0.01 * T + frozen + random.normal(0, 0.01, 2000)}, stamps)
    fitted = TemperatureCompensator(TemperatureMapper(), targets=["f1"]).fit(records)
    cold, warm = fitted.spread_.extrapolation.growth
    assert cold > 10
    assert warm < 0.1
    ranges = T.min() + np.ptp(T) * np.linspace(-1, 2, 31)
    deviations = fitted.spread_.deviations(ranges[:, np.newaxis])[:, 0]
    assert (np.diff(deviations[:11]) < 0).all()
    assert deviations[0] > 3 * deviations[15]


def test_extrapolated_rows_are_those_outside_the_weather_of_the_baseline():
    warm = LATER.assign(T1=X["T1"].max() + np.linspace(0, 0.1, len(LATER)) * np.ptp(X["T1"]), T2=X["T2"].max())
    rows = by_default().extrapolated(warm)
    assert list(rows.index) == list(LATER.index)
    np.testing.assert_array_equal(rows, np.linspace(0, 0.1, len(LATER)) > 0.05)
    np.testing.assert_array_equal(
        TemperatureCompensator(LinearRegression(), targets=[2, 3]).fit(X.to_numpy()).extrapolated(warm.to_numpy()), rows
    )
    assert not by_default().extrapolated(X.mask(X < 0)).any()


@pytest.mark.one_case
@pytest.mark.parametrize("whiten", [None, "auto", "global", "local"])
def test_weather_outside_the_baseline_is_counted_in_one_warning(whiten):
    fitted, hot = compensator(whiten).fit(X), LATER.copy()
    hot.iloc[[3, 5, 800], 1] += 60
    with pytest.warns(UserWarning, match="3 of 3000 .*outside-training-weather") as given:
        fitted.transform(hot)
    assert len(given) == 1
    assert (fitted.extrapolation_distance(hot)["T2"] > 0.25).sum() == 3


def test_the_row_outside_the_baseline_is_named_beside_gaps():
    fitted, hot = compensator(None, HistGradientBoostingRegressor(max_iter=2)).fit(X), LATER[:20].copy()
    hot.iloc[:5, 0] = np.nan
    hot.iloc[7, 1] += 60
    with pytest.warns(UserWarning, match="1 of 20 .*row 7.*outside-training-weather|filled-temperatures") as given:
        fitted.transform(hot)
    assert [warning.message.kind for warning in given] == ["filled-temperatures", "outside-training-weather"]


# Missing modes


@pytest.mark.one_case
@pytest.mark.parametrize("whiten", ["global", "local"])
def test_gaps_stay_and_the_other_modes_are_whitened_by_themselves(whiten):
    holed = X.copy()
    holed = holed.mask(np.random.default_rng(0).random(X.shape) < [0, 0, 0.3, 0.3])
    white = compensator(whiten).fit_transform(holed)
    np.testing.assert_array_equal(white.isna(), holed[MODES].isna())
    alone = white[white["f2"].isna()]["f1"]
    assert alone.std() == pytest.approx(1, abs=0.15)
    fitted = compensator(whiten).fit(holed)
    later = LATER.assign(f2=np.nan)
    residuals = later["f1"] - fitted.estimator_.predict(later[["T1", "T2"]])[:, 0]
    assert fitted.transform(later)["f2"].isna().all()
    assert np.corrcoef(fitted.transform(later)["f1"], residuals)[0, 1] > 0.8


# As a transformer


def test_frames_and_arrays_agree_and_the_index_is_kept():
    frames, plain = compensator(cv="contiguous"), compensator(targets=[2, 3], cv="contiguous")
    white = frames.fit_transform(X)
    assert white.index.equals(X.index)
    assert list(white) == MODES
    np.testing.assert_allclose(plain.fit_transform(X.to_numpy()), white, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(plain.transform(LATER.to_numpy()), frames.transform(LATER), rtol=1e-9, atol=1e-11)


def test_fit_and_fit_transform_teach_the_same():
    fitted, by_transform = compensator(), compensator()
    by_transform.fit_transform(X)
    pd.testing.assert_frame_equal(fitted.fit(X).transform(LATER), by_transform.transform(LATER))
    assert fitted.spread_.smoothing == by_transform.spread_.smoothing


def test_the_size_of_chunks_does_not_matter(monkeypatch):
    holed = X.mask(np.random.default_rng(0).random(X.shape) < [0, 0, 0.3, 0.3])
    expected = compensator().fit_transform(holed), compensator().fit(holed).transform(LATER)
    monkeypatch.setattr("skthermo.residuals.weather.NUMBERS_AT_ONCE", 100_000)
    found = compensator().fit_transform(holed), compensator().fit(holed).transform(LATER)
    for white, whole in zip(found, expected, strict=True):
        np.testing.assert_allclose(white, whole, rtol=1e-9, atol=1e-12)


@pytest.mark.one_case
@pytest.mark.parametrize("whiten", [None, "global", "local"])
def test_forward_in_time_only_rows_before_the_first_fold_are_nan(whiten):
    white = compensator(whiten, cv=TimeSeriesSplit(5)).fit_transform(X)
    np.testing.assert_array_equal(np.flatnonzero(white.isna().any(axis=1)), np.arange(200))
    assert white.iloc[:200].isna().all(axis=None)
    first = LinearRegression().fit(X[["T1", "T2"]][:200], X[MODES][:200])
    if whiten is None:
        expected = X[MODES][200:400] - first.predict(X[["T1", "T2"]][200:400])
        np.testing.assert_allclose(white[200:400], expected, rtol=1e-9, atol=1e-12)


# Residuals that cannot be whitened


@pytest.mark.parametrize("whiten", ["global", "local"])
def test_a_mode_without_scatter_is_refused(whiten):
    with pytest.raises(ValueError, match="constant"):
        compensator(whiten).fit(X.assign(f1=4.0, f2=9.0))


@pytest.mark.parametrize("whiten", ["global", "local"])
def test_a_perfect_estimator_is_refused(whiten):
    linear = X.assign(f1=4 - 0.01 * X["T1"], f2=9 - 0.02 * X["T2"])
    with pytest.raises(ValueError, match="singular"):
        compensator(whiten).fit(linear)


@pytest.mark.parametrize("whiten", ["global", "local"])
def test_a_mode_without_out_of_fold_residuals_is_named(whiten):
    early = X.copy()
    early.iloc[200:, 3] = np.nan
    with pytest.raises(ValueError, match="f2"):
        compensator(whiten, cv=TimeSeriesSplit(5)).fit(early)


def test_deviations_are_those_by_which_single_modes_are_divided():
    for whiten in ("global", "local"):
        fitted = compensator(whiten).fit(X)
        alone = LATER.assign(f2=np.nan)
        more = alone.assign(f1=alone["f1"] + 1.0)
        divided = 1 / (fitted.transform(more) - fitted.transform(alone))["f1"]
        np.testing.assert_allclose(fitted.spread_.deviations(LATER[["T1", "T2"]])[:, 0], divided, rtol=1e-9)
