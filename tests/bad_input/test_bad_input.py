"""Bad input to every public name: each is a clear error or one warning, none is silent.

Bad values of every argument are generated (``examples.py``); a part of them is tried here each time, all at night. What
depends on several arguments is listed there, by callable and cause.
"""

import contextlib
import functools
import importlib
import inspect
import re
import signal
import traceback
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
import sklearn.utils._param_validation
import sklearn.utils.validation

import skthermo
from skthermo.exceptions import SkthermoWarning
from skthermo.preprocessing import RecordFindings
from tests.bad_input import registry

SHARE = 97  # of so many bad values one is tried each time
KINDS = ["legal", "refused", "warned", "silent", "unclear"]
MOST = {"silent": 0.005, "unclear": 0.002}  # shares of all bad values
MOST_OF_A_PART = 0.01  # share of both together in a part of them, in which there may be more by chance
ERRORS = (ValueError, TypeError, FileNotFoundError)
OURS = str(Path(skthermo.__file__).parent)
CHECKED_BY = (OURS, str(Path(sklearn.utils._param_validation.__file__)), str(Path(sklearn.utils.validation.__file__)))
SECONDS = 60
HERE = str(Path(__file__).parent)

FROM_THE_DEPTHS = re.compile(
    "broadcast|setting an array element|object has no attribute|out of bounds|not supported between"
    "|is not (subscriptable|iterable|callable)|has no len|^could not convert|unsupported operand|ufunc|unhashable"
    "|cannot be interpreted|must be real number|not aligned|argument must be a string or a real number|bad operand"
    "|unexpected keyword|positional argument|not understood|could not be resolved|inhomogeneous"
)
"""Messages of NumPy, SciPy, pandas and Python about what a wrong input led to."""

SAYS_WHAT = re.compile(
    "[Ee]xpected|must be|should match|is expecting|not fitted|is none of these|not readable as|; found"
    "|while a minimum of \\d+ is required"
    r"|: .+\. [A-Z].+\. [A-Z]"
)
"""What says what was got and what was expected, or what was found, what follows and what to do; of scikit-learn's words
those on parameters, on other columns and on too few rows or columns."""


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
    where = traceback.extract_tb(error.__traceback__)[-1].filename
    if not where.startswith(CHECKED_BY):
        return False
    return bool(SAYS_WHAT.search(text) or (where.startswith(OURS) and re.search(rf"\b{re.escape(argument)}\b", text)))


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


def findings(result):
    """Kinds of what `check_records` has found."""
    return set(result.table["what"]) if isinstance(result, RecordFindings) else set()


@functools.cache
def good_answer(number):
    """The result and the warnings of the valid call of an example, which only values that are not refused need."""
    example = registry.EXAMPLES[number]
    result, error, warned = answer(example, example.good)
    assert error is None, f"the good example of {example.name} fails: {error!r}"
    return result, warned


def verdict(number, argument, cause, value):
    """One of "legal", "refused", "warned", "silent", "unclear", and what was said."""
    example = registry.EXAMPLES[number]
    with np.errstate(all="ignore"):
        result, error, warned = answer(example, example.good | {argument: value})
    if isinstance(error, TooLong):
        return "unclear", f"still running after {SECONDS} s"
    if error is not None:
        where = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {error}"
        return ("refused", said) if is_clear(error, argument) else ("unclear", f"{said} ({where.filename[-40:]})")
    good_result, good_warnings = good_answer(number)
    if ("another order" in cause or "stamps" in cause) and same(result, good_result):
        return "legal", "read by name, or row by row"
    named = findings(result) - findings(good_result)
    if named:
        return "warned", f"findings: {sorted(named)}"
    new = {text for text in warned if not any(re.sub(r"\d", "", text) == re.sub(r"\d", "", o) for o in good_warnings)}
    return ("warned", next(iter(new))) if new else ("silent", f"gave {result!r:.80}")


def all_examples():
    """The registered examples of all modules."""
    for module in ("examples", "in_service"):
        importlib.import_module(f"tests.bad_input.{module}")
    return registry.EXAMPLES


def bad_values():
    """Number of an example, argument, name of the fault and a bad value of it, but for values that are legal."""
    for number, example in enumerate(all_examples()):
        for argument, bad in example.bad.items():
            default = inspect.Parameter.empty
            with contextlib.suppress(KeyError, TypeError, ValueError):
                default = inspect.signature(example.of).parameters[argument].default
            for cause, value in bad.items():
                if {(cause, "*"), (cause, example.name)} & registry.LEGAL.get(argument, {}).keys():
                    continue
                if value is default or (isinstance(value, type(default)) and np.ndim(value) == 0 and value == default):
                    continue
                yield number, argument, cause, value


