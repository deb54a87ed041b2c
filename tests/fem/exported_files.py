"""Files as other programs export them, for tests of their loader."""

import re

import numpy as np
import scipy.io
import scipy.sparse

from skthermo.fem import AffineModel

N = 6


def spring(i, j, k):
    """A spring between two masses of a row, or (i = j) to the ground."""
    matrix = np.zeros((N, N))
    matrix[i, i] += k
    if i != j:
        matrix[j, j] += k
        matrix[i, j] = matrix[j, i] = -k
    return matrix


TERMS = {
    "E_2": sum(spring(i, i + 1, 1000.0 * (i + 1)) for i in range(3)),
    "E_10": sum(spring(i, i + 1, 3000.0) for i in range(2, 5)),
    "k_base": spring(0, 0, 1500.5) + spring(5, 5, 1 / 3),
}
TOTAL = sum(TERMS.values())
M = np.diag([1.0, 2.0, 0.0, 1.5, 0.0, 1.0])
MATRICES = {"K0": TOTAL} | TERMS | {"M0": M}
RNG = np.random.default_rng(0)


def write_mat(folder, matrices, *, sparse=False, compressed=True):
    form = scipy.sparse.csc_array if sparse else np.asarray
    fields = {name: form(m) if np.shape(m) == (N, N) else m for name, m in matrices.items()}
    scipy.io.savemat(folder / "model.mat", fields, do_compression=compressed)
    return folder / "model.mat"


def write_npz(folder, matrices):
    np.savez(folder / "model.npz", **matrices)
    return folder / "model.npz"


def write_mtx(folder, matrices, *, sparse=False):
    for name, matrix in matrices.items():
        scipy.io.mmwrite(folder / f"{name}.mtx", scipy.sparse.coo_array(matrix) if sparse else np.asarray(matrix))
    return folder


def write_folder_of_npz(folder, matrices):
    for i, (name, matrix) in enumerate(matrices.items()):
        form = [scipy.sparse.csr_array, scipy.sparse.coo_array, scipy.sparse.bsr_array][i % 3]
        scipy.sparse.save_npz(folder / f"{name}.npz", form(matrix))
    return folder


DOFS = [(3, 1), (3, 2), (12, 1), (12, 3), (40, 2), (41, 1)]
"""What FE programs call the rows, node and direction, in ascending order."""


def halved(matrix, half):
    """The lower or upper half of a matrix, or both."""
    return {"lower": np.tril, "upper": np.triu, "both": np.asarray}[half](matrix)


def entries_of(matrix, half, *, zeros=False, seed=None):
    """Rows, columns and values, with or without zeros, in the order of rows or a random one."""
    shown = np.ones_like(matrix, dtype=bool) if zeros else matrix != 0
    rows, columns = np.nonzero(halved(shown, half))
    order = np.arange(len(rows)) if seed is None else np.random.default_rng(seed).permutation(len(rows))
    return rows[order], columns[order], matrix[rows[order], columns[order]]


def coordinates_text(matrix, dofs=None, *, half="lower", **options):
    """As Abaqus writes with FORMAT=COORDINATE, and CalculiX and SAP2000 one half of it."""
    entries = zip(*entries_of(matrix, half, **options), strict=True)
    return "".join(f"{i + 1:6d} {j + 1:6d}  {value: .15e}\n" for i, j, value in entries)


def matrix_input_text(matrix, dofs, *, half="lower", comment="", **options):
    """As Abaqus writes with FORMAT=MATRIX INPUT: node and direction of row and column."""
    labels = [f"{node},{direction}" for node, direction in dofs]
    entries = zip(*entries_of(matrix, half, **options), strict=True)
    return comment + "".join(f"{labels[i]}, {labels[j]},  {value:.15e}\n" for i, j, value in entries)


def fortran(value, digits, letter="E"):
    """A number as Fortran writes with 1P."""
    return f"{value:.{digits}e}".replace("e", letter)


def in_lines(words, width, n):
    words = [word.rjust(width) for word in words]
    return ["".join(words[i : i + n]) for i in range(0, len(words), n)]


