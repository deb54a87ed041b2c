"""A valid call of every public function, class and method, with bad values of its arguments (`test_bad_input.py`)."""

import importlib
import inspect
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import scipy.sparse
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression, Ridge

import skthermo
from skthermo import datasets, detection, fem, metrics, plotting, preprocessing, reporting, studies, surrogate, updating
from skthermo.fem import AffineModel, Bar, Beam, Membrane, PointMass, Spring

mpl.use("Agg")
np.seterr(all="ignore")
ROOMS = (fem, preprocessing, surrogate, updating, detection, metrics, datasets, studies, plotting, reporting)
NAN, INF, HUGE = float("nan"), float("inf"), 1e308
STAMP = pd.Timestamp("2020-01-01")
FOLDER = Path(tempfile.mkdtemp())

# ------------------------------------------------------------------------------------------- bad values by kind


def wrong_types(*but):
    """Values that are no number."""
    values = {
        "true": True,
        "text": "often",
        "text of a number": "1",
        "bytes": b"1",
        "a time": STAMP,
        "a duration": pd.Timedelta("1h"),
        "complex": 1j,
        "a class": float,
        "None": None,
    }
    return {cause: value for cause, value in values.items() if cause not in but}


def number(*wrong, but=()):
    """One real number; ``wrong`` are those out of range."""
    values = {"NaN": NAN, "infinite": INF, "1e308": HUGE, "several": [0.1, 0.2], "empty": []}
    values |= {f"out of range: {value}": value for value in wrong}
    return wrong_types() | {cause: value for cause, value in values.items() if cause not in but}


def count(*wrong, but=()):
    """One integer from 1 on."""
    return number(1.5, -1, *(() if "zero" in but else (0,)), *wrong, but=but)


def flag(*but):
    """True or False."""
    values = {"one": 1, "zero": 0, "text": "yes", "None": None, "a number": 0.5, "bytes": b"", "several": [True]}
    return {cause: value for cause, value in (values | {"NaN": NAN, "a time": STAMP}).items() if cause not in but}


def choice(*but):
    """One of some texts."""
    values = {"unknown": "else", "empty": "", "number": 3, "true": True, "several": ["a"], "a class": str, "NaN": NAN}
    return {cause: value for cause, value in (values | {"bytes": b"a", "None": None}).items() if cause not in but}


def seed():
    return {
        "true": True,
        "text": "7",
        "negative": -1,
        "half": 1.5,
        "too large": 2**40,
        "NaN": NAN,
        "a class": np.random.RandomState,
        "a generator": np.random.default_rng(0),
        "several": [1, 2],
        "bytes": b"1",
    }


def jobs():
    return {
        "zero": 0,
        "true": True,
        "text": "2",
        "half": 1.5,
        "NaN": NAN,
        "a class": int,
        "several": [1],
        "1e308": HUGE,
    }


def names(good, *but):
    """Several names out of those that are known."""
    values = {
        "unknown": ["no such name"],
        "one unknown": [*good, "no such name"],
        "repeated": [*good, good[0]],
        "empty": [],
        "a number": 3,
        "numbers": [0.5],
        "true": True,
        "bytes": [b"top"],
        "text that is no name": "topbottom",
        "None": None,
        "NaN": [NAN],
        "a class": str,
    }
    return {cause: value for cause, value in values.items() if cause not in but}


def by_key(good, wrong=(), but=()):
    """A mapping of names to numbers."""
    first = next(iter(good))
    values = {
        "unknown": {"no such name": 0.1},
        "a list": list(good),
        "a number": 0.1,
        "text": first,
        "true": True,
        "a class": dict,
        "numbered series": pd.Series(list(good.values())),
        **{f"{cause} inside": {first: value} for cause, value in wrong_types().items()},
        **{f"{value} inside": {first: value} for value in (NAN, INF, HUGE, *wrong)},
    }
    return {cause: value for cause, value in values.items() if cause not in but}


def vector(good, *, positive=True, size=None, wrong=(), but=()):
    """Numbers in one row, or one number for all if ``good`` is a number."""
    array = np.atleast_1d(np.asarray(good, dtype=float))

    def with_first(value):
        return [value, *array[1:].tolist()]

    values = wrong_types() | {
        "texts": array.astype(str),
        "booleans": array > 0,
        "bytes of numbers": array.astype(bytes),
        "times": np.full(array.shape, np.datetime64("2020-01-01")),
        "a category": pd.Series(array).astype("category"),
        "objects": np.array([True] * len(array), dtype=object),
        "true inside": with_first(True),
        "NaN inside": with_first(NAN),
        "infinite inside": with_first(INF),
        "1e308 inside": with_first(HUGE),
        "three axes": array[np.newaxis, np.newaxis],
        "sparse": scipy.sparse.csr_array(np.atleast_2d(array)),
        "empty": [],
    }
    if positive:
        values |= {"negative inside": with_first(-0.1), "zero inside": with_first(0.0)}
    if size:
        values |= {
            "too long": np.full(size + 1, array[0]),
            "other names": pd.Series(array[0], list("abcdefghijk"[:size])),
        }
    values |= {f"out of range: {value}": value for value in wrong}
    return {cause: value for cause, value in values.items() if cause not in but}


def by_name(good, labels, **options):
    """Numbers with names, which may come in another order."""
    array = np.broadcast_to(np.asarray(good, dtype=float), len(labels)) * np.linspace(1, 1.05, len(labels))
    series = pd.Series(array, labels)
    unknown = pd.Series(array, [f"no {label}" for label in labels])
    values = vector(good, size=len(labels), **options) | {
        "one name missing": series[1:],
        "unknown names": unknown,
        "repeated names": pd.concat([series, series[:1]]),
        "times as names": pd.Series(array, pd.date_range("2020", periods=len(labels))),
    }
    return {cause: value for cause, value in values.items() if cause not in options.get("but", ())}


def table(good, *, nan=True, positive=False, fixed=True, rows=True, fitting=False, but=()):
    """Rows and columns of numbers; ``fixed`` columns, ``rows`` that belong to those of another table."""
    frame = good if isinstance(good, pd.DataFrame) else pd.DataFrame(good)
    array, named = frame.to_numpy(), isinstance(good, pd.DataFrame)

    def first(value, dtype=float):
        changed = array.astype(dtype, copy=True)
        changed[0, 0] = value
        return pd.DataFrame(changed, frame.index, frame.columns) if named else changed

    values = wrong_types() | {
        "texts": frame.astype(str) if named else array.astype(str),
        "booleans": frame > 0 if named else array > 0,
        "bytes of numbers": array.astype(bytes),
        "a column of bytes": first(b"1", object),
        "times": np.full(array.shape, np.datetime64("2020-01-01")),
        "objects with true": first(True, object),
        "objects with text": first("1.0", object),
        "objects with a time": first(STAMP, object),
        "complex numbers": array + 1j,
        "infinite inside": first(INF),
        "1e308 inside": first(HUGE),
        "three axes": np.stack([array, array]),
        "a number": 0.5,
        "sparse": scipy.sparse.csr_array(np.nan_to_num(array)),
        "no rows": frame[:0] if named else array[:0],
        "ragged": [[1.0, 2.0], [1.0]],
    }
    if named:
        column = frame.columns[0]
        values |= {
            "a column of times": frame.assign(**{column: pd.date_range("2020", periods=len(frame))}),
            "a column of durations": frame.assign(**{column: pd.to_timedelta(np.arange(len(frame)), "h")}),
            "a category": frame.astype({column: "category"}),
            "nullable booleans": frame.assign(**{column: pd.array([True] * len(frame), dtype="boolean")}),
            "strings": frame.astype({column: "string"}),
            "repeated columns": pd.concat([frame, frame.iloc[:, :1]], axis=1),
            "repeated names": frame.set_axis([column] * frame.shape[1], axis=1) if frame.shape[1] > 1 else None,
        }
        if fixed:
            values |= {
                "unknown names": frame.add_prefix("no "),
                "columns in another order": frame.iloc[:, ::-1] if frame.shape[1] > 1 else None,
            }
    if fixed:
        values["a column too few"] = frame.iloc[:, :-1] if named else array[:, :-1]
        values["a column too many"] = np.column_stack([array, array[:, :1]])
    if rows:
        values["a row too few"] = frame[:-1] if named else array[:-1]
    if not nan:
        values["NaN inside"] = first(NAN)
    if fitting:
        values["NaN throughout"] = frame * NAN if named else array * NAN
        values["constant"] = frame * 0 + 7.0 if named else array * 0 + 7.0
    if positive:
        values |= {"negative inside": first(-1.0), "zero inside": first(0.0)}
    return {cause: value for cause, value in values.items() if cause not in but and value is not None}


