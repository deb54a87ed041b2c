"""Files and folders of matrices: their forms, the names of matrices, and the labels of rows."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse

from skthermo._core.arrays import Label, Matrix
from skthermo._core.matlab import matlab_variables
from skthermo.fem.external._texts import (
    OP4_HEADING,
    Labelled,
    check_size,
    read_dmig,
    read_dofs,
    read_entries,
    read_harwell_boeing,
    read_op4,
)

MASS_OF = " (mass)"  # after the name of an export whose stiffness has that name
FORMATS = (
    "a file of MATLAB v5, NumPy (.npz), Matrix Market, Abaqus (.mtx), CalculiX, SAP2000, Harwell-Boeing (ANSYS) or "
    "Nastran (DMIG, OUTPUT4), or a folder of such files"
)


def read_zip(content: bytes) -> Any:
    """A sparse matrix of `scipy.sparse.save_npz`, arrays of NumPy by name, or the variables of a MATLAB file."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = archive.namelist()
        if any(name.lower().endswith(".mat") for name in names):
            return matlab_variables(content)
        if damaged := archive.testzip():
            raise ValueError(f"member {damaged!r} is damaged")
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        if {"format.npy", "shape.npy"} <= {*names}:
            check_size(max(arrays["shape"]), arrays["data"].size)
            return _numbers(scipy.sparse.load_npz(io.BytesIO(content)))
        return {name: _array(arrays, name) for name in arrays.files}


def _array(arrays: Any, name: str) -> Any:
    """An array of numbers; None for one of other things."""
    try:
        array = arrays[name]
        return _numbers(array) if isinstance(array, np.ndarray) else None
    except (ValueError, EOFError, MemoryError) as error:
        if "allow_pickle" in str(error):  # an array of objects
            return None
        raise ValueError(f"variable {name!r}: {error}") from error


def _numbers(value: Any) -> Any:
    """Floats, or complex numbers if an imaginary part is not zero, sparse ones by columns; None for other things."""
    if value.dtype.kind not in "fiubc":
        return None
    if scipy.sparse.issparse(value):
        if value.format in ("csr", "csc", "bsr"):
            value.check_format(full_check=True)
        value = scipy.sparse.csc_array(value)
    value = value.astype(complex if value.dtype.kind == "c" else float, copy=False)
    imaginary = np.asarray(value.data if scipy.sparse.issparse(value) else value).imag
    return value if value.dtype == float or imaginary.any() else value.real


def read_matrix_market(content: bytes) -> Any:
    """A matrix, read by SciPy, which notices neither exponents such as D+03 nor entries on both sides of a diagonal."""
    from scipy.io import mminfo, mmread  # imported here because only users of Matrix Market need it

    n_rows, n_columns, n_entries, layout, field, symmetry = mminfo(io.BytesIO(content))
    if field == "pattern" or (symmetry != "general" and n_rows != n_columns):
        raise ValueError(f"{n_rows} x {n_columns}, {field}, {symmetry}; expected numbers, and a square if symmetric")
    if n_entries > len(content):
        raise ValueError(f"{n_entries:,} entries in {len(content):,} bytes; the file seems to be damaged or cut off")
    start = re.match(rb"(?:[ \t\r]*(?:%.*)?\n)*.*(?:\n|\Z)", content).end()  # type: ignore[union-attr]
    body = content[start:]
    if b"%" in body:  # comments, which SciPy reads in the heading only
        body = re.sub(rb"^[ \t]*%.*$", b"", body, flags=re.MULTILINE)
    if body.translate(None, b"0123456789+-.eE \t\r\nnaifNAIF"):
        wrong = re.search(rb"\S*[^\d+\-.eE\snaifNAIF]\S*", body)
        line = content.count(b"\n", 0, start) + body.count(b"\n", 0, wrong.start()) + 1  # type: ignore[union-attr]
        raise ValueError(f"line {line}: {wrong[0][:30].decode('latin-1')!r} is not a number")  # type: ignore[index]
    if layout == "coordinate":
        check_size(max(n_rows, n_columns), n_entries)
    matrix = mmread(io.BytesIO(content[:start] + body), spmatrix=False)
    numbers = _numbers(matrix)
    if symmetry != "general" and layout == "coordinate" and numbers.nnz < matrix.nnz:
        raise ValueError("entries of a symmetric matrix are given twice or on both sides of its diagonal; expected one")
    return numbers


