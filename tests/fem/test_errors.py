"""Bad structures, models and parameters are refused by name."""

import re

import numpy as np
import pytest
import scipy.sparse

from skthermo.datasets import make_truss, make_truss_campaign, make_z24
from skthermo.fem import AffineModel, Bar, CallableModel, Spring, Structure, evaluate, linearise, sample

STEEL = {"E": 210e9, "A": 0.01, "density": 7850.0}
NODES = {"a": (0, 0), "b": (3, 0), "c": (3, 2)}
MEMBERS = {"ab": Bar("a", "b", **STEEL), "bc": Bar("b", "c", **STEEL), "ca": Bar("c", "a", **STEEL)}
SUPPORTS = {"a": "xy", "b": "y"}
GROUPS = {"tie": ["ab"], "rest": ["bc", "ca"]}


def structure(nodes=NODES, members=MEMBERS, supports=SUPPORTS, groups=GROUPS):
    return Structure(nodes, members, supports, groups)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"nodes": NODES | {"d": (3, 2, 1)}}, "node 'd' has the coordinates"),
        ({"members": MEMBERS | {"ax": Bar("a", "x", **STEEL)}}, "member 'ax' ends at node 'x'"),
        ({"members": MEMBERS | {"ab": Bar("a", "b", **STEEL | {"E": -1.0})}}, "member 'ab' has E = -1.0"),
        ({"members": MEMBERS | {"ab": Bar("a", "b", **STEEL | {"A": 0.0})}}, "member 'ab' has A = 0.0"),
        ({"members": MEMBERS | {"s": Spring("c", "x", float("nan"))}}, "member 's' has k = nan"),
        ({"members": MEMBERS | {"s": Spring("c", "z", 1.0)}}, "member 's' acts along 'z' of node 'c'"),
        (
            {"nodes": NODES | {"d": (3, 2 + 1e-9)}, "members": MEMBERS | {"cd": Bar("c", "d", **STEEL)}},
            "member 'cd' has a length of 1e-09 m; expected at least 3.61e-06 m, a millionth of the structure's extent",
        ),
        ({"supports": {"q": "x"}}, "supports name node 'q'"),
        ({"supports": {"a": "xz"}}, "support of node 'a' along 'z'; expected some of"),
        ({"groups": {"tie": ["xy"]}}, "group 'tie' holds"),
        ({"groups": {"tie": "ax"}}, "group 'tie' holds .'ax'."),
    ],
)
def test_structure_names_what_is_wrong(changes, message):
    with pytest.raises(ValueError, match=message):
        structure(**changes)


def test_mechanism_names_the_node_that_moves():
    unbraced = {"a": (0, 0), "b": (3, 0), "c": (0, 2), "d": (3, 2)}
    bars = {name: Bar(*name, **STEEL) for name in ("ac", "cd", "bd")}
    with pytest.raises(ValueError, match=r"mechanism: node '[cd]' along x, node '[cd]' along x can move"):
        Structure(unbraced, bars, {"a": "xy", "b": "xy"}, {"all": list(bars)}).assemble(["all"], n_modes=2)
    with pytest.raises(ValueError, match="mechanism"):
        structure(supports={"a": "xy"}).assemble(["tie"], n_modes=1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"parameters": ["deck"]}, "parameter 'deck': unknown group 'deck'; expected one of .'rest', 'tie'."),
        ({"parameters": {"k": ("k", "tie")}}, "parameter 'k' is the property 'k' of group 'tie'"),
        ({"parameters": ["tie", "tie"]}, "each once"),
        ({"parameters": ["tie"], "groups": {"k": ("k", "tie")}}, "damage group 'k' is the property 'k' of group 'tie'"),
        ({"parameters": ["tie"], "groups": {"mass": ("mass", "tie")}}, "group 'mass' names no stiffness term"),
        ({"parameters": ["tie"], "n_modes": 4}, "n_modes is 4, but 3 degrees of freedom"),
    ],
)
def test_assembly_names_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=message):
        structure().assemble(**({"n_modes": 1} | arguments))


def test_theta_frame_is_read_by_its_columns():
    import pandas as pd

    truss = make_truss()
    frame = pd.DataFrame([[1.0, 0.9, 1.1, 0.8]] * 2, columns=truss.parameter_names)
    np.testing.assert_array_equal(truss.frequencies(frame), truss.frequencies(frame.to_numpy()))
    np.testing.assert_array_equal(truss.frequencies(frame[frame.columns[::-1]]), truss.frequencies(frame.to_numpy()))
    with pytest.raises(ValueError, match="theta: \\['deck'\\] are unknown; expected each of the parameters"):
        truss.frequencies(frame.rename(columns={"top": "deck"}))


I2 = np.eye(2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"stiffness": {("k",): np.ones((2, 3))}}, r"stiffness term \('k',\) has shape \(2, 3\)"),
        ({"stiffness": {("k",): I2, ("h",): np.eye(3)}}, r"term \('h',\) has shape \(3, 3\); expected \(2, 2\)"),
        ({"stiffness": {("k",): np.diag([1.0, 0.0])}}, "mechanism: degree of freedom 1 can move"),
        ({"stiffness": {("k",): [[1, 1], [1, 1.0]]}}, "mechanism: degree of freedom 0, degree of freedom 1|1, degree"),
        ({"mass": np.diag([1.0, 0.0]), "n_modes": 2}, "1 of them massless, have only 1 modes"),
        ({"parameter_names": ["E"]}, r"terms name \['k'\]; expected all of the parameters \['E'\]"),
        ({"parameter_names": ["k", "E"]}, r"terms name \['k'\]; expected all of the parameters \['k', 'E'\]"),
        ({"groups": {"deck": [("E",)]}}, r"group 'deck' names the term \('E',\)"),
    ],
)
def test_affine_model_names_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=message):
        AffineModel(**({"stiffness": {("k",): I2}, "mass": I2, "n_modes": 1} | arguments))


