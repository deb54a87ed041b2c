"""Files that may be damaged: a child process reads them, with limits of memory and time.

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
from typing import IO, Any, NamedTuple

import numpy as np
import scipy.sparse

from skthermo._core.arrays import Label, Matrix
from skthermo._core.text_matrices import OP4_HEADING, Labelled


def read_matlab(file: Path) -> dict[str, Any]:
    """Every variable of a MATLAB v5 file, or of the only one in a zip file.

    Numbers become arrays of floats or complex numbers with all their dimensions, or sparse matrices; texts a list of
    one text for each row; cell arrays a list of their values, the first dimension running fastest; structs a mapping
    of their fields, and arrays of structs a list of such mappings. Anything else becomes None.
    """
    return read_files([(file, "MATLAB v5")])[0]


def read_half(file: Path) -> Any:
    """A symmetric matrix from lines of row, column and value for each entry of a half."""
    matrix = read_files([(file, "lines of entries")])[0]
    if isinstance(matrix, Labelled):
        raise ValueError(f"{file} holds labels of nodes; expected row, column and value in each line, or load_affine")
    return matrix


def read_files(files: Sequence[tuple[Path, str]]) -> list[Any]:
    """What files hold; each comes with its form, one of the child's ``READERS``."""
    size = sum(file.stat().st_size for file, _ in files)
    most_memory = max(10 * size, 256_000_000)
    job = {"files": [(str(file), form) for file, form in files], "most_memory": most_memory}
    results = []
    with tempfile.TemporaryFile() as output:
        end = _run(json.dumps(job), output, 60 + size / 1_000_000)
        output.seek(0)
        for file, form in files:
            try:
                result = pickle.load(output)
            except (EOFError, pickle.UnpicklingError):
                result = ValueError(f"reading it {end}")
            if isinstance(result, MemoryError):
                result = (
                    f"it would take more than {most_memory / 1e6:.0f} MB of memory; expected at most ten times the "
                    "size of the file or 256 MB (a sound file can be saved without compression)"
                )
            if isinstance(result, ValueError | str):
                raise ValueError(f"{file}: not readable as {form} ({result})")
            results.append(result)
    return results


def _run(job: str, output: IO[bytes], seconds: float) -> str:
    """Run the child; how it ended."""
    name = Path(sys.executable or "").name.lower()
    if getattr(sys, "frozen", False) or not name.startswith(("python", "pypy")):  # a program that embeds Python
        from skthermo._core.matrix_child import read  # with SciPy's readers, which only the child needs otherwise

        for file, form in json.loads(job)["files"]:
            pickle.dump(read(file, form), output)
        return "failed"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    child = Path(__file__).with_name("matrix_child.py")
    command, pipe = [sys.executable, "-P", str(child)], subprocess.PIPE
    try:
        done = subprocess.run(
            command, input=job.encode(), env=environment, timeout=seconds, check=False, stdout=output, stderr=pipe
        )
    except subprocess.TimeoutExpired:
        return f"took more than {seconds:.0f} s"
    return f"ended the process with exit code {done.returncode} {done.stderr[-300:].decode(errors='replace')}".strip()


FORMS = {
    "MATLAB v5": rb".{124}(?:\x00\x01IM|\x01\x00MI)|\x89HDF",
    ".npz": rb"PK",
    "Matrix Market": rb"%|(?i:[^\n]*MatrixMarket)",
    "Harwell-Boeing": rb"[^\n]*\n(?:[ \t]*\d+){4,5}[ \t]*\n(?i:[A-Z]{3})(?:[ \t]+\d+){4}[^\n]*\n[^\n]*\(",
    "Nastran's DMIG": rb"(?i:(?:.*\n)?DMIG[ *,])",
    "Nastran's OUTPUT4": OP4_HEADING.pattern + rb"\n|[\x18\x30]\0{3}|\0{3}[\x18\x30]",
    "labels of rows": rb"\s*Matrix Eqn|(?:\s*\d+\.\d\s)+\s*(?:\d+(?:\.\d?)?)?\Z",
    "lines of entries": (
        rb"(?:[ \t]*(?![ \t\d+\-.])[^\n]*\n)*[ \t]*"
        rb"(?:\d+[ \t,]+\d+|-?\d+[ \t]*,[ \t]*\d+[ \t,]+-?\d+[ \t]*,[ \t]*\d+)[ \t,]+"
        rb"[+-]?(?:\d+\.\d*|\.\d+|\d+(?=[EeDd]))(?:[EeDd][+-]?\d+)?[ \t]*(?:\n|\Z)"
    ),
}
"""How files of each of the child's ``READERS`` begin."""

