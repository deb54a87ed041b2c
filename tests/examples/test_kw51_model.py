"""What the pictures of KW51 show."""

import numpy as np
import pytest

from tests.examples.pages import run

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures")
    return run("kw51_model", "--figures", folder) | {"saved": sorted(folder.iterdir())}


def test_every_member_is_drawn(page):
    structure = page["structure"]
    drawn = set().union(*(structure.groups[group] for group in [*page["WIDTHS"], "plate", "ballast"]))
    assert drawn == set(structure.members)


@pytest.mark.parametrize(
    ("part", "direction", "name"), [("deck", "z", "deck up and down"), ("arch", "y", "arches sideways")]
)
def test_a_mode_is_named_by_what_moves_most(page, part, direction, name):
    shape = [9.0 if (node[0], along) == (part, direction) else 1.0 for node, along in page["structure"].dofs]
    assert page["kind"](page["structure"], np.array(shape)) == name


def test_both_figures_are_saved(page):
    assert [path.name for path in page["saved"]] == ["kw51_model_1.png", "kw51_model_2.png"]
