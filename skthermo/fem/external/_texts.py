"""Matrices in texts: lines of entries, Harwell-Boeing, and labels of rows. Errors name the line."""

from __future__ import annotations

import csv
import io
import re
from typing import NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]
Words = NDArray[np.bytes_]

MOST_INTEGER = 2**31 - 1  # rows, nodes and components are smaller


class Labelled(NamedTuple):
    """A square matrix whose rows are degrees of freedom of nodes, (n, 2): node and direction."""

    matrix: scipy.sparse.csc_array
    dofs: Integers


def lines_ended(content: bytes) -> bytes:
    """A text whose lines end in one byte; bytes that no text holds are an error."""
    content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if content.translate(None, bytes(range(9, 256))):
        control = re.search(rb"[\0-\x08]", content)
        line = content.count(b"\n", 0, control.start()) + 1  # type: ignore[union-attr]
        raise ValueError(f"line {line} holds the byte {control[0][0]}, which no text does")  # type: ignore[index]
    return content


def fields(lines: list[bytes], n: int, width: int) -> Words:
    """The first n fields of a width of each line."""
    return np.array(lines, dtype=f"S{n * width}").view(f"S{width}").reshape(len(lines), n)


def reals(words: Words, lines: Integers) -> Numbers:
    """Numbers as Fortran writes them; an error names the first word that is none, and its line."""
    words = np.frombuffer(words.tobytes().translate(bytes.maketrans(b"Dd_", b"EE?")), words.dtype)
    try:
        return words.astype(float)
    except ValueError:
        return np.array([_real(word, line) for word, line in zip(words.tolist(), lines.tolist(), strict=True)])


def _real(word: bytes, line: int) -> float:
    try:
        return float(re.sub(rb"(?<=[\d.])([+-])(?=\d)", rb"E\1", word))  # Nastran leaves the letter out
    except ValueError:
        raise ValueError(f"line {line}: {word.decode('latin-1').strip()!r} is not a number") from None


def whole(numbers: Numbers, what: str, least: int = -MOST_INTEGER) -> Integers:
    """Whole numbers within the usual range."""
    wrong = ~((numbers % 1 == 0) & (numbers >= least) & (numbers <= MOST_INTEGER))
    if wrong.any():
        got = f"{what} is {numbers[wrong][0]:g}"
        raise ValueError(f"{got}; expected whole numbers from {least} to {MOST_INTEGER}")
    return numbers.astype(np.int64)


def check_size(n_rows: int, n_entries: int) -> None:
    """Refuse a number of rows that would take far more memory than the entries."""
    if n_rows > max(20_000_000, 10 * n_entries):
        raise ValueError(f"{n_rows:,} rows for {n_entries:,} entries; expected at most twenty million, or ten an entry")


def square(rows: Integers, columns: Integers, values: Numbers, size: int) -> scipy.sparse.csc_array:
    """A matrix each entry of which is given once."""
    check_size(size, len(values))
    matrix = scipy.sparse.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()
    if matrix.nnz < len(values):
        keys = np.sort(rows * size + columns)
        row, column = divmod(int(keys[:-1][keys[1:] == keys[:-1]][0]), size)
        raise ValueError(f"the entry of row {row + 1} and column {column + 1} is given more than once")
    return matrix


def symmetric(
    rows: Integers, columns: Integers, values: Numbers, size: int, *, in_order: bool
) -> scipy.sparse.csc_array:
    """A matrix of which one half or all entries are given; ``in_order``: a half is on one side of the diagonal."""
    matrix = square(rows, columns, values, size)
    matrix.eliminate_zeros()  # of which a half or a block may hold some
    kept = values != 0
    below, above = int((kept & (rows > columns)).sum()), int((kept & (rows < columns)).sum())
    if below and above:
        pattern = matrix != 0
        paired = pattern.multiply(pattern.T).nnz - np.count_nonzero(kept & (rows == columns))
        if paired >= 0.5 * (below + above):
            return matrix
        if paired or in_order:
            raise ValueError(
                f"there are {below} entries below and {above} above the diagonal, and {paired} of them in pairs; "
                "expected one half or all entries, of entries on both sides of its diagonal"
            )
    return scipy.sparse.csc_array(matrix + matrix.T - scipy.sparse.diags_array(matrix.diagonal(), format="csc"))


