"""Matrices in files that FE programs write: lines of entries, Harwell-Boeing, and Nastran's OUTPUT4 and DMIG. Errors
name line or byte."""

import re
from array import array
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]

BYTES_FOR_EACH_ROW = 100  # that checks of a sparse matrix take, its entries apart
MOST_INTEGER = 2**31 - 1  # rows, nodes and components are smaller
OP4_HEADING = re.compile(
    rb"([ \d]{8}|[ \d]{16})([ \d-]{8}|[ \d-]{16})([ \d]{8})([ \d]{8})([A-Z]\w{0,7})"
    rb"[ \0]*(?:(?:1P,)?(\d{1,3})[EDed](\d{1,3})\.\d+)?(?:\|I16)?[ \t]*"
)
STRING = 65536  # a string's length and row in one number, where there are fewer rows
REAL_KINDS = 1, 2  # types of real numbers, in single and double precision; others are complex


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
        ends = np.flatnonzero(self.bytes == ord("\n"))
        self.ends = ends if content.endswith(b"\n") or not content else np.append(ends, len(content))
        self.starts = np.append(0, self.ends[:-1] + 1)[: len(self.ends)]
        control = self.bytes < ord("\t")
        if control.any():
            line = int(np.searchsorted(self.ends, np.argmax(control))) + 1
            raise ValueError(f"line {line} holds the byte {self.bytes[np.argmax(control)]}, which no text does")

    def __len__(self) -> int:
        return len(self.ends)

    def words(self) -> Integers:
        """How many words each line has."""
        blank = np.append(True, self.bytes <= ord(" "))
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


def _whole(numbers: Numbers, what: str, least: int = -MOST_INTEGER) -> Integers:
    """Whole numbers within the usual range."""
    wrong = ~((numbers % 1 == 0) & (numbers >= least) & (numbers <= MOST_INTEGER))
    if wrong.any():
        raise ValueError(
            f"{what} is {numbers[np.argmax(wrong)]:g}; expected whole numbers from {least} to {MOST_INTEGER}"
        )
    return numbers.astype(np.int64)


def _nodes(pairs: Numbers, least: int = -MOST_INTEGER) -> Integers:
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
    heading = re.match(rb"\A(?:[ \t]*(?![ \t\d+\-.]).*(?:\n|\Z))*", content).group()  # type: ignore[union-attr]
    body = b"\n" * heading.count(b"\n") + content[len(heading) :]
    body = re.sub(rb"^[ \t]*[*%#!$].*$", b"", body, flags=re.MULTILINE).translate(bytes.maketrans(b"Dd,", b"EE "))
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
    lines = np.flatnonzero(words)[-20_000:]
    if text.content.endswith(b"\n") or len(lines) < 2:
        return
    lengths = np.array([len(text.content[text.starts[i] : text.ends[i]].split()[-1].lstrip(b"+-")) for i in lines])
    if lengths[-1] < lengths[:-1].min() and (lengths[:-1] == lengths[0]).all():
        raise ValueError(f"line {lines[-1] + 1} ends within a number: the file seems to be cut off")


def read_dofs(content: bytes) -> list[tuple[int, int | str]]:
    """Labels of a matrix's rows: CalculiX's lines of ``node.direction``, or ANSYS' of equation, node and direction."""
    lines = Text(content).content.decode("latin-1").split("\n")
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
    ``HBMAT``, one number in each line, the right-hand side at the end.
    """
    lines = Text(content).content.removesuffix(b"\n").split(b"\n")
    heads = lines[:4]
    try:
        counts = [int(word) for word in heads[1].split()]
        kind, sizes = heads[2][:3].decode("ascii").upper(), [int(word) for word in heads[2][3:].split()]
        found_formats = re.findall(
            rb"\((?:\d*P,?)?(\d*)[IEDFG](\d+)(?:\.\d+)?(?:E\d+)?\)", heads[3].upper().replace(b" ", b"")
        )
        formats = [(int(n or 1), int(width)) for n, width in found_formats]
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
            changed = re.sub(rb"(?<=[\d.])([+-])(?=\d)", rb"E\1", word.upper().replace(b"D", b"E").replace(b"_", b"?"))
            found.append(float(changed))
        except ValueError:
            raise ValueError(f"line {line}: {word.decode('latin-1').strip()!r} is not a number") from None
    return found


class Head(NamedTuple):
    """What stands before a matrix of OUTPUT4."""

    n_columns: int
    n_rows: int
    form: int
    kind: int
    name: str

    @property
    def is_big(self) -> bool:
        """Whether a string's length and row are two numbers."""
        return self.n_rows < 0 or self.n_rows >= STRING