READERS: dict[str, tuple[Callable[[bytes], Any], bytes]] = {
    "MATLAB v5": (matlab_variables, rb".{124}(?:\x00\x01IM|\x01\x00MI)|\x89HDF"),
    ".npz": (read_zip, rb"PK"),
    "Matrix Market": (read_matrix_market, rb"%|(?i:[^\n]*MatrixMarket)"),
    "Harwell-Boeing": (
        read_harwell_boeing,
        rb"[^\n]*\n(?:[ \t]*\d+){4,5}[ \t]*\n(?i:[A-Z]{3})(?:[ \t]+\d+){4}[^\n]*\n[^\n]*\(",
    ),
    "Nastran's DMIG": (read_dmig, rb"(?i:(?:.*\n)?DMIG[ *,])"),
    "Nastran's OUTPUT4": (read_op4, OP4_HEADING.pattern + rb"\n|[\x18\x30]\0{3}|\0{3}[\x18\x30]"),
    "labels of rows": (read_dofs, rb"\s*Matrix Eqn|(?:\s*\d+\.\d\s)+\s*(?:\d+(?:\.\d?)?)?\Z"),
    "lines of entries": (
        read_entries,
        rb"(?:[ \t]*(?![ \t\d+\-.])[^\n]*\n)*[ \t]*"
        rb"(?:\d+[ \t,]+\d+|-?\d+[ \t]*,[ \t]*\d+[ \t,]+-?\d+[ \t]*,[ \t]*\d+)[ \t,]+"
        rb"[+-]?(?:\d+\.\d*|\.\d+|\d+(?=[EeDd]))(?:[EeDd][+-]?\d+)?[ \t]*(?:\n|\Z)",
    ),
}
"""The reader of each form, and how its files begin."""

KINDS_BY_SUFFIX = dict.fromkeys((".sti", ".stif", ".stiff", ".txk"), "stiffness") | dict.fromkeys(
    (".mas", ".mass", ".txm"), "mass"
)
SUFFIXES = (
    {".mat": "MATLAB v5", ".npz": ".npz", ".mtx": "lines of entries", ".op4": "Nastran's OUTPUT4"}
    | dict.fromkeys((".pch", ".dmig"), "Nastran's DMIG")
    | dict.fromkeys((".hb", ".rb", ".rsa", ".rua", ".matrix"), "Harwell-Boeing")
    | dict.fromkeys((".dof", ".mapping"), "labels of rows")
    | dict.fromkeys(KINDS_BY_SUFFIX, "lines of entries")
)
"""The form of a file that does not begin as any form does."""


class NamedMatrices(NamedTuple):
    """Matrices by name, None for what is not one of numbers, and the labels of their rows, if there are such."""

    matrices: dict[str, Matrix | None]
    dofs: tuple[Label, ...]


def form_of(file: Path) -> str | None:
    """The form of a file's content or, if it begins as none does, of its name; None if both are unknown."""
    beginning = _beginning(file, 65536)
    both = {beginning, beginning.replace(b"\r\n", b"\n").replace(b"\r", b"\n")}
    found = (form for form, (_, start) in READERS.items() if any(re.match(start, one, re.DOTALL) for one in both))
    return next(found, SUFFIXES.get(file.suffix.lower()))


def _beginning(file: Path, n_bytes: int) -> bytes:
    with open(file, "rb") as stream:
        return stream.read(n_bytes)


def read_file(file: Path, form: str) -> Any:
    """What a file of a known form holds; an error names the file, and where it is damaged."""
    try:
        return READERS[form][0](file.read_bytes())
    except Exception as error:  # readers of damaged files raise errors of every type
        raise ValueError(f"{file}: not readable as {form} ({error or repr(error)})") from error


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
    content = read_file(path, form)
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
    named = _named_files([file for file in files if forms[file] != "labels of rows"], is_used)
    if not named:
        _refuse_binary(sorted(folder.iterdir()))
        raise ValueError(f"{folder} holds no matrix; expected {FORMATS}")
    matrices: dict[str, Any] = dict.fromkeys(named)
    for name in filter(is_used, named):
        content = read_file(named[name], forms[named[name]])
        if isinstance(content, dict) and len(named) == 1:
            return _joined(content, folder)
        matrices |= _parts(name, content, named[name]) if isinstance(content, dict) else {name: content}
    entries = [matrices[name] for name, file in named.items() if forms[file] == "lines of entries"]
    unsized = [matrix for matrix in entries if scipy.sparse.issparse(matrix)]
    for matrix in unsized:  # the last rows of a mass may be zero
        matrix.resize([max(one.shape[0] for one in unsized)] * 2)
    return _joined(_with_labels(matrices, [file for file in files if forms[file] == "labels of rows"]), folder)


