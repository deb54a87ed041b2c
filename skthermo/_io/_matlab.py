"""Matrices from MATLAB v5 files, damaged files included.

SciPy's reader follows the lengths that a file states; where these are damaged it can end the
interpreter, or ask for gigabytes. Here every length is checked against the bytes that are there.
"""

import math
import struct
import zlib
from collections import deque
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._arrays import Matrix
from skthermo._io._memory_limit import MemoryLimit

Part = tuple[int, memoryview]

HEADER = 128
MATRIX, COMPRESSED = 14, 15
STORED_AS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
SPARSE_CLASS, OBJECT_CLASS = 5, 17
NUMERIC_CLASSES = range(6, 16)
COMPLEX = 0x0800
MAX_PARTS = 7  # of a sparse complex matrix
NAME_WITHIN = 1024  # bytes of a variable's beginning, its name included
PIECE = 16384  # bytes that are decompressed at a time, to at most a thousand times as many


def read_matlab(file: Path, *, complex_too: bool = False, limit: MemoryLimit | None = None) -> dict[str, Matrix | None]:
    """Every variable of a MATLAB v5 file; None for what is not a real matrix, full or sparse.

    Raises
    ------
    ValueError
        Names the file and the variable, if it is not a MATLAB v5 file, or cut off or inconsistent anywhere, or
        would need too much memory.
    """
    limit = limit or MemoryLimit(file.stat().st_size)
    content = memoryview(file.read_bytes())
    if content[:10] == b"MATLAB 7.3":
        raise ValueError(f"{file}: a MATLAB v7.3 file; expected v5: save it anew with the option '-v7'")
    order = {b"IM": "<", b"MI": ">"}.get(bytes(content[126:128]))
    if order is None:
        raise ValueError(f"{file}: not a MATLAB v5 file; expected its header of {HEADER} bytes")
    matrices: dict[str, Matrix | None] = {}
    place = "the first variable"
    try:
        for kind, body in _elements(content[HEADER:], order):
            if kind == COMPRESSED:
                beginning = memoryview(zlib.decompressobj().decompress(body, NAME_WITHIN))
                place = f"variable {_name(beginning[8:], order)!r}"
                ((kind, body),) = _elements(_decompressed(body, beginning, order, limit), order)
            if kind != MATRIX:
                raise ValueError(f"an element of type {kind}; expected matrices")
            name = _name(body, order)
            place = f"variable {name!r}"
            if name in matrices:
                raise ValueError("it stands there twice")
            matrix = _matrix(_elements(body, order), order, limit)
            is_wanted = matrix is not None and (complex_too or not np.iscomplexobj(matrix))
            matrices[name] = matrix if is_wanted else None
            place = f"what follows variable {name!r}"
    except (ValueError, struct.error, zlib.error) as error:
        raise ValueError(f"{file}: {place} is not readable as MATLAB v5 ({error})") from error
    return matrices


def _decompressed(body: memoryview, beginning: memoryview, order: str, limit: MemoryLimit) -> memoryview:
    """A compressed element, no longer than its first bytes say."""
    size = 8 + struct.unpack_from(order + "I", beginning, 4)[0]
    limit.take(0, size)
    content, end = bytearray(size), 0
    unpacker = zlib.decompressobj()
    for start in range(0, len(body), PIECE):
        piece = unpacker.decompress(body[start : start + PIECE], size - end + 1)
        if end + len(piece) > size:
            raise ValueError(f"more than the {size} bytes that it says it has when decompressed")
        content[end : end + len(piece)] = piece
        end += len(piece)
    if not unpacker.eof or end < size:
        raise ValueError(f"{end} bytes when decompressed; expected {size}")
    return memoryview(content)


def _elements(content: memoryview, order: str) -> Iterator[Part]:
    """Type and bytes of each element of a block, in order."""
    position = 0
    while position < len(content):
        (kind,) = struct.unpack_from(order + "I", content, position)
        if kind >> 16:  # up to four bytes stand in the tag itself
            kind, length, start, end = kind & 0xFFFF, kind >> 16, position + 4, position + 8
        else:
            (length,) = struct.unpack_from(order + "I", content, position + 4)
            start = position + 8
            end = start + length if kind == COMPRESSED else start + 8 * math.ceil(length / 8)
        if start + length > len(content) or start + length > end:
            raise ValueError(f"an element of {length} bytes where {len(content) - start} are left")
        yield kind, content[start : start + length]
        position = end


