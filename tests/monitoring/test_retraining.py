"""Laws of retraining: what may train, when a retrained detector takes over, and a new baseline after an intervention."""

import warnings
from copy import deepcopy

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.monitoring import Monitor

YEAR = 365


def joined(campaign):
    return campaign.temperatures.join(campaign.frequencies)


@pytest.fixture(scope="module")
def records():
    """Three years of the truss: healthy, damaged, and after the diagonals were strengthened."""
    states = {"healthy": {}, "damaged": {"bottom": 0.3}, "small": {"bottom": 0.06}, "repaired": {"diagonal": -0.15}}
    return {name: joined(make_truss_campaign(3, damage=damage, random_state=0)) for name, damage in states.items()}


def put_into_service(healthy, last=None):
    targets = [name for name in healthy if name.startswith("f")]
    compensator = TemperatureCompensator(LinearRegression(), targets=targets)
    detector = make_pipeline(compensator, last or MahalanobisDetector())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a year tells little of one alarm a year
        return Monitor(detector, sensors=False, random_state=0).fit(healthy[:YEAR])


def quietly(call, *args, **settings):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return call(*args, **settings)


@pytest.fixture(scope="module")
def fitted(records):
    return put_into_service(records["healthy"])


@pytest.fixture
def monitor(fitted):
    return deepcopy(fitted)


def with_damage(records, start, stop, kind="damaged"):
    """The year after the baseline, damaged between two days."""
    healthy = records["healthy"]
    return pd.concat([healthy[YEAR:start], records[kind][start:stop], healthy[stop : 2 * YEAR]])


def decisions(monitor, new):
    return quietly(deepcopy(monitor).update, new)


def test_a_healthy_year_joins_the_baseline(monitor, records):
    healthy = records["healthy"]
    quietly(monitor.update, healthy[YEAR : 2 * YEAR])
    found = quietly(monitor.refit)
    assert found.accepted and not found.reasons
    assert len(found.excluded) == 0
    pd.testing.assert_frame_equal(monitor.trained_, healthy[: 2 * YEAR], check_freq=False, check_index_type=False)
    assert (found.table.loc["smallest change found", ["old", "new"]] > 0).all()
    assert found.summary().startswith("Refit: accepted")


def test_nothing_new_changes_nothing(monitor, records):
    detector = monitor.detector_
    found = monitor.refit()
    assert not found.accepted and "no records" in found.reasons[0]
    assert monitor.detector_ is detector
    quietly(monitor.update, records["healthy"][YEAR : YEAR + 10])
    assert "weeks" in monitor.refit().reasons[0]
    assert monitor.detector_ is detector


def test_rows_of_an_event_train_only_if_it_was_harmless(monitor, records):
    quietly(monitor.update, with_damage(records, 450, 500))
    event = monitor.events_.iloc[0]
    assert event["kind"] == "damage" and event["end"] > event["start"]
    harvested = quietly(deepcopy(monitor).refit, force=True)
    margin = pd.Timedelta("7D")
    inside = harvested.baseline.index.to_series().between(event["start"] - margin, event["end"])
    assert not inside.any()
    left_out = harvested.excluded.iloc[0]
    assert left_out["n_records"] >= 57 and "not acknowledged" in left_out["reason"]
    monitor.acknowledge(1, harmless=False)
    assert "but not as harmless" in quietly(deepcopy(monitor).refit).excluded["reason"][0]
    monitor.acknowledge(1, harmless=True)
    kept = quietly(monitor.refit, force=True)
    assert kept.baseline.index.to_series().between(event["start"], event["end"]).sum() >= 50


def test_nothing_trains_after_an_open_event(monitor, records):
    quietly(monitor.update, with_damage(records, 600, 2 * YEAR))
    start = monitor.events_["start"].iloc[-1]
    assert pd.isna(monitor.events_["end"].iloc[-1])
    found = quietly(monitor.refit)
    assert found.baseline.index[-1] < start - pd.Timedelta("7D")
    assert "still open" in found.summary()
    assert monitor.state() == "alarm"


def test_a_past_event_would_still_be_found(monitor, records):
    quietly(monitor.update, with_damage(records, 450, 500))
    found = quietly(monitor.refit)
    assert found.accepted
    peak = found.table.loc["event 1, peak over threshold"]
    assert peak["old"] > 1 and peak["new"] > 1


def test_a_change_without_an_alarm_is_not_learned(monitor, records):
    after = records["small"]
    quietly(monitor.update, with_damage(records, 500, 2 * YEAR, "small"))
    monitor_events = len(monitor.events_)
    before, detector = decisions(monitor, after[2 * YEAR :]), monitor.detector_
    found = quietly(monitor.refit)
    if not monitor_events:  # else the change has been found, and its records are left out
        assert not found.accepted and "would not see that change" in found.reasons[0]
    assert monitor_events == 0
    assert monitor.detector_ is detector
    pd.testing.assert_frame_equal(decisions(monitor, after[2 * YEAR :]), before, check_exact=True)
    hidden = deepcopy(monitor)
    assert quietly(hidden.refit, force=True).accepted
    index = [decisions(one, after[2 * YEAR :])["index"].mean() for one in (monitor, hidden)]
    assert index[1] < index[0] - 0.05


