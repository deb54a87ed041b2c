"""Which room may import which, and what importing costs."""

import ast
import csv
import functools
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import skthermo
from skthermo.plotting import DamageIndexDisplay

PACKAGE = Path(skthermo.__file__).parent
HOUSE = Path(__file__).parents[1] / "docs" / "contributing" / "house.rst"
ROOMS = [module.name for module in pkgutil.iter_modules(skthermo.__path__) if module.ispkg and module.name[0] != "_"]
MAY_IMPORT = {
    "fem": set(),
    "preprocessing": set(),
    "metrics": set(),
    "residuals": {"preprocessing"},
    "detection": {"metrics", "preprocessing", "residuals", "surrogate"},  # its default regressor
    "surrogate": {"fem", "metrics", "preprocessing", "residuals"},
    "updating": {"fem"},
    "datasets": {"fem"},
}
MAY_IMPORT["studies"] = {*MAY_IMPORT}
MAY_IMPORT["monitoring"] = {*MAY_IMPORT}
MAY_IMPORT["plotting"] = {*MAY_IMPORT}  # displays name the results that they draw
MAY_IMPORT["reporting"] = {*MAY_IMPORT}
MAY_IMPORT["commands"] = {*MAY_IMPORT}  # on top of all
WITHIN = {  # what a package within a package may import, beside what its parent may
    "fem": {"fem.elements", "fem.modal", "fem.affine"},  # its functions and structures use them
    "fem.elements": set(),
    "fem.modal": set(),
    "fem.affine": {"fem.modal"},
    "fem.external": {"fem.affine"},
    "residuals": {"preprocessing.checks"},  # a range of weather names implausible temperatures
    "preprocessing": {"preprocessing.checks", "preprocessing.loggers"},
    "preprocessing.checks": set(),
    "preprocessing.loggers": set(),
    "commands": {"preprocessing.loggers"},
    "surrogate": {"fem.affine", "preprocessing.checks"},  # polynomials of ln f, periods of records
    "detection": {"preprocessing.checks"},  # misplaced columns
    "monitoring": {"preprocessing.checks"},
    "studies.detectability": {"preprocessing.checks"},  # their records go through the gate
    "studies.identification": {"preprocessing.checks"},
}
CORE = {"numpy", "scipy", "pandas", "sklearn", "joblib", "threadpoolctl", "skthermo"}
FILES = sorted(PACKAGE.rglob("*.py"))
PROGRAM = PACKAGE / "__main__.py"  # what users start


@functools.cache
def nodes(path):
    """All nodes of a file's syntax tree."""
    return list(ast.walk(ast.parse(path.read_text())))


def imported_modules(path):
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield node.module


def own_imports(path):
    """Modules of skthermo that a file imports, without the package's name."""
    names = [module.split(".") for module in imported_modules(path)]
    return [parts[1:] for parts in names if parts[0] == "skthermo" and len(parts) > 1]


def package_of(path):
    return list(path.relative_to(PACKAGE).parent.parts)


def may_import(room):
    """Packages that files of a package, or of one within a package, may import."""
    return MAY_IMPORT[room.partition(".")[0]] | WITHIN.get(room, set())


def test_arrows_point_one_way():
    against = []
    for path in FILES:
        room = ".".join(package_of(path))
        for module in own_imports(path):
            package = ".".join(part for i, part in enumerate(module) if (PACKAGE / Path(*module[: i + 1])).is_dir())
            if module[0].startswith("_") or module == ["exceptions"] or package == room or not room:
                continue
            is_front = path.name == "__init__.py" and package.startswith(room + ".")  # a package presents those in it
            shares_parent = room.startswith(package + ".") and ".".join(module) != package
            if not (is_front or shares_parent or package in may_import(room)):
                against.append(f"{path.relative_to(PACKAGE)} may not import {'.'.join(module)}")
    assert not against


def test_no_module_imports_a_program():
    assert [path for path in FILES if path.name == PROGRAM.name] == [PROGRAM]
    assert own_imports(PROGRAM) == [["commands", "main"]]
    assert not [(path, module) for path in FILES for module in own_imports(path) if module[-1] == "__main__"]


