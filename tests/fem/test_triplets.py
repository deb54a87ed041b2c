"""Matrices as CalculiX and SAP2000 write them: half of the entries, a line each."""

import numpy as np
import pytest

from skthermo.fem import AffineModel, load_affine, read_triplets
from tests.fem.exported_files import TERMS, TOTAL, M, N, assert_same


def write_half(file, matrix, *, upper=True, heading=""):
    half = np.triu(matrix) if upper else np.tril(matrix)
    lines = [f"{i + 1} {j + 1}  {half[i, j]:.17e}" for i, j in zip(*np.nonzero(half), strict=True)]
    file.write_text(heading + "\n".join(lines))
    return file


@pytest.mark.parametrize("upper", [True, False])
@pytest.mark.parametrize("heading", ["", "Note: the lower half\n\trow\tcolumn\tvalue\n\n"])
def test_either_half_is_the_whole_matrix(tmp_path, upper, heading):
    file = write_half(tmp_path / "bridge.TXK", TOTAL, upper=upper, heading=heading)
    np.testing.assert_array_equal(read_triplets(file).toarray(), TOTAL)


def test_a_mass_whose_last_rows_are_zero_has_the_size_of_the_stiffness(tmp_path):
    light = M * (np.arange(N) < 4)
    for name, matrix in (TERMS | {"M": light}).items():
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
def test_errors_name_the_file(tmp_path, text, message):
    (tmp_path / "bridge.sti").write_text(text)
    with pytest.raises(ValueError, match=rf"bridge\.sti: not readable as lines of entries .*{message}"):
        read_triplets(tmp_path / "bridge.sti")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"bridge\.sti does not exist; expected a text"):
        read_triplets(tmp_path / "bridge.sti")
