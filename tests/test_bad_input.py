"""Bad inputs to every public name: each is a clear error or one warning, none is silent."""

import re
import traceback
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.sparse
import sklearn
from sklearn.covariance import EmpiricalCovariance
from sklearn.dummy import DummyRegressor
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import Ridge
from sklearn.model_selection import ShuffleSplit
from sklearn.neighbors import LocalOutlierFactor

import skthermo
from skthermo._arguments import check_bounds, check_dofs, check_noise, check_prior, check_theta
from skthermo.datasets import (
    kw51_structure,
    load_z24,
    make_kw51,
    make_kw51_campaign,
    make_truss,
    make_truss_campaign,
    make_z24,
    steel_modulus,
)
from skthermo.detection import MahalanobisDetector, OutlierDetector, TemperatureCompensator, WindowedAlarm
from skthermo.fem import (
    AffineModel,
    Bar,
    Beam,
    CallableModel,
    Membrane,
    PointMass,
    ReducedModel,
    Spring,
    Structure,
    add_noise,
    evaluate,
    linearise,
    load_affine,
    mac,
    match_modes,
    probe,
    read_triplets,
    sample,
    shape_jacobian,
    share_reordered,
)
from skthermo.metrics import (
    complete_r2,
    error_table,
    frequency_scorer,
    mape,
    minimum_detectable_damage,
    probability_of_detection,
    probability_of_false_alarm,
    time_to_detection,
)
from skthermo.preprocessing import BiasAligner, HingeFeatures, KNNGapImputer, LagFeatures
from skthermo.studies import (
    DetectabilityStudy,
    ProgressiveDamage,
    Scenario,
    identify_damage,
    pod_curve,
    sweep,
)
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper, paper_network
from skthermo.updating import ModelUpdater, cramer_rao, identifiability, select_parameters, sensitivity

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


# Each row: what is wrong, the call, "error" or "warning", and what the message says.

THETA = [
    ("a string", lambda: check_theta("stiff", NAMES), "error", "theta is 'stiff'; expected numbers"),
    ("a mapping", lambda: check_theta({"top": 1.0}, NAMES), "error", "theta: .*'bottom'.* are missing"),
    ("ragged rows", lambda: check_theta([[1, 1, 1, 1], [1, 1]], NAMES), "error", "theta is .*expected numbers"),
    ("too few columns", lambda: check_theta(ONES[:, :3], NAMES), "error", r"shape \(3, 3\); expected \(n_samples, 4\)"),
    ("a number", lambda: check_theta(1.0, NAMES), "error", r"shape \(\); expected"),
    ("three axes", lambda: check_theta(ONES[np.newaxis], NAMES), "error", r"shape \(1, 3, 4\); expected"),
    ("zero", lambda: check_theta([1, 0, 1, 1], NAMES), "error", "'top' is 0"),
    ("negative", lambda: check_theta([1, 1, -1, 1], NAMES), "error", "'diagonal' is -1"),
    ("infinite", lambda: check_theta([1, 1, INF, 1], NAMES), "error", "finite and positive.*'diagonal' is inf"),
    ("NaN", lambda: check_theta([1, 1, 1, NAN], NAMES), "error", "'vertical' is nan"),
    ("masked", lambda: TRUSS.frequencies(np.ma.masked_equal([[1, 1, 1, 2]], 2)), "error", "'vertical' is nan"),
    (
        "other columns",
        lambda: TRUSS.frequencies(pd.DataFrame(ONES, columns=list("abcd"))),
        "error",
        r"theta: \['a', 'b', 'c', 'd'\] are unknown; expected each of the par",
    ),
    ("two rows for one", lambda: check_theta(ONES, NAMES, one_row=True), "error", "3 rows; expected one"),
    ("modes of NaN", lambda: TRUSS.modes([1, 1, 1, NAN]), "error", "finite and positive"),
    ("Jacobian at zero", lambda: TRUSS.jacobian([0, 1, 1, 1]), "error", "finite and positive"),
    ("a string among numbers", lambda: evaluate(TRUSS, [["a", 1, 1, 1]]), "error", "theta is .*expected numbers"),
]

BOUNDS = [
    ("a string", lambda: check_bounds("wide", NAMES), "error", "bounds is 'wide'; expected"),
    ("zero width", lambda: check_bounds(0, NAMES), "error", "half-width between 0 and 1"),
    ("percent", lambda: check_bounds(30, NAMES), "error", "bounds is 30.*half-width between 0 and 1"),
    ("NaN", lambda: check_bounds(NAN, NAMES), "error", "half-width between 0 and 1"),
    ("negative", lambda: check_bounds(-0.3, NAMES), "error", "half-width between 0 and 1"),
    ("a boolean", lambda: check_bounds(True, NAMES), "error", "bounds is True; expected numbers"),
    ("a pair", lambda: check_bounds((0.8, 1.2), NAMES), "error", r"shape \(2,\); expected a half-width or \(4, 2\)"),
    ("transposed", lambda: check_bounds(np.ones((2, 4)), NAMES), "error", r"shape \(2, 4\); expected"),
    ("reversed", lambda: check_bounds([[1.2, 0.8]] * 4, NAMES), "error", "0 < lowest < highest"),
    ("lowest of zero", lambda: check_bounds([[0.0, 0.8]] * 4, NAMES), "error", "0 < lowest < highest"),
    ("highest infinite", lambda: check_bounds([[0.5, INF]] * 4, NAMES), "error", "0 < lowest < highest"),
    ("NaN in a row", lambda: check_bounds([[0.5, NAN]] * 4, NAMES), "error", "0 < lowest < highest"),
    ("a parameter left out", lambda: check_bounds({"top": 0.3}, NAMES), "error", "'bottom'.* are missing"),
    (
        "an unknown parameter",
        lambda: check_bounds(dict.fromkeys([*NAMES, "deck"], 0.3), NAMES),
        "error",
        "'deck'.* are unknown",
    ),
    ("no mapping at all", lambda: check_bounds({}, NAMES), "error", "are missing"),
    (
        "three numbers",
        lambda: check_bounds(dict.fromkeys(NAMES, (0.7, 1, 1.3)), NAMES),
        "error",
        "'bottom' are .*half-wid",
    ),
    (
        "a string in a mapping",
        lambda: check_bounds(dict.fromkeys(NAMES, "x"), NAMES),
        "error",
        "'bottom' are 'x'; expected",
    ),
    ("None in a mapping", lambda: check_bounds(dict.fromkeys(NAMES), NAMES), "error", "'bottom' are None; expected"),
    (
        "percent in a mapping",
        lambda: check_bounds(dict.fromkeys(NAMES, 30), NAMES),
        "error",
        "'bottom' are 30; expected",
    ),
    ("text pair", lambda: check_bounds(dict.fromkeys(NAMES, ("a", "b")), NAMES), "error", "bounds.*expected"),
    ("prior of text", lambda: check_prior("wide", NAMES), "error", "prior is 'wide'; expected"),
    ("prior zero", lambda: check_prior(0, NAMES), "error", r"prior is 0.* above 0 and at most 1"),
    ("prior negative", lambda: check_prior([0.1, -0.1, 0.1, 0.1], NAMES), "error", "standard deviations above 0"),
    ("prior NaN", lambda: check_prior(NAN, NAMES), "error", "prior is nan; expected"),
    ("prior infinite", lambda: check_prior(INF, NAMES), "error", "prior is inf; expected"),
    ("prior of other width", lambda: check_prior([0.1, 0.1], NAMES), "error", r"prior is \[0.1 0.1\]; expected"),
    ("prior a table", lambda: check_prior([[0.1] * 4], NAMES), "error", "one for each of"),
    ("prior of one parameter", lambda: check_prior({"top": 0.1}, NAMES), "error", "prior: .*'bottom'.* are missing"),
    ("prior of a group", lambda: check_prior(dict.fromkeys([*NAMES, "deck"], 0.1), NAMES), "error", "'deck'.* unknown"),
    ("prior of pairs", lambda: check_prior(dict.fromkeys(NAMES, (0.1, 0.2)), NAMES), "error", "one for each of"),
    ("dofs negative", lambda: check_dofs([-1], 23), "error", "dofs holds -1; expected 0 to 22"),
    ("dofs too high", lambda: check_dofs([23], 23), "error", "dofs holds 23; expected 0 to 22"),
    ("dofs twice", lambda: check_dofs([1, 1], 23), "error", "dofs holds 1 more than once"),
    ("dofs floats", lambda: check_dofs([1.0], 23), "error", "type float64; expected integers"),
    ("dofs none", lambda: check_dofs([], 23), "error", "expected integers"),
    ("dofs None", lambda: check_dofs(None, 23), "error", "expected integers"),
    ("dofs a mask", lambda: check_dofs([True] * 23, 23), "error", "dofs is .*expected integers"),
    ("dofs a table", lambda: check_dofs([[1, 2]], 23), "error", r"shape \(1, 2\)"),
    ("dofs ragged", lambda: check_dofs([[1, 2], [1]], 23), "error", "dofs.*expected integers"),
]

NOISE = [
    ("noise negative", lambda: add_noise(NOMINAL, -0.01), "error", "noise"),
    ("noise NaN", lambda: add_noise(NOMINAL, NAN), "error", "noise"),
    (
        "noise of other modes",
        lambda: check_noise([0.01, 0.01], 6),
        "error",
        r"noise is \[0.01 0.01\].*each of the 6 modes",
    ),
    ("a generator", lambda: add_noise(NOMINAL, 0.01, random_state=GENERATOR), "error", "random_state is"),
    ("noise in percent", lambda: add_noise(NOMINAL, 1), "error", "noise is 1"),
    ("noise a string", lambda: check_noise("low", 6), "error", "noise.*expected"),
]

