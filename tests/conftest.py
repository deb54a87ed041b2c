"""One BLAS thread for each worker of the tests, which share the machine's cores; figures without a screen; little time
for the garbage collector."""

import gc
import os
import sys

import pytest

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

os.environ.setdefault("MPLBACKEND", "Agg")
gc.set_threshold(10_000)  # by default 700: a fifth of the time in which tests are collected


def pytest_collection_finish(session):
    """What modules hold stays until the end: the garbage collector need not look through it."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def in_process(request, monkeypatch):
    """Files are read in this process, as in a frozen program, which saves half a second for each."""
    if getattr(request, "param", True):
        monkeypatch.setattr(sys, "frozen", True, raising=False)
