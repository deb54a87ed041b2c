"""Numbers of the measured pages, of README and of the home page are in tables that ``release.py`` wrote."""

import csv
import importlib.util
import io
import itertools
import json
import re
from decimal import Decimal
from pathlib import Path

import pytest

from tests.source import lines_with

ROOT = Path(__file__).parents[1]
DOCS, MEASURED = ROOT / "docs", ROOT / "docs" / "measured"
RESULTS = sorted((MEASURED / "results").glob("*.json"))
INCLUDE = re.compile(r"^\.\. include:: measured/([\w-]+)\.rst$", re.MULTILINE)
PAGES = sorted(DOCS.glob("accuracy*.rst"))
CHOSEN = {  # settings of the measurements, not results, by page
    "accuracy": "7.5 40",
    "accuracy_costs": "30",
    "accuracy_detection": "0.3 0.95 2 20 40 50",
    "accuracy_studies": "2 5 10 20 30 90 95",
    "accuracy_kw51": "15",
}
NUMBER = r"-?\d*\.?\d+(?:e-?\d+)?"
LIST = rf"{NUMBER}(?:(?:,| and| to| or|,? and|;) {NUMBER})*"
UNITS = r"%|percent|points|seconds|minutes|times|[smµ]?s\b|[MG]B"
NO_PROSE = re.compile(r"``[^`]+``|:[\w:]+:`[^`]*`|^\.\. .*$|`[^`]*`_+|(?<=\d),(?=\d{3})", re.MULTILINE)


def stated(text):
    """Numbers of a text with a decimal point, or before a unit of what is measured."""
    prose = re.sub(r"\s+", " ", NO_PROSE.sub("", text))
    before_units = re.findall(rf"(?<![\w.-])({LIST}) ?(?:{UNITS})", prose)
    with_points = re.findall(r"(?<![\w.])\d*\.\d+(?![\w.]*[/(])", prose)
    return {number.lstrip("-") for part in (*before_units, *with_points) for number in re.findall(NUMBER, part)}


def cells_of(names):
    """Titles and cells of the tables of parts; the summary, which no command wrote, as it is."""
    for name in names:
        if name == "summary":
            yield (MEASURED / "summary.rst").read_text()
        else:
            for title, table in json.loads((MEASURED / "results" / f"{name}.json").read_text())["tables"].items():
                yield from (title, *itertools.chain.from_iterable(csv.reader(io.StringIO(table))))


def is_in(number, cells):
    """Whether a number is one of the cells', or a hundred times one, rounded as far as it is written."""
    half = 0.5001 * 10.0 ** Decimal(number).as_tuple().exponent
    texts = (re.sub(r"(?<=\d),(?=\d{3})", "", cell) for cell in cells)
    found = [abs(float(text)) for cell in texts for text in re.findall(rf"(?<![\w.]){NUMBER}", cell)]
    return any(abs(scale * value - float(number)) <= half for value in found for scale in (1, 100))


def unknown(text, parts, chosen=""):
    """Numbers that a text states and the tables of parts lack, each with its place."""
    cells = list(cells_of(parts))
    prose = re.sub(r"\s+", " ", text)
    return {
        number: re.findall(rf".{{0,50}}(?<![\w.]){re.escape(number)}(?![\w.]).{{0,20}}", prose)[:2]
        for number in stated(text)
        if number not in chosen.split() and not is_in(number, cells)
    }


@pytest.fixture(scope="module")
def release():
    spec = importlib.util.spec_from_file_location("release", ROOT / "tests" / "benchmarks" / "release.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("file", RESULTS, ids=lambda path: path.stem)
def test_a_table_is_what_its_command_printed(file, release):
    found = json.loads(file.read_text())
    again = f"python tests/benchmarks/release.py --again --only {file.stem}"
    part = release.PARTS.get(file.stem)
    assert part, f"docs/measured: remove {file.name} and {file.stem}.rst, which no part of release.py gives"
    assert found["command"] == part.command, f"{file.name} is of another command; {again}"
    assert found["exit code"] in (0, 1), f"{file.name} is of a run that failed; {again}"
    assert found["tables"], f"{file.name} has no tables; {again}"
    assert (MEASURED / f"{file.stem}.rst").read_text() == release.page(found), f"{file.stem}.rst was changed; {again}"


def test_no_table_was_written_by_hand():
    others = {path.stem for path in MEASURED.glob("*.rst")} ^ ({path.stem for path in RESULTS} | {"summary"})
    assert not others, f"docs/measured: a page and a result of each part, and none alone: {sorted(others)}"
    found = lines_with(r"^ *(?:\.\. (?:list-|csv-)?table::|=+ +=)", ROOT, PAGES)
    assert not found, "\n".join(["include a table of docs/measured in place of:", *found])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_numbers_of_the_prose_are_in_the_tables_of_its_section(page):
    text = page.read_text()
    of_page = INCLUDE.findall(text)
    assert of_page, f"docs/{page.name}: include a table of docs/measured"
    for section in re.split(r"^(?=.+\n[-=]{3,}$)", text, flags=re.MULTILINE):
        found = unknown(section, INCLUDE.findall(section) or of_page, CHOSEN.get(page.stem, ""))
        assert not found, f"docs/{page.name}: write what its tables say, or name a setting in CHOSEN: {found}"


def test_settings_are_of_pages_that_are_there():
    gone = set(CHOSEN) - {page.stem for page in PAGES}
    assert not gone, f"{__file__}: remove from CHOSEN {gone}"


def rows_of_the_summary():
    return (MEASURED / "summary.rst").read_text().partition("   * - ")[2].split("\n   * - ")[1:]


@pytest.mark.parametrize("row", rows_of_the_summary(), ids=lambda row: row.partition("\n")[0][:40])
def test_a_row_of_the_summary_is_what_its_parts_printed(row):
    *said, parts = row.split("     - ")
    names = re.findall(r"``([\w-]+)``", parts)
    assert names, f"docs/measured/summary.rst: name the parts of {row}"
    found = unknown("\n".join(said), names)
    assert not found, f"docs/measured/summary.rst: write what {names} say: {found}"


def test_readme_and_home_say_what_the_summary_says():
    home, readme = (DOCS / "index.rst").read_text(), (ROOT / "README.md").read_text()
    cards = home.partition(":class-container: measured")[2].partition(":class-container:")[0]
    assert stated(cards)
    assert stated(readme)
    found = unknown(cards, ["summary"])
    assert not found, f"docs/index.rst: write what docs/measured/summary.rst says: {found}"
    prose = re.sub(r"```.*?```|<img[^>]*>", "", readme, flags=re.DOTALL)
    found = unknown(prose, ["summary", "readme-study"], "3.11")
    assert not found, f"README.md: write what docs/measured/summary.rst says: {found}"
