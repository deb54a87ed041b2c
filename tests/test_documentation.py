"""Code in README and the user guide runs, and the figures that README shows are there."""

import doctest
import importlib
import re
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ADDRESS = "https://raw.githubusercontent.com/skthermo/skthermo/main/"
BUILT = {"generated", "gallery", "_build"}
PAGES = [ROOT / "README.md", *sorted(p for p in (ROOT / "docs").rglob("*.rst") if not BUILT & set(p.parts))]
DETECTED, DEVIATION = 0.936, 0.029  # alarms among days with 20 % damage: mean and deviation of 40 true years


def python_blocks(page):
    text = page.read_text()
    if page.suffix == ".md":
        return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    indented = re.findall(r"\.\. code-block:: python\n\n((?:    .*\n|\n)+)", text)
    return [textwrap.dedent(block) for block in indented]


@pytest.mark.parametrize("page", [p for p in PAGES if python_blocks(p)], ids=lambda p: p.name)
def test_a_pages_code_runs_from_top_to_bottom(page, capsys):
    namespace = {}
    for block in python_blocks(page):
        exec(compile(block, page.name, "exec"), namespace)
    printed = capsys.readouterr().out
    if any("print(" in block for block in python_blocks(page)):
        assert float(printed) == pytest.approx(DETECTED, abs=2 * DEVIATION)


@pytest.mark.parametrize("page", [p for p in PAGES if "\n>>> " in p.read_text()], ids=lambda p: p.name)
def test_a_pages_examples_print_what_it_shows(page):
    options = {"module_relative": False, "optionflags": doctest.NORMALIZE_WHITESPACE, "encoding": "utf-8"}
    failed, tried = doctest.testfile(str(page), **options)
    assert tried > failed == 0


def test_the_guide_shows_code():
    assert sum(len(python_blocks(page)) for page in PAGES) >= 5


@pytest.mark.parametrize(
    "room", ["fem", "preprocessing", "surrogate", "updating", "detection", "metrics", "datasets", "studies", "plotting"]
)
def test_the_reference_lists_every_public_name(room):
    index = (ROOT / "docs" / "reference" / "api" / "index.rst").read_text()
    listed = re.search(rf"currentmodule:: skthermo\.{room}\n.*?\n\n((?:   \w+\n)+)", index, flags=re.DOTALL)[1].split()
    assert listed == sorted(importlib.import_module(f"skthermo.{room}").__all__)


def test_images_of_readme_exist():
    images = re.findall(r"!\[.*?\]\((.*?)\)", (ROOT / "README.md").read_text())
    assert images
    for image in images:
        assert image.startswith(ADDRESS), "a package index shows README without the repository beside it"
        assert (ROOT / image.removeprefix(ADDRESS)).is_file()