def weather(good, **options):
    """Temperatures in degrees Celsius."""
    frame = pd.DataFrame(good)
    values = {
        "kelvin": good + 273.15,
        "-999": frame.where(np.tile(np.arange(len(frame)) != 3, (frame.shape[1], 1)).T, -999.0),
    }
    return table(good, **options) | (values if isinstance(good, pd.DataFrame) else {"kelvin": good + 273.15})


def matrix(good, but=()):
    """A symmetric matrix."""
    array = np.asarray(good, dtype=float)
    skew = array.copy()
    skew[0, 1] += 1.0
    values = table(array, nan=False, rows=False, but=("sparse", "no rows")) | {"not symmetric": skew, "empty": []}
    return {cause: value for cause, value in values.items() if cause not in but}


def integers(most, *but):
    """Different integers below some number."""
    values = {
        "too high": [0, most],
        "negative": [-1],
        "repeated": [0, 0],
        "floats": [0.0],
        "booleans": [True, False],
        "true inside": [2, True],
        "texts": ["0"],
        "a text": "01",
        "bytes": [b"0"],
        "times": [STAMP],
        "empty": [],
        "a number": 1,
        "a table": [[0, 1]],
        "NaN": [NAN],
        "None": None,
        "None inside": [None],
        "a class": int,
    }
    return {cause: value for cause, value in values.items() if cause not in but}


def instead(*values, **more):
    """Objects in place of an instance of the right class."""
    found = {"None": None, "a number": 3, "text": "model", "true": True, "a class": AffineModel, "an array": np.ones(3)}
    found |= {f"{type(value).__name__} or {value!r:.20}": value for value in values} | {"an empty list": []}
    return found | more


def models():
    return instead(Ridge(), {"E": 1.0}, b"truss")


def estimators(*but):
    values = instead(b"mlp", LinearRegression().fit) | {"a class": Ridge, "no predict": np.random.RandomState(0)}
    return {cause: value for cause, value in values.items() if cause not in but}


def texts(*but):
    values = {"a number": 3, "true": True, "None": None, "several": ["a"], "bytes": b"a", "empty": "", "NaN": NAN}
    return {cause: value for cause, value in (values | {"a class": str}).items() if cause not in but}


def moments(*but):
    """A moment of records."""
    values = {
        "NaT": pd.NaT,
        "NaN": NAN,
        "text": "soon",
        "half": 1.5,
        "negative": -1,
        "true": True,
        "too late": 10**6,
        "infinite": INF,
        "several": [1, 2],
        "a class": int,
        "bytes": b"1",
        "a duration": pd.Timedelta("1D"),
    }
    return {cause: value for cause, value in values.items() if cause not in but}


def durations(*but):
    values = {
        "text": "often",
        "negative": "-1h",
        "zero": "0h",
        "NaT": pd.NaT,
        "months": "1M",
        "true": True,
        "NaN": NAN,
        "a class": pd.Timedelta,
        "a time": STAMP,
        "several": ["1h"],
        "bytes": b"1h",
        "negative number": -1,
        "half": 1.5,
        "1e308": HUGE,
    }
    return {cause: value for cause, value in values.items() if cause not in but}


def paths(*but):
    values = {
        "no file": "no_such_file",
        "None": None,
        "a number": 3,
        "true": True,
        "bytes": b"file",
        "a device": "/dev/zero",
        "an empty device": "/dev/null",
        "a text file": __file__,
        "several": ["a"],
        "a class": Path,
        "NaN": NAN,
        "a folder": "/proc/self/fdinfo",
        "empty": "",
    }
    return {cause: value for cause, value in values.items() if cause not in but}


# ------------------------------------------------------------------------------------------------- valid examples


@dataclass
class Example:
    """A call by keywords with a good value of every argument, and the bad values of each."""

    name: str
    of: Any
    call: Any
    good: dict[str, Any] = field(default_factory=dict)
    bad: dict[str, dict[str, Any]] = field(default_factory=dict)


EXAMPLES: list[Example] = []


def use(name, call=None, /, **arguments):
    """Register an example: for every argument a good value and its bad ones."""
    of = skthermo
    for part in name.split("."):
        of = importlib.import_module(f"skthermo.{part}") if of is skthermo else getattr(of, part)
    good = {argument: pair[0] for argument, pair in arguments.items()}
    bad = {argument: pair[1] for argument, pair in arguments.items()}
    EXAMPLES.append(Example(name, of, of if call is None else call, good, bad))


def method(name, owner, **arguments):
    """Register a method of a fixed object."""
    use(name, getattr(owner, name.rpartition(".")[2]), **arguments)


