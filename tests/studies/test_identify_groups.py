"""Damage groups that look alike, that cannot be seen, or that do not explain the shifts; bad input."""

import copy

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import AffineModel, Beam, CallableModel, Spring, Structure, add_noise
from skthermo.studies import DamagePrior, identify_damage
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, with_model

YEAR = make_truss_campaign(random_state=0)
WEATHER = make_truss_campaign(random_state=1).temperatures[::10]
GROUPS = ["bottom", "top", "diagonal"]
N_MASSES = 9
SENSORS = [0, 2, 4, 6, 8]
SECTION = {"E": 33e9, "G": 14e9, "A": 5.0, "I_yy": 1.6, "I_zz": 20.0, "J": 3.0, "density": 2500.0}


def springs(places):
    """Stiffness of springs between neighbours of a row of masses, fixed at both ends."""
    stretch = np.zeros((N_MASSES + 1, N_MASSES))
    for place in places:
        stretch[place, place : place + 1] = 1
        stretch[place, max(place - 1, 0) : place] = -1
    return 1e4 * stretch.T @ stretch


@pytest.fixture(scope="module")
def symmetric():
    """A row of masses whose left and right springs mirror each other; all stiffness falls with temperature."""
    places = {"left": range(3), "middle": range(3, 7), "right": range(7, 10)}
    terms = {("E", name): springs(part) for name, part in places.items()}
    model = AffineModel(terms, np.eye(N_MASSES), n_modes=5).with_parameters(["E"])
    random = np.random.RandomState(0)
    T = pd.DataFrame({"T": 10 + 12 * np.sin(np.arange(200) / 30) + random.standard_normal(200)})
    F = model.frequencies(1 - 0.002 * (T.to_numpy() - 10)) * (1 + 0.01 * random.standard_normal((200, 5)))
    inverse = PosteriorInverse(noise=0.01)
    return DataInformedFEM(model, inverse=inverse, random_state=0).fit(T, F), T[::5]


def simulated(fem, T, damage=None):
    return fem.simulate(T, damage=damage) * (1 + fem.recorder_.residuals.expected(fem.weather(T).inputs))


def test_mirrored_groups_are_named(symmetric):
    fem, T = symmetric
    F = simulated(fem, T, {"left": 0.1})
    with pytest.warns(UserWarning, match="left and right.*indistinguishable-groups"):
        found = identify_damage(fem, T, F, ["left", "middle", "right"], random_state=0)
    assert found.separability.indistinguishable == [("left", "right")]
    assert found.separability.similarity.loc["left", "right"] == pytest.approx(1, abs=0.01)
    assert found.probabilities.p_value < 0.01
    probable = found.explanations["probability"]
    assert probable["left"] == pytest.approx(probable["right"], rel=0.2)
    assert found.table.loc["middle", "probability"] < 0.2
    joined = {"sides": ["left", "right"], "middle": ["middle"]}
    together = identify_damage(fem, T, F, joined, random_state=0)
    assert together.most_probable == ("sides",)
    assert together.separability.indistinguishable == []
    assert 0.04 < together.severities["sides"] < 0.06
    assert [together.damage[side] for side in ("left", "right")] == pytest.approx(
        [together.severities["sides"]] * 2, abs=1e-3
    )


@pytest.mark.parametrize("side", ["left", "right"])
def test_shapes_tell_mirrored_groups_apart(symmetric, side):
    fem, T = symmetric
    damage, theta = {side: 0.2}, fem.predict_parameters(T).to_numpy().mean(axis=0, keepdims=True)
    healthy = fem.model.modes(theta)[1][0][SENSORS]
    damaged = fem.model.damaged(damage).modes(theta)[1][0][SENSORS] * np.array([2, -1, 1j, 0.5, 1])
    found = identify_damage(
        fem, T, simulated(fem, T, damage), shapes=(healthy, damaged), dofs=SENSORS, shape_noise=0.01, random_state=0
    )
    assert found.separability.indistinguishable == []
    expected = {"left": 0.0, "middle": 0.0, "right": 0.0, **damage}
    assert found.severities.to_dict() == pytest.approx(expected, abs=6e-3)
    assert found.most_probable == (side,)
    assert found.probability > 0.9
    missing = damaged.copy()
    missing[:, 1] = np.nan
    some = identify_damage(fem, T, simulated(fem, T, damage), shapes=(healthy, missing), dofs=SENSORS, random_state=0)
    assert some.severities[side] == pytest.approx(0.2, abs=6e-3)


