"""Matrices of Nastran: DMIG entries, and OUTPUT4 as text or binary. Errors name line or byte."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse

from skthermo.fem.external._texts import (
    MOST_INTEGER,
    Integers,
    Labelled,
    Numbers,
    Words,
    fields,
    labelled,
    lines_ended,
    reals,
    square,
    symmetric,
    whole,
)

OP4_HEADING = re.compile(
    rb"([ \d]{8}|[ \d]{16})([ \d-]{8}|[ \d-]{16})([ \d]{8})([ \d]{8})([A-Z]\w{0,7})"
    rb"[ \0]*(?:(?:1P,)?(\d{1,3})[EDed](\d{1,3})\.\d+)?(?:\|I16)?[ \t]*"
)
REAL_KINDS = 1, 2  # types of real numbers, in single and double precision; others are complex


Entry = tuple[int, int, bytes]
"""Four fields of a DMIG card or its continuation: the number of its head, its line, and the fields."""


def read_dmig(content: bytes) -> dict[str, Labelled | None]:
    """Matrices of Nastran's DMIG entries by name, in small, large or free field; None for complex or rectangular ones.

    The labels are grid point and component. MSC Nastran and OptiStruct Quick Reference Guides, bulk data entry DMIG;
    ``EXTOUT=DMIGPCH`` writes them to the punch file. A half of a symmetric matrix (form 6) or all of it may be there.
    """
    text = lines_ended(content.upper())
    is_free = b"," in text and re.search(rb"^DMIG\*? *,", text, re.MULTILINE)
    width = 32 if is_free else 16  # free fields may be longer
    heads, entries, parts = list[Entry](), list[Entry](), [_cells((), width)]
    number = at = 0
    for card in re.finditer(rb"^DMIG[ *,].*(?:\n(?![A-Z]).*)*", text, re.MULTILINE):  # with its continuations
        number, at = number + text.count(b"\n", at, card.start()), card.start()
        (_, _, head), *own = _groups(card[0].split(b"\n"), len(heads), number + 1, width)
        heads.append((len(heads), number + 1, head))
        if head[width : 2 * width].strip(b" 0"):  # a column; else the card states the form
            entries += own
        if len(entries) > 100_000:  # their words take far more memory than their numbers
            parts.append(_cells(entries, width))
            entries.clear()
    parts.append(_cells(entries, width))
    del text, content
    owners, rows, values = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return _named_matrices(heads, width, owners, rows, values)


def _groups(lines: list[bytes], head: int, first: int, width: int) -> list[Entry]:
    """Groups of four fields, each filled up to a width: name and column, then node, component and value."""
    found: list[Entry] = []
    for number, line in enumerate(lines, start=first):
        if line[:1] not in b"D +*,":
            continue
        if width == 16 and b"*" in line[:8]:
            found.append((head, number, line[8:72]))
            continue
        if width == 32 and b"," in line:
            parts = [part.strip() for part in line.partition(b"$")[0].split(b",")[1:9]]
        elif b"*" in line[:8]:
            parts = [line[i : i + 16] for i in range(8, 72, 16)]
        else:
            parts = [line[i : i + 8] for i in range(8, 72, 8)]
        filled = [b"".join([part.ljust(width) for part in parts[i : i + 4]]) for i in range(0, len(parts), 4)]
        found += [(head, number, group) for group in filled]
    return found[:1] + [entry for entry in found[1:] if entry[2][: 3 * width].strip()]


def _cells(entries: Sequence[Entry], width: int) -> tuple[Integers, Integers, Numbers]:
    """Number of the head, label (n, 2) and value of each entry."""
    heads, lines, words = _columns(entries, width)
    nodes = _whole_words(words[:, :1], lines, "a node", 1)
    rows = np.column_stack([nodes, _whole_words(words[:, 1:2], lines, "a component", 0)])
    return heads, rows, reals(words[:, 2], lines)


def _columns(entries: Sequence[Entry], width: int) -> tuple[Integers, Integers, Words]:
    heads, lines, groups = zip(*entries, strict=True) if entries else ((), (), ())
    return np.array(heads, dtype=np.int64), np.array(lines, dtype=np.int64), fields(list(groups), 4, width)


def _named_matrices(
    heads: Sequence[Entry], width: int, owners: Integers, rows: Integers, values: Numbers
) -> dict[str, Labelled | None]:
    """Matrices from the cards that name them and a column, and from the entries of each such card."""
    _, lines, words = _columns(heads, width)
    names = [name.strip().decode("latin-1") for name in words[:, 0].tolist()]
    columns = _whole_words(words[:, 1:4], lines, "a node, component or form", 0)
    forms = dict[str, list[int]]()
    for name, (node, form, kind), line in zip(names, columns.tolist(), lines.tolist(), strict=True):
        if not 0 < len(name) <= 8:
            raise ValueError(f"line {line}: {name!r} is no name of one to eight characters")
        if node == 0:
            forms[name] = [form, kind]
            if form not in (1, 2, 6, 9) or kind not in (1, 2, 3, 4):
                stated = f"form {form} and type {kind}"
                raise ValueError(f"line {line}: matrix {name!r} has {stated}; expected 6 and 2, or such")
    if not names:
        raise ValueError("no DMIG entry")
    for name, line in zip(names, lines.tolist(), strict=True):
        if name not in forms:
            raise ValueError(f"line {line}: matrix {name!r} has no entry that states its form")
    found: dict[str, Labelled | None] = dict.fromkeys(names)
    for name, (form, kind) in forms.items():
        if form in (1, 6) and kind in REAL_KINDS:
            own = np.array([other == name for other in names])[owners]
            found[name] = labelled(rows[own], columns[owners[own], :2], values[own], is_symmetric=form == 6)
    return found


def _whole_words(words: Words, lines: Integers, what: str, least: int) -> Integers:
    """Whole numbers in words, where a blank is zero."""
    words = np.char.strip(words)
    words[words == b""] = b"0"
    return whole(reals(words.ravel(), np.repeat(lines, words.shape[1])), what, least).reshape(words.shape)


class Head(NamedTuple):
    """Facts before a matrix of OUTPUT4."""

    n_columns: int
    n_rows: int
    form: int
    kind: int
    name: str

    @property
    def is_big(self) -> bool:
        """Whether a string's length and row are two numbers, and not one of 65536 times the first plus the second."""
        return self.n_rows < 0 or self.n_rows >= 65536

    def matrix(self, strings: list[tuple[int, int, int]], values: Numbers) -> scipy.sparse.csc_array | None:
        """The matrix of strings of values below one another: column, first row and length of each; None if not square.

        Columns and rows count from 1.
        """
        if self.n_columns != abs(self.n_rows) or self.kind not in REAL_KINDS:
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