def _name(body: memoryview, order: str) -> str:
    """The name of a variable: its third part, or the second of an object, which has no dimensions."""
    parts = [content for _, (_, content) in zip(range(3), _elements(body, order), strict=False)]
    if len(parts) < 3 or len(parts[0]) != 8:
        raise ValueError("a variable without flags, dimensions and name")
    name = bytes(parts[1 if _class(parts[0], order) == OBJECT_CLASS else 2]).decode("ascii")
    if name and not name.isidentifier():
        raise ValueError(f"the name {name!r}")
    return name


def _class(flags: memoryview, order: str) -> int:
    return struct.unpack(order + "II", flags)[0] & 0xFF


def _matrix(elements: Iterator[Part], order: str, limit: MemoryLimit) -> Matrix | None:
    """Values of one variable, from its flags, dimensions, name and numbers."""
    parts = list(islice(elements, MAX_PARTS + 1))
    kind, shape = _class(parts[0][1], order), np.frombuffer(parts[1][1][: len(parts[1][1]) // 4 * 4], order + "i4")
    if kind not in (SPARSE_CLASS, *NUMERIC_CLASSES) or len(shape) != 2:
        deque(elements, maxlen=0)  # whose lengths are checked all the same
        return None
    is_complex = bool(struct.unpack(order + "II", parts[0][1])[0] & COMPLEX)
    numbers = [_numbers(part, order) for part in parts[3:]]
    if len(numbers) != (3 if kind == SPARSE_CLASS else 1) + is_complex or (shape < 0).any():
        raise ValueError(f"{len(numbers)} arrays of numbers for the dimensions {shape.tolist()}")
    n_rows, n_columns = shape.tolist()
    value_size = 16 if is_complex else 8
    if kind == SPARSE_CLASS:
        limit.take_sparse(n_rows, n_columns, max(part.size for part in numbers), value_size)
    else:
        limit.take(value_size * numbers[0].size)
    values = _complex(*numbers[-2:]) if is_complex else numbers[-1].astype(float)
    if kind == SPARSE_CLASS:
        return _sparse_matrix(numbers[0], numbers[1], values, n_rows, n_columns)
    if values.size != n_rows * n_columns:
        raise ValueError(f"{values.size} values; expected {shape.tolist()}")
    return values.reshape((n_rows, n_columns), order="F")


def _complex(real: NDArray, imaginary: NDArray) -> NDArray:
    if real.size != imaginary.size:
        raise ValueError(f"{imaginary.size} imaginary parts; expected {real.size}")
    values = np.empty(real.size, dtype=complex)
    values.real, values.imag = real, imaginary
    return values


def _sparse_matrix(rows: NDArray, starts: NDArray, values: NDArray, n_rows: int, n_columns: int) -> Matrix:
    """A sparse matrix from its columns; rows and values may be longer than the columns need."""
    rows, starts = rows.astype(np.int64), starts.astype(np.int64)
    if starts.size != n_columns + 1 or starts[0] != 0 or (np.diff(starts) < 0).any():
        raise ValueError(f"{starts.size} starts of sparse columns; expected {n_columns + 1} that rise from 0")
    count = starts[-1]
    if count > min(rows.size, values.size):
        raise ValueError(f"{values.size} values in {rows.size} sparse rows; expected {count}")
    rows = rows[:count]
    rises = rows[1:] > rows[:-1]
    first_of_column = starts[(starts > 0) & (starts < count)]
    rises[first_of_column - 1] = True
    if ((rows < 0) | (rows >= n_rows)).any() or not rises.all():
        raise ValueError(f"sparse rows that do not rise within their columns from 0 to at most {n_rows - 1}")
    return scipy.sparse.csc_array((values[:count], rows, starts), shape=(n_rows, n_columns))


def _numbers(part: Part, order: str) -> NDArray:
    kind, content = part
    if kind not in STORED_AS:
        raise ValueError(f"values of type {kind}; expected numbers")
    return np.frombuffer(content, order + STORED_AS[kind])
