"""Which room may import which, and what importing costs."""

import ast
import csv
import functools
import pkgutil
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import skthermo
from skthermo.plotting import DamageIndexDisplay
from tests.source import built_on, floors, imported, packages_imported, tree_of
from tools.house import DRAWN, drawing

PACKAGE = Path(skthermo.__file__).parent
ROOT = Path(__file__).parents[1]
HOUSE = ROOT / "docs" / "contributing" / "house.rst"
ROOMS = [module.name for module in pkgutil.iter_modules(skthermo.__path__) if module.ispkg and module.name[0] != "_"]
FILES = sorted(PACKAGE.rglob("*.py"))
PROGRAM = PACKAGE / "__main__.py"  # what users start


@functools.cache
def imported_modules(path):
    return list(imported(tree_of(path)))


def own_imports(path):
    """Modules of skthermo that a file imports, without the package's name."""
    names = [module.split(".") for module in imported_modules(path)]
    return [parts[1:] for parts in names if parts[0] == "skthermo" and len(parts) > 1]


def package_of(path):
    return list(path.relative_to(PACKAGE).parent.parts)


def test_the_guide_for_contributors_shows_what_each_package_is_built_on():
    table = HOUSE.read_text().partition(":widths: 15, 55, 30\n\n")[2].partition("\n\n")[0]
    rows = csv.reader(table.splitlines(), skipinitialspace=True)
    shown = {room: set(filter(None, below.split(", "))) for room, _, below in rows}
    found = built_on(packages_imported(PACKAGE))
    wrong = [
        f"{room} is built on {sorted(found.get(room, ()))}, the table says {sorted(shown.get(room, ()))}"
        for room in sorted(found | shown)
        if found.get(room) != shown.get(room)
    ]
    assert not wrong, "\n".join([f"{HOUSE}: change the row and say why, or import less:", *wrong])


def test_the_figure_is_drawn_from_the_imports():
    assert DRAWN.read_text() == drawing(), f"{DRAWN}: python tools/house.py --draw"


def test_packages_within_a_package_are_in_no_circle():
    divided = {path.parent.parent for path in PACKAGE.glob("*/*/__init__.py")}
    assert divided
    for folder in divided:
        assert floors(packages_imported(PACKAGE, folder.relative_to(PACKAGE).parts))  # which names a circle


def test_no_module_imports_a_program():
    assert [path for path in FILES if path.name == PROGRAM.name] == [PROGRAM]
    assert own_imports(PROGRAM) == [["commands", "main"]]
    assert not [(path, module) for path in FILES for module in own_imports(path) if module[-1] == "__main__"]


def test_what_every_room_uses_uses_no_room():
    shared = [p for p in FILES if p != PROGRAM and (not package_of(p) or package_of(p)[0].startswith("_"))]
    rooms = [(p, m) for p in shared for m in own_imports(p) if m[0][0] != "_" and m != ["exceptions"]]
    assert not rooms


def test_private_modules_are_for_their_own_package():
    wrong = []
    for path in FILES:
        package = package_of(path)
        for module in own_imports(path):
            private = next((i for i, part in enumerate(module) if part.startswith("_")), None)
            if private is not None:
                is_shared = private == 0 and not any(part.startswith("_") for part in module[1:])
                last = is_shared or private == len(module) - 1 or package[: private + 1] == module[: private + 1]
                if package[:private] != module[:private] or not last:
                    wrong.append(f"{path} imports skthermo.{'.'.join(module)}")
    assert not wrong, "\n".join(["import a public module of the other package, or make one:", *wrong])


def test_no_circle_of_modules():
    imports = {}
    for path in FILES:
        name = ".".join([*package_of(path), path.stem]).removesuffix(".__init__")
        imports[name] = {".".join(module) for module in own_imports(path)}
    done, open_now = set(), []

    def visit(name):
        assert name not in open_now, f"circle: {[*open_now[open_now.index(name) :], name]}"
        if name in imports and name not in done:
            open_now.append(name)
            for module in imports[name]:
                visit(module)
            open_now.pop()
            done.add(name)

    for name in imports:
        visit(name)


def test_only_core_dependencies_are_imported_and_private_scikit_learn_in_one_place():
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    core = {re.match(r"[\w-]+", one)[0].replace("scikit-learn", "sklearn") for one in needed}
    allowed = core | {"threadpoolctl", "skthermo"} | set(sys.stdlib_module_names)  # scikit-learn needs threadpoolctl
    wrong = []
    for path in FILES:
        tree = tree_of(path)
        for_types = {
            node
            for branch in ast.walk(tree)
            if isinstance(branch, ast.If) and getattr(branch.test, "id", "") == "TYPE_CHECKING"
            for node in ast.walk(branch)
        }
        for node in ast.walk(tree):
            if not isinstance(node, ast.Import | ast.ImportFrom) or node in for_types:
                continue
            names = " ".join(alias.name for alias in node.names)
            for name in imported(node):
                private = name.startswith("sklearn") and re.search(r"[. ]_", f"{name} {names}")
                if name.split(".")[0] not in allowed or (private and path.name != "estimators.py"):
                    wrong.append(f"{path}:{node.lineno} imports {name}")
    remedy = "import optional packages in the function that needs them, scikit-learn's private names in estimators.py:"
    assert not wrong, "\n".join([remedy, *wrong])


def test_imports_load_no_more_than_they_need():
    """fem neither pandas nor scikit-learn, a job with a monitor no chain and no study, all rooms nothing optional."""
    heavy = [f"skthermo.{room}" for room in ("surrogate", "studies", "updating", "datasets")]
    optional = ["matplotlib", "jinja2", "dask", "distributed", "hypothesis", "scipy.signal", "sklearn.ensemble"]
    steps = {
        "skthermo.fem": ["pandas", "sklearn"],
        "skthermo.commands.main, skthermo.reporting": ["scipy.io", *heavy],
        ", ".join(f"skthermo.{room}" for room in ROOMS): optional,
    }
    each = [
        f"import sys, {names}; print([m for m in {unwanted} if m in sys.modules])" for names, unwanted in steps.items()
    ]
    loaded = subprocess.run([sys.executable, "-c", "\n".join(each)], capture_output=True, text=True, check=True)
    assert loaded.stdout.split() == ["[]", "[]", "[]"]


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match=r"skthermo\[plot\]|plot"):
        DamageIndexDisplay.from_predictions([1.0, 3.0], 2.0)
