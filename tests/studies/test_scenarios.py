"""Scenarios and what they change."""

import copy
import pickle

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss
from skthermo.studies import ProgressiveDamage, Scenario, UncertainDamage, sweep

ROWS = np.zeros((10, 3))
DAYS = pd.DataFrame(ROWS, index=pd.date_range("2025-01-01", periods=10, freq="D"))


def test_a_scenario_passes_on_what_it_changes_and_nothing_else():
    assert Scenario("healthy").changes(ROWS) == {}
    scenario = Scenario("all", {"bottom": 0.2}, parameters={"top": 1.1}, mass=np.ones(23))
    assert set(scenario.changes(ROWS, 3)) == {"damage", "parameters", "mass"}
    assert scenario.family is None
    assert np.isnan(scenario.severity)
    assert repr(scenario) == "Scenario('all', damage={'bottom': 0.2}, parameters={'top': 1.1}, mass=<23 matrix>)"


def test_what_counts_as_healthy():
    assert Scenario("healthy").is_healthy
    assert Scenario("no damage", {"bottom": 0.0}, parameters={"top": 1}).is_healthy
    for changed in ({"damage": {"bottom": 0.1}}, {"parameters": {"top": 1.1}}, {"mass": np.ones(23)}):
        assert not Scenario("changed", **changed).is_healthy
    assert not ProgressiveDamage("later", {"bottom": 0.1}, onset=3).is_healthy


def test_family_and_severity_come_from_a_single_group():
    assert (Scenario("a", {"top": 0.3}).family, Scenario("a", {"top": 0.3}).severity) == ("top", 0.3)
    assert Scenario("b", {"top": 0.3, "bottom": 0.3}).family is None
    ballast = Scenario("c", parameters={"mass": 1.02}, family="ballast", severity=0.02)
    assert (ballast.family, ballast.severity) == ("ballast", 0.02)
    assert [ProgressiveDamage("d", {"top": 0.3}, 3, end).family for end in (None, 5)] == ["top", None]


def test_scenarios_can_be_copied_and_pickled():
    lost = {"top": 0.3}
    for one in Scenario("a", lost), ProgressiveDamage("b", lost, 3, 5), UncertainDamage("c", pd.DataFrame([lost])):
        for twin in (copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
            assert repr(twin) == repr(one)
            np.testing.assert_array_equal(twin.changes(ROWS, 1)["damage"]["top"], one.changes(ROWS, 1)["damage"]["top"])


@pytest.mark.parametrize(
    ("onset", "end"), [(2, 6), ("2025-01-03", "2025-01-07"), (pd.Timestamp("2025-01-03"), 6), (2, "2025-01-07")]
)
def test_progressive_damage_grows_linearly_by_number_or_time(onset, end):
    grown = ProgressiveDamage("crack", {"top": 0.4, "bottom": 0.2}, onset, end).changes(DAYS)["damage"]
    np.testing.assert_allclose(grown["top"], np.clip((np.arange(10) - 2) / 4, 0, 1) * 0.4)
    np.testing.assert_allclose(grown["bottom"], grown["top"] / 2)


def test_progressive_damage_follows_time_where_records_are_in_disorder_and_may_be_sudden():
    rows = [7, 0, 3, 5]
    damage = ProgressiveDamage("crack", {"top": 0.4}, "2025-01-03", "2025-01-07")
    grown = damage.changes(DAYS.iloc[rows])["damage"]["top"]
    np.testing.assert_allclose(grown, damage.changes(DAYS)["damage"]["top"][rows])
    sudden = ProgressiveDamage("sudden", {"top": 0.4}, "2025-01-03 12:00").changes(DAYS)["damage"]["top"]
    np.testing.assert_allclose(sudden, np.repeat([0.0, 0.4], [3, 7]))


@pytest.mark.parametrize(
    ("rows", "onset", "end", "message"),
    [
        (ROWS, 10, None, "expected an onset that is not after the last record"),
        (ROWS, -1, None, "onset is -1 for 10 records; expected a position from 0$"),
        (ROWS, 4, 3, "an end that is not before it"),
        (ROWS, "2025-01-03", None, "onset is '2025-01-03' for 10 records; expected a position from 0$"),
        (DAYS, "soon", None, "onset is 'soon' for 10 records; expected a position from 0, or a time$"),
        (DAYS, "2026-01-01", None, "expected an onset that is not after the last record"),
        (DAYS.tz_localize("UTC"), "2025-01-03", None, "a time in the time zone UTC"),
    ],
)
def test_impossible_onsets_are_errors(rows, onset, end, message):
    with pytest.raises(ValueError, match=message):
        ProgressiveDamage("crack", {"top": 0.4}, onset, end).changes(rows)


def test_uncertain_damage_takes_its_draws_in_turn():
    damage = UncertainDamage("pier", pd.DataFrame({"top": [0.1, 0.2], "bottom": [0.3, 0.4]}))
    assert [damage.changes(ROWS, repeat)["damage"]["bottom"] for repeat in range(4)] == [0.3, 0.4, 0.3, 0.4]
    assert damage.n_draws == 2
    assert UncertainDamage("one", pd.DataFrame({"top": [0.1, 0.2]})).severity == pytest.approx(0.15)


def test_a_sweep_holds_every_group_at_every_severity():
    scenarios = sweep(make_truss(), (0.05, -0.15), groups=["top", "bottom"])
    assert [s.name for s in scenarios] == ["healthy", "top 5 %", "top -15 %", "bottom 5 %", "bottom -15 %"]
    assert [s.damage for s in scenarios[1:3]] == [{"top": 0.05}, {"top": -0.15}]
    assert [s.family for s in scenarios] == [None, "top", "top strengthened", "bottom", "bottom strengthened"]
    assert len(sweep(make_truss())) == 1 + 4 * 5
    assert {s.family for s in sweep(make_truss(), (-0.1, -0.2), ["top"])[1:]} == {"top"}
    assert len(sweep(make_truss(), ())) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scenario(""), "name is ''"),
        (lambda: Scenario("a", {"top": 30}), "expected finite shares of the stiffness below 1, not percent"),
        (lambda: Scenario("a", {"top": np.nan}), "expected finite shares"),
        (lambda: Scenario("a", {"top": [0.1, 0.2]}), r"has shape \(2,\); expected one number, or ProgressiveDamage"),
        (lambda: Scenario("a", "top"), "expected {group: severity}"),
        (lambda: UncertainDamage("a", [0.1]), "expected a frame"),
        (lambda: UncertainDamage("a", pd.DataFrame({"top": [0.1, 1.0]})), "expected finite shares"),
        (lambda: sweep(make_truss(), groups=["pier"]), r"groups names \['pier'\]; expected some of"),
        (lambda: sweep(object()), "has no damage groups"),
    ],
)
def test_impossible_scenarios_are_errors(make, message):
    with pytest.raises(ValueError, match=message):
        make()
