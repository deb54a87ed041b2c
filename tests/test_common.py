"""scikit-learn's own estimator checks, every expected failure named with its reason."""

import importlib
import inspect
import pickle
import pkgutil
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
from sklearn.svm import OneClassSVM
from sklearn.utils.estimator_checks import check_estimator

import skthermo
from skthermo.datasets import make_truss, make_truss_campaign
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
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM, FleetMapper, InverseSurrogate, PosteriorInverse, TemperatureMapper
from skthermo.updating import ModelUpdater

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
    rooms = [importlib.import_module(m.name) for m in pkgutil.iter_modules(skthermo.__path__, "skthermo.") if m.ispkg]
    public = {getattr(room, name) for room in rooms for name in getattr(room, "__all__", ())}
    classes = {thing for thing in public if isinstance(thing, type) and not inspect.isabstract(thing)}
    return sorted((one for one in classes if issubclass(one, BaseEstimator)), key=lambda kind: kind.__name__)


def made(kind, arguments):
    """An estimator with its arguments, or with its defaults."""
    try:
        return arguments[kind] if kind in arguments else kind()
    except TypeError as error:
        raise TypeError(f"{__file__}: {error}; add one to ARGUMENTS and ARGUMENTS_ON_RECORDS") from error


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
ESTIMATORS = [made(kind, ARGUMENTS) for kind in public_estimators() if kind not in OF_MODELS]
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


