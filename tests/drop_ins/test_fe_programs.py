"""Recipes for FE programs, against the programs themselves."""

import re
import shutil
import subprocess

import numpy as np
import pytest
import scipy.linalg

from skthermo.fem import Beam, Structure
from tests.drop_ins.recipes import run_recipe

PAGE = "fe_programs.rst"
THETA = np.random.default_rng(0).uniform(0.7, 1.3, (4, 2))


def test_pynite(tmp_path, monkeypatch):
    pytest.importorskip("Pynite", reason="PyNiteFEA is not installed: the extra 'oracle' brings it")
    monkeypatch.chdir(tmp_path)
    recipe = run_recipe(PAGE, "recipe-pynite")
    theirs = recipe["slow"].frequencies(THETA)
    assert recipe["slow"].cache == tmp_path / "frame.solved"
    np.testing.assert_allclose(recipe["fast"].frequencies(THETA), theirs, rtol=1e-8)

    section = {"A": 0.12, "I_yy": 1.6e-3, "I_zz": 9e-4, "J": 2e-3, "I_p": 2e-3}
    concrete = {"E": 30e9, "G": 12.5e9, "density": 2500.0}
    ours = Structure(
        {"a": (0, 0, 0), "b": (0, 4, 0), "c": (6, 4, 0), "d": (6, 0, 0)},
        {i + j: Beam(i, j, **section, **concrete, orientation=(0, 0, 1)) for i, j in ("ab", "bc", "cd")},
        dict.fromkeys("ad", "xyz rx ry rz"),
        {"columns": ["ab", "cd"], "beam": ["bc"]},
    ).assemble(["columns", "beam"])
    np.testing.assert_allclose(ours.frequencies(THETA), theirs, rtol=1e-6)


def test_opensees():
    pytest.importorskip("openseespy", reason="openseespy is not installed; its licence is not an open-source one")
    recipe = run_recipe(PAGE, "recipe-opensees")
    for row, ours in zip(THETA, recipe["model"].frequencies(THETA), strict=True):
        columns, beam = row
        recipe["build"]([columns, beam, columns])
        theirs = np.sqrt(recipe["ops"].eigen("-fullGenLapack", 4)) / (2 * np.pi)
        np.testing.assert_allclose(ours, theirs, rtol=1e-8)
    divided = recipe["frame"].divide(recipe["model"], {"columns": {"left column": ["left"]}})
    recipe["build"]([0.7, 1.0, 1.0])
    theirs = np.sqrt(recipe["ops"].eigen("-fullGenLapack", 4)) / (2 * np.pi)
    damaged = divided.damaged({"left column": 0.3}).frequencies([[1.0, 1.0]])[0]
    np.testing.assert_allclose(damaged, theirs, rtol=1e-8)


def test_ospgrillage():
    pytest.importorskip("ospgrillage", reason="ospgrillage is not installed; it needs openseespy")
    recipe = run_recipe(PAGE, "recipe-ospgrillage")
    theta = np.array([[1.0, 1.0], [0.5, 1.25], [2.0, 0.5]])  # multipliers whose moduli have four digits
    for row, ours in zip(theta, recipe["model"].frequencies(theta), strict=True):
        recipe["bridge"](row)
        theirs = np.sqrt(recipe["og"].ops.eigen(4)) / (2 * np.pi)
        np.testing.assert_allclose(ours, theirs, rtol=1e-8)
    mass = recipe["model"].matrices([1.0, 1.0])[1].diagonal().sum() / 3
    girders = 5 * 20 * 0.9 * 2500
    assert girders < mass < 1.1 * girders  # in kg: girders, and a slab whose strips have no mass beside theirs


CARDS = """
*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 2, 0, 0.5
4, 3, 0, 0.5
5, 4, 0, 0
*ELEMENT, TYPE=B31, ELSET=DECK
1, 1, 2
2, 2, 3
*ELEMENT, TYPE=B31, ELSET=ARCH
3, 3, 4
4, 4, 5
*MATERIAL, NAME=DECK
*ELASTIC
{E_deck}, 0.2
*DENSITY
2500.
*MATERIAL, NAME=ARCH
*ELASTIC
{E_arch}, 0.2
*DENSITY
2500.
*BEAM SECTION, ELSET=DECK, MATERIAL=DECK, SECTION=RECT
0.3, 0.4
0, 1, 0
*BEAM SECTION, ELSET=ARCH, MATERIAL=ARCH, SECTION=RECT
0.3, 0.4
0, 1, 0
*BOUNDARY
1, 1, 6
*STEP
*FREQUENCY, SOLVER=MATRIXSTORAGE
4
*END STEP
"""


