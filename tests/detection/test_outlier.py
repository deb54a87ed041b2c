"""scikit-learn's outlier detectors as damage detectors."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from sklearn.base import BaseEstimator, OutlierMixin
from sklearn.covariance import EllipticEnvelope, MinCovDet
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import Ridge
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import OneClassSVM

from skthermo.detection import MahalanobisDetector, OutlierDetector

RNG = np.random.default_rng(0)
STAMPS = pd.date_range("2025", periods=400, freq="h")
F = pd.DataFrame(RNG.normal([4, 9, 12], [0.04, 0.1, 0.2], (400, 3)), STAMPS, ["f1", "f2", "f3"])
DAMAGED = F - [0.4, 1.0, 2.0]  # ten standard deviations
DETECTORS = [
    IsolationForest(n_estimators=20, random_state=0),
    OneClassSVM(nu=0.1),
    EllipticEnvelope(random_state=0),
    make_pipeline(StandardScaler(), LocalOutlierFactor(novelty=True)),
]


class FromZero(OutlierMixin, BaseEstimator):
    """Scores by the distance of the first column from zero."""

    def fit(self, X, y=None):
        return self

    def score_samples(self, X):
        return -np.abs(X[:, 0])


ROWS = np.random.default_rng(0).permutation(np.arange(101.0))[:, np.newaxis]  # too scattered for frequencies


@pytest.mark.parametrize(("threshold", "expected"), [("quantile", 95), ("conformal", 96)])
def test_index_is_minus_the_score_and_the_threshold_its_quantile_or_order_statistic(threshold, expected):
    detector = OutlierDetector(FromZero(), 0.05, threshold=threshold).fit(ROWS)
    np.testing.assert_array_equal(detector.damage_index(ROWS), ROWS[:, 0])
    np.testing.assert_array_equal(detector.baseline_index_, ROWS[:, 0])  # a score that is not learned
    assert detector.threshold_ == expected


class AsInPyOD(BaseEstimator):
    """Scores by the distance of the first column from zero: higher is more abnormal."""

    def fit(self, X, y=None):
        self.decision_scores_ = self.decision_function(X)
        return self

    def decision_function(self, X):
        return np.abs(X[:, 0])


def test_detectors_that_score_as_those_of_pyod_serve():
    ours, theirs = (OutlierDetector(estimator, 0.05).fit(ROWS) for estimator in (FromZero(), AsInPyOD()))
    assert theirs.threshold_ == ours.threshold_ == 96
    np.testing.assert_array_equal(theirs.predict([[96.0], [-97.0]]), [1, -1])


@pytest.mark.parametrize("estimator", DETECTORS, ids=lambda e: type(e[-1] if hasattr(e, "steps") else e).__name__)
def test_any_outlier_detector_serves(estimator):
    detector = OutlierDetector(estimator, threshold="quantile").fit(F)
    assert detector.estimator_ is not estimator
    relative = F.to_numpy() / detector.report_["level"].to_numpy()
    np.testing.assert_array_equal(detector.damage_index(F), -detector.estimator_.score_samples(relative))
    assert (detector.predict(F) == -1).mean() == 0.02
    assert (detector.predict(DAMAGED) == -1).all()
    assert not [name for name in vars(estimator) if name.endswith("_")]


def test_the_index_of_an_elliptic_envelope_is_the_squared_mahalanobis_distance():
    envelope = OutlierDetector(EllipticEnvelope(random_state=0), 0.02, threshold="quantile").fit(F)
    robust = MahalanobisDetector(0.02, covariance=MinCovDet(random_state=0), threshold="quantile").fit(F)
    np.testing.assert_allclose(envelope.damage_index(DAMAGED), robust.damage_index(DAMAGED) ** 2, rtol=1e-12)
    np.testing.assert_array_equal(envelope.predict(F), robust.predict(F))


@pytest.mark.nightly
def test_rows_with_missing_modes_are_not_evaluated():
    holed = DAMAGED.copy()
    holed.iloc[[3, 7], 1] = np.nan
    detector = OutlierDetector(IsolationForest(random_state=0)).fit(F)
    index = detector.damage_index(holed)
    assert index.index.equals(STAMPS)
    np.testing.assert_array_equal(np.flatnonzero(index.isna()), [3, 7])
    message = r"2 of 400 rows .*row 3 \(2025-01-01 03:00:00\): .*f2 in 2 of them.*not-evaluated"
    with pytest.warns(UserWarning, match=message):
        alarms = detector.predict(holed)
    np.testing.assert_array_equal(np.flatnonzero(alarms == 0), [3, 7])
    assert (np.delete(alarms, [3, 7]) == -1).all()
    without = OutlierDetector(IsolationForest(random_state=0)).fit(holed.drop(index=STAMPS[[3, 7]]))
    assert OutlierDetector(IsolationForest(random_state=0)).fit(holed).threshold_ == without.threshold_


class Recorder(FromZero):
    """Remembers the rows that its clones were fitted on, by the number in the second column."""

    seen = []

    def fit(self, X, y=None):
        self.seen.append(X[:, 1].astype(int))
        return self


@pytest.mark.filterwarnings("ignore:.*few-records")
@pytest.mark.parametrize("block", [None, 24, "1D", pd.Timedelta("1D")])
def test_each_record_is_evaluated_by_a_clone_that_was_fitted_on_the_other_blocks(block):
    rows = pd.DataFrame({"score": np.arange(400.0), "number": np.arange(400)}, STAMPS)
    rows.loc[STAMPS[[5, 100]], "score"] = np.nan
    if block is None:  # blocks are longer than records remember
        rows["score"] = lfilter([1.0], [1.0, -0.9], np.random.default_rng(0).normal(size=400))
    Recorder.seen.clear()
    detector = OutlierDetector(Recorder(), block=block).fit(rows)
    everything, *others = Recorder.seen
    left_out = np.concatenate([np.setdiff1d(everything, rest) for rest in others])
    assert len(others) == 5
    np.testing.assert_array_equal(np.unique(left_out), everything)
    if block is None:
        assert detector.n_independent_ < 80
    else:
        assert len(left_out) == len(everything) == 398
    if block not in (None, 24):  # of 24 complete rows, which do not begin at midnight
        assert [set(rest // 24 % 5) for rest in others] == [set(range(5)) - {fold} for fold in range(5)]


@pytest.mark.parametrize(
    ("rows", "block", "message"),
    [
        (F.to_numpy(), "1D", "block is '1D', but X has no DatetimeIndex; expected a number of rows"),
        (F, "a day", "block is 'a day'; expected a duration of fixed length"),
        (F, 0, "'block' parameter of OutlierDetector must be"),
    ],
)
def test_blocks_are_rows_or_durations(rows, block, message):
    with pytest.raises(ValueError, match=message):
        OutlierDetector(OneClassSVM(), block=block).fit(rows)


@pytest.mark.parametrize(
    ("estimator", "message"),
    [
        (LocalOutlierFactor(), r"estimator is LocalOutlierFactor\(\), which has no score_samples.*\(novelty=True\)"),
        (Ridge(), r"estimator is Ridge\(\), which has no score_samples"),
        (make_pipeline(StandardScaler(), Ridge()), "has no score_samples"),
        (None, "'estimator' parameter of OutlierDetector must be an object implementing 'fit'. Got None"),
        (IsolationForest(n_estimators=0), "'n_estimators' parameter of IsolationForest must be"),
    ],
    ids=["lof", "regressor", "pipeline", "none", "nested parameter"],
)
def test_estimators_that_cannot_serve_are_named(estimator, message):
    with pytest.raises(ValueError, match=message):
        OutlierDetector(estimator).fit(F)
