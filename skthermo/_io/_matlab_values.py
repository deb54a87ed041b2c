"""Structs, cell arrays, texts and arrays of any dimensions from MATLAB v5 files, damaged files included."""

import math
import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._io._matlab_elements import (
    COMPLEX,
    MATRIX,
    NUMERIC_CLASSES,
    Part,
    complex_numbers,
    elements,
    matrix_class,
    numbers_of,
    read_variables,
)
from skthermo._io._memory_limit import MemoryLimit

CELL_CLASS, STRUCT_CLASS, CHAR_CLASS = 1, 2, 4
ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
DEEPEST = 10  # of structs and cells within each other
LEAST = 200  # bytes that a value or a text takes in memory, however short it is


def read_matlab_values(content: bytes | bytearray, file: str, limit: MemoryLimit) -> dict[str, Any]:
    """Every variable of a MATLAB v5 file, given as its bytes.

    Full numeric arrays become arrays of floats or complex numbers with all their dimensions; texts become a list of
    one text for each row; cell arrays a list of their values, the first dimension running fastest; structs a mapping
    of their fields, and arrays of structs a list of such mappings. Anything else becomes None.

    Raises
    ------
    ValueError
        Names the file, the variable and the field, if it is not a MATLAB v5 file, or cut off or inconsistent anywhere,
        or would need too much memory.
    """
    return read_variables(memoryview(content), file, _variable, limit)


def _variable(body: memoryview, order: str, limit: MemoryLimit) -> Any:
    return _Reader(order, limit, len(body)).value((MATRIX, body))


@dataclass
class _Reader:
    """Values within one variable: byte order, limit of memory, and bytes of the whole variable."""

    order: str
    limit: MemoryLimit
    n_bytes: int

    def value(self, part: Part, depth: int = 0) -> Any:
        kind, body = part
        if kind != MATRIX:
            raise ValueError(f"an element of type {kind}; expected a matrix")
        if depth > DEEPEST:
            raise ValueError(f"structs or cells more than {DEEPEST} deep within each other")
        self.limit.take(LEAST, self.n_bytes)
        if not body:  # how MATLAB writes a cell that was never filled
            return np.empty((0, 0))
        parts = elements(body, self.order)
        head = [content for _, content in islice(parts, 3)]
        if len(head) < 3 or len(head[0]) != 8:
            raise ValueError("a matrix without flags, dimensions and name")
        kind = matrix_class(head[0], self.order)
        if kind not in (CELL_CLASS, STRUCT_CLASS, CHAR_CLASS, *NUMERIC_CLASSES):
            deque(parts, maxlen=0)  # whose lengths are checked all the same
            return None
        shape = np.frombuffer(head[1], self.order + "i4").tolist()
        if len(shape) < 2 or min(shape) < 0:
            raise ValueError(f"the dimensions {shape}; expected two or more that are not negative")
        if kind == CELL_CLASS:
            return self._values(parts, [""], math.prod(shape), depth)
        if kind == STRUCT_CLASS:
            return self._structs(parts, math.prod(shape), depth)
        if kind == CHAR_CLASS:
            return self._texts(list(islice(parts, 2)), shape)
        is_complex = bool(struct.unpack(self.order + "II", head[0])[0] & COMPLEX)
        return self._array(list(islice(parts, 3)), shape, is_complex)

    def _values(self, parts: Iterator[Part], fields: list[str], count: int, depth: int) -> list[Any]:
        """So many values, whose fields follow each other in turn; the field of a cell has no name."""
        values: list[Any] = []
        for part in parts:
            field = fields[len(values) % len(fields)] if fields else ""
            try:
                values.append(self.value(part, depth + 1))
            except (ValueError, struct.error) as error:
                raise ValueError(f"field {field!r}: {error}" if field else str(error)) from error
        if len(values) != count:
            raise ValueError(f"{len(values)} values in a struct or cell array; expected {count}")
        return values

    def _structs(self, parts: Iterator[Part], count: int, depth: int) -> dict[str, Any] | list[dict[str, Any]]:
        fields = self._fields(list(islice(parts, 2)))
        self.limit.take(LEAST * count, self.n_bytes)
        values = self._values(parts, fields, count * len(fields), depth)
        n_fields = len(fields)
        structs = [
            dict(zip(fields, values[number * n_fields : (number + 1) * n_fields], strict=True))
            for number in range(count)
        ]
        return structs[0] if count == 1 else structs

    def _fields(self, parts: list[Part]) -> list[str]:
        """Names of fields, each padded with zeros to the same length."""
        lengths = [int(length) for part in parts[:1] for length in numbers_of(part, self.order)]
        names = bytes(parts[1][1]) if len(parts) == 2 else b""
        if len(parts) != 2 or len(lengths) != 1 or lengths[0] < 1 or len(names) % lengths[0]:
            raise ValueError(f"field names of {lengths} bytes in {len(names)} bytes")
        self.limit.take(LEAST * (len(names) // lengths[0]), self.n_bytes)
        starts = range(0, len(names), lengths[0])
        fields = [names[start : start + lengths[0]].partition(b"\0")[0].decode("ascii") for start in starts]
        if len(set(fields)) != len(fields) or not all(field.isidentifier() for field in fields):
            raise ValueError(f"the field names {fields[:20]}; expected names that differ")
        return fields

    def _texts(self, parts: list[Part], shape: list[int]) -> list[str] | None:
        """The rows of a matrix of characters, which MATLAB counts in UTF-16 and SciPy in UTF-32."""
        if len(shape) != 2:
            return None
        kind, content = parts[0] if parts else (1, memoryview(b""))
        if kind not in ENCODINGS or len(parts) > 1:
            raise ValueError(f"a text of type {kind} in {len(parts)} parts")
        self.limit.take(LEAST * shape[0] + 4 * len(content), self.n_bytes + 8 * len(content))
        byte_order = {"<": "-le", ">": "-be"}[self.order]
        has_order = ENCODINGS[kind] in ("utf-16", "utf-32")
        text = bytes(content).decode(ENCODINGS[kind] + (byte_order if has_order else ""))
        for encoding, dtype in (("utf-16-le", "<u2"), ("utf-32-le", "<u4")):
            characters = np.frombuffer(text.encode(encoding), dtype)
            if characters.size == math.prod(shape):
                return [row.tobytes().decode(encoding) for row in characters.reshape(shape, order="F")]
        raise ValueError(f"a text of {len(text)} characters; expected {shape}")

    def _array(self, parts: list[Part], shape: list[int], is_complex: bool) -> NDArray:
        numbers = [numbers_of(part, self.order) for part in parts]
        if len(numbers) != 1 + is_complex:
            raise ValueError(f"{len(numbers)} arrays of numbers; expected {1 + is_complex}")
        self.limit.take((16 if is_complex else 8) * numbers[0].size, self.n_bytes)
        values = complex_numbers(*numbers) if is_complex else numbers[0].astype(float)
        if values.size != math.prod(shape):
            raise ValueError(f"{values.size} values; expected {shape}")
        return values.reshape(shape, order="F")
