"""Damage groups that look alike, that cannot be seen, or that do not explain the shifts; bad input."""

import copy
import re

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import AffineModel, CallableModel
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

YEAR = make_truss_campaign(random_state=0)
WEATHER = make_truss_campaign(random_state=1).temperatures[::10]
GROUPS = ["bottom", "top", "diagonal"]
N_MASSES = 9
SENSORS = [0, 2, 4, 6, 8]


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
    inverse = InverseSurrogate(n_samples=100, noise=0.01)
    return DataInformedFEM(model, inverse=inverse, random_state=0).fit(T, F), T[::5]


def simulated(fem, T, damage=None):
    return fem.simulate(T, damage=damage) * (1 + fem.expected_residuals(T))


def test_mirrored_groups_are_named(symmetric):
    fem, T = symmetric
    F = simulated(fem, T, {"left": 0.1})
    with pytest.warns(UserWarning, match="cannot tell apart: left and right. Only their common effect is known"):
        found = identify_damage(fem, T, F, ["left", "middle", "right"], random_state=0)
    assert found.confused == [("left", "right")]
    assert found.similarity.loc["left", "right"] == pytest.approx(1, abs=0.01)
    assert "left and right cannot be told apart by these modes: only their common effect is known." in found.summary()
    assert not found.table.loc[["left", "right"], "significant"].any()
    assert found.p_value < 0.01
    merged = identify_damage(fem, T, F, ["left", "middle", "right"], merge=True, random_state=0)
    assert merged.severities.index.tolist() == ["left + right", "middle"]
    assert merged.confused == []
    assert 0.04 < merged.severities["left + right"] < 0.06
    assert merged.table["significant"].tolist() == [True, False]
    assert [merged.damage[side] for side in ("left", "right")] == pytest.approx([merged.severities["left + right"]] * 2)


@pytest.mark.parametrize("side", ["left", "right"])
def test_shapes_tell_mirrored_groups_apart(symmetric, side):
    fem, T = symmetric
    damage, theta = {side: 0.2}, fem.predict_parameters(T).to_numpy().mean(axis=0, keepdims=True)
    healthy = fem.model.modes(theta)[1][0][SENSORS]
    damaged = fem.model.damaged(damage).modes(theta)[1][0][SENSORS] * np.array([2, -1, 1j, 0.5, 1])
    found = identify_damage(
        fem, T, simulated(fem, T, damage), shapes=(healthy, damaged), dofs=SENSORS, shape_noise=0.01, random_state=0
    )
    assert found.confused == []
    expected = {"left": 0.0, "middle": 0.0, "right": 0.0, **damage}
    assert found.severities.to_dict() == pytest.approx(expected, abs=3e-3)
    assert found.table["significant"].to_dict() == {group: group == side for group in expected}
    missing = damaged.copy()
    missing[:, 1] = np.nan
    some = identify_damage(fem, T, simulated(fem, T, damage), shapes=(healthy, missing), dofs=SENSORS, random_state=0)
    assert some.severities[side] == pytest.approx(0.2, abs=3e-3)


def test_groups_that_cannot_be_seen_are_named(fem):
    F = simulated(fem, WEATHER, {"top": 0.2})
    with pytest.warns(UserWarning, match="these modes do not show, which are left out: vertical"):
        found = identify_damage(fem, WEATHER, F, random_state=0)
    assert found.unseen == ["vertical"]
    assert found.table.index.tolist() == GROUPS
    assert "vertical cannot be seen" in found.summary()
    assert (found.draws["vertical"] == 0).all()
    with pytest.raises(ValueError, match=r"no group can be seen; .* vertical "):
        identify_damage(fem, WEATHER, F, ["vertical"])


def test_a_shift_that_no_group_makes(fem):
    added = np.zeros(make_truss().n_dof)
    added[:8] = 800.0
    F = fem.simulate(WEATHER, mass=added) * (1 + fem.expected_residuals(WEATHER))
    with pytest.warns(UserWarning, match="damage of these groups does not explain the shifts"):
        found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert found.misfit_p_value < 0.01
    assert found.is_unexplained
    assert "Something has changed (" in found.summary()
    assert "damage of these groups does not explain all of it" in found.summary()


