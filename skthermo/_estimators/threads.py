"""Limits BLAS to one thread for small matrices and small networks, which more threads would slow down."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any, TypeVar

import threadpoolctl  # installed with scikit-learn, which requires it

Item = TypeVar("Item")
Result = TypeVar("Result")

_lock = Lock()
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