def read_op4(content: bytes) -> dict[str, scipy.sparse.csc_array | None]:
    """Matrices of Nastran's OUTPUT4 by name, dense or sparse; None for complex or rectangular ones.

    MSC Nastran DMAP Programmer's Guide, module OUTPUT4. Rows have no labels.
    """
    return dict(_in_records(content) if 0 in content[:4] else _in_lines(lines_ended(content).split(b"\n")))


def _in_lines(lines: list[bytes]) -> Iterator[tuple[str, scipy.sparse.csc_array | None]]:
    """Matrices of a text: a heading, then a line for each column or string, and its values."""
    at = 0
    while at < len(lines):
        if not lines[at].strip():
            at += 1
            continue
        heading = OP4_HEADING.fullmatch(lines[at])
        if heading is None:
            got = lines[at][:40].decode("latin-1")
            raise ValueError(f"line {at + 1} is {got!r}; expected the heading of a matrix")
        n_columns, n_rows, form, kind = map(int, heading.groups()[:4])
        head = Head(n_columns, n_rows, form, kind, heading[5].decode("ascii"))
        n, width = map(int, heading.group(6, 7)) if heading[6] else (5, 16)
        try:
            matrix, end = _of_text(lines, at + 1, head, n, width)
        except ValueError as error:
            raise ValueError(f"matrix {head.name!r} of line {at + 1}: {error}") from error
        yield head.name, matrix
        at = end


def _of_text(lines: list[bytes], at: int, head: Head, n: int, width: int) -> tuple[scipy.sparse.csc_array | None, int]:
    """The matrix whose columns begin at a line, and its end; values stand n in a line, in fields of a width."""
    strings, places, column = list[tuple[int, int, int]](), list[int](), 0
    words_a_value = 1 if head.kind % 2 else 2
    while at < len(lines):
        number, words = at + 1, _integers(lines[at], at + 1)
        start = at = at + 1
        while at < len(lines) and b"." in lines[at]:
            at += 1
        if len(words) == 3:
            column, row, stated = words
            if column == head.n_columns + 1:  # a number without meaning follows
                return head.matrix(strings, _values(lines, places, n, width)), start + 1
        elif column and len(words) == 2 and head.is_big:
            stated, row = words[0] - 1, words[1]
        elif column and len(words) == 1 and not head.is_big:
            stated, row = words[0] // 65536 - 1, words[0] % 65536
        elif words or start < at:
            raise ValueError(f"line {number} starts neither a column nor a string")
        if head.kind not in REAL_KINDS or not words:
            continue
        length = sum([line.count(b".") for line in lines[start:at]])
        stated = 0 if len(words) == 3 and row == 0 else stated  # the strings of the column follow
        if stated != words_a_value * length and not (len(words) == 3 and stated == length):  # some count values
            raise ValueError(f"line {number} states {stated} words; {length} values follow")
        if length:
            strings.append((column, row, length))
            places.extend(range(start, at))
    raise ValueError(f"no end after {head.n_columns} columns: the file seems to be cut off")


def _integers(line: bytes, number: int) -> list[int]:
    words = line.split()
    if not all(word.isdigit() and len(word) < 20 and int(word) <= MOST_INTEGER for word in words):
        got = line[:40].decode("latin-1").strip()
        raise ValueError(f"line {number} is {got!r}; expected whole numbers up to {MOST_INTEGER}")
    return [int(word) for word in words]


def _values(lines: list[bytes], places: list[int], n: int, width: int) -> Numbers:
    """Numbers in fields of some lines, as many in each as there are decimal points."""
    own = [lines[place] for place in places]
    counts = np.array([line.count(b".") for line in own], dtype=np.int64)
    if (counts > n).any():
        most = int(np.argmax(counts))
        raise ValueError(f"line {places[most] + 1} holds {counts[most]} values; expected at most {n}")
    return reals(fields(own, n, width)[np.arange(n) < counts[:, np.newaxis]], np.repeat(np.array(places) + 1, counts))


def _in_records(content: bytes) -> Iterator[tuple[str, scipy.sparse.csc_array | None]]:
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
        while head.kind in REAL_KINDS and start < len(record):
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
