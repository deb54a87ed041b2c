"""Exported models: the same model from every format, what each matrix is taken for, and damaged files."""

import os
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from skthermo.fem import AffineModel, load_affine
from tests.fem.exported_files import (
    EXPECTED,
    MATRICES,
    RNG,
    TERMS,
    TOTAL,
    WRITERS,
    M,
    N,
    assert_same,
    write_mat,
    write_mtx,
    write_npz,
)

CLUTTER = {"measDOFs": np.arange(3.0), "shapes": np.ones((N, 2)), "n": 4, "cube": np.ones((2, 2, 2)), "text": "SAP"}
THETA = RNG.uniform(0.7, 1.3, (5, 3))


@pytest.mark.parametrize("form", WRITERS)
def test_every_format_is_the_same_model(tmp_path, form):
    clutter = {"mat": CLUTTER, "npz": CLUTTER | {"info": np.array({"any": None})}}.get(form.split()[0], {})
    clutter = clutter or {"shapes": np.ones((N, 2))}
    model = load_affine(WRITERS[form](tmp_path, MATRICES | clutter), n_modes=4, track=True)
    assert model.parameter_names == tuple(TERMS)
    assert model.track
    assert_same(model, EXPECTED)
    np.testing.assert_allclose(model.frequencies(THETA)[:, 0], EXPECTED.frequencies(THETA)[:, 0], rtol=1e-9)


def test_without_a_total_all_others_are_terms(tmp_path):
    assert_same(load_affine(write_npz(tmp_path, TERMS | {"mass": M}), n_modes=4), EXPECTED)


def test_a_lone_stiffness_is_a_term_though_it_is_called_k(tmp_path):
    model = load_affine(write_npz(tmp_path, {"K": TOTAL, "m": M}), n_modes=4)
    assert model.parameter_names == ("K",)


@pytest.mark.parametrize("form", ["mat", "mtx sparse"])
def test_terms_that_are_not_named_stay_constant_where_the_total_is_there(tmp_path, form):
    file = WRITERS[form](tmp_path, MATRICES)
    with pytest.warns(UserWarning, match=r"'K0' is more than the sum of \['E_2'\].*doubtful-factor"):
        model = load_affine(file, stiffness=["E_2"], n_modes=4)
    assert_same(model, AffineModel({("E_2",): TERMS["E_2"], (): TOTAL - TERMS["E_2"]}, M, n_modes=4))
    base = load_affine(file, stiffness=["k_base", "E_2", "E_10"], n_modes=4)
    np.testing.assert_allclose(model.frequencies([[1.0]]), base.frequencies([[1.0] * 3]), rtol=1e-12)


@pytest.mark.parametrize("form", WRITERS)
def test_a_skew_symmetric_matrix_is_named(tmp_path, form):
    gyroscopic = np.triu(np.ones((N, N)), 1) - np.tril(np.ones((N, N)), -1)
    file = WRITERS[form](tmp_path, MATRICES | {"G": gyroscopic})
    with pytest.raises(ValueError, match=r"variable 'G' is skew-symmetric, as gyroscopic .*stiffness=\[\.\.\.\]"):
        load_affine(file, n_modes=4)
    assert_same(load_affine(file, stiffness=list(TERMS), n_modes=4), EXPECTED)


def test_a_total_that_rounding_has_touched_is_still_the_total(tmp_path):
    rounded = np.vectorize(lambda value: float(f"{value:.8g}"))(TOTAL)
    assert (rounded != TOTAL).any()
    assert_same(load_affine(write_npz(tmp_path, MATRICES | {"K0": rounded}), n_modes=4), EXPECTED)


@pytest.mark.parametrize("form", WRITERS)
@pytest.mark.parametrize("name", ["K_0", "Ktot"])
def test_a_total_of_any_name_is_recognised_by_its_values(tmp_path, form, name):
    file = WRITERS[form](tmp_path, {name: TOTAL} | TERMS | {"M": M})
    with pytest.warns(UserWarning, match=rf"'{name}' .*\['E_2', .*total='{name}'.*doubtful-factor"):
        assert_same(load_affine(file, n_modes=4), EXPECTED)
    assert_same(load_affine(file, n_modes=4, total=name), EXPECTED)
    assert_same(load_affine(file, n_modes=4, stiffness=list(TERMS)), EXPECTED)


@pytest.mark.parametrize("form", ["mat", "npz", "mtx"])
def test_what_is_not_used_does_no_harm(tmp_path, form):
    unused = {"bad": np.full((N, N), np.nan), "small": np.eye(3)}
    file = WRITERS[form](tmp_path, MATRICES | unused | {"coords": np.full((N, 3), np.nan)})
    if file.is_dir():
        (file / "pattern.mtx").write_text("%%MatrixMarket matrix coordinate pattern general\n1 1 1\n1 1\n")
        np.savez(file / "foreign.npz", a=np.ones(2), b="text")
        (file / "damaged.npz").write_bytes(b"PK")
    assert_same(load_affine(file, n_modes=4, stiffness=list(TERMS)), EXPECTED)
    assert_same(load_affine(file, n_modes=4, stiffness=list(TERMS), mass="M0", total="K0"), EXPECTED)
    with pytest.raises(ValueError, match="variable 'bad' holds values that are not finite"):
        load_affine(file, stiffness=["E_2", "bad"])
    if file.is_dir():
        with pytest.raises(ValueError, match=r"damaged\.npz"):
            load_affine(file, stiffness=["E_2", "damaged"])


