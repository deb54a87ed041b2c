"""Numbers of the pages of accuracy and costs are in tables of ``docs/measured``, which name their commands."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS, MEASURED = ROOT / "docs", ROOT / "docs" / "measured"
PAGES = ["accuracy.rst", "accuracy_costs.rst"]
INCLUDE = re.compile(r"^\.\. include:: measured/(\w+\.rst)$", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.])-?(?:\d*\.\d+(?:e-?\d+)?|\d+(?= ?%))(?![\w]*\.?\w*[/(])")
CHOSEN = {"0.5", "1", "2.5", "3.1", "5", "7.5", "30", "40"}  # settings of the measurements, not results
WITHOUT_COMMAND = {"filled_temperatures.rst", "solvers.rst"}  # measured once
NO_PROSE = re.compile(r"``[^`]+``|:[\w:]+:`[^`]*`|^\.\. .*$|`[^`]*`_+", re.MULTILINE)


@pytest.fixture(scope="module")
def parts():
    spec = importlib.util.spec_from_file_location("release", ROOT / "tests" / "benchmarks" / "release.py")
    release = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(release)
    return release.PARTS


def numbers(text, pattern=NUMBER):
    """Numbers with a decimal point or a percent sign, as text; ".5" is "0.5"."""
    return {number.lstrip("-") if number[0] != "." else f"0{number}" for number in re.findall(pattern, text)}


@pytest.mark.parametrize("page", PAGES)
def test_a_page_types_no_table(page):
    text = (DOCS / page).read_text()
    assert INCLUDE.search(text)
    assert not re.findall(r"^ *(?:\.\. (?:list-|csv-)?table::|=+ +=)", text, re.MULTILINE)


@pytest.mark.parametrize("page", PAGES)
def test_numbers_of_the_prose_are_in_the_tables(page):
    text = (DOCS / page).read_text()
    tables = "\n".join((MEASURED / name).read_text() for name in INCLUDE.findall(text))
    prose = re.sub(r"\s+", " ", NO_PROSE.sub(" ", text))
    unknown = numbers(prose) - numbers(tables, r"\d*\.\d+(?:e-?\d+)?|\d+") - CHOSEN
    places = [re.findall(rf".{{0,50}}\b{re.escape(number.lstrip('0'))}.{{0,20}}", prose)[:2] for number in unknown]
    assert not unknown, dict(zip(unknown, places, strict=True))


def test_numbers_of_the_home_pages_cards_are_in_the_summary():
    cards = (
        (DOCS / "index.rst").read_text().partition(":class-container: measured")[2].partition(":class-container:")[0]
    )
    assert numbers(cards)
    assert numbers(cards) <= numbers((MEASURED / "summary.rst").read_text())


@pytest.mark.parametrize("table", sorted(MEASURED.glob("*.rst")), ids=lambda path: path.stem)
def test_a_table_names_its_commands(table, parts):
    known = {part.command for part in parts.values()}
    named = re.findall(r"``(python (?:tests|examples)/[^`]*)``", table.read_text())
    assert named or table.name in WITHOUT_COMMAND
    assert set(named) <= known
    assert any(table.name in INCLUDE.findall((DOCS / page).read_text()) for page in PAGES)
