"""Losses of cross-section in chains, studies and identification: what they simulate, and what they name."""

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
from skthermo.detection import CompensatedDetector, DirectionalDetector
from skthermo.fem import CallableModel
from skthermo.studies import (
    DetectabilityStudy,
    ProgressiveDamage,
    Scenario,
    UncertainDamage,
    detection_task,
    identify_damage,
    sweep,
)
from skthermo.surrogate import with_model

YEAR, LATER = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1)
T = LATER.temperatures[:60]


def of_model(fem, damage):
    """Frequencies of the chain's model with losses of section, in the measured domain."""
    theta = np.asarray(fem.predict_parameters(T))
    clean = make_truss().damaged(damage, kind="section").frequencies(theta)
    return np.asarray(fem.aligner_.inverse_transform(clean)) * np.exp(fem.discrepancy_(T))


def test_a_chain_of_a_function_says_what_it_does_not_know(fem):
    model = CallableModel(make_truss().frequencies, make_truss().parameter_names, 6, vectorized=True)
    fem = with_model(fem, model)
    assert list(fem.damage_directions().index) == list(make_truss().groups)
    for call in (
        lambda: fem.simulate(T, damage={"bottom": 0.1}, kind="section"),
        lambda: fem.damage_directions(kind="section"),
        lambda: identify_damage(fem, T, LATER.frequencies[:60], kind="section"),
    ):
        with pytest.raises(ValueError, match="does not know the mass"):
            call()


def test_scenarios_hand_the_kind_on(fem):
    damage = {"bottom": 0.2}
    scenarios = [
        Scenario("section", damage, kind="section"),
        ProgressiveDamage("sudden", damage, onset=0, kind="section"),
        UncertainDamage("drawn", pd.DataFrame({"bottom": [0.2, 0.2]}), kind="section"),
    ]
    for scenario in scenarios:
        simulated = fem.simulate(T, **scenario.changes(T))
        assert np.asarray(simulated) == pytest.approx(of_model(fem, damage), rel=1e-9)
    names = [(one.name, one.family) for one in sweep(fem, (0.1, 0.2), ["bottom"], kind="section")][1:]
    assert names == [("bottom, section 10 %", "bottom, section"), ("bottom, section 20 %", "bottom, section")]
    assert "section" in repr(scenarios[0])
    assert "section" in repr(scenarios[2])
    with pytest.raises(ValueError, match="expected 'stiffness' or 'section'"):
        Scenario("x", damage, kind="mass")


@pytest.mark.nightly
def test_studies_find_the_loss_that_is_simulated(fem):
    detector = CompensatedDetector(DirectionalDetector(fem), targets=list(YEAR.frequencies))
    drawn = UncertainDamage("drawn", pd.DataFrame({"diagonal": [0.1, 0.1]}), kind="section")
    scenarios = [*sweep(fem, (0.1,), ["diagonal"]), *sweep(fem, (0.1,), ["diagonal"], kind="section")[1:], drawn]
    study = DetectabilityStudy(fem, detector, scenarios, n_repeats=2, random_state=0, uncertainty="noise")
    rates = study.run(LATER.temperatures).set_index("scenario")["rate"]
    assert rates["diagonal 10 %"] > rates["diagonal, section 10 %"] + 0.1
    assert rates["drawn"] == pytest.approx(rates["diagonal, section 10 %"], abs=1e-9)
    task = detection_task(fem, T, sweep(fem, (0.3,), ["diagonal"], kind="section"), noise=0.0, random_state=0)
    rows = task.X[list(YEAR.frequencies)].to_numpy()
    assert (np.abs(rows[:, np.newaxis] / of_model(fem, {"diagonal": 0.3}) - 1).max(axis=2) < 1e-9).any()


@pytest.mark.one_case
@pytest.mark.parametrize("with_structure", [False, True])
def test_shifts_are_explained_by_losses_of_section(fem, with_structure):
    some = LATER.temperatures if with_structure else LATER.temperatures[::5]
    F = fem.simulate(some, damage={"bottom": 0.2}, kind="section", noise=0.005, random_state=0)
    options = {"structure": truss_structure()} if with_structure else {}
    groups = ["bottom", "top", "diagonal"]
    found = identify_damage(fem, some, F, groups, kind="section", random_state=0, **options)
    assert found.damage["bottom"] == pytest.approx(0.2, abs=0.02)
    assert found.groups["probability"].idxmax() == "bottom"
    assert found.misfit_p_value > 0.05
    assert found.scenario().kind == "section"
    assert "of section" in found.summary()
    with pytest.warns(UserWarning, match="unexplained-shifts"):
        other = identify_damage(fem, some, F, groups, random_state=0)
    assert other.explained[0].misfit > found.explained[0].misfit


def test_campaigns_lose_section():
    lost = make_truss_campaign(damage={"bottom": 0.2}, kind="section", random_state=1)
    expected = lost.model.damaged({"bottom": 0.2}, kind="section").frequencies(lost.theta)
    assert lost.clean_frequencies.to_numpy() == pytest.approx(expected)
    from_half = {"damage": {"bottom": 0.2}, "damage_from": "2025-07-01"}
    later = make_truss_campaign(**from_half, kind="section", random_state=1).clean_frequencies
    assert later[-100:].to_numpy() == pytest.approx(expected[-100:])
