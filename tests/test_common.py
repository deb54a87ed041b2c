"""scikit-learn's own estimator checks, every expected failure named with its reason."""

import inspect
import pickle
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.base import BaseEstimator, clone
from sklearn.ensemble import IsolationForest
from sklearn.exceptions import NotFittedError
from sklearn.impute import KNNImputer
from sklearn.linear_model import Ridge
from sklearn.neighbors import LocalOutlierFactor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import Pipeline
from sklearn.svm import OneClassSVM
from sklearn.utils.estimator_checks import check_estimator

from skthermo.detection import (
    CompensatedDetector,
    DamageDetector,
    DirectionalDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
)
from skthermo.monitoring import Monitor
from skthermo.preprocessing import BiasAligner, ExponentialMeans, HampelFilter, LagFeatures, ModeTracker
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, PosteriorInverse, TemperatureMapper
from skthermo.updating import ModelUpdater
from tests.estimators import CASES, T, assert_same, fitted
from tests.source import public

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "scikit_learn.rst"

pytestmark = [  # scikit-learn checks detectors on 20 to 50 rows
    pytest.mark.filterwarnings(f"ignore:.*{cause}")
    for cause in (
        "few-records",
        "wrong-unit",
        "implausible-values",  # of normal values about 100, those above, as temperatures
        "different-rows",
        "windows.*not-evaluated",
    )
]

ROWS_ARE_ORDERED = {
    "check_methods_sample_order_invariance": "lags and windows reach earlier rows: order is the information",
    "check_methods_subset_invariance": "a row alone has no earlier rows for lags and windows",
}
RATE_OF_NEW_RECORDS = dict.fromkeys(
    ("check_outliers_train", "check_outliers_fit_predict"),
    "the threshold keeps the rate of false alarms of new records, not the share of the baseline above it",
)
FIRST_ROWS = dict.fromkeys(
    ("check_outliers_train", "check_outliers_fit_predict"),
    "the first rows have no full window before them: predict gives 0",
)
OUT_OF_FOLD = dict.fromkeys(
    ("check_transformer_general", "check_transformer_data_not_an_array"),
    "fit_transform gives out-of-fold residuals, which fit(X).transform(X) may not equal",
)
KNOTS_AND_FOLDS = {
    "check_sample_weight_equivalence_on_dense_data": "the default regressor places its knots at quantiles of the rows, "
    "whatever their weights, and RidgeCV leaves out one row at a time: of a row that is repeated the copies stay"
}
EXPECTED_FAILURES = {  # of each estimator and those that derive from it; docs/reference/scikit_learn.rst lists them
    ExponentialMeans: ROWS_ARE_ORDERED,
    LagFeatures: ROWS_ARE_ORDERED,
    TemperatureMapper: KNOTS_AND_FOLDS,
    TemperatureCompensator: OUT_OF_FOLD,
    DamageDetector: RATE_OF_NEW_RECORDS,
    CompensatedDetector: ROWS_ARE_ORDERED | FIRST_ROWS,
}


class InHundredths(DirectionalDetector):
    """Takes the numbers of scikit-learn's checks, about 1, for hundredths: relative residuals are not that large."""

    def _learn(self, F, times):
        return super()._learn(F / 100, times)

    def _index(self, F):
        return super()._index(F / 100)


def expected_failures(estimator):
    is_quantile = getattr(estimator, "threshold", None) == "quantile"
    has_no_window = isinstance(estimator, CompensatedDetector) and estimator.window is None
    kinds = [kind for kind in EXPECTED_FAILURES if isinstance(estimator, kind)]
    return {} if is_quantile or has_no_window or not kinds else EXPECTED_FAILURES[kinds[0]]


def public_estimators():
    """All classes of estimators that users can name, sorted by name."""
    classes = {thing for *_, thing in public() if isinstance(thing, type) and not inspect.isabstract(thing)}
    return sorted((one for one in classes if issubclass(one, BaseEstimator)), key=lambda kind: kind.__name__)


def test_every_public_estimator_has_a_case():
    assert set(public_estimators()) <= {type(case.estimator) for case in CASES.values()}, "tests/estimators.py"


def made(kind):
    """An estimator with its arguments, or with its defaults."""
    try:
        return ARGUMENTS[kind] if kind in ARGUMENTS else kind()
    except TypeError as error:
        raise TypeError(f"{__file__}: {error}; add one to ARGUMENTS") from error


OF_MODELS = {DataInformedFEM, DetectabilityStudy, ModelUpdater, ModeTracker, Monitor, PosteriorInverse}
"""Those that take an FE model, shapes of modes or frames on times, for which scikit-learn's checks have none."""
ARGUMENTS = {  # of estimators that need some, or are slow without
    CompensatedDetector: CompensatedDetector(MahalanobisDetector(), Ridge(), targets=[1]),
    DirectionalDetector: InHundredths(),
    ExponentialMeans: ExponentialMeans(half_lives=[3]),
    InverseSurrogate: InverseSurrogate(regressor=Ridge()),
    OutlierDetector: OutlierDetector(OneClassSVM()),
    TemperatureCompensator: TemperatureCompensator(Ridge(), targets=[1]),
}
ESTIMATORS = [made(kind) for kind in public_estimators() if kind not in OF_MODELS]
OTHER_SETTINGS = [
    InverseSurrogate(
        regressor=MLPRegressor(hidden_layer_sizes=(8,), learning_rate_init=0.01, max_iter=1000, tol=0.001)
    ),
    HampelFilter(targets=[0]),
    BiasAligner(method="scale"),
    MahalanobisDetector(threshold="quantile"),
    MahalanobisDetector(threshold="chi2"),
    InHundredths(omnibus=0.0),
    OutlierDetector(IsolationForest(n_estimators=5, random_state=0)),
    OutlierDetector(LocalOutlierFactor(5, novelty=True)),
    CompensatedDetector(MahalanobisDetector(), Ridge(), targets=[1], window=3),
]


