"""The KW51 bridge against the model of the paper and laws of its own; its updated model is an optimum."""

import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.stats import spearmanr

from skthermo.datasets import kw51_sensors, kw51_structure, make_kw51
from skthermo.fem import Membrane
from skthermo.updating import sensitivity

PATH = Path(__file__).parents[2] / "examples" / "kw51_appendix_recipes.py"
SPEC = importlib.util.spec_from_file_location(PATH.stem, PATH)
PAPER = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(PAPER)
SENSITIVITIES = pd.DataFrame(PAPER.PAPER_A3, index=PAPER.MODES).T
THERMAL = ["E_bot", "E_arc", "E_br", "E_con", "E_pip"]

NOMINAL = np.ones((1, 5))


@pytest.fixture(scope="module")
def structure():
    return kw51_structure()


@pytest.fixture(scope="module")
def model():
    return make_kw51()


@pytest.fixture(scope="module")
def full_model():
    return make_kw51("all")


@pytest.fixture(scope="module")
def sensitivities(full_model):
    return sensitivity(full_model).T


def test_unupdated_frequencies_are_the_papers(model):
    assert model.track
    assert_allclose(model.frequencies(NOMINAL)[0], PAPER.PAPER_A5["before"], rtol=0.03)


def test_sensitivities_rank_as_the_papers(full_model, sensitivities):
    found = sensitivities
    assert tuple(found.index) == tuple(SENSITIVITIES.index) == full_model.parameter_names
    for names, least in ((THERMAL, 0.9), (list(found.index), 0.85)):
        pairs = (np.abs(table.loc[names]).to_numpy().ravel() for table in (found, SENSITIVITIES))
        assert spearmanr(*pairs).statistic > least
    large = SENSITIVITIES.abs() > 0.1
    assert (np.sign(found)[large] == np.sign(SENSITIVITIES)[large])[large].all(axis=None)


def test_six_moduli_are_the_whole_stiffness(sensitivities):
    found = sensitivities
    assert_allclose(found.loc[[*THERMAL, "E_b"]].sum(), 0.5, rtol=1e-6)
    assert (found.loc[["M_a", "M_g"]] <= 1e-9).all(axis=None)
    assert (found.drop(["M_a", "M_g"]) >= -1e-9).all(axis=None)
    for whole, parts in {
        "E_con": ["A_c"],
        "E_br": ["A_d"],
        "E_pip": ["A_p", "I_33p", "I_22p"],
        "E_arc": ["I_33a", "I_22a", "A_a", "J_a"],
        "E_bot": ["I_33g", "I_22g", "A_tb", "I_22s"],
    }.items():
        assert (found.loc[parts].sum() <= found.loc[whole] + 1e-9).all()


def motion(structure, shape, part, direction):
    """Where the part's nodes are along the bridge, and how much they move."""
    x = [
        (structure.nodes[node][0], u)
        for (node, d), u in zip(structure.dofs, shape, strict=True)
        if node[0] == part and d == direction
    ]
    return np.array(x).T


def test_modes_are_of_the_right_kind(structure, model):
    """1, 2, 4: arches sideways; 3: deck sideways; 5, 6: vertical bending; half-waves along the bridge."""
    shapes = model.modes(NOMINAL)[1][0]
    kinds = [("arch", "y", 1), ("arch", "y", 2), ("deck", "y", 1), ("arch", "y", 3), ("deck", "z", 1), ("deck", "z", 2)]
    for shape, (part, direction, half_waves) in zip(shapes.T, kinds, strict=True):
        energy = {
            (p, d): (motion(structure, shape, p, d)[1] ** 2).sum() for p in ("arch", "deck") for d in ("x", "y", "z")
        }
        assert max(energy, key=energy.get) == (part, direction)
        x, moved = motion(structure, shape, part, direction)
        waves = [abs(np.sin(n * np.pi * x / 115) @ moved) for n in (1, 2, 3, 4)]
        assert np.argmax(waves) == half_waves - 1


