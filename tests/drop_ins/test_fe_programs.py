"""Recipes for FE programs, against the programs themselves."""

import re
import shutil
import subprocess
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import scipy.linalg

from skthermo.fem import AffineModel, Beam, Structure, load_affine
from tests.drop_ins.recipes import run_recipe
from tests.fem.exported_files import TERMS, TOTAL

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
        recipe["build"](row)
        theirs = np.sqrt(recipe["ops"].eigen("-fullGenLapack", 4)) / (2 * np.pi)
        np.testing.assert_allclose(ours, theirs, rtol=1e-8)


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


def test_calculix(job):
    recipe = run_recipe(PAGE, "recipe-calculix")
    for row, ours in zip(THETA, recipe["model"].frequencies(THETA), strict=True):
        run_ccx(job, CARDS.replace(", SOLVER=MATRIXSTORAGE", ""), *30e9 * row)
        found = re.findall(r"^ +\d+ +\S+ +\S+ +(\S+) +\S+$", (job / "job.dat").read_text(), flags=re.MULTILINE)
        np.testing.assert_allclose(ours, np.float64(found[:4]), rtol=5e-7)


def test_calculix_by_hand(job):
    folder = job / "folder"
    folder.mkdir()
    for name, moduli in {"K0": (30e9, 30e9), "E_deck": (30e9, 30.0), "E_arch": (30.0, 30e9)}.items():
        run_ccx(job, CARDS, *moduli)
        shutil.move(job / "job.sti", folder / f"{name}.sti")
    shutil.move(job / "job.mas", folder / "M.mas")
    by_hand = load_affine(folder, n_modes=4).with_parameters(["E_deck", "E_arch"])
    recipe = run_recipe(PAGE, "recipe-calculix")
    np.testing.assert_allclose(by_hand.frequencies(THETA), recipe["model"].frequencies(THETA), rtol=1e-8)


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


def test_sap2000s_text_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    deck, arch, base = TERMS.values()
    files = {"bridge.TXK": TOTAL, "bridge.TXM": np.diag([1.0, 2, 3, 4, 5, 0])}
    files |= {"bridge_E_deck_doubled.TXK": TOTAL + deck, "bridge_E_arch_doubled.TXK": TOTAL + arch}
    for name, matrix in files.items():
        half = np.tril(matrix)
        lines = [f"{i + 1}\t{j + 1}\t{float(half[i, j])!r}" for i, j in zip(*np.nonzero(half), strict=True)]
        (tmp_path / name).write_text("\n".join(["Note: the heading of a version", *lines]))
    expected = AffineModel({("E_deck",): deck, ("E_arch",): arch, (): base}, files["bridge.TXM"], n_modes=4)
    recipe = run_recipe(PAGE, "recipe-sap2000")
    np.testing.assert_allclose(recipe["model"].frequencies(THETA), expected.frequencies(THETA), rtol=1e-9)


class StandIn:
    """SAP2000's programming interface, where a frequency is the square root of its material's modulus."""

    def __init__(self):
        self.moduli = {}
        self.PropMaterial = SimpleNamespace(SetMPIsotropic=self.set_modulus)
        self.Analyze = SimpleNamespace(RunAnalysis=lambda: 0)
        setup = SimpleNamespace(DeselectAllCasesAndCombosForOutput=lambda: 0, SetCaseSelectedForOutput=lambda case: 0)
        self.Results = SimpleNamespace(Setup=setup, ModalPeriod=self.periods)

    def SetModelIsLocked(self, locked):
        self.locked = locked

    def set_modulus(self, material, E, poisson, expansion):
        assert not self.locked
        self.moduli[material] = E

    def periods(self, *by_reference):
        assert len(by_reference) == 8
        f = np.sqrt([*self.moduli.values(), 4e12, 9e12, 16e12])
        return [len(f), ["MODAL"] * 5, ["Mode"] * 5, [1.0, 2.0, 3.0, 4.0, 5.0], tuple(1 / f), tuple(f), tuple(f), (), 0]


def test_sap2000s_interface(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    client = ModuleType("comtypes.client")
    client.GetActiveObject = lambda name: SimpleNamespace(SapModel=StandIn())
    package = ModuleType("comtypes")
    package.client = client
    monkeypatch.setitem(sys.modules, "comtypes", package)
    monkeypatch.setitem(sys.modules, "comtypes.client", client)
    recipe = run_recipe(PAGE, "recipe-sap2000-interface")
    expected = np.column_stack([np.sqrt(THETA * [30e9, 210e9]), np.full((4, 2), [2e6, 3e6])])
    np.testing.assert_allclose(recipe["model"].frequencies(THETA), expected)
