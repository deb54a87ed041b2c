"""MATLAB v5 files: values as they were written, and errors that name the file and the variable of a damaged one."""

import io
import re
import struct
import zipfile
import zlib

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from skthermo._core.matlab import read_matlab

SPARSE = scipy.sparse.csc_array(np.array([[2.0, -1.0, 0], [-1.0, 2.0, 0], [0, 0, 0], [0.5, 0, 0]]))
CUBE = np.random.default_rng(0).normal(size=(3, 2, 4))


def cell(*values):
    cells = np.empty((1, len(values)), dtype=object)
    cells[0, :] = values
    return cells


RECORDS = np.zeros((2, 2), dtype=[("number", "O"), ("name", "O")])
for number, place in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]):
    RECORDS[place] = (float(number), f"n{number}")

FIELDS = {
    "record": {
        "cube": CUBE,
        "shapes": CUBE + 1j * CUBE[::-1],
        "whole": np.arange(6, dtype="u1").reshape(2, 3),
        "real": np.eye(2) + 0j,
        "names": cell("aBD11Az", "", "Ä°C"),
        "inner": {"deep": cell(cell("x", np.ones((1, 1))), "y")},
        "rows": np.array(["tVL", "wdVL"]),
        "nothing": np.empty((0, 0)),
    },
    "records": RECORDS,
    "text": "abc",
    "sparse": SPARSE,
    "complex_sparse": SPARSE * 1j,
    "empty": scipy.sparse.csc_array((3, 3)),
    "none": scipy.sparse.csc_array((2, 0)),
    "truths": SPARSE.astype(bool),
} | {dtype: (np.arange(6).reshape(3, 2) % 2 * 100).astype(dtype) for dtype in ("f8", "f4", "i4", "u2", "i1", "bool")}


def read(file, content):
    file.write_bytes(content)
    return read_matlab(file)


def saved(fields, compressed=False):
    stream = io.BytesIO()
    scipy.io.savemat(stream, fields, do_compression=compressed)
    return stream.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_values_are_read_as_written(tmp_path, compressed):
    values = read(tmp_path / "any.mat", saved(FIELDS, compressed))
    assert list(values) == list(FIELDS)
    for name in ("sparse", "complex_sparse", "empty", "none", "truths"):
        assert scipy.sparse.issparse(values[name])
        assert values[name].dtype == (complex if name.startswith("complex") else float)
        np.testing.assert_array_equal(values[name].toarray(), FIELDS[name].toarray())
    for name in list(FIELDS)[-6:]:
        assert values[name].dtype == float
        np.testing.assert_array_equal(values[name], FIELDS[name])
    record, expected = values["record"], FIELDS["record"]
    assert list(record) == list(expected)
    for name in ("cube", "shapes", "whole", "real", "nothing"):
        np.testing.assert_array_equal(record[name], expected[name])
        assert record[name].dtype == (complex if name == "shapes" else float)
    assert [text for texts in record["names"] for text in texts] == ["aBD11Az", "Ä°C"]
    assert [text.strip() for text in record["rows"]] == ["tVL", "wdVL"]
    inner = record["inner"]["deep"]
    assert inner[0][0] == ["x"]
    assert inner[0][1] == 1
    assert inner[1] == ["y"]
    assert values["text"] == ["abc"]
    numbered = [(one["number"].item(), one["name"]) for one in values["records"]]
    assert numbered == [(number, [f"n{number}"]) for number in range(4)]