def harwell_boeing_text(matrix, dofs=None, *, half="lower", sides=False, n=3, digits=16, letter="E", rutherford=False):
    """Columns of one half (RSA) or of both (RUA), n numbers in a line, with a right-hand side at the end if wanted."""
    size = len(matrix)
    columns, rows = np.nonzero(halved(matrix, half).T)
    pointers = np.append(1, 1 + np.cumsum(np.bincount(columns, minlength=size)))
    width = digits + 7 if n > 1 else digits + 10  # fields touch one another where there are several in a line
    values = in_lines([fortran(matrix[i, j], digits, letter) for i, j in zip(rows, columns, strict=True)], width, n)
    blocks = [in_lines(map(str, pointers), 14, n), in_lines(map(str, rows + 1), 14, n), values]
    last = in_lines([fortran(1.0, digits, letter)] * size, width, n) if sides else []
    counts = [len(block) for block in blocks]
    kind = "RUA" if half == "both" else "RSA"
    per_line = n if n > 1 else ""
    head = [
        "Stiffness matrix from a program, in a format of 72 characters".ljust(72) + "KEY",
        "".join(f"{count:14d}" for count in [sum(counts) + len(last), *counts, *([] if rutherford else [len(last)])]),
        (kind.lower() if rutherford else kind).ljust(14) + f"{size:14d}{size:14d}{len(rows):14d}{0:14d}",
        f"({per_line}I14)".ljust(16) * 2 + f"(1P,{per_line}{letter}{width}.{digits})".ljust(20) * 2,
        *([f"F             {1:14d}{0:14d}"] if sides else []),
    ]
    return "\n".join([*head, *(line for block in blocks for line in block), *last]) + "\n"


def nastran_real(value, width):
    """The most digits of a number that fit a field, with a bare exponent if that is shorter."""
    for digits in range(17, 0, -1):
        plain, short = f"{value:.{digits}g}", re.sub(r"e([+-])0*", r"\1", f"{value:.{digits - 1}e}")
        for word in (plain if "." in plain or "e" in plain else plain + ".", short):
            if "e" not in word and len(word) <= width:
                return word
    raise ValueError(value)


def dmig_text(matrix, dofs, *, name="KAAX", half="lower", width=16, form=None, free=False, letter="D", seed=None):
    """DMIG entries in small (8), large (16) or free field; columns in the order of nodes or a random one."""
    form = form or (1 if half == "both" else 6)
    lines = [f"DMIG    {name:8s}{0:8d}{form:8d}{2:8d}{0:8d}{'':16s}{len(matrix):8d}"]
    kept = halved(matrix, half)
    order = range(len(matrix)) if seed is None else np.random.default_rng(seed).permutation(len(matrix))
    for j in order:
        node, direction = dofs[j]
        cells = [(*dofs[i], kept[i, j]) for i in np.flatnonzero(kept[:, j])]
        if cells and width == 16 and not free:
            lines.append(f"DMIG*   {name:16s}{node:16d}{direction:16d}")
            lines += [f"*       {n:16d}{d:16d}{fortran(value, 9, letter):>16s}" for n, d, value in cells]
        elif cells:
            if free:
                fields = [f"{n},{d},{fortran(value, 16, letter)}," for n, d, value in cells]
                first, later = f"DMIG,{name},{node},{direction},,", ","
            else:
                fields = [f"{n:8d}{d:8d}{nastran_real(value, 8):>8s}{'':8s}" for n, d, value in cells]
                first, later = f"DMIG    {name:8s}{node:8d}{direction:8d}{'':8s}", f"{'':8s}"
            pairs = [later[:free].join(fields[i : i + 2]) for i in range(1, len(fields), 2)]
            lines += [line.rstrip() for line in [first + fields[0], *(later + pair for pair in pairs)]]
    return "\n".join(lines) + "\n"


