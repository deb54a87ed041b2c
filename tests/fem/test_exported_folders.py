"""Folders of whole exports, one as built and one with each group's modulus multiplied, read in one call."""

import contextlib
import re

import numpy as np
import pytest
import scipy.sparse

from skthermo.fem import AffineModel, load_affine
from skthermo.fem.external import read_named_matrices
from tests.fem.exported_files import (
    DOFS,
    TERMS,
    M,
    assert_same,
    coordinates_text,
    dmig_text,
    harwell_boeing_text,
    matrix_input_text,
    op4_text,
    spring,
)

REST = spring(3, 3, 500.0)


def whole(group=None, factor=2.0):
    return REST + sum(term * (factor if name == group else 1.0) for name, term in TERMS.items())


EXPECTED = AffineModel([((name,), term) for name, term in TERMS.items()] + [((), REST)], M, n_modes=4)


MAPPING = "    Matrix Eqn          Node    DOF\n" + "".join(
    f"{i:14d}{node:14d}    U{'XYZ'[direction - 1]}\n" for i, (node, direction) in enumerate(DOFS, start=1)
)
LABELS = "".join(f"{node}.{direction}\n" for node, direction in DOFS)
FROM_ANSYS, HEADING = {"n": 1, "digits": 15, "letter": "D"}, "Row Column Value\n"
PROGRAMS = {
    "abaqus": lambda K, M: {
        "_STIF2.mtx": matrix_input_text(K, DOFS, half="both"),
        "_MASS2.mtx": matrix_input_text(M, DOFS, half="both"),
        "_LOAD2.mtx": "*CLOAD\n3,1, 1.0e3\n",
        ".inp": "*HEADING\n*NODE\n1, 0., 0.\n",
    },
    "ansys": lambda K, M: {
        ".stif": harwell_boeing_text(K, sides=True, **FROM_ANSYS),
        ".mass": harwell_boeing_text(M, **FROM_ANSYS),
        ".mapping": MAPPING,
    },
    "nastran": lambda K, M: {".pch": dmig_text(K, DOFS, name="KAAX") + dmig_text(M, DOFS, name="MAAX")},
    "output4": lambda K, M: {".op4": op4_text(K, name="KAA") + op4_text(M, name="MAA")},
    "calculix": lambda K, M: {
        ".sti": coordinates_text(K, half="upper"),
        ".mas": coordinates_text(M, half="upper"),
        ".dof": LABELS,
    },
    "sap2000": lambda K, M: {".TXK": HEADING + coordinates_text(K), ".TXM": HEADING + coordinates_text(M)},
}
"""What programs write of a job, by the ends of the files' names."""


def write_job(program, folder, job, K, M):
    for suffix, text in PROGRAMS[program](K, M).items():
        (folder / f"{job}{suffix}").write_text(text)


def write(program, folder, factor=2.0):
    for job in ("nominal", *TERMS):
        write_job(program, folder, job, whole(job, factor), M)
    return folder


@pytest.mark.parametrize(("program", "factor"), zip(PROGRAMS, [2.0, 0.5] * 3, strict=True))
def test_a_folder_of_jobs_is_a_model_and_another_mass_names_the_job(tmp_path, program, factor):
    model = load_affine(write(program, tmp_path, factor), factor=factor, n_modes=4)
    assert set(model.parameter_names) == set(TERMS)
    assert_same(model, EXPECTED, 1e-6 if program == "nastran" else 1e-11)
    labels = tuple((node, f"U{'XYZ'[d - 1]}") for node, d in DOFS) if program == "ansys" else tuple(DOFS)
    assert model.dofs == (() if program in ("output4", "sap2000") else labels)
    write_job(program, tmp_path, "E_10", whole("E_10", factor), 2 * M)
    with pytest.raises(ValueError, match="mass of 'E_10' differs from that of 'nominal'"):
        load_affine(tmp_path, factor=factor, n_modes=4)
    assert_same(load_affine(tmp_path, factor=factor, n_modes=4, mass="nominal (mass)"), EXPECTED, 1e-6)


def test_a_wrong_factor_and_a_missing_nominal_job_are_errors_that_name_folder_and_group(tmp_path):
    write("abaqus", tmp_path, 3.0)
    with pytest.raises(ValueError, match=r"test_a_wrong.*'E_2'.*factor was 2"):
        load_affine(tmp_path, factor=2.0, n_modes=4)
    for file in tmp_path.glob("nominal*"):
        file.rename(tmp_path / file.name.replace("nominal", "asbuilt"))
    with pytest.raises(ValueError, match=r"no matrix is called .*nominal.*total=.*asbuilt"):
        load_affine(tmp_path, factor=3.0, n_modes=4)
    assert_same(load_affine(tmp_path, factor=3.0, n_modes=4, total="asbuilt"), EXPECTED)


def test_only_some_groups_may_be_named_and_their_parameters(tmp_path):
    write("nastran", tmp_path)
    model = load_affine(tmp_path, factor=2.0, n_modes=4, stiffness={"E_2": "E", "k_base": "k"})
    rest = REST + TERMS["E_10"]
    assert_same(model, AffineModel({("E",): TERMS["E_2"], ("k",): TERMS["k_base"], (): rest}, M, n_modes=4), 1e-6)


