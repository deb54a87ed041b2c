"""Classes are composed, not chained, and files and folders can be read: no mixin with one user, no crowd, no crumbs."""

import importlib
import inspect
import pkgutil
import re
from collections import Counter
from pathlib import Path

import skthermo
from tests.source import public

PACKAGE = Path(skthermo.__file__).parent
HOUSE = Path(__file__).parents[1] / "docs" / "contributing" / "house.rst"
FILES = sorted(PACKAGE.rglob("*.py"))
MOST_SIDE_BY_SIDE = 15  # modules of a package, beside its __init__.py
SHORT = 40
SHORT_FILES = {  # private files of fewer lines, and why they stand alone
    "fem/_samples.py": "it imports scikit-learn, which importing fem must not"
}


def classes():
    """All classes that skthermo defines, without those that stand in for newer ones of scikit-learn."""
    modules = [importlib.import_module(m.name) for m in pkgutil.walk_packages(skthermo.__path__, "skthermo.")]
    found = {member for module in modules for _, member in inspect.getmembers(module, inspect.isclass)}
    return {one for one in found if one.__module__.startswith("skthermo") and "_core.estimators" not in one.__module__}


def place(thing):
    return f"skthermo/{Path(inspect.getsourcefile(thing)).relative_to(PACKAGE)}:{inspect.getsourcelines(thing)[1]}"


def assert_none(wrong, instead):
    assert not wrong, f"{instead}\n" + "\n".join(sorted(wrong))


def test_no_private_class_has_one_child():
    ours, shown = classes(), {thing for *_, thing in public() if callable(thing)}
    children = Counter(base for thing in ours for base in thing.__bases__ if base in ours - shown)
    single = {base for base, number in children.items() if number == 1}
    chains = [
        f"{place(thing)}: {thing.__qualname__}({base.__qualname__})"
        for thing in ours
        for base in thing.__bases__
        if base in single
    ]
    assert_none(chains, "expected one class, or an object that it holds:")


def test_a_folder_can_be_overlooked():
    beside = Counter(path.parent.relative_to(PACKAGE).as_posix() for path in FILES if path.name != "__init__.py")
    full = [f"skthermo/{folder} has {number} files" for folder, number in beside.items() if number > MOST_SIDE_BY_SIDE]
    assert_none(full, f"expected {MOST_SIDE_BY_SIDE} beside __init__.py, or a package within:")


def test_short_files_have_a_reason():
    private = [path for path in FILES if path.name.startswith("_") and not path.name.startswith("__")]
    short = {path.relative_to(PACKAGE).as_posix() for path in private if len(path.read_text().splitlines()) < SHORT}
    assert_none(short - set(SHORT_FILES), f"expected {SHORT} lines, a place beside the only user, or a reason above:")
    assert_none(set(SHORT_FILES) - short, "not short:")


def test_the_guide_for_contributors_lists_what_all_packages_share():
    section = HOUSE.read_text().partition("What every package may use: ``_core``\n")[2].partition("\nDependencies\n")[0]
    listed = set(re.findall(r"``(\w+)\.py``", section)) - {"exceptions"}
    there = {path.stem for path in (PACKAGE / "_core").glob("[a-z]*.py")}
    assert_none(there - listed, f"{HOUSE}: say what is in")
    assert_none(listed - there, f"{HOUSE}: remove")
