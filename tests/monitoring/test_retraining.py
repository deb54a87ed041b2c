"""Laws of retraining: what may train, when a new detector takes over, and a new baseline after an intervention."""

from copy import deepcopy

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.monitoring import Monitor
from tests.monitoring.nightly import joined, quietly

YEAR = 365
STATES = {"healthy": {}, "damaged": {"bottom": 0.3}, "small": {"bottom": 0.015}, "repaired": {"diagonal": -0.15}}
SAME = {"check_freq": False, "check_index_type": False}
WEEK = pd.Timedelta("7D")


def put_into_service(healthy):
    targets = [name for name in healthy if name.startswith("f")]
    detector = make_pipeline(TemperatureCompensator(LinearRegression(), targets=targets), MahalanobisDetector())
    return quietly(Monitor(detector, sensors=False, random_state=0, persistence=1).fit, healthy[:YEAR])


def decisions(monitor, new):
    return quietly(deepcopy(monitor).update, new)


@pytest.fixture(scope="module")
def records():
    """Three years of the truss in some states, with the same weather and noise."""
    return {name: joined(make_truss_campaign(3, damage=damage, random_state=0)) for name, damage in STATES.items()}


@pytest.fixture(scope="module")
def fitted(records):
    return put_into_service(records["healthy"])


@pytest.fixture
def monitor(fitted):
    return deepcopy(fitted)


@pytest.fixture(scope="module")
def renewed(fitted, records):
    """A monitor with a new baseline three weeks after an intervention, one of whose records comes later."""
    monitor, new = deepcopy(fitted), records["repaired"][YEAR : YEAR + 21]
    quietly(monitor.update, new.drop(new.index[17]))
    return monitor, quietly(monitor.rebaseline, new.index[0])


@pytest.mark.nightly
def test_a_healthy_year_joins_the_baseline(monitor, records):
    healthy = records["healthy"]
    quietly(monitor.update, healthy[YEAR : 2 * YEAR])
    found = quietly(monitor.refit)
    assert found.accepted
    assert not found.reasons
    assert len(found.excluded) == 0
    pd.testing.assert_frame_equal(monitor.trained_, healthy[: 2 * YEAR], **SAME)
    assert (found.table["change"].abs() < 4 * found.table["standard_error"]).all()
    assert found.summary().startswith("Refit: accepted")


def test_nothing_new_changes_nothing(monitor, records):
    detector = monitor.detector_
    found = monitor.refit()
    assert not found.accepted
    assert "no records" in found.reasons[0]
    quietly(monitor.update, records["healthy"][YEAR : YEAR + 10])
    assert "weeks" in monitor.refit().reasons[0]
    assert monitor.detector_ is detector


@pytest.mark.nightly
def test_rows_of_an_event_never_train(monitor, records):
    healthy, damaged = records["healthy"], records["damaged"][450:500]  # seven weeks
    quietly(monitor.update, pd.concat([healthy[YEAR:450], damaged, healthy[500 : 2 * YEAR]]))
    event = monitor.events_.loc[1]
    found = quietly(monitor.refit)
    assert not found.baseline.index.to_series().between(event["start"] - WEEK, event["end"]).any()
    left_out = found.excluded.iloc[0]
    assert left_out["n_records"] >= 57
    assert "not acknowledged" in left_out["reason"]


@pytest.mark.nightly
def test_a_change_without_an_alarm_is_not_learned(monitor, records):
    changed = records["small"]
    quietly(monitor.update, pd.concat([records["healthy"][YEAR:500], changed[500:720]]))
    assert not len(monitor.events_)
    before, detector = decisions(monitor, changed[720:]), monitor.detector_
    found = quietly(monitor.refit)
    assert not found.accepted
    assert "would not detect that change" in found.reasons[0]
    assert monitor.detector_ is detector
    pd.testing.assert_frame_equal(decisions(monitor, changed[720:]), before, check_exact=True)
    change, new = found.table["change"], found.baseline[found.baseline.index >= changed.index[YEAR]]
    truth = (new / records["healthy"].loc[new.index]).mean() - 1  # some of the new records are from before the change
    assert (np.abs(change - truth[change.index]) < 4 * found.table["standard_error"]).all()
    assert quietly(monitor.refit, until=changed.index[495], force=True).baseline.index[-1] == changed.index[495]


def test_after_an_intervention_indices_are_as_before(renewed, fitted, records):
    monitor, found = renewed
    assert found.accepted
    assert monitor.status(monitor.last_).state == "healthy"
    assert monitor.events_["end"].notna().all()
    assert monitor.events_["note"].str.contains("new baseline").any()
    what = [one["what"] for one in monitor.transitions()]
    assert "closed" in what[what.index("rebaseline") :]
    later = slice(YEAR + 21, 2 * YEAR)
    fresh, old = decisions(monitor, records["repaired"][later]), decisions(fitted, records["healthy"][later])
    ratios = [float((one["index"] / one["threshold"]).median()) for one in (fresh, old)]
    assert ratios[0] == pytest.approx(ratios[1], rel=0.1)
    assert (fresh["state"] == "alarm").mean() < 0.03
    change, truth = found.table["change"], records["repaired"].mean() / records["healthy"].mean() - 1
    assert (np.abs(change - truth[change.index]) < 4 * found.table["standard_error"]).all()


def test_late_records_after_a_new_baseline(renewed, records):
    monitor, late = deepcopy(renewed[0]), records["repaired"].iloc[[YEAR + 17]]
    assert set(quietly(monitor.update, late)["state"]) == {"healthy"}
    assert monitor.status(monitor.last_).state == "healthy"


@pytest.mark.nightly
def test_a_refit_goes_on_with_a_new_baseline_and_old_weeks_fade(renewed, records):
    monitor, start = deepcopy(renewed[0]), renewed[1].since
    counts = [renewed[1].baseline.index]
    for first, stop in ((YEAR + 21, YEAR + 120), (YEAR + 120, 2 * YEAR + 5)):
        quietly(monitor.update, records["repaired"][first:stop])
        counts.append(quietly(monitor.refit, force=True).baseline.index)
    old = [int((index < start).sum()) for index in counts]
    assert [int((index >= start).sum()) for index in counts] == [20, 119, YEAR + 4]
    assert 320 < old[0] < YEAR - 14
    assert 200 < old[1] < 280
    assert old[2] == 0
    assert monitor.prior_ is None


@pytest.mark.nightly
def test_a_second_intervention_begins_from_the_first(renewed, records):
    monitor = deepcopy(renewed[0])
    both = joined(make_truss_campaign(2, damage={"diagonal": -0.15, "bottom": -0.2}, random_state=0))
    quietly(monitor.update, both[YEAR + 21 : YEAR + 51])
    found = quietly(monitor.rebaseline, both.index[YEAR + 21])
    truth = both.mean() / records["repaired"].mean() - 1
    assert (np.abs(found.table["change"] - truth[found.table.index]) < 4 * found.table["standard_error"]).all()
    assert monitor.status(monitor.last_).state == "healthy"
    assert (found.baseline.index >= found.since).sum() == 30


def test_a_new_baseline_needs_every_mode_and_something_before(monitor, records):
    repaired = records["repaired"][YEAR : YEAR + 20].assign(f3=np.nan)
    quietly(monitor.update, repaired)
    found = quietly(monitor.rebaseline, repaired.index[0])
    assert not found.accepted
    assert "f3" in found.reasons[0]
    with pytest.raises(ValueError, match="expected a later time"):
        monitor.rebaseline("2020-01-01")
