"""A monitor over time: what is drawn is what it said, and silence is seen."""

import numpy as np
import pandas as pd
import pytest

from skthermo.plotting import MonitorDisplay
from tests.reporting.monitors import FakeMonitor, event_row

FAULTS = pd.DataFrame(
    {
        "column": ["T1", "T1", "f2", "T2"],
        "kind": ["stuck", "dead", "swapped", "dead"],
        "since": pd.to_datetime(["2025-03-01", "2025-05-01", "2025-04-01", "2020-01-01"]),
        "detected": pd.to_datetime(["2025-03-05", "2025-05-02", "2025-04-02", "2020-01-02"]),
        "until": pd.to_datetime(["2025-04-01", None, "2025-05-01", "2020-02-01"]),
        "detail": "",
    }
)


def drawn_rows(display):
    return sum(int(np.isfinite(line.get_ydata()).sum()) for line in display.points_)


def test_days_without_an_evaluated_record_are_ticks_and_counted():
    monitor = FakeMonitor(freq="12h", n_days=80, n_not_evaluated=6)
    monitor.days_ = monitor.days_.drop(monitor.days_.index[10:14])  # four days without any record
    display = MonitorDisplay.from_estimator(monitor)
    (ticks,) = [line for line in display.ax_.lines if line.get_gid() == "not evaluated"]
    assert len(ticks.get_xdata()) == 3 + 4
    assert "7 days not evaluated" in [text.get_text() for text in display.ax_.texts]
    assert drawn_rows(display) == monitor.days_["n_evaluated"].gt(0).sum()
    assert display.threshold_line_.get_ydata()[0] == monitor.threshold_


def test_records_in_alarm_have_a_colour_and_a_marker_of_their_own():
    monitor = FakeMonitor(zone="Europe/Brussels")
    monitor.evaluations_.loc[monitor.evaluations_.index[-5:], "state"] = "alarm"
    display = MonitorDisplay.from_estimator(monitor, by="record", start="2025-06-01", end=monitor.last_)
    quiet, alarm = display.points_
    assert len(alarm.get_xdata()) == 5
    assert len(quiet.get_xdata()) == (monitor.evaluations_.index >= "2025-06-01").sum() - 5
    assert alarm.get_marker() != quiet.get_marker()
    assert alarm.get_color() != quiet.get_color()
    np.testing.assert_array_equal(alarm.get_ydata(), monitor.evaluations_["index"].iloc[-5:])


def test_a_new_threshold_is_a_step_on_the_day_of_its_first_record():
    monitor = FakeMonitor(freq="12h", n_days=60)
    monitor.evaluations_.loc[monitor.evaluations_.index[31:], "threshold"] = 5.0  # from noon of the sixteenth day
    steps = MonitorDisplay.from_estimator(monitor).threshold_line_.get_ydata()
    np.testing.assert_array_equal(steps, [3.0] * 15 + [5.0] * 15)
    steps = MonitorDisplay.from_estimator(monitor, by="record").threshold_line_.get_ydata()
    np.testing.assert_array_equal(steps, monitor.evaluations_["threshold"])


def test_a_watch_has_its_own_threshold_and_shade():
    events = [event_row("2025-02-01", "2025-02-08", kind="watch"), event_row("2025-06-20", None)]
    display = MonitorDisplay.from_estimator(FakeMonitor(events=events, watch_per_year=12))
    watch, damage = display.event_spans_
    assert watch.get_label() == "watch event"
    assert watch.get_hatch() != damage.get_hatch()
    (lower,) = [line for line in display.ax_.lines if line.get_label() == "threshold of a watch"]
    assert lower.get_ydata()[0] == 2.5 < display.threshold_line_.get_ydata()[0]


def test_each_panel_has_a_legend_of_its_own():
    drift = pd.DataFrame({"change": [-0.1, 0.0], "standard_error": 0.01}, index=["deck", "piers"])
    display = MonitorDisplay.from_estimator(FakeMonitor(drift=drift, faults=FAULTS))
    assert display.figure_.legends == []
    index, changes = ([text.get_text() for text in ax.get_legend().get_texts()] for ax in display.axes_[:2])
    assert changes == ["deck", "piers", "± 2 standard errors"]
    assert not set(index) & set(changes)
    assert display.axes_[2].get_legend() is None
    assert "since baseline" in display.axes_[1].get_ylabel()


def test_events_are_shaded_until_they_end_and_open_ones_to_the_end_of_the_axis():
    rows = [
        event_row("2025-02-01", "2025-02-08"),
        event_row("2025-03-01", "2025-03-04", acknowledged=True, harmless=True),
        event_row("2025-06-20", None, kind="measurement or structure"),
        event_row("2024-06-01", "2024-06-02"),  # before the first day that is drawn
    ]
    display = MonitorDisplay.from_estimator(FakeMonitor(events=rows))
    labels = [span.get_label() for span in display.event_spans_]
    assert labels == ["damage event", "event marked as harmless", "measurement or structure event"]
    widths = [span.get_width() for span in display.event_spans_]
    assert widths[:2] == [7, 3]
    last = display.event_spans_[2]
    assert last.get_x() + last.get_width() == display.ax_.get_xlim()[1]
    hatches = {span.get_hatch() for span in display.event_spans_}
    assert len(hatches) == 3  # distinguished without colour


def test_drift_in_percent_and_bars_of_failed_sensors():
    errors = {"standard_error": [0.002, 0.001], "change": [-0.02, 0.001]}
    monitor = FakeMonitor(drift=pd.DataFrame(errors, ["deck", "piers"]), faults=FAULTS)
    display = MonitorDisplay.from_estimator(monitor)
    assert display.parts == ["index", "drift", "sensors"]
    np.testing.assert_allclose(display.drift_lines_[0].get_ydata(), 100 * monitor.days_["drift deck"])
    assert "%" in display.axes_[1].get_ylabel()
    assert [label.get_text() for label in display.axes_[2].get_yticklabels()] == ["T1", "f2"]
    assert len(display.fault_bars_) == 3
    assert MonitorDisplay.from_estimator(monitor, parts=["sensors"], start="2025-04-10").parts == ["sensors"]


def test_what_cannot_be_drawn_is_said():
    monitor = FakeMonitor()
    with pytest.raises(ValueError, match=r"parts are \['drift'\]; expected some of \['index'\]"):
        MonitorDisplay.from_estimator(monitor, parts=["drift"])
    with pytest.raises(ValueError, match="there is no day between 2030-01-01 and None"):
        MonitorDisplay.from_estimator(monitor, start="2030-01-01")
    with pytest.raises(ValueError, match="by is 'hour'; expected 'day' or 'record'"):
        MonitorDisplay.from_estimator(monitor, by="hour")
    with pytest.raises(ValueError, match=r"without \['days_', 'events_', 'threshold_'\]; expected a fitted Monitor"):
        MonitorDisplay.from_estimator(object())
