"""Matrices in texts that FE programs write: lines of entries and Harwell-Boeing. Errors name the line."""

import re
from array import array
from typing import NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]

BYTES_FOR_EACH_ROW = 100  # that checks of a sparse matrix take, its entries apart
LINES_AT_ONCE = 20_000
SPACE, TAB, NEWLINE = b" \t\n"
MOST = 2**31 - 1  # rows, nodes and components are smaller
HEADING = re.compile(rb"\A(?:[ \t]*(?![ \t\d+\-.]).*(?:\n|\Z))*")
COMMENTS = re.compile(rb"^[ \t]*[*%#!$].*$", re.MULTILINE)
TO_FLOATS = bytes.maketrans(b"Dd,", b"EE ")
BARE_EXPONENT = re.compile(rb"(?<=[\d.])([+-])(?=\d)")
FORTRAN = re.compile(rb"\((?:\d*P,?)?(\d*)[IEDFG](\d+)(?:\.\d+)?(?:E\d+)?\)")
MAPPING, NODE_DIRECTION = r"(\d+)\s+(\d+)\s+([A-Z]\w*)", r"()(\d+)\.(\d)"
FULL = 0.5  # share of entries beside the diagonal with a mirror image, from which on all entries are meant to be given


class Labelled(NamedTuple):
    """A square matrix whose rows are degrees of freedom of nodes, (n, 2): node and direction."""

    matrix: scipy.sparse.csc_array
    dofs: Integers


class Text:
    """A text as an array of bytes, and where its lines begin and end."""

    def __init__(self, content: bytes):
        if b"\r" in content:
            content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        self.content = content
        self.bytes = np.frombuffer(content, dtype=np.uint8)
        ends = np.flatnonzero(self.bytes == NEWLINE)
        self.ends = ends if content.endswith(b"\n") or not content else np.append(ends, len(content))
        self.starts = np.append(0, self.ends[:-1] + 1)[: len(self.ends)]
        control = self.bytes < TAB
        if control.any():
            line = int(np.searchsorted(self.ends, np.argmax(control))) + 1
            raise ValueError(f"line {line} holds the byte {self.bytes[np.argmax(control)]}, which no text does")

    def __len__(self) -> int:
        return len(self.ends)

    def words(self) -> Integers:
        """How many words each line has."""
        blank = np.append(True, self.bytes <= SPACE)
        begins = np.flatnonzero(blank[:-1] & ~blank[1:])
        return np.diff(np.append(0, np.searchsorted(begins, self.ends)))


def numbers_of(text: bytes, n_before: int = 0) -> Numbers:
    """All numbers of a text in a row; an error names the first word that is none, and its line after others."""
    try:
        return np.fromstring(text, sep=" ") if text.strip() else np.empty(0)
    except (DeprecationWarning, ValueError):
        for number, line in enumerate(text.split(b"\n"), start=n_before + 1):
            for word in line.split():
                try:
                    float(word)
                except ValueError:
                    raise ValueError(f"line {number}: {word[:30].decode('latin-1')!r} is not a number") from None
        raise


def _whole(numbers: Numbers, what: str, least: int = -MOST) -> Integers:
    """Whole numbers within the usual range."""
    wrong = ~((numbers % 1 == 0) & (numbers >= least) & (numbers <= MOST))
    if wrong.any():
        raise ValueError(f"{what} is {numbers[np.argmax(wrong)]:g}; expected whole numbers from {least} to {MOST}")
    return numbers.astype(np.int64)


def _nodes(pairs: Numbers, least: int = -MOST) -> Integers:
    """Labels, (n, 2), of nodes from ``least`` on and directions."""
    return np.column_stack([_whole(pairs[:, 0], "a node", least), _whole(pairs[:, 1], "a direction", 0)])


