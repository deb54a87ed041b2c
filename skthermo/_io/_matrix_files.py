"""Named matrices from the files that other programs write."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse

from skthermo._io._damaged import read_files, read_matlab
from skthermo._tables.arrays import Matrix

HALVES = dict.fromkeys((".sti", ".mas", ".txk", ".txm"), "lines of row, column and value")
FORMS = {".mtx": "Matrix Market", ".npz": "a sparse matrix of scipy.sparse.save_npz"} | HALVES
FORMATS = f"a MATLAB v5 file (.mat), a NumPy file (.npz) or a folder of files {', '.join(FORMS)}"


def read_named_matrices(path: Path, is_used: Callable[[str], bool]) -> dict[str, Matrix | None]:
    """Matrices by name, in the file's order; None for what is not a matrix of numbers.

    Values may be complex or not finite. Of a folder, only files whose stem is used are read, the others are None.
    """
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; expected {FORMATS}")
    if path.is_dir():
        return _read_folder(path, is_used)
    if path.suffix.lower() not in (".mat", ".npz"):
        raise ValueError(f"{path} is none of these: {FORMATS}")
    values = read_matlab(path) if path.suffix.lower() == ".mat" else read_files([(path, ".npz")])[0]
    return {name: value if _is_matrix(value) else None for name, value in values.items()}


def _is_matrix(value: object) -> bool:
    return scipy.sparse.issparse(value) or (isinstance(value, np.ndarray) and value.ndim == 2)


def _read_folder(folder: Path, is_used: Callable[[str], bool]) -> dict[str, Matrix | None]:
    """One matrix for each file, in the order of their names, E_2 before E_10.

    Files that state no size are taken to be of the largest of their sizes: the last rows of a mass may be zero.
    """
    found = [file for file in folder.iterdir() if file.suffix.lower() in FORMS]
    files = sorted(found, key=lambda file: [int(s) if s.isdecimal() else s for s in re.split(r"(\d+)", file.name)])
    if not files:
        raise ValueError(f"{folder} holds no matrix; expected {FORMATS}")
    used: dict[str, Path] = {}
    for file in filter(lambda file: is_used(file.stem), files):
        if file.stem in used:
            both = f"{used[file.stem].suffix.lower()} and as {file.suffix.lower()}"
            raise ValueError(f"{folder} holds {file.stem!r} as {both}; expected one of them, or another name for one")
        used[file.stem] = file
    read = read_files([(file, FORMS[file.suffix.lower()]) for file in used.values()]) if used else []
    matrices = dict.fromkeys(file.stem for file in files) | dict(zip(used, read, strict=True))
    halves: list[Any] = [matrices[name] for name, file in used.items() if file.suffix.lower() in HALVES]
    for half in halves:
        half.resize([max(matrix.shape[0] for matrix in halves)] * 2)
    return matrices
