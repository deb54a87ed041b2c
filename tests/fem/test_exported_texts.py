"""Matrices as Abaqus, ANSYS, Nastran, CalculiX and SAP2000 write them: the same model from every text."""

import re

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.fem import AffineModel, load_affine, read_triplets
from skthermo.fem.external import read_named_matrices
from tests.fem.exported_files import (
    DOFS,
    EXPECTED,
    MATRICES,
    TERMS,
    TEXTS,
    TOTAL,
    M,
    N,
    assert_same,
    dmig_text,
    harwell_boeing_text,
    matrix_input_text,
    op4_text,
    write_texts,
)

CAPITALS = AffineModel({(name.upper(),): term for name, term in TERMS.items()}, M, n_modes=4)
LABELLED = [kind for kind in TEXTS if "matrix input" in kind or "DMIG" in kind]


def in_capitals(stiffness, mass):
    return {stiffness: TOTAL, mass: M} | {name.upper(): term for name, term in TERMS.items()}


def read_all(path):
    return read_named_matrices(path, lambda name: True)


@pytest.mark.parametrize("kind", TEXTS)
def test_every_text_is_the_same_model(tmp_path, kind):
    model = load_affine(write_texts(kind)(tmp_path, MATRICES), n_modes=4)
    assert model.parameter_names == tuple(TERMS)
    assert_same(model, EXPECTED, np.clip(10 * TEXTS[kind][1], 1e-12, 1e-6))
    assert model.dofs == (tuple(DOFS) if kind in LABELLED else ())


@pytest.mark.nightly
@settings(max_examples=150)
@given(
    kind=st.sampled_from(list(TEXTS)),
    seed=st.integers(0, 2**32 - 1),
    size=st.integers(1, 12),
    density=st.floats(0.0, 1.0),
    scale=st.integers(-30, 30),
    line_end=st.sampled_from(["\n", "\r\n", "\r"]),
    change=st.sampled_from([str, str.lower, str.upper]),
)
def test_what_is_written_is_read(tmp_path, kind, seed, size, density, scale, line_end, change):
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((size, size)) * (rng.random((size, size)) < density) * 10.0**scale
    matrix = matrix + matrix.T + np.diag(rng.uniform(1, 2, size) * 10.0**scale)
    nodes = np.sort(rng.choice(10_000, size, replace=False)) + 1
    dofs = [(int(node), int(rng.integers(1, 7))) for node in nodes]
    suffix, tolerance, write = TEXTS[kind]
    text = write(matrix, dofs)
    text = text if "OP4" in kind else change(text)
    file = tmp_path / f"K{suffix}"
    file.write_bytes(text.replace("\n", line_end).encode())
    found = read_all(file)
    (read,) = found.matrices.values()
    assert found.dofs in ((), tuple(dofs))
    assert bool(found.dofs) == (kind in LABELLED)
    largest = np.abs(matrix).max()
    np.testing.assert_allclose(read.toarray(), matrix, rtol=tolerance, atol=1e-16 * largest)


@pytest.mark.parametrize("kind", LABELLED)
def test_matrices_of_some_nodes_are_joined_by_label(tmp_path, kind):
    suffix, tolerance, text = TEXTS[kind]
    for name, matrix in (TERMS | {"M": M}).items():
        kept = [i for i in (4, 0, 5, 2, 1, 3) if matrix[i].any()]
        (tmp_path / f"{name}{suffix}").write_text(text(matrix[np.ix_(kept, kept)], [DOFS[i] for i in kept]))
    model = load_affine(tmp_path, n_modes=4)
    assert model.dofs == tuple(DOFS)
    assert_same(model, EXPECTED, np.clip(10 * tolerance, 1e-12, 1e-6))


def test_degrees_of_freedom_that_abaqus_holds_are_left_out_and_labels_for_some_matrices_only_refused(tmp_path):
    for name, matrix in (TERMS | {"M": M}).items():
        wider = np.zeros((N + 1, N + 1))
        wider[:N, :N] = matrix
        wider[N, N] = 0.0 if name == "M" else 1e36
        (tmp_path / f"{name}.mtx").write_text(matrix_input_text(wider, [*DOFS, (50, 1)]))
    model = load_affine(tmp_path, n_modes=4)
    assert model.dofs == tuple(DOFS)
    assert_same(model, EXPECTED)
    write_texts("Abaqus coordinates, half")(tmp_path, {"M": M})
    with pytest.raises(ValueError, match=r"rows of 'E_2' have labels .* those of 'M' have none"):
        load_affine(tmp_path)


