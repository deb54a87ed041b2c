"""Losses of cross-section, which take stiffness and mass away, and directions in which small losses move modes."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
from skthermo.fem import AffineModel, Bar, Beam, CallableModel, ImportedStructure, PointMass, Spring, Structure
from skthermo.surrogate import DataInformedFEM

TRUSS = make_truss()
NAMES = ["bottom", "top", "diagonal", "vertical"]
NOMINAL = np.ones((1, 4))
THETA = np.random.default_rng(0).uniform(0.8, 1.2, size=(6, 4))
LOSS = {"bottom": 0.3, "diagonal": 0.1}
STEEL = {"E": 210e9, "G": 81e9, "density": 7850.0, "A": 0.02, "I_yy": 4e-5, "I_zz": 1e-5, "J": 3e-5}


def lost(structure, losses):
    """The structure with smaller members: E, G and density stand for all properties of a section."""

    def smaller(name, element):
        left = np.prod([1 - loss for group, loss in losses.items() if name in structure.groups[group]])
        scaled = {name: left * getattr(element, name) for name in ("E", "G", "k", "density") if hasattr(element, name)}
        return replace(element, **scaled)

    members = {name: smaller(name, element) for name, element in structure.members.items()}
    return Structure(structure.nodes, members, structure.supports, structure.groups)


def frame(n=12):
    """A continuous beam on springs, with point masses and a tie, whose groups overlap."""
    nodes = {i: (2.0 * i, 0.0, 0.0) for i in range(n)} | {"low": (n - 1.0, 0.0, -2.0)}
    members = {("beam", i): Beam(i, i + 1, **STEEL) for i in range(n - 1)}
    members |= {("tie", i): Bar(i, "low", E=210e9, A=0.001, density=7850.0) for i in (2, n - 3)}
    members |= {("mass", i): PointMass(i, m=500.0) for i in (3, 5)}
    members |= {("spring", i): Spring(i, "z", k=2e7) for i in (0, n // 2, n - 1)}
    groups = {
        "west": [("beam", i) for i in range(n // 2)] + [("mass", 3)],
        "middle": [("beam", i) for i in range(3, n - 3)],
        "ties": [("tie", 2), ("tie", n - 3)],
        "springs": [("spring", 0), ("spring", n - 1)],
    }
    supports = {0: "xy rx", n - 1: "y", "low": "y"}
    return Structure(nodes, members, supports, groups)


def test_the_truss_is_one_with_smaller_members():
    own = truss_structure()
    damaged = TRUSS.damaged(LOSS, kind="section")
    members = {
        name: replace(bar, A=bar.A * np.prod([1 - loss for group, loss in LOSS.items() if name in own.groups[group]]))
        for name, bar in own.members.items()
    }
    for smaller in (lost(own, LOSS), Structure(own.nodes, members, own.supports, own.groups)):
        exact = smaller.assemble(NAMES, n_modes=6).frequencies(THETA)
        assert damaged.frequencies(THETA) == pytest.approx(exact, rel=1e-10)
    assert (damaged.frequencies(NOMINAL) > TRUSS.damaged(LOSS).frequencies(NOMINAL)).all()


@pytest.mark.parametrize(("n", "track"), [(12, True), (60, False)])  # dense and sparse
def test_beams_overlapping_groups_and_parameters_of_the_mass(n, track):
    structure, loss = frame(n), {"west": 0.3, "middle": 0.2, "ties": 0.5, "springs": 0.1}
    parameters = {"E_west": ("E", "west"), "mass of the middle": ("density", "middle"), "ties": "ties"}
    model, smaller = (one.assemble(parameters, n_modes=4, track=track) for one in (structure, lost(structure, loss)))
    damaged, theta = model.damaged(loss, kind="section"), THETA[:3, :3]
    assert damaged.frequencies(theta) == pytest.approx(smaller.frequencies(theta), rel=1e-10)
    masses, members = model.group_mass, structure.members
    assert masses["springs"].nnz == 0
    whole = sum(2.0 * members["beam", i].density * members["beam", i].A for i in range(n // 2))
    rigid = np.array([float(direction == "z") for _, direction in model.dofs])
    assert rigid @ masses["west"] @ rigid == pytest.approx(whole)  # without the point mass


def changed_models():
    """Models that are changed, and the same of the truss with smaller members."""
    smaller = lost(truss_structure(), LOSS).assemble(NAMES, n_modes=6)
    yield TRUSS.damaged(LOSS, kind="section").with_modes([0, 3]), smaller.with_modes([0, 3]), THETA
    fewer = TRUSS.with_parameters(["top", "bottom"])
    yield fewer.damaged(LOSS, kind="section"), smaller.with_parameters(["top", "bottom"]), THETA[:, :2]
    yield TRUSS.rescaled(THETA[0]).damaged(LOSS, kind="section"), smaller.rescaled(THETA[0]), THETA
    step = {"bottom": 1 - np.sqrt(0.7), "diagonal": 1 - np.sqrt(0.9)}
    yield TRUSS.damaged(step, kind="section").damaged(step, kind="section"), smaller, THETA
    yield pickle.loads(pickle.dumps(TRUSS)).damaged(LOSS, kind="section"), smaller, THETA
    mass = np.full(TRUSS.n_dof, 50.0)
    yield TRUSS.with_added(mass=mass).damaged(LOSS, kind="section"), smaller.with_added(mass=mass), THETA
    both = TRUSS.damaged({"top": 0.2}).damaged(LOSS, kind="section")
    yield both, smaller.damaged({"top": 0.2}), THETA
    varied = TRUSS.with_damage_parameters(["top"], kind="section").damaged(LOSS, kind="section")
    yield varied.with_parameters(["diagonal"]), smaller.with_parameters(["diagonal"]), THETA[:, :1]


def test_other_changes_of_a_model_and_losses_of_section_go_together():
    for model, expected, theta in changed_models():
        assert model.frequencies(theta) == pytest.approx(expected.frequencies(theta), rel=1e-10)


def test_a_reduced_model_loses_section():
    exact = lost(truss_structure(), LOSS).assemble(NAMES, n_modes=6).frequencies(THETA)
    reduced = TRUSS.reduced(0.25, random_state=0)
    varied = reduced.with_damage_parameters(list(LOSS), kind="section")
    rows = np.hstack([THETA, np.tile([0.7, 0.9], (len(THETA), 1))])
    assert reduced.damaged(LOSS, kind="section").frequencies(THETA) == pytest.approx(exact, rel=1e-5)
    assert varied.frequencies(rows) == pytest.approx(exact, rel=1e-5)
    assert varied.full.frequencies(rows) == pytest.approx(exact, rel=1e-10)


def test_a_tracked_mode_is_followed_where_mass_goes():
    tracked = frame().assemble(["west", "ties"], groups=["west", "ties"], n_modes=4, track=True)
    severities = np.linspace(0, 0.9, 7)
    rows = np.column_stack([np.ones((7, 2)), 1 - severities, 1 - severities])
    varied = tracked.with_damage_parameters(["west", "ties"], kind="section").frequencies(rows)
    each = [tracked.damaged({"west": s, "ties": s}, kind="section").frequencies([[1.0, 1.0]])[0] for s in severities]
    assert varied == pytest.approx(np.array(each), rel=1e-10)


def test_derivatives_are_those_of_differences():
    parameters = {"E_west": ("E", "west"), "m_middle": ("density", "middle")}
    model = frame().assemble(parameters, n_modes=4).with_damage_parameters(["west", "middle"], kind="section")
    theta, step = np.array([[1.1, 0.9, 0.8, 0.95]]), 1e-5 * np.eye(4)
    slopes = (model.frequencies(theta + step) - model.frequencies(theta - step)) / 2e-5
    assert model.jacobian(theta)[0] == pytest.approx(slopes.T, rel=1e-5, abs=1e-5)


def test_directions_are_slopes_of_both_kinds():
    directions = TRUSS.damage_directions()
    assert list(directions.index) == [*NAMES, *(f"{name}, section" for name in NAMES)]
    program = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6, vectorized=True)
    for kind in ("stiffness", "section"):
        alone = TRUSS.damage_directions(["top", "bottom"], kind=kind)
        for group, row in zip(["top", "bottom"], alone.to_numpy(), strict=True):
            logs = [np.log(TRUSS.damaged({group: s}, kind=kind).frequencies(NOMINAL)[0]) for s in (1e-4, -1e-4)]
            assert row == pytest.approx((logs[0] - logs[1]) / 2e-4, abs=1e-6)
        assert alone.to_numpy() == pytest.approx(directions.loc[alone.index].to_numpy(), abs=1e-12)
    assert program.damage_directions().to_numpy() == pytest.approx(directions.loc[NAMES].to_numpy(), abs=1e-5)
    on_springs = frame().assemble(["west"], groups=["west", "springs"], n_modes=4).damage_directions()
    assert list(on_springs.index) == ["west", "springs", "west, section"]


def test_directions_of_a_chain_have_the_names_of_its_modes():
    campaign = make_truss_campaign(samples_per_year=90, random_state=0)
    fem = DataInformedFEM(TRUSS, random_state=0).fit(campaign.temperatures, campaign.frequencies)
    directions = fem.damage_directions(["diagonal"])
    assert list(directions.columns) == list(fem.mode_names_)
    theta = fem.parameters_.mean().to_numpy()[np.newaxis]
    for name, kind in (("diagonal", "stiffness"), ("diagonal, section", "section")):
        healthy, damaged = (
            fem.aligner_.inverse_transform(model.frequencies(theta))[0]
            for model in (TRUSS, TRUSS.damaged({"diagonal": 1e-4}, kind=kind))
        )
        assert directions.loc[name].to_numpy() == pytest.approx(np.log(damaged / healthy) / 1e-4, abs=1e-4)


def test_a_loss_of_stiffness_is_what_it_was():
    masses = truss_structure().assemble(NAMES, n_modes=6)._parts_of_mass
    of_parameters = {places: (name,) for name, places in TRUSS.parameter_terms.items()}
    terms = [(of_parameters.get((place,), ()), matrix) for place, matrix in enumerate(TRUSS.stiffness_terms)]
    for kind in ({}, {"kind": "stiffness"}):
        assert np.array_equal(TRUSS.damaged(LOSS, **kind).frequencies(THETA), TRUSS.damaged(LOSS).frequencies(THETA))
    mass = TRUSS.matrices(np.ones(4))[1]
    plain, knowing = (AffineModel(terms, mass, n_modes=6, group_mass=own) for own in (None, masses))
    assert np.array_equal(plain.damaged(LOSS).frequencies(THETA), knowing.damaged(LOSS).frequencies(THETA))
    assert np.array_equal(plain.jacobian(THETA), knowing.jacobian(THETA))
    assert np.array_equal(TRUSS.frequencies(THETA), TRUSS.damaged({"top": 0.0}, kind="section").frequencies(THETA))


def test_a_group_made_of_two_loses_as_both():
    own = truss_structure()
    groups = own.groups | {"chords": own.groups["bottom"] | own.groups["top"]}
    model = Structure(own.nodes, own.members, own.supports, groups).assemble(NAMES, n_modes=6)
    one, two, again = {"chords": 0.2}, {"bottom": 0.2, "top": 0.2}, {"bottom": 0.2, "top": 1 - 0.8 * 0.9}
    for kind, losses in (("stiffness", (one, two)), ("section", (one, two)), ("section", (one | {"top": 0.1}, again))):
        frequencies = [model.damaged(loss, kind=kind).frequencies(THETA) for loss in losses]
        assert frequencies[0] == pytest.approx(frequencies[1], rel=1e-12)
    assert abs(model.group_mass["chords"] - model.group_mass["bottom"] - model.group_mass["top"]).max() < 1e-9


def test_members_of_a_divided_group_lose_their_own_mass():
    structure, theta = frame(), THETA[:, :2]
    parts = {"west": {"first": [("beam", 0), ("beam", 1)]}, "springs": {"left": [("spring", 0)]}}
    groups = structure.groups | parts["west"] | parts["springs"]
    fewer, loss = (
        Structure(structure.nodes, structure.members, structure.supports, groups),
        {"first": 0.4, "middle": 0.1, "left": 0.2},
    )
    exact = lost(fewer, loss).assemble(["west", "ties"], n_modes=4).frequencies(theta)
    model = structure.assemble(["west", "ties"], n_modes=4)
    for one, tolerance in ((model, 1e-10), (model.reduced(0.25, random_state=0), 1e-5)):
        damaged = structure.divide(one, parts).damaged(loss, kind="section")
        assert damaged.frequencies(theta) == pytest.approx(exact, rel=tolerance)


def springs(**options):
    stiffness = {("k",): [[800.0, -400.0], [-400.0, 400.0]], ("c",): np.diag([0.0, 100.0])}
    return AffineModel(stiffness, {(): np.eye(2), ("m",): np.diag([0.0, 2.0])}, n_modes=2, **options)


def test_masses_of_other_programs():
    own = {"k": np.diag([0.5, 0.5]), "c": {("m",): np.diag([0.0, 1.0])}}
    model, theta = springs(group_mass=own), [[1.2, 0.8, 1.5]]
    damaged = model.damaged({"k": 0.2, "c": 0.5}, kind="section")
    stiffness = 0.8 * 1.2 * np.array([[800.0, -400.0], [-400.0, 400.0]]) + 0.5 * 0.8 * np.diag([0.0, 100.0])
    mass = np.eye(2) + 1.5 * np.diag([0.0, 2.0]) - 0.2 * np.diag([0.5, 0.5]) - 0.5 * 1.5 * np.diag([0.0, 1.0])
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness))
    assert damaged.frequencies(theta)[0] == pytest.approx(np.sqrt(np.sort(squares)) / (2 * np.pi), rel=1e-12)
    assert model.group_mass["c"].toarray() == pytest.approx(np.diag([0.0, 1.0]))
    rescaled = model.rescaled(theta).damaged({"k": 0.2, "c": 0.5}, kind="section")
    assert rescaled.frequencies(NOMINAL[:, :3]) == pytest.approx(damaged.frequencies(theta), rel=1e-12)


@pytest.mark.parametrize("is_known", [True, False])
def test_an_imported_structure_knows_the_masses_of_its_members(is_known):
    own = truss_structure()
    exported = own.assemble({name: name for name in own.groups if name in NAMES}, groups=NAMES, n_modes=6)
    terms = {(name,): exported.stiffness_terms[place] for name, (place,) in exported.groups.items()}
    terms[()] = sum(exported.stiffness_terms) - sum(terms.values())
    masses, theta = exported.group_mass if is_known else None, NOMINAL[:, :2]
    model = AffineModel(terms, exported.matrices(np.ones(4))[1], n_modes=6, group_mass=masses)
    members, groups = dict.fromkeys(NAMES, (0, 1)), {"chords": ["bottom", "top"], "rest": NAMES[2:]}
    imported = ImportedStructure(model, {0: (0.0, 0.0), 1: (1.0, 0.0)}, members, groups)
    assembled = imported.assemble(["chords", "rest"], n_modes=6)
    if is_known:
        divided = imported.divide(assembled, {"chords": {"upper": ["top"]}})
        for model, loss, same in (
            (assembled, {"chords": 0.2}, {"bottom": 0.2, "top": 0.2}),
            (divided, {"upper": 0.3}, {"top": 0.3}),
        ):
            expected = exported.damaged(same, kind="section").frequencies(NOMINAL)
            assert model.damaged(loss, kind="section").frequencies(theta) == pytest.approx(expected, rel=1e-10)
    else:
        with pytest.raises(ValueError, match="does not know the mass"):
            assembled.damaged({"chords": 0.2}, kind="section")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: springs().damaged({"k": 0.2}, kind="section"), r"does not know the mass of the groups \['k'\]"),
        (
            lambda: springs(group_mass={"k": 0.5 * np.eye(2)}).with_damage_parameters(["k", "c"], kind="section"),
            r"does not know the mass of the groups \['c'\]",
        ),
        (lambda: springs().damage_directions(kind="section"), "does not know the mass"),
        (lambda: TRUSS.damaged({"top": 0.1}, kind="area"), "expected 'stiffness' or 'section'"),
        (lambda: CallableModel(np.sqrt, ["top"], 1).damaged({"top": 0.1}, kind="section"), "does not know the mass"),
        (lambda: CallableModel(lambda row: [1.0, 2.0], ["E"], 2).damage_directions(), "no loss of the groups"),
        (lambda: TRUSS.damage_directions(["sideways"]), "unknown damage groups"),
        (lambda: springs(group_mass={"x": np.eye(2)}), "expected a mapping of some of"),
        (lambda: springs(group_mass={"k": 2 * np.eye(2)}), "more than the model's mass"),
        (lambda: springs(group_mass={"k": -np.eye(2)}), "below 0"),
        (lambda: springs(group_mass={"k": np.eye(3)}), "expected"),
        (lambda: springs(group_mass={"k": {("z",): 0.1 * np.eye(2)}}), "name"),
    ],
)
def test_what_is_wrong_is_named(wrong, message):
    with pytest.raises(ValueError, match=message):
        wrong()