def fitted(cls, X, y=None, after=None, name=None, **arguments):
    """Register an estimator: its parameters, and X and y of ``fit``."""
    if after is None:
        after = lambda estimator, X: estimator.transform(X)  # noqa: E731
    room = cls.__module__.split(".")[1]

    def call(**values):
        given = [values.pop(part) for part in ("X", "y") if part in values]
        return after(cls(**values).fit(*given), X[0])

    data = {"X": X} | ({} if y is None else {"y": y})
    good = {argument: pair[0] for argument, pair in (arguments | data).items()}
    bad = {argument: pair[1] for argument, pair in (arguments | data).items()}
    EXAMPLES.append(Example(name or f"{room}.{cls.__name__}", cls, call, good, bad))


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
DETECTOR = detection.MahalanobisDetector().fit(F)
COMPENSATOR = detection.TemperatureCompensator(Ridge(), targets=MODES).fit(BOTH)
SCENARIOS = studies.sweep(TRUSS, (0.1, 0.3), ["top"])
STUDY = studies.DetectabilityStudy(
    CHAIN, detection.MahalanobisDetector(), SCENARIOS, n_repeats=2, uncertainty="noise", random_state=0
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


def structure(**given):
    """A model of a structure with one changed member."""

    def call(**values):
        return (
            fem.Structure(**given(**values)).assemble(list(given(**values)["groups"]), n_modes=1).frequencies([[1.0]])
        )

    return call


# fem
AFFINE = {
    "stiffness": (
        {("k",): STIFF},
        {c: {("k",): v} for c, v in matrix(STIFF).items()}
        | {"None": None, "text": "K", "a key of numbers": {1: STIFF}, "no terms": {}, "true": True},
    ),
    "mass": (EYE, matrix(EYE, ("a number",))),
    "n_modes": (1, count(3, 1000)),
    "parameter_names": (["k"], names(["k"])),
    "groups": (
        {"all": ["k"]},
        {
            "a list": ["k"],
            "unknown": {"all": ["x"]},
            "empty": {"all": []},
            "true": True,
            "a number": 3,
            "text": "k",
            "None inside": {"all": None},
            "too high": {"all": [4]},
            "true inside": {"all": [True]},
        },
    ),
    "track": (False, flag()),
    "dof_names": (["x", "y"], names(["x", "y"], "unknown", "one unknown", "text that is no name") | {"too few": ["x"]}),
}
use("fem.AffineModel", lambda **a: fem.AffineModel(**a).frequencies([[1.0]]), **AFFINE)
for owner in (TRUSS, REDUCED):
    kind = type(owner).__name__
    rows = table(THETA, nan=False, positive=True, rows=False, but=("no rows",))
    one = table(ROW, nan=False, positive=True, rows=False, but=())
    for name in ("frequencies", "modes", "jacobian", "linearised"):
        method(f"fem.{kind}.{name}", owner, theta=(THETA, rows))
    method(f"fem.{kind}.linearised_modes", owner, theta=(THETA, rows), dofs=(DOFS, integers(23)))
    use(
        f"fem.{kind}.local_modes",
        lambda owner=owner, **a: owner.local_modes(**a).shapes(DOFS),
        theta=(ROW, one),
        follow=(False, flag()),
    )
    use(f"fem.{kind}.matrices", lambda owner=owner, **a: [m.toarray() for m in owner.matrices(**a)], theta=(ROW, one))
    use(
        f"fem.{kind}.rescaled",
        lambda owner=owner, **a: owner.rescaled(**a).frequencies(np.ones((1, 4))),
        theta=(ROW, one),
    )
    use(
        f"fem.{kind}.damaged",
        lambda owner=owner, **a: owner.damaged(**a).frequencies(np.ones((1, 4))),
        damage=({"top": 0.1}, DAMAGE),
    )
    use(
        f"fem.{kind}.with_modes",
        lambda owner=owner, **a: owner.with_modes(**a).frequencies(np.ones((1, 4))),
        modes=([0, 1], integers(23)),
    )
    use(
        f"fem.{kind}.with_parameters",
        lambda owner=owner, **a: owner.with_parameters(**a).frequencies(np.ones((1, 2))),
        names=(["top", "bottom"], names(["top", "bottom"])),
    )
    use(
        f"fem.{kind}.with_added",
        lambda owner=owner, **a: owner.with_added(**a).frequencies(np.ones((1, 4))),
        stiffness=(np.eye(23), matrix(np.eye(23))),
        mass=(np.eye(23), matrix(np.eye(23))),
    )
    use(
        f"fem.{kind}.with_damage_parameters",
        lambda owner=owner, **a: owner.with_damage_parameters(**a).parameter_names,
        groups=(["top"], names(["top"])),
        severities=(
            (-0.1, 0.5),
            {
                "percent": (-10, 50),
                "one": 0.5,
                "text": ("a", "b"),
                "true": (True, False),
                "NaN": (NAN, 0.5),
                "reversed": (0.5, -0.1),
                "None": None,
                "three": (0, 0.1, 0.2),
                "whole": (0.0, 1.0),
                "1e308": (0, HUGE),
                "a class": tuple,
            },
        ),
    )
    use(
        f"fem.{kind}.reduced",
        lambda owner=owner, **a: owner.reduced(**a).frequencies(np.ones((1, 4))),
        bounds=(0.1, BOUNDED),
        tol=(1e-2, number(0, -1, 1.0)),
        random_state=(0, seed()),
    )
    method(
        f"fem.{kind}.nominal_mac",
        owner,
        shapes=(
            TRUSS.modes(np.ones((1, 4)))[1],
            {
                "None": None,
                "text": "x",
                "two axes": np.ones((23, 2)),
                "other rows": np.ones((1, 5, 2)),
                "texts": np.full((1, 23, 2), "1"),
                "booleans": np.ones((1, 23, 2), dtype=bool),
                "NaN": np.full((1, 23, 2), NAN),
                "times": np.full((1, 23, 2), STAMP),
            },
        ),
    )
use(
    "fem.ReducedModel",
    lambda **a: fem.ReducedModel(**a).frequencies(np.ones((1, 4))),
    full=(TRUSS, models()),
    bounds=(0.1, BOUNDED),
    tol=(1e-2, number(0, -1, 1.0)),
    random_state=(0, seed()),
)
LOCAL = TRUSS.local_modes(ROW)
method("fem.LocalModes.shapes", LOCAL, dofs=(DOFS, integers(23)))
method("fem.LocalModes.derivatives", LOCAL, columns=([0, 1], integers(6)), dofs=(DOFS, integers(23)))


def member(cls, **extra):
    """One member in a structure that stands."""

    def call(**values):
        element = cls(**values)
        if cls is Bar:
            whole = fem.Structure(NODES, BARS | {"tie": element}, SUPPORTS, {"g": ["tie"]})
        elif cls is Beam:
            whole = fem.Structure(
                SPACE,
                {"b": element, "c": Beam("b", "c", **BEAM)},
                {"a": ["x", "y", "z", "rx", "ry", "rz"]},
                {"g": ["b"]},
            )
        elif cls is Membrane:
            whole = fem.Structure(SQUARE, {"m": element}, {"a": "xy", "b": "xy"}, {"g": ["m"]})
        else:
            whole = fem.Structure(NODES, BARS | {"s": element}, SUPPORTS, GROUPS | {"g": ["s"]})
        return whole.assemble(["g" if cls is not PointMass else "rafters"], n_modes=1).frequencies([[1.1]])

    return call


BEAM = {"E": 210e9, "G": 80e9, "A": 0.01, "I_yy": 1e-5, "I_zz": 1e-5, "J": 1e-5, "density": 7850.0}
NODE = {
    "unknown": "nowhere",
    "None": None,
    "true": True,
    "a number": 0.5,
    "several": ["left"],
    "NaN": NAN,
    "a class": str,
    "bytes": b"left",
}
MAY_BE_0 = number(-1.0)
VECTOR = {
    "text": "up",
    "two": (0.0, 1.0),
    "NaN": (NAN, 0.0, 1.0),
    "texts": ("0", "0", "1"),
    "booleans": (True, False, True),
    "true": True,
    "infinite": (INF, 0, 0),
    "1e308": (HUGE, 0, 0),
    "a number": 1.0,
    "times": (STAMP,) * 3,
    "complex": (1j, 0, 0),
    "a class": tuple,
    "bytes": b"001",
}
RELEASES = {
    "unknown": ["rw"],
    "a number": 3,
    "true": True,
    "None": None,
    "NaN": [NAN],
    "bytes": b"ry",
    "numbers": [1],
    "a class": str,
}
use(
    "fem.Bar",
    member(Bar),
    start=("left", NODE),
    end=("right", NODE),
    E=(210e9, PHYSICAL),
    A=(0.01, PHYSICAL),
    density=(7850.0, MAY_BE_0),
    lumped=(False, flag()),
)
use(
    "fem.Beam",
    member(Beam),
    start=("a", NODE),
    end=("b", NODE),
    **{name: (value, MAY_BE_0 if name == "density" else PHYSICAL) for name, value in BEAM.items()},
    I_p=(2e-5, number(-1.0)),
    orientation=((0.0, 0.0, 1.0), VECTOR | {"zero": (0.0, 0.0, 0.0), "along the beam": (1.0, 0.0, 0.0)}),
    lumped=(False, flag()),
    release_start=((), RELEASES),
    release_end=((), RELEASES),
    offset_start=((0.0, 0.0, 0.1), VECTOR),
    offset_end=((0.0, 0.0, 0.1), VECTOR),
)
use(
    "fem.Membrane",
    member(Membrane),
    corners=(
        tuple("abcd"),
        {
            "three": tuple("abc"),
            "unknown": tuple("abcx"),
            "repeated": tuple("abca"),
            "None": None,
            "a number": 3,
            "true": True,
            "crossed": tuple("acbd"),
            "several": [["a", "b"]] * 4,
            "a class": tuple,
        },
    ),
    E=(2e9, PHYSICAL),
    t=(0.1, PHYSICAL),
    nu=(0.3, number(-2, 0.6, 30)),
    density=(2500.0, MAY_BE_0),
    lumped=(False, flag()),
)
use("fem.PointMass", member(PointMass), node=("apex", NODE), m=(5.0, PHYSICAL))
use(
    "fem.Spring",
    member(Spring),
    node=("apex", NODE),
    direction=(
        "y",
        {
            "unknown": "w",
            "two": "xy",
            "None": None,
            "a number": 1,
            "true": True,
            "bytes": b"y",
            "a class": str,
            "NaN": NAN,
            "several": ["y"],
        },
    ),
    k=(1e6, PHYSICAL),
)
use(
    "fem.Structure",
    lambda **a: fem.Structure(**a).assemble(["rafters"], n_modes=1).frequencies([[1.0]]),
    nodes=(
        NODES,
        {"None": None, "a list": [(0, 0)], "text": "xy", "true": True, "a number": 3, "empty": {}}
        | {c: NODES | {"apex": v} for c, v in (VECTOR | {"three": (1.0, 2.0, 3.0)}).items() if c != "two"},
    ),
    members=(
        BARS,
        {
            "None": None,
            "a list": list(BARS.values()),
            "text": "bars",
            "true": True,
            "empty": {},
            "a class": BARS | {"tie": Bar},
            "text inside": BARS | {"tie": "bar"},
            "None inside": BARS | {"tie": None},
            "a number inside": BARS | {"tie": 3},
            "disconnected": {"tie": BARS["tie"]},
        },
    ),
    supports=(
        SUPPORTS,
        {
            "None": None,
            "a list": ["left"],
            "text": "left",
            "true": True,
            "unknown node": {"pier": "xy"},
            "unknown direction": {"left": "xw", "right": "y"},
            "a number": {"left": 1},
            "None inside": {"left": None},
            "bytes": {"left": b"xy"},
            "true inside": {"left": True},
            "numbers": {"left": [0, 1]},
            "a mechanism": {"left": "x"},
            "repeated": {"left": "xx", "right": "y"},
        },
    ),
    groups=(
        GROUPS,
        {
            "a list": ["tie"],
            "text": "tie",
            "true": True,
            "a number": 3,
            "unknown": {"rafters": ["post"]},
            "empty": {"rafters": []},
            "None inside": {"rafters": None},
            "numbers": {"rafters": [3]},
            "text inside": {"rafters": "rafter"},
            "repeated": {"rafters": ["rafter 1", "rafter 1"]},
        },
    ),
)
TARGETS = names(["rafters"], "a number") | {
    "a number": 3,
    "a property": {"p": ("nu", "rafters")},
    "four": {"p": ("E", "rafters", "mass", 1)},
    "number inside": {"p": 1},
    "None inside": {"p": None},
    "true inside": {"p": True},
}
use(
    "fem.Structure.assemble",
    lambda **a: FRAME.assemble(**a).frequencies([[1.0]]),
    parameters=(["rafters"], TARGETS),
    groups=(["rafters"], TARGETS),
    n_modes=(2, count(50)),
    track=(False, flag()),
)
use(
    "fem.CallableModel",
    lambda **a: fem.CallableModel(**a).frequencies([[1.0], [1.1]]),
    **PROGRAM,
    n_modes=(1, count(2)),
    vectorized=(False, flag()),
    cache=(
        None,
        {
            "true": True,
            "a number": 3,
            "bytes": b"c",
            "a folder": str(FOLDER),
            "a text file": __file__,
            "a class": Path,
            "NaN": NAN,
        },
    ),
)
PROGRAMMED = fem.CallableModel(lambda theta: [theta[0] ** 0.5], ["k"], 1)
method(
    "fem.CallableModel.frequencies",
    PROGRAMMED,
    theta=(
        pd.DataFrame({"k": [1.0, 1.1]}),
        table(
            pd.DataFrame({"k": [1.0, 1.1]}),
            nan=False,
            positive=True,
            rows=False,
            but=("no rows", "columns in another order"),
        ),
    ),
)
use(
    "fem.add_noise",
    frequencies=(F, table(F, fixed=False, rows=False, but=("no rows", "repeated names", "repeated columns"))),
    noise=(0.01, NOISE),
    random_state=(0, seed()),
)
for name in ("evaluate", "linearise"):
    more = (
        {"progress": (False, flag("None"))}
        if name == "evaluate"
        else {"relative": (False, flag()), "step": (1e-3, number(0, -1, 1.0, 10))}
    )
    use(
        f"fem.{name}",
        model=(TRUSS, models()),
        theta=(THETA, table(THETA, positive=True, rows=False, but=("no rows",))),
        n_jobs=(1, jobs()),
        **more,
    )
for name in ("evaluate_modes", "linearise_modes"):
    more = {"step": (1e-3, number(0, -1, 1.0, 10))} if name == "linearise_modes" else {}
    use(
        f"fem.{name}",
        model=(TRUSS, models()),
        theta=(THETA, table(THETA, positive=True, rows=False, but=("no rows",))),
        dofs=(DOFS, integers(23)),
        n_jobs=(1, jobs()),
        **more,
    )
use(
    "fem.mac",
    phi_a=(
        SHAPES,
        table(SHAPES, nan=False, rows=True, fixed=False, but=("1e308 inside", "complex numbers", "no rows")),
    ),
    phi_b=(
        SHAPES,
        table(SHAPES, nan=False, rows=True, fixed=False, but=("1e308 inside", "complex numbers", "no rows")),
    ),
)
use(
    "fem.match_modes",
    model=(TRUSS, models()),
    frequencies=(F, table(F, positive=True, rows=False, fixed=False)),
    shapes=(SHAPES, table(SHAPES, rows=True, but=("complex numbers",))),
    dofs=(DOFS, integers(23)),
)
use(
    "fem.probe",
    lambda **a: fem.probe(**a).frequencies([[1.0]]),
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
    track=(False, flag()),
    n_checks=(1, count(but=("zero",))),
    random_state=(0, seed()),
)
use(
    "fem.sample",
    model=(TRUSS, models()),
    bounds=(0.2, BOUNDED),
    n_samples=(4, count()),
    method=("lhs", choice()),
    dofs=(DOFS, integers(23)),
    n_jobs=(1, jobs()),
    progress=(False, flag("None")),
    random_state=(0, seed()),
)
use(
    "fem.shape_components",
    shapes=(
        SHAPES.T[np.newaxis],
        {
            "None": None,
            "text": "x",
            "two axes": SHAPES,
            "texts": SHAPES.T[np.newaxis].astype(str),
            "booleans": SHAPES.T[np.newaxis] > 0,
            "infinite": SHAPES.T[np.newaxis] * INF,
            "other sensors": SHAPES.T[np.newaxis, :, :2],
            "times": np.full((1, 6, 3), STAMP),
            "sparse": scipy.sparse.csr_array(SHAPES),
            "1e308": np.full((1, 6, 3), HUGE),
            "a class": float,
            "true": True,
        },
    ),
    reference=(SHAPES, table(SHAPES, nan=False, rows=True, fixed=True)),
)
use(
    "fem.shape_jacobian",
    model=(TRUSS, models()),
    theta=(ROW, table(ROW, nan=False, positive=True, rows=False)),
    dofs=(DOFS, integers(23)),
)
use(
    "fem.share_reordered",
    model=(TRUSS, models()),
    theta=(THETA, table(THETA, nan=False, positive=True, rows=False, but=("no rows",))),
)
np.savez(FOLDER / "model.npz", E=STIFF, M=EYE)
use(
    "fem.load_affine",
    lambda **a: fem.load_affine(**a).frequencies([[1.0]]),
    path=(FOLDER / "model.npz", paths()),
    stiffness=(["E"], names(["E"])),
    mass=("M", texts() | {"unknown": "X"}),
    total=(None, texts() | {"unknown": "X"}),
    n_modes=(1, count(3)),
    parameter_names=(["E"], names(["E"])),
    groups=({"all": ["E"]}, AFFINE["groups"][1]),
    track=(False, flag()),
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
    preprocessing.BiasAligner,
    (F, PLAIN),
    reference=(NOMINAL[0], by_name(NOMINAL[0], MODES, but=("negative inside",))),
    method=("shift", choice()),
)
ALIGNED = preprocessing.BiasAligner(TRUSS).fit(F)
SAME = table(F, rows=False)
method("preprocessing.BiasAligner.transform", ALIGNED, X=(F, SAME))
method("preprocessing.BiasAligner.inverse_transform", ALIGNED, X=(F, SAME))
use(
    "preprocessing.BlockedKFold",
    lambda **a: preprocessing.BlockedKFold(**a).fold_of(F),
    n_splits=(3, count(1, 10**6)),
    block=("7D", durations()),
)
method(
    "preprocessing.BlockedKFold.fold_of",
    preprocessing.BlockedKFold(3),
    X=(F, {"None": None, "a number": 3, "true": True, "two rows": F[:2], "no rows": F[:0], "a class": pd.DataFrame}),
)
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
        vector(np.ones(len(T)), size=None, but=("zero inside",))
        | {"other rows": pd.Series(1.0, T.index.shift(1)), "too few": np.ones(3)},
    ),
)
method("preprocessing.HingeFeatures.transform", preprocessing.HingeFeatures().fit(T), X=(T, table(T, rows=False)))
GAPPY = F.mask(np.arange(len(F))[:, np.newaxis] % 7 == np.arange(6))
fitted(
    preprocessing.KNNGapImputer,
    (GAPPY, table(GAPPY, fixed=False, rows=False, fitting=True, but=("constant",))),
    n_neighbors=(3, count()),
    weights=("uniform", choice()),
    metric=("nan_euclidean", choice()),
    copy=(True, flag()),
    add_indicator=(False, flag()),
    keep_empty_features=(False, flag()),
    missing_values=(
        NAN,
        {"text": "missing", "several": [NAN], "a class": float, "a time": STAMP, "true": True, "bytes": b"x"},
    ),
)
method(
    "preprocessing.KNNGapImputer.transform",
    preprocessing.KNNGapImputer().fit(GAPPY),
    X=(GAPPY, table(GAPPY, rows=False)),
)
fitted(
    preprocessing.LagFeatures,
    (
        HOURLY,
        table(HOURLY, fixed=False, rows=False, but=("repeated columns",))
        | {
            "stamps as text": HOURLY.set_axis(HOURLY.index.astype(str)),
            "a missing stamp": HOURLY.set_axis([pd.NaT, *HOURLY.index[1:]]),
            "stamps twice": pd.concat([HOURLY, HOURLY]),
        },
    ),
    lags=(
        2,
        count()
        | {
            "texts": ["1"],
            "true inside": [0, True],
            "negative inside": [-1],
            "repeated": [1, 1],
            "NaN inside": [0, NAN],
            "times": [STAMP],
            "several": [0.5, 1.5],
        },
    ),
    freq=("1h", durations()),
    tolerance=("3h", durations()),
    padding=("nan", choice()),
)
method(
    "preprocessing.LagFeatures.transform",
    preprocessing.LagFeatures(2).fit(HOURLY),
    X=(HOURLY, table(HOURLY, rows=False)),
)
POLES = {"frequencies": np.array([[2.0, 2.2], [2.1, 2.15]]), "shapes": np.array([[[1, 2.0, 1], [1, 0, -1]]] * 2)}
REFERENCE = (np.array([2.0, 2.2]), np.array([[1.0, 1], [2, 0], [1, -1]]))
POLED = {
    c: POLES | {"frequencies": v}
    for c, v in table(POLES["frequencies"], fixed=False).items()
    if c not in ("NaN throughout",)
}
POLED |= {
    f"shapes: {c}": POLES | {"shapes": v}
    for c, v in {
        "texts": POLES["shapes"].astype(str),
        "booleans": POLES["shapes"] > 0,
        "two axes": POLES["shapes"][0],
        "infinite": POLES["shapes"] * INF,
        "other sensors": POLES["shapes"][:, :, :2],
        "text": "x",
    }.items()
}
REFERRED = {
    "None": None,
    "text": "model",
    "true": True,
    "a number": 3,
    "one part": (REFERENCE[0],),
    "a class": tuple,
    "empty": (),
} | {f"frequencies: {c}": (v, REFERENCE[1]) for c, v in vector(REFERENCE[0], size=2).items()}
REFERRED |= {
    f"shapes: {c}": (REFERENCE[0], v)
    for c, v in table(REFERENCE[1], nan=False, but=("None", "no rows", "a row too few", "complex numbers")).items()
}
use(
    "preprocessing.ModeTracker",
    lambda **a: (
        preprocessing.ModeTracker(**{k: v for k, v in a.items() if k != "X"}).fit().transform(a["X"]).frequencies
    ),
    X=(POLES, POLED | {"None": None, "text": "poles", "a number": 3, "true": True, "empty": {}, "a class": dict}),
    reference=(REFERENCE, REFERRED),
    max_shift=(0.15, number(0, 1, 15, -0.1)),
    min_mac=(0.8, number(1, 80, -0.1)),
    follow=(10, durations("negative number", "half") | {"zero number": 0, "negative number": -1}),
    max_drift=(0.3, number(1, 30, -0.1)),
    close=(0.02, number(1, 2, -0.1)),
)

