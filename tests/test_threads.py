"""One BLAS thread wherever small matrices are solved, whichever Python thread it is."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import time

import joblib
import numpy as np
import scipy.linalg  # brings a BLAS of its own
from threadpoolctl import threadpool_info, threadpool_limits

from skthermo._core.parallel import map_on_blas_threads, run_jobs, single_blas_thread

def blas_threads():
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

def limited(n=0):
    with single_blas_thread():
        time.sleep(0.01 * (1 + n % 2))  # so that threads leave one after the other
        return blas_threads()

if blas_threads() == {1}:  # all that one core gets unasked
    threadpool_limits(2, "blas")
assert blas_threads() == {2}
assert limited() == {1}
assert blas_threads() == {2}
for backend in ("threading", "loky"):
    with joblib.parallel_config(backend):
        assert run_jobs((joblib.delayed(limited)(n) for n in range(20)), 20, unit="jobs", n_jobs=2) == [{1}] * 20
    assert blas_threads() == {2}
assert list(map_on_blas_threads(lambda _: blas_threads(), range(4))) == [{1}] * 4
assert blas_threads() == {2}
"""


@pytest.mark.nightly
def test_limits_hold_in_every_thread_and_are_lifted_again():
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=os.environ | {"OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"},
        capture_output=True,
        text=True,
    )
    assert not done.returncode, done.stderr
