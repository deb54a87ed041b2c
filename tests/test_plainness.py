"""Equal inputs give equal results: what the source may not hold, and how much of some things.

``python tools/house.py`` prints the present numbers.
"""

import ast
from pathlib import Path

import pytest

import skthermo
from tests.source import (
    constants,
    constructors_called_of,
    hidden_state,
    kinds_of_warnings,
    names_in_two_files,
    private_imports,
    trees,
)

PACKAGE = Path(skthermo.__file__).parent
WARNS = "_core/warnings.py"  # finds the user's line, and collects the warnings of parts
ALLOWED = {
    WARNS: {"the caller's frames", "filters of warnings"},  # one function finds the user's line
}
AT_MOST = {
    "constants": 300,
    "constructors called of": 0,
    "kinds of warnings": 30,
    "names in two files": 0,
    "tests with private imports": 10,
}


@pytest.fixture(scope="module")
def files():
    return trees(PACKAGE)


def test_no_state_is_hidden(files):
    found = {file: hidden_state(tree) for file, tree in files.items()}
    assert not [
        f"skthermo/{file}:{line}: {what}"
        for file, uses in found.items()
        for line, what in uses
        if what not in ALLOWED.get(file, ())
    ]


@pytest.mark.parametrize(
    ("code", "what"),
    [
        ("frame = sys._getframe(1)", "the caller's frames"),
        ("given = frame.f_locals['self']", "the caller's variables"),
        ("from contextvars import ContextVar", "context variables"),
        ("import weakref", "weak references"),
        ("kept[id(table)] = answer", "addresses of objects"),
        ("origins[values.ctypes.data] = unit", "addresses of objects"),
        ("setattr(table, 'unit', 'Hz')", "attributes of other objects"),
        ("object.__setattr__(table, 'unit', 'Hz')", "attributes of other objects"),
        ("vars(jobs)['given'] = kinds", "attributes of other objects"),
        ("vars(jobs).setdefault('given', set())", "attributes of other objects"),
        ("with warnings.catch_warnings(): pass", "filters of warnings"),
    ],
)
def test_hidden_state_is_found(code, what):
    assert hidden_state(ast.parse(code)) == [(1, what)]


def test_what_an_object_does_with_itself_is_not_hidden():
    code = "vars(self).update(state)\nsetattr(self, name, 1)\ntwin = copy(self)\nvars(twin).update(changes)"
    assert hidden_state(ast.parse(code)) == []


def test_few_constants(files):
    assert sum(len([*constants(tree, in_tuples=False)]) for tree in files.values()) <= AT_MOST["constants"]


def test_constructors_say_what_they_learn_or_read(files):
    found = [file for file, tree in files.items() for _ in constructors_called_of(tree)]
    assert len(found) <= AT_MOST["constructors called of"], "\n".join(found)


def test_no_two_classes_or_constants_share_a_name(files):
    found = names_in_two_files(files)
    assert len(found) <= AT_MOST["names in two files"], found


def test_few_kinds_of_warnings(files):
    found = {kind for tree in files.values() for kind, _ in kinds_of_warnings(tree)}
    assert len(found) <= AT_MOST["kinds of warnings"], sorted(found)


def test_few_tests_look_inside():
    tests = sorted(Path(__file__).parent.rglob("*.py"))
    found = [str(file) for file in tests if any(private_imports(ast.parse(file.read_text())))]
    assert len(found) <= AT_MOST["tests with private imports"], "import what a package gives, not:\n" + "\n".join(found)