# surrogate
PREDICTING = weather(T, rows=False)
WEATHER = weather(T, rows=True, fixed=False, fitting=True)
MEASURED = table(F, rows=True, positive=True, fitting=True, but=("unknown names", "columns in another order"))


def chain_of(**values):
    X, y = values.pop("X"), values.pop("y")
    return surrogate.DataInformedFEM(**values).fit(X, y).predict(T)


PARTS = {"inverse": surrogate.InverseSurrogate(**INVERSE), "mapper": surrogate.TemperatureMapper(Ridge())}
use(
    "surrogate.DataInformedFEM",
    chain_of,
    model=(TRUSS, models()),
    inverse=(PARTS["inverse"], estimators()),
    mapper=(PARTS["mapper"], estimators()),
    aligner=("passthrough", estimators()),
    imputer=("passthrough", estimators()),
    reduce=(False, number(0, 1.0, -1, but=()) | {"one": 1}),
    n_jobs=(1, jobs()),
    random_state=(0, seed()),
    X=(T, WEATHER),
    y=(F, MEASURED),
)
use(
    "surrogate.DataInformedFEM.fit",
    lambda **a: surrogate.DataInformedFEM(TRUSS, **PARTS, random_state=0).fit(**a).predict(T),
    X=(T, WEATHER),
    y=(F, MEASURED),
    shapes=(
        None,
        {
            "text": "x",
            "a number": 3,
            "true": True,
            "two axes": SHAPES,
            "times": np.full((120, 6, 3), STAMP),
            "without dofs": np.ones((120, 6, 3)),
        },
    ),
)
for name in ("predict", "predict_parameters", "extrapolation_distance", "predict_interval", "weather"):
    more = {
        "predict": {"return_std": (False, flag())},
        "predict_interval": {"confidence": (0.9, number(0, 1, 90, -0.1))},
    }.get(name, {})
    method(f"surrogate.DataInformedFEM.{name}", CHAIN, X=(T, PREDICTING), **more)