def labelled(rows: Integers, columns: Integers, values: Numbers, *, is_symmetric: bool = True) -> Labelled:
    """A matrix from the labels (n, 2) of rows and columns; of a symmetric one, a half may be given."""
    both = np.vstack([rows, columns])
    codes, places = np.unique(both[:, 0] * 2**31 + both[:, 1], return_inverse=True)
    row, column = np.split(places, 2)
    if is_symmetric:
        matrix = symmetric(row, column, values, len(codes), in_order=False)
    else:
        matrix = square(row, column, values, len(codes))
    return Labelled(matrix, np.column_stack([codes >> 31, codes % 2**31]))


def read_entries(content: bytes) -> scipy.sparse.csc_array | Labelled:
    """A symmetric matrix from lines of row, column and value, or of node and direction of both, and value.

    CalculiX and SAP2000 write the first, and so does Abaqus with ``*MATRIX OUTPUT, FORMAT=COORDINATE``; with
    ``FORMAT=MATRIX INPUT`` it writes the second, with commas (Abaqus Keywords Guide, ``*MATRIX INPUT``). One half or
    all entries may be there, below a heading whose lines do not begin with a number, and between comments.
    """
    text = lines_ended(content)
    heading = re.match(rb"(?:[ \t]*(?![ \t\d+\-.]).*(?:\n|\Z))*", text).group()  # type: ignore[union-attr]
    body = b"\n" * heading.count(b"\n") + text[len(heading) :]
    if any(mark in body for mark in (b"*", b"%", b"#", b"!", b"$")):
        body = re.sub(rb"^[ \t]*[*%#!$].*$", b"", body, flags=re.MULTILINE)
    numbers = _table(body.translate(bytes.maketrans(b"Dd,", b"EE ")))
    _refuse_cut_value(body)
    if numbers.shape[1] == 3:
        rows, columns = whole(numbers[:, 0], "a row", 1), whole(numbers[:, 1], "a column", 1)
        size = int(max(rows.max(), columns.max()))
        return symmetric(rows - 1, columns - 1, numbers[:, 2], size, in_order=True)
    nodes, directions = whole(numbers[:, 0:4:2], "a node"), whole(numbers[:, 1:4:2], "a direction", 0)
    rows, columns = (np.column_stack([nodes[:, i], directions[:, i]]) for i in range(2))
    return labelled(rows, columns, numbers[:, 4])


def _table(text: bytes) -> Numbers:
    """The numbers of lines of three or five; an error names the first line that does not hold as many."""
    import pandas as pd  # imported here because importing models must not import pandas

    try:
        table = pd.read_csv(io.BytesIO(text), sep=r"\s+", header=None, dtype=float, quoting=csv.QUOTE_NONE)
        numbers = table.to_numpy()
    except (ValueError, OverflowError):  # which pandas' own errors are
        numbers = np.full((1, 3), np.nan)
    if numbers.shape[1] in (3, 5) and np.isfinite(numbers).all():
        return numbers
    width = 0
    for number, line in enumerate(text.split(b"\n"), start=1):
        words = line.split()
        width = width or len(words)
        if words and (width not in (3, 5) or len(words) != width):
            expected = "three or five numbers" if width == len(words) else f"{width}, as in the others"
            raise ValueError(f"line {number} holds {len(words)} words; expected {expected}")
        found = reals(np.array(words, dtype=bytes), np.full(len(words), number))
        if not np.isfinite(found).all():
            raise ValueError(f"line {number} is {line[:40].decode('latin-1')!r}; expected finite numbers")
    raise ValueError("it holds no line of three or five numbers")


def _refuse_cut_value(text: bytes) -> None:
    """Refuse a text without a last line end whose last value has fewer digits than those before it have."""
    lines = [line for line in text[-20_000:].split(b"\n")[1:] if line.strip()]
    lengths = [len(re.split(rb"[ \t,]+", line.strip())[-1].lstrip(b"+-")) for line in lines]
    if not text.endswith(b"\n") and len(set(lengths[:-1])) == 1 and lengths[-1] < lengths[0]:
        n_lines = text.count(b"\n") + 1
        raise ValueError(f"line {n_lines} ends within a number: the file seems to be cut off")


