"""Matrices of FE programs: lines of entries, Harwell-Boeing, Nastran's DMIG and OUTPUT4, and labels of rows.

Errors name the line, or the byte of a binary file.
"""

from __future__ import annotations

import csv
import io
import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]

FORTRAN = bytes.maketrans(b"Dd_", b"Ee?")  # exponents; Python would take an underscore for a part of a number
MOST_INTEGER = 2**31 - 1  # rows, nodes and components are smaller


OP4_HEADING = re.compile(
    rb"([ \d]{8}|[ \d]{16})([ \d-]{8}|[ \d-]{16})([ \d]{8})([ \d]{8})([A-Z]\w{0,7})"
    rb"[ \0]*(?:(?:1P,)?(\d{1,3})[EDed](\d{1,3})\.\d+)?(?:\|I16)?[ \t]*"
)


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


def real(word: bytes, line: int) -> float:
    """A number as Fortran writes it; an error names the line."""
    try:
        return float(word.translate(FORTRAN))
    except ValueError:
        pass
    try:  # Nastran leaves the letter out
        return float(re.sub(rb"(?<=[\d.])([+-])(?=\d)", rb"E\1", word.translate(FORTRAN)))
    except ValueError:
        raise ValueError(f"line {line}: {word.decode('latin-1').strip()!r} is not a number") from None


def reals(words: list[bytes], line: int) -> list[float]:
    """Numbers of a line that was translated by ``FORTRAN``."""
    try:
        return list(map(float, words))
    except ValueError:
        return [real(word, line) for word in words]


def whole_word(word: bytes, line: int, what: str, least: int = 0) -> int:
    """A whole number; a blank is zero."""
    number = real(word.strip() or b"0", line)
    if number % 1 or not least <= number <= MOST_INTEGER:
        raise ValueError(f"line {line}: {what} is {number:g}; expected whole numbers from {least} to {MOST_INTEGER}")
    return int(number)


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
        if not np.isfinite([real(word, number) for word in words]).all():
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
    values, are_apart = array("d"), sum(len(line.split()) for line in lines) == n_numbers
    for number, line in enumerate(lines, start=first):
        line, n_left = line.translate(FORTRAN), min(n, n_numbers - len(values))
        if not are_apart and line[n * width :].strip():
            raise ValueError(f"line {number} is longer than {n} fields of {width} characters")
        words = line.split() if are_apart else [line[i : i + width] for i in range(0, n_left * width, width)]
        values.extend(reals(words, number))
    return np.frombuffer(values)


class Cards:
    """Entries of a matrix of DMIG cards: labels (node, component) of their rows and columns, and values."""

    def __init__(self, line: int):
        self.line, self.form, self.kind = line, 0, 0
        self.labels, self.values = array("q"), array("d")

    def matrix(self, name: str) -> Labelled | None:
        """The matrix; None for a complex or rectangular one."""
        if not self.form:
            raise ValueError(f"line {self.line}: matrix {name!r} has no entry that states its form")
        if self.form not in (1, 6) or self.kind not in (1, 2):
            return None
        labels = np.frombuffer(self.labels, np.int64).reshape(-1, 4)
        return labelled(labels[:, :2], labels[:, 2:], np.frombuffer(self.values), is_symmetric=self.form == 6)


def read_dmig(content: bytes) -> dict[str, Labelled | None]:
    """Matrices of Nastran's DMIG entries by name, in small, large or free field; None for complex or rectangular ones.

    The labels are grid point and component. MSC Nastran and OptiStruct Quick Reference Guides, bulk data entry DMIG;
    ``EXTOUT=DMIGPCH`` writes them to the punch file. A half of a symmetric matrix (form 6) or all of it may be there.
    """
    found: dict[str, Cards] = {}
    cards, column = Cards(0), (0, 0)
    for number, is_head, groups in _groups(lines_ended(content.upper())):
        if is_head:
            name, *words = groups[0]
            title = name.strip().decode("latin-1")
            if not 0 < len(title) <= 8:
                raise ValueError(f"line {number}: {title!r} is no name of one to eight characters")
            cards = found.setdefault(title, Cards(number))
            node, component, kind = (whole_word(word, number, "a node, component or form") for word in words)
            column = node, component
            if not node:  # the card states the form
                cards.form, cards.kind = component, kind
                if component not in (1, 2, 6, 9) or kind not in (1, 2, 3, 4):
                    stated = f"form {component} and type {kind}"
                    raise ValueError(f"line {number}: matrix {title!r} has {stated}; expected 6 and 2, or such")
        for point, direction, value, _ in groups[is_head:] if column[0] else ():
            if point.strip() or direction.strip() or value.strip():
                row = whole_word(point, number, "a node", 1), whole_word(direction, number, "a component")
                cards.labels.extend((*row, *column))
                cards.values.append(real(value, number))
    if not found:
        raise ValueError("no DMIG entry")
    return {name: own.matrix(name) for name, own in found.items()}


