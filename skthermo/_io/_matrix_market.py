"""Matrices from Matrix Market files, damaged files included.

Numbers are read by NumPy and compared with the sizes before a matrix is allocated. SciPy's reader takes a quarter of
the time, but ends the interpreter at some damaged sizes, and reads 1.0x as 1.0.
"""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._arrays import Array, Matrix
from skthermo._io._memory_limit import MemoryLimit
from skthermo._io._numbers import read_numbers

COMMENTS = re.compile(rb"^[ \t]*%.*$", re.MULTILINE)
MIRRORS = {"general": 0, "symmetric": 1, "hermitian": 1, "skew-symmetric": -1}
NUMBERS_FOR_AN_ENTRY = {"array": 1, "coordinate": 3}


class Size(NamedTuple):
    """Rows and columns, the sign of what is mirrored at the diagonal (0: nothing is), and values given."""

    n_rows: int
    n_columns: int
    mirror: int
    n_values: int


def read_matrix_market(file: Path, limit: MemoryLimit | None = None) -> Matrix:
    """The matrix of a file, dense ("array") or sparse ("coordinate").

    Raises
    ------
    ValueError
        Names the file, if it is cut off or not what its header says, or needs too much memory.
    """
    try:
        return _read(file.read_bytes(), limit or MemoryLimit(file.stat().st_size))
    except ValueError as error:
        raise ValueError(f"{file}: not readable as Matrix Market ({error})") from error


def _read(text: bytes, limit: MemoryLimit) -> Matrix:
    line, start = _data_line(text, 0, is_first=True)
    header = line.lower().split()
    if len(header) != 5 or header[:2] != ["%%matrixmarket", "matrix"]:
        raise ValueError(f"the first line is {line!r}; expected '%%MatrixMarket matrix ...'")
    layout, field, symmetry = header[2:]
    if layout not in NUMBERS_FOR_AN_ENTRY or field not in ("real", "integer", "complex") or symmetry not in MIRRORS:
        raise ValueError(
            f"the first line is {line!r}; expected array or coordinate, real or complex, general or symmetric"
        )
    is_complex, is_hermitian = field == "complex", symmetry == "hermitian"
    line, start = _data_line(text, start)
    size = _size(line, layout == "array", MIRRORS[symmetry])
    width = NUMBERS_FOR_AN_ENTRY[layout] + is_complex
    limit.take(0, 5 * len(text))
    entries = _numbers(text[start:], size.n_values, width)
    value_size = 16 if is_complex else 8
    if layout == "array":
        limit.take(value_size * size.n_rows * size.n_columns, entries.nbytes)
    else:
        n_entries = size.n_values * (2 if size.mirror else 1)
        limit.take_sparse(size.n_rows, size.n_columns, n_entries, value_size)
    values = entries[:, -2] + 1j * entries[:, -1] if is_complex else entries[:, -1]
    if layout == "array":
        return _dense(values, size, is_hermitian)
    return sparse_matrix(entries, values, size, is_hermitian)


def _data_line(text: bytes, start: int, *, is_first: bool = False) -> tuple[str, int]:
    """The beginning of the next line that is not empty or a comment, and where the line after it starts."""
    while start < len(text):
        end = text.find(b"\n", start)
        end = len(text) if end < 0 else end
        line = text[start : min(end, start + 100)].strip()
        start = end + 1
        if is_first or (line and not line.startswith(b"%")):
            return line.decode("latin-1"), start
    return "", start


def _size(line: str, is_dense: bool, mirror: int) -> Size:
    words = [int(word) for word in line.split()]
    if len(words) != (2 if is_dense else 3) or min(words) < 0 or (mirror and words[0] != words[1]):
        raise ValueError(f"the size is {words}; expected rows and columns, of a sparse matrix also entries")
    n_rows, n_columns = words[:2]
    beside = n_rows * (n_rows - 1) // 2
    dense = {0: n_rows * n_columns, 1: beside + n_rows, -1: beside}[mirror]
    return Size(n_rows, n_columns, mirror, dense if is_dense else words[2])


def _numbers(text: bytes, count: int, width: int) -> Array:
    """A table of so many rows and columns."""
    if b"%" in text:
        text = COMMENTS.sub(b"", text)
    numbers = read_numbers(text)
    if numbers.size != count * width:
        raise ValueError(f"{numbers.size} numbers; expected {count}" + (f" times {width}" if width > 1 else ""))
    return numbers.reshape(count, width)


def _dense(values: NDArray, size: Size, is_hermitian: bool) -> Matrix:
    """A dense matrix from its columns; those of a symmetric matrix begin at the diagonal, or below it if skew."""
    if not size.mirror:
        return values.reshape(size.n_columns, size.n_rows).T
    matrix = np.zeros((size.n_rows, size.n_rows), dtype=values.dtype)
    start = 0
    for column in range(size.n_rows):
        first = column if size.mirror > 0 else column + 1
        part = values[start : start + size.n_rows - first]
        matrix[column, first:] = size.mirror * (part.conj() if is_hermitian else part)
        matrix[first:, column] = part
        start += len(part)
    return matrix


def sparse_matrix(entries: Array, values: NDArray, size: Size, is_hermitian: bool) -> Matrix:
    """A sparse matrix from rows and columns (from 1) and values; a symmetric matrix has one side only."""
    shape = (size.n_rows, size.n_columns)
    places = entries[:, :2]
    within = bool(((places >= 1) & (places <= shape)).all())
    whole = places.astype(np.int64) if within else None
    if whole is None or (whole != places).any():
        raise ValueError(f"rows or columns outside 1 to {list(shape)}")
    rows, columns = whole.T - 1
    if size.mirror:
        if (rows < columns).any() and (rows > columns).any():
            raise ValueError("a symmetric matrix has entries on both sides of its diagonal; expected one")
        beside = rows != columns
        if size.mirror < 0 and not beside.all():
            raise ValueError("a skew-symmetric matrix has entries on its diagonal; expected none")
        mirrored = size.mirror * (values[beside].conj() if is_hermitian else values[beside])
        rows, columns, values = (
            np.concatenate([rows, columns[beside]]),
            np.concatenate([columns, rows[beside]]),
            np.concatenate([values, mirrored]),
        )
    return scipy.sparse.csc_array((values, (rows, columns)), shape=shape)