@pytest.mark.nightly
def test_a_subset_of_parameters_is_the_same_bridge(model, full_model):
    chosen = make_kw51(["M_g", "E_br"])
    assert chosen.parameter_names == ("M_g", "E_br")
    assert make_kw51("A_c", n_modes=2).parameter_names == ("A_c",)
    assert_allclose(chosen.frequencies([[1.0, 1.0]]), model.frequencies(NOMINAL), rtol=1e-9)
    assert_allclose(full_model.frequencies(np.ones((1, 21))), model.frequencies(NOMINAL), rtol=1e-9)
    theta = np.ones((1, 21))
    theta[0, [full_model.parameter_names.index(name) for name in chosen.parameter_names]] = 1.3, 0.8
    assert_allclose(full_model.frequencies(theta), chosen.frequencies([[1.3, 0.8]]), rtol=1e-7)


def test_damage_groups(model):
    """A damaged group is a weaker modulus; parts add up to their whole."""
    groups = {"E_bot": "bottom", "E_arc": "arch", "E_br": "braces", "E_con": "connections", "E_pip": "pipes"}
    assert model.parameter_names == tuple(groups)
    severities = np.linspace(0.1, 0.3, 5)
    damaged = model.damaged(dict(zip(groups.values(), severities, strict=True)))
    assert_allclose(damaged.frequencies(NOMINAL), model.frequencies(NOMINAL - severities), rtol=1e-6)
    for whole, parts in {
        "connections": ("arch_connections", "deck_connections"),
        "bottom": ("girders", "transverse_beams", "stiffeners", "plate"),
    }.items():
        weaker = model.damaged(dict.fromkeys(parts, 0.2)), model.damaged({whole: 0.2})
        assert_allclose(weaker[0].frequencies(NOMINAL), weaker[1].frequencies(NOMINAL), rtol=1e-6)


def test_the_retrofit_lifts_the_braces_mode(model):
    change = model.damaged({"connections": -0.15}).frequencies(NOMINAL) / model.frequencies(NOMINAL) - 1
    assert (change > 0).all()
    assert change[0].argmax() == 5


def member_masses(structure):
    masses = {}
    for name, element in structure.members.items():
        corners = np.array([structure.nodes[node] for node in element.nodes])
        along = [direction == "x" for _, direction in element.dofs(3)]
        masses[name] = sum(m[np.ix_(along, along)].sum() for m in element.mass(corners).values())
    return masses


def test_mass_is_that_of_the_drawings(structure):
    masses = member_masses(structure)
    total = {group: sum(masses[name] for name in members) for group, members in structure.groups.items()}
    assert_allclose(total["plate"], 7850 * 0.015 * 115 * 12.4, rtol=1e-9)
    assert_allclose(total["ballast"], 1500 * 0.6 * 115 * 12.4, rtol=1e-9)
    tee = 1.235 * 0.08 + (0.6 - 0.08) * 0.08
    assert_allclose(total["girders"], 7850 * tee * 2 * 115, rtol=1e-9)
    assert_allclose(total["transverse_beams"], 7850 * tee * 33 * 12.4, rtol=1e-9)
    arc, _ = quad(lambda x: np.hypot(1, 4 * 18 / 115 * (1 - 2 * x / 115)), 0, 115)
    assert_allclose(total["arch"], 7850 * (1.3 * 0.86 - 1.2 * 0.76) * 2 * arc, rtol=1e-3)
    assert 20e3 < sum(masses.values()) / 115 < 30e3  # kg/m of two tracks in ballast


