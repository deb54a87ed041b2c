"""What a monitor knows, in a few lines for the owner."""

from __future__ import annotations

from typing import Any

import pandas as pd

from skthermo._tables.text import counted_number

MOST_EVENTS = 5  # that are told, the latest ones


def in_words(monitor: Any) -> str:
    """State, records, false-alarm rate, events, sensors and drift of a fitted monitor."""
    begin = f"State: {monitor.state()} ({monitor.last_})" if len(monitor.records_) else "No record since the baseline."
    counts, estimate = monitor.counts_, monitor.false_alarm_estimate_
    lines = [
        begin,
        f"Records: {counts['n_records']} since the baseline, {counts['n_not_evaluated']} not evaluated, "
        f"{counts['n_late']} late, {counts['n_too_late']} too late, {counts['n_ahead']} set aside as stamped too far "
        f"ahead, {counts['n_repeated']} repeated; {counts['n_left_out']} values left out.",
        f"Damage events open with {counted_number(estimate.rule.persistence, 'record')} in a row above "
        f"{monitor.threshold_:.4g} and close at or below {monitor.clear_threshold_:.4g}: {estimate}.",
        *_events(monitor.events_),
        *_sensors(monitor.faults_),
    ]
    if monitor.drift_ is not None:
        lines += _drift(monitor.drift_, monitor._state.corrections.drift.n_left_out)
    return "\n".join(lines)


def _events(events: pd.DataFrame) -> list[str]:
    """A line for each of the latest events."""
    if not len(events):
        return ["Events: none."]
    lines = [f"Event {number}: {_event(event)}." for number, event in events.iloc[-MOST_EVENTS:].iterrows()]
    n_earlier = len(events) - len(lines)
    return lines + ([f"{n_earlier} earlier events are in events_."] if n_earlier else [])


def _event(event: pd.Series) -> str:
    until = "still open" if pd.isna(event["end"]) else f"to {event['end']}"
    said = f", acknowledged as {'harmless' if event['harmless'] else 'not harmless'}" if event["acknowledged"] else ""
    note = f" ({event['note']})" if event["note"] else ""
    peak = f"highest index {event['peak']:.4g} on {event['peak_time']} by {event['modes']}"
    return f"{event['kind']} from {event['start']} {until}, {peak}{said}{note}"


def _sensors(faults: pd.DataFrame) -> list[str]:
    """A line for each fault that lasts."""
    lasting = faults[faults["until"].isna()]
    return [f"Sensor {fault['column']}: {fault['kind']} since {fault['since']}." for _, fault in lasting.iterrows()]


def _drift(drift: pd.DataFrame, n_left_out: int) -> list[str]:
    """A line for each group that drifts, and one where drift is not followed at present."""
    lines = [
        f"Drift of {group}: {one['change']:+.1%} so far, {one['per_year']:+.2%} a year"
        f"{'; beyond the limit' if one['beyond_limit'] else ''}."
        for group, one in drift[drift["significant"]].iterrows()
    ]
    if n_left_out:
        lines.append(
            f"Drift has not been followed for {counted_number(n_left_out, 'day')}: the frequencies changed at once."
        )
    return lines
