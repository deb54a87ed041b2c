"""Docstrings agree with signatures, and every public name is typed and shown at work."""

import functools
import inspect
import re
import typing
from pathlib import Path

import pandas as pd
from numpydoc.docscrape import ClassDoc, FunctionDoc
from numpydoc.validate import Validator, validate

import skthermo
import skthermo.fem
from tests.source import public

ROOT = Path(__file__).parents[1]
PUBLIC = [(f"skthermo.{room}.{name}", thing) for room, name, thing in public()]

# Parts of numpydoc's standard that are not asked for.
NOT_ASKED = {
    "ES01",  # extended summary
    "EX01",  # example: asked of classes and functions below, not of every method
    "SA01",  # see also
    "SS05",  # it takes plural nouns ("Frequencies of ...") for verbs
}


def public_members(thing):
    """Members of a class and of its bases in skthermo."""
    ours = [base for base in thing.__mro__[::-1] if base.__module__.startswith("skthermo")]
    return {name: member for base in ours for name, member in vars(base).items() if not name.startswith("_")}


def public_callables():
    """Functions, classes and their methods, those of bases in skthermo included."""
    for name, thing in PUBLIC:
        if isinstance(thing, type):
            yield name, thing.__init__, thing
            for attribute, member in public_members(thing).items():
                function = getattr(member, "__func__", member)  # of class methods
                if inspect.isfunction(function):
                    yield f"{name}.{attribute}", function, function
        elif callable(thing):
            yield name, thing, thing


CALLABLES = list(public_callables())
OBJECTS = [(name, thing) for name, thing in PUBLIC if inspect.isfunction(thing) or inspect.isclass(thing)]
PROTOCOLS = {name for name, thing in OBJECTS if getattr(thing, "_is_protocol", False)}
ELEMENT_METHODS = {name for name in vars(skthermo.fem.Element) if name[0] != "_"}
LONGEST_SIGNATURE = 700  # characters that help() prints


def is_documented_elsewhere(name):
    """Methods whose parameters the protocol of elements documents."""
    owner, _, method = name.removeprefix("skthermo.fem.").partition(".")
    return method in ELEMENT_METHODS and getattr(skthermo.fem, owner).__module__.startswith("skthermo.fem.elements.")


DOCUMENTED = [c for c in CALLABLES if not is_documented_elsewhere(c[0]) and c[0] not in PROTOCOLS]
CLASSES = [(name, thing) for name, thing in OBJECTS if inspect.isclass(thing)]


def own_parameters(function):
    return [p for p in inspect.signature(function).parameters.values() if p.name not in ("self", "cls")]


def place(name):
    """File and line of a public name, or of a method of one."""
    thing = inspect.unwrap(Validator._load_obj(name))
    thing = getattr(thing, "fget", None) or getattr(thing, "func", thing)  # of a property
    return f"{Path(inspect.getsourcefile(thing)).relative_to(ROOT)}:{inspect.getsourcelines(thing)[1]}"


def assert_none(wrong, remedy):
    """Each of what is wrong begins with a public name."""
    places = [f"{place(re.match('[A-Za-z0-9_.]+', one)[0])}: {one}" for one in wrong]
    assert not wrong, "\n".join([f"{remedy}:", *places])


def test_everything_public_has_a_docstring():
    assert_none([name for name, _, documented in CALLABLES if not inspect.getdoc(documented)], "write a docstring")


def test_documented_parameters_are_the_signatures():
    wrong = []
    for name, function, documented in DOCUMENTED:
        stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
        expected = [stars.get(p.kind, "") + p.name for p in own_parameters(function)]
        names = [part.strip() for p in FunctionDoc(documented)["Parameters"] for part in p.name.split(",")]
        if names != expected:
            wrong.append(f"{name}: documented {names}, expected {expected}")
    assert_none(wrong, "document the parameters of the signature, in its order")


