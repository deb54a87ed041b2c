"""Files that may be damaged: SciPy reads them in a child process, with limits of memory and time.

SciPy's readers follow the lengths that a file states; where these are damaged they can end the interpreter, or take
all memory."""

import json
import os
import pickle
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import scipy.sparse

from skthermo._io._child import read
from skthermo._tables.arrays import Matrix

CHILD = Path(__file__).with_name("_child.py")
LEAST_MEMORY = 256_000_000
TIMES_THE_FILE = 10
EXPECTED = "ten times the size of the file or 256 MB (a sound file can be saved without compression)"
SECONDS, BYTES_A_SECOND = 60, 1_000_000


def read_matlab(file: Path) -> dict[str, Any]:
    """Every variable of a MATLAB v5 file, or of the only one in a zip file.

    Numbers become arrays of floats or complex numbers with all their dimensions, or sparse matrices; texts a list of
    one text for each row; cell arrays a list of their values, the first dimension running fastest; structs a mapping
    of their fields, and arrays of structs a list of such mappings. Anything else becomes None.
    """
    return read_files([(file, "MATLAB v5")])[0]


def read_half(file: Path) -> Any:
    """A symmetric matrix from lines of row, column and value for each entry of a half."""
    return read_files([(file, "lines of row, column and value")])[0]


def read_files(files: Sequence[tuple[Path, str]]) -> list[Any]:
    """What files hold; each comes with its form, one of the child's ``READERS``."""
    size = sum(file.stat().st_size for file, _ in files)
    most_memory = max(TIMES_THE_FILE * size, LEAST_MEMORY)
    job = {"files": [(str(file), form) for file, form in files], "most_memory": most_memory}
    results = []
    with tempfile.TemporaryFile() as output:
        end = _run(json.dumps(job), output, SECONDS + size / BYTES_A_SECOND)
        output.seek(0)
        for file, form in files:
            try:
                result = pickle.load(output)
            except (EOFError, pickle.UnpicklingError):
                result = ValueError(f"reading it {end}")
            if isinstance(result, MemoryError):
                result = f"it would take more than {most_memory / 1e6:.0f} MB of memory; expected at most {EXPECTED}"
            if isinstance(result, ValueError | str):
                raise ValueError(f"{file}: not readable as {form} ({result})")
            results.append(result)
    return results


def _run(job: str, output: IO[bytes], seconds: float) -> str:
    """Run the child; how it ended."""
    name = Path(sys.executable or "").name.lower()
    if getattr(sys, "frozen", False) or not name.startswith(("python", "pypy")):  # a program that embeds Python
        for file, form in json.loads(job)["files"]:
            pickle.dump(read(file, form), output)
        return "failed"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command, pipe = [sys.executable, "-P", str(CHILD)], subprocess.PIPE
    try:
        done = subprocess.run(
            command, input=job.encode(), env=environment, timeout=seconds, check=False, stdout=output, stderr=pipe
        )
    except subprocess.TimeoutExpired:
        return f"took more than {seconds:.0f} s"
    return f"ended the process with exit code {done.returncode} {done.stderr[-300:].decode(errors='replace')}".strip()


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