def square(rows: Integers, columns: Integers, values: Numbers, size: int) -> scipy.sparse.csc_array:
    """A matrix each entry of which is given once."""
    bytearray(2 * BYTES_FOR_EACH_ROW * size)  # an error here if that is too much memory
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
        ones = np.ones(matrix.nnz, dtype=np.int8)
        pattern = scipy.sparse.csc_array((ones, matrix.indices, matrix.indptr), shape=matrix.shape)
        paired = pattern.multiply(pattern.T).nnz - np.count_nonzero(kept & (rows == columns))
        if paired >= FULL * (below + above):
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
    if both[:, 1].max(initial=0) >= 2**15:
        raise ValueError(f"a direction is {both[:, 1].max()}; expected a number such as 1 to 6")
    codes, places = np.unique(both[:, 0] * 2**15 + both[:, 1], return_inverse=True)
    first, second = np.split(places, 2)
    entries = first, second, values, len(codes)
    matrix = symmetric(*entries, in_order=False) if is_symmetric else square(*entries)
    return Labelled(matrix, np.column_stack([codes >> 15, codes % 2**15]))


def read_entries(content: bytes) -> scipy.sparse.csc_array | Labelled:
    """A symmetric matrix from lines of row, column and value, or of node and direction of both, and value.

    CalculiX and SAP2000 write the first, and so does Abaqus with ``*MATRIX OUTPUT, FORMAT=COORDINATE``; with
    ``FORMAT=MATRIX INPUT`` it writes the second, with commas (Abaqus Keywords Guide, ``*MATRIX INPUT``). One half or
    all entries may be there, below a heading whose lines do not begin with a number, and between comments.
    """
    content = Text(content).content
    heading = HEADING.match(content).group()  # type: ignore[union-attr]
    body = COMMENTS.sub(b"", b"\n" * heading.count(b"\n") + content[len(heading) :]).translate(TO_FLOATS)
    del content
    text = Text(body)
    words = text.words()
    first = int(np.argmax(np.append(words, 1) > 0))
    width = int(np.append(words, 0)[first])
    if width not in (3, 5):
        raise ValueError(f"line {first + 1} holds {width} words; expected three or five numbers")
    wrong = np.flatnonzero((words > 0) & (words != width))
    if len(wrong):
        raise ValueError(f"line {wrong[0] + 1} holds {words[wrong[0]]} words; expected {width}, as in the others")
    numbers = numbers_of(body).reshape(-1, width)
    _refuse_cut_value(text, words)
    if width == 3:
        rows, columns = (_whole(numbers[:, i], ("a row", "a column")[i], 1) for i in (0, 1))
        size = int(max(rows.max(), columns.max()))
        return symmetric(rows - 1, columns - 1, numbers[:, 2], size, in_order=True)
    return labelled(_nodes(numbers[:, :2]), _nodes(numbers[:, 2:4]), numbers[:, 4])


def _refuse_cut_value(text: Text, words: Integers) -> None:
    """Refuse a text without a last line end whose last value has fewer digits than those before it have."""
    lines = np.flatnonzero(words)[-LINES_AT_ONCE:]
    if text.content.endswith(b"\n") or len(lines) < 2:
        return
    lengths = np.array([len(text.content[text.starts[i] : text.ends[i]].split()[-1].lstrip(b"+-")) for i in lines])
    if lengths[-1] < lengths[:-1].min() and (lengths[:-1] == lengths[0]).all():
        raise ValueError(f"line {lines[-1] + 1} ends within a number: the file seems to be cut off")


