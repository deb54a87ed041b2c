"""scikit-learn's own estimator checks, every expected failure named with its reason."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.covariance import EllipticEnvelope
from sklearn.ensemble import IsolationForest
from sklearn.impute import KNNImputer
from sklearn.linear_model import Ridge
from sklearn.neighbors import LocalOutlierFactor
from sklearn.svm import OneClassSVM
from sklearn.utils.estimator_checks import parametrize_with_checks

from skthermo.detection import MahalanobisDetector, OutlierDetector, TemperatureCompensator
from skthermo.preprocessing import BiasAligner, HingeFeatures, KNNGapImputer, LagFeatures
from skthermo.surrogate import InverseSurrogate, TemperatureMapper

ROWS_ARE_ORDERED = {
    "check_methods_sample_order_invariance": "a lagged value is an earlier row: order is the information",
    "check_methods_subset_invariance": "a row alone has no earlier rows to take lagged values from",
}
OUT_OF_FOLD = dict.fromkeys(
    ("check_transformer_general", "check_transformer_data_not_an_array"),
    "fit_transform gives out-of-fold residuals, which fit(X).transform(X) may not equal",
)

KNOTS = {
    "check_sample_weight_equivalence_on_dense_data": "the default regressor places its knots at quantiles of the rows, "
    "whatever their weights"
}


def expected_failures(estimator):
    if isinstance(estimator, TemperatureCompensator):
        return OUT_OF_FOLD
    if isinstance(estimator, TemperatureMapper):
        return KNOTS
    return ROWS_ARE_ORDERED if isinstance(estimator, LagFeatures) else {}


@parametrize_with_checks(
    [
        LagFeatures(),
        HingeFeatures(),
        KNNGapImputer(),
        BiasAligner(),
        BiasAligner(method="scale"),
        InverseSurrogate(),
        TemperatureMapper(),
        MahalanobisDetector(),
        OutlierDetector(IsolationForest(n_estimators=20, random_state=0)),
        OutlierDetector(OneClassSVM()),
        OutlierDetector(LocalOutlierFactor(5, novelty=True)),
        OutlierDetector(EllipticEnvelope(random_state=0)),
        TemperatureCompensator(Ridge(), targets=[1]),
    ],
    expected_failed_checks=expected_failures,
)
def test_estimator_follows_scikit_learn(estimator, check):
    check(estimator)


RECORDS = pd.DataFrame(
    np.random.default_rng(0).normal([10, 4, 9], 0.1, (60, 3)),
    index=pd.date_range("2025", periods=60, freq="h"),
    columns=["T1", "f1", "f2"],
)
TRANSFORMERS_AND_DETECTORS = [
    LagFeatures(),
    HingeFeatures(),
    KNNGapImputer(),
    BiasAligner(),
    MahalanobisDetector(),
    OutlierDetector(OneClassSVM()),
    TemperatureCompensator(Ridge(), targets=["f1", "f2"]),
]


@pytest.mark.parametrize("estimator", TRANSFORMERS_AND_DETECTORS, ids=lambda estimator: type(estimator).__name__)
def test_fitted_state_has_a_trailing_underscore(estimator):
    fitted = pickle.loads(pickle.dumps(estimator)).fit(RECORDS)
    state = set(vars(fitted)) - set(vars(estimator))
    if isinstance(estimator, KNNImputer):
        state -= set(vars(KNNImputer().fit(RECORDS)))  # scikit-learn's own
    assert state
    assert not [name for name in state if name.startswith("_") or not name.endswith("_")]


@pytest.mark.parametrize("estimator", TRANSFORMERS_AND_DETECTORS, ids=lambda estimator: type(estimator).__name__)
def test_fitted_estimators_are_pickled(estimator):
    fitted = pickle.loads(pickle.dumps(estimator)).fit(RECORDS)
    output = "transform" if hasattr(estimator, "transform") else "damage_index"
    later = RECORDS.shift(freq="30h")
    later.iloc[3, 0] = np.nan
    once, again = (getattr(copy, output)(later) for copy in (fitted, pickle.loads(pickle.dumps(fitted))))
    np.testing.assert_array_equal(again, once)
