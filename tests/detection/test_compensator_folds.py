"""Folds that see each season, and lags that are the true ones whatever the folds."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.tree import DecisionTreeRegressor

from skthermo.detection import TemperatureCompensator
from skthermo.preprocessing import BlockedKFold, LagFeatures

STAMPS = pd.date_range("2025", periods=365 * 8, freq="3h")


def year(scatter=0.02, seed=0, n_rows=365 * 8, start="2025"):
    """Two modes that follow the temperature of now and of six hours ago, with errors."""
    random, hours = np.random.default_rng(seed), 3 * np.arange(n_rows)
    T = 10 - 12 * np.cos(2 * np.pi * hours / 8760) + 4 * np.sin(2 * np.pi * hours / 24) + random.normal(0, 2, n_rows)
    before = np.append([T[0], T[0]], T[:-2])
    errors = scatter * random.normal(size=(n_rows, 2))
    F = np.array([4.0, 9.0]) - 0.01 * T[:, np.newaxis] - 0.02 * before[:, np.newaxis] + errors
    index = pd.date_range(start, periods=n_rows, freq="3h")
    return pd.DataFrame(np.column_stack([T, F]), index, ["T", "f1", "f2"])


def compensator(estimator=None, **options):
    return TemperatureCompensator(estimator or LinearRegression(), **({"targets": ["f1", "f2"]} | options))


LAGGED = make_pipeline(LagFeatures([0, 2]), LinearRegression())


def test_blocks_of_a_week_are_dealt_to_five_folds():
    fitted = compensator(LAGGED).fit(year())
    np.testing.assert_array_equal(fitted.folds_, BlockedKFold().fold_of(year()))
    months = pd.DataFrame({"fold": fitted.folds_, "month": STAMPS.month})
    assert months.groupby("fold")["month"].nunique().tolist() == [12] * 5
    forward = [(np.arange(1000), np.arange(1000, len(STAMPS)))]
    assert (compensator(LAGGED, cv=forward).fit(year()).folds_ == np.repeat([-1, 0], [1000, len(STAMPS) - 1000])).all()


@pytest.mark.one_case
@pytest.mark.parametrize("data", [lambda frame: frame, lambda frame: frame.to_numpy()], ids=["frame", "array"])
@pytest.mark.parametrize("cv", [BlockedKFold(5, block=7), "contiguous"], ids=str)
def test_lags_near_the_border_of_a_block_are_the_true_ones(data, cv):
    residuals = compensator(LAGGED, targets=[1, 2], cv=cv).fit_transform(data(year(scatter=0)))
    np.testing.assert_allclose(residuals, 0, atol=1e-9)


class MeanOfTraining(RegressorMixin, BaseEstimator):
    def fit(self, X, y):
        self.mean_ = np.asarray(y).mean(axis=0)
        return self

    def predict(self, X):
        return np.tile(self.mean_, (len(X), 1))


def test_no_target_of_a_fold_reaches_its_own_prediction():
    records, fitted = year(), compensator(make_pipeline(LagFeatures([0, 2]), MeanOfTraining()))
    residuals = fitted.fit_transform(records)
    for fold in range(5):
        test = fitted.folds_ == fold
        expected = np.log(records[["f1", "f2"]][test] / records[["f1", "f2"]][~test].mean())
        np.testing.assert_allclose(residuals[test], expected, atol=1e-12)


def test_contiguous_folds_of_one_year_are_warned_of_with_numbers():
    records = year()
    cold = (np.arange(len(records)) // 584 == 2) & (np.arange(len(records)) % 3 == 0)
    records.loc[cold, "T"] -= 40  # in the middle of the year
    with pytest.warns(UserWarning, match="'T'.*other-weather") as given:
        residuals = compensator(DecisionTreeRegressor(max_depth=5), cv="contiguous").fit_transform(records)
    assert len(given) == 1
    assert len(residuals) == len(STAMPS)
    periods = np.arange(len(STAMPS)) * 5 // len(STAMPS)
    np.testing.assert_array_equal(periods, compensator(LAGGED, cv="contiguous").fit(year()).folds_)


def test_a_day_alone_is_evaluated_only_where_its_lags_are_known():
    lags = make_pipeline(LagFeatures([0, 2, 7], freq="3h"), LinearRegression())
    fitted, later = compensator(lags).fit(year()), year(seed=1, n_rows=8 * 10, start="2026-03-01")
    with pytest.warns(UserWarning, match="not-evaluated"):
        whole = fitted.transform(later)
    for day, batch in later.iloc[16:].groupby(later.index[16:].floor("D")):
        with pytest.warns(UserWarning, match="not-evaluated") as given:
            alone = fitted.transform(batch)
        assert len(given) == 1
        np.testing.assert_array_equal(alone.notna().all(axis=1), batch.index >= day + pd.Timedelta("21h"))
        np.testing.assert_allclose(alone.iloc[7:], whole.loc[batch.index[7:]], rtol=1e-9)