@pytest.mark.parametrize(
    ("changes", "arguments", "message"),
    [
        ({"M0": None}, {}, "no matrix is called m, m0, mass, .*; say mass=..., one of"),
        ({"M0": np.ones((1, N))}, {}, r"'M0' is 1 x 6, not square, and so not the mass; say mass=.*'k_base'\]$"),
        ({"M0": M * 1j}, {}, "'M0' is 6 x 6, complex, and so not the mass"),
        ({"mass": M}, {}, r"\['M0', 'mass'\] could each be the mass; say mass="),
        ({"E_2": np.eye(3)}, {}, r"variable 'E_2' has shape \(3, 3\); expected \(6, 6\) like the mass"),
        ({"E_2": np.triu(TERMS["E_2"])}, {"total": False, "stiffness": ["E_2"]}, r"'E_2'.* is not symmetric"),
        ({}, {"stiffness": ["E_7"]}, "no variable 'E_7'; found"),
        ({"E_2": TERMS["E_2"] * 1j}, {"stiffness": ["E_2"]}, "variable 'E_2' is not a matrix of real numbers"),
        ({}, {"stiffness": []}, "no stiffness matrix beside the mass 'M0'"),
        ({"K0": None}, {"stiffness": ["E_2"]}, "the structure is a mechanism"),
    ],
)
@pytest.mark.parametrize("writer", [write_mat, write_npz])
def test_errors_name_file_and_variable(tmp_path, writer, changes, arguments, message):
    matrices = {name: matrix for name, matrix in (MATRICES | changes).items() if matrix is not None}
    with pytest.raises(ValueError, match=rf"model\.(mat|npz): .*{message}"):
        load_affine(writer(tmp_path, matrices), **({"n_modes": 4} | arguments))


def test_errors_of_paths(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no_such\.mat does not exist; expected a file of MATLAB v5"):
        load_affine(tmp_path / "no_such.mat")
    with pytest.raises(ValueError, match="holds no matrix; expected"):
        load_affine(tmp_path)
    (tmp_path / "K.csv").write_text("1,2")
    with pytest.raises(ValueError, match=r"K\.csv is none of these"):
        load_affine(tmp_path / "K.csv")
    write_mtx(tmp_path, MATRICES)
    scipy.sparse.save_npz(tmp_path / "K0.npz", scipy.sparse.csr_array(TOTAL))
    with pytest.raises(ValueError, match=r"holds 'K0' as \.mtx and as \.npz"):
        load_affine(tmp_path)


needs_data = pytest.mark.skipif("SKTHERMO_DATA" not in os.environ, reason="SKTHERMO_DATA names no folder of real data")


@needs_data
def test_the_building_frame():
    model = load_affine(Path(os.environ["SKTHERMO_DATA"]) / "building_frame" / "ConcreteBuildingFrame.mat")
    assert model.n_dof == 2302
    assert set(model.parameter_names) == {f"E_{i}" for i in range(1, 13)} | {"Influence_Link", "Influence_Rebar"}
    expected = [2.28649, 5.98051, 16.22121, 17.72160, 20.53380, 22.12960]
    np.testing.assert_allclose(model.frequencies(np.ones((1, 14)))[0], expected, rtol=3e-6)


@pytest.mark.parametrize("form", ["dense", "sparse"])
def test_rows_held_by_ones_are_no_modes(form, tmp_path):
    held = np.zeros(N + 2)
    held[[0, -1]] = 1.0
    shown = scipy.sparse.csc_array if form == "sparse" else np.asarray

    def with_supports(matrix, ones):
        whole = np.diag(ones * held)
        whole[1:-1, 1:-1] = matrix.toarray() if scipy.sparse.issparse(matrix) else matrix
        return shown(whole)

    (first, term), *others = TERMS.items()
    stiffness = {first: with_supports(term, 1.0)} | {name: with_supports(one, 0.0) for name, one in others}
    scipy.io.savemat(tmp_path / "frame.mat", stiffness | {"M0": with_supports(M, 1.0)})
    with pytest.warns(UserWarning, match="ones on the diagonals"):
        model = load_affine(tmp_path / "frame.mat", n_modes=4)
    free = AffineModel({(name,): one for name, one in TERMS.items()}, M, n_modes=4)
    np.testing.assert_allclose(model.frequencies(THETA), free.frequencies(THETA), rtol=1e-9)
