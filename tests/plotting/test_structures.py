"""Structures and mode shapes: colours by value, places of nodes, supports."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from mpl_toolkits.mplot3d.proj3d import proj_transform

from skthermo.datasets import kw51_structure
from skthermo.fem import AffineModel, Bar, Beam, CallableModel, ImportedStructure, PointMass, Spring, Structure
from skthermo.plotting import StructureDisplay

STEEL = {"E": 210e9, "A": 0.01, "density": 7850.0}


def king_post():
    ends = {"tie 1": "lf", "tie 2": "fr", "rafter 1": "la", "rafter 2": "ar", "post": "fa"}
    return Structure(
        nodes={"l": (0, 0), "f": (3, 0), "r": (6, 0), "a": (3, 2)},
        members={name: Bar(*pair, **STEEL) for name, pair in ends.items()},
        supports={"l": "xy", "r": ("y",)},
        groups={"rafters": ["rafter 1", "rafter 2"], "ties": ["tie 1", "tie 2"], "post": ["post"], "all": list(ends)},
    )


def tripod():
    nodes = {"a": (0, 0, 0), "b": (4, 0, 0), "c": (2, 3, 0), "top": (2, 1, 3)}
    members = {foot: Bar(foot, "top", **STEEL) for foot in "abc"}
    return Structure(nodes, members, dict.fromkeys("abc", "xyz"), {"legs": list("abc")})


def colours(display):
    """Value of each line by its middle."""
    lines = display.members_["lines"]
    middles = [tuple(np.mean(segment, axis=0).round(6)) for segment in lines.get_segments()]
    return dict(zip(middles, np.ma.filled(lines.get_array(), np.nan).tolist(), strict=True))


def test_a_group_colours_its_members_and_a_member_its_own_line():
    structure = king_post()
    display = StructureDisplay.from_structure(structure, {"rafters": 2.0, "rafter 2": 5.0, "post": 1.0}, label="E (Pa)")
    found = colours(display)
    assert [found[1.5, 1.0], found[4.5, 1.0], found[3.0, 1.0]] == [2.0, 5.0, 1.0]
    assert np.isnan(found[1.5, 0.0])
    assert display.members_["lines"].get_clim() == (1.0, 5.0)
    assert display.colorbar_.ax.get_xlabel() == "E (Pa)"
    by_group = {"ties": 1.0, "rafters": 2.0, "post": 3.0}
    for values in (by_group, pd.Series(by_group), [1, 1, 2, 2, 3]):
        np.testing.assert_array_equal(StructureDisplay.from_structure(structure, values).values, [1, 1, 2, 2, 3])


@pytest.mark.parametrize("directions", [(1, 2), ("UX", "UY"), ()])
def test_members_from_another_program_are_drawn_as_our_own(directions):
    own = king_post()
    alone = Structure(own.nodes, own.members, own.supports, {name: [name] for name in own.members})
    model = alone.assemble(list(own.members), n_modes=2)
    terms = {(name,): K for name, K in zip(own.members, model.stiffness_terms, strict=True)}
    labels = [(node, directions["xy".index(direction)]) for node, direction in own.dofs] if directions else []
    exported = AffineModel(terms, model.matrices(np.ones(5))[1], n_modes=2, dofs=labels)
    ends = {name: bar.nodes for name, bar in own.members.items()}
    imported = ImportedStructure(exported, own.nodes, ends, own.groups, supports=own.supports)
    values = {"rafters": 2.0, "post": 1.0}
    displays = [StructureDisplay.from_structure(one, values) for one in (own, imported)]
    assert colours(displays[1]) == pytest.approx(colours(displays[0]), nan_ok=True)
    assert len(displays[1].ax_.lines) == len(displays[0].ax_.lines) == 2
    if directions:
        ours, theirs = (StructureDisplay.from_structure(one, modes=[0]).members_[0] for one in (own, imported))
        shapes = [np.array(lines.get_segments()) for lines in (ours, theirs)]
        rest = np.array([[own.nodes[node] for node in pair] for pair in ends.values()])
        sign = np.sign(np.sum((shapes[0] - rest) * (shapes[1] - rest)))
        np.testing.assert_allclose(shapes[1] - rest, sign * (shapes[0] - rest), atol=1e-9)
    else:
        with pytest.raises(ValueError, match="labels"):
            StructureDisplay.from_structure(imported, modes=[0])


def test_supports_are_drawn_where_they_are_and_filled_where_nothing_can_move():
    display = StructureDisplay.from_structure(king_post())
    assert king_post().supports == {"l": ("x", "y"), "r": ("y",)}
    pinned, roller = (line for line in display.ax_.lines if line.get_linestyle() == "None")
    assert (pinned.get_xydata().tolist(), pinned.get_markerfacecolor()) == ([[0.0, 0.0]], "#000000")
    assert (roller.get_xydata().tolist(), roller.get_markerfacecolor()) == ([[6.0, 0.0]], "white")


BEAM = STEEL | {"G": 81e9, "I_yy": 1e-4, "I_zz": 1e-4, "J": 1e-4}


def frame_in(plane, **other_supports):
    """A portal in one plane of space, all nodes held out of plane; its right foot slides."""
    out = next(axis for axis in "xyz" if axis not in plane)
    places = {"a": (0, 0), "b": (0, 3), "c": (4, 3), "d": (4, 0)}
    nodes = {name: np.insert(np.array(place, float), "xyz".index(out), 7.0) for name, place in places.items()}
    held = f"{out} r{plane[0]} r{plane[1]}"
    supports = dict.fromkeys(nodes, held) | {"a": "xyz rx ry rz", "d": f"{held} {plane[1]}"} | other_supports
    members = {pair: Beam(*pair, **BEAM, orientation=(1, 1, 1)) for pair in ("ab", "bc", "cd")}
    return Structure(nodes, members, supports, {"beams": list(members)})


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
def test_a_plane_frame_in_space_is_drawn_in_its_plane_with_its_two_supports(plane):
    display = StructureDisplay.from_structure(frame_in(plane), {"beams": 1.0})
    assert not hasattr(display.ax_, "get_zlim")
    assert colours(display) == {(0.0, 1.5): 1.0, (2.0, 3.0): 1.0, (4.0, 1.5): 1.0}
    fixed, sliding = (line for line in display.ax_.lines if line.get_linestyle() == "None")
    assert (fixed.get_xydata().tolist(), fixed.get_markerfacecolor()) == ([[0.0, 0.0]], "#000000")
    assert (sliding.get_xydata().tolist(), sliding.get_markerfacecolor()) == ([[4.0, 0.0]], "white")


@pytest.mark.parametrize("view", [None, (90, -90)])
def test_what_has_no_plane_is_drawn_as_matplotlib_sees_space(view):
    """Distances are those of an orthographic projection by mplot3d, but for one scale."""
    structure = frame_in("xz", c="rx rz")
    display = StructureDisplay.from_structure(structure, [1.0, 2.0, 3.0], **({} if view is None else {"view": view}))
    drawn = np.concatenate(display.members_["lines"].get_segments())
    space = plt.figure().add_subplot(projection="3d", proj_type="ortho", box_aspect=(1, 1, 1))
    space.set(xlim=(0, 10), ylim=(0, 10), zlim=(0, 10))
    space.view_init(*(view or (22, -60)))
    places = np.array([structure.nodes[node] for bar in structure.members.values() for node in bar.nodes])
    seen = np.column_stack(proj_transform(*places.T, space.get_proj())[:2])
    drawn, seen = drawn - drawn[0], seen - seen[0]
    np.testing.assert_allclose(drawn * np.linalg.norm(seen), seen * np.linalg.norm(drawn), atol=1e-6)
    with pytest.raises(ValueError, match="three-dimensional"):
        StructureDisplay.from_structure(structure, ax=space)


def test_a_structure_along_a_line_has_room_for_its_lines_and_points():
    nodes = {"a": (0, 0, 0), "b": (10, 0, 0)}
    beam = Structure(
        nodes, {"ab": Beam("a", "b", **BEAM, orientation=(0, 0, 1))}, {"a": "xyz rx ry rz", "b": "yz rx rz"}
    )
    display = StructureDisplay.from_structure(beam, [1.0])
    low, high = display.ax_.get_ylim()
    assert low < 0 < high
    assert high - low == pytest.approx(0.6)


def test_groups_get_a_colour_and_a_line_of_the_legend_each():
    display = StructureDisplay.from_structure(king_post(), groups=["ties", "post"], linewidth={"post": 4.0})
    assert len(display.members_["ties"].get_segments()) == 2
    assert display.members_["post"].get_linewidth() == [4.0]
    texts = [text.get_text() for text in display.figure_.legends[0].get_texts()]
    assert texts[:3] == ["other members", "ties", "post"]
    assert len({tuple(display.members_[name].get_color()[0]) for name in display.members_}) == 3


def test_springs_of_a_group_are_points_in_its_colour_and_in_the_legend():
    nodes = {"a": (0, 0, 0), "b": (1, 0, 0)}
    members = {"bar": Bar("a", "b", **STEEL), "spring": Spring("b", "x", 1e6), "mass": PointMass("b", 10.0)}
    structure = Structure(nodes, members, {"a": "xyz", "b": "y"}, {"bearing": ["spring"]})
    display = StructureDisplay.from_structure(structure, groups=["bearing"])
    assert len(display.members_["bearing"].get_offsets()) == 1
    assert "bearing" in [text.get_text() for text in display.figure_.legends[0].get_texts()]
    display = StructureDisplay.from_structure(structure, [1.0, 2.0, 3.0], limits=(0.0, 4.0))
    assert len(display.members_["lines"].get_segments()) == 1
    assert display.members_["points"].get_array().tolist() == [2.0, 3.0]
    assert display.members_["points"].get_clim() == (0.0, 4.0)


def test_surfaces_without_a_value_are_left_out():
    structure = kw51_structure()
    display = StructureDisplay.from_structure(structure, {"arch": 1.0, "plate": 2.0})
    assert set(display.members_) == {"lines", "surfaces"}
    assert len(display.members_["surfaces"].get_paths()) == len(structure.groups["plate"])


def test_a_mode_is_drawn_at_its_shape_and_the_largest_displacement_is_the_amplitude():
    structure = king_post()
    model = structure.assemble(["ties", "rafters", "post"], n_modes=3)
    display = StructureDisplay.from_structure(structure, model=model, modes=[2, 0], amplitude=0.1)
    frequencies, shapes = model.modes([[1.0, 1.0, 1.0]])
    titles = [ax.get_title() for ax in display.axes_]
    assert titles == [f"$f_{{{m + 1}}}$ = {frequencies[0, m]:.2f} Hz" for m in (2, 0)]
    extent = np.hypot(6, 2)
    for number, mode in enumerate((2, 0)):
        segments = np.array(display.members_[number].get_segments())
        places = dict(zip([tuple(m.nodes) for m in structure.members.values()], segments, strict=True))
        moves = {
            "f": places["l", "f"][1] - [3, 0],
            "a": places["l", "a"][1] - [3, 2],
            "r": places["f", "r"][1] - [6, 0],
        }
        drawn = np.array([moves[node]["xy".index(direction)] for node, direction in structure.dofs])
        cosine = drawn @ shapes[0, :, mode] / np.linalg.norm(drawn) / np.linalg.norm(shapes[0, :, mode])
        assert cosine == pytest.approx(1)
        assert max(np.linalg.norm(move) for move in moves.values()) == pytest.approx(0.1 * extent)
        np.testing.assert_allclose(places["l", "f"][0], [0, 0], atol=1e-12)


def test_modes_in_space_by_groups():
    structure = tripod()
    model = structure.assemble(["legs"], n_modes=2)
    display = StructureDisplay.from_structure(structure, model=model, modes=[0, 1], groups=["legs"])
    display.figure_.canvas.draw()  # which projects the lines
    assert [len(display.members_[number].get_segments()) for number in (0, 1)] == [3, 3]
    assert display.axes_[0].get_title() == f"$f_{{1}}$ = {model.frequencies([[1.0]])[0, 0]:.2f} Hz"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"values": {"roof": 1.0}}, r"values names 'roof'; expected members, or groups among \['all'"),
        ({"values": [1.0, 2.0]}, r"values has shape \(2,\); expected \(5,\)"),
        ({"values": ["a"] * 5}, "values is .*expected numbers"),
        ({"values": {"all": 1.0, "post": 2.0}}, "several groups with different values"),
        ({"modes": [7]}, "modes is .7.; expected numbers from 0 to 1"),
        ({"modes": [0], "groups": ["roof"]}, "unknown group 'roof'"),
        ({"modes": [0], "model": CallableModel(lambda theta: theta, ["E"], 1)}, "has no method 'modes'"),
        (
            {"modes": [0], "model": tripod().assemble(["legs"], n_modes=1)},
            "3 degrees of freedom; expected",
        ),
    ],
)
def test_what_does_not_fit_is_named(options, message):
    structure = king_post()
    given = {"model": structure.assemble(["ties"], n_modes=2)} if "modes" in options else {}
    with pytest.raises(ValueError, match=message):
        StructureDisplay.from_structure(structure, **given | options)
