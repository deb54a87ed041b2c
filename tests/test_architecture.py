"""Which room may import which, and what importing costs."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import skthermo
from skthermo._optional import import_optional

PACKAGE = Path(skthermo.__file__).parent
MAY_IMPORT = {
    "fem": set(),
    "preprocessing": set(),
    "metrics": set(),
    "detection": {"metrics"},
    "surrogate": {"fem", "metrics"},
    "updating": {"fem", "metrics"},
    "datasets": {"fem"},
}
CORE = {"numpy", "scipy", "pandas", "sklearn", "joblib", "threadpoolctl", "skthermo"}


def imported_modules(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield node.module


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_arrows_point_one_way(path):
    parts = path.relative_to(PACKAGE).parts
    room = parts[0] if len(parts) > 1 else None
    for module in imported_modules(path):
        top = module.split(".")
        assert top[0] in CORE | set(sys.stdlib_module_names), f"{module} is not a core dependency"
        if top[0] == "skthermo" and len(top) > 1 and not top[1].startswith("_"):
            assert room is not None, f"{module}: what every room uses may not use a room"
            assert top[1] in MAY_IMPORT[room] | {room}, f"{room} may not import {module}"


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE)))
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
        "skthermo.metrics, skthermo.datasets, skthermo.updating; "
        "print([m for m in ('matplotlib', 'dask', 'distributed', 'hypothesis') if m in sys.modules])"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.strip() == "[]"


def test_a_missing_extra_is_named():
    assert import_optional("json", extra="plot").dumps([1]) == "[1]"
    with pytest.raises(ImportError, match=r"'no_such_module' is not installed; .* install \"skthermo\[plot"):
        import_optional("no_such_module", extra="plot")