def test_until_and_given_records(monitor, records):
    healthy = records["healthy"]
    quietly(monitor.update, healthy[YEAR : 2 * YEAR])
    until = healthy.index[500]
    found = quietly(monitor.refit, until=until, force=True)
    assert found.baseline.index[-1] == until
    other = quietly(monitor.refit, healthy[501:600], force=True)
    assert other.baseline.index[-1] == healthy.index[599]
    with pytest.raises(ValueError, match=r"lack the columns \['f1'\]"):
        monitor.refit(healthy.drop(columns="f1"))


def test_values_of_a_faulty_sensor_do_not_train(records):
    from skthermo.monitoring.retraining._harvest import Harvest

    healthy = records["healthy"][:100]
    faults = pd.DataFrame(
        {
            "column": ["T1", "T2"],
            "kind": ["stuck", "disagree"],
            "since": healthy.index[[20, 0]],
            "until": [healthy.index[40], pd.NaT],
        }
    )
    events = put_into_service(records["healthy"]).events_
    found = Harvest.of(healthy, events, faults)
    assert found.records["T1"].isna().sum() == 20 and found.records["T1"].isna()[20:40].all()
    pd.testing.assert_frame_equal(found.records.drop(columns="T1"), healthy.drop(columns="T1"))
    assert found.excluded[["columns", "n_records"]].to_numpy().tolist() == [["T1", 20]]


@pytest.mark.parametrize("last", [MahalanobisDetector(), WindowedAlarm("5D")])
def test_after_an_intervention_indices_are_as_before(records, last):
    healthy, repaired = records["healthy"], records["repaired"]
    monitor = put_into_service(healthy, last)
    start, days = repaired.index[YEAR], 21
    quietly(monitor.update, repaired[YEAR : YEAR + days])
    assert monitor.state() == "alarm"
    later = repaired[YEAR + days : 2 * YEAR]
    usual = put_into_service(healthy, last)
    quietly(usual.update, healthy[YEAR : YEAR + days])
    found = quietly(monitor.begin_again, start)
    assert found.accepted
    assert monitor.state() == "healthy"
    assert monitor.events_["end"].notna().all()
    fresh, old = decisions(monitor, later), decisions(usual, healthy[YEAR + days : 2 * YEAR])
    ratios = [float((one["index"] / one["threshold"]).median()) for one in (fresh, old)]
    assert ratios[0] == pytest.approx(ratios[1], rel=0.2)
    assert (fresh["state"] == "alarm").mean() < 0.03
    change = found.table["change"]
    truth = repaired.mean() / healthy.mean() - 1
    assert (np.abs(change - truth[change.index]) < 4 * found.table["standard_error"]).all()


def test_old_weeks_fade_as_days_come(monitor, records):
    repaired = records["repaired"]
    start = repaired.index[YEAR]
    monitor = deepcopy(monitor)
    counts = []
    for stop in (YEAR + 30, YEAR + 180, 2 * YEAR + 5):
        quietly(monitor.update, repaired[YEAR:stop])
        found = quietly(monitor.begin_again, start)
        counts.append((int((found.baseline.index < start).sum()), int((found.baseline.index >= start).sum())))
    old, new = zip(*counts, strict=True)
    assert list(new) == [30, 180, YEAR + 5]
    assert old[0] > 320 and 150 < old[1] < 220 and old[2] == 0
    assert monitor.prior_ is None and monitor.since_ == start


def test_a_refit_goes_on_with_a_new_baseline(monitor, records):
    repaired = records["repaired"]
    start = repaired.index[YEAR]
    quietly(monitor.update, repaired[YEAR : YEAR + 30])
    quietly(monitor.begin_again, start)
    quietly(monitor.update, repaired[YEAR + 30 : YEAR + 120])
    found = quietly(monitor.refit, force=True)
    own = found.baseline.index >= start
    assert own.sum() == 120 and 0 < (~own).sum() < 300
    pd.testing.assert_frame_equal(
        found.baseline[own], repaired[YEAR : YEAR + 120], check_freq=False, check_index_type=False
    )


def test_a_new_baseline_needs_every_mode_and_something_before(monitor, records):
    repaired = records["repaired"][YEAR : YEAR + 20].assign(f3=np.nan)
    quietly(monitor.update, repaired)
    found = quietly(monitor.begin_again, repaired.index[0])
    assert not found.accepted and "f3" in found.reasons[0]
    with pytest.raises(ValueError, match="expected a later time"):
        monitor.begin_again("2020-01-01")


def test_late_records_after_a_new_baseline(monitor, records):
    repaired = records["repaired"]
    late = repaired.index[YEAR + 17]
    new = repaired[YEAR : YEAR + 21]
    quietly(monitor.update, new.drop(late))
    quietly(monitor.begin_again, repaired.index[YEAR])
    answers = quietly(monitor.update, new.loc[[late]])
    assert answers.loc[late, "state"] == "healthy"
    assert monitor.state() == "healthy"
