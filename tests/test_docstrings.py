"""Docstrings agree with signatures, and every public name is typed and shown at work."""

import importlib
import inspect
import pkgutil
import typing

import pandas as pd
import pytest
from numpydoc.docscrape import FunctionDoc
from numpydoc.validate import validate

import skthermo
import skthermo.fem
from skthermo.fem.sampling._samples import Samples

ROOMS = [m.name for m in pkgutil.iter_modules(skthermo.__path__, "skthermo.") if m.ispkg and "._" not in m.name]

# Parts of numpydoc's standard that one-line summaries of properties and protocols do not need.
NOT_ASKED = {
    "ES01",  # extended summary
    "EX01",  # example: asked of classes and functions below, not of every method
    "SA01",  # see also
    "SA04",
    "GL01",  # summary begins on the line of the quotes, as Ruff formats it
    "RT03",  # a description for every return value: shapes say it
    "RT04",
    "RT05",
    "PR04",  # type of **parameters
    "PR06",
    "PR08",  # descriptions may begin with a formula or a lower-case name
    "PR09",
    "SS06",  # equation numbers may break the summary's line
    "SS05",  # it takes plural nouns ("Frequencies of ...") for verbs
    "YD01",
}


def public_objects():
    for room in ROOMS:
        module = importlib.import_module(room)
        for name in module.__all__:
            yield f"{room}.{name}", getattr(module, name)


def public_callables():
    """Functions, classes and their methods, those of bases in skthermo included."""
    for name, thing in public_objects():
        if isinstance(thing, type):
            yield name, thing.__init__, thing
            ours = [base for base in thing.__mro__ if base.__module__.startswith("skthermo")]
            for attribute, member in {k: v for base in ours[::-1] for k, v in vars(base).items()}.items():
                if inspect.isfunction(member) and not attribute.startswith("_"):
                    yield f"{name}.{attribute}", member, member
        elif callable(thing):
            yield name, thing, thing


CALLABLES = list(public_callables())
PROTOCOLS = {name for name, thing in public_objects() if getattr(thing, "_is_protocol", False)}
ELEMENT_METHODS = ("dofs", "ends", "stiffness", "mass")


def is_contract_of_a_protocol(name):
    """Methods whose parameters a protocol documents once, for every class that follows it."""
    owner, _, method = name.rpartition(".")
    return (
        owner in PROTOCOLS
        or name in PROTOCOLS
        or (
            owner.rsplit(".", 1)[-1] in ("Bar", "Beam", "Membrane", "Spring", "PointMass") and method in ELEMENT_METHODS
        )
    )


@pytest.mark.parametrize(("name", "function", "documented"), CALLABLES, ids=[c[0] for c in CALLABLES])
def test_documented_parameters_are_the_signatures(name, function, documented):
    if is_contract_of_a_protocol(name):
        assert inspect.getdoc(documented)
        return
    expected = [
        ("**" if p.kind is p.VAR_KEYWORD else "") + p.name
        for p in inspect.signature(function).parameters.values()
        if p.name not in ("self", "cls")
    ]
    documented_names = [part.strip() for p in FunctionDoc(documented)["Parameters"] for part in p.name.split(",")]
    assert documented_names == expected


@pytest.mark.parametrize(("name", "function", "documented"), CALLABLES, ids=[c[0] for c in CALLABLES])
def test_every_public_callable_is_typed(name, function, documented):
    if name in PROTOCOLS:
        return  # its members are properties and methods, which are checked on the classes that follow it
    for_type_checkers = vars(skthermo.fem) | {"Samples": Samples, "pd": pd}
    hints = typing.get_type_hints(function, localns=for_type_checkers, include_extras=True)
    parameters = [p for p in inspect.signature(function).parameters.values() if p.name not in ("self", "cls")]
    untyped = [p.name for p in parameters if p.name not in hints]
    assert not untyped
    assert function.__name__ == "__init__" or "return" in hints


DEFAULTS = [(name, thing) for name, thing in public_objects() if inspect.isfunction(thing) or inspect.isclass(thing)]


@pytest.mark.parametrize(("name", "thing"), DEFAULTS, ids=[d[0] for d in DEFAULTS])
def test_docstrings_follow_numpydoc_and_show_an_example(name, thing):
    if name in PROTOCOLS:
        assert "Attributes" in inspect.getdoc(thing)
        return
    report = validate(name)
    errors = [(code, message) for code, message in report["errors"] if code not in NOT_ASKED]
    assert not errors
    assert ">>>" in inspect.getdoc(thing), "expected an example that runs"


DOCUMENTED_DEFAULTS = [c for c in CALLABLES if not is_contract_of_a_protocol(c[0])]


@pytest.mark.parametrize(
    ("name", "function", "documented"), DOCUMENTED_DEFAULTS, ids=[c[0] for c in DOCUMENTED_DEFAULTS]
)
def test_documented_defaults_are_the_signatures(name, function, documented):
    signature = inspect.signature(function).parameters
    for parameter in FunctionDoc(documented)["Parameters"]:
        for name in parameter.name.split(", ") if "default=" in parameter.type else ():
            stated = parameter.type.split("default=")[1]
            default = signature[name].default
            shown = "numpy.nan" if repr(default) == "nan" else repr(default).replace("'", '"')
            assert stated == shown.replace("e-0", "e-")