def test_files_of_numpy_hold_a_job_or_all_matrices(tmp_path):
    for job in ("nominal", *TERMS):
        np.savez(tmp_path / f"{job}.npz", K=whole(job), M=M)
    assert_same(load_affine(tmp_path, factor=2.0, n_modes=4), EXPECTED)
    (tmp_path / "all").mkdir()
    file = tmp_path / "all" / "bridge.npz"
    np.savez(file, M=M, K0=whole(), **{name: whole(name, 5.0) for name in TERMS})
    assert_same(load_affine(file, factor=5.0, n_modes=4), EXPECTED)
    scipy.sparse.save_npz(file.with_name("other.npz"), scipy.sparse.csc_array(M))
    with pytest.raises(ValueError, match=r"bridge\.npz holds .*; expected one stiffness K"):
        load_affine(file.parent, factor=5.0, n_modes=4)


def test_labels_that_occur_more_than_once_are_left_out(tmp_path):
    """CalculiX writes such labels for beams: rows that share one are still different rows."""
    write("calculix", tmp_path)
    for job in ("nominal", *TERMS):
        (tmp_path / f"{job}.dof").write_text("1.1\n1.2\n1.1\n2.1\n2.2\n2.3\n")
    model = load_affine(tmp_path, factor=2.0, n_modes=4)
    assert_same(model, EXPECTED)
    assert model.dofs == ()


def test_names_may_stand_anywhere_in_their_field(tmp_path):
    """pyNastran writes names of matrices at the right end of large fields."""
    write("nastran", tmp_path)
    for file in tmp_path.iterdir():
        moved = re.sub(r"(?m)^(DMIG\*   )(.{16})", lambda m: m[1] + m[2].strip().rjust(16), file.read_text())
        assert moved != file.read_text()
        file.write_text(moved)
    assert_same(load_affine(tmp_path, factor=2.0, n_modes=4), EXPECTED, 1e-8)  # nine digits


@pytest.mark.parametrize(
    ("integers", "program"), [([100, -(2**31), 4, *[0] * 98, 100], "ANSYS"), ([4, 3, 4, 12], "Nastran")]
)
def test_binary_files_of_programs_are_named(tmp_path, integers, program):
    file = tmp_path / "nominal.bin"
    file.write_bytes(np.array(integers, dtype="<i4").tobytes())
    for path in (file, tmp_path):
        with pytest.raises(ValueError, match=f"nominal.bin is an? .* file of {program}; expected another file"):
            load_affine(path)
    write("abaqus", tmp_path)
    assert_same(load_affine(tmp_path, factor=2.0, n_modes=4), EXPECTED)  # beside texts, they are ignored


def binary_op4(folder, job, K, M, order="<", kind=2, layout="dense", word=4):
    """OUTPUT4 in binary form, its integers of four or eight bytes; columns of zeros are left out."""
    number, size = f"{order}f{max(word, 4 * kind)}", max(word, 4 * kind) // word

    def integers(*values):
        return np.array(values, dtype=f"{order}i{word}").tobytes()

    def record(*contents):
        content = b"".join(contents)
        length = np.array([len(content)], dtype=order + "i4").tobytes()
        return length + content + length

    def string(first, values):
        words = size * len(values) + 1
        return integers(words, first) if layout == "big" else integers(65536 * words + first)

    parts = []
    for name, matrix in {"KLL": K, "MLL": M}.items():
        n_rows = -len(matrix) if layout == "big" else len(matrix)
        parts.append(record(integers(len(matrix), n_rows, 6, kind), name.ljust(2 * word).encode()))
        for j, column in enumerate(matrix.T, start=1):
            (used,) = np.nonzero(column)
            if not len(used):
                continue
            if layout == "dense":
                values = column[used[0] : used[-1] + 1].astype(number)
                parts.append(record(integers(j, used[0] + 1, len(values) * size), values.tobytes()))
                continue
            rows = np.split(used, np.flatnonzero(np.diff(used) > 1) + 1)
            strings = b"".join(string(some[0] + 1, some) + column[some].astype(number).tobytes() for some in rows)
            parts.append(record(integers(j, 0, len(strings) // word), strings))
        parts.append(record(integers(len(matrix) + 1, 1, size), np.ones(1, dtype=number).tobytes()))
    (folder / f"{job}.op4").write_bytes(b"".join(parts))


LAYOUTS = ["dense", "strings", "big"]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    ("order", "kind", "word", "tolerance"),
    [("<", 1, 4, 1e-6), (">", 2, 4, 1e-12), (">", 1, 8, 1e-12), ("<", 2, 8, 1e-12)],
)
def test_binary_output4(tmp_path, layout, order, kind, word, tolerance):
    binary_op4(tmp_path, "nominal", whole(), M, order=order, kind=kind, layout=layout, word=word)
    model = load_affine(tmp_path / "nominal.op4", n_modes=4, mass="MLL")
    assert_same(model, AffineModel({("KLL",): whole()}, M, n_modes=4), tolerance)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_damaged_binary_output4_is_read_or_refused(tmp_path, layout):
    """What is cut off gives an error that names the file, and no change of a byte anything but an error."""
    binary_op4(tmp_path, "nominal", whole(), M, layout=layout)
    file, random = tmp_path / "nominal.op4", np.random.default_rng(0)
    sound = file.read_bytes()
    other_row = np.array([0 if layout == "dense" else 1], "<i4").tobytes()
    for refused in (*(sound[:n] for n in random.integers(1, len(sound), 12)), sound[:40] + other_row + sound[44:]):
        file.write_bytes(refused)
        with pytest.raises(ValueError, match=r"nominal\.op4"):
            load_affine(file, n_modes=4)
    for place in random.integers(0, len(sound), 60):
        file.write_bytes(sound[:place] + bytes([random.integers(256)]) + sound[place + 1 :])
        with contextlib.suppress(ValueError):
            read_named_matrices(file, lambda name: True)
