"""Residuals of frequencies, out of fold and in sample."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.ensemble import RandomForestRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import KFold
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import BlockedKFold
from tests.detection.compensated import (
    LAGGED,
    MODES,
    POSITIONS,
    TRUSS,
    F,
    T,
    X,
    chain,
    compensator,
    hourly,
    with_gaps,
)

# The chain's linear inverse scatters with the noise, and folds of few records predict weather not seen.
pytestmark = [
    pytest.mark.filterwarnings("ignore:.*(outside-bounds|outside-training-weather)"),
    pytest.mark.filterwarnings("ignore:.*weather-of-one-fold"),
    pytest.mark.filterwarnings("ignore:.*few-baseline-records"),
]


def alarm_rate(detector, records):
    return (detector.predict(records) == -1).mean()


# What residuals are


def test_a_perfect_estimator_leaves_nothing():
    linear = T.join(pd.DataFrame(T.to_numpy() @ [[0.1, 0.2], [0.3, -0.1], [0.0, 0.5]] + 4, T.index, ["f1", "f2"]))
    perfect = compensator(LinearRegression(), targets=["f1", "f2"])
    for residuals in (perfect.fit_transform(linear), perfect.transform(linear)):
        np.testing.assert_allclose(residuals, 0, atol=1e-12)


def test_transform_is_measured_minus_predicted_by_the_fitted_clone():
    estimator = KNeighborsRegressor(3)
    fitted = compensator(estimator).fit(X)
    assert fitted.estimator_ is not estimator
    assert not hasattr(estimator, "n_features_in_")
    pd.testing.assert_frame_equal(fitted.transform(X), F - fitted.estimator_.predict(T))
    expected = KNeighborsRegressor(3).fit(T, F).predict(T)
    np.testing.assert_array_equal(fitted.transform(X), F - expected)


def test_folds_given_as_an_iterable_serve():
    folds = list(KFold(4).split(X))
    pd.testing.assert_frame_equal(compensator(cv=folds).fit_transform(X), compensator(cv=4).fit_transform(X))


@pytest.mark.filterwarnings("ignore:.*frequency-outliers")
def test_a_folds_targets_enter_only_their_own_residuals():
    periods = compensator(cv="contiguous")
    before, changed, fold = periods.fit_transform(X), X.copy(), slice(80, 120)
    change = np.random.default_rng(0).normal(size=(40, len(MODES)))
    changed.iloc[fold, POSITIONS] += change
    after = periods.fit_transform(changed)
    np.testing.assert_allclose(after.iloc[fold], before.iloc[fold] + change, rtol=0, atol=1e-12)
    others = np.delete(np.arange(len(X)), np.arange(80, 120))
    assert (after.iloc[others] != before.iloc[others]).any(axis=None)


def test_order_of_columns_and_of_targets_does_not_matter():
    order = np.random.default_rng(0).permutation(X.shape[1])
    residuals = compensator(LinearRegression()).fit_transform(X)
    shuffled = compensator(LinearRegression(), targets=MODES[::-1]).fit_transform(X.iloc[:, order])
    assert list(shuffled.columns) == MODES[::-1]
    np.testing.assert_allclose(shuffled[MODES], residuals, rtol=0, atol=1e-9)


@pytest.mark.one_case
@pytest.mark.parametrize("method", ["fit_transform", "transform"])
def test_frames_arrays_names_and_positions_agree(method):
    folds = BlockedKFold(5, block=8)
    by_name, by_position = compensator(cv=folds), compensator(targets=POSITIONS, cv=folds)
    plain = compensator(targets=np.array(POSITIONS), cv=folds)
    frame = getattr(by_name.fit(X), method)(X)
    assert list(frame.columns) == MODES
    assert frame.index.equals(X.index)
    pd.testing.assert_frame_equal(getattr(by_position.fit(X), method)(X), frame)
    array = getattr(plain.fit(X.to_numpy()), method)(X.to_numpy())
    assert type(array) is np.ndarray
    np.testing.assert_array_equal(array, frame)


@pytest.mark.filterwarnings("ignore::skthermo.exceptions.RecordsWarning")  # modes that are not among the targets
def test_one_target_is_a_vector_for_estimators_that_want_one():
    forest = RandomForestRegressor(5, random_state=0)  # warns where a column stands for a vector
    single = compensator(forest, targets=["f2"]).fit(X)
    others = X.drop(columns="f2")
    expected = F["f2"] - clone(forest).fit(others, F["f2"]).predict(others)
    np.testing.assert_array_equal(single.transform(X)["f2"], expected)
    wrapped = compensator(MultiOutputRegressor(clone(forest)), targets=["f2"])
    np.testing.assert_array_equal(wrapped.fit_transform(X), single.fit_transform(X))


# What they are for


@pytest.mark.filterwarnings("ignore:.*few-baseline-records")  # raw frequencies follow the season
def test_out_of_fold_thresholds_keep_the_false_alarm_rate_and_in_sample_ones_do_not():
    healthy, later, damaged = (
        make_truss_campaign(2, random_state=seed, damage=damage)
        for seed, damage in ((0, None), (1, None), (2, {"bottom": 0.2}))
    )
    baseline, second_year, damaged = (c.temperatures.join(c.frequencies) for c in (healthy, later, damaged))
    detector = make_pipeline(compensator(KNeighborsRegressor(2)), MahalanobisDetector(0.02)).fit(baseline)
    fitted = detector[0]
    in_sample = MahalanobisDetector(0.02).fit(fitted.transform(baseline))
    assert alarm_rate(detector, second_year) == pytest.approx(0.02, abs=0.012)  # two standard errors of 730 records
    assert alarm_rate(in_sample, fitted.transform(second_year)) > 0.3
    raw = MahalanobisDetector(0.02).fit(baseline[MODES])
    assert alarm_rate(detector, damaged) > alarm_rate(raw, damaged[MODES]) > 0.9


# Frames, models and scikit-learn's machinery


@pytest.mark.nightly
def test_fe_models_within_are_shared_and_never_copied():
    fitted = compensator(chain()).fit(X)
    assert fitted.estimator_.model is clone(fitted).estimator.model is TRUSS


@pytest.mark.filterwarnings("ignore::skthermo.exceptions.RecordsWarning")  # modes that are not among the targets
def test_output_names_and_containers():
    fitted = compensator().fit(X)
    assert list(fitted.get_feature_names_out()) == MODES
    assert list(fitted.targets_) == POSITIONS
    plain = compensator(targets=[4, 3]).set_output(transform="pandas").fit(X.to_numpy())
    assert list(plain.transform(X.to_numpy()).columns) == ["x4", "x3"]
    assert list(plain.get_feature_names_out(X.columns)) == ["f2", "f1"]


# Missing values


def test_what_cannot_be_predicted_flows_through():
    class Unsure(RegressorMixin, BaseEstimator):
        def fit(self, X, y):
            self.mean_ = np.asarray(y).mean(axis=0)
            return self

        def predict(self, X):
            return np.where(np.asarray(X)[:, :1] > 30, np.nan, self.mean_)

    with pytest.warns(UserWarning, match="18 of 200 .*: 18 .*not-predicted") as given:
        residuals = compensator(Unsure()).fit(X).transform(X)
    assert len(given) == 2  # of fit and of transform
    np.testing.assert_array_equal(residuals.isna().all(axis=1), X["T1"] > 30)


# Lags and gaps


@pytest.mark.filterwarnings("ignore:.*not-predicted")
def test_the_fitted_pipeline_is_whole():
    fitted = compensator(LAGGED, targets=["f1"]).fit(hourly())
    assert [name for name, _ in fitted.estimator_.steps] == [name for name, _ in LAGGED.steps]
    lagged = fitted.estimator_[0].transform(hourly()[["T1"]]).dropna()
    np.testing.assert_allclose(fitted.estimator_[1].predict(lagged), hourly()["f1"].iloc[2:], atol=1e-9)


# Units, missing values by number, names


def test_columns_named_by_integers_keep_their_names():
    numbered = X.set_axis(range(9), axis=1)
    residuals = compensator(targets=POSITIONS).fit_transform(numbered)
    assert list(residuals.columns) == POSITIONS
    with pytest.raises(ValueError, match=r"targets are the integers \[3\], which may be names or positions"):
        compensator(targets=[3]).fit(X.set_axis(range(1, 10), axis=1))


# Errors


@pytest.mark.parametrize(
    ("targets", "data", "message"),
    [
        (["f1", "f9"], X, r"targets \['f9'\] are not columns of X, or more than one; expected some of \['T1',"),
        (["f1", "f1"], X, r"targets \['f1', 'f1'\] repeat a column; expected each once"),
        (
            ["f1"],
            X.rename(columns={"f2": "f1"}),
            r"expected each name once",
        ),
        ([3, 9], X, r"targets \[9\] are not columns of X; expected indexes from 0 to 8"),
        ([-1], X, r"targets \[-1\] are not columns of X; expected indexes from 0 to 8"),
        (["f1", 4], X, "expected names of columns, or integers that are their indexes"),
        ([True, False], X, "expected names of columns, or integers that are their indexes"),
        ([], X, "targets are 0 of the 9 columns of X; expected at least one, and at least one other column"),
        (list(X.columns), X, "targets are 9 of the 9 columns"),
        ("f1", X, "targets is 'f1'"),
        (["f1"], X.to_numpy(), r"targets are the names \['f1'\], but X has no column names; expected a frame or ind"),
        (["f1"], X.set_axis(range(9), axis=1), "X has no column names"),
        (["f1"], with_gaps(["f1"], slice(None)), "'f1' is NaN in all 200 rows"),
        ([3], X.to_numpy()[:, :1], "1 feature.* minimum of 2"),
    ],
)
@pytest.mark.parametrize("method", ["fit", "fit_transform"])
def test_bad_targets_are_named(method, targets, data, message):
    with pytest.raises(ValueError, match=message):
        getattr(compensator(targets=targets), method)(data)


def test_predictions_of_another_shape_are_refused():
    class OneColumn(LinearRegression):
        def predict(self, X):
            return super().predict(X)[:, 0]

    with pytest.raises(
        ValueError, match=r"OneColumn predicted the shape \([0-9]+, 1\); expected \([0-9]+, 6\), a column for"
    ):
        compensator(OneColumn()).fit(X).transform(X)


@pytest.mark.parametrize("estimator", [Ridge(alpha=-1), make_pipeline(StandardScaler(), Ridge(alpha=-1))], ids=str)
@pytest.mark.parametrize("method", ["fit", "fit_transform"])
def test_parameters_of_the_estimator_are_checked(method, estimator):
    with pytest.raises(ValueError, match="'alpha' parameter of Ridge must be"):
        getattr(compensator(estimator), method)(X)
