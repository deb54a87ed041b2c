"""Bad values by kind of argument, each with its cause."""

from pathlib import Path

import numpy as np
import pandas as pd
import scipy.sparse
from sklearn.linear_model import LinearRegression, Ridge

from skthermo.fem import AffineModel

NAN, INF, HUGE = float("nan"), float("inf"), 1e308
STAMP = pd.Timestamp("2020-01-01")


def wrong_types(*but):
    """Values that are no number."""
    values = {"true": True, "text": "often", "text of a number": "1", "bytes": b"1", "a time": STAMP} | {
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
    return (
        {"true": True, "text": "7", "negative": -1, "half": 1.5, "too large": 2**40, "NaN": NAN}
        | {"a class": np.random.RandomState, "a generator": np.random.default_rng(0), "several": [1, 2]}
        | {"bytes": b"1"}
    )


def jobs():
    return {"zero": 0, "true": True, "text": "2", "half": 1.5, "NaN": NAN, "a class": int, "several": [1]} | {
        "1e308": HUGE
    }


def names(good, *but):
    """Several names out of those that are known."""
    values = (
        {"unknown": ["no such name"], "one unknown": [*good, "no such name"], "repeated": [*good, good[0]]}
        | {"empty": [], "a number": 3, "numbers": [0.5], "true": True, "bytes": [b"top"]}
        | {"text that is no name": "topbottom", "None": None, "NaN": [NAN], "a class": str}
    )
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
        "booleans": array > 0,
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
        "a generator": (row for row in array),
        "sparse": scipy.sparse.csr_array(np.nan_to_num(array)),
        "no rows": frame[:0] if named else array[:0],
        "no columns": frame.iloc[:, :0] if named else array[:, :0],
        "ragged": [[1.0, 2.0], [1.0]],
    }
    if named:
        levels = pd.MultiIndex.from_product([["a"], frame.columns])
        values |= {
            "a mapping": frame.to_dict("list"),
            "levels of names": frame.set_axis(levels, axis=1),
            "tuples as names": frame.set_axis(pd.Index(list(levels), tupleize_cols=False), axis=1),
        }
        if frame.shape[1] > 1:
            values |= {
                "a series": frame.iloc[:, 0],
                "a number among names": frame.set_axis([0, *frame.columns[1:]], axis=1),
            }
    if named:
        column = frame.columns[0]
        values |= {
            "a column of times": frame.assign(**{column: pd.date_range("2020", periods=len(frame))}),
            "a column of durations": frame.assign(**{column: pd.to_timedelta(np.arange(len(frame)), "h")}),
            "a category": frame.astype({column: "category"}),
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
    if not isinstance(good, pd.DataFrame):
        return table(good, **options) | {"kelvin": good + 273.15}
    column = good.columns[0]
    faults = {
        "kelvin": good + 273.15,
        "Fahrenheit": good * 1.8 + 32,
        "tenths of a degree": good * 10,
        "one sensor in kelvin": good.assign(**{column: good[column] + 273.15}),
        "-999": marked(good, -999.0),
        "9999": marked(good, 9999.0),
        "a slipped point": marked(good, 1e6, once=True),
    }
    values = table(good, **options) | stamps(good) | faults
    return {cause: value for cause, value in values.items() if cause not in options.get("but", ())}


def frequencies(good, *, in_hertz=True, **options):
    """Frequencies in Hz, of a structure whose model is known if a unit can be wrong."""
    units = {"rad/s": good * 2 * np.pi, "kHz": good / 1000, "periods": 1 / good} if in_hertz else {}
    column = good.columns[1] if good.shape[1] > 1 else good.columns[0]
    faults = {
        "-999": marked(good, -999.0),
        "9999": marked(good, 9999.0),
        "a slipped point": marked(good, 1e6, once=True),
        **({"a mode twice": good.assign(**{column: good.iloc[:, 0]})} if good.shape[1] > 1 else {}),
    }
    values = table(good, positive=in_hertz, **options) | stamps(good) | units | faults
    return {cause: value for cause, value in values.items() if cause not in options.get("but", ())}


def marked(good, value, *, once=False):
    """A frame with a value in each ninth row, or once in its first column."""
    rows = np.arange(len(good))
    chosen = (rows == 7) if once else rows % 9 == 3
    changed = good.to_numpy(copy=True)
    changed[np.ix_(chosen, np.arange(good.shape[1]) < (1 if once else good.shape[1]))] = value
    return pd.DataFrame(changed, good.index, good.columns)


def stamps(good):
    """Frames whose times are wrong."""
    return {
        "stamps missing": good.set_axis([pd.NaT, *good.index[1:]]),
        "stamps equal": good.set_axis(good.index[:1].repeat(len(good))),
        "stamps from numbers": good.set_axis(pd.to_datetime(np.arange(len(good)))),
        "stamps as text": good.set_axis(good.index.astype(str)),
    }


def matrix(good, but=()):
    """A symmetric matrix."""
    array = np.asarray(good, dtype=float)
    skew = array.copy()
    skew[0, 1] += 1.0
    values = table(array, nan=False, rows=False, but=("sparse", "no rows")) | {"not symmetric": skew, "empty": []}
    return {cause: value for cause, value in values.items() if cause not in but}


def integers(most, *but):
    """Different integers below some number."""
    values = (
        {"too high": [0, most], "negative": [-1], "repeated": [0, 0], "floats": [0.0], "booleans": [True, False]}
        | {"true inside": [2, True], "texts": ["0"], "a text": "01", "bytes": [b"0"], "times": [STAMP], "empty": []}
        | {"a number": 1, "a table": [[0, 1]], "NaN": [NAN], "None": None, "None inside": [None], "a class": int}
    )
    return {cause: value for cause, value in values.items() if cause not in but}


def instead(*values, **more):
    """Objects in place of an instance of the right class."""
    found = {"None": None, "a number": 3, "text": "model", "true": True, "a class": AffineModel, "an array": np.ones(3)}
    found |= {f"{type(value).__name__} or {value!r:.20}": value for value in values} | {"an empty list": []}
    return found | more


def bad(*values):
    """Bad values that speak for themselves."""
    return {f"{number}: {value!r:.60}": value for number, value in enumerate(values)}


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
    } | {"infinite": INF, "several": [1, 2], "a class": int, "bytes": b"1", "a duration": pd.Timedelta("1D")}
    return {cause: value for cause, value in values.items() if cause not in but}


def durations(*but):
    values = (
        {"text": "often", "negative": "-1h", "zero": "0h", "NaT": pd.NaT, "months": "1M", "true": True}
        | {"NaN": NAN, "a class": pd.Timedelta, "a time": STAMP, "several": ["1h"], "bytes": b"1h"}
        | {"negative number": -1, "half": 1.5, "1e308": HUGE}
    )
    return {cause: value for cause, value in values.items() if cause not in but}


def paths(*but):
    values = (
        {"no file": "no_such_file", "None": None, "a number": 3, "true": True, "bytes": b"file"}
        | {"a device": "/dev/zero", "an empty device": "/dev/null", "a text file": __file__, "several": ["a"]}
        | {"a class": Path, "NaN": NAN, "a folder": "/proc/self/fdinfo", "empty": ""}
    )
    return {cause: value for cause, value in values.items() if cause not in but}
