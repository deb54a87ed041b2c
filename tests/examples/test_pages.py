"""What all pages of the gallery have in common, and how a script saves its figures."""

import ast
import re
import sys
from importlib import import_module

import pytest

from tests.examples.pages import EXAMPLES

PAGES = sorted(EXAMPLES.glob("plot_*.py"))
page_recipes = import_module("page_recipes")


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_a_page_is_a_lesson_in_cells(page):
    text = page.read_text()
    title, underline = ast.get_docstring(ast.parse(text)).splitlines()[:2]
    assert len(title) <= 50  # what a card can show
    assert underline == "=" * len(title)
    assert text.count("\n# %%\n") >= 3
    assert 'if __name__ == "__main__"' not in text
    assert f"``python examples/{page.name}" in text  # its own command


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_images_and_files_of_a_page_exist(page):
    text = page.read_text()
    for image in re.findall(r"image:: /(images/\S+)|sphinx_gallery_thumbnail_path = '(\S+)'", text):
        file = EXAMPLES.parent / "docs" / "".join(image)
        assert file.stat().st_size < 150_000
    for recipe in re.findall(r"^from (\w+_recipes) import", text, flags=re.MULTILINE):
        assert f":download:`{recipe}.py`" in text
        assert (EXAMPLES / f"{recipe}.py").is_file()


def test_a_script_saves_its_open_figures_by_its_name(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["examples/plot_bridge.py", "--figures", str(tmp_path / "new")])
    folder = page_recipes.command_line().parse_args().figures
    page_recipes.plt.close("all")
    assert page_recipes.save_figures(folder) == []
    assert not folder.exists()  # where nothing is open, as in a gallery
    for _ in range(2):
        page_recipes.plt.figure()
    saved = page_recipes.save_figures(folder)
    page_recipes.plt.close("all")
    assert saved == [folder / "bridge_1.png", folder / "bridge_2.png"]
    assert all(path.is_file() for path in saved)
