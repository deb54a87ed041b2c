"""Readers of the same texts that go through them line by line, with plain Python numbers: what fast ones must give.

Each returns a dense matrix and the labels of its rows, or raises a ValueError or IndexError.
"""

import re

import numpy as np

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([EeDd][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)
MOST_ROWS = 2000


def lines_of(content):
    if any(byte < 9 for byte in content):
        raise ValueError("no text")
    return re.split(r"\r\n|\r|\n", content.decode("latin-1"))


def number(word, *, bare=False):
    word = word.strip(" \t\0\v\f")
    if bare:
        word = re.sub(r"(?<=[\d.])([+-])(?=\d)", r"E\1", word)
    if not NUMBER.fullmatch(word):
        raise ValueError(word)
    return float(word.replace("D", "E").replace("d", "e"))


def whole(word, least):
    value = number(word)
    if value != value // 1 or not least <= value < 2**31:
        raise ValueError(word)
    return int(value)


def mirrored(entries, dofs, in_order):
    """A dense matrix from a mapping of row and column to value, of which a half or all is given."""
    if not 0 < len(dofs) <= MOST_ROWS:
        raise ValueError(f"{len(dofs)} rows")
    entries = {place: value for place, value in entries.items() if value != 0}
    below = sum(i > j for i, j in entries)
    above = sum(i < j for i, j in entries)
    paired = sum(i != j and (j, i) in entries for i, j in entries)
    is_full = bool(below and above) and paired >= (below + above) / 2
    if below and above and not is_full and (paired or in_order):
        raise ValueError("both sides")
    matrix = np.zeros((len(dofs),) * 2)
    for (i, j), value in entries.items():
        matrix[i, j] = value
        if not is_full:
            matrix[j, i] = value
    return matrix


def dense(entries, size):
    if not 0 < size <= MOST_ROWS:
        raise ValueError(f"{size} rows")
    matrix = np.zeros((size, size))
    for (i, j), value in entries.items():
        matrix[i, j] = value
    return matrix


def of_labels(triples, *, is_symmetric=True):
    dofs = sorted({dof for row, column, _ in triples for dof in (row, column)})
    entries = {(dofs.index(row), dofs.index(column)): value for row, column, value in triples}
    if len(entries) < len(triples):
        raise ValueError("given twice")
    return (mirrored(entries, dofs, in_order=False) if is_symmetric else dense(entries, len(dofs))), tuple(dofs)


def read_entries(content):
    lines, rows, begun = lines_of(content), [], False
    for line in lines:
        text = line.strip(" \t")
        begun = begun or text[:1].isdigit() or text[:1] in ("+", "-", ".")
        words = text.replace(",", " ").split() if begun and text[:1] not in ("*", "%", "#", "!", "$") else []
        if words:
            rows.append(words)
    width = len(rows[0])
    if width not in (3, 5) or any(len(row) != width for row in rows):
        raise ValueError("words")
    if width == 5:
        least = -(2**31) + 1
        return of_labels(
            [
                ((whole(a, least), whole(b, 0)), (whole(c, least), whole(d, 0)), number(value))
                for a, b, c, d, value in rows
            ]
        )
    entries = {(whole(i, 1) - 1, whole(j, 1) - 1): number(value) for i, j, value in rows}
    if len(entries) < len(rows):
        raise ValueError("given twice")
    return mirrored(entries, range(1 + max(max(place) for place in entries)), in_order=True), ()


def fields(lines, count, n, width):
    spaced = [word for line in lines for word in line.split()]
    if len(spaced) == count:
        return [number(word, bare=True) for word in spaced]
    if any(line[n * width :].strip() for line in lines):
        raise ValueError("longer")
    words = [line.ljust(n * width)[i * width : (i + 1) * width] for line in lines for i in range(n)]
    return [number(word, bare=True) for word in words[:count]]


def read_harwell_boeing(content):
    lines = lines_of(content)
    counts, kind = [int(word) for word in lines[1].split()], lines[2][:3].upper()
    size, n_columns, n_entries = (int(word) for word in lines[2][3:].split()[:3])
    pattern = r"\((?:\d*P,?)?(\d*)[IEDFG](\d+)(?:\.\d+)?(?:E\d+)?\)"
    forms = [(int(n or 1), int(width)) for n, width in re.findall(pattern, lines[3].upper().replace(" ", ""))]
    if kind not in ("RSA", "RUA", "ISA", "IUA") or size != n_columns:
        raise ValueError(kind)
    at, blocks = 5 if counts[4:] > [0] or min(counts) < 0 else 4, []
    for n_lines, count, (n, width) in zip(counts[1:4], (size + 1, n_entries, n_entries), forms[:3], strict=True):
        if n_lines != -(-count // n) or at + n_lines > len(lines):
            raise ValueError("lines")
        blocks.append(fields(lines[at : at + n_lines], count, n, width))
        at += n_lines
    pointers, rows, values = blocks
    if pointers[0] != 1 or pointers[-1] != n_entries + 1 or sorted(pointers) != pointers:
        raise ValueError("pointers")
    columns = [j for j in range(size) for _ in range(int(pointers[j + 1] - pointers[j]))]
    if any(row % 1 or not 1 <= row <= size for row in rows):
        raise ValueError("rows")
    entries = {(int(i) - 1, j): value for i, j, value in zip(rows, columns, values, strict=True)}
    if len(entries) < n_entries:
        raise ValueError("given twice")
    if kind[1] == "S":
        return mirrored(entries, range(size), in_order=True), ()
    return dense(entries, size), ()


def read_dmig(content):
    """The matrix of a file of fixed fields that holds one."""
    heads, triples, owner = {}, {}, None
    for line in lines_of(content.upper()):
        line = line.ljust(80)
        if line[0].isascii() and line[0].isalpha():
            is_ours = line[:4] == "DMIG" and line[4] in " *"
            owner = None
            if not is_ours:
                continue
            width = 16 if line[4] == "*" else 8
            name = line[8 : 8 + width].strip()
            if not 0 < len(name) <= 8:
                raise ValueError("name")
            first = [
                number(line[i : i + width].strip() or ("nan" if i == 8 + width else "0"), bare=True)
                for i in range(8 + width, 8 + 4 * width, width)
            ]
            triples.setdefault(name, [])
            if first[0] == 0:
                heads[name] = first[1:]
                continue
            owner = name, first[:2]
            groups = [line[40:72]] if width == 8 else []
        elif owner is None or line[0] not in " +*":
            continue
        else:
            width = 16 if line[0] == "*" else 8
            groups = [line[8:72]] if width == 16 else [line[8:40], line[40:72]]
        for group in groups:
            words = [group[i : i + width].strip() for i in range(0, 4 * width, width)]
            if any(words[:3]) or group[:width].strip():
                triples[owner[0]].append((owner[1], words))
    (name,) = triples
    form, kind = heads[name]
    if form not in (1, 6) or kind not in (1, 2):
        raise ValueError("form")
    found = []
    for column, (node, direction, value, _) in triples[name]:
        labels = [(whole(repr(column[0]), 1), whole(repr(column[1]), 0))]
        labels.append((int(number(node, bare=True)), int(number(direction or "0", bare=True))))
        whole(repr(number(node, bare=True)), 1)
        whole(repr(number(direction or "0", bare=True)), 0)
        found.append((labels[1], labels[0], number(value, bare=True)))
    return of_labels(found, is_symmetric=form == 6)


def read_op4(content):
    """The matrix of a file that holds one."""
    lines = lines_of(content)
    n_columns, n_rows, form, kind = (int(lines[0][i : i + 8]) for i in range(0, 32, 8))
    n, width = (int(word) for word in re.search(r"(\d+)[ED](\d+)\.\d+", lines[0][40:]).groups())
    if n_columns != abs(n_rows) or kind not in (1, 2):
        raise ValueError("form")
    body = [line for line in lines[1:] if line.split()]
    entries, at, column = {}, 0, None
    n_given = 0
    while at < len(body):
        words = [whole(word, 0) for word in body[at].split()]
        at += 1
        if len(words) == 3:
            column, row, length = words
            if column == n_columns + 1:  # a number without meaning follows
                break
            if row == 0:
                continue
        elif n_rows < 0:
            length, row = words[0] - 1, words[1]
        else:
            (packed,) = words
            length, row = packed // 65536 - 1, packed % 65536
        values = []
        while at < len(body) and "." in body[at]:
            count = body[at].count(".")
            if count > n:
                raise ValueError("values")
            values += [number(body[at].ljust(n * width)[i * width : (i + 1) * width], bare=True) for i in range(count)]
            at += 1
        if length != kind * len(values) and not (len(words) == 3 and length == len(values)):
            raise ValueError("length")
        n_given += len(values)
        entries |= {(row - 1 + i, column - 1): value for i, value in enumerate(values)}
    if column != n_columns + 1 or len(entries) < n_given:
        raise ValueError("end")
    if any(not (0 <= i < n_columns and 0 <= j < n_columns) for i, j in entries):
        raise ValueError("rows")
    return (mirrored(entries, range(n_columns), in_order=True) if form == 6 else dense(entries, n_columns)), ()


def reader_of(kind):
    """The slow reader of a kind of text; None for free field, which has none."""
    if "free" in kind:
        return None
    for word, reader in {"DMIG": read_dmig, "OP4": read_op4}.items():
        if word in kind:
            return reader
    is_boeing = any(word in kind for word in ("RSA", "RUA", "ANSYS", "Boeing"))
    return read_harwell_boeing if is_boeing else read_entries


def agrees(kind, content, found):
    """Whether the slow reader finds in a text of some kind what was found; what no model can use is not compared."""
    read, matrices = reader_of(kind), [one for one in found.matrices.values() if one is not None]
    if read is None or len(matrices) != 1 or not 0 < matrices[0].shape[0] <= MOST_ROWS:
        return True
    got = matrices[0].toarray()
    if not np.isfinite(got).all():
        return True
    try:
        matrix, dofs = read(content)
    except (ValueError, IndexError, KeyError, TypeError, AttributeError):
        return False
    return dofs == found.dofs and matrix.shape == got.shape and np.allclose(matrix, got, rtol=1e-14, atol=0)
