"""The example of a report finds the damage that was done, and writes its file."""

import runpy
import sys
from pathlib import Path

import pytest

pytest.importorskip("matplotlib").use("Agg")

EXAMPLE = Path(__file__).parents[2] / "examples" / "plot_owner_report.py"


def test_the_report_names_the_damaged_group(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), "--figures", str(tmp_path / "figures")])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    text = (tmp_path / "figures" / "truss_report.html").read_text(encoding="utf-8")
    assert "bottom has lost 24" in text or "bottom has lost 25" in text
    assert text.count(" has lost ") == 2  # in the answer and in its own section
    for group, severity in (("bottom", 20), ("top", 30), ("diagonal", 15)):
        assert f"{group}:</strong> damage of {severity}\xa0% or more is found reliably" in text
