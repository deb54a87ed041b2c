"""A progress bar as a line of text."""

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Iterable, Iterator

from numpy.typing import NDArray

from skthermo._arguments import check_flag

SILENT_SECONDS = 1.0
SECONDS_BETWEEN = 0.1
WIDTH = 30


def with_progress(
    parts: Iterable[tuple[NDArray, ...]], n_rows: int, shown: bool | None
) -> Iterator[tuple[NDArray, ...]]:
    """Yield the results unchanged, and show on stderr how many of their rows are done.

    With ``shown=None`` the environment variable SKTHERMO_PROGRESS decides: 1 shows the bar, 0 does not. Unset, the bar
    appears only on a terminal, after a second, and only in the main thread of the main process: bars of several workers
    would overwrite each other.
    """
    if shown is not None:
        check_flag(shown, "progress")
    if shown is None:
        shown = {"0": False, "1": True}.get(os.environ.get("SKTHERMO_PROGRESS", ""))
    if shown is False or (shown is None and not _on_terminal()):
        yield from parts
        return
    start = time.monotonic()
    drawn, next_time, done = False, start + (0.0 if shown else SILENT_SECONDS), 0
    try:
        for part in parts:
            done += len(part[0])
            now = time.monotonic()
            if now >= next_time or (drawn and done == n_rows):
                sys.stderr.write("\r" + bar(done, n_rows, now - start))
                sys.stderr.flush()
                drawn, next_time = True, now + SECONDS_BETWEEN
            yield part
    finally:
        if drawn:
            sys.stderr.write("\n")


def bar(done: int, total: int, seconds: float) -> str:
    """One line: share, rows, time passed and time left.

    Examples
    --------
    >>> bar(250, 1000, 60)
    ' 25 % |#######-----------------------| 250 of 1000 samples in 60 s, 180 s left   '
    """
    filled = int(WIDTH * done / total)
    left = f", {seconds * (total / done - 1):.0f} s left" if done < total else ""
    drawing = "#" * filled + "-" * (WIDTH - filled)
    return f"{100 * done // total:3d} % |{drawing}| {done} of {total} samples in {seconds:.0f} s{left}   "


def _on_terminal() -> bool:
    is_main = threading.current_thread() is threading.main_thread() and multiprocessing.parent_process() is None
    return is_main and sys.stderr is not None and sys.stderr.isatty()
