"""Exported models: the same model from every format, what each matrix is taken for, damaged and doubtful files."""

import os
import warnings
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

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
    spring,
    write_mat,
    write_mtx,
    write_npz,
)

CLUTTER = {"measDOFs": np.arange(3.0), "shapes": np.ones((N, 2)), "n": 4, "cube": np.ones((2, 2, 2)), "text": "SAP"}
NAMED = {"n_modes": 4, "stiffness": list(TERMS)}
THETA = RNG.uniform(0.7, 1.3, (5, 3))


@pytest.mark.parametrize("form", WRITERS)
def test_every_format_is_the_same_model(tmp_path, form):
    clutter = {"mat": CLUTTER, "npz": CLUTTER | {"info": np.array({"any": None})}}.get(form.split()[0])
    file = WRITERS[form](tmp_path, MATRICES | (clutter or {"shapes": np.ones((N, 2))}))
    model = load_affine(file, n_modes=4, track=True)
    assert model.parameter_names == tuple(TERMS)
    assert model.track
    assert_same(model, EXPECTED)
    np.testing.assert_allclose(model.frequencies(THETA)[:, 0], EXPECTED.frequencies(THETA)[:, 0], rtol=1e-9)


def test_without_a_total_all_others_are_terms_and_a_lone_stiffness_is_one_though_it_is_called_k(tmp_path):
    assert_same(load_affine(write_npz(tmp_path, TERMS | {"mass": M}), n_modes=4), EXPECTED)
    assert load_affine(write_npz(tmp_path, {"K": TOTAL, "m": M}), n_modes=4).parameter_names == ("K",)


@pytest.mark.parametrize("form", ["mat", "mtx sparse"])
def test_terms_that_are_not_named_stay_constant_where_the_total_is_there(tmp_path, form):
    file = WRITERS[form](tmp_path, MATRICES)
    with pytest.warns(UserWarning, match=r"'K0' is more than the sum of \['E_2'\].*doubtful-factor"):
        model = load_affine(file, stiffness=["E_2"], n_modes=4)
    assert_same(model, AffineModel({("E_2",): TERMS["E_2"], (): TOTAL - TERMS["E_2"]}, M, n_modes=4))
    base = load_affine(file, stiffness=["k_base", "E_2", "E_10"], n_modes=4)
    np.testing.assert_allclose(model.frequencies([[1.0]]), base.frequencies([[1.0] * 3]), rtol=1e-12)


@pytest.mark.parametrize("form", ["mat", "mtx sparse"])
def test_a_skew_symmetric_matrix_is_named(tmp_path, form):
    gyroscopic = np.triu(np.ones((N, N)), 1) - np.tril(np.ones((N, N)), -1)
    file = WRITERS[form](tmp_path, MATRICES | {"G": gyroscopic})
    with pytest.raises(ValueError, match=r"variable 'G' is skew-symmetric, as gyroscopic .*stiffness=\[\.\.\.\]"):
        load_affine(file, n_modes=4)
    assert_same(load_affine(file, **NAMED), EXPECTED)


def test_a_total_that_rounding_has_touched_is_still_the_total(tmp_path):
    rounded = np.vectorize(lambda value: float(f"{value:.8g}"))(TOTAL)
    assert (rounded != TOTAL).any()
    assert_same(load_affine(write_npz(tmp_path, MATRICES | {"K0": rounded}), n_modes=4), EXPECTED)


@pytest.mark.parametrize(("form", "name"), [("npz", "K_0"), ("mtx sparse", "Ktot")])
def test_a_total_of_any_name_is_recognised_by_its_values(tmp_path, form, name):
    file = WRITERS[form](tmp_path, {name: TOTAL} | TERMS | {"M": M})
    with pytest.warns(UserWarning, match=rf"'{name}' .*\['E_2', .*total='{name}'.*doubtful-factor"):
        assert_same(load_affine(file, n_modes=4), EXPECTED)
    assert_same(load_affine(file, n_modes=4, total=name), EXPECTED)
    assert_same(load_affine(file, **NAMED), EXPECTED)