def test_higher_frequencies_are_no_damage(fem):
    F = simulated(fem, WEATHER) * 1.05
    with pytest.warns(UserWarning, match="does not explain the shifts .*: 6 of 6 frequencies rose"):
        found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    said = (
        r"6 of 6 frequencies rose, that of mode f\d by 5.00%; strengthening is not sought, because severities are not"
    )
    assert re.search(said, found.summary())
    assert found.severities.tolist() == [0.0, 0.0, 0.0]
    assert found.p_value > 0.9
    assert found.damage == {}


def test_one_higher_frequency_that_no_damage_explains(fem):
    F = simulated(fem, WEATHER)
    F.iloc[:, 3] *= 1.03
    with pytest.warns(UserWarning, match="does not explain the shifts .*: 1 of 6 frequencies rose, that of mode f4 by"):
        identify_damage(fem, WEATHER, F, GROUPS, random_state=0)


@pytest.mark.parametrize("damage", [None, {"top": 0.2}], ids=["healthy", "damaged"])
def test_frequencies_in_radians_per_second_are_named(fem, damage):
    F = simulated(fem, WEATHER, damage) * 2 * np.pi
    with pytest.warns(UserWarning, match="about 2 pi times the predicted ones, perhaps in rad/s; expected Hz"):
        found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert "the measured frequencies are about 2 pi times the predicted ones, perhaps in rad/s; expected Hz." in (
        found.summary()
    )


def test_damage_and_explained_shifts_have_no_other_cause(fem):
    for damage in ({}, {"top": 0.2}):
        found = identify_damage(fem, WEATHER, simulated(fem, WEATHER, damage), GROUPS, random_state=0)
        assert found.likely_cause == ""
    F = simulated(fem, WEATHER, {"top": 0.4})
    F.iloc[:, 5] *= 1.02
    with pytest.warns(UserWarning, match="something else changed too"):
        found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert found.table.loc["top", "significant"]
    assert found.likely_cause == ""


@pytest.mark.filterwarnings("ignore:damage of these groups does not explain")
def test_a_severity_at_its_bound(fem):
    F = simulated(fem, WEATHER, {"diagonal": 0.98})
    with pytest.warns(UserWarning, match="upper bound of 95%: diagonal"):
        found = identify_damage(fem, WEATHER, F, "diagonal", noise=0.05, random_state=0)
    assert found.severities["diagonal"] == 0.95


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
        ({"groups": []}, r"groups is \[\]; expected one or more of"),
        ({"groups": {"chords": []}}, r"expected one or more of"),
        ({"noise": "gaussian"}, "noise is 'gaussian'; expected \"fitted\" or relative standard deviations"),
        ({"noise": 0.0}, "noise is 0.0; expected standard deviations above 0"),
        ({"significance": 1.0}, "significance is 1.0; expected a probability between 0 and 1"),
        ({"shapes": (np.ones((2, 6)), np.ones((2, 6)))}, "shapes came without dofs"),
        ({"dofs": [0, 1]}, "dofs came without shapes"),
        ({"shapes": np.ones((2, 2, 6)), "dofs": [0, 1]}, "shapes is not a pair"),
        ({"shapes": (np.ones((2, 6)), np.ones((3, 6))), "dofs": [0, 1]}, r"the damaged shapes have shape \(3, 6\)"),
        ({"shapes": (np.ones((2, 6)), np.zeros((2, 6))), "dofs": [0, 1]}, "the damaged shape of mode 0 is zero"),
        ({"shapes": (np.ones((2, 6)),) * 2, "dofs": [0, 99]}, "dofs reach from 0 to 99; expected 0 to 22"),
        ({"shapes": (np.ones((2, 6)),) * 2, "dofs": [0.5, 1]}, "expected the degree of freedom of each sensor"),
        ({"shapes": (np.ones((2, 6)),) * 2, "dofs": [0, 1], "shape_noise": 0}, "shape_noise is 0; expected"),
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
    with pytest.raises(ValueError, match="row 3 of the frequencies has a value of 0 or less"):
        identify_damage(fem, WEATHER, zero, GROUPS)
    with pytest.raises(ValueError, match=r"none of 37\srecords can be compared .*: 37 without a frequency; expected"):
        identify_damage(fem, WEATHER, F * np.nan, GROUPS)


def test_a_model_that_cannot_be_damaged(fem):
    truss = make_truss()
    other = copy.copy(fem).set_params(model=CallableModel(truss.frequencies, list(truss.parameter_names), 6))
    with pytest.raises(ValueError, match="has no damage groups; expected a model that can be damaged"):
        identify_damage(other, WEATHER, fem.predict(WEATHER))