AFFINE = [
    ("parameters None", lambda: TRUSS.with_parameters(None), "error", "expected"),
    ("strengthened in percent", lambda: TRUSS.damaged({"top": -15}), "error", "-15"),
    ("no terms", lambda: AffineModel({}, EYE, n_modes=1), "error", "stiffness"),
    ("stiffness None", lambda: AffineModel(None, EYE, n_modes=1), "error", "stiffness"),
    ("a bare matrix", lambda: AffineModel(EYE, EYE, n_modes=1), "error", "no term names a parameter; expected"),
    ("not square", lambda: affine(np.ones((2, 3))), "error", r"shape \(2, 3\)"),
    ("not symmetric", lambda: affine([[2.0, 1.0], [0.0, 2.0]]), "error", "symmetric"),
    ("NaN", lambda: affine([[NAN, 0], [0, 1]]), "error", "finite"),
    ("a mechanism", lambda: affine([[1.0, -1.0], [-1.0, 1.0]]), "error", "mechanism"),
    ("other mass", lambda: affine(STIFF, np.eye(3)), "error", "mass.*shape"),
    ("mass negative", lambda: affine(STIFF, -EYE), "error", "negative eigenvalue"),
    ("too many modes", lambda: affine(STIFF, n_modes=3), "error", "n_modes is 3"),
    ("no modes", lambda: affine(STIFF, n_modes=0), "error", "n_modes is 0"),
    ("half a mode", lambda: affine(STIFF, n_modes=1.5), "error", "n_modes is 1.5"),
    ("modes as text", lambda: make_truss("6"), "error", "n_modes is '6'"),
    ("unknown parameter", lambda: affine(STIFF, parameter_names=["E"]), "error", "'k'"),
    ("a name twice", lambda: affine(STIFF, parameter_names=["k", "k"]), "error", "k"),
    ("unknown key", lambda: affine(STIFF, groups={"g": ["E"]}), "error", "group"),
    ("term too high", lambda: affine(STIFF, groups={"g": [3]}), "error", "group.*3"),
    ("unknown group", lambda: TRUSS.damaged({"deck": 0.1}), "error", "'deck'.*expected"),
    ("severity in percent", lambda: TRUSS.damaged({"top": 30}), "error", "30"),
    ("severity of one", lambda: TRUSS.damaged({"top": 1.0}), "error", "1.0"),
    ("severity NaN", lambda: TRUSS.damaged({"top": NAN}), "error", "nan"),
    ("severity text", lambda: TRUSS.damaged({"top": "10 %"}), "error", "'10 %'.*expected"),
    ("severity None", lambda: TRUSS.damaged({"top": None}), "error", "None.*expected"),
    ("severity complex", lambda: TRUSS.damaged({"top": 0.1j}), "error", "expected"),
    ("damage a string", lambda: TRUSS.damaged("top"), "error", "damage is 'top'; expected"),
    ("damage a number", lambda: TRUSS.damaged(0.3), "error", "damage is 0.3; expected"),
    ("damage a list", lambda: TRUSS.damaged([("top", 0.3)]), "error", "damage is .*; expected"),
    ("rescaled by two rows", lambda: TRUSS.rescaled(ONES), "error", "3 rows; expected one"),
    ("unknown mode", lambda: TRUSS.with_modes([0, 60]), "error", "60"),
    ("negative mode", lambda: TRUSS.with_modes([-1]), "error", "-1"),
    ("a mode twice", lambda: TRUSS.with_modes([0, 0]), "error", "repeat; expected each once"),
    ("no modes", lambda: TRUSS.with_modes([]), "error", "modes"),
    ("modes of floats", lambda: TRUSS.with_modes([0.0]), "error", "modes"),
    ("modes a number", lambda: TRUSS.with_modes(2), "error", "modes"),
    ("modes None", lambda: TRUSS.with_modes(None), "error", "modes"),
    ("unknown parameter", lambda: TRUSS.with_parameters(["deck"]), "error", "'deck'"),
    ("no parameters", lambda: TRUSS.with_parameters([]), "error", "expected"),
    ("a parameter twice", lambda: TRUSS.with_parameters(["top", "top"]), "error", "expected"),
    ("bounds in percent", lambda: TRUSS.reduced(30), "error", "half-width between 0 and 1"),
    ("tol of zero", lambda: TRUSS.reduced(tol=0), "error", "tol is 0"),
    ("tol text", lambda: TRUSS.reduced(tol="fine"), "error", "tol is 'fine'"),
    ("tol NaN", lambda: TRUSS.reduced(tol=NAN), "error", "tol is nan"),
    ("tol None", lambda: TRUSS.reduced(tol=None), "error", "tol is None"),
    ("not a model", lambda: ReducedModel("truss"), "error", "'truss'.*expected"),
    ("a class", lambda: ReducedModel(AffineModel), "error", "expected"),
    (
        "outside the box",
        lambda: TRUSS.reduced(0.2, tol=1e-3, random_state=0).frequencies(2 * ONES),
        "warning",
        "3 of 3",
    ),
    ("few names of dofs", lambda: affine(STIFF, dof_names=["x"]), "error", "dof_names"),
]

STRUCTURE = [
    ("a number as target", lambda: FRAME.assemble({"E": 1}), "error", "'E' is 1; expected"),
    ("a number as parameter", lambda: FRAME.assemble([1]), "error", "1.*expected"),
    ("parameters None", lambda: FRAME.assemble(None), "error", "parameters is None; expected"),
    ("a group None", lambda: truss_of(groups={"g": None}), "error", "group 'g'"),
    ("direction a number", lambda: Structure(NODES, BARS, {"left": 1}), "error", "'left'"),
    ("a class as member", lambda: truss_of(BARS | {"b": Bar}), "error", "'b'"),
    ("no nodes", lambda: Structure({}, BARS, SUPPORTS), "error", "nodes is empty"),
    ("nodes None", lambda: Structure(None, BARS, SUPPORTS), "error", "expected a mapping"),
    ("text for coordinates", lambda: truss_of(nodes=NODES | {"apex": "high"}), "error", "'apex'.*'high'"),
    ("other dimension", lambda: truss_of(nodes=NODES | {"apex": (3, 2, 0)}), "error", "'apex'"),
    ("NaN for coordinates", lambda: truss_of(nodes=NODES | {"apex": (3, NAN)}), "error", "'apex'"),
    ("two nodes at one place", lambda: truss_of(nodes=NODES | {"b": (3, 2)}), "error", "duplicates"),
    ("a node without member", lambda: truss_of(nodes=NODES | {"b": (9, 9)}), "error", "'b' is disconnected"),
    ("no members", lambda: Structure(NODES, {}, SUPPORTS), "error", "expected|disconnected"),
    ("a member of text", lambda: truss_of(BARS | {"tie": "bar"}), "error", "'tie'"),
    ("a member to nowhere", lambda: truss_of(BARS | {"b": Bar("left", "x", **STEEL)}), "error", "'x'"),
    ("length zero", lambda: truss_of(BARS | {"b": Bar("left", "left", **STEEL)}), "error", "'b'"),
    ("unknown support", lambda: Structure(NODES, BARS, {"pier": "xy"}), "error", "'pier'"),
    ("unknown direction", lambda: Structure(NODES, BARS, {"left": "xw"}), "error", "'xw'|'w'"),
    ("nothing free", lambda: Structure(NODES, BARS, dict.fromkeys(NODES, "xy")), "error", "fix every node"),
    ("unknown member", lambda: truss_of(groups={"g": ["post"]}), "error", "group 'g' holds.*'post'"),
    ("an empty group", lambda: truss_of(groups={"g": []}), "error", "group 'g' holds no member"),
    ("negative E", lambda: truss_of(BARS | {"tie": Bar("left", "right", -1, 1)}), "error", "'tie'.*E"),
    ("A of NaN", lambda: truss_of(BARS | {"tie": Bar("left", "right", 1, NAN)}), "error", "'tie'.*A"),
    ("E of text", lambda: truss_of(BARS | {"tie": Bar("left", "right", "s", 1)}), "error", "'tie'.*E"),
    ("a spring of zero", lambda: truss_of(BARS | {"s": Spring("apex", "y", 0)}), "error", "'s'.*k"),
    ("a spring along w", lambda: truss_of(BARS | {"s": Spring("apex", "w", 1)}), "error", "'s'.*'w'"),
    ("a negative mass", lambda: truss_of(BARS | {"m": PointMass("apex", -1)}), "error", "'m'"),
    (
        "a beam in the plane",
        lambda: Structure(NODES, BARS | {"b": Beam("left", "apex", **BEAM)}, {}),
        "error",
        "beam.*expected three coordinates",
    ),
    (
        "three corners",
        lambda: Structure(NODES, {"m": Membrane(tuple(NODES), 1, 1)}, {}),
        "error",
        "expected four nodes",
    ),
    ("an unknown parameter", lambda: FRAME.assemble(["posts"]), "error", "unknown group 'posts'"),
    ("a parameter twice", lambda: FRAME.assemble(["rafters", "rafters"]), "error", "each group once"),
    ("an unknown property", lambda: FRAME.assemble({"p": ("nu", "rafters")}), "error", "property 'nu'"),
    (
        "an unknown matrix",
        lambda: FRAME.assemble({"p": ("E", "rafters", "damping")}),
        "error",
        "expected stiffness or mass",
    ),
    ("four entries", lambda: FRAME.assemble({"p": ("E", "rafters", "mass", 1)}), "error", "parameter 'p' is"),
    ("an unknown damage group", lambda: FRAME.assemble(["rafters"], groups=["deck"]), "error", "unknown group 'deck'"),
    (
        "damage to density",
        lambda: FRAME.assemble(["rafters"], groups={"d": ("density", "rafters")}, n_modes=1),
        "error",
        "'d'",
    ),
    (
        "a mechanism",
        lambda: Structure(NODES, BARS, {"left": "y"}, {"g": BARS}).assemble(["g"], n_modes=1),
        "error",
        "mechanism",
    ),
    ("too many modes", lambda: FRAME.assemble(["rafters"], n_modes=50), "error", "n_modes is 50"),
    ("nodes a list", lambda: Structure([(0, 0)], BARS, SUPPORTS), "error", "nodes is .*expected a mapping"),
    ("members a list", lambda: Structure(NODES, list(BARS.values()), SUPPORTS), "error", "members is .*expected a map"),
    ("members None", lambda: Structure(NODES, None, SUPPORTS), "error", "members is None; expected a mapping"),
    ("supports None", lambda: Structure(NODES, BARS, None), "error", "supports is None"),
    ("supports a list", lambda: Structure(NODES, BARS, ["left"]), "error", "supports is .*expected a mapping"),
    ("groups a list", lambda: truss_of(groups=["tie"]), "error", "groups is .*expected a mapping"),
]