method(
    "surrogate.DataInformedFEM.score", CHAIN, X=(T, weather(T, rows=True)), y=(F, table(F, rows=True, positive=True))
)
use(
    "surrogate.DataInformedFEM.estimate_parameters",
    CHAIN.estimate_parameters,
    F=(F, table(F, rows=False, positive=True)),
    shapes=(None, {"text": "x", "a number": 3, "true": True, "two axes": SHAPES}),
)
CHANGES = {
    "damage": (
        {"top": 0.1},
        by_key({"top": 0.1}, wrong=(20, 1.0, -15))
        | {
            "rows too few": {"top": np.full(3, 0.1)},
            "texts": {"top": np.full(120, "0.1")},
            "booleans": {"top": np.ones(120, dtype=bool)},
        },
    ),
    "parameters": ({"top": 1.02}, PARAMETERS),
    "stiffness": (np.eye(23), matrix(np.eye(23))),
    "mass": (np.eye(23), matrix(np.eye(23))),
}
SHARE_OF_VALUES = number(-0.1, 1.0, 90, but=("None", "several", "empty"))
FAULTS = {
    "gaps": (0.1, SHARE_OF_VALUES | {"unknown": "often"}),
    "outliers": (0.01, SHARE_OF_VALUES | {"unknown": "often", "rows too few": np.full((3, 6), 5.0)}),
}
method(
    "surrogate.DataInformedFEM.simulate",
    CHAIN,
    X=(T, PREDICTING),
    **CHANGES,
    **FAULTS,
    noise=(0.01, NOISE),
    random_state=(0, seed()),
)
INVERTING = {
    "regressor": (Ridge(), estimators("None")),
    "bounds": (0.2, BOUNDED),
    "n_samples": (50, count(1)),
    "narrow_bounds": (False, flag()),
    "noise": (0.01, NOISE),
    "dofs": (None, integers(23)),
    "refine": (2, number(0.5, -1)),
    "prior": (0.2, PRIOR),
    "reduce": (False, number(0, 1.0, -1) | {"one": 1}),
    "memory": (
        None,
        {
            "true": True,
            "a number": 3,
            "bytes": b"m",
            "a text file": __file__,
            "a class": Path,
            "NaN": NAN,
            "several": ["m"],
        },
    ),
    "n_jobs": (1, jobs()),
    "random_state": (0, seed()),
}
INVERTED = table(F, rows=False, positive=True, but=("unknown names", "columns in another order"))
use(
    "surrogate.InverseSurrogate",
    lambda **a: (
        surrogate.InverseSurrogate(**{k: v for k, v in a.items() if k not in "Xy"}).fit(a["X"], a["y"]).transform(F)
    ),
    model=(TRUSS, models()),
    **INVERTING,
    X=(F, INVERTED),
    y=(None, {}),
)
SHAPED = dict(INVERSE, dofs=DOFS)
EXAMPLES.append(
    Example(
        "surrogate.InverseSurrogate",
        surrogate.InverseSurrogate,
        lambda **a: surrogate.InverseSurrogate(TRUSS, **SHAPED, **a).fit().round_trip(),
        {"shape_noise": 0.01},
        {"shape_noise": by_name(0.01, MODES, wrong=(1.0, 5))},
    )
)
use(
    "surrogate.InverseSurrogate.fit",
    lambda **a: surrogate.InverseSurrogate(None, Ridge()).fit(**a).transform(F),
    X=(F, table(F, rows=True, fixed=False, fitting=True)),
    y=(CHAIN.parameters_, table(CHAIN.parameters_, rows=True, fixed=False, but=("a number",))),
)
for name in ("transform", "predict", "invert"):
    more = {"return_std": (False, flag())} if name == "predict" else {}
    method(f"surrogate.InverseSurrogate.{name}", SURROGATE, X=(F, table(F, rows=False, positive=True)), **more)
method(
    "surrogate.InverseSurrogate.inverse_transform",
    SURROGATE,
    X=(THETA, table(THETA, rows=False, positive=True, but=("no rows",))),
)
method(
    "surrogate.InverseSurrogate.score",
    SURROGATE,
    X=(F, table(F, rows=True, positive=True)),
    y=(CHAIN.parameters_, table(CHAIN.parameters_, rows=True)),
)
fitted(
    surrogate.TemperatureMapper,
    (T, WEATHER),
    (CHAIN.parameters_, table(CHAIN.parameters_, rows=True, fixed=False, fitting=True, but=("a number", "constant"))),
    after=lambda estimator, X: estimator.predict(X),
    regressor=(Ridge(), estimators("None")),
    random_state=(0, seed()),
)
use(
    "surrogate.TemperatureMapper.fit",
    lambda **a: surrogate.TemperatureMapper(Ridge()).fit(T, CHAIN.parameters_, **a).predict(T),
    sample_weight=(
        pd.Series(1.0, T.index),
        vector(np.ones(len(T)), but=("zero inside",))
        | {"other rows": pd.Series(1.0, T.index.shift(1)), "too few": np.ones(3)},
    ),
)
method("surrogate.TemperatureMapper.predict", MAPPER, X=(T, table(T, rows=False)), return_std=(False, flag()))
method(
    "surrogate.TemperatureMapper.score",
    MAPPER,
    X=(T, table(T, rows=True)),
    y=(CHAIN.parameters_, table(CHAIN.parameters_, rows=True)),
)
use("surrogate.paper_network", lambda **a: surrogate.paper_network(**a).hidden_layer_sizes, network=("truss", choice()))

