"""Matrices in files that Nastran writes: OUTPUT4, as text and binary, and DMIG entries. Errors name line or byte."""

import re
from array import array
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.sparse

from skthermo._io._text_matrices import (
    MOST,
    Labelled,
    Numbers,
    Text,
    labelled,
    reals,
    square,
    symmetric,
)

HEADING = re.compile(
    rb"([ \d]{8}|[ \d]{16})([ \d-]{8}|[ \d-]{16})([ \d]{8})([ \d]{8})([A-Z]\w{0,7})"
    rb"[ \0]*(?:(?:1P,)?(\d{1,3})[EDed](\d{1,3})\.\d+)?(?:\|I16)?[ \t]*"
)
USUAL_FORMAT = 5, 16  # values in a line and characters of each, if a heading does not say so
STRING = 65536  # a string's length and row in one number, where there are fewer rows
REAL = 1, 2  # types of real numbers, in single and double precision; others are complex
SYMMETRIC = 6  # the form of a matrix of which one half may be given
FREE_FIELD = re.compile(rb"^DMIG\*? *,", re.MULTILINE)


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
        return symmetric(*entries, in_order=True) if form == SYMMETRIC else square(*entries)


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
        number, heading = lines.number, HEADING.fullmatch(line)
        if heading is None:
            raise ValueError(f"line {number} is {line[:40].decode('latin-1')!r}; expected the heading of a matrix")
        n_columns, n_rows, form, kind = (int(word) for word in heading.groups()[:4])
        head = Head(n_columns, n_rows, form, kind, heading[5].decode("ascii"))
        n, width = map(int, heading.group(6, 7)) if heading[6] else USUAL_FORMAT
        try:
            yield head.name, _of_text(lines, head, n, width)
        except ValueError as error:
            raise ValueError(f"matrix {head.name!r} of line {number}: {error}") from error


def _of_text(lines: Lines, head: Head, n: int, width: int) -> scipy.sparse.csc_array | None:
    """The matrix whose columns come next; its values stand n in a line, in fields of a width."""
    strings, values, column = Strings(head), array("d"), 0
    size_of, is_real = 1 if head.kind % 2 else 2, head.kind in REAL
    while lines:
        line = lines.take()
        number, words = lines.number, [_whole(word, lines.number) for word in line.split()]
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
            return strings.matrix(np.frombuffer(values, real).astype(float)) if head.kind in REAL else None
        if column <= before or len(record) != (3 + n_words) * word or is_dense not in (None, row > 0):
            what = f"column {column} from row {row}, of {n_words} words, in {len(record)} bytes"
            raise ValueError(f"after column {before}, {what}")
        before, start, is_dense = column, 3 * word, row > 0
        while head.kind in REAL and start < len(record):
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


def _whole(word: bytes, line: int) -> int:
    number = int(word) if word.isdigit() and len(word) < 20 else MOST + 1
    if number > MOST:
        raise ValueError(f"line {line}: {word.decode('latin-1')!r} is not a whole number up to {MOST}")
    return number


class Entries:
    """The entries of a matrix of DMIG, by grid point and component of row and column."""

    def __init__(self, line: int) -> None:
        self.line, self.head = line, list[int]()
        self.rows, self.columns, self.values = array("q"), array("q"), array("d")

    def matrix(self) -> Labelled | None:
        """The matrix with its labels; None if it is complex or rectangular."""
        form, kind = self.head
        if form not in (1, SYMMETRIC) or kind not in REAL:
            return None
        rows, columns = (np.array(labels, dtype=np.int64).reshape(-1, 2) for labels in (self.rows, self.columns))
        return labelled(rows, columns, np.array(self.values), is_symmetric=form == SYMMETRIC)


def read_dmig(content: bytes) -> dict[str, Labelled | None]:
    """Matrices of Nastran's DMIG entries by name, in small, large or free field; None for complex or rectangular ones.

    The labels are grid point and component. MSC Nastran and OptiStruct Quick Reference Guides, bulk data entry DMIG;
    ``EXTOUT=DMIGPCH`` writes them to the punch file. A half of a symmetric matrix (form 6) or all of it may be there.
    """
    text = Text(content.upper()).content
    is_free, found, name, column = FREE_FIELD.search(text) is not None, dict[str, Entries](), "", [0, 0]
    for number, line in enumerate(text.split(b"\n"), start=1):
        is_card = line[:1].isalpha()
        if is_card:
            name = ""
        if not (line[:4] == b"DMIG" and line[4:5] in b" *," if is_card else name and line[:1] in b" +*,"):
            continue
        fields = _fields(line, is_free=is_free)
        if is_card:
            name, column = fields[0].decode("latin-1"), [_whole(field or b"0", number) for field in fields[1:4]]
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
                entries.rows.extend((_whole(node, number), _whole(component or b"0", number)))
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
