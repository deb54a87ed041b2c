"""scikit-learn's own estimator checks, every expected failure named with its reason."""

from sklearn.linear_model import Ridge
from sklearn.utils.estimator_checks import parametrize_with_checks

from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.preprocessing import BiasAligner, KNNGapImputer, LagFeatures
from skthermo.surrogate import InverseSurrogate, TemperatureMapper

ROWS_ARE_ORDERED = {
    "check_methods_sample_order_invariance": "a lagged value is an earlier row: order is the information",
    "check_methods_subset_invariance": "a row alone has no earlier rows to take lagged values from",
}
OUT_OF_FOLD = dict.fromkeys(
    ("check_transformer_general", "check_transformer_data_not_an_array"),
    "fit_transform gives out-of-fold residuals, which fit(X).transform(X) may not equal",
)


def expected_failures(estimator):
    if isinstance(estimator, TemperatureCompensator):
        return OUT_OF_FOLD
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
        TemperatureCompensator(Ridge(), targets=[1]),
    ],
    expected_failed_checks=expected_failures,
)
def test_estimator_follows_scikit_learn(estimator, check):
    check(estimator)
