"""Bad inputs to every public name: each is a clear error or one warning, none is silent.

Bad values of every argument are generated (``bad_input_examples.py``); a part of them is tried here each time, all at
night. What depends on several arguments, or has to be said in certain words, stands below, case by case.
"""

import collections
import contextlib
import inspect
import re
import signal
import traceback
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import sklearn
from sklearn.covariance import EmpiricalCovariance
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import Ridge
from sklearn.model_selection import ShuffleSplit
from sklearn.neighbors import LocalOutlierFactor

import skthermo
from skthermo._estimators.arguments import check_bounds, check_dofs, check_noise, check_prior
from skthermo.datasets import (
    load_z24,
    make_truss,
    make_truss_campaign,
)
from skthermo.detection import MahalanobisDetector, OutlierDetector, TemperatureCompensator, WindowedAlarm
from skthermo.exceptions import SkthermoWarning
from skthermo.fem import (
    AffineModel,
    Bar,
    Beam,
    CallableModel,
    Structure,
    add_noise,
    evaluate,
    load_affine,
    match_modes,
    read_triplets,
    sample,
    shape_jacobian,
    share_reordered,
)
from skthermo.metrics import (
    error_table,
    mape,
    probability_of_detection,
    time_to_detection,
)
from skthermo.preprocessing import BiasAligner, HingeFeatures, KNNGapImputer, LagFeatures
from skthermo.studies import (
    ProgressiveDamage,
    Scenario,
    pod_curve,
    sweep,
)
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper
from skthermo.updating import ModelUpdater, cramer_rao, identifiability, select_parameters, sensitivity

SHARE, MOST_WRONG = 9, 0.01  # every ninth bad value is tried each time; so many may be silent or unclear
ERRORS = (ValueError, TypeError, FileNotFoundError)
CHECKED_BY = tuple(str(Path(package.__file__).parent) for package in (skthermo, sklearn))
SECONDS = 60

FROM_THE_DEPTHS = re.compile(
    "broadcast|setting an array element|object has no attribute|out of bounds|not supported between"
    "|is not (subscriptable|iterable|callable)|has no len|^could not convert|unsupported operand|ufunc|unhashable"
    "|cannot be interpreted|must be real number|not aligned|argument must be a string or a real number|bad operand"
    "|unexpected keyword|positional argument|not understood|could not be resolved|inhomogeneous"
)
"""Messages of NumPy, SciPy, pandas and Python about what a wrong input led to."""

SAYS_WHAT = re.compile(
    "[Ee]xpected|must be|[Gg]ot |required|should match|not supported|contains (infinity|NaN)"
    "|not finite|expecting|should provide|not fitted|is none of these|not readable as|; found"
)
"""What says what was got and what was expected, also in scikit-learn's words."""


class TooLong(BaseException):
    """A call that takes longer than any refusal should."""


def _stop(number, frame):
    raise TooLong


@contextlib.contextmanager
def time_limit(seconds):
    """Stop what takes longer, on systems that have alarms."""
    signal.signal(signal.SIGALRM, _stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)


def answer(example, values):
    """What a call gives: a result, an error or None, and the texts of its warnings."""
    result, error = None, None
    with warnings.catch_warnings(record=True) as given, time_limit(SECONDS):
        warnings.simplefilter("always")
        try:
            result = example.call(**values)
        except (Exception, TooLong) as caught:
            error = caught
    return result, error, {str(one.message) for one in given if issubclass(one.category, UserWarning)}


def is_clear(error, argument):
    """Whether an error says which argument is wrong, or what was got and what was expected."""
    text = str(error)
    if not isinstance(error, ERRORS) or FROM_THE_DEPTHS.search(text.partition("expected")[0]):
        return False
    if not traceback.extract_tb(error.__traceback__)[-1].filename.startswith(CHECKED_BY):
        return False
    return bool(re.search(rf"\b{re.escape(argument)}\b", text) or SAYS_WHAT.search(text))


def arrays(result):
    """Everything in a result that can be compared."""
    if isinstance(result, dict):
        return [array for value in result.values() for array in arrays(value)]
    if isinstance(result, list | tuple):
        return [array for value in result for array in arrays(value)]
    if isinstance(result, pd.DataFrame) and len(result.columns):
        result = result[sorted(result.columns, key=str)]
    with contextlib.suppress(TypeError, ValueError):
        return [np.asarray(result, dtype=float)]
    return [np.asarray(repr(result))]


def same(result, good):
    """Whether two results are equal up to the order of named columns."""
    first, second = arrays(result), arrays(good)
    if len(first) != len(second):
        return False
    return all(
        a.shape == b.shape
        and (np.allclose(a, b, rtol=1e-9, atol=1e-12, equal_nan=True) if a.dtype.kind == "f" else (a == b).all())
        for a, b in zip(first, second, strict=True)
    )