EXTERNAL = [
    ("no program", lambda: probe(None, ["k"]), "error", "assemble|program"),
    ("names None", lambda: CallableModel(lambda theta: [1.0], None, 1), "error", "parameter_names"),
    ("no function", lambda: CallableModel(None, ["k"], 1), "error", "function|callable"),
    ("no modes", lambda: CallableModel(lambda theta: [1.0], ["k"], 0), "error", "n_modes is 0"),
    (
        "other number of modes",
        lambda: CallableModel(lambda t: [1.0], ["k"], 2).frequencies([[1.0]]),
        "error",
        "expected",
    ),
    (
        "a program that fails",
        lambda: CallableModel(lambda t: 1 / 0, ["k"], 1).frequencies([[1.0]]),
        "warning",
        "1 of 1 rows.*ZeroDiv",
    ),
    ("no matrices", lambda: probe(lambda t: None, ["k"]), "error", "expected"),
    ("negative n_checks", lambda: probe(lambda t: (t[0] * EYE, EYE), ["k"], n_checks=-1), "error", "n_checks is -1"),
    ("not affine", lambda: probe(lambda t: (t[0] ** 2 * EYE, EYE), ["k"], n_modes=1), "error", "affine"),
    ("no effect", lambda: probe(lambda t: (EYE, EYE), ["k"], n_modes=1), "error", "changes neither"),
    ("no file", lambda: load_affine("no_such_file.npz"), "error", "no_such_file"),
    ("a text file", lambda: load_affine(__file__), "error", "test_bad_input"),
    ("text", lambda: CallableModel(lambda t: "no", ["k"], 1).frequencies([[1.0]]), "error", "expected"),
]

MODAL = [
    ("n_samples negative", lambda: sample(TRUSS, n_samples=-5), "error", "n_samples is -5"),
    ("n_samples a float", lambda: sample(TRUSS, n_samples=10.0), "error", "n_samples is 10.0"),
    ("an unknown method", lambda: sample(TRUSS, method="halton"), "error", "method is 'halton'"),
    ("method None", lambda: sample(TRUSS, method=None), "error", "method is None"),
    ("method a list", lambda: sample(TRUSS, method=["lhs"]), "error", "method is"),
    ("a generator", lambda: sample(TRUSS, random_state=GENERATOR), "error", "random_state is Generator"),
    ("a seed of text", lambda: sample(TRUSS, random_state="7"), "error", "random_state is '7'"),
    ("a negative seed", lambda: sample(TRUSS, random_state=-1), "error", "random_state is -1"),
    ("step zero", lambda: linearise(ONE_MODE, [[1.0]], step=0), "error", "step is 0"),
    ("mac of other rows", lambda: mac(np.ones((3, 1)), EYE), "error", "3 degrees of freedom and phi_b 2"),
    ("mac of a number", lambda: mac(1.0, 1.0), "error", "shape"),
    ("shapes of a program", lambda: shape_jacobian(ONE_MODE, [1.0]), "error", "no method 'local_modes'"),
    ("shapes of None", lambda: shape_jacobian(None, [1.0]), "error", "None"),
    ("shapes at no dof", lambda: shape_jacobian(TRUSS, ONES[0], [99]), "error", "dofs holds 99"),
    ("local modes at no dof", lambda: TRUSS.local_modes(ONES[0]).shapes([99]), "error", "dofs holds 99"),
    ("local modes at dof -1", lambda: TRUSS.local_modes(ONES[0]).shapes([-1]), "error", "dofs holds -1"),
    ("derivatives at no dof", lambda: TRUSS.local_modes(ONES[0]).derivatives([0], [99]), "error", "dofs holds 99"),
    (
        "derivatives of no mode",
        lambda: TRUSS.local_modes(ONES[0]).derivatives([99], [0]),
        "error",
        r"columns holds \[99\]; expected 0 to 9",
    ),
    ("order of None", lambda: share_reordered(None, ONES), "error", "None"),
    ("order in a program", lambda: share_reordered(ONE_MODE, [[1.0]]), "error", "no method 'modes'"),
    ("order of no rows", lambda: share_reordered(TRUSS, np.ones((0, 4))), "error", "theta"),
    (
        "match with too many",
        lambda: match_modes(TRUSS, np.ones((1, 50))),
        "error",
        "50 modes were measured; expected at most",
    ),
    ("match with negative", lambda: match_modes(TRUSS, -NOMINAL), "error", "expected"),
    ("match shapes, no dofs", lambda: match_modes(TRUSS, NOMINAL, shapes=np.ones((2, 6))), "error", "dofs"),
    (
        "match wrong shapes",
        lambda: match_modes(TRUSS, NOMINAL, shapes=np.ones((3, 6)), dofs=[0, 1]),
        "error",
        r"shape \(3, 6\); expected \(2, 6\)",
    ),
    ("n_jobs text", lambda: evaluate(TRUSS, ONES, n_jobs="2"), "error", "n_jobs is '2'"),
    ("n_jobs zero", lambda: evaluate(TRUSS, ONES, n_jobs=0), "error", "n_jobs"),
]

PREPROCESSING = [
    ("no knots", lambda: HingeFeatures(0).fit(HOURLY), "error", "'n_knots'.*Got 0"),
    ("knots as a list", lambda: HingeFeatures([0.0]).fit(HOURLY), "error", r"'n_knots'.*Got \[0.0\]"),
    ("knots of NaN", lambda: HingeFeatures().fit(HOURLY * NAN), "error", "'T1' is NaN in every row; expected"),
    ("hinges of others", lambda: HingeFeatures().fit(T).transform(F), "error", "feature names"),
    ("hinges before fit", lambda: HingeFeatures().transform(T), "error", "not fitted"),
    ("no lags", lambda: LagFeatures(0).fit(HOURLY), "error", "'lags'.*Got 0"),
    ("negative lags", lambda: LagFeatures([0, -1]).fit(HOURLY), "error", r"lags is \[0, -1\]"),
    ("an empty list of lags", lambda: LagFeatures([]).fit(HOURLY), "error", r"lags is \[\]"),
    ("lags of floats", lambda: LagFeatures([0.5]).fit(HOURLY), "error", r"lags is \[0.5\]"),
    ("a lag twice", lambda: LagFeatures([1, 1]).fit(HOURLY), "error", "lags is"),
    ("lags of text", lambda: LagFeatures("24").fit(HOURLY), "error", "'lags'.*Got '24'"),
    ("lags None", lambda: LagFeatures(None).fit(HOURLY), "error", "'lags'.*Got None"),
    ("lags of booleans", lambda: LagFeatures([True]).fit(HOURLY), "error", "lags is"),
    ("lags a boolean", lambda: LagFeatures(True).fit(HOURLY), "error", "lags"),
    ("lags in a table", lambda: LagFeatures([[1, 2]]).fit(HOURLY), "error", "lags is"),
    ("a billion lags", lambda: LagFeatures(10**9).fit(HOURLY), "error", "lags are 1000000000"),
    ("one huge lag", lambda: LagFeatures([10**30]).fit(HOURLY), "error", "lag"),
    ("freq of months", lambda: LagFeatures(2, freq="MS").fit(HOURLY), "error", "freq is 'MS'"),
    ("freq of months, M", lambda: LagFeatures(2, freq="1M").fit(HOURLY), "error", "freq is '1M'"),
    ("freq without unit", lambda: LagFeatures(2, freq="10").fit(HOURLY), "error", "freq is '10'"),
    ("freq negative", lambda: LagFeatures(2, freq="-1h").fit(HOURLY), "error", "freq is '-1h'"),
    ("freq of text", lambda: LagFeatures(2, freq="hourly").fit(HOURLY), "error", "freq is 'hourly'"),
    ("freq a number", lambda: LagFeatures(2, freq=3600).fit(HOURLY), "error", "'freq'.*Got 3600"),
    ("freq of an array", lambda: LagFeatures(2, freq="1h").fit(HOURLY.to_numpy()), "error", "freq"),
    ("freq missing", lambda: LagFeatures(2, freq=pd.NaT).fit(HOURLY), "error", "freq"),
    ("tolerance negative", lambda: LagFeatures(2, tolerance="-1h").fit(HOURLY), "error", "tolerance is '-1h'"),
    ("padding unknown", lambda: LagFeatures(2, padding="zero").fit(HOURLY), "error", "'padding'.*Got 'zero'"),
    ("stamps twice", lambda: LagFeatures(2).fit(indexed(HOURLY.index[[0, *range(49)]])), "error", "1 duplicate stamps"),
    ("a missing stamp", lambda: LagFeatures(2).fit(indexed([pd.NaT, *HOURLY.index[1:]])), "error", "missing stamp"),
    ("stamps as text", lambda: LagFeatures(2).fit(indexed(HOURLY.index.astype(str))), "error", "stamps as text"),
    ("durations", lambda: LagFeatures(2).fit(indexed(HOURLY.index - HOURLY.index[0])), "error", "durations"),
    (
        "stamps on a level",
        lambda: LagFeatures(2).fit(indexed(pd.MultiIndex.from_product([HOURLY.index, ["a"]]))),
        "error",
        "index levels",
    ),
    ("another time zone", lambda: LAGS.transform(HOURLY.tz_localize("UTC")), "error", "time zone UTC; expected None"),
    ("stamps lost", lambda: LAGS.transform(HOURLY.reset_index(drop=True)), "error", "stamp|Datetime"),
    ("one stamp", lambda: LagFeatures(2).fit(HOURLY[:1]), "error", "expected freq"),
    ("no rows", lambda: LagFeatures(2).fit(HOURLY[:0]), "error", "0 sample"),
    ("infinite X", lambda: LagFeatures(2).fit([[1.0], [INF]]), "error", "infinity"),
    ("a vector", lambda: LagFeatures(2).fit([1.0, 2.0]), "error", "2D array"),
    ("other sensors", lambda: LAGS.transform(HOURLY.rename(columns={"T1": "T2"})), "error", "feature names"),
    ("before fit", lambda: LagFeatures(2).transform(HOURLY), "error", "not fitted"),
    ("neighbours none", lambda: KNNGapImputer(n_neighbors=0).fit(F), "error", "'n_neighbors'"),
    ("neighbours text", lambda: KNNGapImputer(n_neighbors="10").fit(F), "error", "'n_neighbors'"),
    ("weights unknown", lambda: KNNGapImputer(weights="near").fit(F), "error", "'weights'"),
    ("imputer, other width", lambda: KNNGapImputer().fit(F).transform(F.iloc[:, :3]), "error", "feature"),
    ("imputer, infinite", lambda: KNNGapImputer().fit([[1.0], [INF]]), "error", "infinity"),
    ("imputer, empty", lambda: KNNGapImputer().fit(F[:0]), "error", "0 sample"),
    ("imputer, -999", lambda: KNNGapImputer().fit(changed(F, 3, 1, -999.0)), "warning", "-999"),
    ("reference of other modes", lambda: BiasAligner([1.0, 2.0]).fit(F), "error", r"shape \(2,\)"),
    ("reference a string", lambda: BiasAligner("model").fit(F), "error", "'reference'"),
    ("reference of NaN", lambda: BiasAligner([NAN] * 6).fit(F), "error", "reference"),
    ("reference a class", lambda: BiasAligner(AffineModel).fit(F), "error", "reference"),
    ("method unknown", lambda: BiasAligner(method="move").fit(F), "error", "'method'"),
    ("a mode of NaN", lambda: BiasAligner().fit(changed(F, slice(None), 0, NAN)), "error", "'f1' is NaN in all 365"),
    ("scaled by zero", lambda: BiasAligner(method="scale").fit([[1.0], [-1.0]]), "error", "mean of mode 'x0' is zero"),
    ("aligned, other modes", lambda: BiasAligner().fit(F).transform(F.iloc[:, :2]), "error", "feature"),
    (
        "back, other modes",
        lambda: BiasAligner().fit(F).inverse_transform(NOMINAL[:, :2]),
        "error",
        "2 features; expected 6",
    ),
    ("before fit", lambda: BiasAligner().transform(F), "error", "not fitted"),
    (
        "a tz-aware index later",
        lambda: LAGS.transform(HOURLY.tz_localize("Europe/Brussels")),
        "error",
        "time zone Europe/Brussels",
    ),
    ("offsets of two zones", lambda: LagFeatures(2).fit(indexed(OFFSETS)), "error", "several offsets from UTC"),
    (
        "an index out of order, twice a stamp",
        lambda: LagFeatures(2).fit(pd.concat([HOURLY[::-1], HOURLY[:1]])),
        "error",
        "1 duplicate stamps",
    ),
    (
        "aligner, -999",
        lambda: BiasAligner().fit(changed(F, 3, 1, -999.0)),
        "warning",
        "1 of 2190 values.*-999 in row 3 of column 'f2'",
    ),
    (
        "imputer, a column of NaN",
        lambda: KNNGapImputer().fit(changed(F, slice(None), 0, NAN)),
        "error",
        r"\['f1'\] are missing in all 365",
    ),
    ("aligner, infinite", lambda: BiasAligner().fit([[1.0], [INF]]), "error", "infinity"),
    ("freq of business days", lambda: LagFeatures(2, freq=pd.offsets.BDay()).fit(HOURLY), "error", "freq is"),
    ("tolerance of months", lambda: LagFeatures(2, tolerance="1M").fit(HOURLY), "error", "tolerance is '1M'"),
]

