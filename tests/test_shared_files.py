"""Files that several processes use are always whole, and one process at a time works on them."""

import os
import subprocess
import sys

import pytest

from skthermo._core.files import ReadWhenAsked, alone_with, write_when_complete

HOLDER = """
import sys
from pathlib import Path
from skthermo._core.files import alone_with
with alone_with(Path(sys.argv[1]), 0):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """A process that holds the lock of a file until it is killed."""
    pytest.importorskip("fcntl")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path / "state")], **pipes) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_an_older_file_stays_until_the_new_one_is_complete(tmp_path, monkeypatch):
    path = tmp_path / "a.html"
    path.write_text("older")

    def fails(*args):
        raise OSError("the disk is full")

    with monkeypatch.context() as patched:
        patched.setattr("os.replace", fails)
        with pytest.raises(OSError, match="disk is full"):
            write_when_complete(path, "newer")
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]
    write_when_complete(path, "newer")
    assert path.read_text() == "newer"
    assert list(tmp_path.iterdir()) == [path]


def test_links_and_rights_stay(tmp_path):
    path, link = tmp_path / "state", tmp_path / "link"
    path.write_bytes(b"older")
    path.chmod(0o640)
    link.symlink_to(path)
    write_when_complete(link, b"newer")
    assert link.is_symlink()
    assert path.read_bytes() == b"newer"
    assert path.stat().st_mode & 0o777 == 0o640


def test_who_holds_a_file_is_named(tmp_path, holder):
    path = tmp_path / "state"
    expected = rf"state is in use by process {holder.pid} on .* since \d.*; waited 0.1 s"
    with pytest.raises(TimeoutError, match=expected), alone_with(path, 0.1):
        pass


def test_a_killed_process_leaves_nothing_behind(tmp_path, holder):
    path = tmp_path / "state"
    for name in (".state.1.unfinished", ".state2.1.unfinished"):
        (tmp_path / name).touch()
    holder.kill()
    with alone_with(path, 5):
        left = {file.name for file in tmp_path.iterdir()}
        assert (tmp_path / ".state.lock").read_text().startswith(f"process {os.getpid()} on ")
    assert left == {".state.lock", ".state2.1.unfinished"}


def test_a_link_and_its_file_have_one_lock(tmp_path, holder):
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "state")
    with pytest.raises(TimeoutError, match="is in use"), alone_with(link, 0):
        pass


def test_names_of_objects_are_known_without_reading_them():
    read = []
    objects = ReadWhenAsked({"a": lambda: read.append("a")})
    assert "a" in objects
    assert "b" not in objects
    assert not read
