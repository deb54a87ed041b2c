"""Code in README and the user guide runs, and the figures that README shows are there."""

import doctest
import importlib
import pkgutil
import re
import runpy
import textwrap
from itertools import product
from pathlib import Path

import pandas as pd
import pytest

import skthermo
from skthermo.datasets import make_truss_campaign
from tests.source import BUILT, lines_with, text_files
from tools.mutations import MUTATIONS, is_written_once

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted(p for p in (ROOT / "docs").rglob("*.rst") if not BUILT & set(p.parts))]
API = ROOT / "docs" / "reference" / "api"
PACKAGES = [m.name for m in pkgutil.iter_modules(skthermo.__path__) if not m.name.startswith("_")]
ROOMS = [name for name in PACKAGES if importlib.import_module(f"skthermo.{name}").__all__]  # with public names
README, HOME = ROOT / "README.md", ROOT / "docs" / "index.rst"
LONG = {  # pages whose code takes seconds
    "choices.rst", "detection.rst", "estimation.rst", "identify.rst", "in_service.rst", "many_bridges.rst",
    "method.rst", "models.rst", "preparing_records.rst", "quickstart.rst",
    "records_theory.rst", "studies.rst", "three_steps.rst", "validation.rst",
}  # fmt: skip


def by_page(has_code):
    """A test of each page that has some code, at night if it takes long."""
    pages = [page for page in PAGES if has_code(page)]
    marks = {True: [pytest.mark.nightly], False: []}
    each = [pytest.param(page, id=page.name, marks=marks[page.name in LONG]) for page in pages]
    return pytest.mark.parametrize("page", each)


def python_blocks(page):
    text = page.read_text()
    if page.suffix == ".md":
        return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    indented = re.findall(r"\.\. code-block:: python\n\n((?:    .*\n|\n)+)", text)
    return [textwrap.dedent(block) for block in indented]


def run_code(page):
    """The names that a page's code defines."""
    namespace = {}
    for block in python_blocks(page):
        exec(compile(block, page.name, "exec"), namespace)
    return namespace


@pytest.mark.filterwarnings("ignore:.*(bridges|set-aside)")  # of a fleet whose records have outliers
@by_page(lambda page: page not in (README, HOME) and python_blocks(page))
@pytest.mark.usefixtures("chains_fitted_once")
def test_a_pages_code_runs_from_top_to_bottom(page):
    assert run_code(page).keys() > {"__builtins__"}  # it runs without an error, and defines something


@pytest.mark.usefixtures("chains_fitted_once")
def test_readmes_study_prints_what_is_shown(capsys):
    run_code(README)
    shown = re.search(r"```text\n(.*?)```", README.read_text(), flags=re.DOTALL)[1]
    assert capsys.readouterr().out.split() == shown.split()


@pytest.mark.nightly
def test_rates_of_readmes_study_are_those_of_true_years():
    """Rates of alarms of its detectors in ten years from the thermo-mechanical law are near the simulated ones."""
    study, rates = run_code(README)["study"], []
    for damage, seed in product(({"bottom": 0.1}, {"top": 0.1}), range(100, 110)):
        year = make_truss_campaign(damage=damage, random_state=seed)
        both = year.temperatures.join(year.frequencies)
        alarms = {name: one.predict(both[one.feature_names_in_]) == -1 for name, one in study.detectors_.items()}
        rates.append(pd.DataFrame(alarms).mean())
    true, simulated = pd.DataFrame(rates).mean(), study.ranking()["pod"]
    assert (true - simulated).abs().max() < 0.05
    assert simulated.index[0] == true.idxmax() == "directions of damage"


def test_the_home_page_shows_readmes_code_and_figure():
    assert python_blocks(HOME)[0].strip() == python_blocks(README)[0].strip()
    figures = re.findall(r'src="docs/(.*?)" width="\d+" alt="(.*?)"', README.read_text())
    image, text = re.search(r"image:: /(images/\S+)\n\s+:alt: ((?:.+\n)+?)\s+:target:", HOME.read_text()).groups()
    assert (image, " ".join(text.split())) in figures


@pytest.mark.nightly
def test_the_papers_chain_on_the_truss_errs_as_published():
    names = runpy.run_path(str(ROOT / "docs/guide/recipes/paper_chain_truss.py"))
    assert names["errors"].mean() < 1.5  # Table 2: percent, mean of six modes


