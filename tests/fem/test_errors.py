"""Bad structures, models and parameters are refused by name."""

import re

import numpy as np
import pytest
import scipy.sparse

from skthermo.datasets import make_truss, make_truss_campaign, make_z24
from skthermo.fem import (
    AffineModel,
    Bar,
    CallableModel,
    PointMass,
    Spring,
    Structure,
    evaluate,
    linearise,
    sample,
)

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
        ({"nodes": NODES | {"d": (9, 9)}}, "node 'd' is disconnected"),
        ({"nodes": NODES | {"d": (3, 2)}}, "nodes 'c' and 'd' are duplicates"),
        ({"nodes": NODES | {"d": (3, 2, 1)}}, "node 'd' has the coordinates"),
        ({"nodes": NODES | {"c": (3, np.nan)}}, "node 'c' has the coordinates"),
        ({"nodes": {}}, "nodes is empty"),
        ({"members": MEMBERS | {"aa": Bar("a", "a", **STEEL)}}, "member 'aa' .* has zero length"),
        ({"members": MEMBERS | {"ax": Bar("a", "x", **STEEL)}}, "member 'ax' ends at node 'x'"),
        ({"members": MEMBERS | {"ab": Bar("a", "b", **STEEL | {"E": -1.0})}}, "member 'ab' has E = -1.0"),
        ({"members": MEMBERS | {"ab": Bar("a", "b", **STEEL | {"A": 0.0})}}, "member 'ab' has A = 0.0"),
        ({"members": MEMBERS | {"ab": Bar("a", "b", **STEEL | {"density": -1.0})}}, "density = -1.0; expected zero or"),
        ({"members": MEMBERS | {"s": Spring("c", "x", float("nan"))}}, "member 's' has k = nan"),
        ({"members": MEMBERS | {"s": Spring("c", "z", 1.0)}}, "member 's' acts along 'z' of node 'c'"),
        ({"members": MEMBERS | {"m": PointMass("c", -2.0)}}, "member 'm' has m = -2.0"),
        ({"members": MEMBERS | {"ab": ("a", "b")}}, "member 'ab' is .* expected an element such as Bar"),
        ({"nodes": NODES | {"c": "xy"}}, "node 'c' has the coordinates 'xy'"),
        (
            {"nodes": NODES | {"d": (3, 2 + 1e-9)}, "members": MEMBERS | {"cd": Bar("c", "d", **STEEL)}},
            "member 'cd' has a length of 1e-09 m; expected at least 3.61e-06 m, a millionth of the structure's extent",
        ),
        ({"supports": None}, "supports is None; expected a mapping of node to directions, such as"),
        ({"members": list(MEMBERS.values())}, "members is .*; expected a mapping of member to element"),
        ({"nodes": [(0, 0), (3, 0)]}, "nodes is .*; expected a mapping of node to coordinates"),
        ({"groups": ["tie"]}, "groups is .*; expected a mapping of group to members"),
        ({"supports": {"q": "x"}}, "supports name node 'q'"),
        ({"supports": {"a": "xz"}}, "support of node 'a' along 'z'; expected some of"),
        ({"groups": {"tie": ["xy"]}}, "group 'tie' holds"),
        ({"groups": {"tie": []}}, "group 'tie' holds no member"),
        ({"groups": {"tie": "ax"}}, "group 'tie' holds .'ax'."),
        ({"supports": dict.fromkeys(NODES, "xy")}, "the supports fix every node in every direction"),
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
        ({"parameters": {"A": ("A",)}}, r"parameter 'A' is \('A',\); expected a group, \(property, group\)"),
        ({"parameters": {"k": ("k", "tie")}}, "parameter 'k' is the property 'k' of group 'tie'"),
        ({"parameters": ["tie", "tie"]}, "each once"),
        ({"parameters": ["tie"], "groups": ["deck"]}, "damage group 'deck': unknown group 'deck'"),
        ({"parameters": ["tie"], "groups": {"k": ("k", "tie")}}, "damage group 'k' is the property 'k' of group 'tie'"),
        ({"parameters": ["tie"], "groups": {"mass": ("mass", "tie")}}, "group 'mass' names no stiffness term"),
        ({"parameters": ["tie"], "n_modes": 4}, "n_modes is 4, but 3 degrees of freedom"),
        ({"parameters": ["tie"], "n_modes": 0}, "n_modes is 0; expected a positive integer"),
    ],
)
def test_assembly_names_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=message):
        structure().assemble(**({"n_modes": 1} | arguments))


