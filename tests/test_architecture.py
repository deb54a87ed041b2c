"""Which room may import which, and what importing costs."""

import ast
import csv
import subprocess
import sys
from pathlib import Path

import pytest

import skthermo
from skthermo._optional import import_optional

PACKAGE = Path(skthermo.__file__).parent
HOUSE = Path(__file__).parents[1] / "docs" / "contributing" / "house.rst"
MAY_IMPORT = {
    "fem": set(),
    "fem.elements": set(),
    "fem.modal": set(),
    "fem.sampling": set(),
    "fem.affine": {"fem.modal"},
    "fem.assembly": {"fem.elements", "fem.affine"},
    "fem.external": {"fem.affine"},
    "preprocessing": set(),
    "metrics": set(),
    "detection": {"metrics"},
    "surrogate": {"fem", "metrics", "preprocessing", "updating"},
    "updating": {"fem", "metrics"},
    "datasets": {"fem"},
    "plotting": {"fem", "surrogate", "updating", "detection", "metrics", "datasets"},
    "studies": {"fem", "preprocessing", "surrogate", "updating", "detection", "metrics", "datasets", "plotting"},
}
CORE = {"numpy", "scipy", "pandas", "sklearn", "joblib", "threadpoolctl", "skthermo"}
FILES = sorted(PACKAGE.rglob("*.py"))
LONGEST_FILE = 350
each_file = pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))


def imported_modules(path):
    for node in ast.walk(ast.parse(path.read_text())):
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


@each_file
def test_arrows_point_one_way(path):
    room = ".".join(package_of(path))
    for module in own_imports(path):
        package = ".".join(part for part in module if not part.startswith("_"))
        if module[0].startswith("_") or package == room or not room:
            continue
        is_front = path.name == "__init__.py" and package.startswith(room + ".")  # a room presents its sub-rooms
        shares_parent = room.startswith(package + ".") and module[-1].startswith("_")
        assert is_front or shares_parent or package in MAY_IMPORT[room], f"{room} may not import {'.'.join(module)}"


def test_the_guide_for_contributors_shows_the_arrows():
    table = HOUSE.read_text().partition(":widths: 15, 55, 30\n\n")[2].partition("\n\n")[0]
    rows = csv.reader(table.splitlines(), skipinitialspace=True)
    shown = {room: set(filter(None, imported.split(", "))) for room, _, imported in rows}
    assert shown == {room: imported for room, imported in MAY_IMPORT.items() if "." not in room}


@each_file
def test_what_every_room_uses_uses_no_room(path):
    if not package_of(path) or package_of(path)[0].startswith("_"):
        assert all(module[0].startswith("_") for module in own_imports(path))


@each_file
def test_private_modules_are_for_their_own_package(path):
    for module in own_imports(path):
        private = next((i for i, part in enumerate(module) if part.startswith("_")), None)
        if private is not None:
            assert package_of(path)[:private] == module[:private], f"{path} reaches into {'.'.join(module)}"
            assert private == len(module) - 1 or package_of(path)[: private + 1] == module[: private + 1]


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


@each_file
def test_only_core_dependencies_are_imported(path):
    for module in imported_modules(path):
        assert module.split(".")[0] in CORE | set(sys.stdlib_module_names), f"{module} is not a core dependency"


@each_file
def test_files_are_short(path):
    assert len(path.read_text().splitlines()) <= LONGEST_FILE


@each_file
def test_private_scikit_learn_is_imported_in_one_place(path):
    if path.name == "_validation.py":
        return
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module.startswith("sklearn"):
            names = [*node.module.split("."), *(alias.name for alias in node.names)]
            assert not [name for name in names if name.startswith("_")]


def test_import_loads_no_optional_package():
    code = (
        "import sys, skthermo, skthermo.fem, skthermo.preprocessing, skthermo.surrogate, skthermo.detection, "
        "skthermo.metrics, skthermo.datasets, skthermo.updating, skthermo.plotting, skthermo.studies; "
        "print([m for m in ('matplotlib', 'dask', 'distributed', 'hypothesis') if m in sys.modules])"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.strip() == "[]"


def test_fem_needs_neither_pandas_nor_scikit_learn_to_be_imported():
    code = "import sys, skthermo.fem; print([m for m in ('pandas', 'sklearn') if m in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.strip() == "[]"


def test_a_missing_extra_is_named():
    assert import_optional("json", extra="plot").dumps([1]) == "[1]"
    with pytest.raises(ImportError, match=r"'no_such_module' is not installed; .* install \"skthermo\[plot"):
        import_optional("no_such_module", extra="plot")
