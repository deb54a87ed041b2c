"""Elements of MATLAB v5 files, damaged files included.

SciPy's reader follows the lengths that a file states; where these are damaged it can end the
interpreter, or ask for gigabytes. Here every length is checked against the bytes that are there.
"""

import math
import struct
import zlib
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from skthermo._io._memory_limit import MemoryLimit

Part = tuple[int, memoryview]
Value = TypeVar("Value")

HEADER = 128
MATRIX, COMPRESSED = 14, 15
STORED_AS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
OBJECT_CLASS = 17
NUMERIC_CLASSES = range(6, 16)
COMPLEX = 0x0800
NAME_WITHIN = 1024  # bytes of a variable's beginning, its name included
PIECE = 16384  # bytes that are decompressed at a time, to at most a thousand times as many


def read_variables(
    content: memoryview, file: str, value_of: Callable[[memoryview, str, MemoryLimit], Value], limit: MemoryLimit
) -> dict[str, Value]:
    """Every variable of a MATLAB v5 file by name, made from its bytes and their order ("<" or ">").

    Raises
    ------
    ValueError
        Names the file and the variable, if it is not a MATLAB v5 file, or cut off or inconsistent anywhere, or
        would need too much memory.
    """
    if content[:10] == b"MATLAB 7.3":
        raise ValueError(f"{file}: a MATLAB v7.3 file; expected v5: save it anew with the option '-v7'")
    order = {b"IM": "<", b"MI": ">"}.get(bytes(content[126:128]))
    if order is None:
        raise ValueError(f"{file}: not a MATLAB v5 file; expected its header of {HEADER} bytes")
    values: dict[str, Value] = {}
    place = "the first variable"
    try:
        for kind, body in elements(content[HEADER:], order):
            if kind == COMPRESSED:
                beginning = memoryview(zlib.decompressobj().decompress(body, NAME_WITHIN))
                place = f"variable {_name(beginning[8:], order)!r}"
                ((kind, body),) = elements(_decompressed(body, beginning, order, limit), order)
            if kind != MATRIX:
                raise ValueError(f"an element of type {kind}; expected matrices")
            name = _name(body, order)
            place = f"variable {name!r}"
            if name in values:
                raise ValueError("it stands there twice")
            values[name] = value_of(body, order, limit)
            place = f"what follows variable {name!r}"
    except (ValueError, struct.error, zlib.error) as error:
        raise ValueError(f"{file}: {place} is not readable as MATLAB v5 ({error})") from error
    return values


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


def elements(content: memoryview, order: str) -> Iterator[Part]:
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
    parts = [content for _, (_, content) in zip(range(3), elements(body, order), strict=False)]
    if len(parts) < 3 or len(parts[0]) != 8:
        raise ValueError("a variable without flags, dimensions and name")
    name = bytes(parts[1 if matrix_class(parts[0], order) == OBJECT_CLASS else 2]).decode("ascii")
    if name and not name.isidentifier():
        raise ValueError(f"the name {name!r}")
    return name


def matrix_class(flags: memoryview, order: str) -> int:
    """The number of a variable's class, from its flags."""
    return struct.unpack(order + "II", flags)[0] & 0xFF


def numbers_of(part: Part, order: str) -> NDArray:
    """The numbers that an element holds, of the type in which they are stored."""
    kind, content = part
    if kind not in STORED_AS:
        raise ValueError(f"values of type {kind}; expected numbers")
    return np.frombuffer(content, order + STORED_AS[kind])


def complex_numbers(real: NDArray, imaginary: NDArray) -> NDArray:
    """Complex numbers from as many real and imaginary parts."""
    if real.size != imaginary.size:
        raise ValueError(f"{imaginary.size} imaginary parts; expected {real.size}")
    values = np.empty(real.size, dtype=complex)
    values.real, values.imag = real, imaginary
    return values