@pytest.mark.parametrize(
    ("theta", "message"),
    [
        (np.ones((2, 3)), r"theta has shape \(2, 3\); expected \(n_samples, 4\)"),
        (np.ones(3), r"theta has shape \(3,\)"),
        ([[1, 1, np.nan, 1]], "row 0, parameter 'diagonal' is nan"),
        ([[1, 1, 1, 1], [1, -1, 1, 1]], "row 1, parameter 'top' is -1"),
        ([[1, 1, 0, 1]], "row 0, parameter 'diagonal' is 0"),
    ],
)
def test_theta_is_checked(theta, message):
    with pytest.raises(ValueError, match=message):
        make_truss().frequencies(theta)


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
        ({"stiffness": {}}, "stiffness has no terms"),
        ({"stiffness": {("k",): np.ones((2, 3))}}, r"stiffness term \('k',\) has shape \(2, 3\)"),
        ({"stiffness": {("k",): I2, ("h",): np.eye(3)}}, r"term \('h',\) has shape \(3, 3\); expected \(2, 2\)"),
        ({"stiffness": {("k",): [[1, 0.5], [0, 1]]}}, r"is not symmetric: entries \(0, 1\)"),
        ({"stiffness": {("k",): [[1, np.inf], [np.inf, 1]]}}, "not finite"),
        ({"stiffness": {("k",): I2 * 1j}}, r"stiffness term \('k',\) is complex"),
        ({"stiffness": {3: I2}}, "stiffness has the key 3"),
        ({"stiffness": {(): I2}}, "no term names a parameter"),
        ({"stiffness": {("k",): np.diag([1.0, 0.0])}}, "mechanism: degree of freedom 1 can move"),
        ({"stiffness": {("k",): [[1, 1], [1, 1.0]]}}, "mechanism: degree of freedom 0, degree of freedom 1|1, degree"),
        ({"mass": np.eye(3)}, r"mass term \(\) has shape \(3, 3\); expected \(2, 2\)"),
        ({"mass": np.diag([1.0, -1.0])}, "negative eigenvalue"),
        ({"mass": np.diag([1.0, 0.0]), "n_modes": 2}, "1 of them massless, have only 1 modes"),
        ({"parameter_names": ["E"]}, r"terms name \['k'\]; expected only the parameters \['E'\]"),
        ({"parameter_names": ["k", "E"]}, r"no term names the parameters \['E'\]"),
        ({"parameter_names": ["k", "k"]}, "expected one or more different names"),
        ({"groups": {"deck": [("E",)]}}, r"group 'deck' names the term \('E',\)"),
        ({"groups": {"deck": []}}, "group 'deck' names no stiffness term"),
    ],
)
def test_affine_model_names_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=message):
        AffineModel(**({"stiffness": {("k",): I2}, "mass": I2, "n_modes": 1} | arguments))


def test_too_few_names_of_degrees_of_freedom_are_counted():
    with pytest.raises(ValueError, match="dof_names holds 1 names; expected 2, one for each row"):
        AffineModel({("k",): np.eye(2)}, np.eye(2), n_modes=1, dof_names=["a"])
    with pytest.raises(ValueError, match="mechanism: b can move"):
        AffineModel({("k",): np.diag([1.0, 0.0])}, np.eye(2), n_modes=1, dof_names=np.array(["a", "b"]))


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
@pytest.mark.parametrize("shape", [(2,), (4, 1), (3, 1), (), (1,), (4, 3, 1)])
def test_callable_models_of_another_shape_are_refused(vectorized, shape):
    model = CallableModel(lambda theta: np.ones(shape), ["E"], 3, vectorized=vectorized)
    expected = (4, 3) if vectorized else (3,)
    with pytest.raises(ValueError, match=re.escape(f"returned shape {shape}; expected {expected}")):
        model.frequencies([[1.0], [1.1], [1.2], [1.3]])


def test_callable_models_of_complex_numbers_are_refused():
    with pytest.raises(ValueError, match=r"what the model's function returned at theta = {'E': 1.0} is complex"):
        CallableModel(lambda row: np.array([1 + 1j]), ["E"], 1).frequencies([[1.0]])


@pytest.mark.filterwarnings("error")
def test_numpy_integers_are_integers():
    model = make_z24(np.int8(40))
    assert type(model.n_modes) is int
    assert model.n_modes == 40
    assert "40 modes" in repr(make_z24(np.int64(40)))
    assert CallableModel(np.sqrt, "k", np.uint8(1)).n_modes == 1
    drawn = sample(make_truss(np.int8(6)), 0.2, np.int8(64), n_jobs=np.int8(1), method="sobol", random_state=np.int8(0))
    expected = sample(make_truss(), 0.2, 64, method="sobol", random_state=0)
    np.testing.assert_array_equal(drawn.frequencies, expected.frequencies)
    campaign = make_truss_campaign(np.int8(2), samples_per_year=np.int16(365), samples_per_day=np.int8(1))
    assert len(campaign.temperatures) == 730


@pytest.mark.parametrize(
    ("names", "n_modes", "message"),
    [
        (["a", "a"], 1, "expected one or more different names"),
        ([], 1, "different names"),
        (["a"], 1.5, "n_modes is 1.5"),
    ],
)
def test_callable_model_checks_what_it_is_made_of(names, n_modes, message):
    with pytest.raises(ValueError, match=message):
        CallableModel(np.sqrt, names, n_modes)
    assert CallableModel(np.sqrt, "stiffness", 1).parameter_names == ("stiffness",)


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
    def structure():
        return Structure({"left": (0, 0), "apex": (1, 1)}, {"own": OwnBar()}, {"left": "xy"}, {"all": ["own"]})

    model = structure().assemble({"E": ("E", "all")}, n_modes=1)
    np.testing.assert_allclose(model.frequencies([[4.0]]), 2 * model.frequencies([[1.0]]))
    wrong = OwnBar()
    setattr(wrong, attribute, value)
    with pytest.raises(ValueError, match=message):
        Structure({"left": (0, 0), "apex": (1, 1)}, {"own": wrong}, {"left": "xy"}, {"all": ["own"]}).assemble(["all"])