def _groups(text: bytes) -> Iterator[tuple[int, bool, list[list[bytes]]]]:
    """Lines of DMIG cards: number, whether a card begins, and fields in groups of four.

    The first group holds the name and the column, each other one node, component and value.
    """
    is_card = False
    for number, line in enumerate(io.BytesIO(text), start=1):
        first = line[:1]
        is_head = line[:4] == b"DMIG" and line[4:5] in (b" ", b"*", b",")
        is_card = is_head or (is_card and not b"A" <= first <= b"Z")
        if not is_card or first not in b"D +*,":
            continue
        if b"," in line[:9]:
            parts = line.partition(b"$")[0].split(b",")[1:9]
            parts += [b""] * (-len(parts) % 4)
        elif b"*" in line[:8]:
            parts = [line[8:24], line[24:40], line[40:56], line[56:72]]
        else:
            parts = [line[i : i + 8] for i in range(8, 72, 8)]
        yield number, is_head, [parts[i : i + 4] for i in range(0, len(parts), 4)]


class Head(NamedTuple):
    """Facts before a matrix of OUTPUT4."""

    n_columns: int
    n_rows: int
    form: int
    kind: int
    name: str

    @property
    def is_real(self) -> bool:
        """Whether the numbers are real, in single or double precision, and not complex."""
        return self.kind in (1, 2)

    @property
    def is_big(self) -> bool:
        """Whether a string's length and row are two numbers, and not one of 65536 times the first plus the second."""
        return self.n_rows < 0 or self.n_rows >= 65536

    def matrix(self, strings: Sequence[Sequence[int]], values: Numbers) -> scipy.sparse.csc_array | None:
        """The matrix of strings of values below one another: column, first row and length of each; None if not square.

        Columns and rows count from 1.
        """
        if self.n_columns != abs(self.n_rows) or not self.is_real:
            return None
        columns, rows, lengths = np.array(strings, dtype=np.int64).reshape(-1, 3).T
        outside = (columns < 1) | (columns > self.n_columns) | (rows < 1) | (rows + lengths - 1 > self.n_columns)
        if outside.any():
            column, row, length = strings[int(np.argmax(outside))]
            raise ValueError(f"{length} values from row {row} of column {column}; expected them within the matrix")
        used = np.flatnonzero(values)
        string = np.repeat(np.arange(len(lengths)), lengths)[used]
        first = rows - 1 - np.cumsum(lengths) + lengths
        entries = first[string] + used, columns[string] - 1, values[used], self.n_columns
        return symmetric(*entries, in_order=True) if self.form == 6 else square(*entries)


Announced = tuple[str, Head, Callable[[], scipy.sparse.csc_array | None]]
"""Where a matrix begins, its head, and what reads it."""


def read_op4(content: bytes) -> dict[str, scipy.sparse.csc_array | None]:
    """Matrices of Nastran's OUTPUT4 by name, dense or sparse; None for complex or rectangular ones.

    MSC Nastran DMAP Programmer's Guide, module OUTPUT4. Rows have no labels.
    """
    found = {}
    for where, head, read in _in_records(content) if 0 in content[:4] else _in_lines(lines_ended(content)):
        try:
            found[head.name] = read()
        except ValueError as error:
            raise ValueError(f"matrix {head.name!r} of {where}: {error}") from error
    return found


def _in_lines(text: bytes) -> Iterator[Announced]:
    """Matrices of a text: a heading, then a line for each column or string, and its values."""
    lines = enumerate(io.BytesIO(text), start=1)
    for number, line in lines:
        if not line.strip():
            continue
        heading = OP4_HEADING.fullmatch(line.rstrip(b"\n"))
        if heading is None:
            got = line[:40].decode("latin-1").rstrip("\n")
            raise ValueError(f"line {number} is {got!r}; expected the heading of a matrix")
        n_columns, n_rows, form, kind = map(int, heading.groups()[:4])
        head = Head(n_columns, n_rows, form, kind, heading[5].decode("ascii"))
        n, width = map(int, heading.group(6, 7)) if heading[6] else (5, 16)
        yield f"line {number}", head, partial(_of_text, lines, head, n, width)


