"""The reader of MATLAB v5 files: as SciPy reads them, and never astray in damaged ones."""

import struct
import zlib

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from skthermo._io import read_matlab

SPARSE = scipy.sparse.csc_array(np.array([[2.0, -1.0, 0], [-1.0, 2.0, 0], [0, 0, 0], [0.5, 0, 0]]))
NO_MATRICES = {"text": "abc", "cell": np.array([1, "a"], dtype=object), "complex": np.array([[1j]])}


def dense(matrix):
    return matrix.toarray() if scipy.sparse.issparse(matrix) else matrix


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("dtype", ["f8", "f4", "i4", "u2", "i1", "?"])
def test_full_matrices_are_read_as_scipy_reads_them(tmp_path, compressed, dtype):
    fields = {"tall": (np.arange(6).reshape(3, 2) % 2 * 100).astype(dtype), "x": np.array([[1]], dtype=dtype)}
    others = NO_MATRICES | {"cube": np.ones((2, 2, 2)), "record": {"a": 1}, "complex_sparse": SPARSE * 1j}
    scipy.io.savemat(tmp_path / "any.mat", fields | others, do_compression=compressed)
    matrices = read_matlab(tmp_path / "any.mat")
    assert list(matrices) == [*fields, *others]
    for name, expected in fields.items():
        np.testing.assert_array_equal(matrices[name], expected)
    assert all(matrices[name] is None for name in others)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("dtype", ["f8", "?"])
def test_sparse_matrices_stay_sparse(tmp_path, compressed, dtype):
    fields = {
        "K": SPARSE.astype(dtype),
        "empty": scipy.sparse.csc_array((3, 3)),
        "none": scipy.sparse.csc_array((2, 0)),
    }
    scipy.io.savemat(tmp_path / "any.mat", fields, do_compression=compressed)
    for name, matrix in read_matlab(tmp_path / "any.mat").items():
        assert scipy.sparse.issparse(matrix)
        assert matrix.dtype == float
        np.testing.assert_array_equal(matrix.toarray(), fields[name].toarray().astype(float))