def element(kind, content, order="<"):
    return struct.pack(order + "II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def variable(kind, shape, *parts, name=b"x", order="<"):
    flags = element(6, struct.pack(order + "II", kind, 0), order)
    dimensions = element(5, struct.pack(f"{order}{len(shape)}i", *shape), order)
    return element(14, flags + dimensions + element(1, name, order) + b"".join(parts), order)


def mat_file(*variables, order="<"):
    mark = b"IM" if order == "<" else b"MI"
    return b"MATLAB 5.0".ljust(124) + struct.pack(order + "H", 0x0100) + mark + b"".join(variables)


def doubles(*values, order="<"):
    return element(9, struct.pack(f"{order}{len(values)}d", *values), order)


def packed(content):
    body = zlib.compress(content)
    return struct.pack("<II", 15, len(body)) + body


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders_and_objects_that_have_no_dimensions(tmp_path, order):
    flags = element(6, struct.pack(order + "II", 17, 0), order)
    objects = [
        element(14, flags + b"".join(element(1, word, order) for word in (name, b"MCOS", b"table")), order)
        for name in (b"a", b"b")
    ]
    whole = variable(6, (1, 2, 3), element(2, bytes(range(6)), order), name=b"small", order=order)
    cells = variable(1, (1, 1), element(14, b"", order), name=b"cells", order=order)
    values = read(tmp_path / "any.mat", mat_file(*objects, whole, cells, order=order))
    assert values["a"] is values["b"] is None
    np.testing.assert_array_equal(values["small"], np.arange(6.0).reshape((1, 2, 3), order="F"))
    assert values["cells"][0].size == 0  # a cell that was never filled


def sparse_2x2(rows, starts, values=(1.0, 2.0), shape=(2, 2)):
    parts = [element(5, struct.pack(f"<{len(part)}i", *part)) for part in (rows, starts)]
    return variable(5, shape, *parts, doubles(*values))


X = variable(6, (2, 1), doubles(1.0, 2.0))
SWALLOWED = bytearray(X + X.replace(b"x", b"y"))
SWALLOWED[4:8] = struct.pack("<I", len(SWALLOWED) - 8)
DAMAGED = {
    "empty": (b"", r"another format; expected MATLAB v5"),
    "v7.3": (b"MATLAB 7.3 MAT-file".ljust(126) + b"IM", "a MATLAB v7.3 file can be saved anew with '-v7'"),
    "twice": (mat_file(X, X), "after variable 'x': the file holds it twice"),
    "a number": (mat_file(element(9, b"12345678")), "the first variable: an element of type 9"),
    "a swallowed variable": (mat_file(bytes(SWALLOWED)), "2 parts of values; expected 1"),
    "a lost flag": (mat_file(variable(6, (1, 1), doubles(1.0), doubles(2.0))), "2 parts of values; expected 1"),
    "an added flag": (mat_file(variable(6 | 0x0800, (1, 1), doubles(1.0)), X), "1 parts of values; expected 2"),
    "too few values": (mat_file(variable(6, (3, 1), doubles(1.0, 2.0))), "variable 'x': "),
    "too many values": (mat_file(variable(6, (1, 1), doubles(1.0, 2.0))), "variable 'x': "),
    "cut off": (mat_file(X)[:-8], "an element of"),
    "sparse rows too large": (mat_file(sparse_2x2([0, 2], [0, 1, 2])), "variable 'x': "),
    "negative sparse rows": (mat_file(sparse_2x2([0, -1], [0, 1, 2])), "variable 'x': "),
    "unsorted sparse rows": (mat_file(sparse_2x2([1, 0], [0, 2, 2])), "variable 'x': sparse rows that do not rise"),
    "repeated sparse rows": (mat_file(sparse_2x2([1, 1], [0, 2, 2])), "variable 'x': sparse rows that do not rise"),
    "falling starts": (mat_file(sparse_2x2([0, 1], [0, 2, 1])), "variable 'x': "),
    "a first start": (mat_file(sparse_2x2([0, 1], [1, 1, 2])), "variable 'x': "),
    "too few starts": (mat_file(sparse_2x2([0, 1], [0, 1])), "variable 'x': "),
    "too few sparse values": (mat_file(sparse_2x2([0, 1], [0, 1, 2], (1.0,))), "variable 'x': "),
    "a sparse size": (mat_file(sparse_2x2([0, 1], [0, 1, 2], shape=(-2, 2))), "variable 'x': "),
    "a packed length": (mat_file(packed(X[:4] + struct.pack("<I", len(X)) + X[8:])), "an element of"),
    "a packed checksum": (mat_file(packed(X)[:-1] + b"\0"), "incorrect data check"),
    "packed, cut off": (mat_file(packed(X)[:-9]), "an element of"),
}


def test_damaged_files_are_refused(tmp_path):
    file = tmp_path / "any.mat"
    for what, (content, message) in DAMAGED.items():
        with pytest.raises(ValueError, match=r"any\.mat: not readable as MATLAB v5") as caught:
            read(file, content)
        assert re.search(message, str(caught.value)), f"{what}: {caught.value}"


def outcome(file, content):
    """The values, or what the error says."""
    try:
        return read(file, content)
    except ValueError as error:
        return str(error)


@pytest.mark.nightly
def test_flipped_bits_and_cut_files_give_an_error_or_whole_values(tmp_path):
    fields = {"K0": SPARSE, "M0": np.eye(3), "text": "abc", "cell": np.array([1, "a"], dtype=object)}
    file, random = tmp_path / "any.mat", np.random.default_rng(0)
    for number in range(10):
        compressed = bool(number % 2)
        damaged = bytearray(saved(fields, compressed))
        place = int(random.integers(128, len(damaged)))
        if number % 5:
            damaged[place] ^= 1 << int(random.integers(8))
        else:
            del damaged[place:]
        values = outcome(file, bytes(damaged))
        if isinstance(values, str):
            assert "any.mat" in values
        elif compressed:  # whose checksums leave nothing unnoticed
            assert list(values) == list(fields)[: len(values)]
            assert all(abs(values[name] - fields[name]).sum() == 0 for name in set(values) & {"K0", "M0"})


def zipped(members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def test_the_one_matlab_file_in_a_zip_file(tmp_path):
    file = tmp_path / "any.zip"
    for members in ({"readme": "x", "folder/any.mat": mat_file(X)}, {"a.MAT": mat_file(X), "__MACOSX/._a.mat": b"x"}):
        assert read(file, zipped(members))["x"].tolist() == [[1.0], [2.0]]
    for content, message in [
        (zipped({"readme": "x"}), r"1 members, \['readme'\]; expected exactly one \.mat file"),
        (zipped({"a.mat": "x", "b.mat": "y"}), r"2 members, \['a.mat', 'b.mat'\]; expected exactly one"),
        (zipped({"a.mat": mat_file(X)})[:-30], "not a zip file"),
    ]:
        with pytest.raises(ValueError, match=rf"any\.zip: .*{message}"):
            read(file, content)
    content = bytearray(zipped({"a.mat": mat_file(X)}))
    directory = content.rindex(b"PK\1\2")
    content[directory + 16] ^= 1
    with pytest.raises(ValueError, match=r"any\.zip: .*Bad CRC-32"):
        read(file, bytes(content))
