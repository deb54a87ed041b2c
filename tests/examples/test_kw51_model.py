"""What the pictures of KW51 show."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib").use("Agg")

PATH = Path(__file__).parents[2] / "examples" / "plot_kw51_model.py"
SPEC = importlib.util.spec_from_file_location(PATH.stem, PATH)
EXAMPLE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(EXAMPLE)


def test_every_member_is_drawn():
    structure = EXAMPLE.kw51_structure()
    drawn = set().union(*(structure.groups[group] for group in [*EXAMPLE.WIDTHS, "plate", "ballast"]))
    assert drawn == set(structure.members)


@pytest.mark.parametrize(
    ("part", "direction", "name"), [("deck", "z", "deck up and down"), ("arch", "y", "arches sideways")]
)
def test_a_mode_is_named_by_what_moves_most(part, direction, name):
    structure = EXAMPLE.kw51_structure()
    shape = [9.0 if (node[0], along) == (part, direction) else 1.0 for node, along in structure.dofs]
    assert EXAMPLE.kind(structure, np.array(shape)) == name


def test_both_figures_are_drawn(tmp_path):
    paths = EXAMPLE.draw(EXAMPLE.kw51_structure(), EXAMPLE.make_kw51(), tmp_path)
    assert all(path.is_file() for path in paths)
