"""Named matrices from the files that other programs write."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse

from skthermo._arrays import Matrix
from skthermo._io._matlab import read_matlab
from skthermo._io._matrix_market import read_matrix_market
from skthermo._io._memory_limit import MemoryLimit
from skthermo._io._npz import read_npz, read_sparse_npz
from skthermo._io._triplets import HALF_SUFFIXES, read_half

READERS = {".mtx": read_matrix_market, ".npz": read_sparse_npz} | dict.fromkeys(HALF_SUFFIXES, read_half)
FORMATS = f"a MATLAB v5 file (.mat), a NumPy file (.npz) or a folder of files {', '.join(READERS)}"


def read_named_matrices(path: Path, is_used: Callable[[str], bool]) -> dict[str, Matrix | None]:
    """Matrices by name, in the file's order; None for what is not a matrix of numbers.

    Values may be complex or not finite. Of a folder, only files whose stem is used are read, the others are None.

    Raises
    ------
    FileNotFoundError
        If there is nothing at the path.
    ValueError
        Names the file, and the variable where it is known, that is damaged.
    """
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; expected {FORMATS}")
    if path.is_dir():
        matrices = _read_folder(path, is_used)
    elif path.suffix.lower() == ".mat":
        matrices = read_matlab(path, complex_too=True)
    elif path.suffix.lower() == ".npz":
        arrays = read_npz(path, MemoryLimit(path.stat().st_size))
        matrices = {name: _matrix(array) for name, array in arrays.items()}
    else:
        raise ValueError(f"{path} is none of these: {FORMATS}")
    return {name: _real_if_exact(matrix) for name, matrix in matrices.items()}


def _read_folder(folder: Path, is_used: Callable[[str], bool]) -> dict[str, Matrix | None]:
    """One matrix for each file, in the order of their names, E_2 before E_10.

    Files that state no size are taken to be of the largest of their sizes: the last rows of a mass may be zero.
    """
    found = [file for file in folder.iterdir() if file.suffix.lower() in READERS]
    files = sorted(found, key=lambda file: [int(s) if s.isdecimal() else s for s in re.split(r"(\d+)", file.name)])
    limit = MemoryLimit(sum(file.stat().st_size for file in files if is_used(file.stem)))
    matrices: dict[str, Matrix | None] = {}
    suffixes: dict[str, str] = {}
    for file in files:
        if not is_used(file.stem):
            matrices[file.stem] = None
            continue
        suffix = file.suffix.lower()
        if file.stem in suffixes:
            both = f"{suffixes[file.stem]} and as {suffix}"
            raise ValueError(f"{folder} holds {file.stem!r} as {both}; expected one of them, or another name for one")
        suffixes[file.stem] = suffix
        matrices[file.stem] = _matrix(READERS[suffix](file, limit))
    if not matrices:
        raise ValueError(f"{folder} holds no matrix; expected {FORMATS}")
    halves: list[Any] = [matrices[name] for name, suffix in suffixes.items() if suffix in HALF_SUFFIXES]
    for half in halves:
        half.resize([max(matrix.shape[0] for matrix in halves)] * 2)
    return matrices


def _matrix(matrix) -> Matrix | None:
    if matrix.ndim != 2 or matrix.dtype.kind not in "fiubc":
        return None
    dtype = complex if matrix.dtype.kind == "c" else float
    if scipy.sparse.issparse(matrix):
        return scipy.sparse.csc_array(matrix, dtype=dtype)
    return matrix.astype(dtype, copy=False)


def _real_if_exact(matrix: Matrix | None) -> Matrix | None:
    """The real part, where the imaginary part is zero."""
    if matrix is None or not np.iscomplexobj(matrix):
        return matrix
    values = np.asarray(matrix.data if scipy.sparse.issparse(matrix) else matrix)
    return matrix if values.imag.any() else matrix.real
