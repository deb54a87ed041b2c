"""The user guide's recipes, as they stand there, against the programs themselves."""

import re
import textwrap
from pathlib import Path

import numpy as np
import pytest

from skthermo.fem import Beam, Structure

GUIDE = Path(__file__).parents[2] / "docs" / "guide" / "models.rst"
THETA = np.random.default_rng(0).uniform(0.7, 1.3, (4, 2))


def run_recipe(name):
    """What a recipe defines."""
    block = re.search(rf":name: {name}\n\n((?:    .*\n|\n)+)", GUIDE.read_text())
    defined = {}
    exec(compile(textwrap.dedent(block[1]), name, "exec"), defined)
    return defined


def test_pynite(tmp_path, monkeypatch):
    pytest.importorskip("Pynite", reason="PyNiteFEA is not installed: the extra 'oracle' brings it")
    monkeypatch.chdir(tmp_path)
    recipe = run_recipe("recipe-pynite")
    theirs = recipe["slow"].frequencies(THETA)
    assert recipe["slow"].cache == tmp_path / "frame.solved"
    np.testing.assert_allclose(recipe["fast"].frequencies(THETA), theirs, rtol=1e-8)

    section = {"A": 0.12, "I_yy": 1.6e-3, "I_zz": 9e-4, "J": 2e-3, "I_p": 2e-3}
    concrete = {"E": 30e9, "G": 12.5e9, "density": 2500.0}
    ours = Structure(
        {"a": (0, 0, 0), "b": (0, 4, 0), "c": (6, 4, 0), "d": (6, 0, 0)},
        {i + j: Beam(i, j, **section, **concrete, orientation=(0, 0, 1)) for i, j in ("ab", "bc", "cd")},
        dict.fromkeys("ad", "xyz rx ry rz"),
        {"columns": ["ab", "cd"], "beam": ["bc"]},
    ).assemble(["columns", "beam"])
    np.testing.assert_allclose(ours.frequencies(THETA), theirs, rtol=1e-6)


def test_opensees():
    pytest.importorskip("openseespy", reason="openseespy is not installed; its licence is not an open-source one")
    recipe = run_recipe("recipe-opensees")
    for row, ours in zip(THETA, recipe["model"].frequencies(THETA), strict=True):
        recipe["build"](row)
        theirs = np.sqrt(recipe["ops"].eigen("-fullGenLapack", 4)) / (2 * np.pi)
        np.testing.assert_allclose(ours, theirs, rtol=1e-6)