def op4_text(matrix, dofs=None, *, name="KAA", layout="strings", digits=16, n=3):
    """Columns of OUTPUT4, dense, or as strings whose heads are packed in one number or (big) in two."""
    size, width = len(matrix), digits + 7
    lines = [f"{size:8d}{-size if layout == 'big' else size:8d}{6:8d}{2:8d}{name:8s}1P,{n}E{width}.{digits}"]
    for j, column in enumerate(matrix.T, start=1):
        (used,) = np.nonzero(column)
        if not len(used):
            continue
        if layout == "dense":
            values = column[used[0] : used[-1] + 1]
            lines.append(f"{j:8d}{used[0] + 1:8d}{len(values):8d}")
            lines += in_lines([fortran(value, digits) for value in values], width, n)
            continue
        strings = np.split(used, np.flatnonzero(np.diff(used) > 1) + 1)
        extra = 2 if layout == "big" else 1
        lines.append(f"{j:8d}{0:8d}{sum(extra + 2 * len(rows) for rows in strings):8d}")
        for rows in strings:
            words = 2 * len(rows) + 1
            lines.append(f"{words:8d}{rows[0] + 1:8d}" if layout == "big" else f"{words * 65536 + rows[0] + 1:11d}")
            lines += in_lines([fortran(value, digits) for value in column[rows]], width, n)
    return "\n".join([*lines, f"{size + 1:8d}{1:8d}{1:8d}", fortran(1.0, digits).rjust(width)]) + "\n"


def form(write, suffix, tolerance=1e-14, **options):
    """A text format: the file's suffix, to how many digits it holds, and what it writes of a matrix and its dofs."""
    return suffix, tolerance, lambda matrix, dofs=DOFS, **more: write(matrix, dofs, **options | more)


TEXTS = {
    "Abaqus coordinates, half": form(coordinates_text, ".mtx"),
    "Abaqus coordinates, both": form(coordinates_text, ".mtx", half="both", seed=0),
    "Abaqus coordinates, zeros": form(coordinates_text, ".mtx", half="upper", zeros=True),
    "Abaqus matrix input, half": form(matrix_input_text, ".mtx", half="upper", seed=1),
    "Abaqus matrix input, both": form(matrix_input_text, ".mtx", half="both", comment="** K\n*MATRIX INPUT\n", seed=2),
    "CalculiX": form(coordinates_text, ".sti", half="upper"),
    "RSA": form(harwell_boeing_text, ".hb"),
    "RSA, upper, sides": form(harwell_boeing_text, ".txt", half="upper", sides=True),
    "RUA, sides": form(harwell_boeing_text, ".rua", half="both", sides=True),
    "ANSYS": form(harwell_boeing_text, ".matrix", n=1, digits=15, letter="D", sides=True),
    "Rutherford-Boeing": form(harwell_boeing_text, ".rb", rutherford=True),
    "DMIG, large": form(dmig_text, ".pch", 1e-9),
    "DMIG, large, square": form(dmig_text, ".pch", 1e-9, half="both", seed=3),
    "DMIG, large, symmetric in full": form(dmig_text, ".pch", 1e-9, half="both", form=6, letter="E"),
    "DMIG, small": form(dmig_text, ".bdf", 5e-3, half="upper", width=8),
    "DMIG, free": form(dmig_text, ".bdf", half="upper", free=True, seed=4),
    "OP4, dense": form(op4_text, ".op4", layout="dense"),
    "OP4, strings": form(op4_text, ".op4"),
    "OP4, nine digits": form(op4_text, ".op4", 1e-9, digits=9, n=5),
    "OP4, big": form(op4_text, ".op4", layout="big"),
}


def write_texts(kind):
    suffix, _, text = TEXTS[kind]

    def write(folder, matrices):
        for name, matrix in matrices.items():
            if np.shape(matrix) == (N, N) and not np.iscomplexobj(matrix):
                (folder / f"{name}{suffix}").write_text(text(np.asarray(matrix)))
        return folder

    return write


WRITERS = {
    "mat": write_mat,
    "mat sparse": lambda *a: write_mat(*a, sparse=True),
    "mat sparse, not compressed": lambda *a: write_mat(*a, sparse=True, compressed=False),
    "npz": write_npz,
    "mtx": write_mtx,
    "mtx sparse": lambda *a: write_mtx(*a, sparse=True),
    "folder of npz": write_folder_of_npz,
}


def assert_same(model, expected, tolerance=1e-12):
    """Equal matrices at any theta, the order of parameters apart."""
    assert set(model.parameter_names) == set(expected.parameter_names)
    theta = dict(zip(expected.parameter_names, RNG.uniform(0.7, 1.3, 9), strict=False))
    ours, theirs = (one.matrices([theta[name] for name in one.parameter_names]) for one in (model, expected))
    for got, wanted in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(got.toarray(), wanted.toarray(), rtol=tolerance, atol=max(1e-9, 1e3 * tolerance))


EXPECTED = AffineModel({(name,): matrix for name, matrix in TERMS.items()}, M, n_modes=4)
