"""Code in README and the user guide runs, and the figures that README shows are there."""

import doctest
import importlib
import pkgutil
import re
import textwrap
from pathlib import Path

import pytest

import skthermo

ROOT = Path(__file__).parents[1]
BUILT = {"generated", "gallery", "_build"}
PAGES = [ROOT / "README.md", *sorted(p for p in (ROOT / "docs").rglob("*.rst") if not BUILT & set(p.parts))]
API = ROOT / "docs" / "reference" / "api"
ROOMS = [m.name for m in pkgutil.iter_modules(skthermo.__path__) if m.ispkg and not m.name.startswith("_")]
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


def test_pages_import_nothing_private():
    private = {page.name: re.findall(r"(?:from|import) skthermo[\w.]*\._.*", page.read_text()) for page in PAGES}
    assert not {page: imports for page, imports in private.items() if imports}


def test_the_guide_shows_code():
    assert sum(len(python_blocks(page)) for page in PAGES) >= 5


@pytest.mark.parametrize("room", ROOMS)
def test_the_reference_lists_every_public_name(room):
    page = (API / f"{room}.rst").read_text()
    tables = re.findall(r"autosummary::\n(?:   :.*\n)+\n((?:   \w+\n)+)", page)
    assert f"currentmodule:: skthermo.{room}\n" in page
    assert sorted(" ".join(tables).split()) == sorted(importlib.import_module(f"skthermo.{room}").__all__)


def test_reference_and_guide_have_every_package():
    toctree = re.search(r"toctree::\n   :hidden:\n\n((?:   \w+\n)+)", (API / "index.rst").read_text())[1].split()
    inside = re.findall(r"</reference/api/(?!index)(\w+)>", (ROOT / "docs/guide/inside.rst").read_text())
    assert sorted(toctree) == sorted(ROOMS) == sorted(page.stem for page in API.glob("*.rst") if page.stem != "index")
    assert sorted(inside) == sorted(ROOMS)


def test_sources_are_listed_and_cited():
    citing = [*(ROOT / "skthermo").rglob("*.py"), *PAGES]
    cited = {label for path in citing for label in re.findall(r"\[([A-Z]\w*\d\d)\]_", path.read_text())}
    listed = re.findall(r"^\.\. \[(\w+)\] ", (ROOT / "docs/reference/bibliography.rst").read_text(), flags=re.MULTILINE)
    assert sorted(cited) == sorted(listed)


def test_images_and_links_of_readme_are_files_of_any_copy():
    text = (ROOT / "README.md").read_text()
    images, links = (re.findall(pattern, text) for pattern in (r"!\[[^]]*\]\((.*?)\)", r"[^!]\[[^]]*\]\((.*?)\)"))
    assert images
    assert links
    assert not [target for target in images + links if not (ROOT / target).is_file()]


def test_no_file_names_an_address_of_the_project_that_does_not_exist():
    """The project has no address yet, neither a page of its own nor one at a package index."""
    folders = [ROOT / name for name in ("docs", "examples", "skthermo", "tests", "tools", ".ci")]
    below = [path for folder in folders for path in folder.rglob("*") if not BUILT & set(path.parts)]
    address = re.compile(rb"(?:https?://|www\.|git@)[^\s\"'<>`]*skthermo|pip install [\"']?skthermo", re.IGNORECASE)
    files = [path for path in [*ROOT.iterdir(), *below] if path.is_file()]
    found = {str(path.relative_to(ROOT)): address.findall(path.read_bytes()) for path in files}
    assert {"README.md", "pyproject.toml", "CITATION.cff", "docs/conf.py"} < set(found)
    assert not {name: addresses for name, addresses in found.items() if addresses}


def test_the_citation_is_of_this_version():
    assert f"\nversion: {skthermo.__version__}\n" in (ROOT / "CITATION.cff").read_text()
