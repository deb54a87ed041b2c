"""Every code of a warning has its entry in the guide, and every entry there is of something that the source says."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

from tests.source import kinds_of_warnings

ROOT = Path(__file__).parents[1]
SOURCE = "\n".join(path.read_text() for path in sorted((ROOT / "skthermo").rglob("*.py")))
TEMPLATES = "\n".join(path.read_text() for path in sorted((ROOT / "skthermo").rglob("*.j2")))


def entries(page):
    return re.findall(r"(?<!\w)_`(.+?)`", (ROOT / "docs" / "guide" / f"{page}.rst").read_text())


def kinds_of_findings(tree):
    """Kinds of what is found in records: keys of the mapping to the texts of their warnings."""
    for node in ast.walk(tree):
        match node:
            case ast.Assign(targets=[ast.Name(id="WARNINGS")], value=ast.Dict(keys=keys)):
                yield from (key.value for key in keys)


def test_every_warning_has_an_entry_and_every_entry_a_warning():
    tree = ast.parse(SOURCE)
    given, findings = Counter(kinds_of_warnings(tree)), [*kinds_of_findings(tree)]
    assert given.pop(None) == 1  # findings of records
    assert findings
    assert Counter(entries("warnings")) == Counter({*given, *findings})


@pytest.mark.parametrize("page", ["report_lines", "errors"])
def test_every_entry_is_part_of_a_sentence_of_the_source(page):
    said = re.sub(r'"\s*\n\s*[rf]*"', "", SOURCE) + " ".join(TEMPLATES.split())
    assert len(entries(page)) > 20
    assert [one for one in entries(page) if not all(part.strip() in said for part in one.split("…"))] == []
