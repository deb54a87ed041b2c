"""Every code of a warning has its entry in the guide, and every entry there is of something that the source says."""

import re
from collections import Counter
from pathlib import Path

from tests.source import kinds_of_warnings, trees

ROOT = Path(__file__).parents[1]
SOURCE = "\n".join(path.read_text() for path in sorted((ROOT / "skthermo").rglob("*.py")))
TEMPLATES = "\n".join(path.read_text() for path in sorted((ROOT / "skthermo").rglob("*.j2")))


def entries(page):
    return re.findall(r"(?<!\w)_`(.+?)`", (ROOT / "docs" / "guide" / f"{page}.rst").read_text())


def test_every_warning_has_an_entry_and_every_entry_a_warning():
    files = trees(ROOT / "skthermo").values()
    given = {(kind, category) for tree in files for _, kind, category in kinds_of_warnings(tree)}
    listed, kinds = entries("warnings"), {kind for kind, _ in given}
    remedy = "docs/guide/warnings.rst: one entry for each kind of warning, and none for others:"
    assert Counter(listed) == Counter(kinds), f"{remedy} {sorted({*listed} ^ kinds) or 'one stands there twice'}"
    of_category = Counter(kind for kind, category in given if category)
    twice = {kind for kind, times in of_category.items() if times > 1}
    assert not twice, f"one category for each kind of warning: {twice}"


def test_every_entry_is_part_of_a_sentence_of_the_source():
    said = re.sub(r'"\s*\n\s*[rf]*"', "", SOURCE) + " ".join(TEMPLATES.split())
    assert len(entries("errors")) > 20
    unsaid = [one for one in entries("errors") if not all(part.strip() in said for part in one.split("…"))]
    assert not unsaid, "\n".join(["docs/guide/errors.rst: quote what the source says now, in place of:", *unsaid])
