"""Every code of a warning has its entry in the guide, and every entry there is of something that the source says."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

from skthermo.preprocessing.checks._record_findings import WARNINGS

ROOT = Path(__file__).parents[1]
SOURCE = "\n".join(path.read_text() for path in sorted((ROOT / "skthermo").rglob("*.py")))
TEMPLATES = "\n".join(path.read_text() for path in sorted((ROOT / "skthermo").rglob("*.j2")))


def entries(page):
    return re.findall(r"(?<!\w)_`(.+?)`", (ROOT / "docs" / "guide" / f"{page}.rst").read_text())


def kinds():
    """Kinds of all warnings that the source gives; None where it does not show the text."""
    for call in ast.walk(ast.parse(SOURCE)):
        match call:
            case ast.Call(func=ast.Name(id=name), args=[_, *_, kind]) if re.fullmatch(r"warn_user|\w+Warning", name):
                yield kind.value if isinstance(kind, ast.Constant) else None


def test_every_warning_has_an_entry_and_every_entry_a_warning():
    given = Counter(kinds())
    assert given.pop(None) == 1  # findings of records, whose kinds are these
    assert Counter(entries("warnings")) == Counter({*given, *WARNINGS})


@pytest.mark.parametrize("page", ["report_lines", "errors"])
def test_every_entry_is_part_of_a_sentence_of_the_source(page):
    said = re.sub(r'"\s*\n\s*[rf]*"', "", SOURCE) + " ".join(TEMPLATES.split())
    assert len(entries(page)) > 20
    assert [one for one in entries(page) if not all(part.strip() in said for part in one.split("…"))] == []
