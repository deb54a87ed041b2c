"""Structs, cells, texts and arrays of any dimensions from MATLAB v5 files, and members of zip files."""

import io
import struct
import zipfile
import zlib

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo._io import MemoryLimit, read_matlab, read_matlab_values, read_only_member


def values_of(content):
    return read_matlab_values(content, "any.mat", MemoryLimit(len(content)))


def saved(fields, compressed=False):
    stream = io.BytesIO()
    scipy.io.savemat(stream, fields, do_compression=compressed)
    return stream.getvalue()


def cell(*values):
    cells = np.empty((1, len(values)), dtype=object)
    cells[0, :] = values
    return cells


CUBE = np.random.default_rng(0).normal(size=(3, 2, 4))
FIELDS = {
    "record": {
        "cube": CUBE,
        "shapes": CUBE + 1j * CUBE[::-1],
        "whole": np.arange(6, dtype="u1").reshape(2, 3),
        "names": cell("aBD11Az", "", "Ä°C"),
        "inner": {"deep": cell(cell("x", np.ones((1, 1))), "y")},
        "rows": np.array(["tVL", "wdVL"]),
        "nothing": np.empty((0, 0)),
    },
    "sparse": scipy.sparse.csc_array(np.eye(2)),
    "text": "abc",
}


@pytest.mark.parametrize("compressed", [False, True])
def test_values_are_read_as_written(compressed):
    values = values_of(saved(FIELDS, compressed))
    record, expected = values["record"], FIELDS["record"]
    assert list(record) == list(expected)
    for name in ("cube", "shapes", "whole", "nothing"):
        np.testing.assert_array_equal(record[name], expected[name])
        assert record[name].dtype == (complex if name == "shapes" else float)
    assert [text for texts in record["names"] for text in texts] == ["aBD11Az", "Ä°C"]
    assert [text.strip() for text in record["rows"]] == ["tVL", "wdVL"]
    inner = record["inner"]["deep"]
    assert inner[0][0] == ["x"]
    assert inner[0][1] == 1
    assert inner[1] == ["y"]
    assert values["sparse"] is None
    assert values["text"] == ["abc"]


def test_an_array_of_structs_is_a_list_in_matlabs_order():
    records = np.zeros((2, 2), dtype=[("number", "O"), ("name", "O")])
    for number, place in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]):
        records[place] = (float(number), f"n{number}")
    values = values_of(saved({"records": records}))["records"]
    assert [(record["number"].item(), record["name"]) for record in values] == [(k, [f"n{k}"]) for k in range(4)]


