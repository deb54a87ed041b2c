"""Recipes for programs that are not run here: on files in their formats, and on stand-ins for their interfaces."""

import io
import json
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, Bar, CallableModel, Structure, sample
from tests.drop_ins.recipes import run_recipe
from tests.fem.exported_files import coordinates_text, matrix_input_text

PAGE = "fe_programs.rst"
THETA = np.random.default_rng(0).uniform(0.7, 1.3, (4, 2))
STEEL = {"E": 210e9, "A": 0.01, "density": 7850.0}


@pytest.fixture(scope="module")
def tower():
    """A braced tower of bars in space, whose parts are the groups E_deck and E_arch."""
    nodes = {(floor, i): (x, y, 3.0 * floor) for floor in range(3) for i, (x, y) in enumerate([(0, 0), (2, 0), (0, 2)])}
    pairs = [((f, i), (f + 1, j)) for f in range(2) for i in range(3) for j in range(3)]
    pairs += [((f, i), (f, (i + 1) % 3)) for f in (1, 2) for i in range(3)]
    members = {number: Bar(*pair, **STEEL) for number, pair in enumerate(pairs, start=1)}
    lower = [number for number, (first, last) in enumerate(pairs, start=1) if max(first[0], last[0]) == 1]
    groups = {"E_deck": lower, "E_arch": [number for number in members if number not in lower]}
    return Structure(nodes, members, {(0, i): "xyz" for i in range(3)}, groups)


@pytest.fixture(scope="module")
def model(tower):
    return tower.assemble(["E_deck", "E_arch"], n_modes=4)


JOBS = "nominal", "E_deck", "E_arch"


def whole(model, job):
    """Stiffness of the whole with the modulus of one group doubled, or as built."""
    return model.matrices([2.0 if name == job else 1.0 for name in model.parameter_names])[0]


def assert_same(found, model):
    np.testing.assert_allclose(found.frequencies(THETA), model.frequencies(THETA), rtol=1e-8)


def abaqus(folder, job, K, M, labels):
    (folder / f"{job}_STIF1.mtx").write_text(matrix_input_text(K, labels))
    if job == "nominal":
        (folder / f"{job}_MASS1.mtx").write_text(matrix_input_text(M, labels))


def sap2000(folder, job, K, M, labels):
    for suffix, matrix in ({"TXK": K} | ({"TXM": M} if job == "nominal" else {})).items():
        (folder / f"{job}.{suffix}").write_text("Note: the heading of a version\n" + coordinates_text(matrix))


