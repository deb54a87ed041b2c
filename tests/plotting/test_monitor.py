"""A monitor over time: what is drawn is what it said, and silence is seen."""

import numpy as np
import pytest

from skthermo.plotting import DamageIndexDisplay
from tests.reporting.monitors import FakeMonitor, event_row


def test_days_without_an_evaluated_record_are_ticks_and_counted():
    monitor = FakeMonitor(n_days=80, n_not_evaluated=3)
    monitor.days_ = monitor.days_.drop(monitor.days_.index[10:14])  # four days without any record
    display = DamageIndexDisplay.from_estimator(monitor)
    (ticks,) = [line for line in display.ax_.lines if line.get_gid() == "not evaluated"]
    assert len(ticks.get_xdata()) == 3 + 4
    assert "7 not evaluated" in [text.get_text() for text in display.ax_.texts]
    n_drawn = sum(int(np.isfinite(line.get_ydata()).sum()) for line in display.points_[""])
    assert n_drawn == monitor.days_["n_evaluated"].gt(0).sum()
    assert display.threshold_lines_[0].get_ydata()[0] == monitor.threshold_


def test_records_in_alarm_have_a_colour_and_a_marker_of_their_own():
    monitor = FakeMonitor(zone="Europe/Brussels")
    monitor.evaluations_.loc[monitor.evaluations_.index[-5:], "state"] = "alarm"
    display = DamageIndexDisplay.from_estimator(monitor, by="record", start="2025-06-01", end=monitor.last_)
    quiet, alarm = display.points_[""]
    assert len(alarm.get_xdata()) == 5
    assert len(quiet.get_xdata()) == (monitor.evaluations_.index >= "2025-06-01").sum() - 5
    assert alarm.get_marker() != quiet.get_marker()
    assert alarm.get_color() != quiet.get_color()
    np.testing.assert_array_equal(alarm.get_ydata(), monitor.evaluations_["index"].iloc[-5:])


def test_a_new_threshold_is_a_step_at_its_first_record():
    monitor = FakeMonitor(n_days=60)
    monitor.evaluations_.loc[monitor.evaluations_.index[31:], "threshold"] = 5.0
    for by in ("day", "record"):
        (line,) = DamageIndexDisplay.from_estimator(monitor, by=by).threshold_lines_
        np.testing.assert_array_equal(line.get_ydata(), monitor.evaluations_["threshold"])
        assert line.get_drawstyle() == "steps-post"


def test_a_watch_has_its_own_threshold_and_shade():
    events = [event_row("2025-02-01", "2025-02-08", kind="watch"), event_row("2025-06-20", None)]
    display = DamageIndexDisplay.from_estimator(FakeMonitor(events=events, watch_per_year=12))
    watch, damage = display.event_spans_
    assert watch.get_label() == "watch event"
    assert watch.get_hatch() != damage.get_hatch()
    (lower,) = [line for line in display.ax_.lines if line.get_label() == "threshold of a watch"]
    assert lower.get_ydata()[0] == 2.5 < display.threshold_lines_[0].get_ydata()[0]


def test_events_are_shaded_until_they_end_and_open_ones_to_the_last_day():
    rows = [
        event_row("2025-02-01", "2025-02-08"),
        event_row("2025-03-01", "2025-03-04", acknowledged=True, harmless=True),
        event_row("2025-06-20", None, kind="fault"),
        event_row("2024-06-01", "2024-06-02"),  # before the first day that is drawn
    ]
    monitor = FakeMonitor(events=rows)
    display = DamageIndexDisplay.from_estimator(monitor)
    labels = [span.get_label() for span in display.event_spans_]
    assert labels == ["damage event", "event marked as harmless", "fault event"]
    n_days = (monitor.days_.index[-1] - monitor.events_["start"].iloc[2]).days + 1
    assert [span.get_width() for span in display.event_spans_] == [7, 3, n_days]
    assert len({span.get_hatch() for span in display.event_spans_}) == 3  # distinguished without colour


def test_a_time_without_records_and_what_is_no_monitor_are_refused():
    monitor = FakeMonitor()
    with pytest.raises(ValueError, match="there is no day between 2030-01-01"):
        DamageIndexDisplay.from_estimator(monitor, start="2030-01-01")
    with pytest.raises(ValueError, match="by is 'hour'; expected 'day' or 'record'"):
        DamageIndexDisplay.from_estimator(monitor, by="hour")
    with pytest.raises(ValueError, match="expected a fitted Monitor, or records for a detector"):
        DamageIndexDisplay.from_estimator(object())
