"""Matrices in binary files that FE programs write: Nastran's OUTPUT4."""

from collections.abc import Iterator

import numpy as np
import scipy.sparse

HEAD = 24  # bytes of the record that begins a matrix: columns, rows, form, type and name
KINDS = {1: "f4", 2: "f8"}  # types of real numbers, in single and in double precision


def read_binary_op4(content: bytes) -> dict[str, scipy.sparse.csc_array | None]:
    """Matrices of Nastran's OUTPUT4 in binary form with dense columns, by name; None for complex ones.

    MSC Nastran DMAP Programmer's Guide, module OUTPUT4. A record has its length before and after it; there is one for
    the head of a matrix, one for each column that is not zero, and one for a column beyond the last.
    """
    order = "<" if content[:1] == bytes([HEAD]) else ">"
    records = _records(content, order)
    matrices: dict[str, scipy.sparse.csc_array | None] = {}
    for head in records:
        if len(head) != HEAD:
            raise ValueError(f"a record of {len(head)} bytes; expected {HEAD}, the head of a matrix")
        n_columns, n_rows, _, kind = np.frombuffer(head[:16], order + "i4").tolist()
        name = head[16:].strip().decode("latin-1")
        try:
            if n_rows < 0:
                raise ValueError("its columns are sparse; expected dense ones: a positive unit in OUTPUT4, or DMIG")
            columns = list(_columns(records, n_columns, order))
            matrices[name] = _matrix(columns, (n_rows, n_columns), order + KINDS[kind]) if kind in KINDS else None
        except ValueError as error:
            raise ValueError(f"matrix {name!r}: {error}") from error
    return matrices


def _records(content: bytes, order: str) -> Iterator[bytes]:
    at = 0
    while at < len(content):
        (length,) = np.frombuffer(content[at : at + 4], order + "i4")
        end = at + 4 + int(length)
        if length < 0 or content[end : end + 4] != content[at : at + 4]:
            raise ValueError(f"the record at byte {at} has no end: the file is damaged or cut off")
        yield content[at + 4 : end]
        at = end + 4


def _columns(records: Iterator[bytes], n_columns: int, order: str) -> Iterator[tuple[int, int, bytes]]:
    """Column, first row, both from 0, and numbers of each record up to the column beyond the last."""
    before = -1
    for record in records:
        if len(record) < 12:
            raise ValueError(f"a record of {len(record)} bytes; expected a column")
        column, row, n_words = np.frombuffer(record[:12], order + "i4").tolist()
        if column > n_columns:
            return
        if not row:
            raise ValueError("its columns are sparse; expected dense ones: a positive unit in OUTPUT4, or DMIG")
        if not before < column - 1 or row < 0 or len(record) != 12 + 4 * n_words:
            raise ValueError(f"after column {before + 1}, a record of column {column}, row {row} and {n_words} words")
        before = column - 1
        yield before, row - 1, record[12:]
    raise ValueError("no end: the file seems to be cut off")


def _matrix(columns: list[tuple[int, int, bytes]], shape: tuple[int, int], kind: str) -> scipy.sparse.csc_array:
    values = [np.frombuffer(numbers, kind) for _, _, numbers in columns]
    too_long = [
        column + 1 for (column, row, _), part in zip(columns, values, strict=True) if row + len(part) > shape[0]
    ]
    if too_long:
        raise ValueError(f"column {too_long[0]} goes beyond row {shape[0]}")
    lengths = [len(part) for part in values]
    rows = np.concatenate(
        [np.empty(0, int), *(row + np.arange(n) for (_, row, _), n in zip(columns, lengths, strict=True))]
    )
    places = np.repeat([column for column, _, _ in columns], lengths).astype(int)
    matrix = scipy.sparse.csc_array((np.concatenate([np.empty(0), *values]), (rows, places)), shape=shape)
    matrix.eliminate_zeros()
    return matrix