@pytest.mark.one_case
@pytest.mark.parametrize("program", [abaqus, sap2000])
def test_a_folder_of_jobs(program, model, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bridge").mkdir()
    labels = [(i + 1, 1) for i in range(model.n_dof)]
    for job in JOBS:
        program(tmp_path / "bridge", job, whole(model, job).toarray(), model.matrices([1, 1])[1].toarray(), labels)
    assert_same(run_recipe(PAGE, "recipe-folder")["model"].with_parameters(["E_deck", "E_arch"]), model)


def test_a_full_file_of_ansys():
    """The lowest frequencies are those that the documentation of its reader gives for its file."""
    examples = pytest.importorskip("ansys.mapdl.reader.examples", reason="ansys-mapdl-reader is not installed")
    recipe = run_recipe(PAGE, "recipe-ansys-full")
    K, M, labels = recipe["matrices"](examples.fullfile)
    assert K.shape == M.shape == (len(labels), len(labels)) == (900, 900)
    found = AffineModel({("E",): K}, M, n_modes=4, dofs=labels)
    assert found.frequencies([[1.0]])[0] == pytest.approx([1283.200, 1283.200, 5781.975, 6919.399], abs=6e-4)


def test_terms_from_full_files(model):
    pytest.importorskip("ansys.mapdl.reader", reason="ansys-mapdl-reader is not installed")
    recipe = run_recipe(PAGE, "recipe-ansys-full")
    M = model.matrices([1.0, 1.0])[1]
    recipe["matrices"] = lambda file: (whole(model, file.removesuffix(".full")), M, model.dofs)
    recipe = run_recipe(PAGE, "recipe-ansys-terms", **recipe)
    assert_same(recipe["model"], model)
    assert recipe["model"].dofs == model.dofs


def record(values):
    """A record of an ANSYS binary file: its length in words, a flag, the values, and its length."""
    content = np.ascontiguousarray(values).tobytes()
    n_words = np.int32(len(content) // 4).tobytes()
    return n_words + np.int32(0).tobytes() + content + n_words


def write_emat(path, structure):
    """Element matrices of bars as an .emat file; nodes and elements are not in the order of their numbers."""
    random = np.random.default_rng(3)
    nodes = random.permutation(len(structure.nodes)).tolist()  # positions -> indices
    number = {node: 10 * (i + 1) for i, node in enumerate(structure.nodes)}
    position = {list(structure.nodes)[i]: place for place, i in enumerate(nodes)}
    order = random.permutation(list(structure.members)).tolist()
    header = np.zeros(40, dtype=np.int32)
    header[[0, 1, 2, 4, 10, 11]] = 2, len(order), 3, len(nodes), 1, 1  # elements, directions, nodes; both matrices
    standard = np.zeros(100, dtype=np.int32)
    standard[0] = 2  # a file of element matrices
    standard = bytearray(record(standard))
    standard[44:48] = b"15.0"[::-1]
    parts = [bytes(standard), record(header)]
    for pointer, table in ((31, [number[list(structure.nodes)[i]] for i in nodes]), (32, order)):
        header[pointer] = sum(map(len, parts)) // 4
        parts.append(record(np.array(table, dtype=np.int32)))
    header[37] = sum(map(len, parts)) // 4
    parts.append(record(np.zeros(2 * len(order), dtype=np.int32)))
    index, places = len(parts) - 1, []
    for name in order:
        bar = structure.members[name]
        ends = np.array([structure.nodes[node] for node in bar.nodes])
        matrices = [sum(by_properties.values()) for by_properties in (bar.stiffness(ends), bar.mass(ends))]
        rows = [3 * position[node] + i + 1 for node in bar.nodes for i in range(3)]
        places.append(sum(map(len, parts)) // 4)
        parts.append(record(np.array([1, 1, 0, 0, 0, 0, 0, 0, 0, -len(rows)], dtype=np.int32)))
        parts.append(record(np.array(rows, dtype=np.int32)))
        parts += [record(np.asarray(matrix)[np.tril_indices(len(rows))]) for matrix in matrices]
    parts[1] = record(header)
    parts[index] = record(np.array(places + [0] * len(order), dtype=np.int32))
    path.write_bytes(b"".join(parts))
    return number


def test_element_matrices_of_ansys(tower, model, tmp_path, monkeypatch):
    pytest.importorskip("ansys.mapdl.reader", reason="ansys-mapdl-reader is not installed")
    monkeypatch.chdir(tmp_path)
    number = write_emat(tmp_path / "bridge.emat", tower)
    held = {(number[node], direction) for node in tower.supports for direction in "xyz"}
    recipe = run_recipe(PAGE, "recipe-ansys-emat", components=tower.groups, held=held)
    assert_same(recipe["model"], model)
    assert set(recipe["model"].dofs) == {(number[node], direction) for node, direction in model.dofs}
    deck = {"E_deck": tower.groups["E_deck"]}  # elements of no component have constant stiffness
    found = run_recipe(PAGE, "recipe-ansys-emat", components=deck, held=held)["model"].frequencies(THETA[:, :1])
    np.testing.assert_allclose(found, model.with_parameters(["E_deck"]).frequencies(THETA[:, :1]), rtol=1e-8)


def test_output4_that_pynastran_writes(model, tmp_path, monkeypatch):
    op4 = pytest.importorskip("pyNastran.op4.op4", reason="pyNastran is not installed")
    from pyNastran.op2.result_objects.matrix import Matrix

    monkeypatch.chdir(tmp_path)
    (tmp_path / "bridge").mkdir()
    for job in JOBS:
        matrices = {"KGG": Matrix("KGG", 6), "MGG": Matrix("MGG", 6)}
        matrices["KGG"].data = whole(model, job).toarray()
        matrices["MGG"].data = model.matrices([1, 1])[1].toarray()
        op4.OP4().write_op4(f"bridge/{job}.op4", matrices, is_binary=False)
    assert_same(run_recipe(PAGE, "recipe-folder")["model"].with_parameters(["E_deck", "E_arch"]), model)


@pytest.mark.parametrize("size", [8, 16])
def test_dmig_that_pynastran_writes(model, tmp_path, monkeypatch, size):
    try:
        from pyNastran.bdf.bdf import BDF
    except (ImportError, AttributeError):  # version 1.4.1 wants NumPy below 2
        pytest.skip("pyNastran is not installed, or not for this NumPy")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bridge").mkdir()
    nodes = list(dict.fromkeys(node for node, _ in model.dofs))
    labels = [(10 * nodes.index(node) + 1, "xyz".index(direction) + 1) for node, direction in model.dofs]
    for job in JOBS:
        bdf = BDF(debug=None)
        for name, matrix in (("KAAX", whole(model, job)), ("MAAX", model.matrices([1, 1])[1])):
            lower = scipy.sparse.tril(matrix).tocoo()
            rows, columns = ([labels[i] for i in place] for place in (lower.row, lower.col))
            bdf.add_dmig(name, 6, 2, 0, 0, len(labels), columns, rows, lower.data.tolist())
        bdf.write_bdf(f"bridge/{job}.pch", size=size, is_double=size == 16)
    found = run_recipe(PAGE, "recipe-folder")["model"].with_parameters(["E_deck", "E_arch"])
    assert set(found.dofs) == set(labels)
    np.testing.assert_allclose(found.frequencies(THETA), model.frequencies(THETA), rtol=1e-3 if size == 8 else 1e-8)


class AsterMatrix:
    """What Code_Aster gives of an assembled matrix."""

    def __init__(self, matrix):
        self.matrix = scipy.sparse.coo_array(matrix)

    def EXTR_MATR(self, sparse=False):
        assert sparse
        return self.matrix.data, self.matrix.row, self.matrix.col, self.matrix.shape[0]


def test_code_aster(tower, model, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bridge").mkdir()
    nodes = list(tower.nodes)
    free = [(nodes.index(node), f"D{direction.upper()}") for node, direction in model.dofs]
    held = {(nodes.index(node), f"D{direction}") for node in tower.supports for direction in "XYZ"}
    labels = sorted({*free, *held})
    places = [labels.index(label) for label in free]

    def with_held(matrix):
        embedded = 1e5 * np.eye(len(labels))  # the held ones too, which are no part of the model
        embedded[np.ix_(places, places)] = matrix.toarray()
        return AsterMatrix(embedded)

    numbering = SimpleNamespace(getNodeAndComponentFromDOF=lambda: labels)
    save = run_recipe(PAGE, "recipe-code-aster", held=held)["save"]
    for job in JOBS:
        save(job, with_held(whole(model, job)), numbering)
    save("M", with_held(model.matrices([1, 1])[1]), numbering)
    assert_same(run_recipe(PAGE, "recipe-folder")["model"].with_parameters(["E_deck", "E_arch"]), model)


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


class CivilNX:
    """Stands for the interface of Midas Civil NX: frequencies are those of a truss with the moduli of its materials."""

    def __init__(self):
        self.materials = {str(i): {"NAME": f"{i}", "PARAM": [{"P_TYPE": 2, "ELAST": 2e8}]} for i in (1, 2)}
        self.analysed = None

    def answer(self, request):
        assert request.get_header("Mapi-key") == "secret"
        body = json.loads(request.data)
        match request.get_method(), request.selector:
            case "GET", "/db/MATL":
                found = {"MATL": self.materials}
            case "PUT", "/db/MATL":
                self.analysed, self.materials, found = None, self.materials | body["Assign"], {"MATL": body["Assign"]}
            case "POST", "/doc/ANAL":
                assert body == {"Argument": {}}
                multipliers = [one["PARAM"][0]["ELAST"] / 2e8 for one in self.materials.values()]
                self.analysed = make_truss().frequencies([[*multipliers, 1.0, 1.0]])[0].tolist()
                found = {"message": "complete"}
            case "POST", "/post/TABLE":
                rows = [[str(i), str(i), f"{2 * np.pi * f}", repr(f)] for i, f in enumerate(self.analysed, start=1)]
                modes = {"HEAD": ["Index", "ModeNo", "Frequency(rad/sec)", "Frequency(cycle/sec)"], "DATA": rows}
                other = {"MODAL PARTICIPATION FACTOR PRINTOUT": {"HEAD": [], "DATA": []}}
                found = {body["Argument"]["TABLE_NAME"]: {"SUB_TABLES": [other, {"EIGENVALUE ANALYSIS": modes}]}}
        return io.BytesIO(json.dumps(found).encode())


@pytest.mark.nightly
def test_civil_nx(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("urllib.request.urlopen", CivilNX().answer)
    recipe = run_recipe(PAGE, "recipe-civil-nx", address="http://127.0.0.1", key="secret")
    expected = make_truss().frequencies(np.hstack([THETA, np.ones((4, 2))]))[:, :4]
    np.testing.assert_allclose(recipe["model"].frequencies(THETA), expected, rtol=1e-12)
    np.testing.assert_allclose(recipe["model"].frequencies(THETA[::-1]), expected[::-1], rtol=1e-12)  # from the cache
    assert recipe["built"]["1"]["PARAM"][0]["ELAST"] == 2e8


@pytest.mark.nightly
def test_an_emulator_has_the_frequencies_of_its_program():
    truss = make_truss()
    program = CallableModel(lambda row: truss.frequencies([row])[0], truss.parameter_names, 6)
    fast = run_recipe(PAGE, "recipe-emulator", model=program)["fast"]
    test = sample(truss, 0.3, 500, random_state=1)
    errors = fast.frequencies(test.theta) / test.frequencies - 1
    assert np.sqrt(np.mean(errors**2)) < 1e-3