class Tried(NamedTuple):
    """A bad value that was tried: "legal", "refused", "warned", "silent" or "unclear", and what was said."""

    callable: str
    argument: str
    cause: str
    kind: str
    said: str


def tried(every=1, beginnings=()):
    """Try every so many bad values, of callables whose names begin so."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        values = [(registry.EXAMPLES[number].name, number, *bad) for number, *bad in bad_values()]
    for name, number, argument, cause, value in [one for one in values if one[0].startswith(beginnings or "")][::every]:
        yield Tried(name, argument, cause, *verdict(number, argument, cause, value))


def assert_refused_or_warned_of(every):
    """Hardly any bad value is accepted as if it were good, or refused without a word on why."""
    results = list(tried(every))
    wrong = {
        kind: [f"{one.callable}({one.argument}: {one.cause}) {one.said:.220}" for one in results if one.kind == kind]
        for kind in MOST
    }
    assert sum(map(len, wrong.values())) <= MOST_OF_A_PART * len(results), wrong
    for kind, most in MOST.items() if every == 1 else ():
        assert len(wrong[kind]) <= most * len(results), f"{kind}:\n" + "\n".join(wrong[kind])
    assert sum(one.kind == "refused" for one in results) > 0.9 * len(results)


def test_a_bad_value_of_an_argument_is_refused_or_warned_of():
    assert_refused_or_warned_of(SHARE)


@pytest.mark.nightly
def test_every_bad_value_of_every_argument_is_refused_or_warned_of():
    assert_refused_or_warned_of(1)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore")
def test_every_public_argument_has_bad_values():
    tried = {(example.name, argument) for example in all_examples() for argument in example.bad}
    untried = sorted(set(registry.public_arguments()) - tried)
    assert not untried, f"tests/bad_input/examples.py: give them a good value and bad ones: {untried}"


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
    if {(issubclass(one.category, SkthermoWarning), one.filename.startswith(HERE)) for one in given} != {(True, True)}:
        return f"warnings are {[str(warning) for warning in given]}, expected SkthermoWarning at the user's line"
    said = sum(bool(re.search(message, str(warning.message))) for warning in given)
    return None if said == 1 else f"{said} warnings say {message!r}: {[str(warning.message) for warning in given]}"


def assert_no_complaints(rows):
    wrong = [f"{name}: {cause}: {text}" for name, cause, *answer in rows if (text := complaint(*answer))]
    assert not wrong, "\n" + "\n".join(wrong)


@pytest.fixture(scope="module")
def examples():
    """The calls, made without their warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return importlib.import_module("tests.bad_input.examples")


@pytest.mark.parametrize(("table", "kind"), [("REFUSED", "error"), ("PERCENT", "error"), ("WARNED_OF", "warning")])
def test_what_does_not_go_together_is_named(examples, table, kind):
    assert_no_complaints((name, cause, call, kind, word) for name, cause, call, word in getattr(examples, table))


@pytest.mark.parametrize(
    "column",
    [
        pd.array(["1.0"] * 120, dtype="string"),
        np.array([b"1"] * 120, dtype=object),
        pd.date_range("2020", periods=120, tz="UTC"),
        pd.Categorical([1.0] * 120),
    ],
    ids=["text", "bytes", "times", "categories"],
)
def test_columns_that_are_no_numbers_are_named(examples, column, request):
    calls = examples.with_a_column(column)
    what = f"'c' holds {request.node.callspec.id}"
    assert_no_complaints((name, what, call, "error", what) for name, call in calls.items())


@pytest.mark.parametrize("number", range(15))
def test_names_count_and_not_positions(examples, number):
    named, call = list(examples.BY_NAME.values())[number]
    axis = "columns" if named.ndim == 2 and len(named) == 1 else "index"
    turned = named[named.columns[::-1]] if axis == "columns" else named[::-1]
    np.testing.assert_array_equal(call(turned), call(named))
    unknown = named.set_axis([f"no {label}" for label in getattr(named, axis)], axis=axis)
    with pytest.raises(ValueError, match="unknown"):
        call(unknown)


def test_labels_that_only_count_are_no_names(examples):
    numbered = (1 + examples.SHARES).reset_index(drop=True)
    np.testing.assert_array_equal(examples.TRUSS.frequencies(numbered), examples.TRUSS.frequencies(1 + examples.SHARES))
