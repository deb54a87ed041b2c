"""Reading large exports: processor time and memory of each text format, beside SciPy's own readers.

    OMP_NUM_THREADS=1 python tests/benchmarks/large_exports.py --dofs 100000

A plate of nodes with six degrees of freedom each is written in every format, and each file is read in a new process.
Memory is the peak of that process less what it took before. Every matrix is compared with the one that was written.
"""

import multiprocessing
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.io
import scipy.sparse
from harness import arguments, peak_megabytes, shown, timed
from inside import form_of, read_file

DIRECTIONS = 6


def plate(n_dof):
    """A stiffness of springs with six directions between neighbours of a square grid, whose nodes count from 1."""
    side = max(2, round((n_dof / DIRECTIONS) ** 0.5))
    line = scipy.sparse.diags_array([-np.ones(side - 1), 2.5 * np.ones(side), -np.ones(side - 1)], offsets=[-1, 0, 1])
    grid = scipy.sparse.kron(line, scipy.sparse.eye_array(side)) + scipy.sparse.kron(scipy.sparse.eye_array(side), line)
    corner = np.random.default_rng(0).uniform(-1e6, 1e6, (DIRECTIONS, DIRECTIONS))
    matrix = scipy.sparse.csc_array(scipy.sparse.kron(grid, corner @ corner.T / 1e6))
    matrix.sort_indices()
    return matrix


def entries(matrix):
    found = matrix.tocoo()
    return found.row.tolist(), found.col.tolist(), found.data.tolist()


def coordinates(matrix):
    rows = zip(*entries(scipy.sparse.tril(matrix).tocsc()), strict=True)
    return "".join(f"{i + 1} {j + 1} {value:.15e}\n" for i, j, value in rows)


def matrix_input(matrix):
    return "".join(
        f"{i // DIRECTIONS + 1},{i % DIRECTIONS + 1}, {j // DIRECTIONS + 1},{j % DIRECTIONS + 1}, {value:.15e}\n"
        for i, j, value in zip(*entries(matrix), strict=True)
    )


def harwell_boeing(matrix):
    lower = scipy.sparse.tril(matrix).tocsc()
    size, blocks = matrix.shape[0], []
    for numbers, form in ((lower.indptr + 1, "%14d"), (lower.indices + 1, "%14d"), (lower.data, "%25.15E")):
        words = [form % number for number in numbers.tolist()]
        blocks.append(["".join(words[i : i + 3]) for i in range(0, len(words), 3)])
    counts = [len(block) for block in blocks]
    head = [
        "Stiffness",
        "".join(f"{count:14d}" for count in [sum(counts), *counts, 0]),
        f"RSA           {size:14d}{size:14d}{lower.nnz:14d}{0:14d}",
        "(3I14)          (3I14)          (1P,3E25.15)        ",
    ]
    return "\n".join([*head, *(line for block in blocks for line in block)]) + "\n"


def dmig(matrix):
    lines = [f"DMIG    KAAX    {0:8d}{6:8d}{2:8d}{0:8d}\n"]
    before = -1
    for i, j, value in zip(*entries(scipy.sparse.triu(matrix).tocsc()), strict=True):
        if j != before:
            lines.append(f"DMIG*   KAAX            {j // DIRECTIONS + 1:16d}{j % DIRECTIONS + 1:16d}\n")
            before = j
        word = f"{value:.9E}".replace("E", "D")
        lines.append(f"*       {i // DIRECTIONS + 1:16d}{i % DIRECTIONS + 1:16d}{word:>16s}\n")
    return "".join(lines)


def op4(matrix):
    size = matrix.shape[0]
    lines = [f"{size:8d}{-size:8d}{6:8d}{2:8d}KAA     1P,3E24.16\n"]
    for j in range(size):
        rows = matrix.indices[matrix.indptr[j] : matrix.indptr[j + 1]]
        values = matrix.data[matrix.indptr[j] : matrix.indptr[j + 1]]
        strings = np.flatnonzero(np.diff(rows, prepend=-2) > 1).tolist() + [len(rows)]
        lines.append(f"{j + 1:8d}{0:8d}{2 * len(rows) + 2 * (len(strings) - 1):8d}\n")
        for start, end in pairwise(strings):
            lines.append(f"{2 * (end - start) + 1:8d}{rows[start] + 1:8d}\n")
            words = [f"{value:24.16E}" for value in values[start:end].tolist()]
            lines += ["".join(words[i : i + 3]) + "\n" for i in range(0, len(words), 3)]
    return "".join(lines) + f"{size + 1:8d}{1:8d}{1:8d}\n{1.0:24.16E}\n"


TEXTS = {
    "Abaqus, CalculiX, SAP2000: coordinates, half": ("K.sti", coordinates),
    "Abaqus: matrix input, both halves": ("K_STIF1.mtx", matrix_input),
    "ANSYS: Harwell-Boeing, RSA": ("K.hb", harwell_boeing),
    "Nastran: DMIG, large field, half": ("K.pch", dmig),
    "Nastran: OUTPUT4, both halves": ("K.op4", op4),
}


def measured(reader, file, pipe):
    """Send the seconds of the processor, the memory and the matrix of one reading."""
    before = peak_megabytes()
    seconds, found = timed(lambda: reader(str(file)))
    memory = 1e6 * (peak_megabytes() - before)
    found = next(iter(found.values())) if isinstance(found, dict) else found
    pipe.send((seconds, memory, getattr(found, "matrix", found)))


def ours(file):
    return read_file(Path(file), form_of(Path(file)))


def row(reader, file, matrix):
    """One line of the table, from a process of its own."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=measured, args=(reader, file, sender))
    process.start()
    seconds, memory, found = receiver.recv()
    process.join()
    error = abs(scipy.sparse.csc_array(found) - matrix).max() / abs(matrix).max()
    size = file.stat().st_size
    columns = ("file, MB", "seconds", "peak memory, MB", "peak memory / file", "largest relative error")
    return dict(zip(columns, (size / 1e6, seconds, memory / 1e6, memory / size, float(error)), strict=True))


def main():
    matrix, rows = plate(arguments(__doc__, dofs=10_000).dofs), {}
    with tempfile.TemporaryDirectory() as folder:
        for title, (name, text) in TEXTS.items():
            file = Path(folder, name)
            file.write_text(text(matrix))
            rows[title] = row(ours, file, matrix)
            file.unlink()
        file = Path(folder, "K.mtx")
        scipy.io.mmwrite(file, matrix, symmetry="symmetric")
        rows["Matrix Market, half"] = row(ours, file, matrix)
        rows["the same by scipy.io.mmread"] = row(scipy.io.mmread, file, matrix)
        scipy.io.hb_write(file, matrix)
        rows["Harwell-Boeing, RUA"] = row(ours, file, matrix)
        rows["the same by scipy.io.hb_read"] = row(scipy.io.hb_read, file, matrix)
    title = (
        f"Reading a stiffness of {matrix.shape[0]:,} degrees of freedom and {matrix.nnz:,} entries, processor seconds"
    )
    shown(title, pd.DataFrame(rows).T, "3g")


if __name__ == "__main__":
    main()
