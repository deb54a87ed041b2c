"""The state of a monitored structure at a given time, as plain facts for machines and pages, and in a few lines."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

import pandas as pd

from skthermo._core.frames import DAY, as_moment, check_duration, usual_step
from skthermo._core.text import counted, duration_text, plain, probability_text


@dataclass(frozen=True)
class RecordTimes:
    """When records came, and how many.

    Parameters
    ----------
    baseline_end : Timestamp or None
        Stamp of the last record of the baseline.
    newest : Timestamp or None
        Stamp of the newest record since the baseline; None if none has come.
    evaluated : Timestamp or None
        Stamp of the newest record that was evaluated.
    age : Timedelta or None
        From the newest record, or from the last one of the baseline if none has come since, to the time of the status.
    max_age : Timedelta or None
        Age beyond which nothing is healthy.
    step : Timedelta or None
        Usual time between records.
    counts : dict or None
        As ``counts_`` of a monitor.
    """

    baseline_end: pd.Timestamp | None = None
    newest: pd.Timestamp | None = None
    evaluated: pd.Timestamp | None = None
    age: pd.Timedelta | None = None
    max_age: pd.Timedelta | None = None
    step: pd.Timedelta | None = None
    counts: dict | None = None

    @property
    def is_late(self) -> bool:
        """Whether the newest record is older than ``max_age``."""
        return self.age is not None and self.max_age is not None and self.age > self.max_age

    @property
    def is_ahead(self) -> bool:
        """Whether the newest record is of a time to come, by more than a day."""
        return self.age is not None and self.age < -DAY

    def __str__(self) -> str:
        n = defaultdict(int, self.counts or {})
        return (
            f"{n['n_records']} since the baseline, {n['n_not_evaluated']} not evaluated, {n['n_late']} late, "
            f"{n['n_too_late']} too late, {n['n_ahead']} set aside as stamped too far ahead, {n['n_repeated']} "
            f"repeated; {n['n_left_out']} values left out"
        )


@dataclass(frozen=True)
class AlarmLevels:
    """Damage indices at which events open and close, and what they were chosen for.

    Parameters
    ----------
    threshold, clear_threshold : float or None
        A damage event opens with indices above the first, and closes at or below the second.
    watch_threshold : float or None
        The index is raised above it; None where no such level was asked for.
    false_alarms_per_year, watch_per_year : float or None
        Number of events a year of a healthy structure, for which the thresholds were set.
    smallest_change : dict or None
        Falls of the responses that raise an alarm in the weather of the baseline: ``common`` (of all by one share),
        ``single`` (of each alone, by name), ``groups`` (losses of stiffness by damage group), and ``within`` how many
        seconds. Shares of the mean, or in the unit of the response where not all are positive; None where none is seen.
    """

    threshold: float | None = None
    clear_threshold: float | None = None
    watch_threshold: float | None = None
    false_alarms_per_year: float | None = None
    watch_per_year: float | None = None
    smallest_change: dict | None = None

    def __str__(self) -> str:
        if self.threshold is None:
            return "not known"
        watch = "" if self.watch_threshold is None else f"; watch: opens above {self.watch_threshold:.4g}"
        return f"open above {self.threshold:.4g}, close at or below {self.clear_threshold:.4g}{watch}"


@dataclass(frozen=True)
class MonitorStatus:
    """The state of a monitored structure, and the facts behind it.

    `Monitor.status` and `~skthermo.monitoring.Fleet.status` give it; `as_dict` makes it plain values, as JSON has them.

    Parameters
    ----------
    state : {"healthy", "watch", "drift", "known damage", "alarm", "not evaluated"}
        "alarm" while the index is in an event of damage, or a response is set aside in an event of kind "fault"; else
        "drift" while the mean of the last 30 days has moved, or "watch" while the index is raised; "known damage" after
        damage that the owner has confirmed. Nothing is healthy if the newest record is too old, of a time to come, or
        was not evaluated.
    reason : str
        Why it is not evaluated, or what else is worth saying of the newest record; "" if nothing is.
    now : Timestamp or None
        Time of the status.
    records : RecordTimes
        When records came: ``baseline_end``, ``newest``, ``evaluated`` (the newest that was), ``age``, ``max_age``,
        ``step`` and ``counts``; ``is_late`` and ``is_ahead``.
    index : float or None
        Damage index of the newest record that was evaluated.
    levels : AlarmLevels
        Levels of events: ``threshold``, ``clear_threshold``, ``watch_threshold``, ``false_alarms_per_year``,
        ``watch_per_year`` and ``smallest_change``.
    events : tuple of dict
        Events that are open: ``event`` (the number in ``events_``), ``kind``, ``since``, and ``peak``, ``modes``,
        ``groups``, ``size``, ``n_times``, ``acknowledged`` and ``harmless`` of its row. An event that has grown far
        beyond what it was is not acknowledged any longer.
    faults : tuple of dict
        Sensors that have failed and still do: ``column``, ``kind``, ``since`` and ``detail``.
    transition : int
        Number of the newest entry in `Monitor.transitions`; 0 if there is none.

    See Also
    --------
    Monitor.transitions : What has changed, one entry after the other.

    Notes
    -----
    Keys of `as_dict` are the names above, with the names in ``records`` and ``levels`` side by side with the others.
    Times are texts of ISO 8601, in the time zone of the records; ``age``, ``max_age`` and ``step`` are in seconds; what
    is not known is None. Of a bridge without a monitor, ``state`` is "not evaluated", with the reason, and the numbers
    are None.

    Examples
    --------
    >>> from skthermo.monitoring import MonitorStatus
    >>> status = MonitorStatus("not evaluated", "there is no monitor")
    >>> status.as_dict()["state"], status.as_dict()["newest"]
    ('not evaluated', None)
    """

    state: str
    reason: str = ""
    now: pd.Timestamp | None = None
    records: RecordTimes = RecordTimes()
    index: float | None = None
    levels: AlarmLevels = AlarmLevels()
    events: tuple = ()
    faults: tuple = ()
    transition: int = 0

    def at(self, now: Any = None, *, max_age: str | timedelta | None = None) -> MonitorStatus:
        """The status at a later time, with no record since.

        Parameters
        ----------
        now : str or datetime, optional
            The time. By default the computer's clock tells it; if the records have no time zone, the local time.
        max_age : str or timedelta, optional
            Age of the newest record beyond which nothing is healthy. By default the usual time between records, and
            two days more.

        Returns
        -------
        MonitorStatus
            An alarm or a drift stays one; any other state becomes "not evaluated" where the newest record is too old,
            or of a time to come.

        Raises
        ------
        ValueError
            If ``now`` is no time, or has a time zone where the records have none; if ``max_age`` is no duration.
        """
        records = self.records
        last = records.newest or records.baseline_end
        if last is None:
            return replace(self, now=as_moment(now, None))
        now = as_moment(now, last.tz)
        limit = (records.step or DAY) + 2 * DAY if max_age is None else check_duration(max_age, "max_age")
        records = replace(records, age=now - last, max_age=limit)
        status = replace(self, now=now, records=records)
        if records.newest is None:
            doubt = f"no record has come since the baseline, which ends on {last}"
        elif records.is_ahead:
            doubt = f"the newest record is of {last}, a time after {now.floor('s')}"
        elif records.is_late:
            age, longest = duration_text(records.age), duration_text(limit)
            doubt = f"the newest record, of {last}, is {age} old; expected one of the last {longest}"
        else:
            return status
        stays = self.state in ("alarm", "drift")
        return replace(status, state=self.state if stays else "not evaluated", reason=doubt)

    def __str__(self) -> str:
        lines = [f"state: {self.state}" + (f" ({self.reason})" if self.reason else "")]
        lines += [f"records: {self.records}", f"damage events: {self.levels}"]
        lines += [f"event {one['event']}: {one['kind']} since {one['since']}, still open" for one in self.events]
        lines += [f"sensor: {one['column']} {one['kind']} since {one['since']}" for one in self.faults]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Plain values by name, as a JSON file holds them.

        Returns
        -------
        dict
            Texts, numbers, lists and dicts; None for what is not known.
        """
        flat = vars(self) | vars(self.records) | vars(self.levels)
        return {name: plain(value) for name, value in flat.items() if name not in ("records", "levels")}


