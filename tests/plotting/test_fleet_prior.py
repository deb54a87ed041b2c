"""What a fleet knows of a thermal behaviour, and what a new bridge makes of it."""

from io import BytesIO
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from skthermo.plotting import FleetPriorDisplay

HOSTILE = "$E_{x$ & 50% <b>"
SLOPES = {HOSTILE: -0.003, "B": -0.001}


class Prior:
    """Straight laws whose slopes scatter by 0.0005 about -0.002."""

    comparison_ = pd.DataFrame({"is_pooled": [True, False]}, ["deck", "soil"])
    reach_ = SimpleNamespace(lowest=np.array([-20.0, -10.0]), highest=np.array([25.0, 30.0]))

    def effects(self, temperatures, family=None, *, reference=None):
        d = np.asarray(temperatures) - reference
        lines = {name: slope * d for name, slope in SLOPES.items()}
        return pd.DataFrame({"mean": -0.002 * d, "standard_deviation": abs(0.0005 * d), **lines}, temperatures)


class Mapper:
    """A new bridge whose slope is -0.0025, within 0.0001."""

    prior, families_ = Prior(), {"floor": "deck", "piles": "soil", "pylon": None}
    own_range_ = SimpleNamespace(lowest=np.array([-5.0, -4.0]), highest=np.array([8.0, 10.0]))
    reach_ = Prior.reach_

    def effects(self, temperatures, name=None, *, reference=None):
        d = np.asarray(temperatures) - reference
        return pd.DataFrame({"mean": -0.0025 * d, "standard_deviation": abs(0.0001 * d)}, temperatures)


def drawn(line):
    return np.array(line.get_data())


def test_a_fleet_is_drawn_relative_to_the_middle_of_its_weather():
    display = FleetPriorDisplay.from_estimator(Prior())
    T, change = drawn(display.fleet_line_)
    assert (T[0], T[-1]) == (-20.0, 30.0)
    np.testing.assert_allclose(change, 100 * np.expm1(-0.002 * (T - 5.0)))
    for name, slope in SLOPES.items():
        np.testing.assert_allclose(drawn(display.bridge_lines_[name])[1], 100 * np.expm1(slope * (T - 5.0)))
    low, high = (100 * np.expm1((-0.002 + two * 0.0005) * 25) for two in (-2, 2))
    at_end = [vertex[1] for vertex in display.fleet_band_.get_paths()[0].vertices if vertex[0] == 30.0]
    np.testing.assert_allclose([min(at_end), max(at_end)], [low, high])
    assert display.own_line_ is display.own_band_ is None
    assert display.ax_.get_ylabel() == "change of deck (%)"
    display.figure_.savefig(BytesIO(), format="png")


def test_a_new_bridge_is_drawn_with_the_ends_of_its_own_records():
    display = FleetPriorDisplay.from_estimator(Mapper())
    T, change = drawn(display.own_line_)
    np.testing.assert_allclose(change, 100 * np.expm1(-0.0025 * (T - 2.0)))
    ends = [line.get_xdata()[0] for line in display.ax_.lines if line.get_linestyle() == ":"]
    assert ends == [-4.0, 8.0]  # what all inputs have seen
    assert display.ax_.get_title() == ""


def test_a_mapper_is_found_within_a_chain():
    chain = SimpleNamespace(mapper_=make_pipeline(FunctionTransformer(), Mapper()))
    display = FleetPriorDisplay.from_estimator(chain, "piles", temperatures=[3.0, -7.0], reference=0.0)
    assert drawn(display.own_line_)[0].tolist() == [-7.0, 3.0]
    assert "not pooled" in display.ax_.get_title()
    alone = FleetPriorDisplay.from_estimator(chain, "pylon")
    assert np.isnan(drawn(alone.fleet_line_)[1]).all()
    assert np.isfinite(drawn(alone.own_line_)[1]).all()
    mapper = Mapper()
    mapper.prior = None
    assert "not pooled" in FleetPriorDisplay.from_estimator(mapper).ax_.get_title()


def test_it_draws_into_given_axes_and_refuses_what_has_no_prior():
    ax = plt.figure().subplots()
    assert FleetPriorDisplay.from_estimator(Prior(), "soil", ax=ax).ax_ is ax
    with pytest.raises(ValueError, match=r"name is 'arch'; expected one of \['deck', 'soil'\]"):
        FleetPriorDisplay.from_estimator(Prior(), "arch")
    with pytest.raises(ValueError, match="expected a fitted FleetPrior or FleetMapper"):
        FleetPriorDisplay.from_estimator(SimpleNamespace(mapper_=FunctionTransformer()))