def element(kind, content, order="<"):
    return struct.pack(order + "II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def matrix(kind, shape, *parts, name=b"", order="<"):
    flags = element(6, struct.pack(order + "II", kind, 0), order)
    dimensions = element(5, struct.pack(f"{order}{len(shape)}i", *shape), order)
    return element(14, flags + dimensions + element(1, name, order) + b"".join(parts), order)


def mat_file(*variables, order="<"):
    mark = b"IM" if order == "<" else b"MI"
    return b"MATLAB 5.0".ljust(124) + struct.pack(order + "H", 0x0100) + mark + b"".join(variables)


def names(*fields, length=32, order="<"):
    """Lengths of field names, in the tag itself, and the names."""
    stated = struct.pack(order + "I", 4 << 16 | 5) + struct.pack(order + "i", length)
    return stated + element(1, b"".join(field.ljust(length, b"\0") for field in fields), order)


def packed(content):
    body = zlib.compress(content)
    return struct.pack("<II", 15, len(body)) + body


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders_small_types_and_cells_that_were_never_filled(order):
    small = matrix(6, (1, 2, 3), element(2, bytes(range(6)), order), order=order)
    text = matrix(
        4, (2, 3), element(17, "adbecf".encode("utf-16" + {"<": "-le", ">": "-be"}[order]), order), order=order
    )
    cells = matrix(1, (2, 1), element(14, b"", order), text, order=order)
    fields = names(b"small", b"cells", b"object", order=order)
    strings = element(14, element(6, struct.pack(order + "II", 17, 0), order) + 2 * element(1, b"string", order), order)
    modes = matrix(2, (1, 1), fields, small, cells, strings, name=b"modes", order=order)
    values = values_of(mat_file(modes, order=order))["modes"]
    np.testing.assert_array_equal(values["small"], np.arange(6.0).reshape((1, 2, 3), order="F"))
    assert values["cells"][0].shape == (0, 0)
    assert values["cells"][1] == ["abc", "def"]
    assert values["object"] is None


NUMBER = matrix(6, (1, 1), element(9, struct.pack("<d", 1.0)))


def nested(depth):
    content = NUMBER
    for level in range(depth):
        content = matrix(1, (1, 1), content, name=b"x" if level == depth - 1 else b"")
    return content


def test_values_lie_within_each_other_up_to_a_depth():
    value = values_of(mat_file(nested(10)))["x"]
    for _ in range(10):
        (value,) = value
    assert value.item() == 1
    with pytest.raises(ValueError, match=r"any\.mat: variable 'x' .*more than 10 deep"):
        values_of(mat_file(nested(11)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (matrix(1, (1, 2), NUMBER, name=b"x"), "1 values in a struct or cell array; expected 2"),
        (matrix(1, (1, 1), NUMBER, NUMBER, name=b"x"), "2 values .* expected 1"),
        (matrix(1, (1, 1), element(9, bytes(8)), name=b"x"), "an element of type 9; expected a matrix"),
        (matrix(1, (1, -1), name=b"x"), r"the dimensions \[1, -1\]"),
        (matrix(6, (3,), element(9, bytes(24)), name=b"x"), r"the dimensions \[3\]"),
        (matrix(6, (2, 2, 2), element(9, bytes(24)), name=b"x"), r"3 values; expected \[2, 2, 2\]"),
        (matrix(6, (1, 1), name=b"x"), "0 arrays of numbers; expected 1"),
        (matrix(6 | 0x0800, (1, 1), element(9, bytes(8)), name=b"x"), "1 arrays of numbers; expected 2"),
        (matrix(6 | 0x0800, (1, 1), *[element(9, bytes(n)) for n in (8, 16)], name=b"x"), "2 imaginary parts"),
        (matrix(6, (1, 1), element(16, b"1234"), name=b"x"), "values of type 16"),
        (matrix(4, (1, 3), element(16, b"ab"), name=b"x"), r"a text of 2 characters; expected \[1, 3\]"),
        (matrix(4, (1, 1), element(16, b"\xff"), name=b"x"), "can't decode"),
        (matrix(4, (1, 1), element(9, bytes(8)), name=b"x"), "a text of type 9"),
        (matrix(2, (1, 1), names(b"a", b"a"), NUMBER, NUMBER, name=b"x"), r"the field names \['a', 'a'\]"),
        (matrix(2, (1, 1), names(b"1a"), NUMBER, name=b"x"), r"the field names \['1a'\]"),
        (matrix(2, (1, 1), names(b"a", length=0), NUMBER, name=b"x"), r"field names of \[0\] bytes"),
        (matrix(2, (1, 1), names(b"a", b"b"), NUMBER, name=b"x"), "1 values .* expected 2"),
        (matrix(2, (1, 1), name=b"x"), "field names of"),
        (
            matrix(2, (1, 1), names(b"a", b"b"), NUMBER, matrix(6, (1, 1), element(9, b"1234")), name=b"x"),
            "field 'b': buffer size",
        ),
        (matrix(2, (2**31 - 1, 1), names(), name=b"x"), "MB of memory; expected at most 256 MB"),
        (matrix(4, (2**31 - 1, 0), element(16, b""), name=b"x"), "MB of memory"),
    ],
)
def test_what_does_not_fit_together_is_refused(content, message):
    for variable in (content, packed(content)):
        with pytest.raises(ValueError, match=rf"any\.mat: variable 'x' .*{message}"):
            values_of(mat_file(variable))


@pytest.mark.parametrize(
    "content",
    [
        matrix(1, (2_000_000, 1), element(14, b"") * 2_000_000, name=b"x"),
        matrix(2, (1, 1), names(*[b""] * 2_000_000, length=1), name=b"x"),
        matrix(6, (20_000_000, 1), element(9, bytes(160_000_000)), name=b"x"),
    ],
    ids=["cells", "fields", "numbers"],
)
def test_values_that_grow_without_bound_are_refused(content):
    small = packed(content)
    assert len(small) < len(content) / 100
    with pytest.raises(ValueError, match=r"any\.mat: variable 'x' .* MB of memory; expected at most 256 MB"):
        values_of(mat_file(small))


def outcome(content):
    """The values, or what the error says."""
    try:
        return values_of(content)
    except ValueError as error:
        return str(error)


@settings(max_examples=300, deadline=None)
@given(bit=st.integers(0, 10**6), cut=st.integers(1, 10**6), compressed=st.booleans())
def test_damaged_files_give_an_error_or_values(bit, cut, compressed):
    content = saved(FIELDS, compressed)
    flipped = bytearray(content)
    flipped[bit // 8 % len(content)] ^= 1 << bit % 8
    for damaged in (bytes(flipped), content[: 128 + cut % (len(content) - 128)]):
        values = outcome(damaged)
        if isinstance(values, str):
            assert "any.mat" in values
        elif compressed:  # whose checksums leave nothing unnoticed
            assert list(values) == list(FIELDS)[: len(values)]


def test_what_is_no_matrix_stays_none_in_the_reader_of_matrices(tmp_path):
    (tmp_path / "any.mat").write_bytes(saved(FIELDS | {"M": np.eye(2)}))
    matrices = read_matlab(tmp_path / "any.mat")
    assert matrices["record"] is None
    assert matrices["text"] is None
    np.testing.assert_array_equal(matrices["M"], np.eye(2))


def zipped(members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def member_of(content):
    return bytes(read_only_member(content, ".mat", "any.zip", MemoryLimit(len(content))))


def test_the_one_member_of_a_zip_file():
    assert member_of(zipped({"readme": "x", "folder/any.mat": b"content"})) == b"content"
    with_copy = zipped({"a.MAT": b"content", "__MACOSX/._a.mat": b"x"})
    assert member_of(with_copy) == b"content"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not a zip file"),
        (zipped({"readme": "x"}), r"1 members, \['readme'\]; expected exactly one \.mat file"),
        (zipped({"a.mat": "x", "b.mat": "y"}), r"2 members, \['a.mat', 'b.mat'\]; expected exactly one"),
        (zipped({"a.mat": bytes(300_000_000)}), "MB of memory; expected at most 256 MB"),
        (zipped({"a.mat": b"content" * 99})[:-30], "not a zip file"),
        (zipped({"a.mat": b"content"}).replace(b"content", b"CONTENT", 1).replace(b"a.mat", b"b.mat", 1), "differ"),
    ],
)
def test_other_zip_files_are_refused(content, message):
    with pytest.raises(ValueError, match=rf"any\.zip: .*{message}"):
        member_of(content)


def test_sizes_that_a_zip_file_states_are_not_trusted():
    content = bytearray(zipped({"a.mat": bytes(100_000)}))
    directory = content.rindex(b"PK\1\2")
    for stated in (10, 99_999, 100_001, 200_000_000, 2**32 - 2):
        content[directory + 24 : directory + 28] = struct.pack("<I", stated)
        with pytest.raises(ValueError, match=r"any\.zip: not readable"):
            member_of(bytes(content))
