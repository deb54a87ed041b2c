"""Laws of the parts of locating damage: lines of members, stretches, curves, and places in words."""

import numpy as np
import pytest

from skthermo.fem import Bar, Beam, Spring, Structure
from skthermo.studies.identification._curves import Curves
from skthermo.studies.identification._locate import WHOLE, Division, lines_of
from skthermo.studies.identification._located import Places, fewest

STEEL = {"E": 210e9, "A": 0.01, "density": 7850.0}
BEAM = STEEL | {"G": 81e9, "I_yy": 1e-4, "I_zz": 1e-4, "J": 1e-4}


def girders(order):
    """Two parallel girders of six beams, with cross beams and a spring below each end, members in some order."""
    nodes = {(side, i): (2.0 * i, 5.0 * side, 0.0) for side in (0, 1) for i in range(7)}
    members = {f"girder {side} {i}": Beam((side, i), (side, i + 1), **BEAM) for side in (0, 1) for i in range(6)}
    members |= {f"cross {i}": Beam((0, i), (1, i), **BEAM) for i in range(7)}
    members |= {f"spring {side}{i}": Spring((side, i), "z", 1e8) for side in (0, 1) for i in (0, 6)}
    members = {name: members[name] for name in np.array([*members])[order]}
    groups = {what: [name for name in members if name.startswith(what)] for what in ("girder", "cross", "spring")}
    supports = {(0, 0): "xyz rx ry rz"}
    return Structure(nodes, members, supports, groups)


@pytest.mark.parametrize("seed", range(3))
def test_members_follow_each_other_whatever_their_order(seed):
    structure = girders(np.random.default_rng(seed).permutation(23))
    of_girders = lines_of(structure, structure.groups["girder"])
    assert of_girders == [[f"girder {side} {i}" for i in range(6)] for side in (0, 1)]
    assert lines_of(structure, structure.groups["cross"]) == [[f"cross {i}" for i in range(7)]]
    assert lines_of(structure, structure.groups["spring"]) == [["spring 00", "spring 10", "spring 06", "spring 16"]]


def test_a_ring_and_a_net_are_ordered_by_place():
    nodes = {"a": (0, 0), "b": (3, 0), "c": (3, 1), "d": (0, 1)}
    ring = {pair: Bar(*pair, **STEEL) for pair in ("ab", "bc", "cd", "da")}
    structure = Structure(nodes, ring | {"ac": Bar("a", "c", **STEEL)}, {"a": "xy", "b": "y"}, {"ring": list(ring)})
    assert lines_of(structure, ring) == [["da", "ab", "cd", "bc"]]


def test_an_arch_is_followed_along_its_curve():
    angles = np.linspace(np.pi, 0, 9)
    nodes = {i: (float(np.cos(a)), float(1.5 * np.sin(a))) for i, a in enumerate(angles)}
    arch = {i: Bar(i, i + 1, **STEEL) for i in np.random.default_rng(1).permutation(8).tolist()}
    supports = dict.fromkeys(nodes, "xy") | {4: "x"}
    structure = Structure(nodes, arch, supports)
    line = lines_of(structure, arch)[0]
    assert line in (list(range(8)), list(range(7, -1, -1)))


@pytest.mark.parametrize("lengths", [(1,), (7,), (16,), (40,), (5, 5), (1, 12), (3, 9, 20)])
def test_prior_probabilities_of_stretches_add_up(lengths):
    lines = [[(line, i) for i in range(length)] for line, length in enumerate(lengths)]
    division = Division.of("group", lines, 16)
    assert division.members == [member for line in lines for member in line]
    stretches = list(division.stretches())
    assert sum(prior for _, prior, _ in stretches) == pytest.approx(1.0)
    assert len({positions for positions, _, _ in stretches}) == len(stretches)
    first = stretches[0]
    assert first[0] == tuple(range(len(division.pieces)))
    assert first[1] == pytest.approx(WHOLE if len(stretches) > 1 else 1.0)
    assert all(scale >= 1 for _, _, scale in stretches)