# updating
UPDATED = table(
    F, rows=False, positive=True, fitting=True, but=("constant", "unknown names", "columns in another order")
)
UPDATER = {
    "model": (TRUSS, models()),
    "bounds": (0.2, BOUNDED),
    "shape_weight": (1.0, by_name(1.0, MODES, but=("zero inside",))),
    "n_starts": (1, count()),
    "method": ("least_squares", choice()),
    "prior": (0.2, PRIOR),
    "max_iter": (50, count()),
    "n_jobs": (1, jobs()),
    "random_state": (0, seed()),
}
use("updating.ModelUpdater", lambda **a: updating.ModelUpdater(**a).fit(F, shapes=SHAPES, dofs=DOFS).theta_, **UPDATER)
use(
    "updating.ModelUpdater.fit",
    lambda **a: updating.ModelUpdater(TRUSS, shape_weight=1.0, bounds=0.2).fit(**a).theta_,
    F=(F, UPDATED),
    shapes=(SHAPES, table(SHAPES, rows=True, but=("complex numbers",))),
    dofs=(DOFS, integers(23)),
    frequency_std=(0.1, by_name(0.1, MODES)),
)
use("updating.cramer_rao", information=(STIFF, matrix(STIFF)))
use(
    "updating.identifiability",
    lambda **a: updating.identifiability(**a).deviations,
    model=(TRUSS, models()),
    theta=(ROW, table(ROW, nan=False, positive=True, rows=False)),
    noise=(0.01, NOISE),
    dofs=(DOFS, integers(23)),
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
    model=(TRUSS, models()),
    theta=(ROW, table(ROW, nan=False, positive=True, rows=False)),
    method=("central", choice()),
    step=(0.01, number(0, -1, 1.0)),
)

# detection
CONTAMINATED = number(0, -0.1, 0.6, 2)
WATCHED = table(F, fixed=False, rows=False, fitting=True)
DAMAGE_INDEX = lambda detector, X: detector.damage_index(X)  # noqa: E731
fitted(
    detection.MahalanobisDetector,
    (F, WATCHED),
    after=DAMAGE_INDEX,
    contamination=(0.05, CONTAMINATED),
    covariance=(None, estimators("None")),
    threshold=("conformal", choice()),
)
fitted(
    detection.OutlierDetector,
    (F, WATCHED),
    after=DAMAGE_INDEX,
    estimator=(IsolationForest(n_estimators=5, random_state=0), estimators()),
    contamination=(0.05, CONTAMINATED),
)
fitted(
    detection.WindowedAlarm,
    (F, WATCHED),
    after=DAMAGE_INDEX,
    window=(3, durations("negative", "zero") | {"zero": 0, "negative": "-1h", "None": None}),
    rule=("m-of-n", choice()),
    m=(2, count(9)),
    contamination=(0.05, CONTAMINATED),
)
PAIR = [
    ("a", detection.MahalanobisDetector()),
    ("b", detection.OutlierDetector(IsolationForest(n_estimators=5, random_state=0))),
]
fitted(
    detection.FusedDetector,
    (F, WATCHED),
    after=DAMAGE_INDEX,
    detectors=(
        PAIR,
        {
            "None": None,
            "text": "a",
            "a number": 3,
            "true": True,
            "empty": [],
            "repeated": [PAIR[0], PAIR[0]],
            "without names": [PAIR[0][1]],
            "a class": [("a", detection.MahalanobisDetector)],
            "None inside": [("a", None)],
            "text inside": [("a", "b")],
            "a number as name": [(3, PAIR[0][1])],
        },
    ),
    contamination=(0.05, CONTAMINATED),
)
for name in ("damage_index", "decision_function", "predict", "score_samples"):
    for owner in (
        DETECTOR,
        detection.OutlierDetector(IsolationForest(n_estimators=5, random_state=0)).fit(F),
        detection.WindowedAlarm(3).fit(F),
        detection.FusedDetector(PAIR).fit(F),
    ):
        method(f"detection.{type(owner).__name__}.{name}", owner, X=(F, table(F, rows=False)))
fitted(
    detection.TemperatureCompensator,
    (
        BOTH,
        table(
            BOTH,
            rows=False,
            but=("unknown names", "columns in another order", "a column too few", "a column too many"),
            fitting=True,
        ),
    ),
    estimator=(Ridge(), estimators()),
    targets=(MODES, names(MODES) | {"too high": [9], "booleans": [True] * 9, "floats": [1.5], "all": list(BOTH)}),
    cv=(
        3,
        count(1, 10**6)
        | {"several": [1, 2], "text": "5", "a class": preprocessing.BlockedKFold, "ragged": [([0], [1]), ([1],)]},
    ),
    whiten=("global", choice("None")),
)
method("detection.TemperatureCompensator.transform", COMPENSATOR, X=(BOTH, table(BOTH, rows=False)))
WHITENER = detection.TemperatureCompensator(Ridge(), targets=MODES, whiten="local").fit(BOTH)
method("detection.TemperatureCompensator.extrapolation_distance", WHITENER, X=(BOTH, table(BOTH, rows=False)))

# metrics
PREDICTED = F * 1.01
for name in ("mape", "error_table", "complete_r2"):
    positive = name != "complete_r2"
    more = (
        {
            "scenarios": (
                ["a", "b"] * 60,
                {
                    "too few": ["a"],
                    "text": "all",
                    "a number": 3,
                    "true": True,
                    "None inside": [None] * 120,
                    "NaN inside": [NAN] * 120,
                    "a class": str,
                },
            )
        }
        if name == "error_table"
        else {}
    )
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
        vector([0.1, 0.5, 1.0], but=("zero inside", "NaN inside"))
        | {"percent": [10, 50, 100], "too long": [0.1, 0.2, 0.3, 0.4]},
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
    updated=(False, flag()),
)
use(
    "datasets.make_truss_campaign",
    n_years=(1, count()),
    samples_per_year=(12, count()),
    samples_per_day=(1, count()),
    noise=(0.01, NOISE),
    damage=({"top": 0.1}, DAMAGE),
    random_state=(0, seed()),
)
GROUP = next(iter(datasets.make_kw51_campaign(n_hours=24, random_state=0).model.groups))
use(
    "datasets.make_kw51_campaign",
    n_hours=(48, count()),
    noise=(0.01, NOISE),
    gaps=(False, flag()),
    retrofit=(False, flag()),
    drift=({GROUP: 0.01}, by_key({GROUP: 0.01}, wrong=(1000,))),
    damage=({GROUP: 0.1}, by_key({GROUP: 0.1}, wrong=(20, 1.0))),
    damage_from=(
        "2018-10-02",
        moments("half", "too late", "negative") | {"too late": "2030-01-01", "too early": "2000-01-01", "a number": 5},
    ),
    shapes=(False, flag()),
    random_state=(0, seed()),
)
use(
    "datasets.steel_modulus",
    temperature=(
        T,
        table(
            T,
            rows=False,
            fixed=False,
            but=(
                "three axes",
                "a number",
                "no rows",
                "repeated columns",
                "repeated names",
                "negative inside",
                "zero inside",
            ),
        )
        | {"kelvin": T + 273.15},
    ),
)

