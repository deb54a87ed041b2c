"""Files that several processes use: locks, and files that are replaced when the new one is complete."""

import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import IO, Any
from uuid import uuid4

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

UNFINISHED = ".unfinished"
PAUSE = 0.05  # seconds between two looks at a lock


@contextmanager
def alone_with(path: Path, seconds: float) -> Iterator[None]:
    """Be the only process that works on a file, which may be replaced meanwhile; wait for others so long at most.

    The lock is a file beside it, which says who holds it. What killed processes left half written is removed.
    """
    path = path.resolve()
    with open(path.with_name(f".{path.name}.lock"), "a+") as holder:
        end = time.monotonic() + seconds
        while not _has_locked(holder):
            if time.monotonic() >= end:
                holder.seek(0)
                who = holder.read().strip() or "another process"
                raise TimeoutError(f"{path} is in use by {who}; waited {seconds:g} s for it")
            time.sleep(PAUSE)
        holder.truncate(0)
        holder.write(f"process {os.getpid()} on {socket.gethostname()} since {datetime.now():%Y-%m-%d %H:%M:%S}\n")
        holder.flush()
        for left in path.parent.glob(f".*{UNFINISHED}"):
            if left.name.startswith(f".{path.name}."):
                left.unlink(missing_ok=True)
        yield


def _has_locked(file: IO) -> bool:
    """Whether a file's lock was free, and is held from now on until the file is closed; always true on Windows."""
    try:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


class ReadWhenAsked(Mapping[Any, Any]):
    """Objects by name, each read anew when it is asked for: a function for each does that."""

    def __init__(self, readers: Mapping[Any, Callable[[], Any]]):
        self._readers = readers

    def __getitem__(self, name: Any) -> Any:
        return self._readers[name]()

    def __contains__(self, name: Any) -> bool:
        return name in self._readers

    def __iter__(self) -> Iterator[Any]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)

    def __repr__(self) -> str:
        return f"<{len(self)} objects by name, read when asked for>"


def write_when_complete(path: Path, content: str | bytes) -> None:
    """Write a file beside it, and put it in its place when it is complete and on the disk; links and rights stay.

    What a killed process has left of it an hour ago or earlier is removed.
    """
    path = path.resolve()
    for left in path.parent.glob(f".*{UNFINISHED}"):
        with suppress(FileNotFoundError):  # another process has removed it
            if left.name.startswith(f".{path.name}.") and left.stat().st_mtime < time.time() - 3600:
                left.unlink()
    unfinished = path.with_name(f".{path.name}.{uuid4().hex}{UNFINISHED}")
    try:
        with open(unfinished, "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        if path.exists():
            shutil.copymode(path, unfinished)
        os.replace(unfinished, path)
        _flush_folder(path.parent)
    finally:
        unfinished.unlink(missing_ok=True)


def _flush_folder(folder: Path) -> None:
    """Make the new name of a file survive a power failure, where a folder can be opened."""
    if hasattr(os, "O_DIRECTORY"):
        opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)
