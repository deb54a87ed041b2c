"""Variables of MATLAB v5 files: damaged ones are errors, where `scipy.io.loadmat` can end the interpreter."""

import io
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._core.arrays import Matrix

COMPRESSED = 15  # the type of an element that holds a variable in compressed form
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""NumPy's names of the types of numbers."""

Part = tuple[int, memoryview]


def read_matlab(file: Path) -> dict[str, Any]:
    """Every variable of a MATLAB v5 file, or of the only one in a zip file.

    Numbers become arrays of floats or complex numbers with all their dimensions, or sparse matrices; texts a list of
    one text for each row; cell arrays a list of their values, the first dimension running fastest; structs a mapping
    of their fields, and arrays of structs a list of such mappings. Anything else becomes None.
    """
    try:
        return matlab_variables(file.read_bytes())
    except Exception as error:  # a damaged zip file raises errors of every type
        raise ValueError(f"{file}: not readable as MATLAB v5 ({error})") from error


def matlab_variables(content: bytes) -> dict[str, Any]:
    """Variables by name; an error names the one that is damaged."""
    if content.startswith(b"PK"):
        content = _only_member(content)
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None or content.startswith(b"MATLAB 7.3"):
        raise ValueError("another format; expected MATLAB v5: a MATLAB v7.3 file can be saved anew with '-v7'")
    variables: dict[str, Any] = {}
    name = ""
    try:
        for kind, body in _elements(memoryview(content)[128:], order):
            if kind == COMPRESSED:
                ((kind, body),) = _elements(memoryview(zlib.decompress(body)), order)
            name, value = _variable(kind, body, order)
            if name in variables:
                raise ValueError("the file holds it twice")
            variables[name] = value
    except (ValueError, KeyError, IndexError, struct.error, zlib.error) as error:
        place = f"after variable {list(variables)[-1]!r}" if variables else "the first variable"
        raise ValueError(f"{place}: {error}") from error
    return variables


def _only_member(archive: bytes) -> bytes:
    """The MATLAB file in a zip file."""
    with zipfile.ZipFile(io.BytesIO(archive)) as members:
        names = [name for name in members.namelist() if not name.startswith("__MACOSX/")]
        chosen = [name for name in names if name.lower().endswith(".mat")]
        if len(chosen) != 1:
            raise ValueError(f"{len(names)} members, {names[:20]}; expected exactly one .mat file")
        return members.read(chosen[0])


def _elements(content: memoryview, order: str) -> Iterator[Part]:
    """Type and bytes of each element of a file or variable."""
    position = 0
    while position < len(content):
        kind, length = struct.unpack_from(order + "II", content, position)
        start, end = position + 8, len(content)
        if kind >> 16:  # up to four bytes beside type and length
            kind, length, start, end = kind & 0xFFFF, kind >> 16, position + 4, position + 8
        if start + length > min(end, len(content)):
            raise ValueError(f"an element of {length} bytes where {len(content) - start} are left")
        yield kind, content[start : start + length]
        position = start + length + (0 if kind == COMPRESSED else -(start + length - position) % 8)


def _variable(kind: int, body: memoryview, order: str) -> tuple[str, Any]:
    """Name and value of a variable, of a cell or of a field."""
    if kind != 14:
        raise ValueError(f"an element of type {kind}; expected a variable")
    if not body:  # a cell that was never filled
        return "", np.empty((0, 0))
    (_, flags), *parts = _elements(body, order)
    (word,) = struct.unpack_from(order + "I", flags)
    own_class, is_complex = word & 0xFF, bool(word & 0x0800)
    if own_class == 17:  # an opaque object, which has no dimensions
        return bytes(parts[0][1]).decode("ascii"), None
    shape, name = tuple(_numbers(parts[0], order).tolist()), bytes(parts[1][1]).decode("ascii")
    try:
        return name, _value(own_class, shape, parts[2:], order, n_values=1 + is_complex)
    except (ValueError, IndexError) as error:
        raise ValueError(f"variable {name!r}: {error}") from error


def _value(own_class: int, shape: tuple[int, ...], parts: list[Part], order: str, *, n_values: int) -> Any:
    """The value that the parts of a variable hold; ``n_values`` is 2 for complex numbers."""
    match own_class:
        case 5:  # a sparse matrix
            rows, starts = (_numbers(part, order) for part in parts[:2])
            return _sparse(rows, starts, _complex(parts[2:], order, n_values), shape)
        case n if 6 <= n <= 15:  # numbers
            return _complex(parts, order, n_values).reshape(shape, order="F")
        case 4:  # text
            return _rows_of_text(parts[0], shape, order)
        case 1:  # a cell array
            return [_variable(*part, order)[1] for part in parts]
        case 2:  # structs
            width, names = int(_numbers(parts[0], order)[0]), bytes(parts[1][1])
            fields = [names[i : i + width].split(b"\0")[0].decode() for i in range(0, len(names), width)]
            values = [_variable(*part, order)[1] for part in parts[2:]]
            starts = range(0, len(values), len(fields) or 1)
            structs = [dict(zip(fields, values[i : i + len(fields)], strict=True)) for i in starts]
            return structs[0] if len(structs) == 1 else structs
    return None


def _numbers(part: Part, order: str) -> NDArray:
    kind, content = part
    if kind not in NUMBERS:
        raise ValueError(f"a part of type {kind}; expected numbers")
    return np.frombuffer(content, order + NUMBERS[kind])


def _complex(parts: list[Part], order: str, n_values: int) -> NDArray:
    """Floats, or complex numbers if an imaginary part is not zero."""
    if len(parts) != n_values:
        raise ValueError(f"{len(parts)} parts of values; expected {n_values}")
    real, *imaginary = (_numbers(part, order).astype(float) for part in parts)
    if not imaginary or not imaginary[0].any():
        return real
    values = real.astype(complex)
    values.imag = imaginary[0]
    return values


def _sparse(rows: NDArray, starts: NDArray, values: NDArray, shape: tuple[int, ...]) -> Matrix:
    n_entries = int(starts[-1])
    if not n_entries <= len(rows) or len(values) not in (n_entries, len(rows)):
        raise ValueError(f"{len(rows)} rows and {len(values)} values; expected {n_entries} entries")
    matrix = scipy.sparse.csc_array((values[:n_entries], rows[:n_entries].astype(np.int32), starts), shape=shape)
    matrix.check_format(full_check=True)
    if not matrix.has_canonical_format:
        raise ValueError("sparse rows that do not rise within their columns")
    return matrix


def _rows_of_text(part: Part, shape: tuple[int, ...], order: str) -> list[str]:
    end = {"<": "le", ">": "be"}[order]
    codecs = {1: "latin-1", 2: "latin-1", 4: f"utf-16-{end}", 16: "utf-8", 17: f"utf-16-{end}", 18: f"utf-32-{end}"}
    text = bytes(part[1]).decode(codecs[part[0]])
    n_rows = shape[0]
    return [text[i::n_rows] for i in range(n_rows)]
