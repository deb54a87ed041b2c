"""The pictures of KW51."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib").use("Agg")

PATH = Path(__file__).parents[2] / "examples" / "plot_kw51_model.py"
SPEC = importlib.util.spec_from_file_location(PATH.stem, PATH)
EXAMPLE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(EXAMPLE)


def test_figures_are_drawn(tmp_path):
    structure, model = EXAMPLE.kw51_structure(), EXAMPLE.make_kw51()
    paths = EXAMPLE.draw(structure, model, tmp_path / "figures")
    assert [path.name for path in paths] == ["kw51_structure.png", "kw51_modes.png"]
    assert all(path.stat().st_size > 50_000 for path in paths)
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
