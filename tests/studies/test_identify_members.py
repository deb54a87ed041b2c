"""Members that are damaged: simulations of known truth, symmetry, and which structure a model belongs to."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss_campaign, truss_structure
from skthermo.fem import Beam, ImportedStructure, Spring, Structure, add_noise
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM

pytestmark = pytest.mark.filterwarnings("ignore:.*undetermined")

N = 12  # elements of the symmetric bridge
SENSORS = [("deck", i) for i in range(1, N)]
TRUSS = truss_structure()
LATER = make_truss_campaign(samples_per_year=120, random_state=1)


def damaged_records(group, members, severity):
    """Frequencies of the thermo-mechanical truth with damage in some members."""
    truth = TRUSS.divide(LATER.model, {group: {"damaged": members}}).damaged({"damaged": severity})
    noisy = add_noise(truth.frequencies(LATER.theta), 0.01, random_state=3)
    return pd.DataFrame(noisy, LATER.frequencies.index, LATER.frequencies.columns)


def located(fem, F, groups=None, structure=TRUSS, T=LATER.temperatures, **options):
    return identify_damage(fem, T, F, groups, structure=structure, random_state=0, **options)


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("group", "members", "severity"), [("bottom", ["4", "9"], 0.3), ("diagonal", ["22"], 0.35), ("top", ["13"], 0.4)]
)
def test_damaged_members_are_found(fem, group, members, severity):
    found = located(fem, damaged_records(group, members, severity))
    table = found.table
    assert set(table.index[table["is_likely"]]) == set(found.likely_members())
    assert set(members) <= set(found.likely_members())
    assert len(found.likely_members()) <= 4
    assert table["probability"].idxmax() in members
    assert found.groups["probability"].idxmax() == group
    assert table.loc[members, "if_damaged"].to_numpy() == pytest.approx(severity, abs=0.1)
    assert found.probability_of_damage > 0.9


def test_probabilities_are_those_of_one_law(fem):
    """A member is damaged less often than its group, and sets that hold damage more surely are larger."""
    found = located(fem, damaged_records("bottom", ["24"], 0.3), ["bottom", "diagonal"])
    assert sorted(found.table.index) == sorted([*TRUSS.groups["bottom"], *TRUSS.groups["diagonal"]])
    most = found.table.groupby("group")["probability"].max()
    assert (most <= found.groups["probability"] + 1e-9).all()
    assert found.groups["probability"].max() <= found.probability_of_damage + 1e-9
    assert (found.table["severity"] <= found.table["if_damaged"].fillna(0) + 1e-12).all()
    sets = [set(found.likely_members(share, "bottom")) for share in (0.3, 0.6, 0.9, 0.999)]
    assert all(small <= large for small, large in pairwise(sets))
    assert sets[-1] <= TRUSS.groups["bottom"]
    with pytest.raises(ValueError, match="unknown group 'deck'"):
        found.likely_members(group="deck")
    with pytest.raises(ValueError, match="between 0 and 1"):
        found.likely_members(90)


@pytest.mark.nightly
def test_whole_groups_remain_whole_and_reduced_chains_give_the_same(fem, reduced_fem):
    F = damaged_records("bottom", TRUSS.groups["bottom"], 0.15)
    found, reduced = (located(one, F) for one in (fem, reduced_fem))
    assert found.most_probable == ("bottom",)
    assert set(found.likely_members(group="bottom")) == TRUSS.groups["bottom"]
    assert found.table["probability"].to_numpy() == pytest.approx(reduced.table["probability"].to_numpy(), abs=0.03)


def test_the_structure_must_be_the_models(fem):
    bar = TRUSS.members["4"]
    softer = TRUSS.members | {"4": type(bar)(*bar.nodes, **{"E": 1e11, "A": 0.01, "density": 7850.0})}
    other = Structure(TRUSS.nodes, softer, TRUSS.supports, TRUSS.groups)
    with pytest.raises(ValueError, match="another stiffness in the model"):
        located(fem, LATER.frequencies, structure=other)


@pytest.mark.nightly
def test_members_that_another_program_assembled_are_located_alike(fem):
    """The truss as a structure, and as a matrix of the whole model for each member."""
    year, parameters = make_truss_campaign(random_state=0), fem.model.parameter_names
    members = {name: bar.nodes for name, bar in TRUSS.members.items()}
    alone = Structure(TRUSS.nodes, TRUSS.members, TRUSS.supports, {name: [name] for name in members})
    groups = {group: TRUSS.groups[group] for group in parameters}
    imported = ImportedStructure(alone.assemble(list(members)), TRUSS.nodes, members, groups)
    tables = []
    for structure in (TRUSS, imported):
        model = structure.assemble(parameters, groups=parameters)
        chain = DataInformedFEM(model, random_state=0).fit(year.temperatures, year.frequencies)
        found = located(chain, damaged_records("bottom", ["4", "9"], 0.3), structure=structure)
        assert set(found.likely_members()) == {"4", "9"}
        tables.append(found.table.sort_index()[["probability", "severity"]])
    pd.testing.assert_frame_equal(*tables, rtol=1e-5, atol=1e-6)


@pytest.fixture(scope="module")
def symmetric():
    """A beam on two springs, symmetric about its middle, and a chain calibrated after it was assembled."""
    nodes = {("deck", i): (2.0 * i, 0.0, 0.0) for i in range(N + 1)}
    section = {"E": 32e9, "G": 13e9, "density": 2500.0, "A": 0.6, "I_yy": 0.03, "I_zz": 0.2, "J": 0.05}
    members = {i: Beam(("deck", i), ("deck", i + 1), **section) for i in range(N)}
    members |= {("bearing", i): Spring(("deck", i), "z", 3e8) for i in (0, N)}
    groups = {"deck": range(N), "bearings": [("bearing", 0), ("bearing", N)]}
    bridge = Structure(nodes, members, dict.fromkeys(nodes, "x y rx rz"), groups)
    model, random = bridge.assemble(["deck", "bearings"], n_modes=5), np.random.default_rng(0)
    T = pd.DataFrame({"deck": random.normal(10, 8, 300)}, pd.date_range("2024-01-01", periods=300, freq="D"))
    theta = np.column_stack([1.05 - 0.003 * (T["deck"] - 10), np.full(len(T), 0.97)])
    F = add_noise(model.frequencies(theta), 0.002, random_state=1)
    fem = DataInformedFEM(model.rescaled([1.05, 0.97]), random_state=0).fit(T[:200], F[:200])
    return bridge, model, fem, T, theta


@pytest.mark.nightly
def test_shapes_alone_distinguish_mirrored_places(symmetric):
    """Damage is in the third and fourth element."""
    bridge, model, fem, T, theta = symmetric
    damaged = bridge.divide(model, {"deck": {"x": [2, 3]}}).damaged({"x": 0.4})
    F = add_noise(damaged.frequencies(theta[200:]), 0.002, random_state=2)
    found = located(fem, F, structure=bridge, T=T[200:])
    deck = found.table[found.table["group"] == "deck"]
    assert deck["element"].tolist() == list(range(1, N + 1))
    assert deck["probability"].to_numpy() == pytest.approx(deck["probability"].to_numpy()[::-1], abs=0.02)
    assert {2, 3, N - 3, N - 4} <= set(found.likely_members(0.9, "deck"))
    dofs, random = [bridge.dofs.index((node, "z")) for node in SENSORS], np.random.default_rng(5)
    shapes = [one.modes(theta[:1])[1][0][dofs] for one in (model, damaged)]
    shapes = [s + 0.01 * np.abs(s).max(axis=0) * random.normal(size=s.shape) for s in shapes]
    with_shapes = located(fem, F, structure=bridge, T=T[200:], shapes=tuple(shapes), dofs=dofs)
    assert with_shapes.table.loc[[2, 3], "probability"].min() > 0.5
    likely = with_shapes.likely_members(0.9, "deck")
    assert {2, 3} <= set(likely)
    assert max(likely) < N / 2
    best = with_shapes.most_probable[0].removeprefix("deck: ").split(" to ")
    assert f"x = {2 * int(best[0])} to {2 * int(best[-1]) + 2} m" in with_shapes.summary()
    assert with_shapes.table.loc[2, "x"] == 5.0