def read_dofs(content: bytes) -> list[tuple[int, int | str]]:
    """Labels of a matrix's rows: CalculiX's lines of ``node.direction``, or ANSYS' of equation, node and direction."""
    lines = Text(content).content.decode("latin-1").split("\n")
    is_mapping = "Eqn" in lines[0]
    dofs: list[tuple[int, int | str]] = []
    for number, line in enumerate(lines[is_mapping:], start=1 + is_mapping):
        if found := re.fullmatch(MAPPING if is_mapping else NODE_DIRECTION, line.strip()):
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
    ``HBMAT``, one number in each line, the right-hand side at the end.
    """
    lines = Text(content).content.removesuffix(b"\n").split(b"\n")
    heads = lines[:4]
    try:
        counts = [int(word) for word in heads[1].split()]
        kind, sizes = heads[2][:3].decode("ascii").upper(), [int(word) for word in heads[2][3:].split()]
        formats = [(int(n or 1), int(width)) for n, width in FORTRAN.findall(heads[3].upper().replace(b" ", b""))]
        n_rows, n_columns, n_entries = sizes[:3]
        (_, pointers_in, rows_in, values_in), forms = counts[:4], formats[:3]
        n_sides = counts[4] if len(counts) > 4 else 0
    except (ValueError, IndexError) as error:
        raise ValueError("the first four lines are not those of the format") from error
    if (
        min(counts) < 0
        or kind[0] not in "RI"
        or kind[1] not in "SU"
        or kind[2] != "A"
        or n_rows != n_columns
        or len(forms) < 3
    ):
        raise ValueError(f"a matrix {kind} of {n_rows} x {n_columns}; expected a square one, RSA or RUA")
    start, found = 5 if n_sides else 4, []
    for n_lines, n_numbers, (n, width), what in zip(
        (pointers_in, rows_in, values_in),
        (n_columns + 1, n_entries, n_entries),
        forms,
        ("pointers", "rows", "values"),
        strict=True,
    ):
        if n_numbers < 0 or n_lines != -(-n_numbers // n) or start + n_lines > len(lines):
            raise ValueError(
                f"{n_numbers} {what} in {n_lines} lines of {n} from line {start + 1}, of {len(lines)} lines; expected "
                "as many as the heading says"
            )
        found.append(_block(lines[start : start + n_lines], start + 1, n_numbers, n, width))
        start += n_lines
    pointers, rows = _whole(found[0], "a pointer", 1) - 1, _whole(found[1], "a row", 1) - 1
    if pointers[0] or pointers[-1] != n_entries or (np.diff(pointers) < 0).any() or (rows >= n_rows).any():
        raise ValueError("pointers that do not rise from 1 to the number of entries, or rows beyond the last")
    columns = np.repeat(np.arange(n_columns), np.diff(pointers))
    if kind[1] == "S":
        return symmetric(rows, columns, found[2], n_rows, in_order=True)
    return square(rows, columns, found[2], n_rows)


def _block(lines: list[bytes], first: int, n_numbers: int, n: int, width: int) -> Numbers:
    """Numbers of some lines: between spaces or, where they touch one another, in fields of a width, n in a line."""
    numbers, is_spaced = array("d"), sum(len(line.split()) for line in lines) == n_numbers
    for number, line in enumerate(lines, start=first):
        if not is_spaced and line[n * width :].strip():
            raise ValueError(f"line {number} is longer than {n} fields of {width} characters")
        starts = range(0, min(n * width, len(line)), width)
        words = line.split() if is_spaced else [line[i : i + width] for i in starts]
        numbers.extend(reals(words[: n_numbers - len(numbers)], number))
    if len(numbers) != n_numbers:
        raise ValueError(f"{len(numbers)} numbers in {len(lines)} lines from line {first}; expected {n_numbers}")
    return np.array(numbers)


def reals(words: list[bytes], line: int) -> list[float]:
    """Numbers as Fortran writes them; an error names the first word that is none."""
    try:
        if b"_" not in b"".join(words):  # Python reads 1_000
            return [float(word.replace(b"D", b"E")) for word in words]
    except ValueError:
        pass
    found = []
    for word in words:
        try:
            changed = BARE_EXPONENT.sub(rb"E\1", word.upper().replace(b"D", b"E").replace(b"_", b"?"))
            found.append(float(changed))
        except ValueError:
            raise ValueError(f"line {line}: {word.decode('latin-1').strip()!r} is not a number") from None
    return found