@pytest.mark.parametrize("form", ["mat", "npz", "mtx"])
def test_what_is_not_used_does_no_harm(tmp_path, form):
    unused = {"bad": np.full((N, N), np.nan), "small": np.eye(3)}
    file = WRITERS[form](tmp_path, MATRICES | unused | {"coords": np.full((N, 3), np.nan)})
    if file.is_dir():
        (file / "pattern.mtx").write_text("%%MatrixMarket matrix coordinate pattern general\n1 1 1\n1 1\n")
        np.savez(file / "foreign.npz", a=np.ones(2), b="text")
        (file / "damaged.npz").write_bytes(b"PK")
    assert_same(load_affine(file, **NAMED), EXPECTED)
    assert_same(load_affine(file, **NAMED, mass="M0", total="K0"), EXPECTED)
    with pytest.raises(ValueError, match="variable 'bad' holds values that are not finite"):
        load_affine(file, stiffness=["E_2", "bad"])
    if file.is_dir():
        with pytest.raises(ValueError, match=r"damaged\.npz"):
            load_affine(file, stiffness=["E_2", "damaged"])


WRONG = [
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
]


@pytest.mark.parametrize("case", range(len(WRONG)))
def test_errors_name_file_and_variable(tmp_path, case):
    changes, arguments, message = WRONG[case]
    matrices = {name: matrix for name, matrix in (MATRICES | changes).items() if matrix is not None}
    file = (write_mat, write_npz)[case % 2](tmp_path, matrices)
    with pytest.raises(ValueError, match=rf"model\.(mat|npz): .*{message}"):
        load_affine(file, **({"n_modes": 4} | arguments))


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


@pytest.mark.skipif("SKTHERMO_DATA" not in os.environ, reason="SKTHERMO_DATA names no folder of real data")
def test_the_building_frame():
    model = load_affine(Path(os.environ["SKTHERMO_DATA"]) / "building_frame" / "ConcreteBuildingFrame.mat")
    assert model.n_dof == 2302
    assert set(model.parameter_names) == {f"E_{i}" for i in range(1, 13)} | {"Influence_Link", "Influence_Rebar"}
    expected = [2.28649, 5.98051, 16.22121, 17.72160, 20.53380, 22.12960]
    np.testing.assert_allclose(model.frequencies(np.ones((1, 14)))[0], expected, rtol=3e-6)


@pytest.mark.parametrize("form", [scipy.sparse.csc_array, np.asarray])
def test_rows_held_by_ones_are_no_modes(form, tmp_path):
    held = np.zeros(N + 2)
    held[[0, -1]] = 1.0

    def with_supports(matrix, ones):
        whole = np.diag(ones * held)
        whole[1:-1, 1:-1] = matrix
        return form(whole)

    stiffness = {name: with_supports(term, float(name == "E_2")) for name, term in TERMS.items()}
    scipy.io.savemat(tmp_path / "frame.mat", stiffness | {"M0": with_supports(M, 1.0)})
    with pytest.warns(UserWarning, match="ones on the diagonals"):
        model = load_affine(tmp_path / "frame.mat", n_modes=4)
    np.testing.assert_allclose(model.frequencies(THETA), EXPECTED.frequencies(THETA), rtol=1e-9)


def test_what_terms_leave_of_the_total_is_constant_and_said(tmp_path):
    rest = spring(3, 3, 500.0)
    file = write_mat(tmp_path, MATRICES | {"K0": TOTAL + rest}, sparse=True)
    expected = AffineModel({(name,): matrix for name, matrix in TERMS.items()} | {(): rest}, M, n_modes=4)
    with pytest.warns(UserWarning, match=r"'K0' .*\['E_2', 'E_10', 'k_base'\].*doubtful-factor"):
        assert_same(load_affine(file, n_modes=4), expected)
    assert_same(load_affine(file, n_modes=4, total="K0"), expected)
    some = {("E_2",): TERMS["E_2"], ("k_base",): TERMS["k_base"], (): rest + TERMS["E_10"]}
    model = load_affine(file, stiffness=["E_2", "k_base"], total="K0", n_modes=4)
    assert_same(model, AffineModel(some, M, n_modes=4))


def test_a_constant_part_called_k0_is_refused_until_it_is_named(tmp_path):
    constant = spring(0, 0, 100.0)
    file = write_npz(tmp_path, MATRICES | {"K0": constant})
    with pytest.raises(ValueError, match=r"model\.npz: 'K0' is .*less than the sum of .*expected a total"):
        load_affine(file)
    keys = {"K0": (), "E_2": "E", "E_10": ("E", "A"), "k_base": "k"}
    model = load_affine(file, stiffness=keys, parameter_names=["k", "E", "A"], n_modes=4)
    terms = {(): constant, ("E",): TERMS["E_2"], ("E", "A"): TERMS["E_10"], ("k",): TERMS["k_base"]}
    assert model.parameter_names == ("k", "E", "A")
    assert_same(model, AffineModel(terms, M, n_modes=4, parameter_names=["k", "E", "A"]))