@pytest.mark.parametrize(("suffix", "written"), [(".dof", "{0}.{1}\n"), (".mapping", "{2:14d}{0:14d}    U{1}\n")])
def test_rows_get_their_labels_from_a_file_beside_the_matrices(tmp_path, suffix, written):
    write_texts("ANSYS")(tmp_path, MATRICES)
    heading = "    Matrix Eqn          Node    DOF\n" if suffix == ".mapping" else ""
    lines = (written.format(*dof, i + 1) for i, dof in enumerate(DOFS))
    (tmp_path / f"bridge{suffix}").write_text(heading + "".join(lines))
    model = load_affine(tmp_path, n_modes=4)
    assert model.dofs == tuple((n, f"U{d}" if heading else d) for n, d in DOFS)
    assert_same(model, EXPECTED)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("bridge.dof", "3.1\n3.2\n12.x\n", "line 3 is '12.x'; expected node.direction"),
        ("bridge.mapping", "  Matrix Eqn   Node  DOF\n  1  3  UX\n  3  3  UY\n", "line 3 is of equation 3; expected 2"),
        ("bridge.mapping", "  Matrix Eqn   Node  DOF\n  1  3\n", "line 2 is '1  3'; expected equation, node and"),
    ],
)
def test_damaged_labels_name_file_and_line(tmp_path, name, text, message):
    write_texts("ANSYS")(tmp_path, MATRICES)
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=rf"{re.escape(name)}: not readable as labels of rows .*{message}"):
        load_affine(tmp_path)


def test_what_is_no_matrix_is_ignored_and_what_should_be_one_is_not(tmp_path):
    write_texts("Abaqus matrix input, half")(tmp_path, MATRICES)
    (tmp_path / "readme.txt").write_text("The bridge\n1. as built\n2. 100 mm more\n")
    (tmp_path / "job.inp").write_text("*NODE\n1, 0., 0., 0.\n*ELEMENT, TYPE=B31\n1, 1, 2\n")
    (tmp_path / "table.csv").write_text("1,2,3\n4,5,6\n")
    assert_same(load_affine(tmp_path, n_modes=4), EXPECTED)
    (tmp_path / "E_11.mtx").write_text("damaged\n")
    with pytest.raises(ValueError, match=r"E_11\.mtx: not readable"):
        load_affine(tmp_path)


def test_one_punch_file_holds_a_whole_model(tmp_path):
    card = "DMIG    {0:8s}{1:8d}{2:8d}{3:8d}{4:8d}{5:8d}{6:8.1f}\n"
    load = card.format("PAX", 0, 9, 2, 0, 1, 1.0) + "DMIG    PAX            1       0               3       1     1.0\n"
    text = "".join(dmig_text(matrix, DOFS, name=name) for name, matrix in in_capitals("KAAX", "MAAX").items())
    (tmp_path / "bridge.pch").write_text("$TITLE = BRIDGE\n" + text + load + "GRID,1,,0.,0.,0.\nENDDATA\n")
    for path in (tmp_path, tmp_path / "bridge.pch"):
        model = load_affine(path, n_modes=4)
        assert model.dofs == tuple(DOFS)
        assert_same(model, CAPITALS, 1e-8)


def test_one_op4_file_holds_a_whole_model_and_unsymmetric_matrices_where_they_are_not_used(tmp_path):
    file, skew = tmp_path / "bridge.op4", np.triu(np.ones((N, N)), 1) * 7.0
    text = "".join(op4_text(matrix, name=name) for name, matrix in in_capitals("KAA", "MAA").items())
    file.write_text(text.replace("\n       1  ", "\n\n       1  "))  # lines without words say nothing
    assert_same(load_affine(file, n_modes=4), CAPITALS)
    unsymmetric = op4_text(skew, name="G").replace(f"{6:8d}{2:8d}G ", f"{1:8d}{2:8d}G ")
    file.write_text(unsymmetric + op4_text(TOTAL) + op4_text(M, name="MAA"))
    model = load_affine(file, n_modes=4, stiffness=["KAA"])
    assert_same(model, AffineModel({("KAA",): TOTAL}, M, n_modes=4))
    np.testing.assert_array_equal(read_all(file).matrices["G"].toarray(), skew)


def test_scipy_writes_what_is_read(tmp_path):
    scipy.io.hb_write(tmp_path / "K.hb", scipy.sparse.csc_array(TOTAL))
    np.testing.assert_array_equal(read_all(tmp_path / "K.hb").matrices["K"].toarray(), TOTAL)


def write_half(file, matrix, *, upper=True, heading=""):
    half = np.triu(matrix) if upper else np.tril(matrix)
    lines = [f"{i + 1} {j + 1}  {half[i, j]:.17e}" for i, j in zip(*np.nonzero(half), strict=True)]
    file.write_text(heading + "\n".join(lines))
    return file


@pytest.mark.parametrize(("upper", "heading"), [(True, ""), (False, "Note: the lower half\n\trow\tcolumn\tvalue\n\n")])
def test_either_half_is_the_whole_matrix(tmp_path, upper, heading):
    file = write_half(tmp_path / "bridge.TXK", TOTAL, upper=upper, heading=heading)
    np.testing.assert_array_equal(read_triplets(file).toarray(), TOTAL)


def test_a_mass_whose_last_rows_are_zero_has_the_size_of_the_stiffness(tmp_path):
    for name, matrix in (TERMS | {"M": M * (np.arange(N) < 4)}).items():
        write_half(tmp_path / f"{name}.sti", matrix)
    assert read_triplets(tmp_path / "M.sti").shape == (4, 4)
    assert load_affine(tmp_path, n_modes=3).n_dof == N


