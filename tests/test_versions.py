"""Benchmarks beside another version of the package."""

import sys
from pathlib import Path

import pandas as pd
import pytest

from tests.benchmarks import versions

SCRIPT = """
import sys
print(sys.argv[1:])
if {fails}:
    raise ValueError("no such parameter")
sys.exit(1)  # a target is missed
"""


def test_columns_of_two_versions_stand_side_by_side():
    now = pd.DataFrame({"found": ["1.5", "2.5"], "seconds": ["3", "4"]}, ["a", "b"])
    before = pd.DataFrame({"found": ["1.0", "9.0"], "lost": ["7", "8"]}, ["a", "c"])
    both = versions.side_by_side(now, before, "43ba4fa4")
    assert list(both) == ["found", "found 43ba4fa4", "seconds", "lost 43ba4fa4"]
    assert both.loc["a"].tolist() == ["1.5", "1.0", "3", "7"]
    assert both.loc["b"].tolist() == ["2.5", "", "4", ""]
    assert both.loc["c"].tolist() == ["", "9.0", "", "8"]


@pytest.mark.parametrize("present_fails", [False, True])
def test_a_script_that_fails_with_another_version_is_run_as_it_was_then(present_fails, tmp_path, monkeypatch):
    now, then = tmp_path / "now", tmp_path / "then"
    for folder, fails in ((now, present_fails), (then, False)):
        folder.mkdir()
        (folder / "speed.py").write_text(SCRIPT.format(fails=fails) + f"# {folder.name}\n")
    monkeypatch.setattr(versions, "ROOT", now.resolve())
    version = versions.OtherVersion("43ba4fa4", Path(sys.prefix), then.resolve())
    done = version.run(now / "speed.py", ["--seeds", "2"])
    assert (done.returncode, done.stdout.strip()) == (1, "['--seeds', '2']")
    assert not versions.has_failed(done)
    assert Path(done.args[1]).parent.name == ("then" if present_fails else "now")