def shown(estimator):
    """An estimator's name and settings on one line."""
    return " ".join(repr(estimator).split())


@pytest.mark.filterwarnings("ignore:.*no-earlier-records")  # before rows that are not those of fit
@pytest.mark.parametrize(
    "estimator", [*ESTIMATORS, *(pytest.param(one, marks=pytest.mark.nightly) for one in OTHER_SETTINGS)], ids=shown
)
def test_estimator_follows_scikit_learn(estimator):
    results = check_estimator(
        estimator, expected_failed_checks=expected_failures(estimator), on_fail=None, on_skip=None
    )
    failed = [f"{result['check_name']}: {result['exception']!r}" for result in results if result["status"] == "failed"]
    assert not failed, "\n" + "\n".join(failed)
    needless = expected_failures(estimator).keys() - {r["check_name"] for r in results if r["status"] == "xfail"}
    assert not needless, f"expected to fail, but passed: {needless}; see expected_failures in {__file__}"
    assert sum(result["status"] == "passed" for result in results) > 30


def test_the_reference_lists_every_failing_check_with_its_reason():
    rows = re.findall(
        r"^   \* - (\w+)\n     - (check_\w+)\n     - (.+?)(?=\n   \*|\n\n)", PAGE.read_text(), re.M | re.S
    )
    listed = {}
    for estimator, check, reason in rows:
        listed.setdefault(estimator, {})[check] = " ".join(reason.split())
    assert listed == {kind.__name__: failures for kind, failures in EXPECTED_FAILURES.items()}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("as_frames", [True, pytest.param(False, marks=pytest.mark.nightly)], ids=["frames", "arrays"])
@pytest.mark.parametrize("name", CASES)
def test_what_fit_keeps_has_a_trailing_underscore_and_does_not_change_with_what_it_was_given(name, as_frames):
    case = CASES[name]
    if not as_frames and case.needs_frames:
        pytest.skip("needs names or stamps")
    arrays = [np.array(table, dtype=float) for table in case.tables]
    frames = [
        pd.DataFrame(array, table.index, table.columns, copy=False)
        for array, table in zip(arrays, case.tables, strict=True)
    ]
    fit = fitted(clone(case.estimator), *(frames if as_frames else arrays))
    state = set(vars(fit)) - set(vars(case.estimator))
    if isinstance(fit, KNNImputer):
        state -= set(vars(KNNImputer().fit(arrays[0])))  # scikit-learn's own
    assert state or isinstance(fit, Pipeline)
    assert not [name for name in state if name.startswith("_") or not name.endswith("_")]
    if name not in ("updater", "study"):  # files of monitors, which hold neither, have no frames: skops saves none
        assert not [one for one in fit.__getstate__().values() if isinstance(one, pd.DataFrame | pd.Series)]
    kept = pickle.dumps(fit)
    for array in arrays:
        array[:] = 777.0
    assert pickle.dumps(fit) == kept


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", CASES)
def test_metadata_routing_changes_no_result(name):
    off = CASES[name].results()
    with config_context(enable_metadata_routing=True):
        assert_same(CASES[name].results(), off)


NEED_NO_FIT = re.compile(  # beginnings of names
    r"_|fit|set_|get_params|get_metadata_routing|run$|findings$|steps_on$|behind_means$"
)


def test_every_method_says_that_the_estimator_is_not_fitted():
    wrong = []
    for kind in {type(case.estimator): case.estimator for case in CASES.values()}.values():
        for name in dir(type(kind)) if not isinstance(kind, Pipeline) else ():
            if NEED_NO_FIT.match(name) or not hasattr(clone(kind), name):  # a score that such an estimator has not
                continue
            try:
                member = getattr(clone(kind), name)
                given = inspect.signature(member).parameters.values() if callable(member) else ()
                needed = [one for one in given if one.default is one.empty]
                by_name = {one.name: True for one in needed if one.kind is one.KEYWORD_ONLY}
                member(*[T for one in needed if one.kind is one.POSITIONAL_OR_KEYWORD], **by_name)
                wrong.append(f"{type(kind).__name__}.{name} needs no fit")
            except NotFittedError:
                pass
            except Exception as error:
                wrong.append(f"{type(kind).__name__}.{name} raises {error!r}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.nightly] * case.is_slow) for name, case in CASES.items()]
)
def test_fitted_estimators_are_pickled(name):
    case, X = CASES[name], CASES[name].tables[0]
    fit = fitted(clone(case.estimator), *case.tables)
    assert_same(case.answered(pickle.loads(pickle.dumps(fit)), X), case.answered(fit, X))
