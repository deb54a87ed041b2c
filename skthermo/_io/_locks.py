"""File locks between processes."""

from typing import IO

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]


def lock(file: IO) -> None:
    """Wait until no other process holds a file's lock, then hold it until the file is closed."""
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX)