class Strings:
    """Values that stand below one another in a column: where each string of them begins, how long it is, and values."""

    def __init__(self, head: Head):
        self.head = head
        self.places = array("q")

    def add(self, column: int, row: int, length: int) -> None:
        """Note a string; columns and rows count from 1."""
        if not (1 <= column <= self.head.n_columns and 1 <= row <= abs(self.head.n_rows) + 1 - length):
            raise ValueError(f"{length} values from row {row} of column {column}; expected them within the matrix")
        self.places.extend((column, row, length))

    def matrix(self, values: Numbers) -> scipy.sparse.csc_array | None:
        """The whole matrix, if it is square; None otherwise."""
        n_columns, n_rows, form, *_ = self.head
        if n_columns != abs(n_rows):
            return None
        columns, rows, lengths = np.array(self.places, dtype=np.int64).reshape(-1, 3).T
        used = np.flatnonzero(values)
        string = np.repeat(np.arange(len(lengths)), lengths)[used]
        entries = (rows - 1 - np.cumsum(lengths) + lengths)[string] + used, columns[string] - 1, values[used], n_columns
        return symmetric(*entries, in_order=True) if form == 6 else square(*entries)


def read_op4(content: bytes) -> dict[str, scipy.sparse.csc_array | None]:
    """Matrices of Nastran's OUTPUT4 by name, dense or sparse; None for complex or rectangular ones.

    MSC Nastran DMAP Programmer's Guide, module OUTPUT4. Rows have no labels.
    """
    return dict(_of_records(content) if 0 in content[:4] else _of_lines(content))


class Lines:
    """Lines of a text that are read one after the other."""

    def __init__(self, content: bytes):
        self.lines = Text(content).content.split(b"\n")
        self.number = 0

    def __bool__(self) -> bool:
        return self.number < len(self.lines)

    def take(self) -> bytes:
        self.number += 1
        return self.lines[self.number - 1]

    def take_values(self) -> Iterator[bytes]:
        """The lines up to the next one without a decimal point."""
        while self and b"." in self.lines[self.number]:
            yield self.take()


def _of_lines(content: bytes) -> Iterator[tuple[str, scipy.sparse.csc_array | None]]:
    """Matrices of a text: a heading, then a line for each column or string, and its values."""
    lines = Lines(content)
    while lines:
        line = lines.take()
        if not line.strip():
            continue
        number, heading = lines.number, OP4_HEADING.fullmatch(line)
        if heading is None:
            raise ValueError(f"line {number} is {line[:40].decode('latin-1')!r}; expected the heading of a matrix")
        n_columns, n_rows, form, kind = (int(word) for word in heading.groups()[:4])
        head = Head(n_columns, n_rows, form, kind, heading[5].decode("ascii"))
        n, width = map(int, heading.group(6, 7)) if heading[6] else (5, 16)
        try:
            yield head.name, _of_text(lines, head, n, width)
        except ValueError as error:
            raise ValueError(f"matrix {head.name!r} of line {number}: {error}") from error


def _of_text(lines: Lines, head: Head, n: int, width: int) -> scipy.sparse.csc_array | None:
    """The matrix whose columns come next; its values stand n in a line, in fields of a width."""
    strings, values, column = Strings(head), array("d"), 0
    size_of, is_real = 1 if head.kind % 2 else 2, head.kind in REAL_KINDS
    while lines:
        line = lines.take()
        number, words = lines.number, [_whole_word(word, lines.number) for word in line.split()]
        if len(words) == 3:
            column, row, stated = words
            if column == head.n_columns + 1:
                if lines:
                    _values(lines.take(), lines.number, n, width)  # a number without meaning
                return strings.matrix(np.array(values)) if is_real else None
            stated = stated if row else 0
        elif column and len(words) == 2 and head.is_big:
            stated, row = words[0] - 1, words[1]
        elif column and len(words) == 1 and not head.is_big:
            stated, row = words[0] // STRING - 1, words[0] % STRING
        elif words:
            raise ValueError(f"line {number} starts neither a column nor a string")
        start = len(values)
        for line in lines.take_values():
            if is_real:
                values.extend(_values(line, lines.number, n, width))
        length = len(values) - start
        if not is_real or not words:
            continue
        if stated != size_of * length and not (len(words) == 3 and stated == length):  # some count a block's values
            raise ValueError(f"line {number} states {stated} words; {length} values follow")
        if length:
            strings.add(column, row, length)
    raise ValueError(f"no end after {head.n_columns} columns: the file seems to be cut off")


def _values(line: bytes, number: int, n: int, width: int) -> list[float]:
    count = line.count(b".")
    if count > n:
        raise ValueError(f"line {number} holds {count} values; expected at most {n}")
    return reals([line[i : i + width] for i in range(0, count * width, width)], number)