KINDS_BY_SUFFIX = {
    ".sti": "stiffness",
    ".stif": "stiffness",
    ".stiff": "stiffness",
    ".txk": "stiffness",
} | dict.fromkeys((".mas", ".mass", ".txm"), "mass")
SUFFIXES = (
    {".mat": "MATLAB v5", ".npz": ".npz", ".mtx": "lines of entries", ".op4": "Nastran's OUTPUT4"}
    | dict.fromkeys((".pch", ".dmig"), "Nastran's DMIG")
    | dict.fromkeys((".hb", ".rb", ".rsa", ".rua", ".matrix"), "Harwell-Boeing")
    | dict.fromkeys((".dof", ".mapping"), "labels of rows")
    | dict.fromkeys(KINDS_BY_SUFFIX, "lines of entries")
)
"""What a file is expected to be, if it does not begin as any form does."""

FORMATS = (
    "a file of MATLAB v5, NumPy (.npz), Matrix Market, Abaqus (.mtx), CalculiX, SAP2000, Harwell-Boeing (ANSYS) or "
    "Nastran (DMIG, OUTPUT4), or a folder of such files"
)
MASS_OF = " (mass)"  # after the name of an export whose stiffness has that name


class NamedMatrices(NamedTuple):
    """Matrices by name, None for what is not one of numbers, and the labels of their rows, if there are such."""

    matrices: dict[str, Matrix | None]
    dofs: tuple[Label, ...]


def form_of(file: Path) -> str | None:
    """The form of a file's content or, if it begins as none does, of its name; None if both are unknown."""
    beginning = _beginning(file, 65536)
    text = beginning.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    both = {beginning, text}
    found = (form for form, pattern in FORMS.items() if any(re.match(pattern, one, re.DOTALL) for one in both))
    return next(found, SUFFIXES.get(file.suffix.lower()))


def _beginning(file: Path, n_bytes: int) -> bytes:
    with open(file, "rb") as stream:
        return stream.read(n_bytes)


def read_named_matrices(path: Path, is_used: Callable[[str], bool]) -> NamedMatrices:
    """Matrices by name, in the file's order.

    Values may be complex or not finite. Of a folder, only files whose name is used are read, the others are None.
    """
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; expected {FORMATS}")
    if path.is_dir():
        return _read_folder(path, is_used)
    form = form_of(path) if path.is_file() else None
    if form is None or form == "labels of rows":
        _refuse_binary([path])
        raise ValueError(f"{path} is none of these: {FORMATS}")
    content = read_files([(path, form)])[0]
    return _joined(content if isinstance(content, dict) else {path.stem: content}, path)


def _refuse_binary(files: Sequence[Path]) -> None:
    """Raise an error for the first binary file that another package reads, and say what writes its matrices as text."""
    binary = {
        "a binary file of ANSYS": (rb"\x64\0{3}.{4}[\x02\x04]\0{3}", "HBMAT writes its matrices as text"),
        "an OUTPUT2 file of Nastran": (rb"\x04\0{3}.{4}\x04\0{3}", "DMIGPCH and OUTPUT4 write what can be read"),
    }
    for file in files:
        beginning = _beginning(file, 12) if file.is_file() else b""
        for what, (pattern, instead) in binary.items():
            if re.match(pattern, beginning, re.DOTALL):
                raise ValueError(
                    f"{file} is {what}; expected another file ({instead}), or matrices that you read with another "
                    'package, as the guide shows in "From your FE program"'
                )


def _read_folder(folder: Path, is_used: Callable[[str], bool]) -> NamedMatrices:
    """The matrices of each file, named after it, in the order of these names, E_2 before E_10."""
    forms = {file: form for file in folder.iterdir() if file.is_file() and (form := form_of(file))}
    files = sorted(forms, key=lambda file: [int(s) if s.isdecimal() else s for s in re.split(r"(\d+)", file.name)])
    exports = {file: _export_of(file) for file in files if forms[file] != "labels of rows"}
    stiff = {name for name, kind in exports.values() if kind == "stiffness"}
    named: dict[str, Path] = {}
    for file, (name, kind) in exports.items():
        key = name + MASS_OF if kind == "mass" and name in stiff else name
        if kind == "other":
            continue
        if key in named and is_used(key):
            both = f"{named[key].suffix.lower()} and as {file.suffix.lower()}"
            raise ValueError(f"{folder} holds {key!r} as {both}; expected one of them, or another name for one")
        named[key] = file
    if not named:
        _refuse_binary(sorted(folder.iterdir()))
        raise ValueError(f"{folder} holds no matrix; expected {FORMATS}")
    of_rows = [file for file in files if forms[file] == "labels of rows"]
    used = [name for name in named if is_used(name)]
    contents = read_files([(file, forms[file]) for file in (*(named[name] for name in used), *of_rows)])
    labels = {
        file.stem: rows
        for file, rows in zip(of_rows, contents[len(used) :], strict=True)
        if len(set(rows)) == len(rows)  # of beams and shells, CalculiX writes labels that occur more than once
    }
    matrices: dict[str, Any] = dict.fromkeys(named)
    for name, content in zip(used, contents[: len(used)], strict=True):
        if isinstance(content, dict) and len(named) == 1:
            return _joined(content, folder)
        matrices |= _parts(name, content, named[name]) if isinstance(content, dict) else {name: content}
    of_entries = [matrices[name] for name in used if forms[named[name]] == "lines of entries"]
    unsized = [matrix for matrix in of_entries if not isinstance(matrix, Labelled)]
    for matrix in unsized:  # the last rows of a mass may be zero
        matrix.resize([max(one.shape[0] for one in unsized)] * 2)
    for name, matrix in matrices.items():
        rows = labels.get(name.removesuffix(MASS_OF), next(iter(labels.values())) if len(labels) == 1 else None)
        if rows is not None and scipy.sparse.issparse(matrix) and matrix.shape == (len(rows), len(rows)):
            matrices[name] = Labelled(matrix, rows)
    return _joined(matrices, folder)