# studies
use(
    "studies.Scenario",
    lambda **a: CHAIN.simulate(LATER.temperatures, **studies.Scenario(**a).changes(T)),
    name=("a", texts()),
    damage=({"top": 0.1}, by_key({"top": 0.1}, wrong=(20, 1.0, -15), but=("unknown",))),
    parameters=({"top": 1.02}, by_key({"top": 1.02}, wrong=(0, -1), but=("unknown",))),
    stiffness=(np.eye(23), matrix(np.eye(23), ("a column too many", "a column too few"))),
    mass=(np.eye(23), matrix(np.eye(23), ("a column too many", "a column too few"))),
    family=("top", texts()),
    severity=(0.1, number(20, 1.0, but=("NaN",))),
)
use(
    "studies.ProgressiveDamage",
    lambda **a: CHAIN.simulate(LATER.temperatures, **studies.ProgressiveDamage(**a).changes(LATER.temperatures)),
    name=("a", texts()),
    damage=({"top": 0.1}, by_key({"top": 0.1}, wrong=(20, 1.0, -15), but=("unknown",))),
    onset=(2, moments() | {"None": None}),
    end=(10, moments() | {"before the onset": 1}),
)
DRAWS = pd.DataFrame({"top": [0.1, 0.2], "bottom": [0.0, 0.1]})
use(
    "studies.UncertainDamage",
    lambda **a: CHAIN.simulate(LATER.temperatures, **studies.UncertainDamage(**a).changes(T)),
    name=("a", texts()),
    draws=(DRAWS, table(DRAWS, nan=False, rows=False, fixed=False) | {"percent": DRAWS * 100}),
)
method("studies.Scenario.changes", studies.Scenario("a", {"top": 0.1}), T=(T, {}), repeat=(0, number(0.5, -1)))
method(
    "studies.ProgressiveDamage.changes",
    studies.ProgressiveDamage("a", {"top": 0.1}, 2),
    T=(T, {"None": None, "a number": 3, "true": True, "text": "T", "a class": pd.DataFrame}),
    repeat=(0, number(0.5, -1)),
)
method("studies.UncertainDamage.changes", studies.UncertainDamage("a", DRAWS), T=(T, {}), repeat=(0, number(0.5, -1)))
use(
    "studies.sweep",
    lambda **a: [one.severity for one in studies.sweep(**a)],
    model=(TRUSS, models()),
    severities=(
        [0.1, 0.2],
        vector([0.1, 0.2], but=("negative inside",))
        | {"percent": [10, 20], "a text": ".1", "whole": [1.0], "repeated": [0.1, 0.1], "a number": 0.1},
    ),
    groups=(["top"], names(["top"]) | {"a known text": "top"}),
)
ARGUMENTS = {"fem": (CHAIN, models() | {"not fitted": surrogate.DataInformedFEM(TRUSS)})}
use(
    "studies.DetectabilityStudy",
    lambda **a: studies.DetectabilityStudy(
        **{k: v for k, v in a.items() if k not in ("T", "baseline", "reference", "confidence")}, uncertainty="noise"
    ).run(a["T"], a["baseline"], reference=a["reference"], confidence=a["confidence"])["rate"],
    **ARGUMENTS,
    detectors=(
        detection.MahalanobisDetector(),
        estimators() | {"empty": {}, "no name": {"": detection.MahalanobisDetector()}, "a number": {3: None}},
    ),
    scenarios=(
        SCENARIOS,
        {
            "None": None,
            "text": "healthy",
            "a number": 3,
            "true": True,
            "empty": [],
            "repeated": [SCENARIOS[0]] * 2,
            "texts": ["a"],
            "a class": [studies.Scenario],
            "unknown group": [studies.Scenario("a", {"deck": 0.1})],
            "unknown parameter": [studies.Scenario("a", parameters={"deck": 1.1})],
            "other matrix": [studies.Scenario("a", mass=np.eye(2))],
        },
    ),
    n_repeats=(1, count()),
    noise=(0.01, NOISE),
    n_jobs=(1, jobs()),
    random_state=(0, seed()),
    T=(LATER.temperatures, weather(LATER.temperatures, rows=False)),
    baseline=(F, table(F, rows=False, fitting=True)),
    reference=(
        {"healthy": LATER.frequencies},
        {"text": "F", "a number": 3, "true": True, "unknown": {"no": F}, "None inside": {"healthy": None}}
        | {f"inside: {c}": {"healthy": v} for c, v in table(LATER.frequencies, rows=False).items()},
    ),
    confidence=(0.9, number(0, 1, 90, -0.1)),
)
method(
    "studies.DetectabilityStudy.pod_curve",
    STUDY,
    family=("top", texts() | {"unknown": "no"}),
    source=("simulated", texts() | {"unknown": "no"}),
    log=(False, flag()),
)
method(
    "studies.DetectabilityStudy.is_undetected",
    STUDY,
    family=("top", texts() | {"unknown": "no"}),
    source=("simulated", texts() | {"unknown": "no"}),
)
method(
    "studies.DetectabilityStudy.minimum_detectable_damage",
    STUDY,
    level=(0.9, number(-0.1, 90)),
    method=("grid", choice()),
)
method(
    "studies.DetectabilityStudy.ranking",
    STUDY,
    max_false_alarms=(0.02, number(-0.1, 2)),
    source=("simulated", texts() | {"unknown": "no"}),
    confidence=(0.9, number(0, 1, 90)),
    by=("pod", choice()),
)
method(
    "studies.DetectabilityStudy.time_to_detection",
    STUDY,
    within=(["7D"], {"a number": [7], "texts": ["soon"], "negative": ["-1D"], "a time": STAMP, "true": [True]}),
    level=(0.9, number(0, 1, 90)),
    source=("simulated", texts() | {"unknown": "no"}),
    confidence=(0.9, number(0, 1, 90, but=("None",))),
    smallest=(False, flag()),
)
method("studies.DetectabilityStudy.detector_name", STUDY, detector=("MahalanobisDetector", texts("None")))
COUNTED = vector([3.0, 10.0, 19.0], but=("zero inside",)) | {
    "too long": [1, 2, 3, 4],
    "more than records": [30, 10, 19],
}
use(
    "studies.pod_curve",
    lambda **a: studies.pod_curve(**a).slope,
    severities=([0.1, 0.2, 0.3], vector([0.1, 0.2, 0.3]) | {"percent": [10, 20, 30], "too long": [0.1, 0.2, 0.3, 0.4]}),
    n_detected=([3, 10, 19], COUNTED),
    n_records=([20, 20, 20], vector([20.0, 20.0, 20.0], but=("zero inside",)) | {"too long": [20] * 4}),
    log=(False, flag()),
    confidence=(0.9, number(0, 1, 90, -0.1)),
)
method(
    "studies.PODCurve.predict",
    CURVE,
    severity=(0.2, vector(0.2, wrong=(20,), but=("zero inside", "empty", "three axes"))),
)
method(
    "studies.PODCurve.severity_at", CURVE, pod=(0.9, number(0, 1, 90, -0.1)), confidence=(0.9, number(0, 1, 90, -0.1))
)
use(
    "studies.identify_damage",
    lambda **a: studies.identify_damage(**a).severities,
    **ARGUMENTS,
    T=(LATER.temperatures, weather(LATER.temperatures, rows=True)),
    F=(LATER.frequencies, table(LATER.frequencies, rows=True, positive=True)),
    groups=(["top"], names(["top"]) | {"unknown inside": {"a": ["no"]}, "empty inside": {"a": []}}),
    noise=(0.01, NOISE),
    prior=(None, instead({"severity": 0.2}, (0.5, 0.5), studies.DamagePrior)),
    stiffening=(["top"], names(["top"]) | {"a number": 1}),
    parameters=(["top"], names(["top"])),
    added_mass=({"ballast": np.ones(23)}, {"text": "x", "a number": 5.0, "other length": {"ballast": np.ones(4)}}),
    shapes=(
        (SHAPES, SHAPES * 1.01),
        {
            "text": "x",
            "one": SHAPES,
            "true": True,
            "texts": (SHAPES.astype(str), SHAPES),
            "booleans": (SHAPES > 0, SHAPES),
            "other sensors": (SHAPES[:2], SHAPES),
            "None inside": (None, SHAPES),
            "infinite": (SHAPES * INF, SHAPES),
        },
    ),
    dofs=(DOFS, integers(23)),
    shape_noise=(0.01, by_name(0.01, MODES, wrong=(5,))),
    models=(None, instead([], [1.0], TRUSS)),
    random_state=(0, seed()),
)
use(
    "studies.DamagePrior",
    lambda **a: studies.DamagePrior(**a),
    numbers=(
        (0.5, 0.5),
        {"text": "x", "too many": (0.2,) * 5, "negative": (1.5, -0.5), "one": (1.0,), "sum": (0.5, 0.4)},
    ),
    severity=(0.2, number(0, 2, -0.1)),
    law=("uniform", choice()),
    something_else=(0.1, number(1.5, -0.1)),
    model_error=(0.03, number(1.5, -0.1)),
)
use("studies.IdentifiedDamage.scenario", lambda **a: FOUND.scenario(**a).name, name=("found", texts()))
use(
    "studies.compare_extensions",
    lambda **a: studies.compare_extensions(**a)["gain"],
    study=(STUDY, instead(studies.DetectabilityStudy(CHAIN, DETECTOR, SCENARIOS))),
    T=(LATER.temperatures, weather(LATER.temperatures, rows=False)),
    modes=([6], integers(23) | {"measured": [0]}),
    noise=(0.01, by_name(0.01, ["mode 7"], wrong=(0.5, 5), but=("zero inside", "other names"))),
    baseline_factors=([2.0], vector([2.0]) | {"one": [1.0], "a number": 2.0, "text": "2"}),
    sensors=(None, {}),
)

# plotting and reporting
use(
    "reporting.owner_report",
    subject=(STUDY, instead(studies.DetectabilityStudy(CHAIN, DETECTOR, SCENARIOS))),
    path=(
        FOLDER / "report.html",
        {
            "None": None,
            "a number": 3,
            "true": True,
            "a folder": str(FOLDER),
            "bytes": b"r",
            "several": ["a"],
            "a class": Path,
            "NaN": NAN,
            "no folder": FOLDER / "no" / "report.html",
        },
    ),
    identified=(FOUND, instead() | {"a list": [FOUND]}),
    title=("Bridge", texts("empty")),
    structure=(None, instead()),
)
use(
    "plotting.PredictionDisplay.from_predictions",
    lambda **a: [plotting.PredictionDisplay.from_predictions(**a), 0][1],
    measured=(F, table(F, rows=False, fixed=False, but=("NaN inside",))),
)


