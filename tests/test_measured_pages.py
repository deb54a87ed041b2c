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

ROOT = Path(__file__).parents[1]
DOCS, MEASURED = ROOT / "docs", ROOT / "docs" / "measured"
RESULTS = sorted((MEASURED / "results").glob("*.json"))
# Settings of the measurements, not results, by page.
CHOSEN = {
    "accuracy": "7.5",
    "accuracy_regressors": "",
    "accuracy_costs": "30",
    "accuracy_detection": "0.3 0.95 2 20 40 50",
    "accuracy_studies": "2 5 10 20 30 90 95",
    "accuracy_monitoring": "",
    "accuracy_identification": "",
    "accuracy_kw51": "15",
    "accuracy_paper": "",
}
INCLUDE = re.compile(r"^\.\. include:: measured/([\w-]+)\.rst$", re.MULTILINE)
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
    assert found["command"] == release.PARTS[file.stem].command
    assert found["exit code"] in (0, 1)
    assert found["tables"]
    assert (MEASURED / f"{file.stem}.rst").read_text() == release.page(found)


def test_no_table_was_written_by_hand():
    assert {path.stem for path in MEASURED.glob("*.rst")} == {path.stem for path in RESULTS} | {"summary"}
    for page in CHOSEN:
        text = (DOCS / f"{page}.rst").read_text()
        assert not re.findall(r"^ *(?:\.\. (?:list-|csv-)?table::|=+ +=)", text, re.MULTILINE)


@pytest.mark.parametrize("page", CHOSEN)
def test_numbers_of_the_prose_are_in_the_tables(page):
    text = (DOCS / f"{page}.rst").read_text()
    assert INCLUDE.search(text)
    assert not unknown(text, INCLUDE.findall(text), CHOSEN[page])


def rows_of_the_summary():
    return (MEASURED / "summary.rst").read_text().partition("   * - ")[2].split("\n   * - ")[1:]


@pytest.mark.parametrize("row", rows_of_the_summary(), ids=lambda row: row.partition("\n")[0][:40])
def test_a_row_of_the_summary_is_what_its_parts_printed(row):
    *said, parts = row.split("     - ")
    names = re.findall(r"``([\w-]+)``", parts)
    assert names
    assert not unknown("\n".join(said), names)


def test_readme_and_home_say_what_the_summary_says():
    home, readme = (DOCS / "index.rst").read_text(), (ROOT / "README.md").read_text()
    cards = home.partition(":class-container: measured")[2].partition(":class-container:")[0]
    assert stated(cards)
    assert stated(readme)
    assert not unknown(cards, ["summary"])
    prose = re.sub(r"```.*?```|<img[^>]*>", "", readme, flags=re.DOTALL)
    assert not unknown(prose, ["summary", "readme-study"], "3.11")