def test_groups_that_cannot_be_seen_keep_their_prior_probability(fem):
    F = simulated(fem, WEATHER)
    with pytest.warns(UserWarning, match="vertical.*unobservable-groups"):
        found = identify_damage(fem, WEATHER, F, random_state=0)
    assert found.separability.unobservable == ["vertical"]
    assert found.table.index.tolist() == [*GROUPS, "vertical"]
    # of the explanations that remain, those with or without it: 1/5 of single causes, one of which is all groups
    numbers = found.prior.numbers
    expected = numbers[1] / 5 / (numbers[0] + numbers[1] / 5)
    # which healthy records lower a little, as they show no damage of it
    assert expected / 3 < found.table.loc["vertical", "probability"] < 1.5 * expected
    assert found.table.loc["vertical", "if_damaged"] == pytest.approx(0.2 * np.sqrt(2 / np.pi), rel=0.6)
    assert (found.draws["vertical"] > 0).any()
    with pytest.raises(ValueError, match=r"no group can be seen; .* vertical "):
        identify_damage(fem, WEATHER[::4], F[::4], ["vertical"])


@pytest.mark.filterwarnings("ignore:.*unexplained-shifts")
def test_shifts_that_no_group_makes_are_something_else(fem):
    for change in (1.05, [1, 1, 1, 1.03, 1, 1]):
        found = identify_damage(fem, WEATHER, simulated(fem, WEATHER) * change, GROUPS, random_state=0)
        assert found.most_probable == ("something else",)
        assert found.probabilities.other > 0.9
        assert found.probabilities.damage > 0.99
        assert found.damage == {}
        assert found.probabilities.p_value < 0.01


@pytest.mark.filterwarnings("ignore:.*unexplained-shifts")
def test_damage_beside_something_else_is_still_found(fem):
    F = simulated(fem, WEATHER, {"top": 0.4})
    F.iloc[:, 5] *= 1.02
    found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert found.most_probable == ("top", "something else")
    assert found.table.loc["top", "probability"] > 0.95
    assert found.estimates.loc[("top + something else", "top"), "severity"] == pytest.approx(0.4, abs=0.05)
    without = DamagePrior(something_else=0)
    forced = identify_damage(fem, WEATHER, F, GROUPS, prior=without, random_state=0)
    assert forced.probabilities.other == 0
    assert forced.probabilities.misfit_p_value < found.probabilities.misfit_p_value