class Shaped:
    """A model of one's own that returns frequencies of any shape."""

    parameter_names = ("E",)
    n_modes = 3

    def __init__(self, shape):
        self.shape = shape

    def frequencies(self, theta):
        return np.ones(self.shape)


@pytest.mark.parametrize("shape", [(3,), (4, 1), (1, 3), (), (1,)])
@pytest.mark.parametrize("solve", [evaluate, linearise])
def test_frequencies_of_another_shape_are_not_repeated(solve, shape):
    with pytest.raises(ValueError, match=re.escape(f"the model's frequencies have shape {shape}; expected (4, 3)")):
        solve(Shaped(shape), np.ones((4, 1)))


@pytest.mark.parametrize("vectorized", [False, True])
@pytest.mark.parametrize("shape", [(2,), (4, 1), (), (4, 3, 1)])
def test_callable_models_of_another_shape_are_refused(vectorized, shape):
    model = CallableModel(lambda theta: np.ones(shape), ["E"], 3, vectorized=vectorized)
    expected = (4, 3) if vectorized else (3,)
    with pytest.raises(ValueError, match=re.escape(f"returned shape {shape}; expected {expected}")):
        model.frequencies([[1.0], [1.1], [1.2], [1.3]])


@pytest.mark.filterwarnings("error")
def test_numpy_integers_are_integers():
    model = make_z24(np.int8(40))
    assert type(model.n_modes) is int
    assert "40 modes" in repr(model)
    assert CallableModel(np.sqrt, "k", np.uint8(1)).n_modes == 1
    drawn = sample(make_truss(np.int8(6)), 0.2, np.int8(64), n_jobs=np.int8(1), method="sobol", random_state=np.int8(0))
    expected = sample(make_truss(), 0.2, 64, method="sobol", random_state=0)
    np.testing.assert_array_equal(drawn.frequencies, expected.frequencies)
    assert len(make_truss_campaign(np.int8(2), samples_per_year=np.int16(30), samples_per_day=np.int8(1)).theta) == 60


def test_dense_and_sparse_matrices_and_plain_keys_are_one_model():
    dense = AffineModel({("k",): 2 * I2, (): I2}, I2, n_modes=2)
    sparse = AffineModel([("k", scipy.sparse.csr_array(2 * I2)), ((), scipy.sparse.coo_matrix(I2))], I2, n_modes=2)
    nested = AffineModel({"k": [[2, 0], [0, 2]], (): [[1, 0], [0, 1]]}, [[1, 0], [0, 1]], n_modes=2)
    for other in (sparse, nested):
        np.testing.assert_array_equal(dense.frequencies([[1.7]]), other.frequencies([[1.7]]))


def test_a_repeated_key_lets_groups_cut_through_a_parameter():
    first, second = np.diag([1.0, 0.0]), np.diag([0.0, 4.0])
    model = AffineModel([(("k",), first), (("k",), second)], I2, n_modes=2, groups={"left": [0], "right": [1]})
    hertz = model.damaged({"right": 0.75}).frequencies([[4.0]]) * 2 * np.pi
    np.testing.assert_allclose(hertz, [[2.0, 2.0]])


class OwnBar:
    """An element of one's own, with keys and matrices to get wrong."""

    nodes, key, matrix = ("left", "apex"), ("E", "A"), np.eye(4)

    def dofs(self, dimension):
        return [(node, direction) for node in self.nodes for direction in "xy"]

    def properties(self):
        return iter([("E", 2e11, False), ("A", 0.01, False)])

    def ends(self, coordinates):
        return coordinates

    def stiffness(self, coordinates):
        return {self.key: 1e6 * self.matrix}

    def mass(self, coordinates):
        return {("A",): np.eye(4)}


@pytest.mark.parametrize(
    ("attribute", "value", "message"),
    [
        ("key", "EA", r"stiffness of member 'own' has the key 'EA'; expected a tuple of its properties \['A', 'E'\]"),
        ("key", ("E", "Area"), r"stiffness of member 'own' has the key \('E', 'Area'\)"),
        ("matrix", np.eye(3), r"stiffness of member 'own' has shape \(3, 3\); expected \(4, 4\), a row for each"),
    ],
)
def test_matrices_of_an_element_of_ones_own_are_checked(attribute, value, message):
    def assembled(element):
        structure = Structure({"left": (0, 0), "apex": (1, 1)}, {"own": element}, {"left": "xy"}, {"all": ["own"]})
        return structure.assemble({"E": ("E", "all")}, n_modes=1)

    wrong, model = OwnBar(), assembled(OwnBar())
    np.testing.assert_allclose(model.frequencies([[4.0]]), 2 * model.frequencies([[1.0]]))
    setattr(wrong, attribute, value)
    with pytest.raises(ValueError, match=message):
        assembled(wrong)
