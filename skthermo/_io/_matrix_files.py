"""Named matrices from the files that other programs write."""

import io
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._arrays import Matrix
from skthermo._io._matlab import read_matlab
from skthermo._io._matrix_market import read_matrix_market

FORMATS = "a MATLAB v5 file (.mat), a NumPy file (.npz) or a folder of .mtx and .npz files"


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
        matrices = {name: _matrix(array) for name, array in _read_npz(path).items()}
    else:
        raise ValueError(f"{path} is none of these: {FORMATS}")
    return {name: _real_if_exact(matrix) for name, matrix in matrices.items()}


def _read_folder(folder: Path, is_used: Callable[[str], bool]) -> dict[str, Matrix | None]:
    """One matrix for each file, in the order of their names, E_2 before E_10."""
    files = [file for file in folder.iterdir() if file.suffix.lower() in (".mtx", ".npz")]
    matrices: dict[str, Matrix | None] = {}
    for file in sorted(files, key=lambda file: [int(s) if s.isdigit() else s for s in re.split(r"(\d+)", file.name)]):
        if not is_used(file.stem):
            matrices[file.stem] = None
            continue
        if file.stem in matrices:
            raise ValueError(f"{folder} holds {file.stem!r} as .mtx and as .npz; expected one of them")
        is_text = file.suffix.lower() == ".mtx"
        matrices[file.stem] = read_matrix_market(file) if is_text else _read_sparse_npz(file)
    if not matrices:
        raise ValueError(f"{folder} holds no matrix; expected {FORMATS}")
    return matrices


def _read_sparse_npz(file: Path) -> Matrix | None:
    _read_npz(file)
    try:
        matrix = scipy.sparse.load_npz(file)
        if matrix.format in ("csr", "csc", "bsr"):
            matrix.check_format(full_check=True)
    except Exception as error:  # a damaged file can fail in every way
        raise ValueError(f"{file}: not a sparse matrix of scipy.sparse.save_npz ({error})") from error
    return _matrix(matrix)


def _read_npz(file: Path) -> dict[str, NDArray]:
    """Arrays whose checksums are right."""
    variable = ""
    try:
        arrays = {}
        with zipfile.ZipFile(file) as archive:
            for member in archive.namelist():
                name = member.removesuffix(".npy")
                variable = f"variable {name!r} is "
                content = archive.read(member)
                is_object = b"'descr': '|O'" in content[:64]  # which only pickle reads
                arrays[name] = np.empty(0) if is_object else np.lib.format.read_array(io.BytesIO(content))
    except Exception as error:  # a damaged file can fail in every way
        raise ValueError(f"{file}: {variable}not readable as .npz ({error})") from error
    return arrays


def _matrix(matrix) -> Matrix | None:
    if matrix.ndim != 2 or matrix.dtype.kind not in "fiubc":
        return None
    dtype = complex if matrix.dtype.kind == "c" else float
    return scipy.sparse.csc_array(matrix, dtype=dtype) if scipy.sparse.issparse(matrix) else matrix.astype(dtype)


def _real_if_exact(matrix: Matrix | None) -> Matrix | None:
    """The real part, where the imaginary part is zero."""
    if matrix is None or not np.iscomplexobj(matrix):
        return matrix
    values = np.asarray(matrix.data if scipy.sparse.issparse(matrix) else matrix)
    return matrix if values.imag.any() else matrix.real
