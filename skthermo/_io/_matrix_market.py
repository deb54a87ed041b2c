"""Matrices from Matrix Market files, damaged files included.

SciPy's reader believes the size that a file states and ends the interpreter where that is damaged.
"""

from pathlib import Path

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._arrays import Matrix


def read_matrix_market(file: Path) -> Matrix | None:
    """The matrix of a file, dense ("array") or sparse ("coordinate"); None if it is skew-symmetric.

    Raises
    ------
    ValueError
        Names the file, if it is cut off or not what its header says.
    """
    try:
        return _read(file.read_text("latin-1"))
    except ValueError as error:
        raise ValueError(f"{file}: not readable as Matrix Market ({error})") from error


def _read(text: str) -> Matrix | None:
    first, _, rest = text.partition("\n")
    header = first.lower().split()
    if len(header) != 5 or header[:2] != ["%%matrixmarket", "matrix"]:
        raise ValueError(f"the first line is {first[:80]!r}; expected '%%MatrixMarket matrix ...'")
    layout, field, symmetry = header[2:]
    if symmetry == "skew-symmetric":
        return None
    if (
        layout not in ("array", "coordinate")
        or field not in ("real", "integer", "complex")
        or symmetry not in ("general", "symmetric", "hermitian")
    ):
        raise ValueError(
            f"the first line is {first[:80]!r}; expected array or coordinate, real or complex, general or symmetric"
        )
    if not rest.endswith("\n"):
        raise ValueError("the last line has no end: is it cut off?")
    lines = [line for line in rest.splitlines() if line.strip() and not line.lstrip().startswith("%")]
    size = [int(word) for word in lines[0].split()] if lines else []
    if len(size) != (2 if layout == "array" else 3) or min(size) < 0 or (symmetry != "general" and size[0] != size[1]):
        raise ValueError(f"the size is {size}; expected rows and columns, of a sparse matrix also entries")
    numbers = np.array(" ".join(lines[1:]).split(), dtype=float)
    read = _dense if layout == "array" else _sparse
    if field != "complex":
        return read(numbers, size, symmetry != "general")
    width = 2 if layout == "array" else 4
    if numbers.size % width:
        raise ValueError(f"{numbers.size} numbers; expected a real and an imaginary part of each value")
    entries = numbers.reshape(-1, width)
    real, imaginary = (np.delete(entries, column, axis=1).ravel() for column in (-1, -2))
    return read(real, size, symmetry != "general") + 1j * read(imaginary, size, symmetry != "general")


def _dense(numbers: NDArray[np.float64], size: list[int], is_symmetric: bool) -> Matrix:
    """A dense matrix from its columns; those of a symmetric matrix begin at the diagonal."""
    n_rows, n_columns = size
    count = n_rows * (n_rows + 1) // 2 if is_symmetric else n_rows * n_columns
    if numbers.size != count:
        raise ValueError(f"{numbers.size} numbers; expected {count}")
    if not is_symmetric:
        return numbers.reshape(n_columns, n_rows).T
    matrix = np.zeros((n_rows, n_rows))
    columns, rows = np.triu_indices(n_rows)
    matrix[rows, columns] = matrix[columns, rows] = numbers
    return matrix


def _sparse(numbers: NDArray[np.float64], size: list[int], is_symmetric: bool) -> Matrix:
    """A sparse matrix from rows, columns (from 1) and values; a symmetric matrix has one side only."""
    *shape, count = size
    if numbers.size != 3 * count:
        raise ValueError(f"{numbers.size} numbers; expected {count} times row, column and value")
    places, values = numbers.reshape(count, 3)[:, :2] - 1, numbers[2::3]
    if ((places < 0) | (places >= shape) | (places % 1 != 0)).any():
        raise ValueError(f"rows or columns outside 1 to {shape}")
    rows, columns = places.astype(np.int64).T
    if is_symmetric:
        if (rows < columns).any() and (rows > columns).any():
            raise ValueError("a symmetric matrix has entries on both sides of its diagonal; expected one")
        beside = rows != columns
        rows, columns, values = (
            np.concatenate([rows, columns[beside]]),
            np.concatenate([columns, rows[beside]]),
            np.concatenate([values, values[beside]]),
        )
    return scipy.sparse.csc_array((values, (rows, columns)), shape=tuple(shape))
