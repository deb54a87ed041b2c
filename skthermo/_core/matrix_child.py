"""Reads files in a process of its own, where a damaged one can do no harm; started by `matrix_files`.

Files come as JSON on standard input; what each holds, or its error, goes to standard output as a pickle.
"""

import contextlib
import io
import json
import pickle
import re
import struct
import sys
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse

from skthermo._core.text_matrices import (
    BYTES_FOR_EACH_ROW,
    numbers_of,
    read_dmig,
    read_dofs,
    read_entries,
    read_harwell_boeing,
    read_op4,
)

Bytes = bytes | memoryview

MATLAB_HEADER = 128  # bytes


class MatlabType(IntEnum):
    """Types of a file's elements."""

    MATRIX = 14
    COMPRESSED = 15


class MatlabClass(IntEnum):
    """Classes of a file's variables; those from 6 to 15 are full arrays of numbers."""

    CELL = 1
    STRUCT = 2
    CHARACTERS = 4
    SPARSE = 5
    OPAQUE = 17


def read_matlab(content: bytes) -> dict[str, Any]:
    """Every variable of a MATLAB v5 file, or of the only one in a zip file."""
    if content.startswith(b"PK"):
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = [name for name in archive.namelist() if not name.startswith("__MACOSX/")]
            chosen = [name for name in names if name.lower().endswith(".mat")]
            if len(chosen) != 1:
                raise ValueError(f"{len(names)} members, {names[:20]}; expected exactly one .mat file")
            content = archive.read(chosen[0])
    order = {b"IM": "<", b"MI": ">"}.get(content[MATLAB_HEADER - 2 : MATLAB_HEADER])
    if order is None or content.startswith(b"MATLAB 7.3"):
        raise ValueError("another format; expected MATLAB v5: a MATLAB v7.3 file can be saved anew with '-v7'")
    variables: dict[str, Any] = {}
    place = "the first variable"
    try:
        for kind, body in _elements(memoryview(content)[MATLAB_HEADER:], order):
            if kind == MatlabType.COMPRESSED:
                place = f"variable {_name(zlib.decompressobj().decompress(body, 1024)[8:], order)!r}"
                ((kind, body),) = _elements(memoryview(zlib.decompress(body)), order)
            if kind != MatlabType.MATRIX:
                raise ValueError(f"an element of type {kind}; expected a variable")
            name = _name(body, order)
            place = f"variable {name!r}"
            if name in variables:
                raise ValueError("the file holds it twice")
            variables[name] = _variable(body, order)
            place = f"what follows variable {name!r}"
    except Exception as error:  # SciPy raises errors of every type
        raise ValueError(f"{place}: {error}") from error
    return variables


def _elements(content: Bytes, order: str) -> Iterator[tuple[int, Bytes]]:
    """Type and bytes of each element of a MATLAB file or variable; lengths beyond the end are an error."""
    position = 0
    while position < len(content):
        kind, length = struct.unpack_from(order + "II", content, position)
        start, end = position + 8, len(content)
        if kind >> 16:  # up to four bytes beside type and length
            kind, length, start, end = kind & 0xFFFF, kind >> 16, position + 4, position + 8
        if start + length > min(end, len(content)):
            raise ValueError(f"an element of {length} bytes where {len(content) - start} are left")
        yield kind, content[start : start + length]
        position = start + length + (0 if kind == MatlabType.COMPRESSED else -(start + length - position) % 8)


def _class_of(body: Bytes, order: str) -> tuple[int, bool]:
    """Class of a variable, and whether it is complex."""
    (flags,) = struct.unpack_from(order + "I", body, 8)
    return flags & 0xFF, bool(flags & 0x0800)


def _name(body: Bytes, order: str) -> str:
    """Name of a variable: the third part, or the second of an opaque one, which has no dimensions."""
    parts = [part for _, (_, part) in zip(range(3), _elements(body, order), strict=False)]
    name = bytes(parts[1 if _class_of(body, order)[0] == MatlabClass.OPAQUE else 2]).decode("ascii")
    if name and not name.isidentifier():
        raise ValueError(f"the name {name!r}")
    return name


def _variable(body: Bytes, order: str) -> Any:
    """One variable, read by SciPy, which does not notice parts that are too many or a lost flag."""
    kind, is_complex = _class_of(body, order)
    is_sparse, is_full = kind == MatlabClass.SPARSE, kind in range(6, 16)
    n_parts, expected = sum(1 for _ in _elements(body, order)), (6 if is_sparse else 4) + is_complex
    others = (MatlabClass.CELL, MatlabClass.STRUCT, MatlabClass.CHARACTERS)
    if not (is_sparse or is_full or kind in others):
        return None
    if (is_sparse or is_full) and n_parts != expected:
        raise ValueError(f"{n_parts} parts; expected {expected}")
    header = b"MATLAB 5.0".ljust(MATLAB_HEADER - 4) + struct.pack(order + "2H", 0x0100, 0x4D49)
    stream = io.BytesIO(header + struct.pack(order + "2I", MatlabType.MATRIX, len(body)) + body)
    (value,) = [
        value
        for name, value in scipy.io.loadmat(stream, spmatrix=False).items()
        if name[:2] != "__" or name[-2:] != "__"
    ]
    if scipy.sparse.issparse(value) and not scipy.sparse.csc_array(value).has_canonical_format:
        raise ValueError("sparse rows that do not rise within their columns")
    return _plain(value)


