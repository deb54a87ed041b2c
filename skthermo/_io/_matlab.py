"""Matrices from MATLAB v5 files, damaged files included."""

import struct
from collections import deque
from itertools import islice
from pathlib import Path

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._arrays import Matrix
from skthermo._io._matlab_elements import (
    COMPLEX,
    NUMERIC_CLASSES,
    complex_numbers,
    elements,
    matrix_class,
    numbers_of,
    read_variables,
)
from skthermo._io._memory_limit import MemoryLimit

SPARSE_CLASS = 5
MAX_PARTS = 7  # of a sparse complex matrix


def read_matlab(file: Path, *, complex_too: bool = False, limit: MemoryLimit | None = None) -> dict[str, Matrix | None]:
    """Every variable of a MATLAB v5 file; None for what is not a real matrix, full or sparse.

    Raises
    ------
    ValueError
        Names the file and the variable, if it is not a MATLAB v5 file, or cut off or inconsistent anywhere, or
        would need too much memory.
    """
    limit = limit or MemoryLimit(file.stat().st_size)
    matrices = read_variables(memoryview(file.read_bytes()), str(file), _matrix, limit)
    return {
        name: matrix if matrix is not None and (complex_too or not np.iscomplexobj(matrix)) else None
        for name, matrix in matrices.items()
    }


def _matrix(body: memoryview, order: str, limit: MemoryLimit) -> Matrix | None:
    """Values of one variable, from its flags, dimensions, name and numbers."""
    rest = elements(body, order)
    parts = list(islice(rest, MAX_PARTS + 1))
    kind, shape = (
        matrix_class(parts[0][1], order),
        np.frombuffer(parts[1][1][: len(parts[1][1]) // 4 * 4], order + "i4"),
    )
    if kind not in (SPARSE_CLASS, *NUMERIC_CLASSES) or len(shape) != 2:
        deque(rest, maxlen=0)  # whose lengths are checked all the same
        return None
    is_complex = bool(struct.unpack(order + "II", parts[0][1])[0] & COMPLEX)
    numbers = [numbers_of(part, order) for part in parts[3:]]
    if len(numbers) != (3 if kind == SPARSE_CLASS else 1) + is_complex or (shape < 0).any():
        raise ValueError(f"{len(numbers)} arrays of numbers for the dimensions {shape.tolist()}")
    n_rows, n_columns = shape.tolist()
    value_size = 16 if is_complex else 8
    if kind == SPARSE_CLASS:
        limit.take_sparse(n_rows, n_columns, max(part.size for part in numbers), value_size)
    else:
        limit.take(value_size * numbers[0].size)
    values = complex_numbers(*numbers[-2:]) if is_complex else numbers[-1].astype(float)
    if kind == SPARSE_CLASS:
        return _sparse_matrix(numbers[0], numbers[1], values, n_rows, n_columns)
    if values.size != n_rows * n_columns:
        raise ValueError(f"{values.size} values; expected {shape.tolist()}")
    return values.reshape((n_rows, n_columns), order="F")


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
