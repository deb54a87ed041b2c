"""The package is found where a folder of its name, such as a clone, lies beside the user's script."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import skthermo

ROOT = Path(__file__).parents[1]


def test_a_clone_beside_a_script_does_not_hide_a_package_that_is_installed_as_a_path(tmp_path):
    """An editable install through an import hook would lose to the clone's folder, which has no ``__init__.py``."""
    clone = tmp_path / "skthermo"
    shutil.copytree(Path(skthermo.__file__).parent, clone / "skthermo", ignore=shutil.ignore_patterns("__pycache__"))
    code = f"import sys; sys.path.append({str(clone)!r}); import skthermo as s; print(s.__version__, s.__file__)"
    # The path begins with the working directory, and no other installation is on it.
    command = [sys.executable, "-S", "-c", code]
    found = subprocess.run(command, cwd=tmp_path, env={}, capture_output=True, text=True, check=True)
    assert found.stdout.split() == [skthermo.__version__, str(clone / "skthermo" / "__init__.py")]


def test_editable_installs_are_a_path():
    """Setuptools makes them one only where the folder of the packages is named."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert settings["package-dir"] == {"": "."}