DETECTION = [
    ("contamination zero", lambda: MahalanobisDetector(0).fit(F), "error", "'contamination'.*Got 0"),
    ("contamination in percent", lambda: MahalanobisDetector(2).fit(F), "error", "'contamination'.*Got 2"),
    ("contamination NaN", lambda: MahalanobisDetector(NAN).fit(F), "error", "'contamination'.*nan"),
    ("contamination text", lambda: MahalanobisDetector("auto").fit(F), "error", "'contamination'.*'auto'"),
    (
        "covariance a class",
        lambda: MahalanobisDetector(covariance=EmpiricalCovariance).fit(F),
        "error",
        "instance of scikit-learn",
    ),
    ("covariance of text", lambda: MahalanobisDetector(covariance="robust").fit(F), "error", "'covariance'"),
    ("a regressor as covariance", lambda: MahalanobisDetector(covariance=Ridge()).fit(F), "error", "'covariance'"),
    ("one row", lambda: MahalanobisDetector().fit(F[:1]), "error", "1 sample"),
    ("fewer rows than modes", lambda: MahalanobisDetector().fit(F[:4]), "error", "expected"),
    ("a column of NaN", lambda: MahalanobisDetector().fit(changed(F, slice(None), 0, NAN)), "error", r"modes \['f1'\]"),
    (
        "a constant mode",
        lambda: MahalanobisDetector().fit(changed(F, slice(None), 0, 7.0)),
        "error",
        "'f1'|constant|rank",
    ),
    ("a mode twice", lambda: MahalanobisDetector().fit(F.join(F["f1"].rename("f7"))), "error", "expected"),
    ("an infinite value", lambda: MahalanobisDetector().fit(changed(F, 0, 0, INF)), "error", "infinity"),
    ("other modes", lambda: DETECTOR.predict(F.iloc[:, ::-1]), "error", "feature names"),
    ("fewer modes", lambda: DETECTOR.damage_index(F.iloc[:, :5]), "error", "feature names"),
    ("no rows", lambda: DETECTOR.predict(F[:0]), "error", "0 sample"),
    (
        "missing modes",
        lambda: DETECTOR.predict(changed(F, slice(7), slice(None), NAN)),
        "warning",
        "7 of 365 rows are not judged",
    ),
    ("all modes lost", lambda: DETECTOR.predict(F * NAN), "warning", "365 of 365 rows"),
    ("threshold of text", lambda: MahalanobisDetector(threshold="paper").fit(F), "error", "'threshold'.*'paper'"),
    ("threshold a number", lambda: MahalanobisDetector(threshold=3.0).fit(F), "error", "'threshold'.*3.0"),
    ("too few records", lambda: MahalanobisDetector().fit(F[:20]), "warning", "20 independent baseline .*at least 49"),
    (
        "no row complete",
        lambda: MahalanobisDetector(covariance=EmpiricalCovariance()).fit(DIAGONAL),
        "error",
        "0 of 365",
    ),
    (
        "one row with a value",
        lambda: MahalanobisDetector().fit(changed(F[:3], [0, 1], slice(None), NAN)),
        "error",
        "1 of 3",
    ),
    ("window None", lambda: WindowedAlarm(None).fit(F), "error", "'window'.*None"),
    ("window zero", lambda: WindowedAlarm(0).fit(F), "error", "'window'.*Got 0"),
    ("window half", lambda: WindowedAlarm(2.5).fit(F), "error", "'window'.*2.5"),
    ("window a Timedelta", lambda: WindowedAlarm(pd.Timedelta("1D")).fit(F), "error", "'window'.*Timedelta"),
    (
        "window of time, array",
        lambda: WindowedAlarm("7D").fit(F.to_numpy()),
        "error",
        "'7D', a time, but the records are not a frame",
    ),
    ("window of time, unsorted", lambda: WindowedAlarm("7D").fit(F[::-1]), "error", "in order of time"),
    ("rule of text", lambda: WindowedAlarm(7, rule="median").fit(F), "error", "'rule'.*'median'"),
    ("m zero", lambda: WindowedAlarm(7, rule="m-of-n", m=0).fit(F), "error", "'m'.*Got 0"),
    ("windows of too few rows", lambda: WindowedAlarm(7).fit(F[:13]), "error", "13 rows.*up to 7 records; expected"),
    ("windows of fewer rows than modes", lambda: WindowedAlarm(2).fit(F[:6]), "error", "singular"),
    ("window of no time", lambda: WindowedAlarm("0h").fit(F), "error", "window is '0h'; expected"),
    ("window of negative time", lambda: WindowedAlarm("-3h").fit(F), "error", "window is '-3h'; expected"),
    ("window of words", lambda: WindowedAlarm("a day").fit(F), "error", "window is 'a day'; expected"),
    ("m above n", lambda: WindowedAlarm(5, rule="m-of-n", m=9).fit(F), "error", "m is 9, but windows hold 5 records"),
    ("windows of few rows", lambda: WindowedAlarm(2).fit(F[:40]), "warning", "independent baseline .*at least 49"),
    ("windows before fit", lambda: WindowedAlarm(7).predict(F), "error", "not fitted"),
    (
        "windows lost",
        lambda: WindowedAlarm(2).fit(F).predict(changed(F, slice(7), slice(None), NAN)),
        "warning",
        "7 of 365",
    ),
    ("windows, other modes", lambda: WindowedAlarm(2).fit(F).predict(F.iloc[:, ::-1]), "error", "feature names"),
    ("windows, a mode twice", lambda: WindowedAlarm(2).fit(F.join(F["f1"].rename("f7"))), "error", "rank 6"),
    ("windows, infinite", lambda: WindowedAlarm(2).fit(changed(F, 0, 0, INF)), "error", "infinity"),
    ("scale of text", lambda: compensator(scale="regional").fit(BOTH), "error", "'scale'.*'regional'"),
    ("scale True", lambda: compensator(scale=True).fit(BOTH), "error", "'scale'.*True"),
    ("scale, constant modes", lambda: compensator(scale="local").fit(T.join(F * 0 + 7.0)), "error", "singular"),
    ("scale, hot", lambda: compensator(scale="local").fit(BOTH).transform((T + 60).join(F)), "warning", "far outside"),
    ("scale, applicability before fit", lambda: compensator(scale="local").applicability(BOTH), "error", "not fitted"),
    ("before fit", lambda: MahalanobisDetector().predict(F), "error", "not fitted"),
    ("frequencies of -999", lambda: MahalanobisDetector().fit(changed(F, 3, 1, -999.0)), "warning", "-999"),
    ("no score_samples", lambda: OutlierDetector(LocalOutlierFactor()).fit(F), "error", "no score_samples"),
    ("a class", lambda: OutlierDetector(IsolationForest).fit(F), "error", "estimator"),
    ("None", lambda: OutlierDetector(None).fit(F), "error", "'estimator'"),
    ("contamination of 0.6", lambda: OutlierDetector(IsolationForest(), 0.6).fit(F), "error", "'contamination'"),
    ("unknown targets", lambda: compensator(targets=["f9"]).fit(BOTH), "error", "'f9'"),
    ("a target twice", lambda: compensator(targets=["f1", "f1"]).fit(BOTH), "error", "targets"),
    ("no targets", lambda: compensator(targets=[]).fit(BOTH), "error", "targets"),
    ("targets a string", lambda: compensator(targets="f1").fit(BOTH), "error", "'targets'"),
    ("targets None", lambda: compensator(targets=None).fit(BOTH), "error", "'targets'"),
    ("targets too high", lambda: compensator(targets=[9]).fit(BOTH), "error", "9"),
    ("targets of floats", lambda: compensator(targets=[1.5]).fit(BOTH), "error", "targets"),
    ("targets booleans", lambda: compensator(targets=[True] * 9).fit(BOTH), "error", "targets"),
    ("all targets", lambda: compensator().fit(F), "error", "targets"),
    ("names for an array", lambda: compensator().fit(BOTH.to_numpy()), "error", "targets"),
    ("a class", lambda: compensator(Ridge).fit(BOTH), "error", "estimator"),
    ("no regressor", lambda: compensator("ridge").fit(BOTH), "error", "'estimator'"),
    ("cv tests twice", lambda: compensator(cv=ShuffleSplit(3)).fit_transform(BOTH), "error", "cv|fold"),
    ("one fold", lambda: compensator(cv=1).fit_transform(BOTH), "error", "n_splits=1|cv"),
    ("cv of text", lambda: compensator(cv="5").fit(BOTH), "error", "'cv'"),
    ("more folds than rows", lambda: compensator(cv=9).fit_transform(BOTH[:5]), "error", "9"),
    ("a target of NaN", lambda: compensator().fit(changed(BOTH, slice(None), 3, NAN)), "error", "'f1'"),
    ("kelvin", lambda: compensator().fit((T + 273.15).join(F)), "warning", "kelvin"),
    ("-999", lambda: compensator().fit(changed(BOTH, 0, 0, -999.0)), "warning", "-999 in 1 of 365"),
    ("kelvin later", lambda: COMPENSATOR.transform((T + 273.15).join(F)), "warning", "above 150: kelvin"),
    ("other columns later", lambda: COMPENSATOR.transform(BOTH.iloc[:, ::-1]), "error", "feature names"),
    ("names twice", lambda: MahalanobisDetector().fit(F.iloc[:, [0, 0]]), "error", "expected each name once"),
    (
        "masked modes",
        lambda: MahalanobisDetector().fit(F.to_numpy()[:, :1]).predict(masked(F)[:, :1]),
        "warning",
        "1 of 365 rows are not judged",
    ),
    ("a table of booleans", lambda: MahalanobisDetector().fit(F > 10), "error", "expected"),
    ("an infinite record", lambda: DETECTOR.predict(changed(F, 0, 0, INF)), "error", "infinity"),
    (
        "a text record",
        lambda: DETECTOR.predict(changed(F.astype(object), 0, 0, "a")),
        "error",
        "numeric|expected numbers",
    ),
]