def _of_records(content: bytes) -> Iterator[tuple[str, scipy.sparse.csc_array | None]]:
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
        head = Head(*numbers, name.decode("latin-1"))
        real = f"{order}f{8 if head.kind % 2 == 0 else word}"
        try:
            yield head.name, _of_columns(records, head, integer, real)
        except ValueError as error:
            raise ValueError(f"matrix {head.name!r} of byte {at}: {error}") from error


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
    strings, values, before, is_dense = Strings(head), bytearray(), 0, None
    word, size = np.dtype(integer).itemsize, np.dtype(real).itemsize
    start_of_string = (2 if head.is_big else 1) * word
    for at, record in records:
        if len(record) < 3 * word:
            raise ValueError(f"a record of {len(record)} bytes at byte {at}; expected a column")
        column, row, n_words = np.frombuffer(record[: 3 * word], integer).tolist()
        if column == head.n_columns + 1:
            return strings.matrix(np.frombuffer(values, real).astype(float)) if head.kind in REAL_KINDS else None
        if column <= before or len(record) != (3 + n_words) * word or is_dense not in (None, row > 0):
            what = f"column {column} from row {row}, of {n_words} words, in {len(record)} bytes"
            raise ValueError(f"after column {before}, {what}")
        before, start, is_dense = column, 3 * word, row > 0
        while head.kind in REAL_KINDS and start < len(record):
            stop = len(record)
            if not row or start > 3 * word:
                numbers = np.frombuffer(record[start : start + start_of_string].ljust(start_of_string, b"\0"), integer)
                length, row = numbers.tolist() if head.is_big else divmod(int(numbers[0]), STRING)
                start, stop = start + start_of_string, start + (length + head.is_big) * word
            length, rest = divmod(stop - start, size)
            if rest or not start < stop <= len(record):
                raise ValueError(f"a string of {stop - start} bytes in column {column}; {len(record) - start} are left")
            strings.add(column, row, length)
            values += record[start:stop]
            start = stop
    raise ValueError(f"no end after {head.n_columns} columns: the file seems to be cut off")


def _whole_word(word: bytes, line: int) -> int:
    number = int(word) if word.isdigit() and len(word) < 20 else MOST_INTEGER + 1
    if number > MOST_INTEGER:
        raise ValueError(f"line {line}: {word.decode('latin-1')!r} is not a whole number up to {MOST_INTEGER}")
    return number


class Entries:
    """The entries of a matrix of DMIG, by grid point and component of row and column."""

    def __init__(self, line: int) -> None:
        self.line, self.head = line, list[int]()
        self.rows, self.columns, self.values = array("q"), array("q"), array("d")

    def matrix(self) -> Labelled | None:
        """The matrix with its labels; None if it is complex or rectangular."""
        form, kind = self.head
        if form not in (1, 6) or kind not in REAL_KINDS:
            return None
        rows, columns = (np.array(labels, dtype=np.int64).reshape(-1, 2) for labels in (self.rows, self.columns))
        return labelled(rows, columns, np.array(self.values), is_symmetric=form == 6)


def read_dmig(content: bytes) -> dict[str, Labelled | None]:
    """Matrices of Nastran's DMIG entries by name, in small, large or free field; None for complex or rectangular ones.

    The labels are grid point and component. MSC Nastran and OptiStruct Quick Reference Guides, bulk data entry DMIG;
    ``EXTOUT=DMIGPCH`` writes them to the punch file. A half of a symmetric matrix (form 6) or all of it may be there.
    """
    text = Text(content.upper()).content
    is_free, found, name, column = (
        re.search(rb"^DMIG\*? *,", text, re.MULTILINE) is not None,
        dict[str, Entries](),
        "",
        [0, 0],
    )
    for number, line in enumerate(text.split(b"\n"), start=1):
        is_card = line[:1].isalpha()
        if is_card:
            name = ""
        if not (line[:4] == b"DMIG" and line[4:5] in b" *," if is_card else name and line[:1] in b" +*,"):
            continue
        fields = _fields(line, is_free=is_free)
        if is_card:
            name, column = fields[0].decode("latin-1"), [_whole_word(field or b"0", number) for field in fields[1:4]]
            if not 0 < len(name) <= 8:
                raise ValueError(f"line {number}: {name!r} is no name of one to eight characters")
            entries = found.setdefault(name, Entries(number))
            if column[0] == 0:
                entries.head = column[1:]
                if column[1] not in (1, 2, 6, 9) or column[2] not in (1, 2, 3, 4):
                    stated = f"form {column[1]} and type {column[2]}"
                    raise ValueError(f"line {number}: matrix {name!r} has {stated}; expected 6 and 2, or such")
        for i in range(4 * is_card, len(fields) - 2, 4) if column[0] else ():
            node, component, value = fields[i : i + 3]
            if value:
                entries.rows.extend((_whole_word(node, number), _whole_word(component or b"0", number)))
                entries.columns.extend(column[:2])
                entries.values.extend(reals([value], number))
            elif node or component:
                raise ValueError(f"line {number}: matrix {name!r} has an entry without a value")
    if not found:
        raise ValueError("no DMIG entry")
    for name, entries in found.items():
        if not entries.head:
            raise ValueError(f"line {entries.line}: matrix {name!r} has no entry that states its form")
    return {name: entries.matrix() for name, entries in found.items()}


def _fields(line: bytes, *, is_free: bool) -> list[bytes]:
    """Four or eight fields of a line, without its first."""
    if is_free and b"," in line:
        fields = [field.strip() for field in line.partition(b"$")[0].split(b",")[1:9]]
        return fields + [b""] * (-len(fields) % 4)
    if b"*" in line[:8]:
        return [line[8:24].strip(), line[24:40].strip(), line[40:56].strip(), line[56:72].strip()]
    return [line[i : i + 8].strip() for i in range(8, 72, 8)]