def test_structure_is_symmetric_but_for_its_supports(structure):
    def data_sheets(mirror):
        return sorted(
            (
                *sorted(tuple((structure.nodes[node] * mirror[0] + mirror[1]).round(6) + 0.0) for node in member.nodes),
                tuple(value for _, value, _ in member.properties()),
            )
            for member in structure.members.values()
        )

    as_it_is = data_sheets(([1, 1, 1], [0, 0, 0]))
    assert data_sheets(([1, -1, 1], [0, 0, 0])) == as_it_is
    assert data_sheets(([-1, 1, 1], [115, 0, 0])) == as_it_is
    held = {node for node in structure.nodes if (node, "z") not in structure.dofs}
    fixed = {node for node in structure.nodes if (node, "x") not in structure.dofs}
    assert held == {("deck", s, line) for s in (0, 32) for line in (0, 4)}
    assert fixed == {("deck", 0, 0), ("deck", 32, 0)}


def test_parts_are_where_the_appendix_puts_them(structure):
    places = np.array(list(structure.nodes.values()))
    assert_allclose(np.ptp(places, axis=0)[:2], [115, 12.4])
    assert len(structure.groups["pipes"]) == 4
    assert len(structure.groups["connections"]) == 2 * len(structure.groups["braces"])
    shells = {name for name, member in structure.members.items() if isinstance(member, Membrane)}
    assert shells == structure.groups["plate"] | structure.groups["ballast"]


def test_sensors_are_where_their_labels_say(structure):
    sensors = kw51_sensors()
    assert len(sensors) == len(set(sensors.values())) == 12
    for label, dof in sensors.items():
        node, direction = structure.dofs[dof]
        x, y, z = structure.nodes[node]
        side, axis = label[-2:]
        assert (direction, y) == (axis, -6.2 if side == "A" else 6.2)
        assert (z > 5) == label.startswith("aAR")
        if z == 0:
            assert x == pytest.approx(115 / 32 * (int(label[3:5]) - 1))
    above = {label[3:5]: structure.nodes[structure.dofs[dof][0]][0] for label, dof in sensors.items()}
    assert (above["09"], above["15"], above["21"]) == (above["11"], above["17"], above["23"])


def integrated(width, depth, steel):
    """Area and second moments of the steel inside a rectangle of cells, whose edges are those of the steel."""
    sides = np.array([width, depth])
    numbers = np.rint(sides / np.where(sides > 0.8, 1e-3, np.where(sides > 0.2, 5e-4, 5e-5))).astype(int)
    places = [(np.arange(n) + 0.5) * side / n for side, n in zip(sides, numbers, strict=True)]
    y, z = np.meshgrid(*places)
    cells = steel(y, z)
    cell = width * depth / y.size
    y, z = y[cells] - y[cells].mean(), z[cells] - z[cells].mean()
    return {"A": cells.sum() * cell, "I_yy": (z**2).sum() * cell, "I_zz": (y**2).sum() * cell}


def section_of(structure, group):
    """Properties of a member of a group."""
    member = structure.members[min(structure.groups[group], key=str)]
    return {name: value for name, value, _ in member.properties()}


CASES = {
    "arch": (0.86, 1.3, lambda y, z: (abs(y - 0.43) > 0.38) | (abs(z - 0.65) > 0.6)),
    "girders": (0.6, 1.235, lambda y, z: (z > 1.155) | (abs(y - 0.3) < 0.04)),
    "transverse_beams": (0.6, 1.235, lambda y, z: (z > 1.155) | (abs(y - 0.3) < 0.04)),
    "braces": (0.35, 0.35, lambda y, z: (abs(y - 0.175) > 0.159) | (abs(z - 0.175) > 0.159)),
    "deck_connections": (0.045, 0.31, lambda y, z: y > 0),
    "pipes": (0.75, 0.75, lambda y, z: abs(np.hypot(y - 0.375, z - 0.375) - 0.355) < 0.02),
}
"""Width, depth and steel of sections, by the group of their members."""


@pytest.mark.parametrize("group", CASES)
def test_area_and_second_moments(structure, group):
    found = integrated(*CASES[group])
    section = section_of(structure, group)
    assert_allclose([section[name] for name in found], list(found.values()), rtol=1e-4)