def _of_text(lines: Iterator[tuple[int, bytes]], head: Head, n: int, width: int) -> scipy.sparse.csc_array | None:
    """The matrix whose columns are the next lines; values stand n in a line, in fields of a width."""
    strings, values, column = list[list[int]](), array("d"), 0
    for number, line in lines:
        if b"." in line:
            length = line.count(b".")
            if not strings or length > n:
                raise ValueError(
                    f"line {number} holds {length} values; expected a column's number or at most {n} values"
                )
            strings[-1][2] += length
            if head.is_real:
                line = line.translate(FORTRAN)
                values.extend(reals([line[i : i + width] for i in range(0, length * width, width)], number))
            continue
        words = [whole_word(word, number, "a column, row or length") for word in line.split()]
        if len(words) == 3:
            column, row, n_words = words
            if column == head.n_columns + 1:
                next(lines, None)  # a number without meaning
                for *_, length, at, stated, is_column in strings if head.is_real else ():
                    if stated != length * (1 if head.kind % 2 else 2) and not (is_column and stated == length):
                        raise ValueError(f"line {at} states {stated} words; {length} values follow")  # or values
                return head.matrix([string[:3] for string in strings if string[2]], np.array(values))
            n_words = n_words if row else 0  # the strings of the column follow
        elif column and len(words) == 2 and head.is_big:
            n_words, row = words[0] - 1, words[1]
        elif column and len(words) == 1 and not head.is_big:
            n_words, row = words[0] // 65536 - 1, words[0] % 65536
        elif words:
            raise ValueError(f"line {number} starts neither a column nor a string")
        else:
            continue
        strings.append([column, row, 0, number, n_words, len(words) == 3])
    raise ValueError(f"no end after {head.n_columns} columns: the file seems to be cut off")


def _in_records(content: bytes) -> Iterator[Announced]:
    """Matrices of a binary file: a record for the head, one for each column that is not zero, and one beyond the last.

    A record has its length before and after it, in four bytes; all other integers may have eight.
    """
    order = "<" if content[0] else ">"
    records = _records(content, order)
    for at, record in records:
        if len(record) not in (24, 48):
            raise ValueError(f"a record of {len(record)} bytes at byte {at}; expected 24 or 48, the head of a matrix")
        word = len(record) // 6
        integer = f"{order}i{word}"
        numbers, name = np.frombuffer(record[: 4 * word], integer).tolist(), record[4 * word :].translate(None, b" \0")
        n_columns, n_rows, form, kind = numbers
        head = Head(n_columns, n_rows, form, kind, name.decode("latin-1"))
        real = f"{order}f{8 if head.kind % 2 == 0 else word}"
        yield f"byte {at}", head, partial(_of_columns, records, head, integer, real)


def _records(content: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at < len(content):
        length = int.from_bytes(content[at : at + 4], "little" if order == "<" else "big")
        end = at + 4 + length
        if content[end : end + 4] != content[at : at + 4] or end + 4 > len(content):
            raise ValueError(f"the record at byte {at} has no end: the file is damaged or cut off")
        yield at, content[at + 4 : end]
        at = end + 4


def _of_columns(
    records: Iterator[tuple[int, bytes]], head: Head, integer: str, real: str
) -> scipy.sparse.csc_array | None:
    """The matrix whose columns are the next records, each one string of values or several."""
    strings, values, before, is_dense = list[tuple[int, int, int]](), bytearray(), 0, None
    word, size = np.dtype(integer).itemsize, np.dtype(real).itemsize
    for at, record in records:
        if len(record) < 3 * word:
            raise ValueError(f"a record of {len(record)} bytes at byte {at}; expected a column")
        column, row, n_words = np.frombuffer(record[: 3 * word], integer).tolist()
        if column == head.n_columns + 1:
            return head.matrix(strings, np.frombuffer(values, real).astype(float))
        if column <= before or len(record) != (3 + n_words) * word or is_dense not in (None, row > 0):
            what = f"column {column} from row {row}, of {n_words} words, in {len(record)} bytes"
            raise ValueError(f"after column {before}, {what}")
        before, start, is_dense = column, 3 * word, row > 0
        while head.is_real and start < len(record):
            stop = len(record)
            if not is_dense:  # a string's length and row
                numbers = np.frombuffer(record[start : start + (1 + head.is_big) * word], integer).tolist()
                length, row = numbers if head.is_big else divmod(numbers[0], 65536)
                start, stop = start + (1 + head.is_big) * word, start + (length + head.is_big) * word
            length, rest = divmod(stop - start, size)
            if rest or not start < stop <= len(record):
                raise ValueError(f"a string of {stop - start} bytes in column {column}; {len(record) - start} are left")
            strings.append((column, row, length))
            values += record[start:stop]
            start = stop
    raise ValueError(f"no end after {head.n_columns} columns: the file seems to be cut off")
