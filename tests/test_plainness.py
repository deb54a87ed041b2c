"""Equal inputs give equal results: what the source may not hold, and how much of some things.

``python tools/house.py`` prints the present numbers.
"""

import ast
import re
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
    tree_of,
    trees,
)

PACKAGE = Path(skthermo.__file__).parent
WARNS = "skthermo/_core/warnings.py"  # finds the user's line, and collects the warnings of parts
ALLOWED = {
    WARNS: {"the caller's frames", "filters of warnings"}  # one function finds the user's line
}
AT_MOST = {
    "constants": 300,
    "constructors called of": 0,
    "kinds of warnings": 30,
    "names in two files": 0,
    "tests with private imports": 9,
}


@pytest.fixture(scope="module")
def files():
    return {f"skthermo/{file}": tree for file, tree in trees(PACKAGE).items()}


def assert_at_most(number, found, remedy):
    assert len(found) <= number, "\n".join([f"{len(found)}, at most {number}; {remedy}:", *sorted(found)])


def test_no_state_is_hidden(files):
    found = {(file, use) for file, tree in files.items() for use in hidden_state(tree)}
    hidden = [f"{file}:{line}: {what}" for file, (line, what) in found if what not in ALLOWED.get(file, ())]
    assert_at_most(0, hidden, "give it as an argument, or keep it in self")


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
    found = [
        f"{file}:{line}: {name}" for file, tree in files.items() for line, name in constants(tree, in_tuples=False)
    ]
    assert_at_most(AT_MOST["constants"], found, "write a value where it is used once")


def test_constructors_say_what_they_learn_or_read(files):
    found = [f"{file}:{node.lineno}" for file, tree in files.items() for node in constructors_called_of(tree)]
    assert_at_most(AT_MOST["constructors called of"], found, "name what they learn or read in place of of()")


def test_no_two_classes_or_constants_share_a_name(files):
    found = [f"{name}: {', '.join(places)}" for name, places in names_in_two_files(files).items()]
    assert_at_most(AT_MOST["names in two files"], found, "rename one, or define it once")


def test_few_kinds_of_warnings(files):
    found = {kind: f"{file}:{n}: {kind}" for file, tree in files.items() for n, kind, _ in kinds_of_warnings(tree)}
    assert_at_most(AT_MOST["kinds of warnings"], found.values(), "give one of the kinds that there are")


def test_few_tests_look_inside():
    root = Path(__file__).parents[1]
    may_be = re.compile(r"skthermo[\w.]*\._[^_]|from skthermo.* import .*\b_\w|^\s+_\w+( as \w+)?,$", re.MULTILINE)
    paths = [path for path in root.glob("tests/**/*.py") if may_be.search(path.read_text())]  # to parse all takes long
    imports = {path.relative_to(root): [*private_imports(tree_of(path))] for path in paths}
    found = [f"{path}:{each[0][0]}: {', '.join(name for _, name in each)}" for path, each in imports.items() if each]
    assert_at_most(AT_MOST["tests with private imports"], found, "import what a package gives")
