"""Damaged and doubtful files of exported models."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.fem import AffineModel, load_affine
from tests.fem.exported_files import (
    EXPECTED,
    MATRICES,
    TERMS,
    TOTAL,
    WRITERS,
    M,
    assert_same,
    spring,
    write_mat,
    write_mtx,
    write_npz,
)


@pytest.fixture
def intact(tmp_path, form):
    """A model's path, the file that holds its total, and what is in that."""
    path = WRITERS[form](tmp_path, MATRICES)
    file = path if path.is_file() else next(path.glob("K0.*"))
    return path, file, file.read_bytes()


def outcome(path, n_modes=4):
    """The model, or what the error says."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return load_affine(path, n_modes=n_modes)
        except ValueError as error:
            return str(error)


FUZZ = settings(max_examples=2)


def test_what_terms_leave_of_the_total_is_constant_and_said(tmp_path):
    rest = spring(3, 3, 500.0)
    expected = AffineModel([((name,), matrix) for name, matrix in TERMS.items()] + [((), rest)], M, n_modes=4)
    file = write_mat(tmp_path, MATRICES | {"K0": TOTAL + rest}, sparse=True)
    with pytest.warns(UserWarning, match=r"'K0' .*\['E_2', 'E_10', 'k_base'\].*doubtful-factor"):
        assert_same(load_affine(file, n_modes=4), expected)
    assert_same(load_affine(file, n_modes=4, total="K0"), expected)
    some = load_affine(file, stiffness=["E_2", "k_base"], total="K0", n_modes=4)
    assert_same(
        some,
        AffineModel({("E_2",): TERMS["E_2"], ("k_base",): TERMS["k_base"], (): rest + TERMS["E_10"]}, M, n_modes=4),
    )


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
    file = write_npz(tmp_path, MATRICES)
    keys = {"E_2": "E", "E_10": "E", "k_base": "k"}
    model = load_affine(file, stiffness=keys, groups={"left": [0], "base": [("k",)]}, n_modes=4)
    assert model.parameter_names == ("E", "k")
    damaged = model.damaged({"left": 0.4}).frequencies([[1.0, 1.0]])
    np.testing.assert_allclose(damaged, EXPECTED.damaged({"E_2": 0.4}).frequencies([[1.0] * 3]), rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "matrix", "what"),
    [
        ("M1", M / 2, "0.5 times the mass 'M'"),
        ("C", 0.02 * TOTAL, r"0.02 times the sum of \['E_2', 'E_10', 'k_base'\]"),
    ],
)
@pytest.mark.parametrize("form", ["mat sparse", "npz"])
def test_a_term_that_looks_like_mass_or_damping_is_said(tmp_path, form, name, matrix, what):
    file = WRITERS[form](tmp_path, TERMS | {name: matrix, "M": M})
    with pytest.warns(UserWarning, match=rf"model\..*'{name}' is {what}.*doubtful-factor"):
        model = load_affine(file, n_modes=4)
    assert model.parameter_names == (*TERMS, name)
    assert_same(load_affine(file, n_modes=4, stiffness=list(TERMS)), EXPECTED)


@pytest.mark.parametrize("form", WRITERS)
def test_complex_matrices_are_real_or_refused(tmp_path, form):
    file = WRITERS[form](tmp_path, MATRICES | {"E_2": TERMS["E_2"].astype(complex)})
    assert_same(load_affine(file, n_modes=4), EXPECTED)
    WRITERS[form](tmp_path, MATRICES | {"hysteretic": 0.1j * TOTAL})
    with pytest.raises(ValueError, match=r"variable 'hysteretic' is not a matrix of real .*imaginary part is not zero"):
        load_affine(file, n_modes=4)
    assert_same(load_affine(file, n_modes=4, stiffness=list(TERMS)), EXPECTED)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("%%MatrixMarket matrix coordinate pattern general\n1 1 1\n1 1\n", "1 x 1, pattern, general; expected numbers"),
        (
            "%%MatrixMarket matrix coordinate real general\n999999999 999999999 0\n",
            "999 rows for 0 entries; exp",
        ),
        (
            "%%MatrixMarket matrix coordinate real general\n2 2 999999999999\n1 1 1\n",
            "999,999 entries in 69 bytes",
        ),
        (
            "%%MatrixMarket matrix array real symmetric\n2 1\n1\n2\n",
            "2 x 1, real, symmetric; expected numbers, and a square",
        ),
        ("%%MatrixMarket matrix array real general\n1 1\n1.0D+03\n", r"line 3: '1.0D\+03' is not a number"),
        ("%%MatrixMarket matrix coordinate real general\n2 2 1\n1 0 5.0\n", "Column index out of bounds"),
        ("%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 5.0\n2 2\n", "Line 4: Invalid"),
        ("%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 2 5.0\n2 1 5.0\n", "both sides of its diagonal"),
    ],
)
def test_bad_matrix_market_files_are_refused(tmp_path, text, message):
    write_mtx(tmp_path, MATRICES)
    (tmp_path / "E_2.mtx").write_text(text)
    with pytest.raises(ValueError, match=rf"E_2\.mtx: not readable as Matrix Market .*{message}"):
        load_affine(tmp_path)


@pytest.mark.nightly
@FUZZ
@given(position=st.integers(0, 10**6), bit=st.integers(0, 7), cut=st.booleans())
@pytest.mark.parametrize("form", ["npz", "mtx", "mtx sparse", "folder of npz"])
def test_damaged_files_are_named_or_their_damage_is_harmless(intact, form, position, bit, cut):
    path, file, content = intact
    content = bytearray(content)
    if cut:
        content = content[: position % len(content)]
    else:
        content[position % len(content)] ^= 1 << bit
    file.write_bytes(content)
    result = outcome(path)
    if isinstance(result, str):
        assert file.name in result or path.name in result
    elif "npz" in form:  # whose checksums leave no number wrong
        assert_same(result, EXPECTED)