def test_documented_defaults_are_the_signatures():
    wrong = []
    for name, function, documented in DOCUMENTED:
        defaults = {p.name: p.default for p in own_parameters(function)}
        for entry in FunctionDoc(documented)["Parameters"]:
            for parameter in entry.name.split(", ") if "default=" in entry.type else ():
                stated, default = entry.type.split("default=")[1], defaults.get(parameter)
                shown = "numpy.nan" if repr(default) == "nan" else repr(default).replace("'", '"')
                if stated != shown.replace("e-0", "e-"):
                    wrong.append(f"{name}: {parameter} has default={stated}, expected {shown}")
    assert_none(wrong, "state the default of the signature")


def test_every_public_callable_is_typed():
    wrong = []
    for_type_checkers = vars(skthermo.fem) | {"pd": pd, "Axes": object}  # matplotlib is optional
    for_type_checkers["Samples"] = object  # of skthermo.fem.sample
    for_type_checkers |= vars(skthermo.monitoring) | vars(skthermo.studies)
    for name, function, _ in CALLABLES:
        if name in PROTOCOLS:
            continue  # its members are properties and methods, which are checked on the classes that follow it
        hints = typing.get_type_hints(function, localns=for_type_checkers, include_extras=True)
        expected = {p.name for p in own_parameters(function)} | (
            {"return"} if function.__name__ != "__init__" else set()
        )
        wrong += [f"{name}: {missing}" for missing in sorted(expected - set(hints))]
    assert_none(wrong, "annotate")


def test_signatures_are_readable():
    wrong = []
    for name, function, _ in CALLABLES:
        printed = str(inspect.signature(function))
        if len(printed) > LONGEST_SIGNATURE or "_SupportsArray" in printed:
            wrong.append(f"{name} prints {len(printed)} characters")
    assert_none(wrong, "shorten the signature, or name its types")


def faults(name):
    """What numpydoc finds; a method may inherit its docstring, which is then checked at its definition."""
    if Validator._load_obj(name).__doc__ is None and inspect.getdoc(Validator._load_obj(name)):
        return []
    return [f"{name}: {code} {message}" for code, message in validate(name)["errors"] if code not in NOT_ASKED]


def test_docstrings_follow_numpydoc():
    methods = {name for name, _, _ in DOCUMENTED if name.count(".") > 2}
    objects = {name for name, _ in OBJECTS} - PROTOCOLS
    assert_none([fault for name in sorted(objects | methods) for fault in faults(name)], "write it as numpydoc asks")


def test_protocols_list_their_attributes_and_all_else_shows_an_example_that_runs():
    expected = {name: "Attributes" if name in PROTOCOLS else ">>>" for name, _ in OBJECTS}
    assert_none(
        [name for name, thing in OBJECTS if expected[name] not in inspect.getdoc(thing)],
        "show attributes, or an example",
    )


def test_every_public_property_has_a_summary():
    wrong = []
    for name, thing in CLASSES:
        for attribute, member in public_members(thing).items():
            if isinstance(member, property | functools.cached_property):
                summary = (inspect.getdoc(member) or "").partition("\n")[0]
                wrong += [] if summary.endswith(".") else [f"{name}.{attribute}"]
    assert_none(wrong, "write a summary that ends with a full stop")


source_of = functools.cache(inspect.getsource)
ASSIGNED = re.compile(r"self\.([a-z]\w*_)\b(?=[^=\n]*=[^=])")  # self.a_, self.b_ = ...


def test_every_fitted_attribute_is_documented():
    wrong = []
    for name, thing in CLASSES:
        ours = [base for base in thing.__mro__ if base.__module__.startswith("skthermo")]
        sources = [re.sub(r" +(>>>|\.\.\.) .*", "", source_of(base)) for base in ours]  # without examples
        fitted = {attribute for source in sources for attribute in ASSIGNED.findall(source)}
        documented = {part.strip() for entry in ClassDoc(thing)["Attributes"] for part in entry.name.split(",")}
        wrong += [f"{name}: {attribute}" for attribute in sorted(fitted - documented)]
    assert_none(wrong, "list it in Attributes")