def _plain(value: Any) -> Any:
    """Numbers as an array or sparse matrix; texts and cells as a list; a struct as a mapping, several as a list."""
    if scipy.sparse.issparse(value) or value.dtype.kind in "fiubc":
        return _numbers(value)
    if value.dtype.kind == "U":
        return value.ravel().tolist()
    if type(value) is not np.ndarray:  # objects and functions of MATLAB
        return None
    values = value.ravel(order="F")
    if value.dtype.names is None:
        return [_plain(one) for one in values]
    structs = [{name: _plain(one[name]) for name in value.dtype.names} for one in values]
    return structs[0] if len(structs) == 1 else structs


def _numbers(value: Any) -> Any:
    """Floats, or complex numbers if an imaginary part is not zero, sparse ones by columns; None for other things."""
    if value.dtype.kind not in "fiubc":
        return None
    if scipy.sparse.issparse(value):
        bytearray(BYTES_FOR_EACH_ROW * sum(value.shape))  # an error here if that is too much memory
        if value.format in ("csr", "csc", "bsr"):
            value.check_format(full_check=True)
        value = scipy.sparse.csc_array(value)
    value = value.astype(complex if value.dtype.kind == "c" else float, copy=False)
    imaginary = np.asarray(value.data if scipy.sparse.issparse(value) else value).imag
    return value if value.dtype == float or imaginary.any() else value.real


def read_npz(content: bytes) -> dict[str, Any]:
    """Arrays of numbers by name; None for other arrays."""
    arrays: dict[str, Any] = {}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for member in archive.namelist():
            name = member.removesuffix(".npy")
            try:
                stream = io.BytesIO(archive.read(member))  # all of it, for its checksum
                arrays[name] = _numbers(np.lib.format.read_array(stream, allow_pickle=False))
                if stream.read(1):
                    raise ValueError("more values than its shape says")
            except Exception as error:
                if "allow_pickle" not in str(error):
                    raise ValueError(f"variable {name!r}: {error}") from error
                arrays[name] = None  # an array of objects
    return arrays


def read_zip(content: bytes) -> Any:
    """A sparse matrix of `scipy.sparse.save_npz`, arrays of NumPy by name, or the variables of a MATLAB file."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = archive.namelist()
    if any(name.lower().endswith(".mat") for name in names):
        return read_matlab(content)
    arrays = read_npz(content)
    return _numbers(scipy.sparse.load_npz(io.BytesIO(content))) if {"format.npy", "shape.npy"} <= {*names} else arrays


def read_matrix_market(content: bytes) -> Any:
    """A matrix, read by SciPy, which does not notice numbers that end in letters, or lines that are too long."""
    n_rows, n_columns, n_entries, layout, field, symmetry = scipy.io.mminfo(io.BytesIO(content))
    if field == "pattern" or (symmetry != "general" and n_rows != n_columns):
        raise ValueError(f"{n_rows} x {n_columns}, {field}, {symmetry}; expected numbers, and a square if symmetric")
    start = re.match(rb"(?:[ \t\r]*(?:%.*)?\n)*.*(?:\n|\Z)", content).end()  # type: ignore[union-attr]
    body = re.sub(rb"^[ \t]*%.*$", b"", content[start:], flags=re.MULTILINE)
    numbers = numbers_of(body, content.count(b"\n", 0, start))
    width = (3 if layout == "coordinate" else 1) + (field == "complex")
    if layout == "array" and symmetry != "general":
        n_entries = n_rows * (n_rows - 1) // 2 + (0 if symmetry == "skew-symmetric" else n_rows)
    if numbers.size != n_entries * width:
        raise ValueError(f"{numbers.size} numbers; expected {n_entries} times {width}")
    if layout == "coordinate":
        rows, columns = numbers.reshape(-1, width)[:, :2].T
        if (rows % 1).any() or (columns % 1).any():
            raise ValueError("rows or columns that are not whole numbers")
        if symmetry != "general" and (rows < columns).any() and (rows > columns).any():
            raise ValueError("a symmetric matrix has entries on both sides of its diagonal; expected one")
        if symmetry == "skew-symmetric" and (rows == columns).any():
            raise ValueError("a skew-symmetric matrix has entries on its diagonal; expected none")
    return _numbers(scipy.io.mmread(io.BytesIO(content[:start] + body), spmatrix=False))


READERS = {
    "MATLAB v5": read_matlab,
    ".npz": read_zip,
    "Matrix Market": read_matrix_market,
    "Harwell-Boeing": read_harwell_boeing,
    "Nastran's DMIG": read_dmig,
    "Nastran's OUTPUT4": read_op4,
    "lines of entries": read_entries,
    "labels of rows": read_dofs,
}


def read(file: str, form: str) -> Any:
    """What a file holds, or the error that reading it raised."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)  # SciPy's, of damaged variables
            warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)  # NumPy's
            return READERS[form](Path(file).read_bytes())
    except Exception as error:  # a damaged file can fail in every way
        is_memory = isinstance(error.__cause__ or error, MemoryError)
        return MemoryError() if is_memory else ValueError(str(error) or repr(error))


def main() -> None:
    """Read the files that standard input names, within the limits that it sets."""
    job = json.load(sys.stdin)
    with contextlib.suppress(ImportError, OSError, ValueError):  # where the platform has no limits
        import resource

        taken = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_DATA, (taken + job["most_memory"],) * 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    kept = []  # so that the limit is for all files together
    for file, form in job["files"]:
        kept.append(read(file, form))
        pickle.dump(kept[-1], sys.stdout.buffer, protocol=5)
        sys.stdout.flush()


if __name__ == "__main__":
    main()