def test_matrices_may_share_a_parameter_and_damage_groups_cut_through_it(tmp_path):
    keys, groups = {"E_2": "E", "E_10": "E", "k_base": "k"}, {"left": [0], "base": [("k",)]}
    model = load_affine(write_npz(tmp_path, MATRICES), stiffness=keys, groups=groups, n_modes=4)
    assert model.parameter_names == ("E", "k")
    damaged = model.damaged({"left": 0.4}).frequencies([[1.0, 1.0]])
    np.testing.assert_allclose(damaged, EXPECTED.damaged({"E_2": 0.4}).frequencies([[1.0] * 3]), rtol=1e-12)


@pytest.mark.parametrize(
    ("form", "name", "matrix", "what"),
    [
        ("mat sparse", "M1", M / 2, "0.5 times the mass 'M'"),
        ("npz", "C", 0.02 * TOTAL, r"0.02 times the sum of \['E_2', 'E_10', 'k_base'\]"),
    ],
)
def test_a_term_that_looks_like_mass_or_damping_is_said(tmp_path, form, name, matrix, what):
    file = WRITERS[form](tmp_path, TERMS | {name: matrix, "M": M})
    with pytest.warns(UserWarning, match=rf"model\..*'{name}' is {what}.*doubtful-factor"):
        model = load_affine(file, n_modes=4)
    assert model.parameter_names == (*TERMS, name)
    assert_same(load_affine(file, **NAMED), EXPECTED)


@pytest.mark.parametrize("form", ["mat sparse", "npz", "mtx", "mtx sparse", "folder of npz"])
def test_complex_matrices_are_real_or_refused(tmp_path, form):
    file = WRITERS[form](tmp_path, MATRICES | {"E_2": TERMS["E_2"].astype(complex)})
    assert_same(load_affine(file, n_modes=4), EXPECTED)
    WRITERS[form](tmp_path, MATRICES | {"hysteretic": 0.1j * TOTAL})
    with pytest.raises(ValueError, match=r"variable 'hysteretic' is not a matrix of real .*imaginary part is not zero"):
        load_affine(file, n_modes=4)
    assert_same(load_affine(file, **NAMED), EXPECTED)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("coordinate pattern general\n1 1 1\n1 1\n", "1 x 1, pattern, general; expected numbers"),
        ("coordinate real general\n999999999 999999999 0\n", "999 rows for 0 entries; exp"),
        ("coordinate real general\n2 2 999999999999\n1 1 1\n", "999,999 entries in 69 bytes"),
        ("array real symmetric\n2 1\n1\n2\n", "2 x 1, real, symmetric; expected numbers, and a square"),
        ("array real general\n1 1\n1.0D+03\n", r"line 3: '1.0D\+03' is not a number"),
        ("coordinate real general\n2 2 1\n1 0 5.0\n", "Column index out of bounds"),
        ("coordinate real general\n2 2 2\n1 1 5.0\n2 2\n", "Line 4: Invalid"),
        ("coordinate real symmetric\n2 2 2\n1 2 5.0\n2 1 5.0\n", "both sides of its diagonal"),
    ],
)
def test_bad_matrix_market_files_are_refused(tmp_path, text, message):
    write_mtx(tmp_path, MATRICES)
    (tmp_path / "E_2.mtx").write_text("%%MatrixMarket matrix " + text)
    with pytest.raises(ValueError, match=rf"E_2\.mtx: not readable as Matrix Market .*{message}"):
        load_affine(tmp_path)


@pytest.mark.nightly
@settings(max_examples=2)
@given(position=st.integers(0, 10**6), bit=st.integers(0, 7), cut=st.booleans())
@pytest.mark.parametrize("form", ["npz", "mtx", "mtx sparse", "folder of npz"])
def test_damaged_files_are_named_or_their_damage_is_harmless(tmp_path, form, position, bit, cut):
    path = WRITERS[form](tmp_path, MATRICES)
    file = path if path.is_file() else next(path.glob("K0.*"))
    content = bytearray(file.read_bytes())
    if cut:
        content = content[: position % len(content)]
    else:
        content[position % len(content)] ^= 1 << bit
    file.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = load_affine(path, n_modes=4)
        except ValueError as error:
            found = str(error)
    if isinstance(found, str):
        assert file.name in found or path.name in found
    elif "npz" in form:  # whose checksums leave no number wrong
        assert_same(found, EXPECTED)