def state_of(standing: str, is_set_aside: bool, newest: str) -> str:
    """How the structure is by its open events, else by the state of the newest record."""
    if standing in ("alarm", "drift") or is_set_aside:
        return "drift" if standing == "drift" and not is_set_aside else "alarm"
    return "watch" if standing == "watch" else "not evaluated" if newest == "alarm" else newest


def status_of(monitor: Any) -> MonitorStatus:
    """The status of a fitted monitor by its records alone, whatever the time is."""
    evaluations, events, baseline = monitor.evaluations_, monitor.events_, monitor.baseline_.index
    known, faults = evaluations[evaluations["state"] != "not evaluated"], monitor.faults_
    opened = events[events["end"].isna()].rename_axis("event").reset_index().rename(columns={"start": "since"})
    for name in ("modes", "groups"):
        opened[name] = pd.Series([[one for one in text.split(", ") if one] for text in opened[name]], dtype=object)
    opened["size"] = opened["size"].astype(object).where(opened["size"].notna(), None)
    state = "not evaluated"
    if len(evaluations):
        found = monitor.known_events_
        last = found.standing.iloc[-1]
        state = state_of(last["state"], last["is_unexplained"], evaluations["state"].iloc[-1])
        opened["acknowledged"] &= (opened["event"] != last["event"]) | (last["state"] not in ("alarm", "drift"))
    shown = ["event", "kind", "since", "peak", "modes", "groups", "size", "n_times", "acknowledged", "harmless"]
    failed = faults[faults["until"].isna()].astype({"column": str})
    levels = ("threshold_", "clear_threshold_", "watch_threshold_", "false_alarms_per_year", "watch_per_year")
    return MonitorStatus(
        state=state,
        reason=str(evaluations["reason"].iloc[-1]) if len(evaluations) else "",
        records=RecordTimes(
            baseline_end=baseline[-1],
            newest=monitor.last_ if len(evaluations) else None,
            evaluated=known.index[-1] if len(known) else None,
            step=usual_step(baseline.append(evaluations.index)) or DAY,
            counts=dict(monitor.counts_),
        ),
        index=float(known["index"].iloc[-1]) if len(known) else None,
        levels=AlarmLevels(
            *(None if getattr(monitor, name) is None else float(getattr(monitor, name)) for name in levels),
            smallest_change=monitor.smallest_changes_.as_dict(),
        ),
        events=tuple(opened[shown].to_dict("records")),
        faults=tuple(failed[["column", "kind", "since", "detail"]].to_dict("records")),
        transition=len(monitor.transitions()),
    )


