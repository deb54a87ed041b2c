"""Laws of models whose damage groups are divided into parts."""

import numpy as np
import pytest

from skthermo.datasets import truss_structure
from skthermo.fem import Bar, Beam, Structure

PARAMETERS = "bottom", "top", "diagonal", "vertical"
STEEL = {"E": 210e9, "A": 0.01, "density": 7850.0}


@pytest.fixture(scope="module")
def structure():
    return truss_structure()


@pytest.fixture(scope="module")
def halves(structure):
    bottom = sorted(structure.groups["bottom"], key=int)
    return {"bottom": {"west": bottom[:2], "east": bottom[2:]}}


@pytest.fixture(scope="module")
def healthy(structure):
    return structure.assemble(PARAMETERS, groups=PARAMETERS)


@pytest.fixture(scope="module")
def theta():
    return np.random.default_rng(0).uniform(0.8, 1.2, (5, 4))


VARIANTS = {
    "as assembled": lambda model, theta: model,
    "calibrated and reduced": lambda model, theta: model.rescaled(theta[0]).reduced(0.3, random_state=0),
    "damaged": lambda model, theta: model.damaged({"top": 0.3, "bottom": 0.1}),
    "with additions": lambda model, theta: model.with_added(1e5 * np.eye(model.n_dof), np.full(model.n_dof, 50.0)),
    "other modes": lambda model, theta: model.with_modes([1, 4, 2]),
    "fewer parameters": lambda model, theta: model.with_parameters(["top", "bottom"]),
}
"""What may have happened to a model since it was assembled."""


@pytest.mark.parametrize("kind", VARIANTS)
def test_parts_make_up_their_group(structure, healthy, halves, theta, kind):
    model = VARIANTS[kind](healthy, theta)
    divided = structure.divide(model, halves)
    rows = theta[:, : len(model.parameter_names)]
    assert divided.frequencies(rows) == pytest.approx(model.frequencies(rows), rel=1e-9)
    expected = model.damaged({"bottom": 0.3}).frequencies(rows)
    for both in ({"west": 0.3, "east": 0.3}, {"bottom": 0.3}):
        assert divided.damaged(both).frequencies(rows) == pytest.approx(expected, rel=2e-5)
    west = divided.with_damage_parameters(["west"]).frequencies(np.column_stack([rows, np.full(len(rows), 0.7)]))
    assert west == pytest.approx(divided.damaged({"west": 0.3}).frequencies(rows), rel=2e-5)
    assert (west > expected).any()
    assert (west < model.frequencies(rows)).any()


def test_a_part_is_what_a_group_of_its_members_is_which_remain_in_their_other_groups(structure, halves, theta):
    groups = structure.groups | {"west": halves["bottom"]["west"]}
    regrouped = Structure(structure.nodes, structure.members, structure.supports, groups)
    expected = regrouped.assemble(PARAMETERS, groups=["west"]).damaged({"west": 0.4}).frequencies(theta)
    model = structure.assemble(PARAMETERS)
    divided = structure.divide(model, halves)
    assert divided.damaged({"west": 0.4}).frequencies(theta) == pytest.approx(expected, rel=1e-9)
    expected = model.damaged({"T1": 0.3}).frequencies([np.ones(4)])
    assert divided.damaged({"T1": 0.3}).frequencies([np.ones(4)]) == pytest.approx(expected, rel=1e-9)


def test_parts_of_a_property_and_of_sparse_terms():
    nodes = {i: (float(i), 0.0, 0.0) for i in range(61)}
    section = {"E": 210e9, "G": 81e9, "density": 7850.0, "A": 0.02, "I_yy": 1e-4, "I_zz": 2e-4, "J": 1e-4}
    beams = {i: Beam(i, i + 1, **section) for i in range(60)}
    beam = Structure(nodes, beams, {0: "xyz rx", 60: "yz"}, {"beam": list(beams), "end": [58, 59]})
    model = beam.assemble({"I": ("I_yy", "beam")}, groups={"bending": ("I_yy", "beam"), "end": "end"}, n_modes=4)
    divided = beam.divide(model, {"bending": {"first": range(20)}})
    assert divided.n_dof > 200
    assert divided.frequencies([[1.1]]) == pytest.approx(model.frequencies([[1.1]]), rel=1e-8)
    softer = {i: element if i >= 20 else Beam(i, i + 1, **section | {"I_yy": 0.5e-4}) for i, element in beams.items()}
    expected = Structure(nodes, softer, beam.supports, beam.groups).assemble({"I": ("I_yy", "beam")}, n_modes=4)
    assert divided.damaged({"first": 0.5}).frequencies([[1.0]]) == pytest.approx(
        expected.frequencies([[1.0]]), rel=1e-8
    )
    assert divided.groups["end"] == model.groups["end"]


def test_errors_of_divide(structure, healthy, halves):
    west = halves["bottom"]["west"]
    for model, parts, message in (
        (structure.divide(healthy, halves), halves, "divided yet"),
        (healthy, {"bottom": {"west": west, "east": west}}, "overlap"),
        (healthy, {"top": {"west": west}}, "are not in group 'top'"),
        (healthy, {"deck": {"west": west}}, "'deck'"),
        (healthy, {"bottom": {"top": west}}, "'top'"),
    ):
        with pytest.raises(ValueError, match=message):
            structure.divide(model, parts)
    softer = structure.members | {west[0]: Bar(*structure.members[west[0]].nodes, **STEEL | {"E": 100e9})}
    other = Structure(structure.nodes, softer, structure.supports, structure.groups)
    with pytest.raises(ValueError, match="another stiffness in the model"):
        other.divide(healthy, halves)
    held = Structure(structure.nodes, structure.members, structure.supports | {"2": "x"}, structure.groups)
    with pytest.raises(ValueError, match="degrees of freedom"):
        held.divide(healthy, halves)
