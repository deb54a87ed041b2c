"""Work in parts: on one BLAS thread, which small matrices and networks are fastest on, on several Python threads, or in
joblib's jobs; a bar says how much is done."""

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from contextvars import ContextVar
from functools import cache
from typing import Any, TypeVar

import numpy as np
import threadpoolctl  # installed with scikit-learn, which requires it
from joblib import Parallel

Item = TypeVar("Item")
Result = TypeVar("Result")

SILENT_SECONDS = 1.0
SECONDS_BETWEEN = 0.1
WIDTH = 30

Part = TypeVar("Part")
_n_open = 0  # contexts within which no bar is drawn
_stage = ContextVar("stage", default="")  # what an estimator is doing in this thread, which a bar names

_lock = threading.Lock()
_n_inside = 0  # open contexts
_limits: Any = None


@cache
def _controller() -> threadpoolctl.ThreadpoolController:
    return threadpoolctl.ThreadpoolController().select(user_api="blas")


@contextmanager
def _in_control() -> Iterator[None]:
    """Let this thread set limits: since threadpoolctl 3.8 only the first thread to set limits may do so."""
    openblas = getattr(threadpoolctl, "OpenBLASController", None)
    let_go = getattr(openblas, "clear_controlling_thread", lambda force: None)
    let_go(force=True)
    yield
    let_go(force=True)


@contextmanager
def single_blas_thread() -> Iterator[None]:
    """Limit every BLAS library of this process to one thread. Contexts that overlap in several Python threads are
    counted: the first to enter sets the limit, and the last to leave lifts it."""
    global _n_inside, _limits
    with _lock:
        if not _n_inside:
            with _in_control():
                _limits = _controller().limit(limits=1)
        _n_inside += 1
    try:
        yield
    finally:
        with _lock:
            _n_inside -= 1
            if not _n_inside:
                with _in_control():
                    _limits.restore_original_limits()


def map_on_blas_threads(function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
    """Map with as many Python threads as BLAS has threads, each limited to one BLAS thread.

    Limits on BLAS (``OMP_NUM_THREADS``, threadpoolctl, joblib's workers) apply to these Python threads too. Closing
    the iterator waits for the items that are running and skips the rest.
    """
    n_threads = 1
    if len(items) > 1:
        n_threads = max((library["num_threads"] for library in _controller().info()), default=1)
    with single_blas_thread():
        if n_threads < 2:
            yield from map(function, items)
        else:
            with ThreadPoolExecutor(n_threads) as pool:
                yield from pool.map(function, items)


def with_progress(
    parts: Iterable[Part], total: int, shown: bool | None, *, count: Callable[[Part], int], unit: str = "samples"
) -> Generator[Part, None, None]:
    """Yield the results unchanged, and show on stderr how many are done; ``count`` says how many are in a part.

    With ``shown=None`` the environment variable SKTHERMO_PROGRESS decides, 1 or 0. Unset, the bar appears after a
    second on a terminal or in a notebook, in the main thread of the main process.
    """
    if not isinstance(shown, bool | np.bool_ | None):
        raise ValueError(f"progress is {shown!r:.100}; expected None, True or False")
    if shown is None:
        shown = {"0": False, "1": True}.get(os.environ.get("SKTHERMO_PROGRESS", ""))
    if shown is False or _n_open or (shown is None and not _is_watched()):
        yield from parts
        return
    title = f"{_stage.get()}: " if _stage.get() else ""
    start = time.monotonic()
    drawn, next_time, done = False, start + (0.0 if shown else SILENT_SECONDS), 0
    try:
        with without_bars():
            for part in parts:
                done += count(part)
                now = time.monotonic()
                if now >= next_time or (drawn and done == total):
                    sys.stderr.write("\r" + title + bar(done, total, now - start, unit))
                    sys.stderr.flush()
                    drawn, next_time = True, now + SECONDS_BETWEEN
                yield part
    finally:
        if drawn:
            sys.stderr.write("\n")


@contextmanager
def without_bars() -> Iterator[None]:
    """Work within draws no bar: the work around it draws one, or others do the same at once."""
    global _n_open
    _n_open += 1
    try:
        yield
    finally:
        _n_open -= 1


@contextmanager
def bars_of(stage: str) -> Iterator[None]:
    """Bars within name the stage of the work."""
    before = _stage.set(stage)
    try:
        yield
    finally:
        _stage.reset(before)


def run_jobs(
    jobs: Iterable[Any], total: int, *, unit: str, count: Callable[[Any], int] = lambda _: 1, **options: Any
) -> list[Any]:
    """Results of joblib's jobs, in their order; a bar counts them as they come."""
    results = as_they_come(**options)(jobs)
    with closing(with_progress(results, total, None, count=count, unit=unit)) as shown:
        return list(shown)


def as_they_come(**options: Any) -> Parallel:
    """A joblib `Parallel` that yields results as they come, in order, where the active backend can."""
    try:
        return Parallel(return_as="generator", **options)
    except ValueError:  # some backends, such as Ray's, return all results at the end
        return Parallel(**options)


def bar(done: int, total: int, seconds: float, unit: str = "samples") -> str:
    """One line: share, number, time passed and time left.

    >>> bar(250, 1000, 60)
    ' 25 % |#######-----------------------| 250 of 1000 samples in 60 s, 180 s left   '
    """
    filled = int(WIDTH * done / total)
    left = f", {seconds * (total / done - 1):.0f} s left" if done < total else ""
    drawing = "#" * filled + "-" * (WIDTH - filled)
    return f"{100 * done // total:3d} % |{drawing}| {done} of {total} {unit} in {seconds:.0f} s{left}   "


def _is_watched() -> bool:
    """Whether stderr is a terminal or the output of a notebook's cell, and not a log."""
    is_main = threading.current_thread() is threading.main_thread() and multiprocessing.parent_process() is None
    if not is_main or sys.stderr is None:
        return False
    return sys.stderr.isatty() or type(sys.stderr).__module__.startswith("ipykernel.")