RECORDS = pd.DataFrame(
    np.random.default_rng(0).normal([10, 4, 9], 0.1, (60, 3)),
    index=pd.date_range("2025", periods=60, freq="h"),
    columns=["T1", "f1", "f2"],
)
TRUSS, YEAR = make_truss(), make_truss_campaign(random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
LINEAR_INVERSE = InverseSurrogate(TRUSS, Ridge(), bounds=0.2, n_samples=100, noise=0.01, random_state=0)
CHAIN = DataInformedFEM(TRUSS, mapper=TemperatureMapper(Ridge()), reduce=True)
NOMINAL, SHAPES = (values[0] for values in TRUSS.modes(np.ones((1, 4))))


BOUND = [  # estimators and what they learn from
    (TemperatureMapper(), (T, F / F.mean())),
    (FleetMapper(), (T, F)),
    (LINEAR_INVERSE, (F[:20],)),
    (PosteriorInverse(TRUSS), (F[:20],)),
    (CHAIN, (T, F)),
    (
        DataInformedFEM(TRUSS, inverse=LINEAR_INVERSE, mapper=TemperatureMapper(Ridge())),
        (T, F.mask(F.quantile(0.99) < F)),
    ),
    (ModelUpdater(TRUSS), (TRUSS.frequencies([[1.05, 0.97, 1.02, 1]]),)),
    (ModeTracker((NOMINAL, SHAPES)), ()),
]
ARGUMENTS_ON_RECORDS = {  # of estimators that need some, to learn from records
    CompensatedDetector: CompensatedDetector(MahalanobisDetector(), Ridge(), targets=["f1", "f2"]),
    ExponentialMeans: ExponentialMeans(half_lives=["3h"]),
    OutlierDetector: OutlierDetector(OneClassSVM()),
    TemperatureCompensator: TemperatureCompensator(Ridge(), targets=["f1", "f2"]),
}
ON_OTHERS = {type(estimator) for estimator, _ in BOUND} | OF_MODELS
TRANSFORMERS_AND_DETECTORS = [
    *(made(kind, ARGUMENTS_ON_RECORDS) for kind in public_estimators() if kind not in ON_OTHERS),
    clone(ARGUMENTS_ON_RECORDS[CompensatedDetector]).set_params(window="6h"),
]
STUDY = DetectabilityStudy(None, MahalanobisDetector(), [], n_repeats=2, random_state=0, uncertainty="noise")
MONITOR = Monitor(MahalanobisDetector(), targets=["f1", "f2"])  # takes frames on a DatetimeIndex only
YEAR = pd.DataFrame(
    np.random.default_rng(0).normal([10, 4, 9], 0.1, (400, 3)),
    index=pd.date_range("2025", periods=400),
    columns=["T1", "f1", "f2"],
)


def fitted(estimator, *data):
    return pickle.loads(pickle.dumps(estimator)).fit(*data)


def check_names_of_state(estimator, fit):
    state = set(vars(fit)) - set(vars(estimator))
    if isinstance(estimator, KNNImputer):
        state -= set(vars(KNNImputer().fit(RECORDS)))  # scikit-learn's own
    assert state
    assert not [name for name in state if name.startswith("_") or not name.endswith("_")]


def run(study):
    """A study that has been run, which is how it learns."""
    chain = fitted(CHAIN, T, F)
    study = clone(study).set_params(fem=chain, scenarios=sweep(chain, (0.1, 0.2), groups=["bottom"]))
    study.run(T)
    return study


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("as_frames", [True, pytest.param(False, marks=pytest.mark.nightly)], ids=["frames", "arrays"])
@pytest.mark.parametrize(
    ("estimator", "data"),
    [*((estimator, (RECORDS,)) for estimator in TRANSFORMERS_AND_DETECTORS), *BOUND],
    ids=lambda given: type(given).__name__,
)
def test_what_fit_keeps_has_a_trailing_underscore_and_does_not_change_with_what_it_was_given(
    estimator, data, as_frames
):
    arrays = [np.array(table, dtype=float) for table in data]
    tables = list(arrays)
    if as_frames:
        tables = [
            pd.DataFrame(array, table.index, table.columns, copy=False) if isinstance(table, pd.DataFrame) else array
            for array, table in zip(arrays, data, strict=True)
        ]
    elif "targets" in estimator.get_params() or getattr(estimator, "window", 0) == "6h":
        pytest.skip("needs names or stamps")
    elif isinstance(estimator, ExponentialMeans):
        pytest.skip("its half-life needs stamps")
    fit = fitted(estimator, *tables)
    check_names_of_state(estimator, fit)
    kept = pickle.dumps(fit)
    for array in arrays:
        array[:] = 777.0
    assert pickle.dumps(fit) == kept


@pytest.mark.filterwarnings("ignore:.*(outside-bounds|other-weather)")
def test_what_studies_monitors_and_priors_keep_has_a_trailing_underscore():
    for estimator, fit in [(STUDY, run(STUDY)), (MONITOR, fitted(MONITOR, YEAR))]:
        check_names_of_state(estimator, fit)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*(outside-bounds|other-weather)")
def test_metadata_routing_changes_no_result():
    def results(estimator, data):
        fit = fitted(estimator, *data)
        output = next(name for name in ("transform", "damage_index", "predict") if hasattr(fit, name))
        return getattr(fit, output)(data[0])

    cases = [(estimator, (RECORDS,)) for estimator in TRANSFORMERS_AND_DETECTORS]
    cases += [(estimator, data) for estimator, data in BOUND if data and hasattr(estimator, "predict")]
    for estimator, data in cases:
        off = results(estimator, data)
        with config_context(enable_metadata_routing=True):
            np.testing.assert_array_equal(results(estimator, data), off, err_msg=shown(estimator))


NEED_NO_FIT = re.compile(  # beginnings of names
    r"_|fit|set_|get_params|get_metadata_routing|run$|findings$|steps_on$|behind_means$"
)


def test_every_method_says_that_the_estimator_is_not_fitted():
    estimators = [*TRANSFORMERS_AND_DETECTORS, *(estimator for estimator, _ in BOUND), STUDY, MONITOR]
    wrong = []
    for kind in {type(estimator): estimator for estimator in estimators}.values():
        for name in dir(type(kind)):
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
    assert not wrong, "\n" + "\n".join(wrong)


@pytest.mark.filterwarnings("ignore:.*not-evaluated")
@pytest.mark.parametrize("estimator", TRANSFORMERS_AND_DETECTORS, ids=lambda estimator: type(estimator).__name__)
def test_fitted_estimators_are_pickled(estimator):
    fitted = pickle.loads(pickle.dumps(estimator)).fit(RECORDS)
    output = "transform" if hasattr(estimator, "transform") else "damage_index"
    later = RECORDS.shift(freq="30h")
    later.iloc[3, 0] = np.nan
    once, again = (getattr(copy, output)(later) for copy in (fitted, pickle.loads(pickle.dumps(fitted))))
    np.testing.assert_array_equal(again, once)