def test_stiffeners_are_channels_side_by_side(structure):
    channel = integrated(0.25, 0.25, lambda y, z: (y < 0.008) | (abs(z - 0.125) > 0.117))
    section = section_of(structure, "stiffeners")
    number = section["A"] / channel["A"]
    assert_allclose([section[name] / number for name in channel], list(channel.values()), rtol=1e-4)
    assert_allclose(section["J"], number * (0.25 + 2 * 0.242) * 0.008**3 / 3, rtol=1e-4)


def test_torsion_constants(structure):
    J = {group: section_of(structure, group)["J"] for group in CASES}
    assert_allclose(J["arch"], 2 * (1.25 * 0.81) ** 2 * 0.05 / (1.25 + 0.81))  # Bredt, 4 A^2 t / perimeter
    assert_allclose(J["braces"], 0.334**3 * 0.016)
    assert_allclose(J["girders"], (0.6 + 1.155) * 0.08**3 / 3)
    assert_allclose(J["deck_connections"], 0.31 * 0.045**3 * (1 - 0.63 * 0.045 / 0.31) / 3, rtol=1e-3)  # Timoshenko
    pipe = section_of(structure, "pipes")
    assert_allclose(J["pipes"], pipe["I_yy"] + pipe["I_zz"])


UPDATED = {  # multipliers that the third fit of examples/plot_kw51_updating.py ends at
    "E_bot": 1.3,
    "E_arc": 0.9,
    "E_br": 0.9,
    "E_con": 0.9,
    "E_pip": 0.942523,
    "A_c": 1.5,
    "I_22p": 0.5,
    "A_d": 1.031471,
    "I_22a": 1.128122,
    "A_a": 1.016123,
    "M_a": 0.711763,
}
MEASURED = np.array([0.51, 1.24, 1.89, 2.45, 2.58, 2.92])
AT_LOWER, AT_UPPER = ["E_arc", "E_br", "E_con", "I_22p"], ["E_bot", "A_c"]


@pytest.fixture(scope="module")
def updated():
    return make_kw51(list(UPDATED), updated=True)


def test_updated_nominal_state_is_the_documented_theta(updated, full_model):
    frequencies = updated.frequencies(np.ones((1, 11)))
    theta = [UPDATED.get(name, 1.0) for name in full_model.parameter_names]
    assert_allclose(full_model.frequencies([theta]), frequencies, rtol=1e-9)
    assert_allclose(frequencies[0], [0.507, 1.211, 1.888, 2.515, 2.581, 2.920], atol=5e-4)
    assert 0.008 < np.abs(frequencies[0] / MEASURED - 1).mean() < 0.01


def test_updated_gradient_vanishes_or_points_out_of_the_bounds(updated):
    frequencies, jacobian = (part[0] for part in updated.linearised(np.ones((1, 11))))
    residuals = frequencies / MEASURED - 1
    gradient = dict(zip(UPDATED, (jacobian / MEASURED[:, np.newaxis]).T @ residuals, strict=True))
    largest = max(map(abs, gradient.values()))
    assert all(gradient[name] > 0 for name in AT_LOWER)
    assert all(gradient[name] < 0 for name in AT_UPPER)
    assert all(abs(gradient[name]) < 1e-3 * largest for name in set(UPDATED) - {*AT_LOWER, *AT_UPPER})


@pytest.mark.nightly
def test_other_updated_parameters_are_of_the_same_bridge(updated):
    expected = updated.frequencies(np.ones((1, 11)))
    drawn, thermal, everything = make_kw51(), make_kw51(updated=True), make_kw51("all", updated=True)
    assert thermal.parameter_names == drawn.parameter_names
    assert thermal.groups.keys() == drawn.groups.keys()
    assert_allclose(thermal.frequencies(np.ones((1, 5))), expected, rtol=1e-9)
    assert_allclose(everything.frequencies(np.ones((1, 21))), expected, rtol=1e-9)
