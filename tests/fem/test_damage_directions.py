"""Directions in which small losses of stiffness move the frequencies, as models and chains give them."""

import numpy as np
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import CallableModel
from skthermo.surrogate import DataInformedFEM

TRUSS = make_truss()


def test_a_function_has_the_directions_of_the_model_that_it_calls():
    model = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6, vectorized=True)
    asked = ["top", "bottom"]
    assert model.damage_directions(asked).to_numpy() == pytest.approx(
        TRUSS.damage_directions(asked, kind="stiffness").to_numpy(), abs=1e-5
    )


def test_a_chain_names_its_modes():
    campaign = make_truss_campaign(random_state=0)
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


def test_groups_that_move_nothing_are_refused():
    model = CallableModel(lambda row: [1.0, 2.0], ["E"], 2)
    with pytest.raises(ValueError, match="no loss of the groups"):
        model.damage_directions()
    with pytest.raises(ValueError, match="unknown damage groups"):
        TRUSS.damage_directions(["sideways"])
