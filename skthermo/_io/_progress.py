"""A progress bar as a line of text."""

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from skthermo._arguments import check_flag

SILENT_SECONDS = 1.0
SECONDS_BETWEEN = 0.1
WIDTH = 30


Part = TypeVar("Part")
_n_open = 0  # contexts within which no bar is drawn


def with_progress(
    parts: Iterable[Part], total: int, shown: bool | None, *, count: Callable[[Part], int], unit: str = "samples"
) -> Iterator[Part]:
    """Yield the results unchanged, and show on stderr how many are done; ``count`` says how many are in a part.

    With ``shown=None`` the environment variable SKTHERMO_PROGRESS decides: 1 shows the bar, 0 does not. Unset, the bar
    appears only on a terminal, after a second, and only in the main thread of the main process: bars of several workers
    would overwrite each other, as would those of work within work.
    """
    if shown is not None:
        check_flag(shown, "progress")
    if shown is None:
        shown = {"0": False, "1": True}.get(os.environ.get("SKTHERMO_PROGRESS", ""))
    if shown is False or _n_open or (shown is None and not _on_terminal()):
        yield from parts
        return
    start = time.monotonic()
    drawn, next_time, done = False, start + (0.0 if shown else SILENT_SECONDS), 0
    try:
        for part in parts:
            done += count(part)
            now = time.monotonic()
            if now >= next_time or (drawn and done == total):
                sys.stderr.write("\r" + bar(done, total, now - start, unit))
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


def bar(done: int, total: int, seconds: float, unit: str = "samples") -> str:
    """One line: share, number, time passed and time left.

    Examples
    --------
    >>> bar(250, 1000, 60)
    ' 25 % |#######-----------------------| 250 of 1000 samples in 60 s, 180 s left   '
    """
    filled = int(WIDTH * done / total)
    left = f", {seconds * (total / done - 1):.0f} s left" if done < total else ""
    drawing = "#" * filled + "-" * (WIDTH - filled)
    return f"{100 * done // total:3d} % |{drawing}| {done} of {total} {unit} in {seconds:.0f} s{left}   "


def _on_terminal() -> bool:
    is_main = threading.current_thread() is threading.main_thread() and multiprocessing.parent_process() is None
    return is_main and sys.stderr is not None and sys.stderr.isatty()
