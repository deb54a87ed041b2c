"""The detector of a monitor to which none is given."""

import copy

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import CompensatedDetector, DirectionalDetector, MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.surrogate import DataInformedFEM
from tests.monitoring.nightly import joined, quietly

MODES = [f"f{mode}" for mode in range(1, 7)]


def records(damage=None, seed=0, start="2025-01-01"):
    table = joined(make_truss_campaign(damage=damage, random_state=seed))
    return table.set_index(pd.date_range(start, periods=len(table), freq="1D"))


def fitted(**options):
    return quietly(Monitor(**options).fit, records())


@pytest.mark.nightly
def test_frequencies_have_directions_and_other_responses_have_none():
    by_unit = {unit: fitted(targets=MODES, units=unit).detector_ for unit in ("Hz", "mm")}
    assert all(isinstance(one, CompensatedDetector) for one in by_unit.values())
    assert by_unit["Hz"].detector.directions == "softening"
    assert type(by_unit["mm"].detector) is MahalanobisDetector
    mixed = fitted(targets=MODES, units=dict.fromkeys(MODES, "Hz") | {"f6": "mm"}).detector_
    assert type(mixed.detector) is MahalanobisDetector


@pytest.fixture(scope="module")
def fem():
    return DataInformedFEM(make_truss(), random_state=0).fit(records().drop(columns=MODES), records()[MODES])


LOSSES = {"bottom": 0.15, "top": 0.15, "diagonal": 0.1, "bottom ": -0.2}


@pytest.mark.parametrize(
    ("detector", "groups"),
    [
        (None, ["diagonal"]),
        pytest.param({"window": 7}, ["diagonal", "bottom "], marks=pytest.mark.nightly),
        pytest.param({"window": None}, [*LOSSES], marks=pytest.mark.nightly),
    ],
    ids=str,
)
def test_events_name_the_damage_groups_that_explain_them_and_none_of_what_is_no_loss(fem, detector, groups):
    if detector is not None:
        detector = CompensatedDetector(DirectionalDetector(fem), targets=MODES, **detector)
    fresh = fitted(detector=detector, fem=fem)
    last = fresh.detector_.detectors_[0]
    assert isinstance(last, DirectionalDetector)
    assert last.directions is fem
    assert list(last.directions_.index[:5]) == ["bottom", "top", "diagonal", "vertical", "bottom, section"]
    for group in groups:
        loss = LOSSES[group]
        changed = records({group.strip(): loss}, 1, "2026-01-01")[:28]
        whole, parts = copy.deepcopy(fresh), copy.deepcopy(fresh)
        answers, of_parts = whole.update(changed), [parts.update(changed[:20]), parts.update(changed[20:])]
        assert (answers["groups"] == pd.concat(of_parts)["groups"]).all()
        event = whole.events_.iloc[-1]
        assert event["kind"] == "damage"
        assert event["groups"].split(", ")[0] == (group if loss > 0 else "")
        assert event["size"] == pytest.approx(loss, rel=0.3) if loss > 0 else np.isnan(event["size"])
        status, names = whole.status("2026-01-29"), [name for name in event["groups"].split(", ") if name]
        assert (status.state, list(status.events[-1]["groups"])) == ("alarm", names)


def test_without_temperatures_the_detector_sees_the_responses_alone():
    monitor = quietly(Monitor(units="Hz", targets=MODES).fit, records()[MODES])
    assert isinstance(monitor.detector_, DirectionalDetector)
    with pytest.raises(ValueError, match="targets"):
        Monitor().fit(records())
