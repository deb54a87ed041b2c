"""What users of 0.2.0 can name stays, or CHANGELOG.md says what has become of it.

``inventory.csv`` has all items of 0.2.0. ``status`` is stays, goes or renamed; ``now`` is the new name of what is
renamed; ``changelog`` is a piece of the line of CHANGELOG.md, in the section of 0.3, that tells users. Items that go
may still be there.
"""

import csv
import re
from pathlib import Path

import pytest

from tests.contract.inventory import inventory

CHANGELOG = Path(__file__).parents[2] / "CHANGELOG.md"


@pytest.fixture(scope="module")
def marked():
    with open(Path(__file__).with_name("inventory.csv"), encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_nothing_is_missing_without_a_word(marked):
    present = set(inventory())
    missing = [row["item"] for row in marked if row["status"] == "stays" and row["item"] not in present]
    lost = [row["now"] for row in marked if row["now"] and not {row["item"], row["now"]} & present]
    assert not missing, f"mark them in inventory.csv, with their line of CHANGELOG.md: {missing}"
    assert not lost, f"neither the old nor the new name is there: {lost}"


def test_each_change_is_in_the_changelog(marked):
    section = re.search(r"^## 0\.3.*?(?=^## 0\.2)", CHANGELOG.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)[0]
    changed = [row for row in marked if row["status"] != "stays"]
    untold = [row["item"] for row in changed if not row["changelog"] or row["changelog"] not in section]
    assert not untold
    assert {row["status"] for row in changed} == {"goes", "renamed"}
    assert all((row["status"] == "renamed") == bool(row["now"]) for row in marked)


def test_the_inventory_of_0_2_0_is_whole(marked):
    assert len({row["item"] for row in marked}) == len(marked) == 2571
