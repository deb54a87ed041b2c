"""Matrix Market and NumPy files: as SciPy reads them, bounded in memory, and errors for what it would misread."""

import zipfile

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from skthermo.fem.external import read_named_matrices

N = 6
RNG = np.random.default_rng(0)


def read_all(path):
    return read_named_matrices(path, lambda name: True).matrices


def test_matrix_market_is_mirrored_as_scipy_does(tmp_path):
    lower = RNG.normal(size=(N, N))
    written = {}
    for symmetry in ("symmetric", "skew-symmetric", "hermitian"):
        matrix = lower + (-1 if symmetry == "skew-symmetric" else 1) * lower.T
        if symmetry == "hermitian":
            matrix = matrix + 1j * (lower - lower.T)
        for sparse in (False, True):
            name = f"{symmetry}{sparse}".replace("-", "")
            target = scipy.sparse.coo_array(matrix) if sparse else matrix
            scipy.io.mmwrite(tmp_path / f"{name}.mtx", target, symmetry=symmetry)
            written[name] = matrix
    for name, got in read_all(tmp_path).items():
        dense = got.toarray() if scipy.sparse.issparse(got) else got
        np.testing.assert_allclose(dense, written[name], rtol=1e-14, err_msg=name)


def test_matrix_market_needs_no_line_end_and_may_hold_comments(tmp_path):
    text = "%%MatrixMarket matrix array real general\n% one\n\n2 2\n1\n% two\n2\n\n3\n4"
    (tmp_path / "A.mtx").write_text(text)
    np.testing.assert_array_equal(read_all(tmp_path)["A"], [[1.0, 3.0], [2.0, 4.0]])


def npz_of(header, content=b""):
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + content


HEADER = "{'descr': '<f8', 'fortran_order': False, 'shape': (%s)}"


def test_npz_members_that_do_not_hold_what_they_state_are_refused(tmp_path):
    for member, message in [
        (npz_of(HEADER % "100,"), "variable 'K': EOF|variable 'K': cannot reshape"),
        (npz_of(HEADER % "1,", b"1234"), "variable 'K': "),
        (npz_of(HEADER % "100000, 100000"), "variable 'K': "),
    ]:
        with zipfile.ZipFile(tmp_path / "model.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("K.npy", member)
        with pytest.raises(ValueError, match=rf"model\.npz: not readable as \.npz \(({message})"):
            read_all(tmp_path / "model.npz")


def test_in_a_folder_the_damaged_file_is_named(tmp_path):
    scipy.sparse.save_npz(tmp_path / "E_1.npz", scipy.sparse.eye_array(2, format="csr"))
    huge = scipy.sparse.coo_array(([1.0], ([0], [0])), shape=(10**9, 10**9))
    scipy.sparse.save_npz(tmp_path / "E_2.npz", huge)
    with pytest.raises(ValueError, match=r"E_2\.npz: .*1,000,000,000 rows for 1 entries; expected at most"):
        read_all(tmp_path)


def test_entries_outside_a_sparse_npz_are_refused(tmp_path):
    for form in ("csr", "csc", "bsr", "coo"):
        matrix = scipy.sparse.random_array((4, 4), density=0.5, format=form, random_state=0)
        if form == "coo":
            matrix.coords[0][0] = 9
        else:
            matrix.indices[0] = 9
        scipy.sparse.save_npz(tmp_path / "E_2.npz", matrix)
        with pytest.raises(ValueError, match=r"E_2\.npz: not readable as \.npz"):
            read_all(tmp_path)


def test_a_changed_byte_in_a_zip_file_is_refused(tmp_path):
    np.savez(tmp_path / "model.npz", K=np.eye(4), M=np.eye(4))
    content = bytearray((tmp_path / "model.npz").read_bytes())
    content[content.index(np.float64(1.0).tobytes()) + 7] ^= 1
    (tmp_path / "model.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"model\.npz: not readable as \.npz \(member 'K\.npy' is damaged"):
        read_all(tmp_path / "model.npz")