def _named_files(files: Sequence[Path], is_used: Callable[[str], bool]) -> dict[str, Path]:
    """The file of each matrix; a mass has another name than the stiffness of its job."""
    exports = {file: _export_of(file) for file in files}
    stiff = {name for name, kind in exports.values() if kind == "stiffness"}
    named: dict[str, Path] = {}
    for file, (name, kind) in exports.items():
        key = name + MASS_OF if kind == "mass" and name in stiff else name
        if kind == "other":
            continue
        if key in named and is_used(key):
            both = f"{named[key].suffix.lower()} and as {file.suffix.lower()}"
            raise ValueError(f"{file.parent} holds {key!r} as {both}; expected one of them, or another name for one")
        named[key] = file
    return named


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
    stiff, masses = ([key for key in square if key.lower().startswith(letter)] for letter in "km")
    if len(stiff) != 1 or len(masses) > 1:
        raise ValueError(f"{file} holds {list(content)}; expected one stiffness K... and at most one mass M...")
    return {name: square[stiff[0]]} | ({name + MASS_OF: square[masses[0]]} if masses else {})


def _with_labels(matrices: dict[str, Any], files: Sequence[Path]) -> dict[str, Any]:
    """Matrices with the labels of the file of their name, or of the only file of labels."""
    labels = {file.stem: read_file(file, "labels of rows") for file in files}
    # CalculiX writes labels that occur more than once for beams and shells
    labels = {name: rows for name, rows in labels.items() if len(set(rows)) == len(rows)}
    only = next(iter(labels.values())) if len(labels) == 1 else None
    for name, matrix in matrices.items():
        rows = labels.get(name.removesuffix(MASS_OF), only)
        if rows is not None and scipy.sparse.issparse(matrix) and matrix.shape == (len(rows), len(rows)):
            matrices[name] = Labelled(matrix, rows)
    return matrices


def _is_square(value: object) -> bool:
    matrix: Any = value.matrix if isinstance(value, Labelled) else value
    return _is_matrix(matrix) and matrix.shape[0] == matrix.shape[1]


def _is_matrix(value: object) -> bool:
    return scipy.sparse.issparse(value) or (isinstance(value, np.ndarray) and value.ndim == 2)


def _joined(named: dict[str, Any], path: Path) -> NamedMatrices:
    """Matrices on the union of their labels, if they have such, and without degrees of freedom that are held."""
    named, dofs = _on_all_labels(named, path)
    matrices = {name: value if _is_matrix(value) else None for name, value in named.items()}
    square = [one for one in matrices.values() if one is not None and _is_square(one)]
    diagonals = [one.diagonal() for one in square if scipy.sparse.issparse(one)]
    held = 1e36  # what Abaqus puts on the diagonal where a degree of freedom is held
    if any((diagonal == held).any() for diagonal in diagonals) and len({len(d) for d in diagonals}) == 1:
        free = np.flatnonzero((np.array(diagonals) != held).all(axis=0))
        matrices = {name: m[free][:, free] if _is_square(m) else m for name, m in matrices.items()}  # type: ignore[index]
        dofs = tuple(dofs[i] for i in free) if dofs else ()
    return NamedMatrices(matrices, dofs)


def _on_all_labels(named: dict[str, Any], path: Path) -> tuple[dict[str, Any], tuple[Label, ...]]:
    """Labelled matrices with a row for each label that any of them has, in the order of the labels."""
    labelled = {name: one for name, one in named.items() if isinstance(one, Labelled)}
    plain = [name for name, one in named.items() if name not in labelled and _is_square(one)]
    if labelled and plain:
        raise ValueError(
            f"{path}: the rows of {next(iter(labelled))!r} have labels of nodes, and those of {plain[0]!r} have none; "
            "expected labels for all or none"
        )
    labels = {name: list(map(tuple, np.asarray(one.dofs, dtype=object).tolist())) for name, one in labelled.items()}
    dofs = tuple(dict.fromkeys(dof for rows in labels.values() for dof in rows))
    if all(isinstance(part, int) for dof in dofs for part in dof):
        dofs = tuple(sorted(dofs))
    places = {dof: i for i, dof in enumerate(dofs)}
    for name, (matrix, _) in labelled.items():
        at = np.array([places[dof] for dof in labels[name]])
        entries = matrix.tocoo()
        named[name] = scipy.sparse.csc_array((entries.data, (at[entries.row], at[entries.col])), shape=(len(dofs),) * 2)
    return named, dofs