def test_every_package_has_its_arrows():
    packages = {".".join(package_of(path)) for path in FILES if path.name == "__init__.py"}
    public = {package for package in packages if package and not package.startswith("_")}
    assert public <= {*MAY_IMPORT, *WITHIN}


def test_the_guide_for_contributors_shows_the_arrows():
    table = HOUSE.read_text().partition(":widths: 15, 55, 30\n\n")[2].partition("\n\n")[0]
    rows = csv.reader(table.splitlines(), skipinitialspace=True)
    shown = {room: set(filter(None, imported.split(", "))) for room, _, imported in rows}
    assert shown == MAY_IMPORT
    drawn = re.findall(r'y="(\d+)">(\w+)<', (HOUSE.parents[1] / "_static" / "house.svg").read_text())
    heights = {room: int(height) for height, room in drawn}
    assert heights.keys() == MAY_IMPORT.keys()
    assert not [(room, below) for room in heights for below in MAY_IMPORT[room] if heights[below] <= heights[room]]


def test_what_every_room_uses_uses_no_room():
    shared = [p for p in FILES if p != PROGRAM and (not package_of(p) or package_of(p)[0].startswith("_"))]
    rooms = [(p, m) for p in shared for m in own_imports(p) if m[0][0] != "_" and m != ["exceptions"]]
    assert not rooms


def test_private_modules_are_for_their_own_package():
    for path in FILES:
        package = package_of(path)
        for module in own_imports(path):
            private = next((i for i, part in enumerate(module) if part.startswith("_")), None)
            if private is not None:
                assert package[:private] == module[:private], f"{path} reaches into {'.'.join(module)}"
                is_shared = private == 0 and not any(part.startswith("_") for part in module[1:])
                last = is_shared or private == len(module) - 1 or package[: private + 1] == module[: private + 1]
                assert last, f"{path} reaches into {'.'.join(module)}"


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


def test_only_core_dependencies_are_imported():
    allowed = CORE | set(sys.stdlib_module_names)
    for path in FILES:
        for_types = {
            node.module
            for branch in nodes(path)
            if isinstance(branch, ast.If) and getattr(branch.test, "id", "") == "TYPE_CHECKING"
            for node in ast.walk(branch)
            if isinstance(node, ast.ImportFrom)
        }
        others = {one for one in imported_modules(path) if one.split(".")[0] not in allowed and one not in for_types}
        assert not others, f"{path} imports {others}, which are no core dependencies"


def test_private_scikit_learn_is_imported_in_one_place():
    for path in FILES:
        for node in nodes(path):
            if isinstance(node, ast.ImportFrom) and node.module.startswith("sklearn") and path.name != "estimators.py":
                names = [*node.module.split("."), *(alias.name for alias in node.names)]
                private = [name for name in names if name.startswith("_")]
                assert not private, f"{path} imports scikit-learn's {private}"


def test_import_loads_nothing_optional_or_slow_and_fem_neither_pandas_nor_scikit_learn():
    unwanted = ("matplotlib", "jinja2", "dask", "distributed", "hypothesis", "scipy.signal", "sklearn.ensemble")
    code = "import sys, skthermo.fem; print([m for m in ('pandas', 'sklearn') if m in sys.modules])\n"
    code += f"import {', '.join(f'skthermo.{room}' for room in ROOMS)}; "
    code += f"print([m for m in {unwanted} if m in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.split() == ["[]", "[]"]


def test_a_job_with_a_monitor_loads_no_chain_and_no_study():
    unwanted = ("scipy.io", *(f"skthermo.{room}" for room in ("surrogate", "studies", "updating", "datasets")))
    code = "import sys, skthermo.commands.main, skthermo.reporting; "
    code += f"print([m for m in {unwanted} if m in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.split() == ["[]"]


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match=r"skthermo\[plot\]|plot"):
        DamageIndexDisplay.from_predictions([1.0, 3.0], 2.0)