@by_page(lambda page: "\n>>> " in page.read_text())
@pytest.mark.usefixtures("chains_fitted_once")
def test_a_pages_examples_print_what_it_shows(page):
    options = {"module_relative": False, "optionflags": doctest.NORMALIZE_WHITESPACE, "encoding": "utf-8"}
    failed, tried = doctest.testfile(str(page), **options)
    assert tried > failed == 0


def test_pages_import_nothing_private():
    found = lines_with(r"(?:from|import) skthermo[\w.]*\._", ROOT, PAGES)
    assert not found, "\n".join(["import what a package gives:", *found])


def test_the_users_pages_have_at_most_30000_words():
    others = {"measured", "reference", "contributing", "_templates"}
    pages = [page for page in PAGES if page != README and not others & set(page.relative_to(ROOT / "docs").parts)]
    words = pd.Series({page.relative_to(ROOT): len(page.read_text().split()) for page in pages})
    assert words.sum() <= 30_000, f"shorten by {words.sum() - 30_000} words; the longest pages:\n{words.nlargest(8)}"


def test_the_guide_shows_code():
    assert sum(len(python_blocks(page)) for page in PAGES) >= 5
    gone = LONG - {page.name for page in PAGES}
    assert not gone, f"{__file__}: remove from LONG what is no page: {gone}"


@pytest.mark.parametrize("room", ROOMS)
def test_the_reference_lists_every_public_name(room):
    page = (API / f"{room}.rst").read_text()
    tables = re.findall(r"autosummary::\n(?:   :.*\n)+\n((?:   \w+\n)+)", page)
    assert f"currentmodule:: skthermo.{room}\n" in page
    names, listed = importlib.import_module(f"skthermo.{room}").__all__, " ".join(tables).split()
    missing, gone = sorted({*names} - {*listed}), sorted({*listed} - {*names})
    assert not missing, f"docs/reference/api/{room}.rst: add {missing} to one of its tables"
    assert not gone, f"docs/reference/api/{room}.rst: remove {gone}"
    assert len(listed) == len(names), f"docs/reference/api/{room}.rst: a name stands there twice"


def test_reference_and_guide_have_every_package():
    toctree = re.search(r"toctree::\n   :hidden:\n\n((?:   \w+\n)+)", (API / "index.rst").read_text())[1].split()
    inside = re.findall(r"</reference/api/(?!index)(\w+)>", (ROOT / "docs/guide/method.rst").read_text())
    pages = [page.stem for page in API.glob("*.rst") if page.stem != "index"]
    listed = {f"{API}/": pages, f"{API}/index.rst, toctree": toctree, "docs/guide/method.rst, packages": inside}
    wrong = [f"{place}: {sorted(names)}" for place, names in listed.items() if sorted(names) != sorted(ROOMS)]
    assert not wrong, "\n".join([f"list each package with public names once, {ROOMS}, in place of:", *wrong])


def test_files_and_names_that_contributors_are_sent_to_are_there():
    """Paths are files, and a word in code stands in the source or is a file's name."""
    folders = [ROOT / name for name in ("skthermo", "tests", "tools", "docs", "examples")]
    files = [path for folder in folders for path in folder.rglob("*.*") if not BUILT & set(path.parts)]
    texts = [path.read_text() for path in files if path.suffix in {".py", ".toml", ".j2"}]
    words = set(re.findall(r"\w+", " ".join(texts))) | {path.name for path in files}
    named = re.compile(
        r"(?<![\w/.])(?:skthermo|tests|docs|examples|tools)/[\w/.]*\w"  # a path
        r"|(?<=``)(?:\w*[A-Z_]\w*|[\w-]+\.py)(?=``)"  # a name, or a file's
    )
    invented = re.compile("NAME|PAGE|PART|ROOM|_build|CODE_OF_CONDUCT|github_url")
    missing = [
        f"{page.relative_to(ROOT)}: {name}"
        for page in [ROOT / "CONTRIBUTING.md", *(ROOT / "docs" / "contributing").glob("*.rst")]
        for name in named.findall(page.read_text())
        if not (invented.search(name) or name in words or (ROOT / name).exists())
    ]
    assert not missing, "\n".join(["name what is there now, in place of:", *missing])


