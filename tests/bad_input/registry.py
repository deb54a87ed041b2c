"""Where the modules of examples register theirs: valid calls of public callables, with bad values of their arguments.

``examples.py`` holds those of all rooms up to studies and reports, ``in_service.py`` those of monitoring and fleets.
"""

import importlib
import inspect
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import skthermo
from tests.bad_input.values import choice, count, flag
from tests.source import public

FOLDER = Path(tempfile.mkdtemp())
"""Holds the files that examples read and write."""

NOT_CALLED: dict[str, str] = {}
"""Public names whose constructors are not tried, with reasons."""

UNTRIED: dict[str, set[str]] = {}
"""Arguments that have no bad values, by callable."""

LEGAL: dict[str, dict[tuple[str, str], str]] = {}
"""Bad values that are good for an argument: (cause, callable or *) and the reason."""

USUAL: dict[str, tuple[Any, dict[str, Any]]] = {}
"""A good value and the bad ones of arguments that many callables have."""


@dataclass
class Example:
    """A call by keywords with a good value of every argument, and the bad values of each."""

    name: str
    of: Any
    call: Any
    good: dict[str, Any] = field(default_factory=dict)
    bad: dict[str, dict[str, Any]] = field(default_factory=dict)


EXAMPLES: list[Example] = []


def usual_of(of, argument):
    """The pair of `USUAL`, or a default of the signature with what is bad for its type."""
    if argument in USUAL:
        return USUAL[argument]
    default = inspect.signature(of).parameters[argument].default
    bad = {bool: flag, str: choice, int: count}.get(type(default))
    if bad is None:
        raise LookupError(f"tests/bad_input/examples.py: {argument!r} of {of.__name__} needs a good and bad values")
    return default, bad()


def is_registered(of):
    """Whether there is an example of a callable."""
    return any(example.of is of for example in EXAMPLES)


def use(name, call=None, /, usual="", **arguments):
    """Register an example: for every argument a good value and its bad ones, for ``usual`` ones those of `usual_of`."""
    of = skthermo
    for part in name.split("."):
        of = importlib.import_module(f"skthermo.{part}") if of is skthermo else getattr(of, part)
    arguments = {argument: usual_of(of, argument) for argument in usual.split()} | arguments
    good = {argument: pair[0] for argument, pair in arguments.items()}
    bad = {argument: pair[1] for argument, pair in arguments.items()}
    EXAMPLES.append(Example(name, of, of if call is None else call, good, bad))


def methods(owner, names, **arguments):
    """Register methods of a fixed object that take the same."""
    kind = type(owner)
    for name in names.split():
        use(f"{kind.__module__.split('.')[1]}.{kind.__name__}.{name}", getattr(owner, name), **arguments)


def fitted(cls, X, y=None, after=None, usual="", **arguments):
    """Register an estimator: its parameters, and X and y of ``fit``."""
    if after is None:
        after = lambda estimator, X: estimator.transform(X)  # noqa: E731

    def call(**values):
        given = [values.pop(part) for part in ("X", "y") if part in values]
        return after(cls(**values).fit(*given), X[0])

    data = {"X": X} | ({} if y is None else {"y": y})
    use(f"{cls.__module__.split('.')[1]}.{cls.__name__}", call, usual=usual, **arguments, **data)


def public_arguments():
    """Name and argument of every public function and constructor, but for those that are not tried."""
    for room, name, thing in public():
        full = f"{room}.{name}"
        for argument, parameter in inspect.signature(thing).parameters.items() if full not in NOT_CALLED else ():
            keyed = parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
            if keyed and argument not in UNTRIED.get(full, ()):
                yield full, argument