@pytest.mark.filterwarnings("ignore:.*unexplained-shifts")
@pytest.mark.filterwarnings("ignore:.*severity-at-bound")
def test_a_severity_at_its_bound(fem):
    F = simulated(fem, WEATHER, {"diagonal": 0.98})
    found = identify_damage(fem, WEATHER, F, "diagonal", noise=0.05, random_state=0)
    assert 0.9 < found.severities["diagonal"] <= 0.95
    assert found.table.loc["diagonal", "ci_high"] == pytest.approx(0.95)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_mode_of_which_all_training_records_are_of_one_period():
    """Nothing says how much the mode scatters from period to period: it is left out."""
    F = YEAR.frequencies.copy()
    F.iloc[12:, 1] = np.nan
    fem = DataInformedFEM(make_truss(), random_state=0).fit(YEAR.temperatures, F)
    new = fem.simulate(WEATHER, damage={"diagonal": 0.3})
    found = identify_damage(fem, WEATHER, new, GROUPS, random_state=0)
    assert found.severities["diagonal"] == pytest.approx(0.3, abs=0.03)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"groups": ["bottom", "deck"]}, r"unknown damage groups \['deck'\]; expected some of \['bottom', "),
        ({"groups": {"chords": []}}, r"expected one or more of"),
        ({"noise": "gaussian"}, "noise is 'gaussian'; expected \"fitted\" or relative standard deviations"),
        ({"noise": 0.0}, "noise is 0.0; expected standard deviations above 0"),
        ({"groups": {"something else": ["top"]}}, r"causes have the names \['something else'\]; expected other names"),
        ({"n_jobs": 0}, "n_jobs is 0; expected an integer"),
        ({"prior": 0.5}, "prior is 0.5; expected a DamagePrior"),
        ({"shapes": (np.ones((2, 6)), np.ones((2, 6)))}, "shapes came without dofs"),
        ({"dofs": [0, 1]}, "dofs came without shapes"),
        ({"shapes": (np.ones((2, 6)),) * 2, "dofs": [0, 99]}, "dofs holds 99; expected 0 to 22"),
        ({"shapes": (np.ones((2, 6)),) * 2, "dofs": [0.5, 1]}, "expected integers"),
    ],
)
def test_bad_options(fem, change, message):
    with pytest.raises(ValueError, match=message):
        identify_damage(fem, WEATHER, simulated(fem, WEATHER), **{"groups": GROUPS, **change})


def test_bad_records(fem):
    F = simulated(fem, WEATHER)
    with pytest.raises(ValueError, match="temperatures"):
        identify_damage(fem, WEATHER, F[:-1], GROUPS)
    with pytest.raises(ValueError, match=r"have the columns \['a', .*expected \['f1'"):
        identify_damage(fem, WEATHER, F.set_axis(list("abcdef"), axis=1), GROUPS)
    with pytest.raises(ValueError, match=r"have shape \(37, 4\); expected 6 modes"):
        identify_damage(fem, WEATHER.to_numpy(), F.to_numpy()[:, :4], GROUPS)
    zero = F.copy()
    zero.iloc[3, 2] = 0.0
    with pytest.warns(UserWarning, match="'f3' is 0 Hz in 1 of 37 rows.*set-aside"):
        found = identify_damage(fem, WEATHER, zero, GROUPS, random_state=0)
    missing = identify_damage(fem, WEATHER, zero.where(zero > 0), GROUPS, random_state=0)
    pd.testing.assert_frame_equal(found.table, missing.table)
    with pytest.raises(ValueError, match=r"none of 37\srecords can be compared .*: 37 without a frequency; expected"):
        identify_damage(fem, WEATHER, F * np.nan, GROUPS)


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        (2 * np.pi, "rad/s"),
        (0.001, "kHz"),
        ([1, 1, 1, 1, 1, 5], r"1 of 6 modes are .*, f6 .* times; expected Hz, and modes in the order of fit"),
    ],
)
def test_frequencies_that_no_change_of_a_structure_explains(fem, factors, message):
    with pytest.raises(ValueError, match=message):
        identify_damage(fem, WEATHER, simulated(fem, WEATHER) * factors, GROUPS)


class OwnModel:
    """A user's model that offers frequencies alone."""

    parameter_names, n_modes, frequencies = make_truss().parameter_names, 6, make_truss().frequencies


def test_a_program_that_gives_frequencies_alone_has_its_parameters_as_groups(fem):
    """Without matrices and derivatives, damage is identified as with them."""
    truss, F = make_truss(), simulated(fem, WEATHER, damage={"bottom": 0.15})
    program = CallableModel(truss.frequencies, truss.parameter_names, 6, vectorized=True)
    chains = fem, with_model(fem, program)
    ours, theirs = (identify_damage(one, WEATHER, F, GROUPS, random_state=0) for one in chains)
    assert theirs.most_probable == ours.most_probable == ("bottom",)
    columns = ["probability", "severity"]
    np.testing.assert_allclose(theirs.table[columns], ours.table[columns], atol=2e-3)


