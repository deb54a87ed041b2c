"""Matrices in texts that FE programs write: lines of entries, Harwell-Boeing, Nastran's DMIG and OUTPUT4.

Texts are read as arrays of bytes, in parts of many lines at once. Errors name the line.
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]
Grid = NDArray[np.uint8]

BYTES_FOR_EACH_ROW = 100  # that checks of a sparse matrix take, its entries apart
LINES_AT_ONCE = 20_000
SPACE, STAR, TAB, NEWLINE, POINT = b" *\t\n."
MOST = 2**31 - 1  # rows, nodes and components are smaller
HEADING = re.compile(rb"\A(?:[ \t]*(?![ \t\d+\-.]).*(?:\n|\Z))*")
COMMENTS = re.compile(rb"^[ \t]*[*%#!$].*$", re.MULTILINE)
TO_FLOATS = bytes.maketrans(b"Dd,", b"EE ")
BARE_EXPONENT = re.compile(rb"(?<=[\d.])([+-])(?=\d)")
FORTRAN = re.compile(rb"\((?:\d*P,?)?(\d*)[IEDFG](\d+)(?:\.\d+)?(?:E\d+)?\)")
OP4_HEADING = re.compile(rb"^[ \d-]{32}[A-Z][\w ]{7} *(?:1P,)?(\d+)[ED](\d+)\.\d+[ \t]*$", re.MULTILINE)
SYMMETRIC = 6  # the form of a matrix in Nastran of which one half may be given
OP4_STRING = 65536  # a string's length and row in one number
FREE_FIELD = re.compile(rb"^DMIG\*? *,", re.MULTILINE)
WIDE = 32  # characters of a field of a text that was in free field
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

    def count(self, character: int) -> Integers:
        """How often each line has a character."""
        places = np.flatnonzero(self.bytes == character)
        return np.searchsorted(places, self.ends) - np.searchsorted(places, self.starts)

    def grid(self, lines: Integers, width: int) -> Grid:
        """The first characters of some lines, (n_lines, width), with spaces after the end of a line."""
        starts, ends = self.starts[lines], self.ends[lines]
        n_lines, steps = len(starts), np.diff(starts)
        grid = np.full((n_lines, width), SPACE, dtype=np.uint8)
        if n_lines > 1 and (steps == steps[0]).all() and ends[-1] - starts[-1] == steps[0] - 1 <= width:
            even = self.bytes[starts[0] : ends[-1]]  # a table of characters, but for the last line end
            grid[:-1, : steps[0] - 1] = even[: -steps[0] + 1].reshape(n_lines - 1, steps[0])[:, :-1]
            grid[-1, : steps[0] - 1] = even[-steps[0] + 1 :]
        elif len(self.bytes):
            places = starts[:, np.newaxis] + np.arange(width)
            inside = places < ends[:, np.newaxis]
            grid[inside] = self.bytes[places[inside]]
        return grid

    def parts(self, lines: Integers) -> Iterator[Integers]:
        """Lines in parts that take little memory."""
        for start in range(0, len(lines), LINES_AT_ONCE):
            yield lines[start : start + LINES_AT_ONCE]


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


def _fields(grid: Grid, lines: Integers, if_blank: bytes = b"") -> Numbers:
    """One number for each row of characters; ``if_blank`` is what those of spaces alone mean."""
    if if_blank:
        empty = (grid == SPACE).all(axis=1)
        grid[empty, grid.shape[1] - len(if_blank) :] = list(if_blank)
    spaced = np.full((len(grid), grid.shape[1] + 2), SPACE, dtype=np.uint8)
    spaced[:, 1:-1] = grid
    blank = spaced <= SPACE
    is_one = (blank[:, :-1] & ~blank[:, 1:]).sum(axis=1) == 1
    text = spaced.tobytes().translate(TO_FLOATS)
    for change in (lambda text: text, lambda text: BARE_EXPONENT.sub(rb"E\1", text)):
        try:
            numbers = np.fromstring(change(text), sep=" ") if is_one.all() else np.empty(0)
        except (DeprecationWarning, ValueError):
            continue
        if len(numbers) == len(grid):
            return numbers
    for row, line, is_word in zip(grid, lines, is_one, strict=True):
        word = row.tobytes()
        try:
            if not is_word:
                raise ValueError
            float(BARE_EXPONENT.sub(rb"E\1", word.translate(TO_FLOATS)))
        except ValueError:
            raise ValueError(f"line {line + 1}: {word.decode('latin-1').strip()!r} is not a number") from None
    raise ValueError(f"lines {lines[0] + 1} to {lines[-1] + 1}: what is not a number")


def _whole(numbers: Numbers, what: str, least: int = -MOST) -> Integers:
    """Whole numbers within the usual range."""
    wrong = ~((numbers % 1 == 0) & (numbers >= least) & (numbers <= MOST))
    if wrong.any():
        raise ValueError(f"{what} is {numbers[np.argmax(wrong)]:g}; expected whole numbers from {least} to {MOST}")
    return numbers.astype(np.int64)


def _nodes(pairs: Numbers, least: int = -MOST) -> Integers:
    """Labels, (n, 2), of nodes from ``least`` on and directions."""
    return np.column_stack([_whole(pairs[:, 0], "a node", least), _whole(pairs[:, 1], "a direction", 0)])


def _square(rows: Integers, columns: Integers, values: Numbers, size: int) -> scipy.sparse.csc_array:
    """A matrix each entry of which is given once."""
    bytearray(2 * BYTES_FOR_EACH_ROW * size)  # an error here if that is too much memory
    matrix = scipy.sparse.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()
    if matrix.nnz < len(values):
        keys = np.sort(rows * size + columns)
        row, column = divmod(int(keys[:-1][keys[1:] == keys[:-1]][0]), size)
        raise ValueError(f"the entry of row {row + 1} and column {column + 1} is given more than once")
    return matrix


def _symmetric(
    rows: Integers, columns: Integers, values: Numbers, size: int, *, in_order: bool
) -> scipy.sparse.csc_array:
    """A matrix of which one half or all entries are given; ``in_order``: a half is on one side of the diagonal."""
    matrix = _square(rows, columns, values, size)
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


def _labelled(rows: Integers, columns: Integers, values: Numbers, *, is_symmetric: bool = True) -> Labelled:
    """A matrix from the labels (n, 2) of rows and columns; of a symmetric one, a half may be given."""
    both = np.vstack([rows, columns])
    if both[:, 1].max(initial=0) >= 2**15:
        raise ValueError(f"a direction is {both[:, 1].max()}; expected a number such as 1 to 6")
    codes, places = np.unique(both[:, 0] * 2**15 + both[:, 1], return_inverse=True)
    first, second = np.split(places, 2)
    entries = first, second, values, len(codes)
    matrix = _symmetric(*entries, in_order=False) if is_symmetric else _square(*entries)
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
        return _symmetric(rows - 1, columns - 1, numbers[:, 2], size, in_order=True)
    return _labelled(_nodes(numbers[:, :2]), _nodes(numbers[:, 2:4]), numbers[:, 4])


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
    text = Text(content)
    heads = [text.content[text.starts[i] : text.ends[i]] for i in range(min(4, len(text)))]
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
    start, found, words = 5 if n_sides else 4, [], text.words()
    for n_lines, n_numbers, (n, width), what in zip(
        (pointers_in, rows_in, values_in),
        (n_columns + 1, n_entries, n_entries),
        forms,
        ("pointers", "rows", "values"),
        strict=True,
    ):
        if n_numbers < 0 or n_lines != -(-n_numbers // n) or start + n_lines > len(text):
            raise ValueError(
                f"{n_numbers} {what} in {n_lines} lines of {n} from line {start + 1}, of {len(text)} lines; expected "
                "as many as the heading says"
            )
        lines = np.arange(start, start + n_lines)
        found.append(_block(text, lines, words[lines], n_numbers, n, width))
        start += n_lines
    pointers, rows = _whole(found[0], "a pointer", 1) - 1, _whole(found[1], "a row", 1) - 1
    if pointers[0] or pointers[-1] != n_entries or (np.diff(pointers) < 0).any() or (rows >= n_rows).any():
        raise ValueError("pointers that do not rise from 1 to the number of entries, or rows beyond the last")
    columns = np.repeat(np.arange(n_columns), np.diff(pointers))
    if kind[1] == "S":
        return _symmetric(rows, columns, found[2], n_rows, in_order=True)
    return _square(rows, columns, found[2], n_rows)


def _block(text: Text, lines: Integers, words: Integers, n_numbers: int, n: int, width: int) -> Numbers:
    """Numbers of some lines: between spaces or, where they touch one another, in fields of a width, n in a line."""
    if words.sum() == n_numbers:
        return _spaced_numbers(text, lines)
    numbers = [np.empty(0)]
    for line in lines[(text.ends - text.starts)[lines] > n * width]:
        if text.content[text.starts[line] + n * width : text.ends[line]].strip():
            raise ValueError(f"line {line + 1} is longer than {n} fields of {width} characters")
    for part in text.parts(lines):
        fields = text.grid(part, n * width).reshape(-1, width)
        inside = np.repeat(part, n)[: n_numbers - n * int(part[0] - lines[0])]
        numbers.append(_fields(fields[: len(inside)], inside))
    return np.concatenate(numbers)


def _spaced_numbers(text: Text, lines: Integers) -> Numbers:
    """The numbers of some lines, with spaces between them."""
    numbers, width = [np.empty(0)], int((text.ends - text.starts)[lines].max(initial=0)) + 1
    for part in text.parts(lines):
        grid = text.grid(part, width)
        grid[:, -1] = NEWLINE
        numbers.append(numbers_of(grid.tobytes().translate(TO_FLOATS), int(part[0])))
    return np.concatenate(numbers)


def read_dmig(content: bytes) -> dict[str, Labelled | None]:
    """Matrices of Nastran's DMIG entries by name, in small, large or free field; None for complex or rectangular ones.

    The labels are grid point and component. MSC Nastran and OptiStruct Quick Reference Guides, bulk data entry DMIG;
    ``EXTOUT=DMIGPCH`` writes them to the punch file. A half of a symmetric matrix (form 6) or all of it may be there.
    """
    text = Text(content.upper())
    is_free = FREE_FIELD.search(text.content) is not None
    cards, (at, values) = _dmig_lines(_in_fields(text) if is_free else text, WIDE if is_free else 16)
    owner = np.searchsorted(cards.lines, at, side="right") - 1
    is_head = cards.fields[:, 0] == 0
    heads = {cards.names[i]: cards.fields[i, 1:] for i in np.flatnonzero(is_head)}
    matrices: dict[str, Labelled | None] = {}
    for name in dict.fromkeys(cards.names.tolist()):
        if name not in heads:
            line = int(cards.lines[np.argmax(cards.names == name)]) + 1
            raise ValueError(f"line {line}: matrix {name.decode('latin-1')!r} has no entry that states its form")
        form, kind = heads[name]
        if form not in (1, 2, 6, 9) or kind not in (1, 2, 3, 4):
            raise ValueError(
                f"matrix {name.decode('latin-1')!r} has form {form:g} and type {kind:g}; expected 6 and 2, or such"
            )
        mine = (cards.names[owner] == name) & ~is_head[owner]
        key = name.decode("latin-1")
        without = mine & np.isnan(values[:, 2])
        if without.any():
            raise ValueError(f"line {at[np.argmax(without)] + 1}: matrix {key!r} has an entry without a value")
        if form in (1, 6) and kind in (1, 2):
            rows, columns = _nodes(values[mine, :2], 1), _nodes(cards.fields[owner[mine]], 1)
            matrices[key] = _labelled(rows, columns, values[mine, 2], is_symmetric=form == SYMMETRIC)
        else:
            matrices[key] = None
    if not matrices:
        raise ValueError("no DMIG entry")
    return matrices


class Cards(NamedTuple):
    """Lines on which DMIG entries begin, their names and their next three fields: 0, form and type in a head."""

    lines: Integers
    names: NDArray[np.bytes_]
    fields: Numbers


def _dmig_lines(text: Text, wide: int) -> tuple[Cards, tuple[Integers, Numbers]]:
    """The beginnings of DMIG entries; and lines, grid points, components and values of what they hold."""
    cards, entries, goes_on = [], [], False
    for lines in text.parts(np.arange(len(text))):
        grid = text.grid(lines, 8 + 4 * wide)
        first = grid[:, 0]
        is_card = (first >= ord("A")) & (first <= ord("Z"))
        is_dmig = (grid[:, :4] == np.frombuffer(b"DMIG", dtype=np.uint8)).all(axis=1)
        is_dmig &= (grid[:, 4] == SPACE) | (grid[:, 4] == STAR)
        is_large = np.where(is_dmig, grid[:, 4], first) == STAR
        card = np.maximum.accumulate(np.where(is_card, np.arange(len(lines)), -1))
        is_ours = np.where(card < 0, goes_on, is_dmig[card])
        goes_on = bool(is_ours[-1])
        follows = is_ours & np.isin(first, list(b" +*"))
        for chosen, width in ((is_dmig & ~is_large, 8), (is_dmig & is_large, wide)):
            cards.append(_cards(grid[chosen], lines[chosen], width))
        for chosen, place, width in (
            (is_dmig & ~is_large, 40, 8),
            (follows & ~is_large, 8, 8),
            (follows & ~is_large, 40, 8),
            (follows & is_large, 8, wide),
        ):
            entries.append(_quadruples(chosen, place, width, grid, lines))
    if not cards:
        return Cards(np.empty(0, np.int64), np.empty(0, "S8"), np.empty((0, 3))), (
            np.empty(0, np.int64),
            np.empty((0, 3)),
        )
    order = np.argsort(np.concatenate([part.lines for part in cards]), kind="stable")
    found = Cards(*(np.concatenate(parts)[order] for parts in zip(*cards, strict=True)))
    at, values = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    return found, (at, values)


def _cards(grid: Grid, lines: Integers, width: int) -> Cards:
    names = grid[:, 8 : 8 + width].tobytes()
    fields = [grid[:, i : i + width].copy() for i in range(8 + width, 8 + 4 * width, width)]
    numbers = [_fields(field, lines, blank) for field, blank in zip(fields, (b"nan", b"0", b"0"), strict=True)]
    stripped = [names[i : i + width].strip() for i in range(0, len(names), width)]
    for name, line in zip(stripped, lines, strict=True):
        if not 0 < len(name) <= 8:
            raise ValueError(f"line {line + 1}: {name.decode('latin-1')!r} is no name of one to eight characters")
    return Cards(lines, np.array(stripped, dtype="S8"), np.column_stack(numbers))


def _quadruples(
    chosen: NDArray[np.bool_], at: int, width: int, grid: Grid, lines: Integers
) -> tuple[Integers, Numbers]:
    """Line, and grid point, component and value of the entries that stand at a place of some lines."""
    chosen = chosen & (grid[:, at : at + 3 * width] != SPACE).any(axis=1)
    rows, on = grid[chosen], lines[chosen]
    fields = [rows[:, i : i + width].copy() for i in range(at, at + 3 * width, width)]
    blanks = (b"nan", b"0", b"nan")
    return on, np.column_stack([_fields(field, on, blank) for field, blank in zip(fields, blanks, strict=True)])


def _in_fields(text: Text) -> Text:
    """Entries of a text in free field, with commas, as ones in fields wide enough for any number; line by line."""
    lines = []
    for line in text.content.split(b"\n"):
        line = line.partition(b"$")[0].rstrip()
        if b"," in line:
            head, *data = (field.strip() for field in line.split(b",")[:9])
        else:
            width = 16 if b"*" in line[:8] else 8
            head, data = line[:8].strip(), [line[i : i + width].strip() for i in range(8, len(line), width)]
        data += [b""] * (-len(data) % 4)
        for i in range(0, len(data), 4):
            start = head.rstrip(b"*") + b"*" if not i and head[:1].isalpha() else b"*"
            lines.append(start.ljust(8) + b"".join(field.ljust(WIDE) for field in data[i : i + 4]))
        lines += [b""] * (not data)
    return Text(b"\n".join(lines))


def read_op4(content: bytes) -> dict[str, scipy.sparse.csc_array | None]:
    """Matrices of Nastran's OUTPUT4 as text, by name, dense or sparse; None for complex or rectangular ones.

    MSC Nastran DMAP Programmer's Guide, module OUTPUT4. Rows have no labels.
    """
    text = Text(content)
    heads = list(OP4_HEADING.finditer(text.content))
    if not heads:
        raise ValueError("no heading of a matrix")
    words, points = text.words(), text.count(POINT)
    first_lines = np.searchsorted(text.starts, [head.start() for head in heads])
    matrices: dict[str, scipy.sparse.csc_array | None] = {}
    for head, start, end in zip(heads, first_lines, [*first_lines[1:], len(text)], strict=True):
        n_columns, n_rows, form, kind = (int(head.group()[i : i + 8]) for i in range(0, 32, 8))
        name = head.group()[32:40].strip().decode("ascii")
        matrices[name] = None
        if n_columns == abs(n_rows) and kind in (1, 2):
            lines = np.arange(start + 1, end)
            n, width = int(head.group(1)), int(head.group(2))
            try:
                strings = _op4_strings(text, lines, words[lines], points[lines], n_columns, is_big=n_rows < 0)
                entries = *_op4_entries(text, lines, points[lines], strings, n_columns, kind, n, width), n_columns
                matrices[name] = _symmetric(*entries, in_order=True) if form == SYMMETRIC else _square(*entries)
            except ValueError as error:
                raise ValueError(f"matrix {name!r} of line {start + 1}: {error}") from error
    return matrices


def _op4_strings(
    text: Text, lines: Integers, words: Integers, points: Integers, n_columns: int, *, is_big: bool
) -> Integers:
    """Line, column, first row and number of words of each string, and whether it begins a column.

    A column of strings has no words itself, and one of a block is its only string. The last is the end of the matrix.
    """
    on = lines[(points == 0) & (words > 0)]
    words = words[(points == 0) & (words > 0)]
    integers = _spaced_numbers(text, on)
    begins = np.append(0, np.cumsum(words))[:-1]
    is_column = words == 3
    wrong = ~is_column & (words != (2 if is_big else 1))
    if wrong.any() or not is_column[:1].all() or not len(on):
        raise ValueError(
            f"line {on[np.argmax(wrong)] + 1 if len(on) else lines[0]} starts neither a column nor a string"
        )
    numbers = _whole(np.append(integers, [0, 0]), "a number", 0)
    columns, first, length = (numbers[begins[is_column] + i] for i in range(3))
    if columns[-1] != n_columns + 1:
        raise ValueError(f"no end after {n_columns} columns: the file seems to be cut off")
    column = columns[np.cumsum(is_column) - 1]
    packed, second = numbers[begins], numbers[begins + 1]
    row = second if is_big else packed % OP4_STRING
    size = packed - 1 if is_big else packed // OP4_STRING - 1
    row[is_column], size[is_column] = first, np.where(first > 0, length, 0)  # of strings, if it begins in row 0
    return np.column_stack([on, column, row, size, is_column])


def _op4_entries(
    text: Text, lines: Integers, points: Integers, strings: Integers, n_columns: int, kind: int, n: int, width: int
) -> tuple[Integers, Integers, Numbers]:
    """Rows, columns and values, which stand, n in a line, below the line of each string."""
    on, counts = lines[points > 0], points[points > 0]
    if (counts > n).any():
        raise ValueError(f"line {on[np.argmax(counts > n)] + 1} holds more than {n} values")
    values = []
    for part, inside in zip(text.parts(on), text.parts(counts), strict=True):
        fields = text.grid(part, n * width).reshape(-1, width)
        kept = (np.arange(n) < inside[:, np.newaxis]).ravel()
        values.append(_fields(fields[kept], np.repeat(part, inside)))
    before = np.append(0, np.cumsum(counts))[np.searchsorted(on, np.append(strings[:, 0], lines[-1] + 1))]
    held, (line, column, row, size, is_block) = np.diff(before), strings.T
    wrong = (kind * held != size) & ~((is_block == 1) & (held == size))  # some programs count a block's values
    if wrong.any() or before[0]:
        i = np.argmax(wrong)
        raise ValueError(
            f"line {line[i] + 1} states {size[i]} words; {held[i]} values follow, and {before[0]} come before"
        )
    rows = np.repeat(row - 1 - before[:-1], held) + np.arange(before[-1])
    columns = np.repeat(column - 1, held)
    inner = columns < n_columns
    if len(rows) and (rows[inner].min(initial=0) < 0 or rows[inner].max(initial=0) >= n_columns):
        raise ValueError(f"row {rows[inner].max() + 1} of {n_columns}")
    everything = np.concatenate([np.empty(0), *values])
    return rows[inner], columns[inner], everything[inner]