METRICS = [
    ("damage index a table", lambda: probability_of_false_alarm([[1.0]], 3.0), "error", r"shape \(1, 1\)"),
    ("threshold None", lambda: probability_of_false_alarm([1.0], None), "error", "threshold is None"),
    ("threshold NaN", lambda: probability_of_false_alarm([1.0], NAN), "error", "threshold is nan"),
    ("threshold infinite", lambda: probability_of_detection([1.0], INF), "error", "threshold is inf"),
    ("thresholds", lambda: probability_of_detection([1.0], [1.0, 2.0]), "error", "threshold is"),
    ("time to detection of a table", lambda: time_to_detection([[1.0]], 3.0), "error", r"shape \(1, 1\)"),
    ("time to detection, threshold NaN", lambda: time_to_detection([1.0], NAN), "error", "threshold is nan"),
    ("time to detection, unsorted", lambda: time_to_detection(DATED[::-1], 3.0, DATED.index[0]), "error", "in order"),
    ("onset too late", lambda: time_to_detection([1.0], 3.0, 1), "error", "onset is 1 for 1 records"),
    ("onset next year", lambda: time_to_detection(DATED, 3.0, "2030"), "error", "onset is '2030' for 365 records"),
    ("other lengths", lambda: minimum_detectable_damage([0.1], [0.1, 0.2]), "error", r"\(1,\) and pod \(2,\)"),
    ("pod in percent", lambda: minimum_detectable_damage([0.1, 0.2], [26, 95]), "error", "pod is.*not percent"),
    ("level in percent", lambda: minimum_detectable_damage([0.1], [0.9], 90), "error", "level is 90"),
    ("level NaN", lambda: minimum_detectable_damage([0.1], [0.9], NAN), "error", "level is nan"),
    ("level None", lambda: minimum_detectable_damage([0.1], [0.9], None), "error", "level is None"),
    ("severities of both signs", lambda: minimum_detectable_damage([-0.1, 0.1], [0.5, 1]), "error", "all positive"),
    ("severity zero", lambda: minimum_detectable_damage([0.0, 0.1], [0.5, 1]), "error", "not 0"),
    ("severity twice", lambda: minimum_detectable_damage([0.1, 0.1], [0.5, 1]), "error", "expected different"),
    ("severity in percent", lambda: minimum_detectable_damage([10, 20], [0.5, 1]), "error", "severities are"),
    ("severity NaN", lambda: minimum_detectable_damage([NAN], [0.5]), "error", "severities are"),
    ("severities none", lambda: minimum_detectable_damage([], []), "error", "expected two vectors"),
    ("other width", lambda: mape(F, F.to_numpy()[:, :5]), "error", r"y_pred \(365, 5\)"),
    ("other rows", lambda: mape(F.to_numpy(), F.to_numpy()[1:]), "error", r"\(364, 6\)"),
    ("other index", lambda: mape(F, F.shift(freq="1D")), "error", "different indices"),
    ("other names", lambda: mape(F, F.add_prefix("x")), "error", "expected the same"),
    ("infinite", lambda: mape(F, changed(F, 2, 1, INF)), "error", "row 2 of 'f2' in y_pred is inf"),
    ("frequency zero", lambda: mape(changed(F, 0, 0, 0.0), F), "error", "'f1' in y_true is 0"),
    ("frequency -999", lambda: mape(changed(F, 0, 0, -999.0), F), "error", "'f1' in y_true is -999"),
    ("predicted -999", lambda: mape(F, changed(F, 0, 0, -999.0)), "error", "'f1' in y_pred is -999"),
    ("three axes", lambda: mape(NOMINAL[np.newaxis], NOMINAL[np.newaxis]), "error", "shape"),
    ("few scenarios", lambda: error_table(F, F, scenarios=["a"]), "error", r"scenarios has shape \(1,\)"),
    ("a missing scenario", lambda: error_table(F, F, scenarios=[None] * 365), "error", "scenario of row 0 is missing"),
    ("scenario Average", lambda: error_table(F, F, scenarios=["Average"] * 365), "error", "'Average'"),
    ("scenarios a string", lambda: error_table(F, F, scenarios="all"), "error", "scenarios has shape"),
    ("r2 of other shapes", lambda: complete_r2(F, NOMINAL), "error", "shape"),
    ("r2 infinite", lambda: complete_r2([[1.0], [INF]], [[1.0], [2.0]]), "error", "inf"),
    ("scored, no estimator", lambda: frequency_scorer(None, T, F), "error", "estimator is None; expected"),
    ("scored, a class", lambda: frequency_scorer(Ridge, T, F), "error", "estimator is .*; expected"),
    ("scored, other modes", lambda: frequency_scorer(DummyRegressor().fit(T, F), T, F.iloc[:, :2]), "error", "shape"),
    (
        "a mode predicted twice",
        lambda: mape(F, F.set_axis(["f1", "f1", *MODES[2:]], axis=1)),
        "error",
        "expected the same, each once",
    ),
    ("masked, all", lambda: mape(np.ma.masked_all((2, 2)), np.ones((2, 3))), "error", "shape"),
    (
        "scenarios for other rows",
        lambda: error_table(F, F, scenarios=["a"] * 364),
        "error",
        r"\(364,\); expected \(365,\)",
    ),
    ("a table of severities", lambda: minimum_detectable_damage([[0.1]], [[1.0]]), "error", "expected two vectors"),
    ("pod negative", lambda: minimum_detectable_damage([0.1], [-0.1]), "error", "expected probabilities"),
]

