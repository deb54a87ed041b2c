"""Symmetric matrices written as text, one line of row, column and value for each entry of a half."""

import re
from pathlib import Path

import scipy.sparse

from skthermo._io._matrix_market import Size, sparse_matrix
from skthermo._io._memory_limit import MemoryLimit
from skthermo._io._numbers import read_numbers

HALF_SUFFIXES = (".sti", ".mas", ".txk", ".txm")
"""Stiffness and mass as CalculiX and as SAP2000 write them."""

HEADING = re.compile(rb"\A(?:[ \t]*(?![ \t\d]).*(?:\n|\Z))*")


def read_half(file: Path, limit: MemoryLimit | None = None) -> scipy.sparse.csc_array:
    """The whole matrix of a file that holds its diagonal and the entries on one side of it.

    Lines at the beginning that do not start with a digit are a heading.

    Raises
    ------
    ValueError
        Names the file, if it is cut off or something else, or needs too much memory.
    """
    try:
        return _read(file.read_bytes(), limit or MemoryLimit(file.stat().st_size))
    except ValueError as error:
        raise ValueError(f"{file}: not readable as lines of row, column and value ({error})") from error


def _read(text: bytes, limit: MemoryLimit) -> scipy.sparse.csc_array:
    text = HEADING.sub(b"", text, count=1)
    n_lines = sum(bool(line.strip()) for line in text.splitlines())
    limit.take(0, 5 * len(text))
    numbers = read_numbers(text)
    if numbers.size != 3 * n_lines or not n_lines:
        raise ValueError(f"{numbers.size} numbers in {n_lines} lines; expected three in each")
    entries = numbers.reshape(n_lines, 3)
    largest = entries[:, :2].max()
    n_rows = int(largest) if 1 <= largest < 2**31 else 0
    limit.take_sparse(n_rows, n_rows, 2 * n_lines)
    return sparse_matrix(entries, entries[:, 2], Size(n_rows, n_rows, 1, n_lines), False)
