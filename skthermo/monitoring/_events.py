"""Events as they open and close, record by record, and what that changes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from typing import Any

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from skthermo._core.arrays import Array
from skthermo._core.frames import as_index
from skthermo._core.saved_frames import SavesFrames

DAMAGE, MEASUREMENT, WATCH = "damage", "measurement or structure", "watch"
"""Kinds of events; the second is that of responses set aside as implausible or stuck, the last of a raised index."""

Shown = tuple[Array, Sequence[str], Sequence[dict[str, float]]]
"""What records show of a kind of event: damage indices, modes that drive them, and effects of damage groups."""

MATTERS = 2.0  # standard deviations from which a mode, or a damage group, drives an alarm
MOST_NAMED = 3  # of them


@dataclass(frozen=True)
class EventState:
    """Whether an event is open, since when all levels have stayed within the clear threshold, and the last indices.

    ``quiet_since`` is in nanoseconds, None if the last level was above it, or there was none.
    """

    is_open: bool = False
    quiet_since: int | None = None
    recent: tuple[float, ...] = ()


@dataclass(frozen=True)
class EventRule(SavesFrames):
    """An event opens when ``persistence`` of the last ``2 persistence - 1`` evaluated records exceed ``threshold``.

    That is when their level, the median index of these records, exceeds it; those before the first count as 0. An
    event closes when the levels of ``hold`` have stayed within ``release``. Records that are not evaluated (NaN)
    neither open nor close it: the time of quiet counts only between evaluated records.
    """

    threshold: float
    release: float
    hold: pd.Timedelta
    persistence: int = 1

    def follow(
        self, state: EventState, index: Array, times: NDArray[np.int64]
    ) -> tuple[NDArray[np.bool_], Array, EventState]:
        """Whether an event is open after each record, in order of time (nanoseconds), levels, and the last state."""
        after, level, recent = np.full(len(index), state.is_open), *levels(index, self.persistence, state.recent)
        places = np.flatnonzero(~np.isnan(index))
        if not len(places):
            return after, level, state
        values, at, order = level[places], times[places], np.arange(len(places))
        quiet = values <= self.release
        begins = quiet & ~np.append(state.quiet_since is not None, quiet[:-1])
        last_begin = np.maximum.accumulate(np.where(begins, order, -1))
        since = np.where(last_begin >= 0, at[last_begin], 0 if state.quiet_since is None else state.quiet_since)
        closes = quiet & (at - since >= self.hold.value)
        opens = values > self.threshold
        last_change = np.maximum.accumulate(np.where(opens | closes, order, -1))
        is_open = np.where(last_change >= 0, opens[last_change], state.is_open)
        last_evaluated = np.searchsorted(places, np.arange(len(index)), side="right") - 1
        after = np.where(last_evaluated >= 0, is_open[last_evaluated], state.is_open)
        return after, level, EventState(bool(is_open[-1]), int(since[-1]) if quiet[-1] else None, recent)


def levels(index: Array, persistence: int, recent: tuple[float, ...] = ()) -> tuple[Array, tuple[float, ...]]:
    """The median index of the last evaluated records at each of them, and the indices that the next ones need."""
    level, known, n = np.full(len(index), np.nan), ~np.isnan(index), 2 * (persistence - 1)
    values = np.append([*np.zeros(n), *recent][len(recent) :], index[known])
    if known.any():
        level[known] = np.median(sliding_window_view(values, n + 1), axis=1)
    return level, tuple(values[len(values) - n :].tolist())


def find_events(index: Array, times: pd.DatetimeIndex, rule: EventRule) -> pd.DataFrame:
    """Events in a series of damage indices: ``start``, ``end`` (NaT while open), ``peak`` (level), ``peak_time``."""
    is_open, values, _ = rule.follow(EventState(), np.asarray(index, dtype=float), times.as_unit("ns").asi8)
    change = np.diff(is_open.astype(np.int8), prepend=0)
    starts, stops = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    bounds = np.append(stops, len(values))[: len(starts)]
    peaks = np.array(
        [start + np.nanargmax(values[start:stop]) for start, stop in zip(starts, bounds, strict=True)], int
    )
    ends = times[stops].append(pd.DatetimeIndex([pd.NaT] * (len(starts) - len(stops))).tz_localize(times.tz))
    table = {"start": times[starts], "end": ends, "peak": values[peaks], "peak_time": times[peaks]}
    return pd.DataFrame(table, index=pd.RangeIndex(1, len(starts) + 1, name="event"))


@dataclass(frozen=True)
class Event:
    """A time in which the structure was unlike its baseline; stamps in nanoseconds, no end while it is open.

    ``effects`` are the sums of those of damage groups, by name, over the records in alarm.
    """

    kind: str
    start: int
    end: int | None
    peak: float
    peak_time: int
    modes: str
    effects: tuple[tuple[str, float], ...]
    n_alarms: int

    @property
    def groups(self) -> str:
        """Damage groups whose losses explain the event on average over its records in alarm."""
        means = {name: total / self.n_alarms for name, total in self.effects}
        return ", ".join(leading({name: size for name, size in means.items() if size > MATTERS}))

    def grown(
        self, level: Array, times: NDArray[np.int64], shown: Shown, inside: NDArray[np.intp], end: int | None
    ) -> Event:
        """The event with the records in which it was open."""
        evaluated = inside[~np.isnan(level[inside])]
        if not len(evaluated):
            return replace(self, end=end)
        _, modes, effects = shown
        highest = evaluated[np.argmax(level[evaluated])]
        peak, peak_time, of_peak = self.peak, self.peak_time, self.modes
        if level[highest] > peak:
            peak, peak_time, of_peak = float(level[highest]), int(times[highest]), modes[highest]
        totals = dict(self.effects)
        for row in evaluated:
            for name, size in effects[row].items():
                totals[name] = totals.get(name, 0.0) + size
        n_alarms = self.n_alarms + len(evaluated)
        return Event(self.kind, self.start, end, peak, peak_time, of_peak, tuple(sorted(totals.items())), n_alarms)


@dataclass(frozen=True)
class EventLog:
    """All events in order of their start, and for each kind whether one is open."""

    states: dict[str, EventState] = field(default_factory=dict)
    events: tuple[Event, ...] = ()

    def follow(
        self,
        rules: dict[str, EventRule],
        series: dict[str, Shown],
        times: NDArray[np.int64],
    ) -> tuple[dict[str, NDArray[np.int64]], EventLog]:
        """Number of the event of each kind at records in order of time, 0 for none, and the log after them."""
        is_open, levels, states, numbers, openings = {}, {}, dict(self.states), {}, []
        for kind, (index, *_) in series.items():
            before = self.state(kind)
            is_open[kind], levels[kind], states[kind] = rules[kind].follow(before, index, times)
            opens = np.diff(is_open[kind].astype(int), prepend=int(before.is_open)) == 1
            openings += zip(np.flatnonzero(opens).tolist(), repeat(kind))
            numbers[kind] = np.zeros(len(times), dtype=np.int64)
        events = list(self.events)
        for row, kind in sorted(openings):
            events.append(Event(kind, int(times[row]), None, -np.inf, 0, "", (), 0))
        for kind, level in levels.items():
            own = [n for n, event in enumerate(events) if event.kind == kind and event.end is None]
            begins = np.searchsorted(times, [events[n].start for n in own])
            for n, begin, end in zip(own, begins, [*begins, len(times)][1:], strict=True):
                inside = np.flatnonzero(is_open[kind][begin:end]) + begin
                numbers[kind][inside] = n + 1
                closing = np.flatnonzero(~is_open[kind][begin:end])
                end_time = int(times[begin + closing[0]]) if len(closing) else None
                events[n] = events[n].grown(level, times, series[kind], inside, end_time)
        return numbers, EventLog(states, tuple(events))

    def ended(self, end: int) -> EventLog:
        """The log in which open events ended at a time, or at their start if that is later."""
        events = tuple(e if e.end is not None else replace(e, end=max(e.start, end)) for e in self.events)
        return EventLog(events=events)

    def is_open(self, kind: str) -> bool:
        return self.state(kind).is_open

    def state(self, kind: str) -> EventState:
        """Where events of a kind stand."""
        return self.states.get(kind, EventState())


def leading(sizes: dict[str, float]) -> list[str]:
    """Names of the largest sizes, in standard deviations, and of others that matter."""
    worst = sorted(sizes, key=sizes.__getitem__, reverse=True)[:MOST_NAMED]
    return [name for n, name in enumerate(worst) if n == 0 or sizes[name] > MATTERS]


@dataclass(frozen=True)
class Acknowledgement:
    """What the owner says of an event, known by the time of its peak: late records may move its start and number.

    ``time`` is that of the newest record then.
    """

    kind: str
    peak_time: int
    time: int
    harmless: bool
    note: str


def event_table(events: Sequence[Event], said: Sequence[Acknowledgement], zone: Any) -> pd.DataFrame:
    """Events as a frame, with what the owner says of them."""
    by_event: list[Acknowledgement | None] = [
        next((a for a in reversed(said) if a.kind == e.kind and e.start <= a.peak_time < (e.end or np.inf)), None)
        for e in events
    ]
    return pd.DataFrame(
        {
            "kind": pd.Series([e.kind for e in events], dtype=object),
            "start": as_index([e.start for e in events], zone),
            "end": as_index([e.end for e in events], zone),
            "peak": np.array([e.peak for e in events], dtype=float),
            "peak_time": as_index([e.peak_time for e in events], zone),
            "modes": pd.Series([e.modes for e in events], dtype=object),
            "groups": pd.Series([e.groups for e in events], dtype=object),
            "n_alarms": np.array([e.n_alarms for e in events], dtype=np.int64),
            "acknowledged": np.array([a is not None for a in by_event], dtype=bool),
            "harmless": np.array([a is not None and a.harmless for a in by_event], dtype=bool),
            "note": pd.Series(["" if a is None else a.note for a in by_event], dtype=object),
        }
    ).set_axis(pd.RangeIndex(1, len(events) + 1, name="event"))


@dataclass(frozen=True)
class Transition:
    """One change: when it happened, and the newest record when the monitor reported it; times in nanoseconds.

    ``event`` is the number of an event, 0 for none, ``column`` that of a sensor.
    """

    what: str
    time: int
    newest: int
    kind: str
    event: int = 0
    column: str = ""
    detail: str = ""

    def as_dict(self, number: int, zone: Any) -> dict[str, Any]:
        """Plain values by name, times as texts of ISO 8601 in a time zone."""
        stamps = {name: pd.Timestamp(getattr(self, name), tz=zone).isoformat() for name in ("time", "newest")}
        return {"id": number, "what": self.what} | vars(self) | stamps


def event_changes(before: Sequence[Event], after: Sequence[Event], newest: int) -> Iterator[Transition]:
    """Events that have opened, closed, or been withdrawn, as late records may show that there was none."""
    known = {place: one for place, one in enumerate(before, 1) if place > len(after) or one != after[place - 1]}
    for number, event in enumerate(after, 1):
        if number <= len(before) and event == before[number - 1]:
            continue
        old = min(
            (place for place, one in known.items() if _is_same(one, event)),
            key=lambda place: abs(known[place].start - event.start),
            default=0,
        )
        was = known.pop(old, None)
        if was is None or (was.end is not None and event.end is None):
            groups = f"; explained by a loss of stiffness of {event.groups}" if event.groups else ""
            yield Transition("opened", event.start, newest, event.kind, number, detail=event.modes + groups)
        if event.end is not None and (was is None or was.end is None):
            yield Transition("closed", event.end, newest, event.kind, number, detail=f"peak {event.peak:.4g}")
    for number, event in known.items():
        yield Transition("withdrawn", event.start, newest, event.kind, number, detail="by records that came late")


def _is_same(one: Event, other: Event) -> bool:
    """Whether two events of one kind have a time in common."""
    ends_after = one.end is None or one.end > other.start
    return one.kind == other.kind and ends_after and (other.end is None or other.end > one.start)
