"""The example of a report finds the damage that was done, and writes its file."""

import re

import pytest

from tests.examples.pages import run

pytestmark = pytest.mark.nightly


def test_the_report_names_the_damaged_group(tmp_path):
    run("owner_report", "--figures", tmp_path / "figures")
    text = (tmp_path / "figures" / "truss_report.html").read_text(encoding="utf-8")
    found = re.search(r"loss of (\d+)\s% of stiffness in bottom", text)
    assert abs(float(found[1]) - 25) <= 1
    for group, severity in (("bottom", 20), ("top", 30), ("diagonal", 15)):
        assert int(re.search(rf"<strong>{group}:</strong>[^<]*?(\d+)\xa0%", text)[1]) == severity
