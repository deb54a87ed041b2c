"""A file of solved samples, shared with other and later processes."""

import json
import os
import warnings
import zlib
from collections.abc import Mapping, Sequence
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from skthermo._arguments import check_path
from skthermo._arrays import Array
from skthermo._io import lock


class SampleCache:
    """A file of one header line and records of equal size, to which several processes may append.

    A record holds theta, the frequencies and a checksum of both. A record that was cut off at the end of the file is
    ignored, and the next one is written over it.

    Parameters
    ----------
    path : str or path-like
        The file. The file and its folder are created when the first sample is solved.
    parameter_names : sequence of str
        Columns of theta.
    n_modes : int
        Columns of the frequencies.
    """

    def __init__(self, path: str | PathLike, parameter_names: Sequence[str], n_modes: int):
        self.path = check_path(path, "cache").absolute()
        self._describes = {"parameter_names": list(parameter_names), "n_modes": int(n_modes)}
        self._header = json.dumps({"skthermo": "solved samples 1"} | self._describes).encode() + b"\n"
        sizes = {"theta": len(parameter_names), "frequencies": n_modes}
        self._record = np.dtype([*((name, "<f8", size) for name, size in sizes.items()), ("checksum", "<u4")])
        self._known: dict[bytes, Array] = {}
        self._damaged: list[int] = []
        self._inode, self._end = 0, 0

    def read(self) -> Mapping[bytes, Array]:
        """Frequencies, keyed by the bytes of their theta. Reads only what was appended since the last call."""
        if self.path.is_dir():
            raise ValueError(f"{self.path}: the cache is a folder; expected a file, such as {self.path / 'solved'}")
        if not self.path.exists():
            self._forget()
            return self._known
        with open(self.path, "rb") as file:
            state = os.fstat(file.fileno())
            if state.st_ino != self._inode or state.st_size < self._end:
                self._forget(state.st_ino)
            if not self._is_begun(file.read(len(self._header))):
                return self._known
            file.seek(max(self._end, len(self._header)))
            content = file.read()
        records = np.frombuffer(content, self._record, len(content) // self._record.itemsize)
        whole = records["checksum"] == self._checksums(records)
        if not whole.all():
            warnings.warn(
                f"{self.path}: {len(whole) - whole.sum()} of {len(whole)} records are damaged and left out, to be "
                "solved again",
                stacklevel=3,
            )
        start = max(self._end, len(self._header))
        self._damaged += (start + np.flatnonzero(~whole) * self._record.itemsize).tolist()
        self._known |= {record["theta"].tobytes(): record["frequencies"] for record in records[whole]}
        self._end = start + records.nbytes
        return self._known

    def _forget(self, inode: int = 0) -> None:
        self._known, self._damaged, self._inode, self._end = {}, [], inode, 0

    def __getstate__(self) -> dict:
        """State for pickling, without the records: workers read the file themselves."""
        return vars(self) | {"_known": {}, "_damaged": [], "_inode": 0, "_end": 0}

    def append(self, theta: Array, frequencies: Array) -> None:
        """Write rows after the last complete record; other processes wait meanwhile."""
        records = np.zeros(len(theta), self._record)
        records["theta"], records["frequencies"] = theta, frequencies
        records["checksum"] = self._checksums(records)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with open(self.path, "a+b") as file:
            lock(file)
            file.seek(0)
            if self._is_begun(file.read(len(self._header))):
                size = file.seek(0, 2)
                file.truncate(size - (size - len(self._header)) % self._record.itemsize)
            else:
                file.truncate(0)
                file.write(self._header)
            file.write(records.tobytes())
        if self._damaged and len(records):
            self._mend(records[:1].tobytes())

    def _mend(self, record: bytes) -> None:
        """Overwrite each damaged record with a copy of a good one, so that all others keep their place."""
        with open(self.path, "r+b") as file:
            lock(file)
            for position in self._damaged:
                file.seek(position)
                content = file.read(len(record))
                found = np.frombuffer(content, self._record, len(content) // len(record))
                if (found["checksum"] != self._checksums(found)).any():
                    file.seek(position)
                    file.write(record)
        self._damaged = []

    def _is_begun(self, content: bytes) -> bool:
        """Whether the header is there; the header of another file is an error."""
        if content.startswith(self._header):
            return True
        if self._header.startswith(content):
            return False
        try:
            found = json.loads(content.partition(b"\n")[0])
            got = str({name: found[name] for name in self._describes})
        except (ValueError, KeyError, TypeError):
            got = "something that is not a cache of solved samples"
        raise ValueError(f"{self.path}: the file holds {got}; expected {self._describes}, or a path of its own")

    def _checksums(self, records: NDArray) -> list[int]:
        return [zlib.crc32(record.tobytes()[:-4]) for record in records]
