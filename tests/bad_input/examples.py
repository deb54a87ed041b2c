"""A valid call of every public function, class and method, with bad values of its arguments; and calls in which several
arguments do not go together."""

import inspect
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import scipy.sparse
from sklearn.covariance import EmpiricalCovariance
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import Ridge
from sklearn.model_selection import ShuffleSplit
from sklearn.neighbors import LocalOutlierFactor

from skthermo import datasets, detection, fem, metrics, plotting, preprocessing, studies, surrogate, updating
from skthermo.detection import CompensatedDetector, MahalanobisDetector, OutlierDetector
from skthermo.fem import AffineModel, Bar, Beam, Membrane, Spring, evaluate_modes
from skthermo.monitoring import fit_fleet
from skthermo.preprocessing import BiasAligner, HampelFilter, KNNGapImputer, LagFeatures
from tests.bad_input import registry
from tests.bad_input.registry import FOLDER, fitted, is_registered, methods, use
from tests.bad_input.values import (
    HUGE,
    INF,
    NAN,
    STAMP,
    bad,
    by_key,
    by_name,
    choice,
    count,
    durations,
    estimators,
    flag,
    frequencies,
    instead,
    integers,
    jobs,
    matrix,
    models,
    moments,
    names,
    number,
    paths,
    seed,
    table,
    texts,
    vector,
    weather,
)

mpl.use("Agg")
np.seterr(all="ignore")

TRUSS = datasets.make_truss()
NAMES = list(TRUSS.parameter_names)
MODES = [f"f{i + 1}" for i in range(6)]
THETA = pd.DataFrame(np.linspace(0.9, 1.1, 12).reshape(3, 4), columns=NAMES)
ROW = THETA[:1]
YEAR = datasets.make_truss_campaign(samples_per_year=120, random_state=0)
LATER = datasets.make_truss_campaign(samples_per_year=60, random_state=1)
T, F = YEAR.temperatures, YEAR.frequencies
BOTH = T.join(F)
NOMINAL = TRUSS.frequencies(np.ones((1, 4)))
DOFS = [0, 4, 8]
SHAPES = TRUSS.modes(np.ones((1, 4)))[1][0, DOFS]
STIFF, EYE = np.array([[2.0, -1.0], [-1.0, 1.0]]), np.eye(2)
REDUCED = TRUSS.reduced(0.2, tol=1e-3, random_state=0)
BOUNDS = dict.fromkeys(NAMES, (0.8, 1.2))
BOUNDED = by_name(0.2, NAMES, wrong=(20, 1.0, 0, -0.2), but=("too long",)) | {
    "frame of other names": pd.DataFrame(BOUNDS, ["lowest", "highest"]).T.rename(index={"top": "deck"}),
    "frame of other columns": pd.DataFrame(BOUNDS, ["from", "to"]).T,
    "transposed frame": pd.DataFrame(BOUNDS, ["lowest", "highest"]),
    "reversed": [(1.2, 0.8)] * 4,
}
PRIOR = by_name(0.2, NAMES, wrong=(20, 30))
NOISE = by_name(0.01, MODES, wrong=(0.5, 1.0, 5), but=("zero inside",))
registry.USUAL |= {
    "random_state": (0, seed()),
    "model": (TRUSS, models()),
    "dofs": (DOFS, integers(23)),
    "noise": (0.01, NOISE),
    "n_jobs": (1, jobs()),
    "contamination": (0.05, number(0, -0.1, 0.6, 2)),
    "source": ("simulated", texts() | bad("no")),
    "family": ("top", texts() | bad("no")),
    "confidence": (0.9, number(0, 1, 90, -0.1)),
    "repeat": (0, number(0.5, -1)),
    "tol": (0.01, number(0, -1, 1.0)),
    "verbose": (False, flag("one", "zero")),
    "max_false_alarms": (0.02, number(-0.1, 2)),
}
DAMAGE = by_key({"top": 0.1}, wrong=(20, 1.0, -15))
PARAMETERS = by_key({"top": 1.02}, wrong=(0, -1))
STEEL = {"E": 210e9, "A": 0.01, "density": 7850.0}
NODES = {"left": (0.0, 0.0), "right": (6.0, 0.0), "apex": (3.0, 2.0)}
BARS = {
    "tie": Bar("left", "right", **STEEL),
    "rafter 1": Bar("left", "apex", **STEEL),
    "rafter 2": Bar("apex", "right", **STEEL),
}
SUPPORTS = {"left": "xy", "right": "y"}
GROUPS = {"rafters": ["rafter 1", "rafter 2"]}
FRAME = fem.Structure(NODES, BARS, SUPPORTS, GROUPS)
SQUARE = {"a": (0.0, 0.0), "b": (1.0, 0.0), "c": (1.0, 1.0), "d": (0.0, 1.0)}
SPACE = {"a": (0.0, 0.0, 0.0), "b": (1.0, 0.0, 0.0), "c": (2.0, 1.0, 0.0)}
PHYSICAL = number(-1.0, 0.0)
INVERSE = {"regressor": Ridge(), "bounds": 0.2, "n_samples": 50, "noise": 0.01, "random_state": 0}
CHAIN = surrogate.DataInformedFEM(
    TRUSS, inverse=surrogate.InverseSurrogate(**INVERSE), mapper=surrogate.TemperatureMapper(Ridge()), random_state=0
).fit(T, F)
SURROGATE = surrogate.InverseSurrogate(TRUSS, **INVERSE).fit(F)
MAPPER = surrogate.TemperatureMapper(Ridge()).fit(T, CHAIN.parameters_)
DETECTOR = MahalanobisDetector().fit(F)
COMPENSATOR = detection.TemperatureCompensator(Ridge(), targets=MODES).fit(BOTH)
LINEAR = {"detector": MahalanobisDetector(), "regressor": Ridge(), "targets": MODES}
COMPENSATED = CompensatedDetector(**LINEAR).fit(BOTH)
SCENARIOS = studies.sweep(TRUSS, (0.1, 0.3), ["top"])
STUDY = studies.DetectabilityStudy(
    CHAIN, MahalanobisDetector(), SCENARIOS, n_repeats=2, uncertainty="noise", random_state=0
)
STUDY.run(LATER.temperatures)
CURVE = studies.pod_curve([0.1, 0.2, 0.3], [3, 10, 19], [20, 20, 20])
FOUND = studies.identify_damage(CHAIN, LATER.temperatures, LATER.frequencies, ["top"], random_state=0)
INDEX = pd.Series([1.0, 2.0, 4.0, 5.0], pd.date_range("2020", periods=4))
HOURLY = pd.DataFrame({"T1": np.arange(20.0)}, pd.date_range("2020-01-01", periods=20, freq="h"))
PROGRAM = {
    "function": (lambda theta: [theta[0] ** 0.5], instead(b"x")),
    "parameter_names": (["k"], names(["k"], "unknown", "one unknown", "text that is no name")),
}


def matrices(theta):
    return theta[0] * STIFF, EYE


def solved(model):
    """Frequencies of a model at its nominal parameters."""
    return model.frequencies(np.ones((1, len(model.parameter_names))))


ADDED = {name: (np.eye(23), matrix(np.eye(23))) for name in ("stiffness", "mass")}


# fem
AFFINE = {
    "stiffness": (
        {("k",): STIFF},
        {c: {("k",): v} for c, v in matrix(STIFF).items()} | bad(None, "K", {1: STIFF}, {}, True),
    ),
    "mass": (EYE, matrix(EYE, ("a number",))),
    "n_modes": (1, count(3, 1000)),
    "parameter_names": (["k"], names(["k"])),
    "groups": (
        {"all": ["k"]},
        bad(["k"], {"all": ["x"]}, {"all": []}, True, 3, "k", {"all": None}, {"all": [4]}, {"all": [True]}),
    ),
    "group_mass": ({"all": EYE / 10}, bad("x", 3, True, {"no": EYE}, {"all": np.eye(3)}, {"all": "m"}, {"all": -EYE})),
    "track": (False, flag()),
    "dofs": (
        [(1, "x"), (2, "x")],
        bad([(1, "x")], [(1, "x")] * 2, ["x", "y"], [(1, "x", 0), (2, "x", 0)], [(True, "x"), (2, "x")], "ab", 2)
        | {"lists inside": [([1], "x"), ([2], "x")]},
    ),
}
use("fem.AffineModel", lambda **a: AffineModel(**a).frequencies([[1.0]]), **AFFINE)
for owner in (TRUSS, REDUCED):
    kind = type(owner).__name__
    rows = table(THETA, nan=False, positive=True, rows=False, but=("no rows",))
    one = table(ROW, nan=False, positive=True, rows=False, but=())
    methods(owner, "frequencies modes jacobian linearised", theta=(THETA, rows))
    methods(owner, "linearised_modes", usual="dofs", theta=(THETA, rows))
    use(
        f"fem.{kind}.local_modes",
        lambda owner=owner, **a: owner.local_modes(**a).shapes(DOFS),
        theta=(ROW, one),
        follow=(False, flag()),
    )
    use(f"fem.{kind}.matrices", lambda owner=owner, **a: [m.toarray() for m in owner.matrices(**a)], theta=(ROW, one))
    for name, argument, good, wrong in (
        ("rescaled", "theta", ROW, one),
        ("damaged", "damage", {"top": 0.1}, DAMAGE),
        ("with_modes", "modes", [0, 1], integers(23)),
    ):
        use(f"fem.{kind}.{name}", lambda o=owner, n=name, **a: solved(getattr(o, n)(**a)), **{argument: (good, wrong)})
    use(
        f"fem.{kind}.with_parameters",
        lambda owner=owner, **a: solved(owner.with_parameters(**a)),
        names=(["top", "bottom"], names(["top", "bottom"])),
    )
    use(f"fem.{kind}.with_added", lambda owner=owner, **a: solved(owner.with_added(**a)), **ADDED)
    use(
        f"fem.{kind}.with_damage_parameters",
        lambda owner=owner, **a: owner.with_damage_parameters(**a).parameter_names,
        groups=(["top"], names(["top"])),
        severities=(
            (-0.1, 0.5),
            bad((-10, 50), 0.5, ("a", "b"), (True, False), (NAN, 0.5), (0.5, -0.1), None, tuple)
            | bad((0, 0.1, 0.2), (0.0, 1.0), (0, HUGE)),
        ),
    )
    use(
        f"fem.{kind}.reduced",
        lambda owner=owner, **a: solved(owner.reduced(**a)),
        usual="tol random_state",
        bounds=(0.1, BOUNDED),
    )
    methods(
        owner,
        "nominal_mac",
        shapes=(
            TRUSS.modes(np.ones((1, 4)))[1],
            bad(None, "x", np.ones((23, 2)), np.ones((1, 5, 2)))
            | {f"all {one}": np.full((1, 23, 2), one) for one in ("1", True, NAN, STAMP)},
        ),
    )
FULL = {"full": (TRUSS, models()), "bounds": (0.1, BOUNDED)}
use("fem.ReducedModel", lambda **a: solved(fem.ReducedModel(**a)), usual="tol random_state", **FULL)
LOCAL = TRUSS.local_modes(ROW)
use("fem.modal.LocalModes.shapes", LOCAL.shapes, usual="dofs")
use("fem.modal.LocalModes.derivatives", LOCAL.derivatives, usual="dofs", columns=([0, 1], integers(6)))


