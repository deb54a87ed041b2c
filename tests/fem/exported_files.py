"""Files as other programs export them, for tests of their loader."""

import numpy as np
import scipy.io
import scipy.sparse

from skthermo.fem import AffineModel

N = 6


def spring(i, j, k):
    """A spring between two masses of a row, or (i = j) to the ground."""
    matrix = np.zeros((N, N))
    matrix[i, i] += k
    if i != j:
        matrix[j, j] += k
        matrix[i, j] = matrix[j, i] = -k
    return matrix


TERMS = {
    "E_2": sum(spring(i, i + 1, 1000.0 * (i + 1)) for i in range(3)),
    "E_10": sum(spring(i, i + 1, 3000.0) for i in range(2, 5)),
    "k_base": spring(0, 0, 1500.5) + spring(5, 5, 1 / 3),
}
TOTAL = sum(TERMS.values())
M = np.diag([1.0, 2.0, 0.0, 1.5, 0.0, 1.0])
MATRICES = {"K0": TOTAL} | TERMS | {"M0": M}
RNG = np.random.default_rng(0)


def write_mat(folder, matrices, *, sparse=False, compressed=True):
    form = scipy.sparse.csc_array if sparse else np.asarray
    fields = {name: form(m) if np.shape(m) == (N, N) else m for name, m in matrices.items()}
    scipy.io.savemat(folder / "model.mat", fields, do_compression=compressed)
    return folder / "model.mat"


def write_npz(folder, matrices):
    np.savez(folder / "model.npz", **matrices)
    return folder / "model.npz"


def write_mtx(folder, matrices, *, sparse=False):
    for name, matrix in matrices.items():
        scipy.io.mmwrite(folder / f"{name}.mtx", scipy.sparse.coo_array(matrix) if sparse else np.asarray(matrix))
    return folder


def write_folder_of_npz(folder, matrices):
    for i, (name, matrix) in enumerate(matrices.items()):
        form = [scipy.sparse.csr_array, scipy.sparse.coo_array, scipy.sparse.bsr_array][i % 3]
        scipy.sparse.save_npz(folder / f"{name}.npz", form(matrix))
    return folder


WRITERS = {
    "mat": write_mat,
    "mat sparse": lambda *a: write_mat(*a, sparse=True),
    "mat sparse, not compressed": lambda *a: write_mat(*a, sparse=True, compressed=False),
    "npz": write_npz,
    "mtx": write_mtx,
    "mtx sparse": lambda *a: write_mtx(*a, sparse=True),
    "folder of npz": write_folder_of_npz,
}


def assert_same(model, expected):
    """Equal matrices wherever theta is, the order of parameters apart."""
    assert set(model.parameter_names) == set(expected.parameter_names)
    for _ in range(3):
        theta = dict(zip(expected.parameter_names, RNG.uniform(0.7, 1.3, 9), strict=False))
        ours, theirs = (one.matrices([theta[name] for name in one.parameter_names]) for one in (model, expected))
        for got, wanted in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(got.toarray(), wanted.toarray(), rtol=1e-12, atol=1e-9)


EXPECTED = AffineModel({(name,): matrix for name, matrix in TERMS.items()}, M, n_modes=4)