UPDATING = [
    ("no Jacobian", lambda: sensitivity(ONE_MODE), "error", "no method 'jacobian'"),
    ("an unknown method", lambda: sensitivity(TRUSS, method="forward"), "error", "method is 'forward'"),
    ("step of zero", lambda: sensitivity(TRUSS, method="central", step=0), "error", "step is 0"),
    ("step of rounding", lambda: sensitivity(TRUSS, method="central", step=1e-17), "error", "step is 1e-17"),
    ("step of text", lambda: sensitivity(TRUSS, method="central", step="1 %"), "error", "step is '1 %'"),
    ("two rows of theta", lambda: sensitivity(TRUSS, ONES), "error", "3 rows; expected one"),
    ("S an array", lambda: select_parameters(np.ones((6, 4))), "error", "S is a ndarray"),
    ("threshold None", lambda: select_parameters(sensitivity(TRUSS), None), "error", "threshold is None"),
    ("threshold text", lambda: select_parameters(sensitivity(TRUSS), "0.1"), "error", "threshold is '0.1'"),
    ("threshold NaN", lambda: select_parameters(sensitivity(TRUSS), NAN), "error", "threshold is nan"),
    ("S of text", lambda: select_parameters(pd.DataFrame({"top": ["a"]})), "error", "S"),
    ("noise None", lambda: identifiability(TRUSS, noise=None), "error", "noise"),
    (
        "noise for some modes",
        lambda: identifiability(TRUSS, noise=[0, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]),
        "error",
        "noise is",
    ),
    ("dofs without noise", lambda: identifiability(TRUSS, noise=0.01, dofs=[0]), "error", "shape_noise"),
    (
        "shape noise text",
        lambda: identifiability(TRUSS, noise=0.01, dofs=[0, 1], shape_noise="1 %"),
        "error",
        "shape_noise is",
    ),
    ("unknown dofs", lambda: identifiability(TRUSS, noise=0.01, dofs=[99], shape_noise=0.1), "error", "dofs holds 99"),
    ("not square", lambda: cramer_rao([[1.0, 0.0]]), "error", r"shape \(1, 2\)"),
    ("a number", lambda: cramer_rao(1.0), "error", r"shape \(\)"),
    ("not symmetric", lambda: cramer_rao([[1.0, 0.5], [0.0, 1.0]]), "error", "symmetric"),
    ("negative information", lambda: cramer_rao([[-1.0]]), "error", "negative"),
    ("bounds without one", lambda: updater(bounds=[[1.1, 1.3]] * 4).fit(NOMINAL), "error", "contain 1"),
    ("bounds of other names", lambda: updater(bounds={"E": 0.3}).fit(NOMINAL), "error", r"\['E'\] are unknown"),
    ("bounds text", lambda: updater(bounds="wide").fit(NOMINAL), "error", "'bounds'"),
    ("bounds in percent", lambda: updater(bounds=30).fit(NOMINAL), "error", "half-width between 0 and 1"),
    ("starts none", lambda: updater(n_starts=0).fit(NOMINAL), "error", "'n_starts'"),
    ("method unknown", lambda: updater(method="newton").fit(NOMINAL), "error", "'method'"),
    ("prior zero", lambda: updater(prior=0).fit(NOMINAL), "error", "'prior'"),
    ("prior of other width", lambda: updater(prior=[0.1, 0.1]).fit(NOMINAL), "error", "prior is"),
    ("prior of text", lambda: updater(prior=["a"] * 4).fit(NOMINAL), "error", "prior is"),
    ("n_jobs text", lambda: updater(n_jobs="2").fit(NOMINAL), "error", "'n_jobs'"),
    ("n_jobs zero", lambda: updater(n_jobs=0).fit(NOMINAL), "error", "n_jobs"),
    ("a generator", lambda: updater(random_state=GENERATOR).fit(NOMINAL), "error", "'random_state'"),
    ("F of other modes", lambda: updater().fit(NOMINAL[:, :5]), "error", "5 columns; expected the 6 modes"),
    ("F negative", lambda: updater().fit(-NOMINAL), "error", "expected Hz above 0"),
    ("F -999", lambda: updater().fit(changed(F, 2, 0, -999.0)), "error", "'f1' of record 2 is -999"),
    ("F NaN", lambda: updater().fit(NOMINAL * NAN), "error", "F is NaN in all"),
    ("F infinite", lambda: updater().fit(NOMINAL * INF), "error", "inf"),
    ("F in rad/s", lambda: updater().fit(NOMINAL * 2 * np.pi), "warning", "rad/s"),
    ("F far off", lambda: updater().fit(NOMINAL * 1.5), "warning", "misses.*f6.*more than 15 %: expected"),
    ("frequency_std zero", lambda: updater().fit(NOMINAL, frequency_std=0), "error", "frequency_std of 'f1' is 0"),
    ("frequency_std width", lambda: updater().fit(NOMINAL, frequency_std=[1, 1]), "error", "frequency_std has shape"),
    ("shapes without dofs", lambda: updater().fit(NOMINAL, shapes=np.ones((2, 6))), "error", "without dofs"),
    ("dofs without shapes", lambda: updater().fit(NOMINAL, dofs=[0]), "error", "without shapes"),
    ("shapes transposed", lambda: updater().fit(NOMINAL, shapes=np.ones((6, 2)), dofs=[0, 1]), "error", r"\(6, 2\)"),
    (
        "shapes of zeros",
        lambda: updater().fit(NOMINAL, shapes=np.zeros((2, 6)), dofs=[0, 1]),
        "error",
        "zero throughout",
    ),
    (
        "shapes of text",
        lambda: updater().fit(NOMINAL, shapes=[["a"] * 6] * 2, dofs=[0, 1]),
        "error",
        "shapes is .*expected numbers",
    ),
    ("weight without shapes", lambda: updater(shape_weight=1.0).fit(NOMINAL), "error", "no shapes were given"),
    ("weight NaN", lambda: updater(shape_weight=NAN).fit(NOMINAL), "error", "shape_weight"),
    ("one mode, four parameters", lambda: updater(make_truss(1)).fit([[7.4]]), "warning", "4 parameters.*1 residual"),
    (
        "two modes swapped",
        lambda: updater().fit(NOMINAL[:, [0, 1, 3, 2, 4, 5]]),
        "warning",
        "expected frequencies in Hz, in the order",
    ),
    (
        "an optimum at the bounds",
        lambda: updater(bounds=0.1).fit(NOMINAL * 1.1),
        "warning",
        "lies at the bounds of 'bottom'",
    ),
    (
        "noise that explains little",
        lambda: updater(bounds=0.1).fit(NOMINAL * 1.04 + 1, frequency_std=1e-4),
        "warning",
        "standard deviations of frequency_std",
    ),
    ("prior of other names", lambda: updater(prior={"E": 0.1}).fit(NOMINAL), "error", r"prior: \['E'\] are unknown"),
    ("F of three axes", lambda: updater().fit(NOMINAL[np.newaxis]), "error", "dim 3|3 dim"),
    (
        "shapes of NaN",
        lambda: updater().fit(NOMINAL, shapes=[[NAN] * 6, [1] * 6], dofs=[0, 1]),
        "error",
        "is NaN in row 0 but not in all",
    ),
    (
        "complex shapes",
        lambda: updater().fit(NOMINAL, shapes=SHAPES * 1j, dofs=[0, 4, 8]),
        "warning",
        "shapes are complex",
    ),
    (
        "unknown dofs",
        lambda: updater().fit(NOMINAL, shapes=SHAPES, dofs=[0, 4, 99]),
        "error",
        "dofs holds 99; expected 0 to 22",
    ),
    (
        "shapes of a program",
        lambda: ModelUpdater(ONE_MODE).fit([[1.0]], shapes=[[1.0]], dofs=[0]),
        "error",
        "has no 'local_modes'",
    ),
    ("a masked theta", lambda: sensitivity(TRUSS, np.ma.masked_equal([1, 1, 1, 2], 2)), "error", "'vertical' is nan"),
    ("theta of NaN", lambda: identifiability(TRUSS, [1, 1, 1, NAN], noise=0.01), "error", "'vertical' is nan"),
    ("noise in percent", lambda: identifiability(TRUSS, noise=1), "error", "noise is 1"),
]

DATASETS = [
    ("no modes", lambda: make_truss(0), "error", "n_modes is 0"),
    ("too many modes", lambda: make_truss(24), "error", "n_modes is 24"),
    ("modes None", lambda: make_truss(None), "error", "n_modes is None"),
    ("an unknown parameter", lambda: make_kw51(["cables"]), "error", "cables"),
    ("years negative", lambda: make_truss_campaign(-1), "error", "n_years is -1"),
    ("years a float", lambda: make_truss_campaign(1.5), "error", "n_years is 1.5"),
    ("samples zero", lambda: make_truss_campaign(samples_per_year=0), "error", "samples_per_year is 0"),
    ("samples text", lambda: make_truss_campaign(samples_per_day="1"), "error", "samples_per_day is '1'"),
    ("noise None", lambda: make_truss_campaign(noise=None), "error", "noise"),
    ("damage unknown", lambda: make_truss_campaign(damage={"deck": 0.1}), "error", "'deck'"),
    ("damage in percent", lambda: make_truss_campaign(damage={"top": 30}), "error", "30"),
    ("damage a number", lambda: make_truss_campaign(damage=0.3), "error", "damage is 0.3; expected"),
    ("a generator", lambda: make_truss_campaign(random_state=GENERATOR), "error", "random_state is Generator"),
    ("kelvin", lambda: steel_modulus([293.15, 300.0]), "error", "kelvin|temperature"),
    ("text", lambda: steel_modulus("cold"), "error", "temperature is 'cold'; expected numbers"),
    ("no file", lambda: load_z24("no_such_file.csv"), "error", "no_such_file.csv is not a file"),
    ("a folder", lambda: load_z24(Path(__file__).parent), "error", "is not a file"),
    ("not that data", lambda: load_z24(__file__), "error", "header"),
    ("parameters a number", lambda: make_kw51(3), "error", "parameters"),
    ("parameters none", lambda: make_kw51([]), "error", "parameters"),
    ("modes of text", lambda: make_z24("4"), "error", "n_modes is '4'"),
    ("an unknown group", lambda: kw51_structure().assemble(["cables"]), "error", "unknown group 'cables'"),
    ("noise in percent", lambda: make_truss_campaign(noise=1), "error", "noise is 1"),
]

