"""Arrays and sparse matrices from NumPy's .npz files, damaged files included.

NumPy allocates what a member's header states. Here the header is compared with the bytes that are there.
"""

import io
import math
import zipfile
from pathlib import Path

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._io._memory_limit import MemoryLimit
from skthermo._io._zip import read_member

HEADER_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
LONGEST_HEADER = 20_000
FORMATS = {
    "csr": scipy.sparse.csr_array,
    "csc": scipy.sparse.csc_array,
    "bsr": scipy.sparse.bsr_array,
}


def read_npz(file: Path, limit: MemoryLimit) -> dict[str, NDArray]:
    """Arrays whose checksums are right; an empty one for what only pickle reads.

    Raises
    ------
    ValueError
        Names the file and the variable that is damaged, or would need too much memory.
    """
    variable = ""
    try:
        arrays = {}
        with zipfile.ZipFile(file) as archive:
            for member in archive.infolist():
                name = member.filename.removesuffix(".npy")
                variable = f"variable {name!r} is "
                limit.take(member.file_size)
                arrays[name] = array = _array(read_member(archive, member))
                limit.take(0 if array.dtype in (float, complex) else 16 * array.size)
    except Exception as error:  # a damaged file can fail in every way
        raise ValueError(f"{file}: {variable}not readable as .npz ({error})") from error
    return arrays


def read_sparse_npz(file: Path, limit: MemoryLimit) -> scipy.sparse.sparray:
    """A sparse matrix of `scipy.sparse.save_npz`.

    Raises
    ------
    ValueError
        Names the file, if it is damaged or something else.
    """
    arrays = read_npz(file, limit)
    try:
        form = arrays["format"].astype("U").item()
        n_rows, n_columns = (int(size) for size in arrays["shape"])
        data = arrays["data"]
        if data.dtype.kind not in "fiubc" or min(n_rows, n_columns) < 0:
            raise ValueError(f"values of type {data.dtype}, shape ({n_rows}, {n_columns}); expected numbers")
        limit.take_sparse(n_rows, n_columns, data.size, data.itemsize)
        if form in FORMATS:
            parts = data, _whole(arrays["indices"]), _whole(arrays["indptr"])
            matrix = FORMATS[form](parts, shape=(n_rows, n_columns))
            matrix.check_format(full_check=True)
        elif form == "coo":
            places = _whole(arrays["row"]), _whole(arrays["col"])
            matrix = scipy.sparse.coo_array((data, places), shape=(n_rows, n_columns))
        elif form == "dia":
            matrix = scipy.sparse.dia_array((data, _whole(arrays["offsets"])), shape=(n_rows, n_columns)).tocoo()
        else:
            raise ValueError(f"the format {form!r}; expected one of {[*FORMATS, 'coo', 'dia']}")
    except Exception as error:  # arrays that do not belong together can fail in every way
        raise ValueError(f"{file}: not a sparse matrix of scipy.sparse.save_npz ({error})") from error
    return matrix


def _array(content: bytearray) -> NDArray:
    header = io.BytesIO(bytes(content[:LONGEST_HEADER]))
    version = np.lib.format.read_magic(header)
    if version not in HEADER_READERS:
        raise ValueError(f"version {version}; expected one of {list(HEADER_READERS)}")
    shape, is_fortran, dtype = HEADER_READERS[version](header)
    if dtype.hasobject:
        return np.empty(0)
    count, n_bytes = math.prod(shape), len(content) - header.tell()
    if count * dtype.itemsize != n_bytes:
        raise ValueError(f"{n_bytes} bytes for the shape {shape} of {dtype}; expected {count * dtype.itemsize}")
    if not dtype.itemsize:
        return np.empty(0)
    values = np.frombuffer(content, dtype, count, header.tell())
    return values.reshape(shape, order="F" if is_fortran else "C")


def _whole(numbers: NDArray) -> NDArray:
    if numbers.dtype.kind not in "iu":
        raise ValueError(f"places of type {numbers.dtype}; expected integers")
    return numbers
