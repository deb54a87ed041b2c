"""Laws of structures whose members another program has assembled: the same as if they were assembled here."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse

from skthermo.datasets import truss_structure
from skthermo.fem import AffineModel, Beam, ImportedStructure, Spring, Structure, load_affine

PARAMETERS = ["bottom", "top", "diagonal", "vertical"]
THETA = np.random.default_rng(0).uniform(0.8, 1.2, (5, 4))


@pytest.fixture(scope="module")
def own():
    return truss_structure()


def by_member(structure):
    """A model of the structure with a parameter for each member, as another program would export it."""
    each = {str(name): [name] for name in structure.members}
    return Structure(structure.nodes, structure.members, structure.supports, each).assemble(list(each))


def imported_from(structure, model):
    members = {str(name): element.nodes for name, element in structure.members.items()}
    groups = {group: [str(member) for member in inside] for group, inside in structure.groups.items()}
    return ImportedStructure(model, structure.nodes, members, groups, supports=structure.supports)


@pytest.fixture(scope="module")
def exported(own):
    return by_member(own)


@pytest.fixture(scope="module")
def imported(own, exported):
    return imported_from(own, exported)


def test_the_models_are_the_same(own, imported):
    ours, theirs = (structure.assemble(PARAMETERS) for structure in (own, imported))
    assert theirs.frequencies(THETA) == pytest.approx(ours.frequencies(THETA), rel=1e-10)
    assert theirs.groups.keys() == ours.groups.keys()
    for group in ours.groups:
        damaged = [model.damaged({group: 0.3}).frequencies(THETA) for model in (ours, theirs)]
        assert damaged[1] == pytest.approx(damaged[0], rel=1e-10)
    assert theirs.dofs == ours.dofs
    assert imported.dofs == own.dofs
    assert imported.supports == own.supports


@pytest.mark.parametrize("is_changed", [False, True])
def test_so_are_divided_ones(own, imported, is_changed):
    parts = {"bottom": {"west": ["1", "4"], "east": ["19"]}, "top": {"middle": ["13"]}}
    models = [one.assemble(PARAMETERS) for one in (own, imported)]
    if is_changed:
        models = [model.rescaled(THETA[0]).reduced(0.3, random_state=0) for model in models]
    models = [one.divide(model, parts) for one, model in zip((own, imported), models, strict=True)]
    for damage in ({"west": 0.4}, {"east": 0.2, "middle": 0.5}, {"bottom": 0.3}):
        ours, theirs = (model.damaged(damage).frequencies(THETA) for model in models)
        assert theirs == pytest.approx(ours, rel=1e-9)


def test_from_a_folder_with_a_file_for_each_member(own, exported, imported, tmp_path):
    model = exported
    mass = model.matrices(np.ones(len(model.parameter_names)))[1]
    scipy.sparse.save_npz(tmp_path / "M.npz", mass)
    for name, matrix in zip(model.parameter_names, model.stiffness_terms, strict=True):
        scipy.sparse.save_npz(tmp_path / f"{name}.npz", matrix)
    read = imported_from(own, load_affine(tmp_path))
    expected = imported.assemble(PARAMETERS).frequencies(THETA)
    assert read.assemble(PARAMETERS).frequencies(THETA) == pytest.approx(expected, rel=1e-10)


def beam_on_springs():
    """Three beams in a row on springs; the last two begin at a node of their own where the first one ends."""
    nodes = {i: (4.0 * i, 0.0, 0.0) for i in range(4)}
    section = {"E": 32e9, "G": 13e9, "density": 2500.0, "A": 0.6, "I_yy": 0.03, "I_zz": 0.2, "J": 0.05}
    members = {f"b{i}": Beam(i, i + 1, **section) for i in range(3)}
    members |= {f"s{i}": Spring(i, "z", 3e7) for i in range(4)}
    groups = {"deck": ["b0", "b1", "b2"], "bearings": [f"s{i}" for i in range(4)]}
    return Structure(nodes, members, dict.fromkeys(nodes, "x y rx rz"), groups)


def test_what_belongs_to_no_member_stays_as_it_is():
    own = beam_on_springs()
    model = by_member(own)
    members = {f"b{i}": (i, i + 1) for i in range(3)}
    imported = ImportedStructure(model, own.nodes, members, {"deck": list(members)})
    theta = THETA[:, :1]
    expected = own.assemble(["deck", "bearings"]).frequencies(np.hstack([theta, np.ones_like(theta)]))
    assert imported.assemble(["deck"]).frequencies(theta) == pytest.approx(expected, rel=1e-10)


def test_nodes_at_the_same_place_are_one():
    own = beam_on_springs()
    nodes = own.nodes | {"start of b1": (4.0, 0.0, 0.0), "ground": (0.0, 0.0, 0.0), "far": (0.0, 99.0, 0.0)}
    members = {"b0": (0, 1), "b1": ("start of b1", 2), "b2": [2, 3], "s0": (0, "ground"), "s3": 3}
    imported = ImportedStructure(by_member(own), nodes, members)
    ends = {name: member.nodes for name, member in imported.members.items()}
    assert ends == {"b0": (0, 1), "b1": (1, 2), "b2": (2, 3), "s0": (0,), "s3": (3,)}
    assert set(imported.nodes) == {0, 1, 2, 3}


def test_a_node_may_be_named_by_a_tuple():
    model = AffineModel({("a",): np.eye(2), ("b",): np.eye(2)}, np.eye(2), n_modes=1)
    nodes = {("deck", i): (float(i), 0.0) for i in range(3)}
    imported = ImportedStructure(model, nodes, {"a": ("deck", 0), "b": (("deck", 0), ("deck", 2))})
    assert [member.nodes for member in imported.members.values()] == [(("deck", 0),), (("deck", 0), ("deck", 2))]


def test_what_does_not_fit_is_named(own, exported, imported):
    model, nodes = exported, own.nodes
    first, second = list(nodes)[:2]
    product = AffineModel({("a", "b"): np.eye(2)}, np.eye(2), n_modes=1)
    for message, arguments in (
        ("'girder'", (model, nodes, {"girder": (first, second)})),
        ("'nowhere'", (model, nodes, {"1": (first, "nowhere")})),
        ("no node", (model, nodes, {"1": ()})),
        ("calibrated", (model.damaged({"1": 0.1}), nodes, {"1": (first, second)})),
        ("expected an AffineModel", (own, nodes, {"1": (first, second)})),
        ("mapping", (model, nodes, ["1"])),
        ("finite", (model, {first: (0, np.nan), second: (1, 0)}, {"1": (first, second)})),
        ("share a term", (product, nodes, {"a": first, "b": second})),
    ):
        with pytest.raises(ValueError, match=message):
            ImportedStructure(*arguments)
    with pytest.raises(ValueError, match="mass"):
        imported.assemble({"weight": ("mass", "top")})
    with pytest.raises(ValueError, match="unknown group"):
        imported.assemble(["arch"])
    with pytest.raises(ValueError, match="another stiffness"):
        imported.divide(softer(own).assemble(PARAMETERS), {"top": {"middle": ["13"]}})
    with pytest.raises(ValueError, match="not in group"):
        imported.divide(imported.assemble(PARAMETERS), {"top": {"middle": ["1"]}})


def softer(structure):
    """The same structure with another modulus."""
    members = {name: replace(bar, E=0.9 * bar.E) for name, bar in structure.members.items()}
    return Structure(structure.nodes, members, structure.supports, structure.groups)
