"""Folds that see each season, and lags that are the true ones whatever the folds."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.tree import DecisionTreeRegressor

from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.preprocessing import BlockedKFold, LagFeatures

STAMPS = pd.date_range("2025", periods=365 * 8, freq="3h")


def year(memory=0.0, seed=0, n_rows=365 * 8):
    """Two modes that follow the temperature of now and of six hours ago, with errors that remember the last ones."""
    random, hours = np.random.default_rng(seed), 3 * np.arange(n_rows)
    T = 10 - 12 * np.cos(2 * np.pi * hours / 8760) + 4 * np.sin(2 * np.pi * hours / 24) + random.normal(0, 2, n_rows)
    before = np.append([T[0], T[0]], T[:-2])
    noise = np.sqrt(1 - memory**2) * random.normal(0, 0.02, (n_rows, 2))
    errors = pd.DataFrame(noise).ewm(alpha=1 - memory, adjust=False).mean().to_numpy() / max(1 - memory, 1e-9)
    F = np.array([4.0, 9.0]) - 0.01 * T[:, np.newaxis] - 0.02 * before[:, np.newaxis] + errors
    index = pd.date_range("2025", periods=n_rows, freq="3h")
    return pd.DataFrame(np.column_stack([T, F]), index, ["T", "f1", "f2"])


def compensator(estimator=None, **options):
    return TemperatureCompensator(estimator or LinearRegression(), **({"targets": ["f1", "f2"]} | options))


LAGGED = make_pipeline(LagFeatures([0, 2]), LinearRegression())


def test_blocks_of_a_week_are_dealt_to_five_folds():
    fitted = compensator(LAGGED).fit(year())
    np.testing.assert_array_equal(fitted.folds_, BlockedKFold().fold_of(year()))
    months = pd.DataFrame({"fold": fitted.folds_, "month": STAMPS.month})
    assert months.groupby("fold")["month"].nunique().tolist() == [12] * 5


def test_other_folds_are_those_that_were_asked_for():
    for cv in ("contiguous", 5):
        fitted = compensator(LAGGED, cv=cv).fit(year())
        np.testing.assert_array_equal(fitted.folds_, np.arange(len(STAMPS)) * 5 // len(STAMPS))
    forward = [(np.arange(1000), np.arange(1000, len(STAMPS)))]
    assert (compensator(LAGGED, cv=forward).fit(year()).folds_ == np.repeat([-1, 0], [1000, len(STAMPS) - 1000])).all()


@pytest.mark.one_case
@pytest.mark.parametrize("data", [lambda frame: frame, lambda frame: frame.to_numpy()], ids=["frame", "array"])
@pytest.mark.parametrize("cv", [BlockedKFold(5, block=7), "contiguous"], ids=str)
def test_lags_near_the_border_of_a_block_are_the_true_ones(data, cv):
    records = year()
    records[["f1", "f2"]] = (
        np.array([4.0, 9.0])
        - 0.01 * records[["T"]].to_numpy()
        - 0.02 * np.append([records["T"].iloc[0]] * 2, records["T"].iloc[:-2]).reshape(-1, 1)
    )
    residuals = compensator(LAGGED, targets=[1, 2], cv=cv).fit_transform(data(records))
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
    with pytest.warns(UserWarning, match="'T'.*other-weather") as given:
        residuals = compensator(DecisionTreeRegressor(max_depth=5), cv="contiguous").fit_transform(winter_year())
    assert len(given) == 1
    assert len(residuals) == len(STAMPS)


def winter_year():
    """A year that is colder in its middle than anywhere else."""
    records = year()
    cold = (np.arange(len(records)) // 584 == 2) & (np.arange(len(records)) % 3 == 0)
    records.loc[cold, "T"] -= 40
    return records


# Batches of a day


@pytest.fixture(scope="module")
def service():
    lags = make_pipeline(LagFeatures([0, 2, 8], freq="3h"), LinearRegression())
    detector = make_pipeline(compensator(lags), MahalanobisDetector()).fit(year())
    later = year(seed=1, n_rows=8 * 60)
    later.index = pd.date_range("2026-03-01", periods=len(later), freq="3h")
    later.loc[later.index >= "2026-04-01", ["f1", "f2"]] -= 0.08
    return detector, later


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*not-evaluated")
def test_a_day_behind_the_records_before_it_is_evaluated_as_in_one_pass(service):
    detector, later = service
    index = detector[-1].damage_index(detector[0].transform(later))
    limit, n_alarms = detector[-1].threshold_, 0
    for day, batch in later.iloc[16:].groupby(later.index[16:].floor("D")):
        records = later[(later.index >= day - pd.Timedelta("30h")) & (later.index < day + pd.Timedelta("1D"))]
        found = detector[-1].damage_index(detector[0].transform(records))[-len(batch) :]
        np.testing.assert_array_equal(found > limit, index[batch.index] > limit)
        np.testing.assert_allclose(found, index[batch.index], rtol=1e-9)
        n_alarms += (found > limit).sum()
    assert 100 < n_alarms < 300


@pytest.mark.filterwarnings("ignore:.*not-evaluated")
def test_a_day_alone_is_evaluated_only_where_its_lags_are_known(service):
    detector, later = service
    index = detector[-1].damage_index(detector[0].transform(later))
    for _, batch in later.iloc[16:].groupby(later.index[16:].floor("D")):
        alone = detector[-1].damage_index(detector[0].transform(batch))
        known = alone.notna()
        assert not known.iloc[:-1].all()
        np.testing.assert_allclose(alone[known], index[batch.index][known], rtol=1e-9)


def test_a_day_alone_says_what_lags_lack(service):
    detector, later = service
    with pytest.warns(UserWarning, match="not-evaluated") as given:
        residuals = detector[0].transform(later.loc["2026-03-04"])
    assert len(given) == 1
    assert residuals.isna().all(axis=None)
