"""Solved samples on disk, which outlive the process that solved them."""

import json
import warnings
import zlib
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skthermo._locks import lock

Array = NDArray[np.float64]


class SolvedSamples:
    """A file of one header line and records of one size, to which several processes may append.

    A record holds theta, the frequencies and a checksum of both. What was cut off at the end of the file
    is no record, and the next one is written over it.

    Parameters
    ----------
    path : str or path-like
        The file; it and its folder are made when the first sample is solved.
    parameter_names : sequence of str
        Columns of theta.
    n_modes : int
        Columns of the frequencies.
    """

    def __init__(self, path: str | PathLike, parameter_names: Sequence[str], n_modes: int):
        self.path = Path(path).absolute()
        self._describes = {"parameter_names": list(parameter_names), "n_modes": int(n_modes)}
        self._header = json.dumps({"skthermo": "solved samples 1"} | self._describes).encode() + b"\n"
        sizes = {"theta": len(parameter_names), "frequencies": n_modes}
        self._record = np.dtype([*((name, "<f8", size) for name, size in sizes.items()), ("checksum", "<u4")])

    def read(self) -> dict[bytes, Array]:
        """Frequencies by the bytes of their theta.

        Raises
        ------
        ValueError
            If the file was written for other parameters or modes, or is something else.
        """
        content = self.path.read_bytes() if self.path.exists() else b""
        if not self._is_begun(content):
            return {}
        count = (len(content) - len(self._header)) // self._record.itemsize
        records = np.frombuffer(content, self._record, count, len(self._header))
        whole = records["checksum"] == self._checksums(records)
        if not whole.all():
            warnings.warn(
                f"{self.path}: {count - whole.sum()} of {count} records are damaged and left out, to be solved again",
                stacklevel=3,
            )
        return {record["theta"].tobytes(): record["frequencies"] for record in records[whole]}

    def append(self, theta: Array, frequencies: Array) -> None:
        """Write rows behind the last whole record, as the only process that does so."""
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

    def _is_begun(self, content: bytes) -> bool:
        """Whether the header is there; what is another's is refused."""
        if content.startswith(self._header):
            return True
        if self._header.startswith(content):
            return False
        try:
            found = json.loads(content.partition(b"\n")[0])
            got = str({name: found[name] for name in self._describes})
        except (ValueError, KeyError, TypeError):
            got = "something that is no cache of solved samples"
        raise ValueError(f"{self.path}: the file holds {got}; expected {self._describes}, or a path of its own")

    def _checksums(self, records: NDArray) -> list[int]:
        return [zlib.crc32(record.tobytes()[:-4]) for record in records]