SURROGATE = [
    ("scored on other modes", lambda: CHAIN.score(T, F.iloc[:, :5]), "error", "5 columns; expected|shape"),
    ("a frequency of -999", lambda: chain().fit(T, changed(F, 0, 0, -999.0)), "error", "-999"),
    ("no model, no theta", lambda: InverseSurrogate().fit(), "error", "expected theta"),
    ("regressor of text", lambda: InverseSurrogate(TRUSS, "mlp").fit(), "error", "'regressor'"),
    ("regressor a class", lambda: InverseSurrogate(TRUSS, Ridge).fit(), "error", "instance of scikit-learn"),
    ("bounds in percent", lambda: InverseSurrogate(TRUSS, bounds=30).fit(), "error", "half-width between 0 and 1"),
    ("bounds None", lambda: InverseSurrogate(TRUSS, bounds=None).fit(), "error", "'bounds'"),
    (
        "bounds of other names",
        lambda: InverseSurrogate(TRUSS, bounds={"E": 0.2}).fit(),
        "error",
        r"\['E'\] are unknown",
    ),
    ("one sample", lambda: InverseSurrogate(TRUSS, n_samples=1).fit(), "error", "'n_samples'"),
    ("noise negative", lambda: InverseSurrogate(TRUSS, noise=-0.1).fit(), "error", "'noise'"),
    ("noise of other modes", lambda: InverseSurrogate(TRUSS, noise=[0.1, 0.1], n_samples=10).fit(), "error", "noise"),
    ("n_jobs text", lambda: InverseSurrogate(TRUSS, n_jobs="2").fit(), "error", "'n_jobs'"),
    ("a generator", lambda: InverseSurrogate(TRUSS, random_state=GENERATOR).fit(), "error", "random_state"),
    ("memory a number", lambda: InverseSurrogate(TRUSS, memory=3).fit(), "error", "'memory'"),
    ("other modes", lambda: INVERSE.transform(NOMINAL[:, :5]), "error", "5 features"),
    ("frequencies negative", lambda: INVERSE.transform(-NOMINAL), "error", "expected"),
    ("frequencies in rad/s", lambda: INVERSE.transform(F * 2 * np.pi), "warning", "36[45] of 365 rows.*far outside"),
    ("before fit", lambda: InverseSurrogate(TRUSS).transform(F), "error", "not fitted"),
    ("inverted before fit", lambda: InverseSurrogate(TRUSS).invert(F), "error", "not fitted"),
    ("negative steps", lambda: InverseSurrogate(TRUSS, refine=-1).fit(), "error", "'refine'"),
    ("steps as text", lambda: InverseSurrogate(TRUSS, refine="yes").fit(), "error", "'refine'"),
    ("half a step", lambda: InverseSurrogate(TRUSS, refine=0.5).fit(), "error", "'refine'"),
    ("steps without a model", lambda: InverseSurrogate(refine=5).fit(ONES, ONES), "error", "refine is 5 without a mod"),
    (
        "inverted without steps",
        lambda: InverseSurrogate(TRUSS, Ridge(), refine=0, **SEEDED).fit().invert(F.to_numpy()),
        "error",
        "refine is 0, which means no steps",
    ),
    ("inverted frequency of zero", lambda: INVERSE.invert(F.to_numpy() * 0), "error", "'f1' is 0; expected positive"),
    ("inverted too few modes", lambda: INVERSE.invert(F.to_numpy()[:, :5]), "error", "5 features"),
    (
        "standard deviations that the regressor has not",
        lambda: InverseSurrogate(TRUSS, Ridge(), refine=0, **SEEDED).fit().predict(F.to_numpy(), return_std=True),
        "error",
        "gives no standard deviations",
    ),
    ("prior of zero", lambda: InverseSurrogate(TRUSS, prior=0, n_samples=10).fit(), "error", "'prior'"),
    ("prior as text", lambda: InverseSurrogate(TRUSS, prior="wide", **SEEDED).fit(), "error", "prior"),
    (
        "prior of two parameters",
        lambda: InverseSurrogate(TRUSS, Ridge(), prior=[0.1, 0.1], **SEEDED).fit(),
        "error",
        r"prior is \[0.1 0.1\]; expected",
    ),
    (
        "prior of other names",
        lambda: InverseSurrogate(TRUSS, Ridge(), prior={"E": 0.1}, **SEEDED).fit(),
        "error",
        r"prior: \['E'\] are unknown",
    ),
    ("theta of other width", lambda: INVERSE.inverse_transform([[1.0, 1.0]]), "error", r"shape \(1, 2\)"),
    ("fewer theta than F", lambda: InverseSurrogate().fit(F.to_numpy(), ONES), "error", "365|inconsistent"),
    ("mapper, text", lambda: TemperatureMapper("ridge").fit(T, np.ones((365, 4))), "error", "'regressor'"),
    (
        "mapper, a class",
        lambda: TemperatureMapper(Ridge).fit(T, np.ones((365, 4))),
        "error",
        "instance of scikit-learn",
    ),
    ("mapper, few rows", lambda: TemperatureMapper(Ridge()).fit(T, ONES), "error", "365|inconsistent"),
    ("mapper, all NaN", lambda: TemperatureMapper(Ridge()).fit(T * NAN, np.ones((365, 4))), "error", "NaN|complete"),
    (
        "mapper, other sensors",
        lambda: TemperatureMapper(Ridge()).fit(T, YEAR.frequencies).predict(F),
        "error",
        "feature names",
    ),
    (
        "weights of other rows",
        lambda: TemperatureMapper(Ridge()).fit(T, np.ones((365, 4)), sample_weight=[1.0, 2.0]),
        "error",
        r"sample_weight has shape \(2,\); expected \(365,\)",
    ),
    ("a network of text", lambda: paper_network("big"), "error", "'big'"),
    ("other lengths", lambda: chain().fit(T, F[1:]), "error", "365 rows and frequencies 364"),
    ("other index", lambda: chain().fit(T, F.shift(freq="1D")), "error", "different indices"),
    ("other number of modes", lambda: chain().fit(T, F.iloc[:, :5]), "error", "5 columns; expected the 6 modes"),
    ("a sensor of NaN", lambda: chain().fit(changed(T, slice(None), 0, NAN), F), "error", "'T1' is NaN in all"),
    ("a constant sensor", lambda: chain().fit(changed(T, slice(None), 0, 5.0), F), "error", "'T1' is constant"),
    ("a mode of NaN", lambda: chain().fit(T, changed(F, slice(None), 1, NAN)), "error", "'f2' is NaN in all"),
    ("infinite", lambda: chain().fit(changed(T, 0, 0, INF), F), "error", "infinity"),
    ("one row", lambda: chain().fit(T[:1], F[:1]), "error", "1 sample"),
    ("rad/s", lambda: chain().fit(T, F * 2 * np.pi), "warning", "rad/s"),
    ("kelvin", lambda: CHAIN.predict(T + 273.15), "warning", "kelvin|far outside"),
    ("Fahrenheit", lambda: CHAIN.predict(T * 1.8 + 32), "warning", "rows have temperatures far outside"),
    ("temperature of -999", lambda: chain().fit(changed(T, 0, 0, -999.0), F), "error", "-999"),
    ("inverse of text", lambda: chain(inverse="mlp").fit(T, F), "error", "'inverse'"),
    ("mapper a class", lambda: chain(mapper=TemperatureMapper).fit(T, F), "error", "mapper|class"),
    ("aligner of text", lambda: chain(aligner="shift").fit(T, F), "error", "'aligner'"),
    ("imputer of text", lambda: chain(imputer="knn").fit(T, F), "error", "'imputer'"),
    ("reduce of 2", lambda: chain(reduce=2).fit(T, F), "error", "'reduce'"),
    ("a generator", lambda: chain(random_state=GENERATOR).fit(T, F), "error", "random_state"),
    ("before fit", lambda: DataInformedFEM(TRUSS).predict(T), "error", "not fitted"),
    ("other sensors", lambda: CHAIN.predict(T.iloc[:, :2]), "error", "feature names"),
    ("text later", lambda: CHAIN.predict(changed(T.astype(object), 0, 0, "cold")), "error", "'cold'.*expected numbers"),
    (
        "confidence in percent",
        lambda: CHAIN.predict_interval(T, 90),
        "error",
        "confidence is 90; expected a probability",
    ),
    ("confidence of one", lambda: CHAIN.predict_interval(T, 1.0), "error", "confidence is 1.0; expected"),
    ("confidence of text", lambda: CHAIN.predict_interval(T, "high"), "error", "confidence is 'high'; expected"),
    ("confidence NaN", lambda: CHAIN.predict_interval(T, NAN), "error", "confidence is nan; expected"),
    ("confidence a boolean", lambda: CHAIN.predict_interval(T, True), "error", "confidence is True; expected"),
    ("two confidences", lambda: CHAIN.predict_interval(T, [0.5, 0.9]), "error", "confidence is .*; expected"),
    ("interval before fit", lambda: chain().predict_interval(T), "error", "not fitted"),
    ("residuals before fit", lambda: chain().residuals_, "error", "not fitted"),
    ("interval of other sensors", lambda: CHAIN.predict_interval(T.iloc[:, :2]), "error", "feature names"),
    ("fitted noise misspelt", lambda: CHAIN.simulate(T, noise="fit"), "error", "noise is 'fit'; expected \"fitted\""),
    ("unknown damage", lambda: CHAIN.simulate(T, damage={"deck": 0.1}), "error", "'deck'"),
    ("damage in percent", lambda: CHAIN.simulate(T, damage={"top": 30}), "error", "30"),
    (
        "no damage there",
        lambda: chain(ONE_MODE).fit(T, F[["f1"]]).simulate(T, damage={"k": 0.1}),
        "error",
        "no method 'damaged'",
    ),
    (
        "a sensor twice",
        lambda: chain().fit(T.iloc[:, [0, 0, 1]], F),
        "error",
        r"\['T1', 'T1', 'T2'\]; expected each name once",
    ),
    ("1.5 times too high", lambda: chain().fit(T, F * 1.5), "warning", r"differ from the model's.*\+5\d %"),
    (
        "two modes swapped",
        lambda: chain().fit(T, F.iloc[:, [0, 1, 3, 2, 4, 5]]),
        "warning",
        r"look like other modes.*0, 1, 3, 2",
    ),
    ("kelvin in fit", lambda: chain().fit(T + 273.15, F), "error", "kelvin"),
    (
        "fewer rows than parameters ask",
        lambda: chain().fit(T[:20], F[:20]),
        "warning",
        "20 complete rows train 4 parameters",
    ),
    ("scored on other rows", lambda: CHAIN.score(T, F[1:]), "error", "365 rows and .* 364"),
    ("scored on another index", lambda: CHAIN.score(T, F.shift(freq="1D")), "error", "different indices"),
    ("scored without F", lambda: CHAIN.score(T, None), "error", "None|y"),
    ("noise as text", lambda: CHAIN.simulate(T, noise=[0.01]), "error", "noise is"),
    ("applicability of others", lambda: CHAIN.applicability(F), "error", "feature names"),
    ("parameters of no rows", lambda: CHAIN.predict(T[:0]), "error", "0 sample"),
    ("predicted kelvin", lambda: CHAIN.predict_parameters(T + 273.15), "warning", "365 of 365 rows have temperatures"),
    (
        "simulated with severities in percent",
        lambda: CHAIN.simulate(T, damage={"top": 10}),
        "error",
        "severity 10; expected",
    ),
    ("seed of text", lambda: CHAIN.simulate(T, noise=0.01, random_state="7"), "error", "random_state is '7'"),
    ("noise in percent", lambda: InverseSurrogate(TRUSS, Ridge(), noise=1, n_samples=10).fit(), "error", "noise is 1"),
    ("memory a file", lambda: InverseSurrogate(TRUSS, Ridge(), memory=__file__, n_samples=10).fit(), "error", "memory"),
    ("noise in percent", lambda: CHAIN.simulate(T, noise=5), "error", "noise is 5"),
    ("noise of text", lambda: CHAIN.simulate(T, noise="much"), "error", "noise.*expected"),
]

ROWS = {
    "theta": THETA,
    "bounds": BOUNDS,
    "noise": NOISE,
    "affine": AFFINE,
    "structure": STRUCTURE,
    "external": EXTERNAL,
    "modal": MODAL,
    "preprocessing": PREPROCESSING,
    "detection": DETECTION,
    "metrics": METRICS,
    "updating": UPDATING,
    "datasets": DATASETS,
    "surrogate": SURROGATE,
}
EXPECTED_ERRORS = (ValueError, TypeError, FileNotFoundError, RuntimeError)
CHECKED_BY = tuple(str(Path(package.__file__).parent) for package in (skthermo, sklearn))
FROM_THE_DEPTHS = re.compile(
    "broadcast|setting an array element|object has no attribute|out of bounds|not supported between"
    "|is not (subscriptable|iterable|callable)|has no len|^could not convert|unsupported operand|ufunc|unhashable"
    "|cannot be interpreted|must be real number|not aligned|argument must be a string or a real number"
)
"""Messages of numpy, SciPy, pandas and Python about what a wrong input led to."""


def complaint(call, kind, message):
    """What is wrong with the answer to a call with bad input; None if it is a clear error or one warning."""
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        try:
            call()
        except EXPECTED_ERRORS as error:
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
    if {(warning.category, warning.filename) for warning in given} != {(UserWarning, __file__)}:
        return f"warnings are {[str(warning) for warning in given]}, expected UserWarning at the user's line"
    said = sum(bool(re.search(message, str(warning.message))) for warning in given)
    return None if said == 1 else f"{said} warnings say {message!r}: {[str(warning.message) for warning in given]}"


def assert_no_complaints(rows):
    complaints = [(cause, complaint(call, kind, message)) for cause, call, kind, message in rows]
    wrong = [f"{cause}: {text}" for cause, text in complaints if text]
    assert not wrong, "\n" + "\n".join(wrong)


@pytest.mark.parametrize("room", ROWS)
def test_bad_input_is_named(room):
    assert_no_complaints(ROWS[room])