def test_a_model_that_cannot_be_damaged(fem):
    other = copy.copy(fem).set_params(model=OwnModel())
    with pytest.raises(ValueError, match="has no damage groups; expected a model that can be damaged"):
        identify_damage(other, WEATHER, fem.predict(WEATHER))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"numbers": (0.5, 0.6)}, "expected probabilities of none, one, two and at most three causes"),
        ({"numbers": (0.2,) * 5}, "numbers is"),
        ({"numbers": {0: 0.5, 1: 0.5}}, "numbers is {0: 0.5, 1: 0.5}; expected numbers"),
        ({"law": np.array(["uniform", "uniform"])}, "expected 'half-normal' or 'uniform'"),
        ({"severity": 0}, "severity is 0; expected a number between 0 and 1"),
        ({"something_else": 1.5}, "something_else is 1.5"),
    ],
)
def test_bad_priors(options, message):
    with pytest.raises(ValueError, match=message):
        DamagePrior(**options)


def test_an_even_loss_is_one_of_all_groups(fem):
    """1.2 % everywhere is no 3 % in one group: nobody has to ask for it, and every group is damaged then."""
    F = simulated(fem, WEATHER, dict.fromkeys((*GROUPS, "vertical"), 0.012))
    found = identify_damage(fem, WEATHER, F, noise=0.002, random_state=0)
    assert found.most_probable == ("all groups",)
    assert found.probabilities.even > 0.9
    assert found.table["probability"].min() > 0.9
    assert found.severities.to_dict() == pytest.approx(dict.fromkeys((*GROUPS, "vertical"), 0.012), abs=2e-3)
    assert found.damage == pytest.approx(dict.fromkeys((*GROUPS, "vertical"), 0.012), abs=2e-3)


def symmetric_bridge():
    """Three spans of 20, 30 and 20 m on springs."""
    nodes = {i: (5.0 * i, 0.0, 0.0) for i in range(15)}
    members = {i: Beam(i, i + 1, **SECTION) for i in range(14)}
    members |= {"p1": Spring(4, "z", k=4e8), "p2": Spring(10, "z", k=4e8)}
    members |= {"b0": Spring(0, "z", k=6e8), "b3": Spring(14, "z", k=6e8)}
    groups = {"deck": range(14), "pier_1": ["p1"], "pier_2": ["p2"]}
    supports = dict.fromkeys(nodes, "y rx rz") | {0: "x y rx rz"}
    return Structure(nodes, members, supports, groups).assemble(["deck", "pier_1", "pier_2"], n_modes=4)


@pytest.mark.nightly
def test_mirror_images_are_named_and_share_the_probability():
    """Of a symmetric bridge, whose chain has drifted out of symmetry."""
    model = symmetric_bridge()
    T = 10 + 10 * np.random.default_rng(0).uniform(-1, 1, (300, 1))
    theta = np.exp((T - 10) * [-0.004, -0.003, -0.003])
    fem = DataInformedFEM(model, inverse=PosteriorInverse(noise=0.004), random_state=0)
    fem.fit(T, add_noise(model.frequencies(theta), 0.004, random_state=0))
    records = add_noise(model.damaged({"pier_2": 0.2}).frequencies(theta), 0.004, random_state=1)
    with pytest.warns(UserWarning, match="pier_1 and pier_2.*indistinguishable-groups"):
        found = identify_damage(fem, T, records, random_state=0)
    assert found.separability.indistinguishable == [("pier_1", "pier_2")]
    assert found.probabilities.p_value < 0.01
    assert found.probabilities.damage > 0.99
    alone = found.explanations["probability"]
    assert 0.3 < alone["pier_2"] / alone["pier_1"] < 3
    assert (found.table.loc[["pier_1", "pier_2"], "standard_error"] > 0.05).all()
    assert found.estimates.loc[("pier_2", "pier_2"), "severity"] == pytest.approx(0.2, abs=0.02)
    assert (found.table["ci_low"] == 0).all()
    assert found.table.loc["pier_2", "ci_high"] > 0.18