def run_ccx(folder, cards, E_deck=30e9, E_arch=30e9):
    (folder / "job.inp").write_text(cards.format(E_deck=E_deck, E_arch=E_arch))
    subprocess.run(["ccx", "job"], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def job(tmp_path, monkeypatch):
    """A folder with the recipe's input file."""
    if shutil.which("ccx") is None:
        pytest.skip("CalculiX is not installed")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bridge.inp").write_text(CARDS)
    return tmp_path


@pytest.mark.nightly
def test_calculix(job):
    recipe = run_recipe(PAGE, "recipe-calculix")
    for row, ours in zip(THETA, recipe["model"].frequencies(THETA), strict=True):
        run_ccx(job, CARDS.replace(", SOLVER=MATRIXSTORAGE", ""), *30e9 * row)
        found = re.findall(r"^ +\d+ +\S+ +\S+ +(\S+) +\S+$", (job / "job.dat").read_text(), flags=re.MULTILINE)
        np.testing.assert_allclose(ours, np.float64(found[:4]), rtol=5e-7)


@pytest.mark.nightly
def test_calculix_by_hand(job):
    folder = job / "bridge"
    folder.mkdir()
    jobs = {"nominal": (30e9, 30e9), "E_deck": (60e9, 30e9), "E_arch": (30e9, 60e9)}
    for name, moduli in jobs.items():
        run_ccx(job, CARDS, *moduli)
        for suffix in ("sti", "mas", "dof") if name == "nominal" else ("sti",):
            shutil.move(job / f"job.{suffix}", folder / f"{name}.{suffix}")
    by_hand = run_recipe(PAGE, "recipe-folder")["model"].with_parameters(["E_deck", "E_arch"])
    recipe = run_recipe(PAGE, "recipe-calculix")
    np.testing.assert_allclose(by_hand.frequencies(THETA), recipe["model"].frequencies(THETA), rtol=1e-8)
    assert by_hand.dofs == ()  # rows of beams have labels that occur more than once


NASTRAN = """
SOL 103
OUTPUT4 KLL,MLL,,,//-1/21 $
CEND
SPC = 1
METHOD = 1
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,0.,2.,0.
GRID,3,,0.,4.,0.
GRID,4,,3.,4.,0.
GRID,5,,6.,4.,0.
GRID,6,,6.,2.,0.
GRID,7,,6.,0.,0.
CBAR,1,1,1,2,0.,0.,1.
CBAR,2,1,2,3,0.,0.,1.
CBAR,3,2,3,4,0.,0.,1.
CBAR,4,2,4,5,0.,0.,1.
CBAR,5,1,5,6,0.,0.,1.
CBAR,6,1,6,7,0.,0.,1.
PBAR,1,1,0.12,9.-4,1.6-3,2.-3
PBAR,2,2,0.12,9.-4,1.6-3,2.-3
{materials}
SPC1,1,123456,1,7
EIGRL,1,,,4
ENDDATA
"""


@pytest.fixture
def mystran(tmp_path, monkeypatch):
    """A call of MYSTRAN for a job, with moduli of two materials; it returns the frequencies that are printed."""
    command = shutil.which("mystran")
    if command is None:
        pytest.skip("MYSTRAN is not installed")
    monkeypatch.chdir(tmp_path)

    def run(job, multipliers):
        cards = (
            f"MAT1*   {i:16d}{30e9 * t:16.9E}{12.5e9 * t:16.9E}{'':16s}\n*       {2500.0:16.1f}"
            for i, t in enumerate(multipliers, start=1)
        )
        (tmp_path / f"{job}.bdf").write_text(NASTRAN.strip().format(materials="\n".join(cards)) + "\n")
        subprocess.run([command, f"{job}.bdf"], cwd=tmp_path, check=True, capture_output=True)
        rows = re.findall(r"^ +\d+ +\d+((?: +-?\d\.\d{6}E[+-]\d\d){5})", (tmp_path / f"{job}.F06").read_text(), re.M)
        return np.array([float(row.split()[2]) for row in rows])

    return run


def test_mystran(mystran, tmp_path):
    """A solver of Nastran's input: its OUTPUT4, which is binary, and its own frequencies, of seven digits."""
    (tmp_path / "bridge").mkdir()
    for job, multipliers in {"nominal": (1, 1), "E_deck": (2, 1), "E_arch": (1, 2)}.items():
        mystran(job, multipliers)
        shutil.move(tmp_path / f"{job}.OU1", tmp_path / "bridge" / f"{job}.op4")
    model = run_recipe(PAGE, "recipe-folder")["model"].with_parameters(["E_deck", "E_arch"])
    for row, ours in zip(THETA, model.frequencies(THETA), strict=True):
        np.testing.assert_allclose(ours, mystran("other", row), rtol=5e-7)


def test_scikit_fem():
    pytest.importorskip("skfem", reason="scikit-fem is not installed")
    recipe = run_recipe(PAGE, "recipe-scikit-fem")
    from skfem import BilinearForm
    from skfem.helpers import ddot, eye, sym_grad, trace

    mass = recipe["mass"][recipe["free"]][:, recipe["free"]]
    for row, ours in zip(THETA, recipe["model"].frequencies(THETA), strict=True):

        @BilinearForm
        def wall(u, v, w, row=row):
            lame, shear = recipe["lame_parameters"](30e9 * np.where(w.x[0] < 3, *row), 0.2)
            strain = sym_grad(u)
            return ddot(2 * shear * strain + eye(lame * trace(strain), 2), sym_grad(v))

        stiffness = wall.assemble(recipe["whole"])[recipe["free"]][:, recipe["free"]]
        squared = scipy.linalg.eigh(stiffness.toarray(), mass.toarray(), eigvals_only=True, subset_by_index=[0, 3])
        np.testing.assert_allclose(ours, np.sqrt(squared) / (2 * np.pi), rtol=1e-8)
    slender = 1.8751**2 / (2 * np.pi * 6**2) * np.sqrt(30e9 / (1 - 0.2**2) * 0.4**2 / 12 / 2500)
    assert recipe["model"].frequencies([[1.0, 1.0]])[0, 0] == pytest.approx(slender, rel=0.01)
