"""Real matrices from MATLAB v5 files, damaged files included.

SciPy's reader follows the lengths that a file states; where these are damaged it can end the
interpreter. Here every length is checked against the bytes that are there.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HEADER = 128
MATRIX, COMPRESSED = 14, 15
STORED_AS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
NUMERIC_CLASSES = range(6, 16)
COMPLEX = 0x0800


def read_matrices(file: Path) -> dict[str, NDArray[np.float64] | None]:
    """Every variable of a MATLAB v5 file; None for what is not a real, full matrix.

    Raises
    ------
    ValueError
        Names the file, if it is not a MATLAB v5 file, or cut off or inconsistent anywhere.
    """
    content = file.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise ValueError(f"{file}: not a MATLAB v5 file; expected its header of {HEADER} bytes")
    matrices = {}
    try:
        for kind, body in _elements(content[HEADER:], order):
            if kind == COMPRESSED:
                ((kind, body),) = _elements(zlib.decompress(body), order)
            if kind != MATRIX:
                raise ValueError(f"an element of type {kind}; expected matrices")
            name, matrix = _matrix(body, order)
            matrices[name] = matrix
    except (ValueError, struct.error, zlib.error) as error:
        raise ValueError(f"{file}: not a readable MATLAB v5 file ({error})") from error
    return matrices


def _elements(content: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Types and bytes of the elements that follow each other in a block."""
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


def _matrix(body: bytes, order: str) -> tuple[str, NDArray[np.float64] | None]:
    """Name and values of one variable."""
    parts = list(_elements(body, order)) if body else []
    if len(parts) < 3 or len(parts[0][1]) != 8 or len(parts[1][1]) % 4:
        raise ValueError("a variable without flags, dimensions and name")
    (flags,) = struct.unpack_from(order + "I", parts[0][1])
    name = parts[2][1].decode("ascii")
    shape = np.frombuffer(parts[1][1], order + "i4")
    if flags & 0xFF not in NUMERIC_CLASSES or flags & COMPLEX or len(shape) != 2:
        return name, None
    if len(parts) != 4 or parts[3][0] not in STORED_AS or (shape < 0).any():
        raise ValueError(f"variable {name!r} has no values")
    values = np.frombuffer(parts[3][1], order + STORED_AS[parts[3][0]])
    if values.size != math.prod(shape.tolist()):
        raise ValueError(f"variable {name!r} has {values.size} values; expected {shape.tolist()}")
    return name, values.reshape(shape, order="F").astype(float)
