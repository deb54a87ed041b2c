"""Laws of a compensator whose estimator knows how uncertain its predictions are."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.pipeline import make_pipeline

from skthermo._core.origins import origin_of
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.preprocessing import LagFeatures
from skthermo.residuals.gaussian import Gaussian
from tests.bayesian import EVERYWHERE, MEAN, NOISE, WIDTH, BayesianLogs, Logs, records_of

MODES = ["f1", "f2", "f3"]
WHITENINGS = [None, "global", "local"]
ROOT = np.array([[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, -0.3, 0.7]])
"""Of the covariance of the scatter."""

pytestmark = [
    pytest.mark.filterwarnings(f"ignore:.*{message}")
    for message in (
        "rows-from-fleet",
        "weather-of-one-fold",
        "no-thermal-effect",
        "outside-training-weather",
        "frequency-outliers",
        "few-baseline-records",
        "filled-temperatures",
    )
]


class Known(RegressorMixin, BaseEstimator):
    """Predicts zero, with errors of a known covariance that grows from 0 C on."""

    def fit(self, X, y):
        self.n_targets_ = y.shape[1]
        return self

    def predict(self, X):
        return np.zeros((len(X), self.n_targets_))

    def predict_covariance(self, X):
        first = np.ones(self.n_targets_) + np.arange(self.n_targets_)
        size = np.maximum(np.asarray(X, dtype=float)[:, 0], 0.0) / 10
        return (size**2)[:, None, None] * (np.outer(first, first) + np.eye(self.n_targets_))


def of_known_errors(n_rows, seed):
    """Records whose frequencies are scatter and the errors of `Known`, independent from row to row."""
    rng = np.random.default_rng(seed)
    T = pd.DataFrame({"T1": rng.uniform(-20, 20, n_rows)}, index=pd.date_range("2025", periods=n_rows, freq="6h"))
    roots = np.linalg.cholesky(Known().fit(T, np.empty((1, 3))).predict_covariance(T) + 1e-12 * np.eye(3))
    errors = np.einsum("ijk,ik->ij", roots, rng.standard_normal((n_rows, 3)))
    F = rng.standard_normal((n_rows, 3)) @ ROOT.T + errors
    return T.join(pd.DataFrame(F, T.index, MODES))


def bridge(seed, days):
    return records_of(seed, days, ROOT)


def knowing(share=1.0, **options):
    return TemperatureCompensator(BayesianLogs(MEAN, WIDTH, NOISE, EVERYWHERE, share), targets=MODES, **options)


def unknowing(**options):
    return TemperatureCompensator(Logs(MEAN, WIDTH, NOISE), targets=MODES, **options)


@pytest.mark.parametrize("n_rows", [300, 3000])
def test_a_distribution_is_learned_from_rows_that_hold_known_errors(n_rows):
    rng = np.random.default_rng(0)
    sizes = rng.uniform(0, 3, n_rows)
    rows = 5 + rng.standard_normal((n_rows, 3)) @ ROOT.T + sizes[:, None] * rng.standard_normal((n_rows, 3))
    rows[rng.uniform(size=rows.shape) < 0.1] = np.nan
    learned = Gaussian.fitted(rows, sizes[:, None, None] ** 2 * np.eye(3))
    assert np.abs(learned.mean - 5).max() < 4 / np.sqrt(n_rows / 2)
    assert np.abs(learned.covariance - ROOT @ ROOT.T).max() < 12 / np.sqrt(n_rows)
    without = Gaussian.fitted(rows).covariance
    assert np.trace(without) > 2 * np.trace(learned.covariance)


def test_without_errors_the_distribution_is_that_of_the_rows():
    rows = np.random.default_rng(0).standard_normal((200, 3)) @ ROOT.T
    plain, learned = Gaussian.fitted(rows), Gaussian.fitted(rows, np.zeros((200, 3, 3)))
    np.testing.assert_allclose(learned.covariance, plain.covariance, atol=1e-6)
    np.testing.assert_allclose(learned.mean, plain.mean, atol=1e-6)


@pytest.mark.one_case
@pytest.mark.parametrize("whiten", WHITENINGS)
def test_residuals_of_known_errors_have_one_covariance_whatever_the_error(whiten):
    compensator = TemperatureCompensator(Known(), targets=MODES, whiten=whiten)
    baseline = compensator.fit_transform(of_known_errors(4000, 0))
    later = of_known_errors(8000, 1)
    residuals, expected = compensator.transform(later), ROOT @ ROOT.T if whiten is None else np.eye(3)
    for part in (baseline, residuals[later["T1"] < 0], residuals[later["T1"] > 10]):
        assert np.abs(np.cov(part.T) - expected).max() < 0.15
    if whiten is not None:
        assert np.abs(np.cov(baseline.T) - np.eye(3)).max() < 0.1


@pytest.mark.parametrize("whiten", WHITENINGS)
def test_what_changes_make_of_residuals_is_their_derivative_whatever_the_error(whiten):
    compensator = TemperatureCompensator(Known(), targets=MODES, whiten=whiten)
    baseline = compensator.fit_transform(of_known_errors(3000, 0).add({"T1": 0.0} | dict.fromkeys(MODES, 10.0)))
    later = of_known_errors(2000, 1).add({"T1": 0.0} | dict.fromkeys(MODES, 10.0))
    later.loc[later.index[::3], "f2"] = np.nan
    residuals = compensator.transform(later)
    changes = origin_of(residuals).changes()
    for n, mode in enumerate(MODES):
        change = 1e-3 * compensator.levels_[n]
        moved = compensator.transform(later.assign(**{mode: later[mode] + change})) - residuals
        has_it = later[mode].notna().to_numpy()
        stated = changes.matrices[changes.which][has_it, :, n]
        np.testing.assert_allclose(np.nan_to_num(moved[has_it]), 1e-3 * stated, atol=1e-9)
    complete = origin_of(compensator.transform(later.dropna())).changes().typical()
    np.testing.assert_allclose(origin_of(baseline).changes().typical(), complete, atol=0.05 * np.abs(complete).max())


def test_errors_together_count_in_the_modes_that_are_there():
    records = of_known_errors(6000, 0)
    compensator = TemperatureCompensator(Known(), targets=MODES, whiten="global").fit(records[:3000])
    warm = records[3000:][records["T1"][3000:] > 10].assign(f2=np.nan)
    assert np.abs(np.cov(compensator.transform(warm)[["f1", "f3"]].T) - np.eye(2)).max() < 0.2


@pytest.mark.one_case
@pytest.mark.parametrize("whiten", WHITENINGS)
def test_an_estimator_that_is_certain_changes_nothing(whiten):
    records = bridge(0, 500)
    certain, silent = knowing(0.0, whiten=whiten), unknowing(whiten=whiten)
    np.testing.assert_allclose(
        certain.fit_transform(records[:200]), silent.fit_transform(records[:200]), rtol=1e-12, atol=1e-12
    )
    inside = (silent.extrapolation_distance(records) == 0).all(axis=1)
    assert 200 <= inside.sum() < 500
    np.testing.assert_allclose(
        certain.transform(records[inside]), silent.transform(records[inside]), rtol=1e-12, atol=1e-12
    )


@pytest.mark.one_case
@pytest.mark.parametrize("whiten", WHITENINGS)
def test_weeks_of_winter_raise_no_more_alarms_in_summer_than_are_asked_for(whiten):
    rates, unaware = [], []
    for seed in range(6):
        records = bridge(seed, 405)
        for compensator, found in ((knowing(whiten=whiten), rates), (unknowing(whiten=whiten), unaware)):
            detector = make_pipeline(compensator, MahalanobisDetector(0.05)).fit(records[:40])
            found.append((detector.predict(records[40:]) == -1).mean())
    assert np.mean(rates) < 0.07
    assert np.mean(unaware) > 2 * np.mean(rates)


def test_targets_with_gaps_have_clones_and_errors_of_their_own():
    records = bridge(0, 300)
    holed = records.mask(np.random.default_rng(1).uniform(size=records.shape) < [0, 0, 0.2, 0.2, 0.2])
    compensator = knowing(whiten="global").fit(holed[:60])
    assert len(compensator.estimator_.estimators_) == 3
    white = compensator.transform(holed[60:])
    assert white.isna().equals(holed[60:][MODES].isna())
    complete = knowing(whiten="global").fit(records[:60])
    assert np.abs(white.std() / complete.transform(records[60:]).std() - 1).max() < 0.4


def test_lags_and_filled_temperatures_add_up():
    records = bridge(0, 300)
    lagged = TemperatureCompensator(
        make_pipeline(LagFeatures([0, 1]), BayesianLogs(MEAN, WIDTH, NOISE, EVERYWHERE)), targets=MODES, whiten="global"
    ).fit(records[:60])
    gap = records[60:].copy()
    gap.loc[gap.index[100], "T1"] = np.nan
    with pytest.warns(UserWarning, match="filled-temperatures"):
        filled = lagged.transform(gap)
    whole = lagged.transform(records[60:])
    assert filled.notna().all(axis=None)
    unlike = (filled != whole).any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(unlike), [100, 101])


def test_a_row_does_not_depend_on_the_rows_beside_it():
    records = bridge(0, 300)
    compensator = knowing(whiten="local").fit(records[:60])
    whole = compensator.transform(records[60:])
    alone = pd.concat([compensator.transform(records[row : row + 1]) for row in range(60, 300, 30)])
    np.testing.assert_allclose(alone, whole[::30], rtol=1e-9)


@pytest.mark.filterwarnings("ignore:.*implausible-temperatures")
def test_weather_of_the_fleet_is_counted_and_only_weather_beyond_it_is_far_outside():
    records = bridge(0, 300)
    compensator = knowing().fit(records[:40])
    new = records[200:].copy()
    with pytest.warns(UserWarning, match="100 of 100 .*rows-from-fleet"):
        compensator.transform(new)
    new[["T1", "T2"]] += 100
    with pytest.warns(UserWarning, match="100 of 100 .*outside-training-weather"):
        compensator.transform(new)