# newer arguments
CLOCKED = F.set_axis(pd.date_range("2020-01-01", periods=len(F), freq="h"))
fitted(
    preprocessing.HampelFilter,
    (BOTH, table(BOTH, fixed=False, rows=False, but=("repeated columns",))),
    window=(5, number(-1, 0, 0.5, but=("several", "empty"))),
    n_deviations=(6.0, number(-1.0, 0.0)),
    targets=(MODES, names(MODES)),
)
use("preprocessing.check_records", temperatures=(T, table(T, fixed=False)), frequencies=(F, table(F, fixed=False)))
use("preprocessing.residual_trend", residuals=(F, table(F, fixed=False, rows=False)))
fitted(
    detection.OutlierDetector,
    (F, {}),
    after=DAMAGE_INDEX,
    estimator=(IsolationForest(n_estimators=5, random_state=0), {}),
    threshold=("conformal", choice()),
)
use(
    "metrics.complete_r2",
    y_true=(F, {}),
    y_pred=(PREDICTED, {}),
    sample_weight=(np.ones(len(F)), vector(np.ones(len(F)), but=("zero inside",))),
)
use(
    "surrogate.InverseSurrogate",
    lambda **a: surrogate.InverseSurrogate(TRUSS, **INVERSE, **a).fit().transform(F),
    verbose=(False, flag("one", "zero")),
)
use(
    "surrogate.DataInformedFEM",
    lambda **a: surrogate.DataInformedFEM(TRUSS, **PARTS, random_state=0, **a).fit(T, F).predict(T),
    verbose=(False, flag("one", "zero")),
)
use(
    "studies.DetectabilityStudy",
    lambda **a: studies.DetectabilityStudy(
        CHAIN, detection.MahalanobisDetector(), SCENARIOS[:1], n_repeats=1, **({"uncertainty": "noise"} | a)
    ).run(LATER.temperatures, F)["rate"],
    verbose=(False, flag("one", "zero")),
    gaps=("fitted", choice("None")),
    outliers=("fitted", choice("None")),
    uncertainty=("noise", choice()),
)
use(
    "studies.detection_task",
    lambda **a: studies.detection_task(**a).y,
    **ARGUMENTS,
    T=(LATER.temperatures, weather(LATER.temperatures, rows=False)),
    scenarios=(SCENARIOS, {"None": None, "text": "healthy", "a number": 3, "empty": [], "texts": ["a"]}),
    baseline=(F, table(F, rows=False)),
    n_repeats=(2, count()),
    n_splits=(2, count(1)),
    noise=(0.01, NOISE),
    max_false_alarms=(0.02, number(-0.1, 2)),
    random_state=(0, seed()),
)
use("fem.add_noise", frequencies=(F, {}), noise=(0.01, {}), correlation=(0.5, number(-1.0, 1.0)))
for name in ("make_truss_campaign", "make_kw51_campaign"):
    size = (
        {"samples_per_year": (12, {})} if name == "make_truss_campaign" else {"n_hours": (48, {}), "gaps": (False, {})}
    )
    use(f"datasets.{name}", **size, correlation=(0.5, number(-1.0, 1.0)), random_state=(0, {}))
use(
    "datasets.make_fleet",
    lambda **a: list(datasets.make_fleet(**a)),
    n_bridges=(3, count()),
    random_state=(0, seed()),
)
fitted(preprocessing.SensorMeans, (T, {}), roles=(None, {"a number": 3, "text": "air", "true": True}))
use("preprocessing.find_memory", temperatures=(T, table(T, fixed=False)), frequencies=(F, table(F, fixed=False)))


IGNORED = {"y", "input_features", "groups of split"}

NOT_CALLED = {
    "fem.BatchModel": "a protocol",
    "fem.DamageableModel": "a protocol",
    "fem.DifferentiableModel": "a protocol",
    "fem.Element": "a protocol",
    "fem.FEModel": "a protocol",
    "fem.LocalModel": "a protocol",
    "fem.ModalModel": "a protocol",
    "fem.LocalModes": "made by a model's local_modes",
    "surrogate.FitReport": "made by a chain's fit",
    "preprocessing.RecordFindings": "made by check_records",
    "studies.IdentifiedDamage": "made by identify_damage",
    "studies.LocatedDamage": "made by locate_damage",
    "studies.locate_damage": "not tried: it wants a structure whose model is fitted",
    "preprocessing.MemoryFindings": "made by find_memory",
    "datasets.BridgeFleet": "made by make_fleet",
    "datasets.FleetBridge": "made by make_fleet",
    "studies.PODCurve": "made by pod_curve",
    "datasets.load_kw51": "files have a benchmark of their own, fuzz_loaders.py",
    "datasets.load_z24": "files have a benchmark of their own, fuzz_loaders.py",
    **{
        f"plotting.{name}": "draws results of others; tables are tried in from_predictions" for name in plotting.__all__
    },
}
"""Public names whose constructors are not tried, with reasons."""

UNTRIED = {
    "datasets.make_fleet": {"atypical", "kinds"},
    "datasets.make_truss_campaign": {"damage_from", "drift"},
    "detection.OutlierDetector": {"block"},
    "fem.AffineModel": {"contents"},
    "preprocessing.ExponentialMeans": {"sensors", "time_constants"},
    "preprocessing.check_records": {"unit"},
    "reporting.owner_report": {"detector", "drift_limit", "fdr", "max_false_alarms", "now"},
    "studies.DetectabilityStudy": {"models", "n_replicates"},
    "studies.detection_task": {"columns", "gaps", "outliers"},
    "studies.identify_damage": {"n_jobs"},
    "studies.compare_extensions": {"detector"},
    "surrogate.DataInformedFEM": {"discrepancy", "memory"},
    "updating.ModelUpdater": {"reduce"},
}
"""Arguments that have no bad values in this table."""

LEGAL: dict[str, dict[tuple[str, str], str]] = {
    "window": {("a duration", "preprocessing.HampelFilter"): "a window may be a duration"},
    "n_deviations": {("1e308", "preprocessing.HampelFilter"): "removes nothing"},
    "sample_weight": {(cause, "*"): "a mask says which rows count" for cause in ("true", "booleans", "true inside")},
    "reduce": {("true", "*"): "True takes the default tolerance"},
    "shapes": {("NaN", f"fem.{kind}.nominal_mac"): "NaN stays NaN" for kind in ("AffineModel", "ReducedModel")},
    "columns": {
        ("too high", "fem.LocalModes.derivatives"): "more modes are kept than are given",
        ("repeated", "fem.LocalModes.derivatives"): "a column may be asked for twice",
    },
    "dofs": {("empty", "fem.LocalModes.derivatives"): "documented: saves time where no shapes are wanted"},
    "phi_a": {("NaN inside", "fem.mac"): "NaN stays NaN"},
    "phi_b": {("NaN inside", "fem.mac"): "NaN stays NaN"},
    "weights": {("None", "preprocessing.KNNGapImputer"): "scikit-learn's word for uniform"},
    "severities": {("empty", "studies.sweep"): "the healthy structure alone"},
    "information": {("NaN inside", "updating.cramer_rao"): "NaN stays NaN"},
    "modes": {("empty", "studies.compare_extensions"): "no further modes are asked for"},
    "baseline_factors": {("empty", "studies.compare_extensions"): "no longer baselines are asked for"},
    "follow": {("1e308", "preprocessing.ModeTracker"): "follows the mean of all records"},
    "tolerance": {("zero", "preprocessing.LagFeatures"): "only records at the very time"},
    "X": {
        ("kelvin", "surrogate.DataInformedFEM.extrapolation_distance"): "the answer says how far outside",
        ("-999", "surrogate.DataInformedFEM.extrapolation_distance"): "the answer says how far outside",
    },
    "F": {("NaN throughout", "updating.ModelUpdater.fit"): "shapes alone may be measured"},
    "damage_index": {
        ("infinite inside", "*"): "an infinite index is an alarm",
        ("negative inside", "*"): "other detectors have indices of any sign",
        ("empty", "*"): "the rate of no records is NaN",
    },
    "threshold": {
        ("out of range: -1.0", f"metrics.{name}"): "other detectors have indices of any sign"
        for name in ("probability_of_detection", "probability_of_false_alarm", "time_to_detection")
    },
    "reference": {("zero inside", "preprocessing.BiasAligner"): "the frequencies become shifts"},
}
"""Bad values that are good for an argument: (cause, callable or *) and the reason."""


def public_arguments():
    """Name and argument of every public function and constructor, but for those that are not tried."""
    for room in ROOMS:
        for name in room.__all__:
            full = f"{room.__name__.split('.')[-1]}.{name}"
            if full in NOT_CALLED:
                continue
            for argument, parameter in inspect.signature(getattr(room, name)).parameters.items():
                keyed = parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
                if keyed and argument not in UNTRIED.get(full, ()):
                    yield full, argument