def verdict(example, argument, cause, value, good_result, good_warnings):
    """One of "legal", "refused", "warned", "silent", "unclear", and what was said."""
    with np.errstate(all="ignore"):
        result, error, told = answer(example, example.good | {argument: value})
    if isinstance(error, TooLong):
        return "unclear", f"still running after {SECONDS} s"
    if error is not None:
        where = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {error}"
        return ("refused", said) if is_clear(error, argument) else ("unclear", f"{said} ({where.filename[-40:]})")
    if "another order" in cause and same(result, good_result):
        return "legal", "read by name"
    new = {text for text in told if not any(re.sub(r"\d", "", text) == re.sub(r"\d", "", o) for o in good_warnings)}
    return ("warned", next(iter(new))) if new else ("silent", f"gave {result!r:.80}")


def bad_values():
    """Every example with an argument, the name of the fault and a bad value of it, but for values that are legal."""
    from tests.bad_input_examples import EXAMPLES, LEGAL

    for example in EXAMPLES:
        for argument, bad in example.bad.items():
            default = inspect.Parameter.empty
            with contextlib.suppress(KeyError, TypeError, ValueError):
                default = inspect.signature(example.of).parameters[argument].default
            for cause, value in bad.items():
                if (cause, "*") in LEGAL.get(argument, {}) or (cause, example.name) in LEGAL.get(argument, {}):
                    continue
                if value is default or (isinstance(value, type(default)) and np.ndim(value) == 0 and value == default):
                    continue
                yield example, argument, cause, value


