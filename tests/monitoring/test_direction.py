"""Softening distinguished from stiffening."""

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import FusedDetector, MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.monitoring._direction import Direction
from skthermo.surrogate import TemperatureMapper

MODES = [f"f{mode}" for mode in range(1, 7)]


def records(severity=0.0, seed=0, group="bottom"):
    campaign = make_truss_campaign(damage={group: severity}, random_state=seed)
    return campaign.temperatures.join(campaign.frequencies)


def compensated(last, whiten=None):
    return make_pipeline(TemperatureCompensator(TemperatureMapper(), targets=MODES, whiten=whiten), last)


@pytest.fixture(scope="module")
def baseline():
    return records()


@pytest.fixture(scope="module")
def windows(baseline):
    return compensated(WindowedAlarm("7D"), "global").fit(baseline)


@pytest.mark.parametrize("group", ["bottom", "top", "diagonal"])
def test_damage_is_softening_and_its_opposite_stiffening(group, baseline, windows):
    direction = Direction.of(windows, baseline, MODES)
    assert (direction.of_rows(records(0.1, 1, group))[7:] == 1).all()
    assert (direction.of_rows(records(-0.1, 1, group))[7:] == -1).all()


@pytest.mark.nightly
def test_it_does_not_depend_on_how_residuals_are_scaled(baseline):
    later = records(0.03, 2)
    signs = [
        Direction.of(compensated(MahalanobisDetector(), whiten).fit(baseline), baseline, MODES).of_rows(later)
        for whiten in (None, "global")
    ]
    assert np.mean(signs[0] == signs[1]) > 0.98
    assert signs[0].mean() > 0.3


def test_detectors_that_are_fused_tell_it_too(baseline):
    fused = FusedDetector([("one", compensated(MahalanobisDetector())), ("week", compensated(WindowedAlarm(7)))])
    direction = Direction.of(fused.fit(baseline), baseline, MODES)
    assert direction.of_rows(records(0.15, 3)).mean() > 0.9


def test_only_rows_that_are_asked_for_and_have_a_mode_are_evaluated(baseline, windows):
    later = records(0.2, 4)
    later.iloc[:30, 3:] = np.nan
    later.loc[later.index[40:80], ["f1", "f5"]] = np.nan
    wanted = np.arange(len(later)) % 2 == 0
    signs = Direction.of(windows, baseline, MODES).of_rows(later, wanted)
    assert (signs[~wanted] == 0).all()
    assert (signs[:30] == 0).all()
    assert (signs[30:][wanted[30:]] == 1).all()


def test_without_a_compensator_it_is_that_of_the_frequencies():
    random, index = np.random.default_rng(0), pd.date_range("2025-01-01", periods=400)
    F = pd.DataFrame(random.normal([4.0, 5.0, 9.0], 0.01, (400, 3)), index, ["a", "b", "c"])
    direction = Direction.of(MahalanobisDetector().fit(F), F, ["a", "b", "c"])
    moved = F.iloc[:6].assign(a=[3, 5, 4, 4, 3, 5], b=[5, 5, 6, 4, 4, 6], c=9.0)
    assert direction.of_rows(moved).tolist() == [1, -1, -1, 1, 1, -1]


def test_a_mixed_change_is_no_stiffening():
    random, index = np.random.default_rng(0), pd.date_range("2025-01-01", periods=400)
    F = pd.DataFrame(random.normal([4.0, 5.0, 9.0], 0.01, (400, 3)), index, ["a", "b", "c"])
    direction = Direction.of(MahalanobisDetector().fit(F), F, ["a", "b", "c"])
    moved = F.iloc[:2].assign(a=4.2, b=[4.9, 5.0], c=9.0)  # a rises by 20 deviations, b falls by 10 or stays
    assert direction.of_rows(moved).tolist() == [1, -1]