def read_dofs(content: bytes) -> list[tuple[int, int | str]]:
    """Labels of a matrix's rows: CalculiX's lines of ``node.direction``, or ANSYS' of equation, node and direction."""
    lines = lines_ended(content).decode("latin-1").split("\n")
    is_mapping = "Eqn" in lines[0]
    pattern = r"(\d+)\s+(\d+)\s+([A-Z]\w*)" if is_mapping else r"()(\d+)\.(\d)"
    dofs: list[tuple[int, int | str]] = []
    for number, line in enumerate(lines[is_mapping:], start=1 + is_mapping):
        if found := re.fullmatch(pattern, line.strip()):
            equation, node, direction = found.groups()
            if is_mapping and int(equation) != len(dofs) + 1:
                raise ValueError(f"line {number} is of equation {equation}; expected {len(dofs) + 1}")
            dofs.append((int(node), direction if is_mapping else int(direction)))
        elif line.strip():
            expected = "equation, node and direction" if is_mapping else "node.direction"
            raise ValueError(f"line {number} is {line.strip()[:40]!r}; expected {expected}")
    return dofs


def read_harwell_boeing(content: bytes) -> scipy.sparse.csc_array:
    """A square matrix in Harwell-Boeing or Rutherford-Boeing form: real, assembled, symmetric or not.

    Duff, Grimes and Lewis, User's Guide for the Harwell-Boeing Sparse Matrix Collection (1992). ANSYS writes it with
    ``HBMAT``, one number in each line, the right-hand side at the end; `scipy.io.hb_read` reads no symmetric ones.
    """
    lines = lines_ended(content).removesuffix(b"\n").split(b"\n")
    try:
        n_lines = [int(word) for word in lines[1].split()]
        kind, (n_rows, n_columns, n_entries) = lines[2][:3].upper(), map(int, lines[2][3:].split()[:3])
        pattern = rb"\((?:\d*P,?)?(\d*)[IEDFG](\d+)(?:\.\d+)?(?:E\d+)?\)"
        formats = re.findall(pattern, lines[3].upper().replace(b" ", b""))
        widths = [(int(n or 1), int(width)) for n, width in formats[:3]]
        blocks = zip(n_lines[1:4], (n_columns + 1, n_entries, n_entries), widths, strict=True)
    except (ValueError, IndexError) as error:
        raise ValueError("the first four lines are not those of the format") from error
    if not re.fullmatch(rb"[RI][SU]A", kind) or n_rows != n_columns or min(n_entries, n_rows, *n_lines) < 0:
        what = f"a matrix {kind.decode('latin-1')} of {n_rows} x {n_columns}"
        raise ValueError(f"{what}; expected a square one, RSA or RUA")
    start, found = 5 if n_lines[4:] > [0] else 4, []
    for n_own, n_numbers, (n, width) in blocks:
        if n_own != -(-n_numbers // n) or start + n_own > len(lines):
            where = f"{n_own} lines of {n} from line {start + 1}, of {len(lines)} lines"
            raise ValueError(f"{n_numbers} numbers in {where}; expected as many as the heading says")
        found.append(_block(lines[start : start + n_own], start + 1, n_numbers, n, width))
        start += n_own
    pointers, rows, values = whole(found[0], "a pointer", 1) - 1, whole(found[1], "a row", 1) - 1, found[2]
    if pointers[0] or pointers[-1] != n_entries or (np.diff(pointers) < 0).any() or (rows >= n_rows).any():
        raise ValueError("pointers that do not rise from 1 to the number of entries, or rows beyond the last")
    entries = rows, np.repeat(np.arange(n_columns), np.diff(pointers)), values, n_rows
    return symmetric(*entries, in_order=True) if kind[1:2] == b"S" else square(*entries)


def _block(lines: list[bytes], first: int, n_numbers: int, n: int, width: int) -> Numbers:
    """Numbers of some lines: between spaces or, where they touch one another, in fields of a width, n in a line."""
    words = b"\n".join(lines).split()
    if len(words) == n_numbers:
        return reals(np.array(words, dtype=bytes), first + np.arange(n_numbers) // n)
    longer = [number for number, line in enumerate(lines, start=first) if line[n * width :].strip()]
    if longer:
        raise ValueError(f"line {longer[0]} is longer than {n} fields of {width} characters")
    return reals(fields(lines, n, width).ravel()[:n_numbers], first + np.arange(n_numbers) // n)