def summary_lines(monitor: Any, most: int = 5) -> Iterator[str]:
    """The status of a fitted monitor, what it detects, its latest events, and drift."""
    events, drift, aside = monitor.events_, monitor.drift_, monitor.set_aside_
    yield str(replace(status_of(monitor), events=()))
    yield f"expected: {monitor.false_alarm_estimate_}"
    yield f"smallest change: {monitor.smallest_changes_}, in weather of the baseline"
    if len(aside):
        n_values = counted(int(aside["n_rows"].sum()), "value")
        yield f"baseline: {n_values} set aside: {'; '.join(aside['detail'].head(3))}"
    for number, event in events.iloc[-most:].iterrows():
        until = "still open" if pd.isna(event["end"]) else f"to {event['end']}"
        harmless = "harmless" if event["harmless"] else "not harmless"
        said = f"acknowledged as {harmless}" if event["acknowledged"] else "not acknowledged"
        times = f"{event['n_times']} times" if event["n_times"] > 1 else ""
        kind, peak = event["kind"], event["peak"]
        reached = f"index {peak:.4g} {monitor.known_events_.reached}"
        level = f"mean of 30 days up to {peak:.3g} times its limit" if kind == "drift" else reached
        highest = "" if kind == "fault" else f"{level} on {event['peak_time']}"
        parts = [times, highest, event["modes"], event["groups"], said]
        note = f" ({event['note']})" if event["note"] else ""
        yield f"event {number}: {event['kind']} from {event['start']} {until}, {', '.join(filter(None, parts))}{note}"
    before = f"; those before the last {most} are on the page and in events_" if len(events) > most else ""
    yield f"events: {len(events)}, {events['end'].isna().sum()} of them open{before}" if len(events) else "events: none"
    for group, one in () if drift is None else drift[drift["significant"]].iterrows():
        beyond = ", beyond the limit" if one["beyond_limit"] else ""
        yield f"drift: {group} {one['change']:+.1%} so far, {one['per_year']:+.2%} a year{beyond}"
    if drift is not None and not drift["significant"].any():
        yield f"drift: none that is significant (p value {probability_text(drift['p_value'].iloc[0])})"