def element(kind, content, order):
    return struct.pack(order + "II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def variable(order, flags, *parts):
    return element(14, element(6, struct.pack(order + "II", flags, 0), order) + b"".join(parts), order)


def mat_file(order, *variables):
    mark = b"IM" if order == "<" else b"MI"
    return b"MATLAB 5.0".ljust(124) + struct.pack(order + "H", 0x0100) + mark + b"".join(variables)


def matrix_2x1(order, name="x"):
    values = element(9, struct.pack(order + "2d", 1.0, 2.0), order)
    return variable(order, 6, element(5, struct.pack(order + "2i", 2, 1), order), element(1, name, order), values)


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders_and_objects_that_have_no_dimensions(tmp_path, order):
    file = tmp_path / "any.mat"
    objects = [variable(order, 17, *(element(1, word, order) for word in (n, b"MCOS", b"table"))) for n in (b"a", b"b")]
    file.write_bytes(mat_file(order, *objects, matrix_2x1(order, b"x")))
    matrices = read_matlab(file)
    assert matrices["a"] is matrices["b"] is None
    np.testing.assert_array_equal(matrices["x"], [[1.0], [2.0]])


def test_what_is_no_mat_file_or_holds_a_name_twice_is_refused(tmp_path):
    file = tmp_path / "any.mat"
    for content, message in [
        (b"", "not a MATLAB v5 file"),
        (b"MATLAB 7.3 MAT-file".ljust(126) + b"IM", "v7.3 file; expected v5: save it anew"),
        (mat_file("<", matrix_2x1("<", b"K"), matrix_2x1("<", b"K")), "variable 'K' .*twice"),
        (mat_file("<", matrix_2x1("<", b"K"), matrix_2x1("<", b"2K")), "what follows variable 'K' .*the name '2K'"),
        (mat_file("<", element(9, b"12345678", "<")), "the first variable .*an element of type 9"),
    ]:
        file.write_bytes(content)
        with pytest.raises(ValueError, match=rf"any\.mat: .*{message}"):
            read_matlab(file)


def sparse_2x2(rows, starts, values=(1.0, 2.0), shape=(2, 2)):
    parts = [(5, struct.pack(f"<{len(p)}i", *p)) for p in (rows, starts)] + [(9, np.array(values, "<f8").tobytes())]
    dimensions = element(5, struct.pack("<2i", *shape), "<")
    return variable("<", 5, dimensions, element(1, b"K", "<"), *(element(*part, "<") for part in parts))


def test_sparse_storage_may_be_longer_than_what_is_used(tmp_path):
    file = tmp_path / "any.mat"
    file.write_bytes(mat_file("<", sparse_2x2([0, 1, 7], [0, 1, 2], (1.0, 2.0, 9.0))))
    np.testing.assert_array_equal(read_matlab(file)["K"].toarray(), np.diag([1.0, 2.0]))


@pytest.mark.parametrize(
    ("storage", "message"),
    [
        (([0, 2], [0, 1, 2]), "sparse rows that do not rise .* at most 1"),
        (([0, -1], [0, 1, 2]), "sparse rows that do not rise"),
        (([1, 0], [0, 2, 2]), "sparse rows that do not rise"),
        (([1, 1], [0, 2, 2]), "sparse rows that do not rise"),
        (([0, 1], [0, 2, 1]), "3 starts of sparse columns; expected 3 that rise"),
        (([0, 1], [1, 1, 2]), "3 starts of sparse columns; expected 3 that rise"),
        (([0, 1], [0, 1]), "2 starts of sparse columns; expected 3"),
        (([0, 1], [0, 1, 3]), "2 values in 2 sparse rows; expected 3"),
        (([0, 1], [0, 1, 2], (1.0,)), "1 values in 2 sparse rows; expected 2"),
        (([0, 1], [0, 1, 2], (1.0, 2.0), (-2, 2)), r"the dimensions \[-2, 2\]"),
    ],
)
def test_inconsistent_sparse_storage_is_refused(tmp_path, storage, message):
    file = tmp_path / "any.mat"
    file.write_bytes(mat_file("<", sparse_2x2(*storage)))
    with pytest.raises(ValueError, match=rf"any\.mat: variable 'K' .*{message}"):
        read_matlab(file)


FIELDS = {"K0": SPARSE, "M0": np.eye(3)} | NO_MATRICES
SETTINGS = settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def outcome(file, content):
    """The matrices, or what the error says."""
    file.write_bytes(content)
    try:
        return read_matlab(file)
    except ValueError as error:
        return str(error)


@SETTINGS
@given(bit=st.integers(0, 10**6), cut=st.integers(1, 10**6))
@pytest.mark.parametrize("compressed", [False, True])
def test_damaged_files_give_an_error_or_whole_matrices(tmp_path, compressed, bit, cut):
    scipy.io.savemat(tmp_path / "whole.mat", FIELDS, do_compression=compressed)
    content = (tmp_path / "whole.mat").read_bytes()
    position = bit // 8 % len(content)
    flipped = bytearray(content)
    flipped[position] ^= 1 << bit % 8
    damaged = outcome(tmp_path / "damaged.mat", bytes(flipped))
    if isinstance(damaged, str):
        assert "damaged.mat" in damaged
        assert position < 128 or "variable" in damaged
    elif compressed:  # whose checksums leave nothing unnoticed
        assert list(damaged) == list(FIELDS)
        assert all(damaged[name] is None for name in NO_MATRICES)
        assert all((dense(damaged[name]) == dense(FIELDS[name])).all() for name in ("K0", "M0"))
    else:
        assert all(matrix is None or matrix.ndim == 2 for matrix in damaged.values())

    short = outcome(tmp_path / "short.mat", content[: 128 + cut % (len(content) - 128)])
    if isinstance(short, str):
        assert "short.mat" in short
        assert "variable" in short
    else:  # cut between two variables: what is there is whole
        assert list(short) == list(FIELDS)[: len(short)]


@pytest.mark.parametrize("place", [20, 60])
def test_a_damaged_compressed_variable_is_named(tmp_path, place):
    file = tmp_path / "any.mat"
    values = np.random.default_rng(0).normal(size=(30, 30))
    scipy.io.savemat(file, {"stiffness": values}, do_compression=True)
    content = bytearray(file.read_bytes())
    content[-place] ^= 1
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"any\.mat: variable 'stiffness' is not readable"):
        read_matlab(file)


def test_a_variable_that_grows_without_bound_is_refused(tmp_path):
    file = tmp_path / "any.mat"
    packed = zlib.compress(matrix_of_zeros(40_000_000))
    assert len(packed) < 1_000_000
    file.write_bytes(mat_file("<", struct.pack("<II", 15, len(packed)) + packed))
    with pytest.raises(ValueError, match=r"any\.mat: variable 'x' .* MB of memory; expected at most 256 MB"):
        read_matlab(file)


def matrix_of_zeros(n):
    dimensions = element(5, struct.pack("<2i", n, 1), "<")
    return variable("<", 6, dimensions, element(1, b"x", "<"), element(9, bytes(8 * n), "<"))


def test_a_packed_variable_of_another_length_than_it_says_is_refused(tmp_path):
    file = tmp_path / "any.mat"
    content = matrix_2x1("<", b"x")
    for stated, message in ((len(content) - 16, "more than"), (len(content) + 8, "bytes when decompressed; expected")):
        packed = zlib.compress(struct.pack("<II", 14, stated) + content[8:])
        file.write_bytes(mat_file("<", struct.pack("<II", 15, len(packed)) + packed))
        with pytest.raises(ValueError, match=rf"variable 'x' .*{message}"):
            read_matlab(file)