NO_NUMBERS = {  # a value, and what the message says
    "text": ([["cold"]], "expected numbers|expected .*, a number|numeric"),
    "text of numbers": ([["1.0"]], "text|expected .*, a number"),
    "booleans": (np.array([[True]]), "booleans|expected .*, a (number|weight)"),
    "bytes": (np.array([[b"1"]]), "bytes"),
    "times": (np.array([["2020-01-01"]], dtype="datetime64[D]"), "times"),
    "objects that are true": (np.array([[True]], dtype=object), "booleans"),
    "nothing": (None, "None|Expected 2D array"),
    "complex numbers": ([[1j]], "[Cc]omplex"),
    "a sparse matrix": (scipy.sparse.csr_array(np.ones((1, 1))), "[Ss]parse"),
}
ARRAYS = [  # what the message names, a call that takes an array of numbers, and what the call may take
    ("theta", lambda bad: check_theta(bad, NAMES), ()),
    ("theta", lambda bad: TRUSS.frequencies(bad), ()),
    ("theta", lambda bad: TRUSS.jacobian(bad), ()),
    ("theta", lambda bad: evaluate(TRUSS, bad), ()),
    ("theta", lambda bad: linearise(TRUSS, bad), ()),
    ("theta", lambda bad: shape_jacobian(TRUSS, bad), ()),
    ("theta", lambda bad: share_reordered(TRUSS, bad), ()),
    ("theta", lambda bad: sensitivity(TRUSS, bad), ("nothing",)),
    ("theta", lambda bad: identifiability(TRUSS, bad, noise=0.01), ("nothing",)),
    ("theta", lambda bad: INVERSE.inverse_transform(bad), ()),
    ("bounds", lambda bad: check_bounds(bad, NAMES), ()),
    ("prior", lambda bad: check_prior(bad, NAMES), ()),
    ("noise", lambda bad: check_noise(bad, 6), ()),
    ("frequencies", lambda bad: add_noise(bad, 0.01), ()),
    ("frequencies", lambda bad: match_modes(TRUSS, bad), ()),
    ("phi_a", lambda bad: mac(bad, EYE[:1]), ("complex numbers",)),
    ("stiffness", lambda bad: affine(bad), ("a sparse matrix",)),
    ("mass", lambda bad: affine([[1.0]], bad), ("a sparse matrix",)),
    ("reference", lambda bad: BiasAligner(bad).fit(F), ("nothing",)),
    ("damage_index", lambda bad: probability_of_detection(bad, 3.0), ()),
    ("damage_index", lambda bad: probability_of_false_alarm(bad, 3.0), ()),
    ("damage_index", lambda bad: time_to_detection(bad, 3.0), ()),
    ("severities", lambda bad: minimum_detectable_damage(bad, [1.0]), ()),
    ("pod", lambda bad: minimum_detectable_damage([0.1], bad), ()),
    ("y_true", lambda bad: mape(bad, F), ()),
    ("y_pred", lambda bad: mape(F, bad), ()),
    ("y_pred", lambda bad: error_table(F, bad), ()),
    ("y_pred", lambda bad: complete_r2(F, bad), ()),
    ("information", lambda bad: cramer_rao(bad), ()),
    ("F", lambda bad: updater().fit(bad), ()),
    ("frequency_std", lambda bad: updater().fit(NOMINAL, frequency_std=bad), ("nothing",)),
    ("temperature", lambda bad: steel_modulus(bad), ()),
    ("", lambda bad: LagFeatures(2).fit(bad), ()),
    ("", lambda bad: HingeFeatures().fit(bad), ()),
    ("", lambda bad: KNNGapImputer().fit(bad), ()),
    ("", lambda bad: BiasAligner().fit(bad), ()),
    ("", lambda bad: MahalanobisDetector().fit(bad), ()),
    ("", lambda bad: DETECTOR.predict(bad), ()),
    ("", lambda bad: WindowedAlarm(2).fit(bad), ()),
    ("", lambda bad: OutlierDetector(IsolationForest()).fit(bad), ()),
    ("", lambda bad: compensator(targets=[0]).fit(bad), ()),
    ("", lambda bad: INVERSE.transform(bad), ()),
    ("", lambda bad: InverseSurrogate().fit(bad, [[1.0]]), ()),
    ("", lambda bad: InverseSurrogate().fit([[1.0]], bad), ()),
    ("", lambda bad: TemperatureMapper(LINEAR).fit(bad, [[1.0]]), ()),
    ("", lambda bad: TemperatureMapper(LINEAR).fit([[1.0]], bad), ()),
    ("sample_weight", lambda bad: HingeFeatures().fit(T, sample_weight=bad), ("nothing",)),
    ("sample_weight", lambda bad: chain().fit(T, F, sample_weight=bad), ("nothing",)),
    ("", lambda bad: chain().fit(bad, F), ()),
    ("", lambda bad: chain().fit(T, bad), ()),
    ("", lambda bad: CHAIN.predict(bad), ()),
    ("", lambda bad: CHAIN.simulate(bad), ()),
]


@pytest.mark.parametrize("cause", NO_NUMBERS)
def test_what_is_no_array_of_numbers_is_named(cause):
    value, message = NO_NUMBERS[cause]
    assert_no_complaints(
        (f"{name or 'X or y'} of call {i}", lambda call=call: call(value), "error", rf"(?s){name}.*({message})")
        for i, (name, call, takes) in enumerate(ARRAYS)
        if cause not in takes
    )


TAKES_A_MODEL = [
    lambda bad: evaluate(bad, ONES),
    lambda bad: sample(bad),
    lambda bad: linearise(bad, ONES),
    lambda bad: match_modes(bad, NOMINAL),
    lambda bad: share_reordered(bad, ONES),
    lambda bad: sensitivity(bad),
    lambda bad: identifiability(bad, noise=0.01),
    lambda bad: updater(bad).fit(NOMINAL),
    lambda bad: InverseSurrogate(bad).fit(F.to_numpy(), None),
    lambda bad: chain(bad).fit(T, F),
]


@pytest.mark.parametrize("value", [None, "truss", AffineModel, LINEAR], ids=str)
def test_what_is_no_model_is_named(value):
    message = r"model is .*; expected|'model' parameter .* must be|None; expected theta"
    assert_no_complaints(
        (f"call {i}", lambda call=call: call(value), "error", message) for i, call in enumerate(TAKES_A_MODEL)
    )


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


FLAGS = {  # a flag, and a call that takes it
    "track": lambda bad: affine(STIFF, track=bad),
    "follow": lambda bad: TRUSS.local_modes(ONES[:1], follow=bad),
    "vectorized": lambda bad: CallableModel(lambda theta: [1.0], ["k"], 1, vectorized=bad),
    "relative": lambda bad: linearise(TRUSS, ONES, relative=bad),
    "progress": lambda bad: evaluate(TRUSS, ONES, progress=bad),
    "lumped": lambda bad: truss_of(BARS | {"tie": Bar("left", "right", **STEEL, lumped=bad)}),
    "return_std": lambda bad: CHAIN.predict(T, return_std=bad),
    "return_number": lambda bad: CHAIN.expected_residuals(T, return_number=bad),
    "log": lambda bad: pod_curve([0.1, 0.2], [1, 9], [10, 10], log=bad),
    "gaps": lambda bad: make_kw51_campaign(n_hours=24, gaps=bad),
    "updated": lambda bad: make_kw51(updated=bad),
    "narrow_bounds": lambda bad: InverseSurrogate(TRUSS, narrow_bounds=bad).fit(),
}


@pytest.mark.parametrize("flag", FLAGS)
def test_flags_take_booleans_only(flag):
    message = rf"(?s){flag}.*(expected True or False|must be an instance of 'bool')"
    values = (1, 0, "yes", NAN) if flag == "progress" else (1, 0, "yes", None, NAN)
    assert_no_complaints((repr(value), lambda value=value: FLAGS[flag](value), "error", message) for value in values)


NOT_TRUE = {  # a number, and a call that takes it
    "n_modes": lambda bad: make_truss(bad),
    "n_samples": lambda bad: sample(TRUSS, 0.2, bad),
    "'n_samples'": lambda bad: InverseSurrogate(TRUSS, n_samples=bad).fit(),
    "'n_knots'": lambda bad: HingeFeatures(bad).fit(T),
    "'lags'": lambda bad: LagFeatures(bad).fit(T),
    "n_neighbors": lambda bad: KNNGapImputer(n_neighbors=bad).fit(F),
    "'window'": lambda bad: WindowedAlarm(bad).fit(F),
    "'refine'": lambda bad: InverseSurrogate(TRUSS, refine=bad).fit(),
    "'random_state'": lambda bad: InverseSurrogate(TRUSS, random_state=bad).fit(),
    "random_state": lambda bad: add_noise(F, 0.01, random_state=bad),
    "severity": lambda bad: TRUSS.damaged({"top": bad}),
    "severity of 'top'": lambda bad: Scenario("a", {"top": bad}),
    "noise": lambda bad: CHAIN.simulate(T, noise=bad),
    "bounds": lambda bad: sample(TRUSS, bad),
    "threshold": lambda bad: probability_of_detection([1.0], bad),
    "E": lambda bad: truss_of(BARS | {"tie": Bar("left", "right", bad, 1.0)}),
    "dofs": lambda bad: check_dofs([2, bad], 23),
    "noise of a mode": lambda bad: check_noise([0.01, bad], 2, what="noise of a mode"),
}


@pytest.mark.parametrize("what", NOT_TRUE)
def test_true_is_no_number(what):
    assert_no_complaints([("True", lambda: NOT_TRUE[what](True), "error", f"(?s){what}.*(expected|must be|Got)")])


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


ONE_TEXT = {  # a call with one text where several values are expected
    "groups of a sweep": lambda: sweep(TRUSS, groups="topbottom"),
    "severities of a sweep": lambda: sweep(TRUSS, ".1"),
    "damaged groups": lambda: identify_damage(CHAIN, T, F, groups="topbottom"),
    "matrices": lambda: AffineModel(STIFF, EYE, groups="k"),
    "modes": lambda: TRUSS.with_modes("01"),
    "dofs": lambda: check_dofs("01", 23),
    "lags": lambda: LagFeatures("24").fit(T),
    "scenarios": lambda: DetectabilityStudy(CHAIN, MahalanobisDetector(), "healthy").run(T),
}


@pytest.mark.parametrize("what", ONE_TEXT)
def test_a_text_is_not_read_letter_by_letter(what):
    assert_no_complaints([(what, ONE_TEXT[what], "error", "[Ee]xpected|must be")])


ONSETS = {
    "NaT": pd.NaT,
    "NaN": NAN,
    "a duration": pd.Timedelta("1D"),
    "half a record": 1.5,
    "True": True,
    "after the end": 10**6,
    "a text": "soon",
}


@pytest.mark.parametrize("cause", ONSETS)
def test_what_is_no_moment_is_refused(cause):
    bad = ONSETS[cause]
    assert_no_complaints(
        (what, call, "error", "(?s)(onset|end).*expected")
        for what, call in {
            "onset": lambda: ProgressiveDamage("a", {"top": 0.1}, bad).changes(T),
            "end": lambda: ProgressiveDamage("a", {"top": 0.1}, 2, bad).changes(T),
            "detection": lambda: time_to_detection(DATED, 3.0, bad),
        }.items()
    )


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