def assert_refused_or_warned_of(every):
    """Try every so many bad values: hardly any is accepted as if it were good, or refused without a word on why."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        chosen = list(bad_values())[::every]
    good, kinds, wrong = {}, collections.Counter(), []
    for example, argument, cause, value in chosen:
        if id(example) not in good:
            result, error, told = answer(example, example.good)
            assert error is None, f"the good example of {example.name} fails: {error!r}"
            good[id(example)] = result, told
        kind, said = verdict(example, argument, cause, value, *good[id(example)])
        kinds[kind] += 1
        if kind in ("silent", "unclear"):
            wrong.append(f"{kind}: {example.name}({argument}: {cause}) {said:.220}")
    assert len(wrong) <= MOST_WRONG * len(chosen), "\n".join(wrong)
    assert kinds["refused"] > 0.9 * len(chosen)


def test_a_bad_value_of_an_argument_is_refused_or_warned_of():
    assert_refused_or_warned_of(SHARE)


@pytest.mark.nightly
def test_every_bad_value_of_every_argument_is_refused_or_warned_of():
    assert_refused_or_warned_of(1)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore")
def test_every_public_argument_has_bad_values():
    from tests.bad_input_examples import EXAMPLES, public_arguments

    tried = {(example.name, argument) for example in EXAMPLES for argument in example.bad}
    assert not sorted(set(public_arguments()) - tried)


LINEAR = Ridge()
GENERATOR = np.random.default_rng(0)
NAN, INF = float("nan"), float("inf")
TRUSS = make_truss()
NAMES = list(TRUSS.parameter_names)
ONES = np.ones((3, 4))
NOMINAL = TRUSS.frequencies(ONES[:1])
YEAR = make_truss_campaign(random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
ONE_MODE = CallableModel(lambda theta: [7.5 * theta[0] ** 0.5], ["k"], 1)
STEEL = {"E": 210e9, "A": 0.01, "density": 7850.0}
BEAM = {"E": 210e9, "G": 80e9, "A": 0.01, "I_yy": 1e-5, "I_zz": 1e-5, "J": 1e-5, "density": 7850.0}
NODES = {"left": (0, 0), "right": (6, 0), "apex": (3, 2)}
BARS = {
    "tie": Bar("left", "right", **STEEL),
    "rafter 1": Bar("left", "apex", **STEEL),
    "rafter 2": Bar("apex", "right", **STEEL),
}
SUPPORTS = {"left": "xy", "right": "y"}
FRAME = Structure(NODES, BARS, SUPPORTS, {"rafters": ["rafter 1", "rafter 2"]})
STIFF, EYE = [[2.0, -1.0], [-1.0, 1.0]], np.eye(2)
HOURLY = pd.DataFrame({"T1": np.arange(50.0)}, pd.date_range("2020-01-01", periods=50, freq="h"))
BOTH = T.join(F)
DATED = pd.Series(np.arange(365.0), F.index)
MODES = list(F)


def changed(frame, row, column, value):
    """A copy of a frame with other values at some place."""
    copy = frame.copy()
    copy.iloc[row, column] = value
    return copy


def masked(frame):
    """A frame as an array whose first value is masked."""
    values = np.ma.array(frame.to_numpy())
    values[0, 0] = np.ma.masked
    return values


def indexed(index):
    return HOURLY.set_axis(index, axis=0)


LAGS = LagFeatures(2).fit(HOURLY)
OFFSETS = [stamp.tz_localize("UTC" if i % 2 else "Asia/Tokyo") for i, stamp in enumerate(HOURLY.index)]
GAPPY = T.where(np.random.default_rng(0).random(T.shape) > 0.012)
DIAGONAL = F.mask(np.eye(6, dtype=bool)[np.arange(365) % 6])
HOLES = T.where(np.eye(3, dtype=bool)[np.arange(365) % 3])
SHAPES = TRUSS.modes(ONES[:1])[1][0, [0, 4, 8]]
with warnings.catch_warnings():  # a year of raw frequencies follows the seasons
    warnings.simplefilter("ignore")
    DETECTOR = MahalanobisDetector().fit(F)


def compensator(estimator=LINEAR, targets=MODES, **options):
    return TemperatureCompensator(estimator, targets=targets, **options)


COMPENSATOR = compensator().fit(BOTH)


def updater(model=TRUSS, **options):
    return ModelUpdater(model, **options)


def affine(stiffness, mass=EYE, n_modes=1, **options):
    return AffineModel({("k",): stiffness}, mass, n_modes=n_modes, **options)


def truss_of(members=BARS, supports=SUPPORTS, groups=None, nodes=NODES):
    return Structure(nodes, members, supports, groups)


INVERSE = InverseSurrogate(TRUSS, Ridge(), n_samples=50, random_state=0).fit()
SEEDED = {"bounds": 0.2, "n_samples": 50, "random_state": 0}
QUICK = {
    "inverse": InverseSurrogate(regressor=Ridge(), n_samples=100, bounds=0.2, noise=0.01),
    "mapper": TemperatureMapper(Ridge()),
}
CHAIN = DataInformedFEM(TRUSS, **QUICK, random_state=0).fit(T, F)


def chain(model=TRUSS, **parts):
    return DataInformedFEM(model, **(QUICK | {"random_state": 0} | parts))


# What is wrong, the call, and what the message says.
REFUSED = [
    ("a string among numbers", lambda: evaluate(TRUSS, [["a", 1, 1, 1]]), "theta is .*expected numbers"),
    ("NaN", lambda: check_bounds(NAN, NAMES), "half-width between 0 and 1"),
    ("three numbers", lambda: check_bounds(dict.fromkeys(NAMES, (0.7, 1, 1.3)), NAMES), "'bottom' are .*half-wid"),
    ("a string in a mapping", lambda: check_bounds(dict.fromkeys(NAMES, "x"), NAMES), "'bottom' are 'x'; expected"),
    ("None in a mapping", lambda: check_bounds(dict.fromkeys(NAMES), NAMES), "'bottom' are None; expected"),
    ("percent in a mapping", lambda: check_bounds(dict.fromkeys(NAMES, 30), NAMES), "'bottom' are 30; expected"),
    ("prior NaN", lambda: check_prior(NAN, NAMES), "prior is nan; expected"),
    ("prior infinite", lambda: check_prior(INF, NAMES), "prior is inf; expected"),
    ("prior a table", lambda: check_prior([[0.1] * 4], NAMES), "one for each of"),
    ("prior of pairs", lambda: check_prior(dict.fromkeys(NAMES, (0.1, 0.2)), NAMES), "one for each of"),
    ("dofs ragged", lambda: check_dofs([[1, 2], [1]], 23), "dofs.*expected integers"),
    ("noise NaN", lambda: add_noise(NOMINAL, NAN), "noise"),
    ("a generator", lambda: add_noise(NOMINAL, 0.01, random_state=GENERATOR), "random_state is"),
    ("a bare matrix", lambda: AffineModel(EYE, EYE, n_modes=1), "no term names a parameter; expected"),
    ("a mechanism", lambda: affine([[1.0, -1.0], [-1.0, 1.0]]), "mechanism"),
    ("other mass", lambda: affine(STIFF, np.eye(3)), "mass.*shape"),
    ("mass negative", lambda: affine(STIFF, -EYE), "negative eigenvalue"),
    ("two nodes at one place", lambda: truss_of(nodes=NODES | {"b": (3, 2)}), "duplicates"),
    ("a node without member", lambda: truss_of(nodes=NODES | {"b": (9, 9)}), "'b' is disconnected"),
    ("no members", lambda: Structure(NODES, {}, SUPPORTS), "expected|disconnected"),
    ("length zero", lambda: truss_of(BARS | {"b": Bar("left", "left", **STEEL)}), "'b'"),
    ("nothing free", lambda: Structure(NODES, BARS, dict.fromkeys(NODES, "xy")), "fix every node"),
    (
        "a beam in the plane",
        lambda: Structure(NODES, BARS | {"b": Beam("left", "apex", **BEAM)}, {}),
        "beam.*expected three coordinates",
    ),
    ("an unknown matrix", lambda: FRAME.assemble({"p": ("E", "rafters", "damping")}), "expected stiffness or mass"),
    ("damage to density", lambda: FRAME.assemble(["rafters"], groups={"d": ("density", "rafters")}, n_modes=1), "'d'"),
    ("no file", lambda: load_affine("no_such_file.npz"), "no_such_file"),
    ("a text file", lambda: load_affine(__file__), "test_bad_input"),
    ("text", lambda: CallableModel(lambda t: "no", ["k"], 1).frequencies([[1.0]]), "expected"),
    ("a generator", lambda: sample(TRUSS, random_state=GENERATOR), "random_state is Generator"),
    ("shapes of a program", lambda: shape_jacobian(ONE_MODE, [1.0]), "no method 'local_modes'"),
    ("order in a program", lambda: share_reordered(ONE_MODE, [[1.0]]), "no method 'modes'"),
    ("order of no rows", lambda: share_reordered(TRUSS, np.ones((0, 4))), "theta"),
    ("match with too many", lambda: match_modes(TRUSS, np.ones((1, 50))), "50 modes were measured; expected at most"),
    ("match shapes, no dofs", lambda: match_modes(TRUSS, NOMINAL, shapes=np.ones((2, 6))), "dofs"),
    ("hinges of others", lambda: HingeFeatures().fit(T).transform(F), "feature names"),
    ("hinges before fit", lambda: HingeFeatures().transform(T), "not fitted"),
    ("lags in a table", lambda: LagFeatures([[1, 2]]).fit(HOURLY), "lags is"),
    ("a billion lags", lambda: LagFeatures(10**9).fit(HOURLY), "lags are 1000000000"),
    ("one huge lag", lambda: LagFeatures([10**30]).fit(HOURLY), "lag"),
    ("freq of an array", lambda: LagFeatures(2, freq="1h").fit(HOURLY.to_numpy()), "freq"),
    ("durations", lambda: LagFeatures(2).fit(indexed(HOURLY.index - HOURLY.index[0])), "durations"),
    (
        "stamps on a level",
        lambda: LagFeatures(2).fit(indexed(pd.MultiIndex.from_product([HOURLY.index, ["a"]]))),
        "index levels",
    ),
    ("another time zone", lambda: LAGS.transform(HOURLY.tz_localize("UTC")), "time zone UTC; expected None"),
    ("stamps lost", lambda: LAGS.transform(HOURLY.reset_index(drop=True)), "stamp|Datetime"),
    ("one stamp", lambda: LagFeatures(2).fit(HOURLY[:1]), "expected freq"),
    ("no rows", lambda: LagFeatures(2).fit(HOURLY[:0]), "0 sample"),
    ("infinite X", lambda: LagFeatures(2).fit([[1.0], [INF]]), "infinity"),
    ("a vector", lambda: LagFeatures(2).fit([1.0, 2.0]), "2D array"),
    ("other sensors", lambda: LAGS.transform(HOURLY.rename(columns={"T1": "T2"})), "feature names"),
    ("before fit", lambda: LagFeatures(2).transform(HOURLY), "not fitted"),
    ("imputer, other width", lambda: KNNGapImputer().fit(F).transform(F.iloc[:, :3]), "feature"),
    ("reference a class", lambda: BiasAligner(AffineModel).fit(F), "reference"),
    ("scaled by zero", lambda: BiasAligner(method="scale").fit([[1.0], [-1.0]]), "mean of mode 'x0' is zero"),
    ("aligned, other modes", lambda: BiasAligner().fit(F).transform(F.iloc[:, :2]), "feature"),
    ("before fit", lambda: BiasAligner().transform(F), "not fitted"),
    (
        "a tz-aware index later",
        lambda: LAGS.transform(HOURLY.tz_localize("Europe/Brussels")),
        "time zone Europe/Brussels",
    ),
    ("offsets of two zones", lambda: LagFeatures(2).fit(indexed(OFFSETS)), "several offsets from UTC"),
    ("aligner, infinite", lambda: BiasAligner().fit([[1.0], [INF]]), "infinity"),
    ("freq of business days", lambda: LagFeatures(2, freq=pd.offsets.BDay()).fit(HOURLY), "freq is"),
    (
        "covariance a class",
        lambda: MahalanobisDetector(covariance=EmpiricalCovariance).fit(F),
        "instance of scikit-learn",
    ),
    ("one row", lambda: MahalanobisDetector().fit(F[:1]), "1 sample"),
    ("a column of NaN", lambda: MahalanobisDetector().fit(changed(F, slice(None), 0, NAN)), r"modes \['f1'\]"),
    ("an infinite value", lambda: MahalanobisDetector().fit(changed(F, 0, 0, INF)), "infinity"),
    ("other modes", lambda: DETECTOR.predict(F.iloc[:, ::-1]), "feature names"),
    ("fewer modes", lambda: DETECTOR.damage_index(F.iloc[:, :5]), "feature names"),
    ("no rows", lambda: DETECTOR.predict(F[:0]), "0 sample"),
    ("no row complete", lambda: MahalanobisDetector(covariance=EmpiricalCovariance()).fit(DIAGONAL), "0 of 365"),
    (
        "window of time, array",
        lambda: WindowedAlarm("7D").fit(F.to_numpy()),
        "'7D', a time, but the records are not a frame",
    ),
    ("window of time, unsorted", lambda: WindowedAlarm("7D").fit(F[::-1]), "in order of time"),
    ("windows of too few rows", lambda: WindowedAlarm(7).fit(F[:13]), "13 rows.*up to 7 records; expected"),
    ("windows before fit", lambda: WindowedAlarm(7).predict(F), "not fitted"),
    ("windows, other modes", lambda: WindowedAlarm(2).fit(F).predict(F.iloc[:, ::-1]), "feature names"),
    ("windows, infinite", lambda: WindowedAlarm(2).fit(changed(F, 0, 0, INF)), "infinity"),
    (
        "whiten, extrapolation_distance before fit",
        lambda: compensator(whiten="local").extrapolation_distance(BOTH),
        "not fitted",
    ),
    ("before fit", lambda: MahalanobisDetector().predict(F), "not fitted"),
    ("no score_samples", lambda: OutlierDetector(LocalOutlierFactor()).fit(F), "no score_samples"),
    ("a class", lambda: OutlierDetector(IsolationForest).fit(F), "estimator"),
    ("names for an array", lambda: compensator().fit(BOTH.to_numpy()), "targets"),
    ("cv tests twice", lambda: compensator(cv=ShuffleSplit(3)).fit_transform(BOTH), "cv|fold"),
    ("one fold", lambda: compensator(cv=1).fit_transform(BOTH), "n_splits=1|cv"),
    ("more folds than rows", lambda: compensator(cv=9).fit_transform(BOTH[:5]), "9"),
    ("other columns later", lambda: COMPENSATOR.transform(BOTH.iloc[:, ::-1]), "feature names"),
    ("an infinite record", lambda: DETECTOR.predict(changed(F, 0, 0, INF)), "infinity"),
    ("time to detection, unsorted", lambda: time_to_detection(DATED[::-1], 3.0, DATED.index[0]), "in order"),
    ("other index", lambda: mape(F, F.shift(freq="1D")), "different indices"),
    ("predicted -999", lambda: mape(F, changed(F, 0, 0, -999.0)), "'f1' in y_pred is -999"),
    ("scenario Average", lambda: error_table(F, F, scenarios=["Average"] * 365), "'Average'"),
    ("no Jacobian", lambda: sensitivity(ONE_MODE), "no method 'jacobian'"),
    ("S of text", lambda: select_parameters(pd.DataFrame({"top": ["a"]})), "S"),
    ("noise for some modes", lambda: identifiability(TRUSS, noise=[0, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]), "noise is"),
    ("dofs without noise", lambda: identifiability(TRUSS, noise=0.01, dofs=[0]), "shape_noise"),
    ("negative information", lambda: cramer_rao([[-1.0]]), "negative"),
    ("bounds without one", lambda: updater(bounds=[[1.1, 1.3]] * 4).fit(NOMINAL), "contain 1"),
    ("F NaN", lambda: updater().fit(NOMINAL * NAN), "F is NaN in all"),
    ("F infinite", lambda: updater().fit(NOMINAL * INF), "inf"),
    ("frequency_std zero", lambda: updater().fit(NOMINAL, frequency_std=0), "frequency_std of 'f1' is 0"),
    ("shapes without dofs", lambda: updater().fit(NOMINAL, shapes=np.ones((2, 6))), "without dofs"),
    ("dofs without shapes", lambda: updater().fit(NOMINAL, dofs=[0]), "without shapes"),
    (
        "shapes of text",
        lambda: updater().fit(NOMINAL, shapes=[["a"] * 6] * 2, dofs=[0, 1]),
        "shapes is .*expected numbers",
    ),
    ("weight without shapes", lambda: updater(shape_weight=1.0).fit(NOMINAL), "no shapes were given"),
    ("F of three axes", lambda: updater().fit(NOMINAL[np.newaxis]), "dim 3|3 dim"),
    (
        "shapes of NaN",
        lambda: updater().fit(NOMINAL, shapes=[[NAN] * 6, [1] * 6], dofs=[0, 1]),
        "is NaN in row 0 but not in all",
    ),
    (
        "shapes of a program",
        lambda: ModelUpdater(ONE_MODE).fit([[1.0]], shapes=[[1.0]], dofs=[0]),
        "has no 'local_modes'",
    ),
    ("a generator", lambda: make_truss_campaign(random_state=GENERATOR), "random_state is Generator"),
    ("no file", lambda: load_z24("no_such_file.csv"), "no_such_file.csv is not a file"),
    ("a folder", lambda: load_z24(Path(__file__).parent), "is not a file"),
    ("not that data", lambda: load_z24(__file__), "header"),
    ("no model, no theta", lambda: InverseSurrogate().fit(), "expected theta"),
    ("regressor a class", lambda: InverseSurrogate(TRUSS, Ridge).fit(), "instance of scikit-learn"),
    ("other modes", lambda: INVERSE.transform(NOMINAL[:, :5]), "5 features"),
    ("before fit", lambda: InverseSurrogate(TRUSS).transform(F), "not fitted"),
    ("inverted before fit", lambda: InverseSurrogate(TRUSS).invert(F), "not fitted"),
    ("steps without a model", lambda: InverseSurrogate(refine=5).fit(ONES, ONES), "refine is 5 without a mod"),
    (
        "inverted without steps",
        lambda: InverseSurrogate(TRUSS, Ridge(), refine=0, **SEEDED).fit().invert(F.to_numpy()),
        "refine is 0, which means no steps",
    ),
    (
        "standard deviations that the regressor has not",
        lambda: InverseSurrogate(TRUSS, Ridge(), refine=0, **SEEDED).fit().predict(F.to_numpy(), return_std=True),
        "gives no standard deviations",
    ),
    ("mapper, a class", lambda: TemperatureMapper(Ridge).fit(T, np.ones((365, 4))), "instance of scikit-learn"),
    ("mapper, other sensors", lambda: TemperatureMapper(Ridge()).fit(T, YEAR.frequencies).predict(F), "feature names"),
    ("other index", lambda: chain().fit(T, F.shift(freq="1D")), "different indices"),
    ("infinite", lambda: chain().fit(changed(T, 0, 0, INF), F), "infinity"),
    ("one row", lambda: chain().fit(T[:1], F[:1]), "1 sample"),
    ("mapper a class", lambda: chain(mapper=TemperatureMapper).fit(T, F), "mapper|class"),
    ("before fit", lambda: DataInformedFEM(TRUSS).predict(T), "not fitted"),
    ("interval before fit", lambda: chain().predict_interval(T), "not fitted"),
    ("residuals before fit", lambda: chain().residuals(), "not fitted"),
    (
        "no damage there",
        lambda: chain(ONE_MODE).fit(T, F[["f1"]]).simulate(T, damage={"k": 0.1}),
        "no method 'damaged'",
    ),
    ("scored on another index", lambda: CHAIN.score(T, F.shift(freq="1D")), "different indices"),
]
WARNED_OF = [
    ("outside the box", lambda: TRUSS.reduced(0.2, tol=1e-3, random_state=0).frequencies(2 * ONES), "3 of 3"),
    (
        "a program that fails",
        lambda: CallableModel(lambda t: 1 / 0, ["k"], 1).frequencies([[1.0]]),
        "1 of 1 rows.*ZeroDiv",
    ),
    ("imputer, -999", lambda: KNNGapImputer().fit(changed(F, 3, 1, -999.0)), "-999"),
    (
        "aligner, -999",
        lambda: BiasAligner().fit(changed(F, 3, 1, -999.0)),
        "1 of 2190 values.*-999 in row 3 of column 'f2'",
    ),
    (
        "missing modes",
        lambda: DETECTOR.predict(changed(F, slice(7), slice(None), NAN)),
        "7 of 365 rows are not evaluated",
    ),
    ("all modes lost", lambda: DETECTOR.predict(F * NAN), "365 of 365 rows"),
    ("too few records", lambda: MahalanobisDetector().fit(F[:20]), "20 independent baseline .*at least 49"),
    ("windows of few rows", lambda: WindowedAlarm(2).fit(F[:40]), "independent baseline .*at least 49"),
    ("windows lost", lambda: WindowedAlarm(2).fit(F).predict(changed(F, slice(7), slice(None), NAN)), "7 of 365"),
    ("whiten, hot", lambda: compensator(whiten="local").fit(BOTH).transform((T + 60).join(F)), "far outside"),
    ("frequencies of -999", lambda: MahalanobisDetector().fit(changed(F, 3, 1, -999.0)), "-999"),
    ("kelvin", lambda: compensator().fit((T + 273.15).join(F)), "kelvin"),
    ("-999", lambda: compensator().fit(changed(BOTH, 0, 0, -999.0)), "-999 in 1 of 365"),
    ("kelvin later", lambda: COMPENSATOR.transform((T + 273.15).join(F)), "above 150: kelvin"),
    (
        "masked modes",
        lambda: MahalanobisDetector().fit(F.to_numpy()[:, :1]).predict(masked(F)[:, :1]),
        "1 of 365 rows are not evaluated",
    ),
    ("F in rad/s", lambda: updater().fit(NOMINAL * 2 * np.pi), "rad/s"),
    ("F far off", lambda: updater().fit(NOMINAL * 1.5), "misses.*f6.*more than 15 %: expected"),
    ("one mode, four parameters", lambda: updater(make_truss(1)).fit([[7.4]]), "4 parameters.*1 residual"),
    (
        "two modes swapped",
        lambda: updater().fit(NOMINAL[:, [0, 1, 3, 2, 4, 5]]),
        "expected frequencies in Hz, in the order",
    ),
    ("an optimum at the bounds", lambda: updater(bounds=0.1).fit(NOMINAL * 1.1), "lies at the bounds of 'bottom'"),
    (
        "noise that explains little",
        lambda: updater(bounds=0.1).fit(NOMINAL * 1.04 + 1, frequency_std=1e-4),
        "standard deviations of frequency_std",
    ),
    ("complex shapes", lambda: updater().fit(NOMINAL, shapes=SHAPES * 1j, dofs=[0, 4, 8]), "shapes are complex"),
    ("frequencies in rad/s", lambda: INVERSE.transform(F * 2 * np.pi), "36[45] of 365 rows.*far outside"),
    ("rad/s", lambda: chain().fit(T, F * 2 * np.pi), "rad/s"),
    ("kelvin", lambda: CHAIN.predict(T + 273.15), "kelvin|far outside"),
    ("Fahrenheit", lambda: CHAIN.predict(T * 1.8 + 32), "rows have temperatures far outside"),
    ("1.5 times too high", lambda: chain().fit(T, F * 1.5), r"differ from the model's.*\+5\d %"),
    ("two modes swapped", lambda: chain().fit(T, F.iloc[:, [0, 1, 3, 2, 4, 5]]), r"look like other modes.*0, 1, 3, 2"),
    ("fewer rows than parameters ask", lambda: chain().fit(T[:20], F[:20]), "20 complete rows train 4 parameters"),
    ("predicted kelvin", lambda: CHAIN.predict_parameters(T + 273.15), "365 of 365 rows have temperatures"),
]


def complaint(call, kind, message):
    """What is wrong with the answer to a call with bad input; None if it is a clear error or one warning."""
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        try:
            call()
        except (*ERRORS, RuntimeError) as error:
            if kind != "error" or not re.search(message, str(error)):
                return f"{error!r}, expected {kind} {message!r}"
            if FROM_THE_DEPTHS.search(str(error).partition("expected")[0]):
                return f"{error!r} says what it led to, not what is wrong"
            where = traceback.extract_tb(error.__traceback__)[-1].filename
            return None if where.startswith(CHECKED_BY) else f"{error!r} comes from {where}"
        except Exception as error:
            return f"{error!r}, expected {kind} {message!r}"
    if kind == "error":
        return f"no error, expected {message!r}"
    if {(issubclass(one.category, SkthermoWarning), one.filename) for one in given} != {(True, __file__)}:
        return f"warnings are {[str(warning) for warning in given]}, expected SkthermoWarning at the user's line"
    said = sum(bool(re.search(message, str(warning.message))) for warning in given)
    return None if said == 1 else f"{said} warnings say {message!r}: {[str(warning.message) for warning in given]}"


def assert_no_complaints(rows):
    complaints = [(cause, complaint(call, kind, message)) for cause, call, kind, message in rows]
    wrong = [f"{cause}: {text}" for cause, text in complaints if text]
    assert not wrong, "\n" + "\n".join(wrong)


@pytest.mark.parametrize(("kind", "rows"), [("error", REFUSED), ("warning", WARNED_OF)])
def test_bad_input_is_named(kind, rows):
    assert_no_complaints((cause, call, kind, message) for cause, call, message in rows)


COLUMNS = {  # a column that is no number, by what the message calls it
    "booleans": pd.array([True] * 365, dtype="boolean"),
    "text": pd.array(["1.0"] * 365, dtype="string"),
    "bytes": np.array([b"1"] * 365, dtype=object),
    "times": pd.date_range("2020", periods=365, tz="UTC"),
    "categories": pd.Categorical([1.0] * 365),
}
TABLES = [
    lambda bad: MahalanobisDetector().fit(F.assign(c=bad)),
    lambda bad: LagFeatures(2).fit(T.assign(c=bad)),
    lambda bad: KNNGapImputer().fit(F.assign(c=bad)),
    lambda bad: chain().fit(T.assign(c=bad), F),
    lambda bad: chain().fit(T, F.assign(c=bad)),
    lambda bad: compensator().fit(BOTH.assign(c=bad)),
    lambda bad: TemperatureMapper(LINEAR).fit(T, F.assign(c=bad)),
    lambda bad: error_table(F.assign(c=1.0), F.assign(c=bad)),
]


@pytest.mark.parametrize("what", COLUMNS)
def test_columns_that_are_no_numbers_are_named(what):
    assert_no_complaints(
        (f"call {i}", lambda call=call: call(COLUMNS[what]), "error", f"column 'c' holds {what}")
        for i, call in enumerate(TABLES)
    )


TOO_LARGE = {  # what the message names, and a call
    "theta": lambda: TRUSS.frequencies([[1e308, 1, 1, 1]]),
    "frequencies": lambda: match_modes(TRUSS, NOMINAL * 1e300),
    "damage_index": lambda: probability_of_detection([1e308], 3.0),
    "y_true": lambda: mape(F * 1e300, F),
    "X": lambda: MahalanobisDetector().fit(changed(F, 0, 0, 1e308)),
    "X of fit": lambda: chain().fit(changed(T, 0, 0, 1e308), F),
    "y of fit": lambda: chain().fit(T, changed(F, 0, 0, 1e308)),
    "E": lambda: truss_of(BARS | {"tie": Bar("left", "right", 1e308, 1.0)}),
}


@pytest.mark.parametrize("what", TOO_LARGE)
def test_numbers_that_cannot_be_squared_are_refused(what):
    name = what.split()[0]
    assert_no_complaints([(what, TOO_LARGE[what], "error", rf"{name} (holds|=) \S*e\+30\d.*; expected")])


def trained(**options):
    return InverseSurrogate(TRUSS, Ridge(), **SEEDED, **options).fit()


SHARES = pd.Series([0.1, 0.2, 0.3, 0.15], NAMES)
BOX = pd.DataFrame({"lowest": 1 - SHARES, "highest": 1 + SHARES})
STEPS = pd.Series([1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3], MODES)
WEIGHTS = pd.Series(np.linspace(1, 2, len(T)), T.index)
BY_NAME = {  # values with names, and a call that reads them
    "theta, a series": (1 + SHARES, TRUSS.frequencies),
    "theta, a frame": ((1 + SHARES).to_frame().T, lambda theta: evaluate(TRUSS, theta).ravel()),
    "half-widths": (SHARES, lambda bounds: sample(TRUSS, bounds, 4, random_state=0).theta),
    "box": (BOX, lambda bounds: check_bounds(bounds, NAMES)),
    "prior": (SHARES, lambda prior: check_prior(prior, NAMES)),
    "severities": (SHARES, lambda damage: TRUSS.damaged(damage).frequencies(ONES[:1])),
    "severities of a scenario": (SHARES, lambda damage: CHAIN.simulate(T[:2], damage=Scenario("a", damage).damage)),
    "noise": (STEPS, lambda noise: add_noise(F, noise, random_state=0)),
    "noise of a chain": (STEPS, lambda noise: CHAIN.simulate(T[:5], noise=noise, random_state=0)),
    "noise of an inverse": (STEPS, lambda noise: trained(noise=noise).transform(NOMINAL)),
    "noise of a campaign": (STEPS, lambda noise: make_truss_campaign(noise=noise, random_state=0).frequencies),
    "noise of what is identified": (STEPS, lambda noise: identifiability(TRUSS, noise=noise).deviations),
    "deviations": (100 * STEPS, lambda std: updater().fit(F[:9], frequency_std=std).theta_),
    "reference": (F.mean(), lambda reference: BiasAligner(reference).fit_transform(F)),
    "weights": (WEIGHTS, lambda weights: TemperatureMapper(Ridge()).fit(T, F / 10, sample_weight=weights).predict(T)),
}


@pytest.mark.parametrize("what", BY_NAME)
def test_names_count_and_not_positions(what):
    named, call = BY_NAME[what]
    turned = named[named.columns[::-1]] if what == "theta, a frame" else named[::-1]
    np.testing.assert_array_equal(call(turned), call(named))
    labels = "columns" if what == "theta, a frame" else "index"
    others = [f"no {label}" for label in getattr(named, labels)]
    with pytest.raises(ValueError, match=r"'?no .* unknown|unknown damage group 'no|groups .*unknown|unknown to X"):
        call(named.set_axis(others, axis=labels))


def test_labels_that_only_count_are_no_names():
    numbered = (1 + SHARES).reset_index(drop=True)
    np.testing.assert_array_equal(TRUSS.frequencies(numbered), TRUSS.frequencies(1 + SHARES))
    np.testing.assert_array_equal(check_noise(STEPS.to_numpy(), 6), check_noise(STEPS.reset_index(drop=True), 6))


IN_PERCENT = {  # a call with a share in percent, and what the message says
    "noise": (lambda: InverseSurrogate(TRUSS, noise=0.5).fit(), "means 50 % .*percent.*0.005 where 0.5 %"),
    "noise by mode": (lambda: add_noise(F, [0.5, 0.4, 0.5, 0.6, 0.7, 0.5]), "means 40 % or more in every mode"),
    "prior": (lambda: updater(prior=30).fit(NOMINAL), r"prior is 30.*at most 1 \(0.3 means 30 %\)"),
    "severity": (lambda: Scenario("a", {"top": 20}), r"not percent \(0.2 means 20 %\)"),
    "position on a curve": (lambda: Scenario("a", {"top": 0.2}, severity=20), "not percent"),
    "strengthening": (lambda: Scenario("a", {"top": -15}), "not below -10"),
    "sweep": (lambda: sweep(TRUSS, [10, 20]), "not percent"),
    "severity on a curve": (lambda: pod_curve([0.1, 0.2], [1, 9], [10, 10]).predict(20), "shares below 1"),
    "range of severities": (lambda: TRUSS.with_damage_parameters(["top"], severities=(0, 60)), "below 1"),
}


@pytest.mark.parametrize("what", IN_PERCENT)
def test_percent_is_refused_with_a_hint(what):
    call, message = IN_PERCENT[what]
    assert_no_complaints([(what, call, "error", f"(?s){message}")])


def test_a_single_mode_may_be_unknown():
    np.testing.assert_array_equal(check_noise([0.01, 0.9], 2), [0.01, 0.9])


def test_growth_to_a_record_after_the_last_goes_on_as_far_as_there_are_records():
    growing = ProgressiveDamage("a", {"top": 0.4}, 2, 22).changes(np.zeros((12, 3)))["damage"]["top"]
    np.testing.assert_allclose(growing, np.clip(np.arange(12) - 2, 0, None) * 0.4 / 20)


def test_read_triplets_refuses_devices_and_infinite_values(tmp_path):
    (tmp_path / "tower.sti").write_text("1 1 inf\n")
    assert_no_complaints(
        [
            ("a device", lambda: read_triplets("/dev/zero"), "error", "/dev/zero is a folder or a device"),
            ("a folder", lambda: read_triplets(tmp_path), "error", "is a folder or a device"),
            (
                "infinite",
                lambda: read_triplets(tmp_path / "tower.sti"),
                "error",
                "tower.sti holds values that are not finite",
            ),
            ("a number", lambda: read_triplets(3), "error", "path is 3; expected a path"),
            ("bytes", lambda: load_affine(b"model.npz"), "error", "path is b'model.npz'; expected a path"),
        ]
    )
