"""Docstrings agree with signatures, and every public name is typed and shown at work."""

import functools
import importlib
import inspect
import pkgutil
import re
import typing

import pandas as pd
import pytest
from numpydoc.docscrape import ClassDoc, FunctionDoc
from numpydoc.validate import validate

import skthermo
import skthermo.fem
from skthermo.fem.sampling._samples import Samples

ROOMS = [m.name for m in pkgutil.iter_modules(skthermo.__path__, "skthermo.") if m.ispkg and "._" not in m.name]

# Parts of numpydoc's standard that are not asked for.
NOT_ASKED = {
    "ES01",  # extended summary
    "EX01",  # example: asked of classes and functions below, not of every method
    "SA01",  # see also
    "SS05",  # it takes plural nouns ("Frequencies of ...") for verbs
}


def public_objects():
    for room in ROOMS:
        module = importlib.import_module(room)
        for name in module.__all__:
            yield f"{room}.{name}", getattr(module, name)


def public_members(thing):
    """Members of a class and of its bases in skthermo."""
    ours = [base for base in thing.__mro__[::-1] if base.__module__.startswith("skthermo")]
    return {name: member for base in ours for name, member in vars(base).items() if not name.startswith("_")}


def public_callables():
    """Functions, classes and their methods, those of bases in skthermo included."""
    for name, thing in public_objects():
        if isinstance(thing, type):
            yield name, thing.__init__, thing
            for attribute, member in public_members(thing).items():
                function = getattr(member, "__func__", member)  # of class methods
                if inspect.isfunction(function):
                    yield f"{name}.{attribute}", function, function
        elif callable(thing):
            yield name, thing, thing


CALLABLES = list(public_callables())
PROTOCOLS = {name for name, thing in public_objects() if getattr(thing, "_is_protocol", False)}
ELEMENT_METHODS = ("properties", "dofs", "ends", "stiffness", "mass")


def is_contract_of_an_element(name):
    """Methods whose parameters the protocol of elements documents, once for all of them."""
    owner, _, method = name.rpartition(".")
    return owner.rsplit(".", 1)[-1] in ("Bar", "Beam", "Membrane", "Spring", "PointMass") and method in ELEMENT_METHODS


@pytest.mark.parametrize(("name", "function", "documented"), CALLABLES, ids=[c[0] for c in CALLABLES])
def test_documented_parameters_are_the_signatures(name, function, documented):
    if is_contract_of_an_element(name) or name in PROTOCOLS:
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


def faults(name):
    return [(code, message) for code, message in validate(name)["errors"] if code not in NOT_ASKED]


DOCUMENTED = [(name, thing) for name, thing in public_objects() if inspect.isfunction(thing) or inspect.isclass(thing)]


@pytest.mark.parametrize(("name", "thing"), DOCUMENTED, ids=[d[0] for d in DOCUMENTED])
def test_docstrings_follow_numpydoc_and_show_an_example(name, thing):
    if name in PROTOCOLS:
        assert "Attributes" in inspect.getdoc(thing)
        return
    assert not faults(name)
    assert ">>>" in inspect.getdoc(thing), "expected an example that runs"


METHODS = [c[0] for c in CALLABLES if c[0].count(".") > 2 and not is_contract_of_an_element(c[0])]


@pytest.mark.parametrize("name", METHODS)
def test_docstrings_of_methods_follow_numpydoc(name):
    assert not faults(name)


CLASSES = [d for d in DOCUMENTED if inspect.isclass(d[1])]


@pytest.mark.parametrize(("name", "thing"), CLASSES, ids=[c[0] for c in CLASSES])
def test_every_public_property_has_a_summary(name, thing):
    properties = [m for m in public_members(thing).values() if isinstance(m, property | functools.cached_property)]
    assert all((inspect.getdoc(member) or "").partition("\n")[0].endswith(".") for member in properties)


ASSIGNED = re.compile(r"self\.([a-z]\w*_)\b(?=[^=\n]*=[^=])")  # self.a_, self.b_ = ...


@pytest.mark.parametrize(("name", "thing"), CLASSES, ids=[c[0] for c in CLASSES])
def test_every_fitted_attribute_is_documented(name, thing):
    ours = [base for base in thing.__mro__ if base.__module__.startswith("skthermo")]
    fitted = {attribute for base in ours for attribute in ASSIGNED.findall(inspect.getsource(base))}
    documented = {part.strip() for entry in ClassDoc(thing)["Attributes"] for part in entry.name.split(",")}
    assert fitted <= documented


DOCUMENTED_DEFAULTS = [c for c in CALLABLES if not is_contract_of_an_element(c[0]) and c[0] not in PROTOCOLS]


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
