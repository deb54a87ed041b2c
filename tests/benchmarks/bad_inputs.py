"""Bad inputs, generated: every argument of every public function and class is given its own list of bad values.

    OMP_NUM_THREADS=1 python tests/benchmarks/bad_inputs.py

A bad value is refused by an error that names it, warned of, silent (accepted as if it were good), or unclear (any
other error, or more than a minute). Values that happen to be legal are left out: where they are the default, where the
result is that of the good value because names were read, and those in ``LEGAL``. The exit code is 1 if more than 1 %
are silent or unclear, or if a public argument has no example. ``--of`` chooses callables, ``--all`` shows all answers.
"""

import argparse
import collections
import contextlib
import inspect
import re
import signal
import sys
import traceback
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import sklearn

import skthermo

TARGET = 0.01
SECONDS = 60
ERRORS = (ValueError, TypeError, FileNotFoundError)
CHECKED_BY = tuple(str(Path(package.__file__).parent) for package in (skthermo, sklearn))
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


def without_example(examples, arguments):
    """Public arguments that no example gives."""
    return sorted(set(arguments) - {(example.name, argument) for example in examples for argument in example.bad})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--of", default="", help="regular expression of the callables that are tried")
    parser.add_argument("--all", action="store_true", help="show every answer")
    options = parser.parse_args()
    from bad_input_examples import EXAMPLES, LEGAL, NOT_CALLED, public_arguments  # which takes a quarter of a minute

    counts, causes, shown = collections.Counter(), collections.defaultdict(collections.Counter), []
    for example in EXAMPLES:
        if not re.search(options.of, example.name):
            continue
        good, error, told = answer(example, example.good)
        if error is not None:
            traceback.print_exception(error)
            raise SystemExit(f"the good example of {example.name} fails")
        for argument, bad in example.bad.items():
            default = inspect.Parameter.empty
            with contextlib.suppress(KeyError, TypeError, ValueError):
                default = inspect.signature(example.of).parameters[argument].default
            for cause, value in bad.items():
                if (cause, "*") in LEGAL.get(argument, {}) or (cause, example.name) in LEGAL.get(argument, {}):
                    continue
                if value is default or (isinstance(value, type(default)) and np.ndim(value) == 0 and value == default):
                    continue
                kind, said = verdict(example, argument, cause, value, good, told)
                if kind == "legal":
                    continue
                counts[kind] += 1
                causes[cause][kind] += 1
                if options.all or kind in ("silent", "unclear"):
                    shown.append(f"{kind}: {example.name}({argument}: {cause}) {said:.220}")
    print("\n".join(shown))
    print()
    worst = sorted(causes.items(), key=lambda item: -item[1]["silent"] - item[1]["unclear"])
    for cause, kinds in worst:
        if kinds["silent"] + kinds["unclear"]:
            print(f"{cause:32s} {kinds['silent']:4d} silent {kinds['unclear']:4d} unclear of {kinds.total():4d}")
    missing = without_example(EXAMPLES, public_arguments()) if not options.of else []
    for name, argument in missing:
        print(f"no example: {name}({argument})")
    total = max(counts.total(), 1)
    shares = ", ".join(f"{counts[kind]} {kind} ({counts[kind] / total:.2%})" for kind in KINDS)
    print(
        f"{total} bad values in {sum(len(e.bad) for e in EXAMPLES)} arguments of {len(EXAMPLES)} callables "
        f"({len(NOT_CALLED)} public names are not called): {shares}"
    )
    return 1 if missing or max(counts["silent"], counts["unclear"]) > TARGET * total else 0


KINDS = ("refused", "warned", "silent", "unclear")

if __name__ == "__main__":
    sys.exit(main())
