"""Readers of Matrix Market and NumPy files: as SciPy reads them, and bounded in memory."""

import time
import timeit
import zipfile

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from skthermo._io import read_matrix_market, read_named_matrices

N = 6
RNG = np.random.default_rng(0)


@pytest.mark.parametrize("symmetry", ["symmetric", "skew-symmetric", "hermitian"])
@pytest.mark.parametrize("sparse", [False, True])
def test_matrix_market_mirrors_as_scipy_does(tmp_path, symmetry, sparse):
    lower = RNG.normal(size=(N, N))
    sign = -1 if symmetry == "skew-symmetric" else 1
    matrix = lower + sign * lower.T
    if symmetry == "hermitian":
        matrix = matrix + 1j * (lower - lower.T)
    target = scipy.sparse.coo_array(matrix) if sparse else matrix
    scipy.io.mmwrite(tmp_path / "A.mtx", target, symmetry=symmetry)
    got = read_matrix_market(tmp_path / "A.mtx")
    np.testing.assert_allclose(got.toarray() if sparse else got, matrix, rtol=1e-14)


def test_matrix_market_needs_no_line_end_and_may_hold_comments(tmp_path):
    file = tmp_path / "A.mtx"
    file.write_text("%%MatrixMarket matrix array real general\n% one\n\n2 2\n1\n% two\n2\n\n3\n4")
    np.testing.assert_array_equal(read_matrix_market(file), [[1.0, 3.0], [2.0, 4.0]])


def test_matrix_market_is_read_in_a_few_times_scipys_time(tmp_path):
    count = 200_000
    places = np.random.default_rng(0).integers(0, 5000, (2, count))
    matrix = scipy.sparse.coo_array((np.random.default_rng(1).normal(size=count), tuple(places)), shape=(5000, 5000))
    scipy.io.mmwrite(tmp_path / "A.mtx", matrix)

    def fastest(read):
        return min(timeit.repeat(lambda: read(tmp_path / "A.mtx"), timer=time.process_time, number=1, repeat=5))

    assert fastest(read_matrix_market) < 6 * fastest(lambda file: scipy.io.mmread(file).tocsc())


def npz_of(header, content=b""):
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + content


@pytest.mark.parametrize(
    ("member", "message"),
    [
        (npz_of("{'descr': '<f8', 'fortran_order': False, 'shape': (100000, 100000)}"), "0 bytes for the shape"),
        (npz_of("{'descr': '<f8', 'fortran_order': False, 'shape': (1,)}", b"1234"), "4 bytes for the shape"),
        (bytes(3 * 10**8), "it would take [0-9]* MB of memory; expected at most 256 MB"),
    ],
)
def test_npz_members_that_state_too_much_are_refused(tmp_path, member, message):
    with zipfile.ZipFile(tmp_path / "model.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("K.npy", member)
    with pytest.raises(ValueError, match=rf"model\.npz: variable 'K' is not readable as \.npz \({message}"):
        read_named_matrices(tmp_path / "model.npz", lambda name: True)


def test_a_sparse_npz_that_states_too_much_is_refused(tmp_path):
    huge = scipy.sparse.coo_array(([1.0], ([0], [0])), shape=(10**9, 10**9))
    scipy.sparse.save_npz(tmp_path / "E_2.npz", huge)
    with pytest.raises(ValueError, match=r"E_2\.npz: .* MB of memory; expected at most 256 MB"):
        read_named_matrices(tmp_path, lambda name: True)
