"""The package at another commit, in an environment of its own, in which a benchmark runs beside the present package."""

import os
import subprocess
import sys
import sysconfig
import tempfile
import venv
import zlib
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[2]
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "skthermo"


@dataclass(frozen=True)
class OtherVersion:
    """The package at a commit: an environment with it, and the files of the repository at that commit."""

    commit: str
    environment: Path
    source: Path

    @classmethod
    def built(cls, commit):
        """The environment in the user's cache; made once for each commit and Python.

        Dependencies are those of the Python that runs, so that only skthermo differs.
        """
        full = git("rev-parse", "--verify", f"{commit}^{{commit}}").decode().strip()
        made = CACHE.resolve() / f"{full[:12]}-{zlib.crc32(sys.prefix.encode()):08x}"
        if not made.exists():
            made.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=made.parent) as scratch:
                being_made = Path(scratch) / "made"
                build(full, being_made)
                being_made.rename(made)  # whole or not at all
        return cls(commit, made / "environment", made / "source")

    def run(self, script, words):
        """A script of the present checkout with the other package, or, where it fails there, that commit's script."""
        script = Path(script).resolve()
        done = self.run_file(script, words)
        older = self.source / script.relative_to(ROOT)
        if has_failed(done) and older.exists():
            done = self.run_file(older, words)
        return done

    def run_file(self, file, words):
        settings = os.environ | {"PYTHONPATH": str(self.source / "examples")}  # recipes for that package
        programs = self.environment / ("Scripts" if os.name == "nt" else "bin")
        return run_python(programs / "python", file, words, settings)


def run_present(file, words):
    """A script with the package of this checkout."""
    return run_python(sys.executable, file, words, os.environ | {"PYTHONPATH": str(ROOT)})


def run_python(python, file, words, settings):
    return subprocess.run([python, file, *words], env=settings, capture_output=True, text=True)


def build(commit, folder):
    """An environment, the package at a commit in it, and the other files of the commit beside it."""
    environment, source = folder / "environment", folder / "source"
    venv.create(environment, symlinks=os.name != "nt")
    source.mkdir()
    subprocess.run(["tar", "-x", "-C", source], input=git("archive", commit), check=True)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(environment), "platbase": str(environment)}))
    (source / "skthermo").rename(packages / "skthermo")  # pure Python, whose files are all of it
    present = dict.fromkeys(sysconfig.get_path(name) for name in ("purelib", "platlib"))
    (packages / "dependencies.pth").write_text("\n".join(present))  # behind the environment's own packages


def git(*words):
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True).stdout


def has_failed(done):
    """Whether a benchmark ended in an exception; with 1 it ends as well where a target is missed."""
    return done.returncode not in (0, 1) or "Traceback (most recent call last)" in done.stderr


def side_by_side(table, other, commit):
    """Columns of two tables in pairs, those of the other one with its commit."""
    rows = table.index.union(other.index, sort=False)
    pairs = {}
    for name in dict.fromkeys([*table, *other]):
        pairs |= {heading: one[name] for heading, one in ((name, table), (f"{name} {commit}", other)) if name in one}
    return pd.DataFrame({heading: column.reindex(rows, fill_value="") for heading, column in pairs.items()}, rows)
