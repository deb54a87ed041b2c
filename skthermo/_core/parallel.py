"""Work in parts: on one BLAS thread, which small matrices and networks are fastest on, in joblib's jobs, with a bar."""

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from functools import cache
from typing import Any, TypeVar

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from threadpoolctl import ThreadpoolController  # installed with scikit-learn, which requires it

from skthermo._core.arrays import check_flag

Item = TypeVar("Item")
Result = TypeVar("Result")


@cache
def _blas() -> ThreadpoolController:
    """BLAS libraries of this process; finding them takes milliseconds."""
    return ThreadpoolController().select(user_api="blas")


def single_blas_thread() -> AbstractContextManager[Any]:
    """Limit every BLAS library of this process to one thread.

    The thread that starts others enters it around their work: threadpoolctl takes limits from the first thread alone,
    and threads that overlap would lift their limits in the wrong order.
    """
    return _blas().limit(limits=1)


def n_blas_threads() -> int:
    """Number of threads that BLAS takes now."""
    return max((library["num_threads"] for library in _blas().info()), default=1)


def map_on_blas_threads(function: Callable[[Item], Result], items: Sequence[Item]) -> Generator[Result, None, None]:
    """Map with as many Python threads as BLAS has threads, each limited to one BLAS thread.

    Limits on BLAS (``OMP_NUM_THREADS``, threadpoolctl, joblib's workers) apply to these Python threads too. Closing
    the iterator waits for the items that are running and skips the rest.
    """
    n_threads = n_blas_threads() if len(items) > 1 else 1
    with single_blas_thread():
        if n_threads < 2:
            yield from map(function, items)
        else:
            threads = Parallel(n_threads, require="sharedmem", return_as="generator")
            yield from threads(delayed(function)(item) for item in items)


def run_jobs(jobs: Iterable[Any], total: int, *, unit: str, **options: Any) -> list[Any]:
    """Results of joblib's jobs, in their order; a bar counts them as they come."""
    with closing(as_they_come(jobs, **options)) as results:
        return list(with_progress(results, total, None, count=lambda _: 1, unit=unit))


def as_they_come(jobs: Iterable[Any], *, n_jobs: int | None = None, **options: Any) -> Generator[Any, None, None]:
    """Results of joblib's jobs in order, as they come where the backend can; jobs side by side share the cores."""
    with single_blas_thread() if effective_n_jobs(n_jobs) > 1 else nullcontext():
        try:
            parallel = Parallel(n_jobs, return_as="generator", **options)
        except ValueError:  # some backends, such as Ray's, return all results at the end
            parallel = Parallel(n_jobs, **options)
        yield from parallel(jobs)


def with_progress(
    parts: Iterable[Item], total: int, shown: bool | None, *, count: Callable[[Item], int], unit: str = "samples"
) -> Iterator[Item]:
    """Yield the results unchanged, and show on stderr how many are done; ``count`` says how many are in a part.

    With ``shown=None`` the environment variable SKTHERMO_PROGRESS decides, 1 or 0. Unset, the bar appears after a
    second on a terminal or in a notebook, in the main thread of the main process.
    """
    if shown is None:
        shown = {"0": False, "1": True}.get(os.environ.get("SKTHERMO_PROGRESS", ""))
    is_asked = shown is not None and check_flag(shown, "progress")
    silence = 0.0 if is_asked else 1.0 if shown is None and _is_watched() else np.inf
    start, next_time, done = time.monotonic(), silence, 0
    try:
        for part in parts:
            done += count(part)
            seconds = time.monotonic() - start
            if seconds >= next_time or (next_time > silence and done == total):
                sys.stderr.write("\r" + bar(done, total, seconds, unit))
                sys.stderr.flush()
                next_time = seconds + 0.1
            yield part
    finally:
        if next_time > silence:
            sys.stderr.write("\n")


def bar(done: int, total: int, seconds: float, unit: str = "samples", *, width: int = 30) -> str:
    """One line: share, number, time passed and time left.

    >>> bar(250, 1000, 60)
    ' 25 % |#######-----------------------| 250 of 1000 samples in 60 s, 180 s left   '
    """
    filled = int(width * done / total)
    left = f", {seconds * (total / done - 1):.0f} s left" if done < total else ""
    drawing = "#" * filled + "-" * (width - filled)
    return f"{100 * done // total:3d} % |{drawing}| {done} of {total} {unit} in {seconds:.0f} s{left}   "


def _is_watched() -> bool:
    """Whether stderr is a terminal or the output of a notebook's cell, and not a log."""
    is_main = threading.current_thread() is threading.main_thread() and multiprocessing.parent_process() is None
    if not is_main or sys.stderr is None:
        return False
    return sys.stderr.isatty() or type(sys.stderr).__module__.startswith("ipykernel.")