def test_stiffness_and_mass_of_one_job_have_one_name(tmp_path):
    write_half(tmp_path / "bridge.sti", TOTAL)
    write_half(tmp_path / "bridge.mas", M)
    assert_same(load_affine(tmp_path, n_modes=4), AffineModel({("bridge",): TOTAL}, M, n_modes=4))
    write_half(tmp_path / "bridge.txk", TOTAL)
    with pytest.raises(ValueError, match=r"holds 'bridge' as \.sti and as \.txk; expected one .*or another name"):
        load_affine(tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no line of three or five numbers"),
        ("row column value\n1 2\n", "line 2 holds 2 words; expected three or five numbers"),
        ("1 1 2.0\n2 2", "line 2 holds 2 words; expected 3"),
        ("row column value\n1 1 2.0\n\n2 2 2.0\n2 2 x", "line 5: 'x' is not a number"),
        ("1 1 2.0\n1 2 -1.0\n3 1 -1.0\n3 3 2.0", "entries on both sides of its diagonal"),
        ("1 1 2.0\n1 2 -1.0\n1 1 2.0", "row 1 and column 1 is given more than once"),
        ("1 1 2.000e+00\n2 2 1.000e+00\n3 3 1.0", "line 3 ends within a number"),
        ("1.5 1 2.0", "a row is 1.5; expected whole numbers"),
        ("1 1 2.0\n2 2 nan", "line 2 is '2 2 nan'; expected finite"),
        ("0 1 2.0", "a row is 0; expected"),
        ("1e300 1 2.0", "a row is 1e.300; expected"),
    ],
)
def test_errors_of_lines_of_entries_name_the_file(tmp_path, text, message):
    with pytest.raises(FileNotFoundError, match=r"bridge\.sti does not exist as a file; expected a text"):
        read_triplets(tmp_path / "bridge.sti")
    (tmp_path / "bridge.sti").write_text(text)
    with pytest.raises(ValueError, match=rf"bridge\.sti: not readable as lines of entries .*{message}"):
        read_triplets(tmp_path / "bridge.sti")


BAD = {
    "RSA": [
        (r"RSA", "PSA", "a matrix PSA of 6 x 6; expected"),
        (r"RSA", "CUA", "a matrix CUA"),
        (r"\n +1 +3", "\n             1             9", "pointers that do not rise|from 1 to"),
        (r"\n[^\n]*\n$", "\n", "lines; expected as many as the heading says"),
        (r"1\.0000000000000000E\+03", "1.00000000000x0000E+03", r"line \d+: .*is not a number"),
    ],
    "DMIG, large": [
        (r"^DMIG +KAAX.*\n", "", "line 1: matrix 'KAAX' has no entry that states its form"),
        (r"D\+03", "Q+03", r"line \d+: .*Q.03' is not a number"),
        (r"^\* .*\n", lambda found: found.group() * 2, "more than once"),
        (r"^DMIG( |\n|.)*", "DMIGS\n", "no DMIG entry"),
    ],
    "OP4, strings": [
        (r"\n +7 +1 +1\n.*\n$", "\n", "line 1: no end after 6 columns: the file seems to be cut off"),
        (r"327681|196609|458753", "196610", r"line 3 states 2 words; 2 values follow"),
        (r"E\+03", "x+03", r"line \d+: .* is not a number"),
        (r"1P,3E", "1P,2E", r"line \d+ holds 3 values; expected a column's number or at most 2 values"),
        (r"(\n +1 +0 +\d+\n)", r"\n 1 2 3 4\1", "starts neither a column nor a string"),
    ],
    "Abaqus matrix input, half": [
        (r"3,1, 3,1,", "3,1, 3,", r"line \d+ holds 4 words; expected 5"),
        (r"3,1, 3,1,", "3,1, 3.5,1,", "a node is 3.5; expected whole numbers"),
        (r"e\+03\n", "e+0x3\n", r"line \d+: .*e.0x3' is not a number"),
        (r"3\n$", "", r"line \d+ ends within a number"),
    ],
}


@pytest.mark.parametrize(
    ("kind", "pattern", "new", "message"), [(kind, *one) for kind, some in BAD.items() for one in some]
)
def test_errors_name_file_and_line(tmp_path, kind, pattern, new, message):
    suffix, _, text = TEXTS[kind]
    changed, count = re.subn(pattern, new, text(TOTAL), count=1, flags=re.MULTILINE)
    assert count
    (tmp_path / f"K{suffix}").write_text(changed)
    with pytest.raises(ValueError, match=rf"K\{suffix}: not readable as .*({message})"):
        load_affine(tmp_path / f"K{suffix}")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("K.mtx", "1000000000 1 2.0\n"),
        ("K.hb", harwell_boeing_text(TOTAL).replace("             6             6", "    1000000000    1000000000")),
        ("K.op4", op4_text(TOTAL, layout="big").replace("       6      -6", "99999999-9999999", 1)),
    ],
)
def test_a_matrix_too_large_for_its_file_is_refused(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=rf"{re.escape(name)}: .*(expected at most twenty million|as many|cut off)"):
        load_affine(tmp_path / name)