def _export_of(file: Path) -> tuple[str, str | None]:
    """Name of an export, and whether a file is its stiffness, its mass or something else, where its name says so."""
    if found := re.fullmatch(r"(?P<name>.+)_(?P<kind>STIF|MASS|DMP[VS]|LOAD)\d*", file.stem, re.IGNORECASE):
        return found["name"], {"STIF": "stiffness", "MASS": "mass"}.get(found["kind"].upper(), "other")
    return file.stem, KINDS_BY_SUFFIX.get(file.suffix.lower())


def _parts(name: str, content: dict[str, Any], file: Path) -> dict[str, Any]:
    """The stiffness of a file of several matrices, which has its name, and the mass."""
    square = {key: one for key, one in content.items() if _is_square(one)}
    if len(square) == 1:
        return {name: next(iter(square.values()))}
    by_letter = {letter: [key for key in square if key.lower().startswith(letter)] for letter in "km"}
    if len(by_letter["k"]) != 1 or len(by_letter["m"]) > 1:
        raise ValueError(f"{file} holds {list(content)}; expected one stiffness K... and at most one mass M...")
    masses = {name + MASS_OF: square[by_letter["m"][0]]} if by_letter["m"] else {}
    return {name: square[by_letter["k"][0]]} | masses


def _is_square(value: object) -> bool:
    matrix: Any = value.matrix if isinstance(value, Labelled) else value
    return _is_matrix(matrix) and matrix.shape[0] == matrix.shape[1]


def _is_matrix(value: object) -> bool:
    return scipy.sparse.issparse(value) or (isinstance(value, np.ndarray) and value.ndim == 2)


def _joined(named: dict[str, Any], path: Path) -> NamedMatrices:
    """Matrices on the union of their labels, if they have such, and without degrees of freedom that are held."""
    dofs: tuple[Label, ...] = ()
    labelled = {name: one for name, one in named.items() if isinstance(one, Labelled)}
    if labelled:
        plain = [name for name, one in named.items() if name not in labelled and _is_square(one)]
        if plain:
            raise ValueError(
                f"{path}: the rows of {next(iter(labelled))!r} have labels of nodes, and those of {plain[0]!r} have "
                "none; expected labels for all or none"
            )
        labels = {
            name: [tuple(dof) for dof in np.asarray(one.dofs, dtype=object).tolist()] for name, one in labelled.items()
        }
        dofs = tuple(dict.fromkeys(dof for rows in labels.values() for dof in rows))
        if all(isinstance(part, int) for dof in dofs for part in dof):
            dofs = tuple(sorted(dofs))
        places = {dof: i for i, dof in enumerate(dofs)}
        for name, one in labelled.items():
            at = np.array([places[dof] for dof in labels[name]])
            entries = one.matrix.tocoo()
            coordinates = at[entries.row], at[entries.col]
            named[name] = scipy.sparse.coo_array((entries.data, coordinates), shape=(len(dofs),) * 2).tocsc()
    matrices = {name: value if _is_matrix(value) else None for name, value in named.items()}
    diagonals = [
        m.diagonal() for m in matrices.values() if m is not None and scipy.sparse.issparse(m) and _is_square(m)
    ]
    held = 1e36  # what Abaqus puts on the diagonal where a degree of freedom is held
    if any((diagonal == held).any() for diagonal in diagonals) and len({len(d) for d in diagonals}) == 1:
        free = np.flatnonzero((np.array(diagonals) != held).all(axis=0))
        matrices = {name: m[free][:, free] if _is_square(m) else m for name, m in matrices.items()}  # type: ignore[index]
        dofs = tuple(dofs[i] for i in free) if dofs else ()
    return NamedMatrices(matrices, dofs)
