"""Long simulations say how far they are, and end when they are interrupted."""

import io
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import joblib
import numpy as np
import pytest

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, CallableModel, evaluate, sample

TRUSS = make_truss()


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_bar_on_request_counts_every_sample(capsys):
    drawn = sample(TRUSS, 0.2, 600, progress=True, random_state=0)
    lines = capsys.readouterr().err.split("\r")
    assert lines[-1].startswith("100 % |##############################| 600 of 600 samples in ")
    assert lines[-1].endswith("\n")
    counts = [int(count) for count in re.findall(r"(\d+) of 600", "".join(lines))]
    assert counts == sorted(counts)
    np.testing.assert_array_equal(drawn.frequencies, sample(TRUSS, 0.2, 600, random_state=0).frequencies)


class Notebook(io.StringIO):
    __module__ = "ipykernel.iostream"


@pytest.mark.nightly
def test_only_a_terminal_or_a_notebook_sees_a_bar_unasked_and_only_after_a_second(monkeypatch):
    slow = CallableModel(slow_square_root, ["E"], 1)
    for stderr, model, progress, seen in (
        (io.StringIO(), slow, None, False),
        (Terminal(), slow, None, True),
        (Notebook(), slow, None, True),
        (Terminal(), slow, False, False),
        (Terminal(), TRUSS, None, False),
    ):
        monkeypatch.setattr(sys, "stderr", stderr)
        sample(model, 0.2, 64, progress=progress, random_state=0)
        lines = [line for line in stderr.getvalue().split("\r") if line]
        assert bool(lines) == seen
        assert all(" of 64 samples in " in line for line in lines)


def slow_square_root(row):
    time.sleep(0.025)
    return np.sqrt(row)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # of multiprocessing, from Python 3.12 on
@pytest.mark.parametrize("backend", ["loky", "threading", "multiprocessing"])
def test_every_backend_gives_the_same_bits(backend):
    """That of multiprocessing, of which Ray's is made, cannot give results as they come."""
    expected = sample(TRUSS, 0.2, 600, random_state=0).frequencies
    with joblib.parallel_config(backend, n_jobs=2):
        np.testing.assert_array_equal(sample(TRUSS, 0.2, 600, random_state=0).frequencies, expected)


BUCKLES = AffineModel({("k",): np.eye(3), ("force",): -0.5 * np.eye(3)}, np.eye(3), n_modes=2)
REDUCED = TRUSS.reduced(0.1, random_state=0)


@pytest.mark.parametrize("n_jobs", [1, 2])
@pytest.mark.parametrize(
    ("model", "bounds", "warning"),
    [(BUCKLES, [[0.1, 1.0], [0.9, 1.1]], "no-solution"), (REDUCED, 0.2, "outside-bounds")],
)
def test_what_many_chunks_say_is_one_warning(model, bounds, warning, n_jobs):
    with pytest.warns(UserWarning, match=warning) as caught:
        drawn = sample(model, bounds, 2 * model.rows_per_chunk, n_jobs=n_jobs, random_state=0)
    is_missing = np.isnan(drawn.frequencies).any(axis=1)
    assert (0 < is_missing.sum() < len(is_missing)) == (model is BUCKLES)
    assert len(caught) == 1
    assert caught[0].filename == __file__


ENDLESS = """
import os, signal, sys, time
from pathlib import Path
from skthermo.fem import CallableModel, sample

def endless(row):
    Path(sys.argv[1], str(os.getpid())).touch()
    time.sleep(3600)

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background may inherit deafness
    Path(sys.argv[1], "me").write_text(str(os.getpid()))
    sample(CallableModel(endless, ["E"], 1), 0.2, 1000, n_jobs=2, progress=True, random_state=0)
"""


def processes_of(session):
    """Processes of a session that still run, by their files in /proc."""
    running = []
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, its_session = file.read_text().rsplit(")", 1)[1].split()[:4]
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(its_session) == session and state != "Z":
            running.append(int(file.parent.name))
    return running


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


@pytest.mark.nightly
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to look for processes")
@pytest.mark.parametrize("everyone", [False, True], ids=["the process", "Ctrl-C reaches the workers too"])
def test_an_interrupt_ends_the_work_and_leaves_no_process(tmp_path, everyone):
    script = tmp_path / "endless.py"
    script.write_text(ENDLESS)
    working = tmp_path / "working"
    working.mkdir()
    process = subprocess.Popen(
        [sys.executable, str(script), str(working)], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        assert until(lambda: len(list(working.iterdir())) == 3), process.stderr.read()
        assert len(processes_of(process.pid)) >= 3
        (os.killpg if everyone else os.kill)(process.pid, signal.SIGINT)
        assert "KeyboardInterrupt" in process.communicate(timeout=60)[1]
        assert process.returncode
        assert until(lambda: not processes_of(process.pid)), processes_of(process.pid)
    finally:
        for left in processes_of(process.pid):
            os.kill(left, signal.SIGKILL)


def test_an_error_in_a_worker_comes_through():
    with pytest.raises(RuntimeError, match="the program failed at 1"):
        sample(CallableModel(_broken, ["E"], 1), 0.2, 100, n_jobs=2, random_state=0)


def _broken(row):
    raise RuntimeError(f"the program failed at {row[0]:.0f}")


@pytest.mark.parametrize(("setting", "shown"), [("1", True), ("0", False)])
def test_one_setting_shows_or_hides_every_bar(setting, shown, monkeypatch, capsys):
    monkeypatch.setenv("SKTHERMO_PROGRESS", setting)
    evaluate(TRUSS, np.ones((600, 4)))
    assert ("600 of 600 samples" in capsys.readouterr().err) is shown
    evaluate(TRUSS, np.ones((600, 4)), progress=not shown)
    assert ("600 of 600 samples" in capsys.readouterr().err) is not shown