def test_a_page_says_what_each_tool_is_for():
    callers = [ROOT / "docs" / "conf.py", *PAGES]
    texts = " ".join(path.read_text() for path in callers)
    unused = [path.name for path in (ROOT / "tools").glob("*.py") if f"tools/{path.name}" not in texts]
    assert not unused, f"tools/: name on a page who calls it, or remove: {unused}"


def test_every_mutation_can_be_made():
    each = [(file, tests, *mutation) for (file, tests), found in MUTATIONS.items() for mutation in found]
    gone = [
        f"{breaks} ({file}; tests/{tests})"
        for file, tests, breaks, *texts in each
        if not is_written_once(file, tests, breaks, *texts)
    ]
    assert not gone, "\n".join(["tools/mutations.py: write anew what no longer stands in the code once:", *gone])


def test_sources_are_listed_and_cited():
    citing = [*(ROOT / "skthermo").rglob("*.py"), *PAGES]
    cited = {label for path in citing for label in re.findall(r"\[([A-Z]\w*\d\d)\]_", path.read_text())}
    listed = re.findall(r"^\.\. \[(\w+)\] ", (ROOT / "docs/reference/bibliography.rst").read_text(), flags=re.MULTILINE)
    assert len(listed) == len({*listed}), "docs/reference/bibliography.rst: a source stands there twice"
    assert not cited - {*listed}, f"docs/reference/bibliography.rst: add {cited - {*listed}}"
    assert not {*listed} - cited, f"docs/reference/bibliography.rst: remove, or cite, { ({*listed} - cited) }"


def test_images_and_links_of_readme_are_files_of_any_copy():
    text = (ROOT / "README.md").read_text()
    images, links = re.findall(r'src="(.*?)"', text), re.findall(r"\]\((.*?)\)", text)
    assert images
    assert links
    below = {"#" + title.lower().replace(" ", "-") for title in re.findall(r"^## ([\w ]+)", text, flags=re.MULTILINE)}
    gone = [target for target in images + links if target not in below and not (ROOT / target).is_file()]
    assert not gone, f"README.md: name a file of the project, or one of {sorted(below)}, in place of {gone}"


def test_no_file_names_an_address_of_the_project_that_does_not_exist():
    """The project has no address yet, neither a page of its own nor one at a package index."""
    folders = [ROOT / name for name in ("docs", "examples", "skthermo", "tests", "tools", ".ci")]
    below = [path for folder in folders for path in folder.rglob("*") if not BUILT & set(path.parts)]
    address = re.compile(rb"(?:https?://|www\.|git@)[^\s\"'<>`]*skthermo|pip install [\"']?skthermo", re.IGNORECASE)
    files = [path for path in [*ROOT.iterdir(), *below] if path.is_file()]
    found = {str(path.relative_to(ROOT)): address.findall(path.read_bytes()) for path in files}
    assert {"README.md", "pyproject.toml", "CITATION.cff", "docs/conf.py"} < set(found)
    wrong = {name: addresses for name, addresses in found.items() if addresses}
    assert not wrong, f"name the project without an address in {wrong}"


def test_the_citation_is_of_this_version():
    assert f"\nversion: {skthermo.__version__}\n" in (ROOT / "CITATION.cff").read_text()


REPLACED = (
    "judge[sd]?|judging|foretells?|foretold|aliens?|told|tells? apart|promise[sd]?|absurd|broken lines?|weather apart|"
    "worlds?|bench|courses?|confused|stands? on|unseen(?![ _]weather)"  # unseen weather: outside the training range
)
"""What ``docs/contributing/words.rst`` replaces by the field's words; "benchmark" is a word of the field."""
NOT_OURS = re.compile(rf"(?<![a-z])(?:{REPLACED})(?![a-z])", re.IGNORECASE)  # also within names_of_several_words
LISTS_OF_THEM = {ROOT / "docs/contributing/words.rst", Path(__file__).resolve()}


@pytest.mark.parametrize("folder", ["README.md", "docs", "examples", "skthermo", "tests", "tools"])
def test_text_and_names_are_in_the_fields_words(folder):
    files = text_files(ROOT, folder)
    assert files
    named = [f"{path.relative_to(ROOT)}: its name" for path in files if NOT_OURS.search(path.stem)]
    found = [*named, *lines_with(NOT_OURS, ROOT, [path for path in files if path not in LISTS_OF_THEM])]
    assert not found, "\n".join(["write the field's word, docs/contributing/words.rst, in:", *found])
