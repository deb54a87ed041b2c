"""Residuals of frequencies, out of fold and in sample."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.ensemble import RandomForestRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import BlockedKFold
from skthermo.surrogate import TemperatureMapper
from tests.detection.compensated import (
    MODES,
    POSITIONS,
    F,
    T,
    X,
    compensator,
    with_gaps,
)

# The chain's linear inverse scatters with the noise, and folds of few records predict weather not seen.
pytestmark = [
    pytest.mark.filterwarnings("ignore:.*(outside-bounds|other-weather|few-records)"),
]


def alarm_rate(detector, records):
    return (detector.predict(records) == -1).mean()


# What residuals are


def test_transform_is_the_logarithm_of_measured_over_predicted_by_the_fitted_clone():
    estimator = KNeighborsRegressor(3)
    fitted = compensator(estimator).fit(X)
    assert fitted.estimator_ is not estimator
    assert not hasattr(estimator, "n_features_in_")
    expected = KNeighborsRegressor(3).fit(T, F).predict(T)
    pd.testing.assert_frame_equal(fitted.transform(X), np.log(F / expected))
    assert fitted.relative_.all()


def test_responses_that_may_be_zero_have_residuals_in_their_own_unit():
    strain = X.assign(f1=100 * (X["f1"] - X["f1"].mean()))
    fitted = compensator(KNeighborsRegressor(3)).fit(strain)
    assert fitted.relative_.tolist() == [False] + [True] * 5
    expected = KNeighborsRegressor(3).fit(T, strain[MODES]).predict(T)
    np.testing.assert_allclose(fitted.transform(strain)["f1"], strain["f1"] - expected[:, 0], atol=1e-12)


def test_an_input_that_is_constant_in_the_baseline_is_named_and_residuals_count_less_where_it_differs():
    with pytest.warns(UserWarning, match="'frost'.*useless-column"):
        fitted = compensator(LinearRegression()).fit(X.assign(frost=0.0))
    usual, other = (fitted.transform(X.assign(frost=value)) for value in (0.0, 1.0))
    np.testing.assert_allclose(usual, compensator(LinearRegression()).fit(X).transform(X), atol=1e-12)
    ratio = (other / usual).to_numpy()
    assert ratio.max() < 0.7
    assert np.ptp(ratio) < 1e-9


def test_damping_ratios_are_compensated_beside_frequencies():
    """They fall by 14 % with every ten degrees and scatter by 15 %."""
    random, names = np.random.default_rng(0), [f"xi{mode}" for mode in range(1, 4)]
    ratios = np.exp(-0.15 * T[["T2"]].to_numpy() / 10 + 0.15 * random.standard_normal((len(X), 3))) * 0.008
    damping = pd.DataFrame(ratios, X.index, names)
    damping.iloc[::5, 0], damping.iloc[3, 2] = np.nan, -0.001  # modes are lost, and ratios just below zero happen
    residuals = compensator(TemperatureMapper(LinearRegression()), targets=MODES + names).fit_transform(X.join(damping))
    assert list(residuals) == MODES + names
    assert (damping.corrwith(T["T2"]) < -0.4).all()
    assert (residuals[names].corrwith(T["T2"]).abs() < 0.1).all()
    pd.testing.assert_frame_equal(residuals.isna(), F.join(damping).isna())
    assert np.isfinite(MahalanobisDetector().fit(residuals).damage_index(residuals)).all()


def test_a_larger_fall_is_never_a_smaller_residual():
    fitted = compensator(Ridge()).fit(X)
    falls = [fitted.transform(X.assign(f1=X["f1"] * share))["f1"].mean() for share in (1, 0.9, 0.5, 0.01, 0.0, -1.0)]
    assert (np.diff(falls) <= 0).all()
    assert np.isfinite(falls).all()


def test_outliers_do_not_train_the_regression_and_keep_their_residuals():
    spoiled = X.copy()
    spoiled.iloc[::40, POSITIONS[0]] *= 1.1
    clean, robust = (compensator(Ridge()).fit_transform(records) for records in (X, spoiled))
    usual = np.arange(len(X)) % 40 > 0
    np.testing.assert_allclose(robust[usual], clean[usual], atol=0.01)
    np.testing.assert_allclose(robust["f1"][~usual] - clean["f1"][~usual], np.log(1.1), atol=0.01)


class Unsure(Ridge):
    """A regression that says it knows less when it is warm."""

    def predict(self, X, return_std=False):
        mean = super().predict(X)
        if not return_std:
            return mean
        warm = np.asarray(X)[:, :1] > 20
        return mean, np.where(warm, 0.05, 0.001) * mean


def test_residuals_count_less_where_the_regression_is_less_certain_than_usual():
    plain, unsure = (compensator(estimator).fit(X) for estimator in (Ridge(), Unsure()))
    warm = (X["T1"] > 20).to_numpy()
    assert 0 < warm.mean() < 0.5
    one, other = plain.transform(X), unsure.transform(X)
    np.testing.assert_allclose(other[~warm], one[~warm], rtol=1e-9)
    excess = 0.05**2 - 0.001**2
    np.testing.assert_allclose(other[warm], one[warm] / np.sqrt(1 + excess / unsure.scale_**2), rtol=1e-6)


def test_a_folds_targets_enter_only_their_own_residuals():
    periods = compensator(cv="contiguous")
    before, changed, fold = periods.fit_transform(X), X.copy(), slice(80, 120)
    change = np.random.default_rng(0).normal(size=(40, len(MODES)))
    changed.iloc[fold, POSITIONS] *= np.exp(0.005 * change)
    after = periods.fit_transform(changed)
    np.testing.assert_allclose(after.iloc[fold], before.iloc[fold] + 0.005 * change, rtol=0, atol=1e-12)
    others = np.delete(np.arange(len(X)), np.arange(80, 120))
    assert (after.iloc[others] != before.iloc[others]).any(axis=None)


@pytest.mark.filterwarnings("ignore::skthermo.exceptions.RecordsWarning")  # modes that are not among the targets
def test_frames_arrays_names_and_positions_agree():
    folds = BlockedKFold(5, block=8)
    by_name, by_position = compensator(cv=folds), compensator(targets=POSITIONS, cv=folds)
    plain = compensator(targets=np.array(POSITIONS), cv=folds)
    frame = by_name.fit_transform(X)
    assert list(frame.columns) == list(by_name.get_feature_names_out()) == MODES
    assert frame.index.equals(X.index)
    assert list(by_name.targets_) == POSITIONS
    pd.testing.assert_frame_equal(by_position.fit_transform(X), frame)
    array = plain.fit_transform(X.to_numpy())
    assert type(array) is np.ndarray
    np.testing.assert_array_equal(array, frame)
    np.testing.assert_array_equal(plain.transform(X.to_numpy()), by_name.transform(X))
    two = compensator(targets=[4, 3]).set_output(transform="pandas").fit(X.to_numpy())
    assert list(two.transform(X.to_numpy()).columns) == ["x4", "x3"]
    assert list(two.get_feature_names_out(X.columns)) == ["f2", "f1"]


@pytest.mark.filterwarnings("ignore::skthermo.exceptions.RecordsWarning")  # modes that are not among the targets
def test_one_target_is_a_vector_for_estimators_that_want_one():
    forest = RandomForestRegressor(2, random_state=0)  # warns where a column stands for a vector
    single = compensator(forest, targets=["f2"]).fit(X)
    others = X.drop(columns="f2")
    expected = np.log(F["f2"] / clone(forest).fit(others, F["f2"]).predict(others))
    np.testing.assert_allclose(single.transform(X)["f2"], expected, atol=1e-12)
    wrapped = compensator(MultiOutputRegressor(clone(forest)), targets=["f2"])
    np.testing.assert_array_equal(wrapped.fit_transform(X), single.fit_transform(X))


# What they are for


@pytest.mark.filterwarnings("ignore:.*few-records")  # raw frequencies follow the season
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
    assert alarm_rate(detector, damaged) > alarm_rate(raw, damaged[MODES]) > 0.85


# Frames, models and scikit-learn's machinery


# Missing values


def test_what_cannot_be_predicted_flows_through():
    class Silent(RegressorMixin, BaseEstimator):
        def fit(self, X, y):
            self.mean_ = np.asarray(y).mean(axis=0)
            return self

        def predict(self, X):
            return np.where(np.asarray(X)[:, :1] > 30, np.nan, self.mean_)

    with pytest.warns(UserWarning, match="not-evaluated") as given:
        residuals = compensator(Silent()).fit(X).transform(X)
    assert len(given) == 2  # of fit and of transform
    np.testing.assert_array_equal(residuals.isna().all(axis=1), X["T1"] > 30)


# Lags and gaps


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
        (["f1"], X.rename(columns={"f2": "f1"}), r"expected each name once"),
        ([3, 9], X, r"targets \[9\] are not columns of X; expected indexes from 0 to 8"),
        (["f1", 4], X, "expected names of columns, or integers that are their indexes"),
        ([], X, "targets are 0 of the 9 columns of X; expected at least one, and at least one other column"),
        ("f1", X, "targets is 'f1'"),
        (["f1"], X.to_numpy(), r"targets are the names \['f1'\], but X has no column names; expected a frame or ind"),
        (["f1"], X.set_axis(range(9), axis=1), "X has no column names"),
        (["f1"], with_gaps(["f1"], slice(None)), "'f1'"),
        ([3], X.to_numpy()[:, :1], "1 feature.* minimum of 2"),
    ],
)
def test_bad_targets_are_named(targets, data, message):
    with pytest.raises(ValueError, match=message):
        compensator(targets=targets).fit(data)


def test_predictions_of_another_shape_are_refused():
    class OneColumn(LinearRegression):
        def predict(self, X):
            return super().predict(X)[:, 0]

    with pytest.raises(ValueError, match=r"OneColumn predicted the shape \([0-9]+, 1\); expected \([0-9]+, 6\)"):
        compensator(OneColumn()).fit(X).transform(X)


def test_parameters_of_the_estimator_are_checked():
    for estimator in (Ridge(alpha=-1), make_pipeline(StandardScaler(), Ridge(alpha=-1))):
        with pytest.raises(ValueError, match="'alpha' parameter of Ridge must be"):
            compensator(estimator).fit(X)
