"""scikit-learn's own estimator checks, every expected failure named with its reason."""

from sklearn.utils.estimator_checks import parametrize_with_checks

from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import BiasAligner, KNNGapImputer, LagFeatures
from skthermo.surrogate import InverseSurrogate, TemperatureMapper

ROWS_ARE_ORDERED = {
    "check_methods_sample_order_invariance": "a lagged value is an earlier row: order is the information",
    "check_methods_subset_invariance": "a row alone has no earlier rows to take lagged values from",
}


def expected_failures(estimator):
    return ROWS_ARE_ORDERED if isinstance(estimator, LagFeatures) else {}


@parametrize_with_checks(
    [
        LagFeatures(),
        KNNGapImputer(),
        BiasAligner(),
        BiasAligner(method="scale"),
        InverseSurrogate(),
        TemperatureMapper(),
        MahalanobisDetector(),
    ],
    expected_failed_checks=expected_failures,
)
def test_estimator_follows_scikit_learn(estimator, check):
    check(estimator)
