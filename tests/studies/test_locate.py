"""Laws of located damage: simulations of known truth, symmetry, and which structure a model belongs to."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss_campaign, truss_structure
from skthermo.fem import Beam, ImportedStructure, Spring, Structure, add_noise
from skthermo.studies import locate_damage
from skthermo.surrogate import DataInformedFEM

pytestmark = pytest.mark.filterwarnings("ignore:.*(indistinguishable|unobservable)-groups")

N = 12  # elements of the symmetric bridge
SENSORS = [("deck", i) for i in range(1, N)]


@pytest.fixture(scope="module")
def truss():
    return truss_structure()


@pytest.fixture(scope="module")
def later():
    return make_truss_campaign(samples_per_year=120, random_state=1)


def damaged_records(truss, later, group, members, severity):
    """Frequencies of the thermo-mechanical truth with damage in some members."""
    truth = truss.divide(later.model, {group: {"damaged": members}}).damaged({"damaged": severity})
    noisy = add_noise(truth.frequencies(later.theta), 0.01, random_state=3)
    return pd.DataFrame(noisy, later.frequencies.index, later.frequencies.columns)


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("group", "members", "severity"), [("bottom", ["4", "9"], 0.3), ("diagonal", ["22"], 0.35), ("top", ["13"], 0.4)]
)
def test_damaged_members_are_found(fem, truss, later, group, members, severity):
    F = damaged_records(truss, later, group, members, severity)
    located = locate_damage(fem, truss, later.temperatures, F, random_state=0)
    table = located.table
    assert set(table.index[table["is_likely"]]) == set(located.likely_members())
    assert set(members) <= set(located.likely_members())
    assert len(located.likely_members()) <= 4
    assert table["probability"].idxmax() in members
    assert located.groups["probability"].idxmax() == group
    assert table.loc[members, "if_damaged"].to_numpy() == pytest.approx(severity, abs=0.1)
    assert f"{group} is damaged" in located.summary().splitlines()[0]
    assert located.probability_of_damage > 0.9


def test_probabilities_are_those_of_one_law(fem, truss, later):
    """A member is damaged less often than its group, and sets that hold damage more surely are larger."""
    F = damaged_records(truss, later, "bottom", ["24"], 0.3)
    located = locate_damage(fem, truss, later.temperatures, F, ["bottom", "diagonal"], random_state=0)
    table, groups = located.table, located.groups
    assert sorted(table.index) == sorted([*truss.groups["bottom"], *truss.groups["diagonal"]])
    most = table.groupby("group")["probability"].max()
    assert (most <= groups["probability"] + 1e-9).all()
    assert groups["probability"].max() <= located.probability_of_damage + 1e-9
    assert (table["severity"] <= table["if_damaged"].fillna(0) + 1e-12).all()
    sets = [set(located.likely_members(share, "bottom")) for share in (0.3, 0.6, 0.9, 0.999)]
    assert all(small <= large for small, large in pairwise(sets))
    assert sets[-1] <= truss.groups["bottom"]
    assert (located.levels["likely"] <= 10).all()


def test_a_healthy_structure_has_no_place_of_damage(fem, truss, later):
    located = locate_damage(fem, truss, later.temperatures, later.frequencies, random_state=0)
    assert located.probability_of_damage < 0.5
    assert "no place is given" in located.summary()


def test_whole_groups_remain_whole(fem, truss, later):
    F = damaged_records(truss, later, "bottom", truss.groups["bottom"], 0.15)
    located = locate_damage(fem, truss, later.temperatures, F, random_state=0)
    assert set(located.likely_members(group="bottom")) == truss.groups["bottom"]
    assert "all 5 elements alike" in located.summary()


def test_a_reduced_chain_gives_the_same(fem, reduced_fem, truss, later):
    F = damaged_records(truss, later, "diagonal", ["22"], 0.35)
    tables = [
        locate_damage(one, truss, later.temperatures, F, random_state=0).table["probability"]
        for one in (fem, reduced_fem)
    ]
    assert tables[0].to_numpy() == pytest.approx(tables[1].to_numpy(), abs=0.02)


def test_the_structure_must_be_the_models(fem, truss, later):
    T, F = later.temperatures, later.frequencies
    with pytest.raises(ValueError, match="expected the Structure"):
        locate_damage(fem, None, T, F)
    bar = truss.members["4"]
    softer = truss.members | {"4": type(bar)(*bar.nodes, **{"E": 1e11, "A": 0.01, "density": 7850.0})}
    other = Structure(truss.nodes, softer, truss.supports, truss.groups)
    with pytest.raises(ValueError, match="another stiffness in the model"):
        locate_damage(fem, other, T, F)
    located = locate_damage(fem, truss, T, F, ["bottom", "top"], random_state=0)
    with pytest.raises(ValueError, match="unknown group 'deck'"):
        located.likely_members(group="deck")
    with pytest.raises(ValueError, match="between 0 and 1"):
        located.likely_members(90)


@pytest.mark.nightly
def test_members_that_another_program_assembled_are_located_alike(fem, truss, later):
    """The truss as a structure, and as a matrix of the whole model for each member."""
    year, parameters = make_truss_campaign(random_state=0), fem.model.parameter_names
    members = {name: bar.nodes for name, bar in truss.members.items()}
    alone = Structure(truss.nodes, truss.members, truss.supports, {name: [name] for name in members})
    groups = {group: truss.groups[group] for group in parameters}
    imported = ImportedStructure(alone.assemble(list(members)), truss.nodes, members, groups)
    F = damaged_records(truss, later, "bottom", ["4", "9"], 0.3)
    located = []
    for structure in (truss, imported):
        model = structure.assemble(parameters, groups=parameters)
        chain = DataInformedFEM(model, random_state=0).fit(year.temperatures, year.frequencies)
        located.append(locate_damage(chain, structure, later.temperatures, F, random_state=0))
    ours, theirs = (one.table.sort_index() for one in located)
    pd.testing.assert_frame_equal(theirs, ours, rtol=1e-6, atol=1e-8)
    assert set(located[1].likely_members()) == {"4", "9"}
    assert located[1].summary() == located[0].summary()


# A symmetric bridge, calibrated


@pytest.fixture(scope="module")
def bridge():
    """A beam on two springs, symmetric about its middle."""
    nodes = {("deck", i): (2.0 * i, 0.0, 0.0) for i in range(N + 1)}
    section = {"E": 32e9, "G": 13e9, "density": 2500.0, "A": 0.6, "I_yy": 0.03, "I_zz": 0.2, "J": 0.05}
    members = {i: Beam(("deck", i), ("deck", i + 1), **section) for i in range(N)}
    members |= {("bearing", i): Spring(("deck", i), "z", 3e8) for i in (0, N)}
    supports = dict.fromkeys(nodes, "x y rx rz")
    groups = {"deck": range(N), "bearings": [("bearing", 0), ("bearing", N)]}
    return Structure(nodes, members, supports, groups)


@pytest.fixture(scope="module")
def records():
    random = np.random.default_rng(0)
    T = pd.DataFrame({"deck": random.normal(10, 8, 300)}, pd.date_range("2024-01-01", periods=300, freq="D"))
    return T, np.column_stack([1.05 - 0.003 * (T["deck"] - 10), np.full(len(T), 0.97)])


@pytest.fixture(scope="module")
def calibrated(bridge, records):
    """A chain whose model was calibrated after it was assembled."""
    T, theta = records
    model = bridge.assemble(["deck", "bearings"], n_modes=5)
    F = add_noise(model.frequencies(theta), 0.002, random_state=1)
    return DataInformedFEM(model.rescaled([1.05, 0.97]), random_state=0).fit(T[:200], F[:200])


@pytest.fixture(scope="module")
def of_damaged_deck(bridge, records):
    """Records and shapes with damage in the third and fourth element."""
    T, theta = records
    model = bridge.assemble(["deck", "bearings"], n_modes=5)
    damaged = bridge.divide(model, {"deck": {"x": [2, 3]}}).damaged({"x": 0.4})
    dofs = [bridge.dofs.index((node, "z")) for node in SENSORS]
    random = np.random.default_rng(5)
    shapes = [one.modes(theta[:1])[1][0][dofs] for one in (model, damaged)]
    shapes = [s + 0.01 * np.abs(s).max(axis=0) * random.normal(size=s.shape) for s in shapes]
    return T[200:], add_noise(damaged.frequencies(theta[200:]), 0.002, random_state=2), tuple(shapes), dofs


@pytest.fixture(scope="module")
def by_frequencies(calibrated, bridge, of_damaged_deck):
    T, F, _, _ = of_damaged_deck
    return locate_damage(calibrated, bridge, T, F, random_state=0)


def test_mirrored_places_are_not_distinguished_by_frequencies(by_frequencies):
    located = by_frequencies
    deck = located.table[located.table["group"] == "deck"]
    assert deck["probability"].to_numpy() == pytest.approx(deck["probability"].to_numpy()[::-1], abs=0.02)
    assert {2, 3, N - 3, N - 4} <= set(located.likely_members(0.9, "deck"))
    summary = located.summary()
    assert " or elements 9" in summary
    assert "These modes do not distinguish" in summary


def test_shapes_tell_mirrored_places_apart(calibrated, bridge, of_damaged_deck):
    T, F, shapes, dofs = of_damaged_deck
    located = locate_damage(calibrated, bridge, T, F, shapes=shapes, dofs=dofs, random_state=0)
    assert located.table.loc[[2, 3], "probability"].min() > 0.5
    likely = located.likely_members(0.9, "deck")
    assert {2, 3} <= set(likely)
    assert max(likely) < N / 2
    assert not located.alike