def member(cls, **extra):
    """One member in a structure that stands."""

    def call(**values):
        element = cls(**values)
        if cls is Bar:
            whole = fem.Structure(NODES, BARS | {"tie": element}, SUPPORTS, GROUPS)
        elif cls is Beam:
            whole = fem.Structure(
                SPACE,
                {"b": element, "c": Beam("b", "c", **BEAM)},
                {"a": ["x", "y", "z", "rx", "ry", "rz"]},
                {"rafters": ["b"]},
            )
        elif cls is Membrane:
            whole = fem.Structure(SQUARE, {"m": element}, {"a": "xy", "b": "xy"}, {"rafters": ["m"]})
        else:
            whole = fem.Structure(NODES, BARS | {"s": element}, SUPPORTS, GROUPS)
        return whole.assemble(["rafters"], n_modes=1).frequencies([[1.1]])

    return call


BEAM = {"E": 210e9, "G": 80e9, "A": 0.01, "I_yy": 1e-5, "I_zz": 1e-5, "J": 1e-5, "density": 7850.0}
NODE = bad("nowhere", None, True, 0.5, ["left"], NAN, str, b"left")
MAY_BE_0 = number(-1.0)
VECTOR = {"two": (0.0, 1.0), "times": (STAMP,) * 3} | bad(
    *((first, 0, 0) for first in (NAN, INF, HUGE, 1j)),
    ("0", "0", "1"),
    (True, False, True),
    "up",
    True,
    1.0,
    tuple,
    b"001",
)
RELEASES = bad(["rw"], 3, True, None, [NAN], b"ry", [1], str)
use(
    "fem.Beam",
    member(Beam),
    usual="lumped",
    start=("a", NODE),
    end=("b", NODE),
    **{name: (value, MAY_BE_0 if name == "density" else PHYSICAL) for name, value in BEAM.items()},
    I_p=(2e-5, number(-1.0)),
    orientation=((0.0, 0.0, 1.0), VECTOR | bad((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
    release_start=((), RELEASES),
    release_end=((), RELEASES),
    offset_start=((0.0, 0.0, 0.1), VECTOR),
    offset_end=((0.0, 0.0, 0.1), VECTOR),
)
use(
    "fem.Membrane",
    member(Membrane),
    usual="lumped",
    corners=(tuple("abcd"), bad(*map(tuple, ("abc", "abcx", "abca", "acbd")), None, 3, True, [["a", "b"]] * 4, tuple)),
    E=(2e9, PHYSICAL),
    t=(0.1, PHYSICAL),
    nu=(0.3, number(-2, 0.6, 30)),
    density=(2500.0, MAY_BE_0),
)
use(
    "fem.Spring",
    member(Spring),
    node=("apex", NODE),
    direction=("y", bad("w", "xy", None, 1, True, b"y", str, NAN, ["y"])),
    k=(1e6, PHYSICAL),
    to=("right", NODE),
)
ENDS = {"start": ("left", NODE), "end": ("right", NODE), "node": ("apex", NODE)}
for name in fem.__all__:  # elements between one or two nodes
    cls = getattr(fem, name)
    if cls.__module__.startswith("skthermo.fem.elements.") and name != "Element" and not is_registered(cls):
        given = inspect.signature(cls).parameters
        of_nodes = {one: pair for one, pair in ENDS.items() if one in given}
        physical = {one: (1.0, MAY_BE_0 if one in cls._may_be_zero else PHYSICAL) for one in cls._properties}
        others = " ".join(given.keys() - of_nodes.keys() - physical.keys())
        use(f"fem.{name}", member(cls), usual=others, **of_nodes, **physical)
use(
    "fem.Structure",
    lambda **a: fem.Structure(**a).assemble(["rafters"], n_modes=1).frequencies([[1.0]]),
    nodes=(
        NODES,
        bad(None, [(0, 0)], "xy", True, 3, {})
        | {c: NODES | {"apex": v} for c, v in (VECTOR | {"three": (1.0, 2.0, 3.0)}).items() if c != "two"},
    ),
    members=(
        BARS,
        bad(None, list(BARS.values()), "bars", True, {}, {"tie": BARS["tie"]})
        | {f"{cause} inside": BARS | {"tie": v} for cause, v in bad(Bar, "bar", None, 3).items()},
    ),
    supports=(
        SUPPORTS,
        bad(None, ["left"], "left", True, {"pier": "xy"}, {"left": "xw", "right": "y"}, {"left": "xx", "right": "y"})
        | {f"{cause} inside": {"left": v} for cause, v in bad(1, None, b"xy", True, [0, 1], "x").items()},
    ),
    groups=(
        GROUPS,
        bad(["tie"], "tie", True, 3)
        | {f"{c} inside": {"rafters": v} for c, v in bad(["post"], [], None, [3], "rafter", ["rafter 1"] * 2).items()},
    ),
)
TARGETS = names(["rafters"]) | {
    f"{cause} inside": {"p": value}
    for cause, value in bad(("nu", "rafters"), ("E", "rafters", "mass", 1), 1, None, True).items()
}
ALONE = {name: [name] for name in BARS}
EXPORTED = fem.Structure(NODES, BARS, SUPPORTS, ALONE).assemble(list(BARS), n_modes=1)
ENDS = {name: bar.nodes for name, bar in BARS.items()}
use(
    "fem.ImportedStructure",
    lambda **a: fem.ImportedStructure(**a).assemble(["rafters"], n_modes=1).frequencies([[1.0]]),
    model=(
        EXPORTED,
        bad(None, "model", 3, True, fem.AffineModel, {}, FRAME) | {"another": FRAME.assemble(["rafters"], n_modes=1)},
    ),
    nodes=(NODES, bad(None, [(0, 0)], "xy", True, 3, {}) | {"None inside": NODES | {"apex": None}}),
    members=(
        ENDS,
        bad(None, [("left", "right")], "bars", True, 3, {})
        | {"None inside": ENDS | {"tie": None}, "unknown": ENDS | {"post": "apex"}, "nowhere": ENDS | {"tie": "foot"}},
    ),
    groups=(GROUPS, bad(["tie"], "tie", True, 3, {"rafters": ["post"]}, {"rafters": []}, {"rafters": [3]})),
    supports=(SUPPORTS, bad(["left"], "left", True, {"pier": "xy"}, {"left": "xw"}, {"left": 1}, {"left": b"xy"})),
)
use(
    "fem.Structure.assemble",
    lambda **a: FRAME.assemble(**a).frequencies([[1.0]]),
    usual="track",
    parameters=(["rafters"], TARGETS),
    groups=(["rafters"], TARGETS),
    n_modes=(2, count(50)),
)
use(
    "fem.CallableModel",
    lambda **a: fem.CallableModel(**a).frequencies([[1.0], [1.1]]),
    **PROGRAM,
    n_modes=(1, count(2)),
    usual="vectorized",
    cache=(None, bad(True, 3, b"c", __file__, Path, NAN)),
    groups=({"g": ["k"]}, bad("k", ["k"], 3, True, {"g": []}, {"g": ["E"]}, {"g": 1}, {"g": None}, {"g": ["k", "k"]})),
)
SOFT = pd.DataFrame({"k": [1.0, 1.1]})
PROGRAMMED = fem.CallableModel(lambda theta: [theta[0] ** 0.5], ["k"], 1)
methods(PROGRAMMED, "damaged", damage=({"k": 0.1}, by_key({"k": 0.1}, wrong=(20, 1.0, -15))))
methods(
    PROGRAMMED,
    "frequencies",
    theta=(SOFT, table(SOFT, nan=False, positive=True, rows=False, but=("no rows", "columns in another order"))),
)
use(
    "fem.add_noise",
    usual="noise random_state",
    frequencies=(F, table(F, fixed=False, rows=False, but=("no rows", "repeated names", "repeated columns"))),
)
STEP = (1e-3, number(0, -1, 1.0, 10))
for name, usual, more in (
    ("evaluate", "", {"progress": (False, flag("None"))}),
    ("linearise", "relative", {"step": STEP}),
    ("evaluate_modes", "dofs", {}),
    ("linearise_modes", "dofs", {"step": STEP}),
):
    rows = table(THETA, positive=True, rows=False, but=("no rows",))
    use(f"fem.{name}", usual=f"model n_jobs {usual}", theta=(THETA, rows), **more)
COMPARED = (
    SHAPES,
    table(SHAPES, nan=False, rows=True, fixed=False, but=("1e308 inside", "complex numbers", "no rows")),
)
use("fem.mac", phi_a=COMPARED, phi_b=COMPARED)
use(
    "fem.match_modes",
    usual="model dofs",
    frequencies=(F, table(F, positive=True, rows=False, fixed=False)),
    shapes=(SHAPES, table(SHAPES, rows=True, but=("complex numbers",))),
)
use(
    "fem.probe",
    lambda **a: fem.probe(**a).frequencies([[1.0]]),
    usual="track random_state",
    assemble=(
        matrices,
        instead(b"x")
        | {
            "one matrix": lambda theta: EYE,
            "text": lambda theta: ("a", "b"),
            "nothing": lambda theta: None,
            "not affine": lambda theta: (theta[0] ** 2 * EYE, EYE),
        },
    ),
    parameter_names=(["k"], names(["k"], "unknown", "text that is no name")),
    n_modes=(1, count(3)),
    n_checks=(1, count(but=("zero",))),
)
use(
    "fem.sample",
    usual="model dofs n_jobs random_state",
    bounds=(0.2, BOUNDED),
    n_samples=(4, count()),
    method=("lhs", choice()),
    progress=(False, flag("None")),
)
STACK = SHAPES.T[np.newaxis]
use(
    "fem.shape_components",
    shapes=(
        STACK,
        bad(None, "x", True, float, SHAPES, STACK[:, :, :2])
        | bad(*(np.full((1, 6, 3), one) for one in ("1", True, INF, STAMP, HUGE)))
        | {"sparse": scipy.sparse.csr_array(SHAPES)},
    ),
    reference=(SHAPES, table(SHAPES, nan=False, rows=True, fixed=True)),
)
np.savez(FOLDER / "model.npz", E=STIFF, M=EYE)
use(
    "fem.load_affine",
    lambda **a: fem.load_affine(**a).frequencies([[1.0]]),
    usual="track",
    path=(FOLDER / "model.npz", paths()),
    stiffness=(["E"], names(["E"])),
    mass=("M", texts() | bad("X")),
    total=(None, texts() | bad("X")),
    n_modes=(1, count(3)),
    parameter_names=(["E"], names(["E"])),
    groups=({"all": ["E"]}, AFFINE["groups"][1]),
)
FACTORS = {"one": 1.0, "zero": 0.0, "negative": -2.0, "text": "2", "infinite": np.inf, "unknown": {"x": 2.0}}
np.savez(FOLDER / "exports.npz", K0=STIFF, E=2 * STIFF, M=EYE)
use(
    "fem.load_affine",
    lambda **a: fem.load_affine(FOLDER / "exports.npz", n_modes=1, **a).frequencies([[1.0]]),
    factor=(2.0, FACTORS),
)
TWICE = {"k": STIFF * 2}
use(
    "fem.difference_terms",
    lambda **a: fem.difference_terms(**a)["k",].toarray(),
    nominal=(STIFF, matrix(STIFF)),
    changed=(TWICE, {c: {"k": v} for c, v in matrix(STIFF * 2).items()} | bad(None, "K", {1: STIFF}, {}, True)),
    factor=(2.0, FACTORS),
    check=(
        None,
        (
            {"a matrix": STIFF, "unknown": ({"x": 2.0}, STIFF), "text": ({"k": "2"}, STIFF)}
            | {"other stiffness": ({"k": 3.0}, STIFF), "NaN inside": ({"k": 2.0}, STIFF * np.nan)}
            | {"None": ({"k": 2.0}, None)}
        ),
    ),
)
(FOLDER / "tower.sti").write_text("1 1 800.0\n1 2 -400.0\n2 2 400.0\n")
for cause, text in {
    "infinite": "1 1 inf\n",
    "NaN": "1 1 nan\n",
    "half": "1.5 1 3\n",
    "words": "1 a b\n",
    "1e308": "1 1 1e308\n2 2 1e308\n",
}.items():
    (FOLDER / f"{cause}.sti").write_text(text)
use(
    "fem.read_triplets",
    lambda **a: fem.read_triplets(**a).toarray(),
    path=(
        FOLDER / "tower.sti",
        paths() | {f"text with {cause}": FOLDER / f"{cause}.sti" for cause in ("infinite", "NaN", "half", "words")},
    ),
)

# preprocessing
PLAIN = table(F, fixed=False, rows=False, fitting=True, but=("constant",))
fitted(
    BiasAligner,
    (F, PLAIN),
    reference=(NOMINAL[0], by_name(NOMINAL[0], MODES, but=("negative inside",))),
    usual="method",
)
ALIGNED = BiasAligner(TRUSS).fit(F)
SAME = table(F, rows=False)
methods(ALIGNED, "transform inverse_transform", X=(F, SAME))
use(
    "preprocessing.BlockedKFold",
    lambda **a: preprocessing.BlockedKFold(**a).fold_of(F),
    n_splits=(3, count(1, 10**6)),
    block=("7D", durations()),
)
methods(preprocessing.BlockedKFold(3), "fold_of", X=(F, bad(None, 3, True, F[:2], F[:0], pd.DataFrame)))
fitted(
    preprocessing.HingeFeatures,
    (T, table(T, fixed=False, rows=False, fitting=True, but=("constant",))),
    n_knots=(2, count()),
)
use(
    "preprocessing.HingeFeatures.fit",
    lambda **a: preprocessing.HingeFeatures().fit(**a).transform(T),
    X=(T, table(T, fixed=False)),
    sample_weight=(
        pd.Series(1.0, T.index),
        vector(np.ones(len(T)), size=None, but=("zero inside",)) | bad(pd.Series(1.0, T.index.shift(1)), np.ones(3)),
    ),
)
methods(preprocessing.HingeFeatures().fit(T), "transform", X=(T, table(T, rows=False)))
GAPPY = F.mask(np.arange(len(F))[:, np.newaxis] % 7 == np.arange(6))
fitted(
    KNNGapImputer,
    (GAPPY, table(GAPPY, fixed=False, rows=False, fitting=True, but=("constant",))),
    usual="n_neighbors weights metric copy add_indicator keep_empty_features",
    missing_values=(NAN, bad("missing", [NAN], float, STAMP, True, b"x")),
)
methods(KNNGapImputer().fit(GAPPY), "transform", X=(GAPPY, table(GAPPY, rows=False)))
fitted(
    LagFeatures,
    (
        HOURLY,
        table(HOURLY, fixed=False, rows=False, but=("repeated columns",))
        | {
            "stamps as text": HOURLY.set_axis(HOURLY.index.astype(str)),
            "a missing stamp": HOURLY.set_axis([pd.NaT, *HOURLY.index[1:]]),
            "stamps twice": pd.concat([HOURLY, HOURLY]),
        },
    ),
    lags=(2, count() | bad(["1"], [0, True], [-1], [1, 1], [0, NAN], [STAMP], [0.5, 1.5])),
    freq=("1h", durations()),
    tolerance=("3h", durations()),
    usual="padding",
)
methods(LagFeatures(2).fit(HOURLY), "transform", X=(HOURLY, table(HOURLY, rows=False)))
POLES = {"frequencies": np.array([[2.0, 2.2], [2.1, 2.15]]), "shapes": np.array([[[1, 2.0, 1], [1, 0, -1]]] * 2)}
REFERENCE = (np.array([2.0, 2.2]), np.array([[1.0, 1], [2, 0], [1, -1]]))
POLED = {
    c: POLES | {"frequencies": v}
    for c, v in table(POLES["frequencies"], fixed=False).items()
    if c not in ("NaN throughout",)
}
POLED |= {
    f"shapes: {c}": POLES | {"shapes": v}
    for c, v in (
        {"texts": POLES["shapes"].astype(str), "booleans": POLES["shapes"] > 0, "two axes": POLES["shapes"][0]}
        | {"infinite": POLES["shapes"] * INF, "other sensors": POLES["shapes"][:, :, :2], "text": "x"}
    ).items()
}
REFERRED = bad(None, "model", True, 3, (REFERENCE[0],), tuple, ()) | {
    f"frequencies: {c}": (v, REFERENCE[1]) for c, v in vector(REFERENCE[0], size=2).items()
}
REFERRED |= {
    f"shapes: {c}": (REFERENCE[0], v)
    for c, v in table(REFERENCE[1], nan=False, but=("None", "no rows", "a row too few", "complex numbers")).items()
}
use(
    "preprocessing.ModeTracker",
    lambda X, **a: preprocessing.ModeTracker(**a).fit().transform(X).frequencies,
    X=(POLES, POLED | bad(None, "poles", 3, True, {}, dict)),
    reference=(REFERENCE, REFERRED),
    max_shift=(0.15, number(0, 1, 15, -0.1)),
    min_mac=(0.8, number(1, 80, -0.1)),
    follow=(10, durations("negative number", "half") | bad(0, -1)),
    max_drift=(0.3, number(1, 30, -0.1)),
    close=(0.02, number(1, 2, -0.1)),
)

# surrogate
PREDICTING = weather(T, rows=False)
WEATHER = weather(T, rows=True, fixed=False, fitting=True)
MEASURED = frequencies(F, rows=True, fitting=True, but=("unknown names", "columns in another order"))
PARTS = {"inverse": surrogate.InverseSurrogate(**INVERSE), "mapper": surrogate.TemperatureMapper(Ridge())}
use(
    "surrogate.DataInformedFEM",
    lambda X, y, **a: surrogate.DataInformedFEM(**a).fit(X, y).predict(T),
    usual="model n_jobs random_state",
    inverse=(PARTS["inverse"], estimators()),
    mapper=(PARTS["mapper"], estimators()),
    aligner=("passthrough", estimators()),
    imputer=("passthrough", estimators()),
    reduce=(False, number(0, 1.0, -1, but=()) | bad(1)),
    X=(T, WEATHER),
    y=(F, MEASURED),
)
use(
    "surrogate.DataInformedFEM.fit",
    lambda **a: surrogate.DataInformedFEM(TRUSS, **PARTS, random_state=0).fit(**a).predict(T),
    X=(T, WEATHER),
    y=(F, MEASURED),
    shapes=(None, bad("x", 3, True, SHAPES, np.full((120, 6, 3), STAMP), np.ones((120, 6, 3)))),
)
methods(CHAIN, "predict_parameters extrapolation_distance weather", X=(T, PREDICTING))
methods(CHAIN, "predict", usual="return_std", X=(T, PREDICTING))
methods(CHAIN, "predict_interval", usual="confidence", X=(T, PREDICTING))
methods(CHAIN, "score", X=(T, weather(T, rows=True)), y=(F, table(F, rows=True, positive=True)))
NO_SHAPES = (None, bad("x", 3, True, SHAPES))
methods(CHAIN, "estimate_parameters", F=(F, frequencies(F, rows=False)), shapes=NO_SHAPES)
CHANGES = {
    "damage": (
        {"top": 0.1},
        DAMAGE
        | {
            cause: {"top": values}
            for cause, values in (
                ("rows too few", np.full(3, 0.1)),
                ("texts", ["0.1"] * 120),
                ("booleans", [True] * 120),
            )
        },
    ),
    "parameters": ({"top": 1.02}, PARAMETERS),
    **ADDED,
}
SHARE_OF_VALUES = number(-0.1, 1.0, 90, but=("None", "several", "empty"))
FAULTS = {
    "gaps": (0.1, SHARE_OF_VALUES | bad("often")),
    "outliers": (0.01, SHARE_OF_VALUES | bad("often", np.full((3, 6), 5.0))),
}
methods(CHAIN, "simulate", usual="noise random_state", X=(T, PREDICTING), **CHANGES, **FAULTS)
INVERTING = {
    "regressor": (Ridge(), estimators("None")),
    "bounds": (0.2, BOUNDED),
    "n_samples": (50, count(1)),
    "noise": (0.01, NOISE),
    "memory": (None, bad(True, 3, b"m", __file__, Path, NAN, ["m"])),
}
INVERTED = frequencies(F, rows=False, but=("unknown names", "columns in another order"))
OF_F = lambda estimator, X: estimator.transform(F)  # noqa: E731
COMMON = "model n_jobs random_state"
fitted(surrogate.InverseSurrogate, (F, INVERTED), (None, {}), usual=COMMON, after=OF_F, **INVERTING)
INVERTIBLE = (F, table(F, rows=False, positive=True))
POSTERIOR = surrogate.PosteriorInverse(TRUSS, noise=0.01).fit(F)
use(
    "surrogate.PosteriorInverse",
    lambda X, **a: surrogate.PosteriorInverse(**a).fit_transform(X),
    usual="model n_jobs noise",
    prior=(0.2, PRIOR),
    dofs=(None, integers(23)),
    reduce=(False, number(0, 1.0, -1) | bad(1)),
    memory=INVERTING["memory"],
    X=(F, INVERTED),
)
SHAPED = np.hstack([NOMINAL, evaluate_modes(TRUSS, np.ones((1, 4)), DOFS)[1].swapaxes(1, 2).reshape(1, -1)])
registry.EXAMPLES.append(
    registry.Example(
        "surrogate.PosteriorInverse",
        surrogate.PosteriorInverse,
        lambda **a: surrogate.PosteriorInverse(TRUSS, dofs=DOFS, noise=0.01, prior=0.1, **a).fit_transform(SHAPED),
        {"shape_noise": 0.01},
        {"shape_noise": by_name(0.01, MODES, wrong=(1.0, 5))},
    )
)
methods(POSTERIOR, "transform", usual="return_std", X=INVERTIBLE)
methods(POSTERIOR, "invert", X=INVERTIBLE)
use(
    "surrogate.InverseSurrogate.fit",
    lambda **a: surrogate.InverseSurrogate(None, Ridge()).fit(**a).transform(F),
    X=(F, table(F, rows=True, fixed=False, fitting=True)),
    y=(CHAIN.parameters_, table(CHAIN.parameters_, rows=True, fixed=False, but=("a number",))),
)
methods(SURROGATE, "transform", X=INVERTIBLE)
methods(SURROGATE, "predict", usual="return_std", X=INVERTIBLE)
methods(SURROGATE, "inverse_transform", X=(THETA, table(THETA, rows=False, positive=True, but=("no rows",))))
methods(
    SURROGATE,
    "score",
    X=(F, table(F, rows=True, positive=True)),
    y=(CHAIN.parameters_, table(CHAIN.parameters_, rows=True)),
)
fitted(
    surrogate.TemperatureMapper,
    (T, WEATHER),
    (CHAIN.parameters_, table(CHAIN.parameters_, rows=True, fixed=False, fitting=True, but=("a number", "constant"))),
    usual="random_state",
    after=lambda estimator, X: estimator.predict(X),
    regressor=(Ridge(), estimators("None")),
    means=(None, bad("no", 3, True, ["-1h"], [3], [])),
)
use(
    "surrogate.TemperatureMapper.fit",
    lambda **a: surrogate.TemperatureMapper(Ridge()).fit(T, CHAIN.parameters_, **a).predict(T),
    sample_weight=(
        pd.Series(1.0, T.index),
        vector(np.ones(len(T)), but=("zero inside",)) | bad(pd.Series(1.0, T.index.shift(1)), np.ones(3)),
    ),
)
methods(MAPPER, "predict", usual="return_std", X=(T, table(T, rows=False)))
methods(MAPPER, "score", X=(T, table(T, rows=True)), y=(CHAIN.parameters_, table(CHAIN.parameters_, rows=True)))
use(
    "surrogate.paper_network",
    lambda **a: surrogate.paper_network(**a).hidden_layer_sizes,
    network=("truss", choice()),
    usual="dropout",
)


def published(**values):
    """The paper's chain after one epoch."""
    fem = surrogate.paper_chain(**values)
    mapper = "mapper__temperaturemapper" if values["lags"] is not None else "mapper"
    fem.set_params(**{"inverse__regressor__max_iter": 1, f"{mapper}__regressor__max_iter": 1})
    return fem.fit(T, F).predict(T)


use(
    "surrogate.paper_chain",
    published,
    usual="model random_state",
    network=("truss", choice()),
    lags=(2, count()),
    bounds=INVERTING["bounds"],
    n_samples=(50, count(1)),
)

# updating
UPDATED = frequencies(F, rows=False, fitting=True, but=("constant", "unknown names", "columns in another order"))
UPDATER = {
    "bounds": (0.2, BOUNDED),
    "shape_weight": (1.0, by_name(1.0, MODES, but=("zero inside",))),
    "n_starts": (1, count()),
    "prior": (0.2, PRIOR),
    "max_iter": (50, count()),
}
use(
    "updating.ModelUpdater",
    lambda **a: updating.ModelUpdater(**a).fit(F, shapes=SHAPES, dofs=DOFS).theta_,
    usual="model method n_jobs random_state",
    **UPDATER,
)
use(
    "updating.ModelUpdater.fit",
    lambda **a: updating.ModelUpdater(TRUSS, shape_weight=1.0, bounds=0.2).fit(**a).theta_,
    usual="dofs",
    F=(F, UPDATED),
    shapes=(SHAPES, table(SHAPES, rows=True, but=("complex numbers",))),
    frequency_std=(0.1, by_name(0.1, MODES)),
)
use(
    "updating.identifiability",
    lambda **a: updating.identifiability(**a).deviations,
    usual="model noise dofs",
    theta=(ROW, table(ROW, nan=False, positive=True, rows=False)),
    shape_noise=(0.01, number(0, -0.1, 5)),
)
SENSITIVITY = updating.sensitivity(TRUSS)
use(
    "updating.select_parameters",
    S=(SENSITIVITY, table(SENSITIVITY, rows=False, fixed=False, nan=False)),
    threshold=(0.1, number(-0.1)),
)
use(
    "updating.sensitivity",
    usual="model",
    theta=(ROW, table(ROW, nan=False, positive=True, rows=False)),
    step=(0.01, number(0, -1, 1.0)),
)

# detection
WATCHED = frequencies(F, in_hertz=False, fixed=False, rows=False, fitting=True)
DAMAGE_INDEX = lambda detector, X: detector.damage_index(X)  # noqa: E731
fitted(
    MahalanobisDetector,
    (F, WATCHED),
    usual="contamination threshold",
    after=DAMAGE_INDEX,
    covariance=(None, estimators("None")),
)
fitted(
    detection.DirectionalDetector,
    (F, WATCHED),
    usual="contamination threshold",
    after=DAMAGE_INDEX,
    directions=(
        "softening",
        bad(None, "down", 3, True, NAN, [], np.zeros((0, 6)), np.full((1, 6), NAN), np.ones((1, 5))),
    ),
    omnibus=(0.2, number(-0.1, 1.1)),
    covariance=(None, estimators("None")),
)
fitted(
    OutlierDetector,
    (F, WATCHED),
    usual="contamination",
    after=DAMAGE_INDEX,
    estimator=(IsolationForest(n_estimators=5, random_state=0), estimators()),
)
for name in detection.__all__:  # detectors that take what all detectors take
    cls = getattr(detection, name)
    if issubclass(cls, detection.DamageDetector) and not inspect.isabstract(cls) and not is_registered(cls):
        fitted(cls, (F, WATCHED), usual=" ".join(inspect.signature(cls).parameters), after=DAMAGE_INDEX)
ASKED = "damage_index decision_function predict score_samples"
for owner in (DETECTOR, OutlierDetector(IsolationForest(n_estimators=5, random_state=0)).fit(F)):
    methods(owner, ASKED, X=(F, table(F, rows=False)))
SIDE_BY_SIDE = table(
    BOTH,
    rows=False,
    but=("unknown names", "columns in another order", "a column too few", "a column too many"),
    fitting=True,
)
FOLDS = count(1, 10**6) | bad([1, 2], "5", preprocessing.BlockedKFold, [([0], [1]), ([1],)])
TARGETS = (MODES, names(MODES) | bad([9], [True] * 9, [1.5], list(BOTH)))
fitted(
    detection.TemperatureCompensator,
    (BOTH, SIDE_BY_SIDE),
    estimator=(Ridge(), estimators()),
    targets=TARGETS,
    cv=(3, FOLDS),
)
fitted(
    CompensatedDetector,
    (BOTH, SIDE_BY_SIDE),
    after=DAMAGE_INDEX,
    detector=(MahalanobisDetector(), estimators("None")),
    regressor=(Ridge(), estimators("None")),
    targets=TARGETS,
    window=(3, durations("negative", "zero") | bad(0, "-1h")),
    regimes=(None, bad("no", 3, True, ("T1",), ("no", 3.0), ("T1", "warm"))),
    cv=(3, FOLDS),
    window_share=(0.5, number(0, -0.1, 2)),
)
methods(COMPENSATED, f"{ASKED} residuals", X=(BOTH, table(BOTH, rows=False)))
methods(COMPENSATOR, "transform extrapolation_distance", X=(BOTH, table(BOTH, rows=False)))

# metrics
PREDICTED = F * 1.01
OF_SCENARIOS = {"scenarios": (["a", "b"] * 60, bad(["a"], "all", 3, True, [None] * 120, [NAN] * 120, str))}
for name, more in (("mape", {}), ("error_table", OF_SCENARIOS), ("errors.complete_r2", {})):
    positive = name != "errors.complete_r2"
    use(
        f"metrics.{name}",
        y_true=(F, table(F, rows=True, positive=positive)),
        y_pred=(PREDICTED, table(PREDICTED, rows=True, positive=False)),
        **more,
    )
use(
    "metrics.frequency_scorer",
    estimator=(CHAIN, instead(Ridge)),
    X=(T, weather(T, rows=True)),
    y=(F, table(F, rows=True, positive=True)),
)
use(
    "metrics.minimum_detectable_damage",
    severities=(
        [0.1, 0.2, 0.3],
        vector([0.1, 0.2, 0.3], wrong=(0.1,), but=())
        | {
            "percent": [10, 20, 30],
            "too long": [0.1, 0.2, 0.3, 0.4],
            "repeated": [0.1, 0.1, 0.3],
            "other labels": pd.Series([0.1, 0.2, 0.3], list("abc")),
        },
    ),
    pod=(
        [0.1, 0.5, 1.0],
        vector([0.1, 0.5, 1.0], but=("zero inside", "NaN inside")) | bad([10, 50, 100], [0.1, 0.2, 0.3, 0.4]),
    ),
    level=(0.9, number(-0.1, 90, but=())),
)
INDICES = vector(INDEX.to_numpy(), but=("NaN inside", "zero inside"))
for name in ("probability_of_detection", "probability_of_false_alarm", "time_to_detection"):
    more = {"onset": (1, moments("text"))} if name == "time_to_detection" else {}
    use(f"metrics.{name}", damage_index=(INDEX, INDICES), threshold=(3.0, number(-1.0)), **more)

# datasets
use("datasets.make_truss", lambda **a: datasets.make_truss(**a).frequencies(np.ones((1, 4))), n_modes=(3, count(24)))
use("datasets.make_z24", lambda **a: datasets.make_z24(**a).n_modes, n_modes=(2, count()), track=(True, flag()))
use(
    "datasets.make_kw51",
    lambda **a: datasets.make_kw51(**a).n_modes,
    parameters=(["E_arc"], names(["E_arc"])),
    n_modes=(2, count()),
    usual="updated",
)
use(
    "datasets.make_truss_campaign",
    usual="noise random_state n_years samples_per_day kind",
    samples_per_year=(12, count()),
    damage=({"top": 0.1}, DAMAGE),
)
GROUP = "girders"
use(
    "datasets.make_kw51_campaign",
    usual="noise random_state shapes gaps retrofit",
    n_hours=(48, count()),
    drift=({GROUP: 0.01}, by_key({GROUP: 0.01}, wrong=(1000,))),
    damage=({GROUP: 0.1}, by_key({GROUP: 0.1}, wrong=(20, 1.0))),
    damage_from=("2018-10-02", moments("half", "too late", "negative") | bad("2030-01-01", "2000-01-01", 5)),
)
use(
    "datasets.steel_modulus",
    temperature=(
        T,
        table(
            T, rows=False, fixed=False, but=("three axes", "a number", "no rows", "repeated columns", "repeated names")
        )
        | bad(T + 273.15),
    ),
)

# studies
use(
    "studies.Scenario",
    lambda **a: CHAIN.simulate(LATER.temperatures, **studies.Scenario(**a).changes(T)),
    usual="kind",
    name=("a", texts()),
    damage=({"top": 0.1}, by_key({"top": 0.1}, wrong=(20, 1.0, -15), but=("unknown",))),
    parameters=({"top": 1.02}, by_key({"top": 1.02}, wrong=(0, -1), but=("unknown",))),
    **dict.fromkeys(("stiffness", "mass"), (np.eye(23), matrix(np.eye(23), ("a column too many", "a column too few")))),
    family=("top", texts()),
    severity=(0.1, number(20, 1.0, but=("NaN",))),
)
use(
    "studies.ProgressiveDamage",
    lambda **a: CHAIN.simulate(LATER.temperatures, **studies.ProgressiveDamage(**a).changes(LATER.temperatures)),
    usual="kind",
    name=("a", texts()),
    damage=({"top": 0.1}, by_key({"top": 0.1}, wrong=(20, 1.0, -15), but=("unknown",))),
    onset=(2, moments() | bad(None)),
    end=(10, moments() | bad(1)),
)
DRAWS = pd.DataFrame({"top": [0.1, 0.2], "bottom": [0.0, 0.1]})
use(
    "studies.UncertainDamage",
    lambda **a: CHAIN.simulate(LATER.temperatures, **studies.UncertainDamage(**a).changes(T)),
    usual="kind",
    name=("a", texts()),
    draws=(DRAWS, table(DRAWS, nan=False, rows=False, fixed=False) | bad(DRAWS * 100)),
)
methods(studies.Scenario("a", {"top": 0.1}), "changes", usual="repeat", T=(T, {}))
methods(
    studies.ProgressiveDamage("a", {"top": 0.1}, 2),
    "changes",
    usual="repeat",
    T=(T, bad(None, 3, True, "T", pd.DataFrame)),
)
methods(studies.UncertainDamage("a", DRAWS), "changes", usual="repeat", T=(T, {}))
use(
    "studies.sweep",
    lambda **a: [one.severity for one in studies.sweep(**a)],
    usual="model kind",
    severities=([0.1, 0.2], vector([0.1, 0.2], but=("negative inside",)) | bad([10, 20], ".1", [1.0], [0.1, 0.1], 0.1)),
    groups=(["top"], names(["top"]) | bad("top")),
)
ARGUMENTS = {"fem": (CHAIN, models() | bad(surrogate.DataInformedFEM(TRUSS)))}
use(
    "studies.DetectabilityStudy",
    lambda T, baseline, reference, confidence, **a: studies.DetectabilityStudy(uncertainty="noise", **a).run(
        T, baseline, reference=reference, confidence=confidence
    )["rate"],
    usual="noise n_jobs random_state confidence",
    **ARGUMENTS,
    detectors=(MahalanobisDetector(), estimators() | bad({}, {"": MahalanobisDetector()}, {3: None})),
    scenarios=(
        SCENARIOS,
        bad(None, "healthy", 3, True, [], [SCENARIOS[0]] * 2, ["a"], [studies.Scenario])
        | {
            f"unknown {name}": [studies.Scenario("a", **{name: value})]
            for name, value in (("damage", {"deck": 0.1}), ("parameters", {"deck": 1.1}), ("mass", np.eye(2)))
        },
    ),
    n_repeats=(1, count()),
    T=(LATER.temperatures, weather(LATER.temperatures, rows=False)),
    baseline=(F, frequencies(F, rows=False, fitting=True)),
    reference=(
        {"healthy": LATER.frequencies},
        bad("F", 3, True, {"no": F}, {"healthy": None})
        | {f"inside: {c}": {"healthy": v} for c, v in table(LATER.frequencies, rows=False).items()},
    ),
)
methods(STUDY, "pod_curve", usual="family source log")
methods(STUDY, "is_undetected", usual="family source")
methods(STUDY, "minimum_detectable_damage", level=(0.9, number(-0.1, 90)), method=("grid", choice()))
methods(STUDY, "ranking", usual="max_false_alarms source", confidence=(0.9, number(0, 1, 90)), by=("pod", choice()))
methods(STUDY, "detector_name", detector=("MahalanobisDetector", texts("None")))
COUNTED = vector([3.0, 10.0, 19.0], but=("zero inside",)) | bad([1, 2, 3, 4], [30, 10, 19])
use(
    "studies.pod_curve",
    lambda **a: studies.pod_curve(**a).slope,
    usual="log confidence",
    severities=([0.1, 0.2, 0.3], vector([0.1, 0.2, 0.3]) | bad([10, 20, 30], [0.1, 0.2, 0.3, 0.4])),
    n_detected=([3, 10, 19], COUNTED),
    n_records=([20, 20, 20], vector([20.0, 20.0, 20.0], but=("zero inside",)) | bad([20] * 4)),
)
methods(CURVE, "predict", severity=(0.2, vector(0.2, wrong=(20,), but=("zero inside", "empty", "three axes"))))
methods(CURVE, "severity_at", usual="confidence", pod=(0.9, number(0, 1, 90, -0.1)))
use(
    "studies.identify_damage",
    lambda **a: studies.identify_damage(**a).severities,
    usual="noise dofs random_state kind",
    structure=(None, instead()),
    added_stiffness=({"rope": np.ones(23)}, bad("x", 5.0, {"rope": np.ones(4)})),
    **ARGUMENTS,
    T=(LATER.temperatures, weather(LATER.temperatures, rows=True)),
    F=(LATER.frequencies, frequencies(LATER.frequencies, rows=True)),
    groups=(["top"], names(["top"]) | bad({"a": ["no"]}, {"a": []})),
    prior=(None, instead({"severity": 0.2}, (0.5, 0.5), studies.DamagePrior)),
    stiffening=(["top"], names(["top"]) | bad(0, 1, NAN, b"")),
    parameters=(["top"], names(["top"]) | bad(0, NAN, b"")),
    added_mass=({"ballast": np.ones(23)}, bad("x", 5.0, {"ballast": np.ones(4)})),
    shapes=(
        (SHAPES, SHAPES * 1.01),
        bad("x", SHAPES, True)
        | {c: (v, SHAPES) for c, v in bad(SHAPES.astype(str), SHAPES > 0, SHAPES[:2], None, SHAPES * INF).items()},
    ),
    shape_noise=(0.01, by_name(0.01, MODES, wrong=(5,))),
    models=(None, instead([], [1.0], TRUSS)),
)
use(
    "studies.DamagePrior",
    lambda **a: studies.DamagePrior(**a),
    numbers=((0.5, 0.5), bad("x", (0.2,) * 5, (1.5, -0.5), (1.0,), (0.5, 0.4))),
    severity=(0.2, number(0, 2, -0.1)),
    usual="law",
    something_else=(0.1, number(1.5, -0.1)),
    model_error=(0.03, number(1.5, -0.1)),
)
use("studies.IdentifiedDamage.scenario", lambda **a: FOUND.scenario(**a).name, name=("found", texts()))
use(
    "studies.compare_extensions",
    lambda **a: studies.compare_extensions(**a)["gain"],
    study=(STUDY, instead(studies.DetectabilityStudy(CHAIN, DETECTOR, SCENARIOS))),
    T=(LATER.temperatures, weather(LATER.temperatures, rows=False)),
    modes=([6], integers(23) | bad([0])),
    noise=(0.01, by_name(0.01, ["mode 7"], wrong=(0.5, 5), but=("zero inside", "other names"))),
    baseline_factors=([2.0], vector([2.0]) | bad([1.0], 2.0, "2")),
    sensors=(None, {}),
)

# plotting and reporting
use(
    "reporting.owner_report",
    subject=(STUDY, instead(studies.DetectabilityStudy(CHAIN, DETECTOR, SCENARIOS))),
    path=(
        FOLDER / "report.html",
        bad(None, 3, True, str(FOLDER), b"r", ["a"], Path, NAN, FOLDER / "no" / "report.html"),
    ),
    identified=(FOUND, instead() | bad([FOUND])),
    title=("Bridge", texts("empty")),
    structure=(None, instead()),
    settings=(None, bad(3, True, NAN, ["a"], Path)),
    templates=(None, bad(3, True, NAN, ["a"], Path, "no such folder", str(FOLDER), FOLDER / "report.html")),
)
use(
    "plotting.PredictionDisplay.from_predictions",
    lambda **a: [plotting.PredictionDisplay.from_predictions(**a), 0][1],
    measured=(F, table(F, rows=False, fixed=False, but=("NaN inside",))),
)


# newer arguments
fitted(
    HampelFilter,
    (BOTH, table(BOTH, fixed=False, rows=False, but=("repeated columns",))),
    window=(5, number(-1, 0, 0.5, but=("several", "empty"))),
    n_deviations=(6.0, number(-1.0, 0.0)),
    targets=(MODES, names(MODES)),
)
RECORDS = {"temperatures": (T, weather(T, fixed=False)), "frequencies": (F, frequencies(F, fixed=False))}
MODEL = (TRUSS, {cause: value for cause, value in models().items() if cause != "None"})
use("preprocessing.check_records", **RECORDS, model=MODEL)
fitted(
    OutlierDetector,
    (F, {}),
    usual="threshold",
    after=DAMAGE_INDEX,
    estimator=(IsolationForest(n_estimators=5, random_state=0), {}),
)
use(
    "metrics.errors.complete_r2",
    y_true=(F, {}),
    y_pred=(PREDICTED, {}),
    sample_weight=(np.ones(len(F)), vector(np.ones(len(F)), but=("zero inside",))),
)
use(
    "surrogate.DataInformedFEM",
    lambda **a: surrogate.DataInformedFEM(TRUSS, **PARTS, random_state=0, **a).fit(T, F).predict(T),
    usual="verbose",
)
use(
    "studies.DetectabilityStudy",
    lambda **a: studies.DetectabilityStudy(
        CHAIN, MahalanobisDetector(), SCENARIOS[:1], n_repeats=1, **({"uncertainty": "noise"} | a)
    ).run(LATER.temperatures, F)["rate"],
    usual="verbose tol",
    gaps=("fitted", choice("None")),
    outliers=("fitted", choice("None")),
    uncertainty=("noise", choice()),
)
use(
    "studies.detection_task",
    lambda **a: studies.detection_task(**a).y,
    usual="noise max_false_alarms random_state",
    **ARGUMENTS,
    T=(LATER.temperatures, weather(LATER.temperatures, rows=False)),
    scenarios=(SCENARIOS, bad(None, "healthy", 3, [], ["a"])),
    baseline=(F, table(F, rows=False)),
    n_repeats=(2, count()),
    n_splits=(2, count(1)),
)
use("fem.add_noise", frequencies=(F, {}), noise=(0.01, {}), correlation=(0.5, number(-1.0, 1.0)))
for name, size in (
    ("make_truss_campaign", {"samples_per_year": (12, {})}),
    ("make_kw51_campaign", {"n_hours": (48, {}), "gaps": (False, {})}),
):
    use(f"datasets.{name}", **size, correlation=(0.5, number(-1.0, 1.0)), random_state=(0, {}))
use("datasets.make_fleet", lambda **a: list(datasets.make_fleet(**a)), usual="random_state", n_bridges=(3, count()))
fitted(preprocessing.SensorMeans, (T, {}), roles=(None, bad(3, "air", True)))


# --------------------------------------------------------------------------- what depends on several arguments

LATE = F.set_axis(F.index + pd.Timedelta("1h"))
DATED = F["f1"]
FAILING = fem.CallableModel(lambda theta: 1 / 0, ["k"], 1)
OF_ONE_MODE = MahalanobisDetector().fit(F.to_numpy()[:, :1])
LITTLE_NOISE = {"bounds": 0.1, "frequency_std": 1e-4}
ONE_MODE = fem.CallableModel(lambda theta: [7.5 * theta[0] ** 0.5], ["k"], 1)
LAGS = LagFeatures(2).fit(HOURLY)
OFFSETS = [stamp.tz_localize("UTC" if i % 2 else "Asia/Tokyo") for i, stamp in enumerate(HOURLY.index)]
LINES = detection.TemperatureCompensator(Ridge(), targets=MODES)


def of_covariance(covariance):
    return MahalanobisDetector(covariance=covariance)


def windowed(window, **options):
    return CompensatedDetector(**LINEAR | {"window": window} | options)


DIAGONAL = F.mask(np.eye(6, dtype=bool)[np.arange(len(F)) % 6])
SPACE_BEAM = Beam("left", "apex", **BEAM)


def changed(frame, row, column, value):
    """A copy of a frame with other values at some place."""
    copy = frame.copy()
    copy.iloc[row, column] = value
    return copy


def indexed(index):
    return HOURLY.set_axis(index, axis=0)


def masked(frame):
    """A frame as an array whose first value is masked."""
    values = np.ma.array(frame.to_numpy())
    values[0, 0] = np.ma.masked
    return values


def truss_of(members=BARS, supports=SUPPORTS, nodes=NODES):
    return fem.Structure(nodes, members, supports)


def assembled(parameters=("rafters",), **options):
    return FRAME.assemble(list(parameters), **options)


def affine(stiffness, mass=EYE):
    return AffineModel({("k",): stiffness}, mass, n_modes=1)


def updated(F=NOMINAL, *, model=TRUSS, shapes=None, dofs=None, frequency_std=None, **options):
    return updating.ModelUpdater(model, **options).fit(F, shapes=shapes, dofs=dofs, frequency_std=frequency_std)


def chain(model=TRUSS, **parts):
    return surrogate.DataInformedFEM(model, **(PARTS | {"random_state": 0} | parts))


def of_seed(seed):
    return fit_fleet({"a": Ridge()}, {"a": (T, F)}, random_state=seed)


def means(half_lives, **options):
    return preprocessing.ExponentialMeans(half_lives=half_lives, **options)


def folded(cv):
    return detection.TemperatureCompensator(Ridge(), targets=MODES, cv=cv)


def bare():
    return surrogate.InverseSurrogate(TRUSS, **INVERSE).fit(F)


def detected(index, onset):
    return metrics.time_to_detection(index, 3.0, onset)


def roles(roles):
    return preprocessing.SensorMeans(roles).fit(T)


LISTS = {name: list(values) for name, values in POLES.items()}
NAMED = dict(zip(("frequencies", "shapes"), REFERENCE, strict=True))
OF_SENSORS = NAMED | {"sensors": "abz"}


def tracker(reference, **options):
    return preprocessing.ModeTracker(reference, **options).fit()


def tracked(*, many=False, **changes):
    poles = {"shapes": np.tile(POLES["shapes"][:1], (20, 1, 1))} if many else POLES
    return tracker(REFERENCE).transform(poles | changes)


REFUSED = [  # what is called, what is wrong, the call, and a word of the error
    ("fem.AffineModel", "a bare matrix", lambda: AffineModel(EYE, EYE, n_modes=1), "parameter"),
    ("fem.AffineModel", "a mechanism", lambda: affine([[1.0, -1.0], [-1.0, 1.0]]), "mechanism"),
    ("fem.AffineModel", "mass of another size", lambda: affine(STIFF, np.eye(3)), "mass"),
    ("fem.AffineModel", "negative mass", lambda: affine(STIFF, -EYE), "negative"),
    ("fem.Structure", "two nodes at one place", lambda: truss_of(nodes=NODES | {"b": (3, 2)}), "duplicates"),
    ("fem.Structure", "a node without member", lambda: truss_of(nodes=NODES | {"b": (9, 9)}), "'b'"),
    ("fem.Structure", "length zero", lambda: truss_of(BARS | {"b": Bar("left", "left", **STEEL)}), "'b'"),
    ("fem.Structure", "nothing free", lambda: truss_of(supports=dict.fromkeys(NODES, "xy")), "every node"),
    ("fem.Structure", "a beam in the plane", lambda: truss_of(BARS | {"b": SPACE_BEAM}), "three coordinates"),
    ("fem.Structure", "damage to mass", lambda: assembled(groups={"d": ("density", "rafters")}), "'d'"),
    ("fem.Structure", "neither matrix", lambda: FRAME.assemble({"p": ("E", "rafters", "damping")}), "stiffness"),
    ("fem.CallableModel", "text", lambda: fem.CallableModel(lambda t: "no", ["k"], 1).frequencies([[1]]), "expected"),
    ("fem.match_modes", "too many modes", lambda: fem.match_modes(TRUSS, np.ones((1, 50))), "50"),
    ("fem.match_modes", "no dofs", lambda: fem.match_modes(TRUSS, NOMINAL, shapes=np.ones((2, 6))), "dofs"),
    ("LagFeatures", "a table of lags", lambda: LagFeatures([[1, 2]]).fit(HOURLY), "lags"),
    ("LagFeatures", "a billion lags", lambda: LagFeatures(10**9).fit(HOURLY), "1000000000"),
    ("LagFeatures", "one huge lag", lambda: LagFeatures([10**30]).fit(HOURLY), "lag"),
    ("LagFeatures", "lags of ages", lambda: LagFeatures([0, 10**6]).fit(HOURLY), "years"),
    ("LagFeatures", "freq, no stamps", lambda: LagFeatures(freq="1h").fit([[1.0]] * 9), "Datetime"),
    ("LagFeatures", "tolerance, no stamps", lambda: LagFeatures(tolerance="1h").fit([[1.0]] * 9), "'1h'"),
    ("LagFeatures", "months", lambda: LagFeatures(freq="MS").fit(HOURLY), "fixed length"),
    ("LagFeatures", "unit of months", lambda: LagFeatures(freq=np.timedelta64(1, "M")).fit(HOURLY), "freq|fixed"),
    ("LagFeatures", "business days", lambda: LagFeatures(freq=pd.offsets.BDay()).fit(HOURLY), "freq"),
    ("LagFeatures", "no unit", lambda: LagFeatures(freq="24").fit(HOURLY), "unit"),
    ("LagFeatures", "one stamp", lambda: LagFeatures(2).fit(HOURLY[:1]), "freq"),
    ("LagFeatures", "a stamp twice", lambda: LagFeatures().fit(pd.concat([HOURLY, HOURLY[3:4]])), "03:00"),
    ("LagFeatures", "durations", lambda: LagFeatures().fit(indexed(HOURLY.index - STAMP)), "durations"),
    ("LagFeatures", "text", lambda: LagFeatures().fit(indexed(HOURLY.index.astype(str))), "text"),
    ("LagFeatures", "a missing stamp", lambda: LagFeatures().fit(indexed([None, *HOURLY.index[1:]])), "row 0"),
    ("LagFeatures", "levels", lambda: LagFeatures().fit(HOURLY.set_index([np.ones(20), HOURLY.index])), "levels"),
    ("LagFeatures", "offsets", lambda: LagFeatures().fit(indexed(OFFSETS)), "UTC"),
    ("LagFeatures", "another time zone", lambda: LAGS.transform(HOURLY.tz_localize("UTC")), "UTC"),
    ("LagFeatures", "stamps lost", lambda: LAGS.transform(HOURLY.reset_index(drop=True)), "Datetime"),
    ("LagFeatures", "stamps found", lambda: LagFeatures().fit([[1.0]] * 9).transform(HOURLY), "without"),
    ("ExponentialMeans", "a duration, no stamps", lambda: means(["30D"]).fit([[1.0]] * 9), "'30D'"),
    ("ExponentialMeans", "rows, stamps", lambda: means([3]).fit(HOURLY), "3"),
    ("ExponentialMeans", "months", lambda: means(["1M"]).fit(HOURLY), "fixed length"),
    ("ExponentialMeans", "negative", lambda: means(["-1h"]).fit(HOURLY), "'-1h'"),
    ("ExponentialMeans", "thirty years", lambda: means(["11000D"]).fit(HOURLY), "years"),
    ("ExponentialMeans", "the same twice", lambda: means(["24h", "1D"]).fit(HOURLY), "different"),
    ("ExponentialMeans", "none", lambda: means([]).fit(HOURLY), "half_lives"),
    ("ExponentialMeans", "no rows", lambda: means([0]).fit([[1.0]] * 9), "positive"),
    ("ExponentialMeans", "unknown sensor", lambda: means(["1D"], sensors=["soil"]).fit(HOURLY), "'soil'"),
    ("ExponentialMeans", "no sensor", lambda: means(["1D"], sensors=[]).fit(HOURLY), "sensors"),
    ("ExponentialMeans", "a stamp twice", lambda: means(["1D"]).fit(pd.concat([HOURLY, HOURLY[:1]])), "duplicate"),
    ("HampelFilter", "a time, no stamps", lambda: HampelFilter("1D").fit(F.to_numpy()), "Datetime"),
    ("HampelFilter", "no unit", lambda: HampelFilter("7").fit(F), "unit"),
    ("HampelFilter", "months", lambda: HampelFilter("1M").fit(F), "fixed length"),
    ("HampelFilter", "all targets", lambda: HampelFilter(targets=MODES).fit(F), "6"),
    ("HampelFilter", "unknown target", lambda: HampelFilter(targets=["f9"]).fit(F), "'f9'"),
    ("SensorMeans", "a column without a role", lambda: roles({"T1": "air"}), "each of"),
    ("SensorMeans", "an unknown column", lambda: roles(dict.fromkeys([*T, "T9"], "air")), "T9"),
    ("SensorMeans", "no role", lambda: roles(dict.fromkeys(T)), "at least"),
    ("SensorMeans", "a number", lambda: roles(dict.fromkeys(T, 3)), "'air'"),
    ("BlockedKFold", "block of 0", lambda: preprocessing.BlockedKFold(block=0).fold_of(T), "block is 0"),
    ("BlockedKFold", "block, no stamps", lambda: preprocessing.BlockedKFold(block="7D").fold_of([[1.0]] * 9), "'7D'"),
    ("ModeTracker", "rad/s", lambda: tracked(many=True, frequencies=np.tile([12.6, 13.8], (20, 1))), "rad/s"),
    ("ModeTracker", "no shapes", lambda: tracked(shapes=None), "'shapes'"),
    ("ModeTracker", "negative", lambda: tracked(frequencies=-POLES["frequencies"]), "record 0"),
    ("ModeTracker", "transposed shapes", lambda: tracked(shapes=POLES["shapes"].transpose(0, 2, 1)), "(2, 3, 2)|shape"),
    ("ModeTracker", "complex damping", lambda: tracked(damping=np.ones((2, 2)) * 1j), "complex"),
    ("ModeTracker", "damping of one record", lambda: tracked(damping=np.ones((1, 2))), "damping 1"),
    ("ModeTracker", "shapes of one record", lambda: tracked(**LISTS | {"shapes": LISTS["shapes"][:1]}), "shapes 1"),
    ("ModeTracker", "shapes of one pole", lambda: tracked(**LISTS | {"shapes": [[[1, 2, 1]]] * 2}), "record 0"),
    ("ModeTracker", "an index of another length", lambda: tracked(index=[1, 2, 3]), "3 entries"),
    ("ModeTracker", "transposed reference", lambda: tracker((REFERENCE[0], REFERENCE[1].T)), "transpose"),
    ("ModeTracker", "a shape of zeros", lambda: tracker((REFERENCE[0], 0 * REFERENCE[1])), "zero"),
    ("ModeTracker", "a reference in part", lambda: tracker({"frequencies": REFERENCE[0]}), "'shapes'"),
    ("ModeTracker", "too few sensors", lambda: tracker(NAMED | {"sensors": "ab"}), "2 sensors"),
    ("ModeTracker", "unknown sensors", lambda: tracker(OF_SENSORS).transform(POLES | {"sensors": "abc"}), "'z'"),
    ("ModeTracker", "a duration, no stamps", lambda: tracker(REFERENCE, follow="5D").transform(POLES), "Datetime"),
    ("monitoring.fit_fleet", "a flag as seed", lambda: of_seed(True), "random_state"),
    ("monitoring.fit_fleet", "a negative seed", lambda: of_seed(-1), "random_state"),
    ("BiasAligner", "scaled by zero", lambda: BiasAligner(method="scale").fit([[1.0], [-1.0]]), "zero"),
    ("BiasAligner", "a mode of NaN", lambda: BiasAligner().fit(F.assign(f3=NAN)), "'f3'"),
    ("BiasAligner", "a model of more modes", lambda: BiasAligner(TRUSS).fit(F[["f1", "f2"]]), "6"),
    ("KNNGapImputer", "an empty column", lambda: KNNGapImputer().fit(F.assign(f2=NAN)), "'f2'"),
    ("MahalanobisDetector", "a column of NaN", lambda: MahalanobisDetector().fit(F.assign(f1=NAN)), "'f1'"),
    ("MahalanobisDetector", "gaps", lambda: of_covariance(EmpiricalCovariance()).fit(DIAGONAL), "0 of"),
    ("CompensatedDetector", "a time, no stamps", lambda: windowed("7D").fit(BOTH.reset_index(drop=True)), "'7D'"),
    ("CompensatedDetector", "unsorted", lambda: windowed("7D").fit(BOTH[::-1]), "order"),
    ("CompensatedDetector", "too few rows", lambda: windowed(7).fit(BOTH[:6]), "6"),
    ("CompensatedDetector", "no such input", lambda: windowed(None, regimes=("T9", 0.0)).fit(BOTH), "'T9'"),
    ("OutlierDetector", "no scores", lambda: OutlierDetector(LocalOutlierFactor()).fit(F), "score_samples"),
    ("TemperatureCompensator", "names for an array", lambda: LINES.fit(BOTH.to_numpy()), "targets"),
    ("TemperatureCompensator", "folds that overlap", lambda: folded(ShuffleSplit(3)).fit_transform(BOTH), "cv|fold"),
    ("TemperatureCompensator", "more folds than rows", lambda: folded(9).fit_transform(BOTH[:5]), "9"),
    ("metrics.time_to_detection", "unsorted", lambda: detected(DATED[::-1], DATED.index[0]), "order"),
    ("metrics.time_to_detection", "an onset beyond", lambda: detected(DATED, "2030"), "2030"),
    ("metrics.time_to_detection", "another time zone", lambda: detected(DATED.tz_localize("UTC"), "2025"), "UTC"),
    ("metrics.time_to_detection", "no records", lambda: detected([], None), "0 records"),
    ("minimum_detectable_damage", "signs", lambda: metrics.minimum_detectable_damage([0.1, -0.1], [0, 1]), "-0.1"),
    ("metrics.mape", "another index", lambda: metrics.mape(F, LATE), "indices"),
    ("metrics.mape", "other columns", lambda: metrics.mape(F, F.rename(columns={"f1": "g1"})), "'g1'"),
    ("metrics.mape", "more columns", lambda: metrics.mape(F, F.assign(f7=1.0)), "'f7'"),
    ("metrics.mape", "-999 predicted", lambda: metrics.mape(F, changed(F, 0, 0, -999.0)), "-999"),
    ("metrics.mape", "-999 measured", lambda: metrics.mape(changed(F, 7, 1, -999.0), F), "row 7"),
    ("error_table", "a scenario Average", lambda: metrics.error_table(F, F, scenarios=["Average"] * 120), "Average"),
    ("error_table", "no scenario", lambda: metrics.error_table([1, 2], [1, 2], scenarios=["a", None]), "row 1"),
    ("updating.select_parameters", "text", lambda: updating.select_parameters(pd.DataFrame({"top": ["a"]})), "S"),
    ("identifiability", "some noise", lambda: updating.identifiability(TRUSS, noise=[0] + [1e-3] * 5), "noise"),
    ("identifiability", "dofs alone", lambda: updating.identifiability(TRUSS, noise=0.01, dofs=[0]), "shape_noise"),
    ("ModelUpdater", "bounds without 1", lambda: updated(bounds=[[1.1, 1.3]] * 4), "contain 1"),
    ("ModelUpdater", "F of NaN", lambda: updated(NOMINAL * NAN), "NaN"),
    ("ModelUpdater", "three axes", lambda: updated(NOMINAL[np.newaxis]), "dim"),
    ("ModelUpdater", "shapes without dofs", lambda: updated(shapes=np.ones((2, 6))), "dofs"),
    ("ModelUpdater", "dofs without shapes", lambda: updated(dofs=[0]), "shapes"),
    ("ModelUpdater", "weight without shapes", lambda: updated(shape_weight=1.0), "shapes"),
    ("ModelUpdater", "shapes half NaN", lambda: updated(shapes=[[NAN] * 6, [1] * 6], dofs=[0, 1]), "row 0"),
    ("ModelUpdater", "a program", lambda: updated([[1.0]], model=ONE_MODE, shapes=[[1.0]], dofs=[0]), "'local_modes'"),
    ("InverseSurrogate", "neither model nor theta", lambda: surrogate.InverseSurrogate().fit(), "theta"),
    ("PosteriorInverse", "no model", lambda: surrogate.PosteriorInverse().fit(F), "model"),
    ("InverseSurrogate", "no deviations", lambda: bare().predict(F, return_std=True), "standard deviations"),
    ("DataInformedFEM", "another index", lambda: chain().fit(T, LATE), "different rows"),
    ("DataInformedFEM", "rad/s", lambda: chain().fit(T, F * 2 * np.pi), "rad/s"),
    ("DataInformedFEM", "kHz", lambda: chain().fit(T, F / 1000), "kHz"),
    ("DataInformedFEM", "periods", lambda: chain().fit(T, 1 / F), "periods"),
    ("DataInformedFEM", "all errors", lambda: chain().fit(T + 273.15, F.assign(f2=7.0)), "kelvin.*'f2' is 7"),
    ("MahalanobisDetector", "a constant", lambda: MahalanobisDetector().fit(F.assign(f2=7.0)), "'f2'"),
    ("identify_damage", "rad/s", lambda: studies.identify_damage(CHAIN, T, F * 2 * np.pi), "rad/s"),
    ("DataInformedFEM", "scored on another index", lambda: CHAIN.score(T, LATE), "indices"),
    ("datasets.load_z24", "not that file", lambda: datasets.load_z24(__file__), "readable CSV"),
    ("fem.read_triplets", "infinite values", lambda: fem.read_triplets(FOLDER / "infinite.sti"), "finite"),
    ("fem.AffineModel.frequencies", "1e308", lambda: TRUSS.frequencies([[1e308, 1, 1, 1]]), "theta"),
    ("fem.Structure", "1e308", lambda: truss_of(BARS | {"tie": Bar("left", "right", 1e308, 1.0)}), "E"),
]
PERCENT = [  # shares in percent are refused with a hint
    ("InverseSurrogate", "noise", lambda: surrogate.InverseSurrogate(TRUSS, noise=0.5).fit(), "percent"),
    ("fem.add_noise", "noise by mode", lambda: fem.add_noise(F, [0.5, 0.4, 0.5, 0.6, 0.7, 0.5]), "40 %"),
    ("ModelUpdater", "prior", lambda: updated(prior=30), "0.3 means 30 %"),
    ("studies.Scenario", "severity", lambda: studies.Scenario("a", {"top": 20}), "percent"),
    ("studies.Scenario", "position on a curve", lambda: studies.Scenario("a", {"top": 0.2}, severity=20), "percent"),
    ("studies.Scenario", "strengthening", lambda: studies.Scenario("a", {"top": -15}), "-10"),
    ("studies.sweep", "severities", lambda: studies.sweep(TRUSS, [10, 20]), "percent"),
    ("studies.PODCurve", "severity", lambda: CURVE.predict(20), "shares"),
    ("with_damage_parameters", "range", lambda: TRUSS.with_damage_parameters(["top"], severities=(0, 60)), "below 1"),
]
WARNED_OF = [
    ("reduced model", "outside its box", lambda: REDUCED.frequencies(np.full((3, 4), 2.0)), "outside-bounds"),
    ("fem.CallableModel", "it fails", lambda: FAILING.frequencies([[1]]), "ZeroDivision"),
    ("KNNGapImputer", "-999", lambda: KNNGapImputer().fit(changed(F, 3, 1, -999.0)), "-999"),
    ("BiasAligner", "-999", lambda: BiasAligner().fit(changed(F, 3, 1, -999.0)), "'f2'"),
    ("MahalanobisDetector", "1e6", lambda: MahalanobisDetector().fit(changed(F, 3, 1, 1e6)), "'f2'"),
    ("MahalanobisDetector", "few records", lambda: MahalanobisDetector().fit(F[:20]), "49"),
    ("MahalanobisDetector", "rows lost", lambda: DETECTOR.predict(changed(F, slice(7), slice(None), NAN)), "7 of 120"),
    ("MahalanobisDetector", "all lost", lambda: DETECTOR.predict(F * NAN), "120 of 120"),
    ("MahalanobisDetector", "masked", lambda: OF_ONE_MODE.predict(masked(F)[:, :1]), "1 of 120"),
    ("CompensatedDetector", "few windows", lambda: windowed(2).fit(BOTH[:40]), "49"),
    ("TemperatureCompensator", "kelvin later", lambda: COMPENSATOR.transform((T + 273.15).join(F)), "kelvin"),
    ("TemperatureCompensator", "hot", lambda: COMPENSATOR.transform((T + 60).join(F)), "other-weather"),
    ("ModelUpdater", "rad/s", lambda: updated(NOMINAL * 2 * np.pi), "rad/s"),
    ("ModelUpdater", "far off", lambda: updated(NOMINAL * 1.5), "15 %"),
    ("ModelUpdater", "one mode", lambda: updated([[7.4]], model=datasets.make_truss(1)), "4 parameters"),
    ("ModelUpdater", "modes swapped", lambda: updated(NOMINAL[:, [0, 1, 3, 2, 4, 5]]), "order"),
    ("ModelUpdater", "at the bounds", lambda: updated(NOMINAL * 1.1, bounds=0.1), "'bottom'"),
    ("ModelUpdater", "little noise", lambda: updated(NOMINAL * 1.04 + 1, **LITTLE_NOISE), "frequency_std"),
    ("ModelUpdater", "complex shapes", lambda: updated(shapes=SHAPES * 1j, dofs=DOFS), "complex"),
    ("InverseSurrogate", "rad/s", lambda: SURROGATE.transform(F * 2 * np.pi), "outside-bounds"),
    ("DataInformedFEM", "1.5 times too high", lambda: chain().fit(T, F * 1.5), "differ"),
    ("DataInformedFEM", "modes swapped", lambda: chain().fit(T, F.iloc[:, [0, 1, 3, 2, 4, 5]]), "0, 1, 3, 2"),
    ("DataInformedFEM", "few rows", lambda: chain().fit(T[:20], F[:20]), "few-records"),
    ("DataInformedFEM", "kelvin", lambda: CHAIN.predict(T + 273.15), "other-weather"),
    ("DataInformedFEM", "Fahrenheit", lambda: CHAIN.predict(T * 1.8 + 32), "other-weather"),
]


def with_a_column(bad):
    """Calls with a table that has a bad column, c."""
    return {
        "MahalanobisDetector": lambda: MahalanobisDetector().fit(F.assign(c=bad)),
        "LagFeatures": lambda: LagFeatures(2).fit(T.assign(c=bad)),
        "KNNGapImputer": lambda: KNNGapImputer().fit(F.assign(c=bad)),
        "DataInformedFEM, X": lambda: chain().fit(T.assign(c=bad), F),
        "DataInformedFEM, y": lambda: chain().fit(T, F.assign(c=bad)),
        "TemperatureCompensator": lambda: LINES.fit(BOTH.assign(c=bad)),
        "TemperatureMapper": lambda: surrogate.TemperatureMapper(Ridge()).fit(T, F.assign(c=bad)),
        "metrics.error_table": lambda: metrics.error_table(F.assign(c=1.0), F.assign(c=bad)),
    }


SHARES = pd.Series([0.1, 0.2, 0.3, 0.15], NAMES)
BOX = pd.DataFrame({"lowest": 1 - SHARES, "highest": 1 + SHARES})
STEPS = pd.Series([1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3], MODES)
WEIGHTS = pd.Series(np.linspace(1, 2, len(T)), T.index)
BY_NAME = {  # values with names, and a call that reads them by name
    "theta, a series": (1 + SHARES, TRUSS.frequencies),
    "theta, a frame": ((1 + SHARES).to_frame().T, lambda theta: fem.evaluate(TRUSS, theta).ravel()),
    "half-widths": (SHARES, lambda bounds: fem.sample(TRUSS, bounds, 4, random_state=0).theta),
    "box": (BOX, lambda bounds: fem.sample(TRUSS, bounds, 4, random_state=0).theta),
    "prior": (SHARES, lambda prior: updated(F[:9], prior=prior, bounds=0.9).theta_),
    "severities": (SHARES, lambda damage: TRUSS.damaged(damage).frequencies(np.ones((1, 4)))),
    "severities of a scenario": (
        SHARES,
        lambda damage: CHAIN.simulate(T[:2], damage=studies.Scenario("a", damage).damage),
    ),
    "noise": (STEPS, lambda noise: fem.add_noise(F, noise, random_state=0)),
    "noise of a chain": (STEPS, lambda noise: CHAIN.simulate(T[:5], noise=noise, random_state=0)),
    "noise of an inverse": (
        STEPS,
        lambda noise: surrogate.InverseSurrogate(TRUSS, **INVERSE | {"noise": noise}).fit().transform(NOMINAL),
    ),
    "noise of a campaign": (STEPS, lambda noise: datasets.make_truss_campaign(noise=noise, random_state=0).frequencies),
    "noise of what is identified": (STEPS, lambda noise: updating.identifiability(TRUSS, noise=noise).deviations),
    "deviations": (100 * STEPS, lambda std: updated(F[:9], bounds=0.9, frequency_std=std).theta_),
    "reference": (F.mean(), lambda reference: BiasAligner(reference).fit_transform(F)),
    "weights": (
        WEIGHTS,
        lambda weights: surrogate.TemperatureMapper(Ridge()).fit(T, F / 10, sample_weight=weights).predict(T),
    ),
}


T.join(F).to_csv(FOLDER / "records.csv", index_label="time")
use(
    "preprocessing.read_records",
    lambda **a: preprocessing.read_records(FOLDER / "records.csv", **a),
    temperatures=(list(T), names(list(T))),
    responses=(list(F), names(list(F))),
    zone=("UTC", texts() | bad("Mars")),
    stamps=("ISO8601", texts() | bad("%d.%m.%Y")),
)

registry.NOT_CALLED |= {
    "detection.DamageDetector": "abstract",
    "fem.Element": "a protocol",
    "fem.FEModel": "a protocol",
    "surrogate.FitReport": "made by a chain's fit",
    **dict.fromkeys(
        ("surrogate.refitted", "surrogate.resampled", "surrogate.with_model"),
        "called by studies, which check chains and models; refitted hands records to fit",
    ),
    "preprocessing.RecordFindings": "made by check_records",
    "studies.IdentifiedDamage": "made by identify_damage",
    "studies.PODCurve": "made by pod_curve",
    "fem.FrequencySurface": "made by chains, of what they have checked",
    **dict.fromkeys(("datasets.load_kw51", "datasets.load_z24"), "their tests damage files in every place"),
    **{
        f"plotting.{name}": "draws results of others; tables are tried in from_predictions" for name in plotting.__all__
    },
}
registry.UNTRIED |= {
    "datasets.make_fleet": {"atypical", "kinds"},
    "datasets.make_truss_campaign": {"damage_from", "drift"},
    "detection.OutlierDetector": {"block"},
    "fem.AffineModel": {"contents"},
    "preprocessing.ExponentialMeans": {"half_lives", "recorded", "sensors"},
    "preprocessing.check_records": {"unit"},
    "reporting.owner_report": {"detector", "drift_limit", "fdr", "max_false_alarms", "now"},
    "studies.DetectabilityStudy": {"memory", "models", "n_replicates"},
    "studies.detection_task": {"columns", "gaps", "outliers"},
    "studies.identify_damage": {"n_jobs"},
    "studies.compare_extensions": {"detector"},
    "surrogate.DataInformedFEM": {"discrepancy", "memory"},
    "updating.ModelUpdater": {"reduce"},
}
LEVELS = ["levels of names", "tuples as names", "a number among names"]
CELSIUS = ["kelvin", "Fahrenheit", "tenths of a degree", "one sensor in kelvin", "-999", "9999", "a slipped point"]
UNITS = ["rad/s", "kHz", "periods"]
DERIVATIVES, DRAWN = "fem.modal.LocalModes.derivatives", "plotting.PredictionDisplay.from_predictions"
WEATHER, COMPARED = "surrogate.DataInformedFEM.weather", "studies.compare_extensions"
IN_METRICS = "metrics.probability_of_detection metrics.probability_of_false_alarm metrics.time_to_detection"
A_SERIES = "a series is a vector, or a table of one column"
for argument, callables, causes, reason in [  # bad values that are good for an argument of some callables
    ("window", "preprocessing.HampelFilter", ["a duration"], "a window may be a duration"),
    ("n_deviations", "preprocessing.HampelFilter", ["1e308"], "removes nothing"),
    ("sample_weight", "*", ["true", "booleans", "true inside"], "a mask says which rows count"),
    ("reduce", "*", ["true"], "True takes the default tolerance"),
    ("shapes", "fem.AffineModel.nominal_mac fem.ReducedModel.nominal_mac", ["all nan"], "NaN stays NaN"),
    ("columns", DERIVATIVES, ["too high"], "more modes are kept than are given"),
    ("columns", DERIVATIVES, ["repeated"], "a column may be asked for twice"),
    ("dofs", DERIVATIVES, ["empty"], "documented: saves time where no shapes are wanted"),
    ("phi_a", "fem.mac", ["NaN inside"], "NaN stays NaN"),
    ("phi_b", "fem.mac", ["NaN inside"], "NaN stays NaN"),
    ("weights", "preprocessing.KNNGapImputer", ["None"], "scikit-learn's word for uniform"),
    ("severities", "studies.sweep", ["empty"], "the healthy structure alone"),
    ("modes", COMPARED, ["empty"], "no further modes are asked for"),
    ("baseline_factors", COMPARED, ["empty"], "no longer baselines are asked for"),
    ("follow", "preprocessing.ModeTracker", ["1e308"], "follows the mean of all records"),
    ("tolerance", "preprocessing.LagFeatures", ["zero"], "only records at the very time"),
    ("F", "updating.ModelUpdater.fit", ["NaN throughout"], "shapes alone may be measured"),
    ("damage_index", "*", ["infinite inside"], "an infinite index is an alarm"),
    ("damage_index", "*", ["negative inside"], "other detectors have indices of any sign"),
    ("damage_index", "*", ["empty"], "the rate of no records is NaN"),
    ("threshold", IN_METRICS, ["out of range: -1.0"], "other detectors have indices of any sign"),
    ("reference", "preprocessing.BiasAligner", ["zero inside"], "the frequencies become shifts"),
    ("frequencies", "fem.add_noise fem.match_modes", LEVELS, "names are not matched"),
    ("S", "updating.select_parameters", LEVELS, "names are not matched"),
    ("temperature", "datasets.steel_modulus", LEVELS, "names are not matched"),
    ("measured", DRAWN, LEVELS, "names are not matched"),
    ("frequencies", "fem.add_noise", ["no columns"], "the answer is empty"),
    ("phi_a", "fem.mac", ["no columns"], "the answer is empty"),
    ("phi_b", "fem.mac", ["no columns"], "the answer is empty"),
    ("temperature", "datasets.steel_modulus", ["no columns"], "the answer is empty"),
    ("y", "surrogate.TemperatureMapper surrogate.InverseSurrogate.fit", ["a series"], A_SERIES),
    ("measured", DRAWN, ["a series"], A_SERIES),
    ("temperature", "datasets.steel_modulus", ["a series"], A_SERIES),
    ("frequencies", "preprocessing.check_records", ["a series"], A_SERIES),
    ("X", "surrogate.DataInformedFEM.extrapolation_distance", CELSIUS, "the answer says how far outside"),
    ("X", WEATHER, CELSIUS, "fills gaps alone: predict warns of the weather"),
    ("X", WEATHER, ["stamps missing", "stamps equal", "stamps from numbers"], "there are no lags"),
    ("X", "surrogate.InverseSurrogate", [*UNITS, "9999", "a slipped point", "a mode twice"], "only names are read"),
    ("frequencies", "preprocessing.check_records", UNITS, "without a model, any unit is possible"),
]:
    registry.LEGAL.setdefault(argument, {}).update(
        {(cause, name): reason for name in callables.split() for cause in causes}
    )
