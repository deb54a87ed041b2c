"""Gaps and lags inside a compensator."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from sklearn.base import clone
from sklearn.compose import ColumnTransformer, TransformedTargetRegressor
from sklearn.ensemble import HistGradientBoostingRegressor, RandomForestRegressor
from sklearn.impute import SimpleImputer
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV, KFold, PredefinedSplit, ShuffleSplit, cross_val_predict
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from skthermo.detection import TemperatureCompensator
from skthermo.preprocessing import KNNGapImputer, LagFeatures
from skthermo.residuals.sensors import SensorRegression
from skthermo.surrogate import TemperatureMapper
from tests.detection.compensated import (
    LAGGED,
    MODES,
    POSITIONS,
    F,
    T,
    X,
    compensator,
    hourly,
    with_gaps,
)

# The chain's linear inverse scatters with the noise, and folds of few records predict weather not seen.
pytestmark = [
    pytest.mark.filterwarnings("ignore:.*(outside-bounds|other-weather)"),
]
TREES = HistGradientBoostingRegressor(max_iter=5)
SHUFFLED = KFold(3, shuffle=True, random_state=0)


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("cv", "same"), [(None, None), ("contiguous", KFold(5)), (4, KFold(4)), (SHUFFLED, SHUFFLED)], ids=str
)
def test_fit_transform_is_cross_val_predict_and_then_a_fit_on_all_rows(cv, same):
    fitted = compensator(cv=cv)
    residuals = fitted.fit_transform(X)
    same = PredefinedSplit(fitted.folds_) if cv is None else same
    predicted = cross_val_predict(KNeighborsRegressor(3), T, F, cv=same)
    np.testing.assert_allclose(residuals, np.log(F / predicted), atol=1e-12)
    pd.testing.assert_frame_equal(fitted.transform(X), compensator().fit(X).transform(X))


@pytest.mark.parametrize(("correlation", "shortest", "longest"), [(0.0, 7, 7), (0.9, 30, 36)])
def test_blocks_out_of_fold_are_as_long_as_noise_is_remembered(correlation, shortest, longest):
    rng, days = np.random.default_rng(0), pd.date_range("2025", periods=365)
    noise = lfilter([1.0], [1.0, -correlation], rng.normal(0, 0.001, (365 + 100, 2)), axis=0)[100:]
    air = pd.DataFrame({"air": 10 * np.sin(np.arange(365) / 58) + rng.normal(0, 3, 365)}, days)
    records = air.join(pd.DataFrame(5.0 * np.exp(noise - 0.001 * air.to_numpy()), days, ["f1", "f2"]))
    fold_of = TemperatureCompensator(targets=["f1", "f2"]).fit(records).folds_
    blocks = np.diff(np.flatnonzero(np.diff(fold_of)))
    assert shortest <= blocks.min()
    assert blocks.max() <= longest


def test_lags_within_go_by_time():
    lagged = make_pipeline(LagFeatures(3), LinearRegression())
    order = np.random.default_rng(0).permutation(len(X))
    expected = compensator(lagged).fit(X).transform(X)
    with pytest.warns(UserWarning, match="wrong-stamps"):
        shuffled = compensator(lagged).fit(X.iloc[order]).transform(X.iloc[order])
    np.testing.assert_allclose(shuffled.loc[X.index], expected, rtol=0, atol=1e-9)
    assert list(compensator(lagged).fit(X).estimator_[0].feature_names_in_) == list(T.columns)


@pytest.mark.one_case
@pytest.mark.parametrize("estimator", [KNeighborsRegressor(3), make_pipeline(StandardScaler(), Ridge())], ids=str)
def test_every_target_learns_from_the_rows_that_have_it_and_is_missing_alone(estimator):
    holed, fitted, others = with_gaps(["f2"], [3, 50]), compensator(estimator), ["f1", *MODES[2:]]
    np.testing.assert_array_equal(np.argwhere(fitted.fit_transform(holed).isna()), [[3, 1], [50, 1]])
    np.testing.assert_array_equal(np.argwhere(fitted.transform(holed).isna()), [[3, 1], [50, 1]])
    residuals = fitted.transform(X)
    np.testing.assert_allclose(residuals[others], compensator(estimator).fit(X).transform(X)[others], atol=1e-9)
    alone = compensator(estimator, targets=["f2"]).fit(T.join(holed[["f2"]])).transform(T.join(F[["f2"]]))
    np.testing.assert_allclose(residuals[["f2"]], alone, atol=1e-9)
    never_together = X.copy()
    never_together.iloc[::2, POSITIONS[1]], never_together.loc[X.index[1::2], others] = np.nan, np.nan
    residuals = compensator(estimator).fit_transform(never_together)
    pd.testing.assert_frame_equal(residuals.isna(), never_together[MODES].isna())


EMPTY = "ignore:.*not-evaluated"


@pytest.mark.filterwarnings(EMPTY)
def test_a_fold_without_a_temperature_is_missing():
    residuals = compensator(cv="contiguous").fit_transform(with_gaps(list(T), slice(40, 80)))
    np.testing.assert_array_equal(np.flatnonzero(residuals.isna().all(axis=1)), np.arange(40, 80))
    assert residuals.drop(index=residuals.index[40:80]).notna().all(axis=None)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*faulty-sensor")
@pytest.mark.parametrize(
    "estimator",
    [
        Ridge(),
        MultiOutputRegressor(TREES),
        GridSearchCV(RandomForestRegressor(random_state=0), {"n_estimators": [2, 3]}, cv=2),
        make_pipeline(StandardScaler(), KNNGapImputer(), PolynomialFeatures(2), LinearRegression()),
        TransformedTargetRegressor(make_pipeline(SimpleImputer(), Ridge()), transformer=StandardScaler()),
    ],
    ids=lambda estimator: type(estimator[-1] if hasattr(estimator, "steps") else estimator).__name__,
)
def test_every_estimator_gets_temperatures_filled_from_the_other_sensors(estimator):
    holed = with_gaps(["T1"], [0, 7])
    fitted = compensator(estimator).fit(holed)
    filled = T.copy()
    filled["T1"] = SensorRegression.fitted(holed[T.columns]).fill(holed[T.columns])[0][:, 0]
    expected = np.log(F / clone(estimator).fit(filled, F).predict(filled))
    # memory may be laid out otherwise, and then linear algebra rounds otherwise
    measured = np.delete(np.arange(len(X)), [0, 7])
    np.testing.assert_allclose(fitted.transform(holed).iloc[measured], expected.iloc[measured], rtol=0, atol=1e-9)
    assert fitted.fit_transform(holed).notna().all(axis=None)


@pytest.mark.filterwarnings(EMPTY)
@pytest.mark.parametrize(
    "estimator",
    [make_pipeline(PolynomialFeatures(2), SimpleImputer(), Ridge()), TransformedTargetRegressor()],
    ids=["imputed too late", "default regressor"],
)
def test_nothing_missing_reaches_an_estimator_that_takes_none(estimator):
    residuals = compensator(estimator).fit_transform(with_gaps(list(T), [0, 7]))
    np.testing.assert_array_equal(np.flatnonzero(residuals.isna().any(axis=1)), [0, 7])


@pytest.mark.one_case
@pytest.mark.filterwarnings(EMPTY)
@pytest.mark.parametrize(
    "estimator",
    [
        LAGGED,
        make_pipeline(StandardScaler().set_output(transform="pandas"), *LAGGED),
        make_pipeline(ColumnTransformer([("lags", LAGGED[0], ["T1"])]), LinearRegression()),
        make_pipeline(LAGGED[0], PolynomialFeatures(1), LinearRegression()),
        make_pipeline(LAGGED[0], TemperatureMapper(LinearRegression())),
    ],
    ids=["lags", "scaled", "by column", "polynomial", "mapper"],
)
def test_what_a_lag_does_not_find_is_missing_and_does_not_train(estimator):
    records = hourly()
    if isinstance(estimator[-1], TemperatureMapper):
        records["f1"] = np.exp(records["f1"])  # it learns logarithms
    gappy = records.drop(records.index[40:50])
    gappy.iloc[70, 0] = np.nan
    residuals = compensator(estimator, targets=["f1"]).fit(gappy).transform(gappy)
    np.testing.assert_array_equal(np.flatnonzero(residuals["f1"].isna()), [0, 1, 40, 41, 70, 72])
    np.testing.assert_allclose(residuals.dropna(), 0, atol=1e-9)
    in_folds = compensator(estimator, targets=["f1"]).fit_transform(gappy)
    assert in_folds["f1"].notna().sum() > 100
    np.testing.assert_allclose(in_folds.dropna(), 0, atol=1e-9)


@pytest.mark.filterwarnings(EMPTY)
@pytest.mark.parametrize("data", [lambda frame: frame, lambda frame: frame.to_numpy()], ids=["frame", "array"])
def test_rows_without_a_target_still_are_the_history_of_lags(data):
    records = hourly()
    holed = records.copy()
    holed.iloc[10:20, 1] = np.nan
    estimator = make_pipeline(LagFeatures([0, 2], padding="nan"), LinearRegression())
    residuals = np.asarray(compensator(estimator, targets=[1]).fit(data(holed)).transform(data(holed)))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(residuals)), [0, 1, *range(10, 20)])
    np.testing.assert_allclose(residuals[~np.isnan(residuals)], 0, atol=1e-9)


def test_numbers_for_missing_values_are_set_aside_and_warned_of_at_the_users_line():
    marked = X.copy()
    marked.iloc[5:8, 0] = -999
    with pytest.warns(UserWarning, match="T1") as caught:
        compensator().fit(marked)
    assert {warning.filename for warning in caught} == {__file__}


@pytest.mark.parametrize(
    ("cv", "message"),
    [
        ([(np.arange(100), np.arange(40, 200, 2))], r"tests row 41 0 times \(80 of 200 rows not exactly once\); expec"),
        (ShuffleSplit(3, random_state=0), r"cv is ShuffleSplit\(.*expected a partition of the rows"),
        ([], "cv is .., which tests row 0 0 times"),
        (201, "201 folds of 200 rows"),
        (1, "'cv' parameter"),
        ([1, 2], r"cv holds 1 as its element 0; expected a number of folds, a splitter, or pairs of training and te"),
        ([(np.arange(200) < 100, np.arange(200) >= 100)], r"element 0; .* positions from 0 to 199"),
        ("five", "'cv' parameter"),
    ],
    ids=str,
)
def test_folds_that_do_not_partition_the_rows_are_refused(cv, message):
    with pytest.raises(ValueError, match=message):
        compensator(cv=cv).fit_transform(X)


def test_no_row_to_learn_from_is_said():
    said = r"'f1' has none of [0-9]+ rows to learn from, of all or in a fold; expected rows with that target"
    with pytest.raises(ValueError, match=said):
        compensator(Ridge()).fit_transform(with_gaps(["f1"], slice(1, None)))