def test_a_finer_division_shares_the_prior_of_the_coarser():
    """A stretch of coarse pieces has the prior of all finer ones that begin and end in them."""
    coarse = Division.of("group", [list(range(24))], 6)
    chosen = [False, True, False, False, True, False]
    fine = coarse.finer(chosen)
    assert len(fine.pieces) == 8
    parent = [next(k for k, piece in enumerate(coarse.pieces) if set(part) <= set(piece)) for part in fine.pieces]
    sums = {}
    for positions, prior, _ in list(fine.stretches())[1:]:
        key = parent[positions[0]], parent[positions[-1]]
        sums[key] = sums.get(key, 0.0) + prior
    ratios = {sums[positions[0], positions[-1]] / prior for positions, prior, _ in list(coarse.stretches())[1:]}
    assert max(ratios) == pytest.approx(min(ratios))


def test_curves_are_the_effects_of_single_causes():
    """Springs in a row under one mass: ln f has a closed form, with exact derivatives."""
    flexibility = np.array([0.2, 0.3, 0.5])

    def effects(severities):
        sums = (flexibility / (1 - severities)).sum(axis=-1)
        slopes = flexibility / (1 - severities) ** 2 / sums[:, np.newaxis]
        return -0.5 * np.log(sums)[:, np.newaxis], -0.5 * slopes[:, np.newaxis]

    incidence = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1], [0, 0, 1]], dtype=bool)
    curves, each = Curves.of_stretches(effects, incidence, np.array([[2.0]])), np.arange(4)[:, np.newaxis]
    for severity in (0.0, 0.05, 0.2, 0.45, 0.75, 0.9):
        exact, slopes = effects(severity * incidence)
        found, found_slopes = curves.at(each, np.full((4, 1, 1), severity))
        assert found[:, 0] / 2 == pytest.approx(exact, rel=3e-3, abs=1e-9)
        assert found_slopes[:, 0, 0, 0] / 2 == pytest.approx((slopes[:, 0] * incidence).sum(axis=1), rel=2e-2)
    change, slope = curves.at(np.array([[0, 3]]), np.array([[[0.1, 0.3]]]))
    single = [curves.at(np.array([[cause]]), np.array([[[s]]]))[0] for cause, s in ((0, 0.1), (3, 0.3))]
    assert change == pytest.approx(sum(single))
    assert slope.shape == (1, 1, 1, 2)


def test_the_fewest_members_that_hold_the_damage():
    sets = [(frozenset("abc"), 0.4), (frozenset("b"), 0.3), (frozenset("hij"), 0.2), (frozenset("abcdefghij"), 0.1)]
    small, held = fewest(sets, 0.5)
    assert set(small) == set("abc")
    assert held == pytest.approx(0.7)
    wide, held = fewest(sets, 0.9)
    assert set(wide) == set("abchij")
    assert held == pytest.approx(0.9)
    assert fewest([], 0.9) == ([], 0.0)


def test_places_in_words():
    structure = girders(np.arange(23))
    lines = lines_of(structure, structure.groups["girder"])
    both = Places(structure, lines)
    assert both.text(lines[0][1:3]) == "elements 2 to 3 of 6 of line 1 (x = 2 to 6 m)"
    assert both.text([*lines[0][:1], *lines[1][4:]], alternatives=True) == (
        "element 1 of 6 of line 1 (x = 0 to 2 m) or elements 5 to 6 of 6 of line 2 (x = 8 to 12 m)"
    )
    assert both.text(both.members).replace("\N{NO-BREAK SPACE}", " ") == "all 12 elements"
    cross = Places(structure, lines_of(structure, structure.groups["cross"]))
    assert cross.text(["cross 3"]) == "element 4 of 7 (x = 6 m)"
