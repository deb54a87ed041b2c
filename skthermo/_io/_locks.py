"""Files that one process at a time may use."""

from typing import IO

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]


def lock(file: IO) -> None:
    """Wait for a file and hold it until it is closed; the system closes it when its process ends."""
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX)
