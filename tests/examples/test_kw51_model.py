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
    drawn = set().union(*(structure.groups[group] for group in [*EXAMPLE.COLOURS, "plate", "ballast"]))
    assert drawn == set(structure.members)


def test_displacements_leave_supports_where_they_are():
    structure = EXAMPLE.kw51_structure()
    moved = EXAMPLE.displacements(structure, np.ones(len(structure.dofs)))
    assert not moved["deck", 0, 0].any()
    np.testing.assert_array_equal(moved["deck", 0, 4], [1, 0, 0])
    np.testing.assert_array_equal(moved["arch", 5, 0], [1, 1, 1])
    assert EXAMPLE.kind(moved | {node: u * [0, 0, 9] for node, u in moved.items() if node[0] == "deck"}) == (
        "deck up and down"
    )
