"""Events as they open and close, record by record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo._tables.frames import as_index
from skthermo.monitoring._false_alarms import EventRule, EventState

DAMAGE, MEASUREMENT, WATCH = "damage", "measurement or structure", "watch"
"""Kinds of events; the second is that of responses set aside as implausible or stuck, the last of a raised index."""

MATTERS = 2.0  # standard deviations from which a mode, or a damage group, drives an alarm
MOST_NAMED = 3  # of them


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


@dataclass(frozen=True)
class EventLog:
    """All events in order of their start, and for each kind whether one is open."""

    states: dict[str, EventState] = field(default_factory=dict)
    events: tuple[Event, ...] = ()

    def follow(
        self,
        rules: dict[str, EventRule],
        by_kind: dict[str, Array],
        drivers: dict[str, tuple[Sequence[str], Sequence[dict[str, float]]]],
        times: NDArray[np.int64],
    ) -> tuple[dict[str, NDArray[np.int64]], EventLog]:
        """Number of the event of each kind at records in order of time, 0 for none, and the log after them.

        ``drivers`` are the modes that drive the index of each record, and the effects of damage groups, by kind.
        """
        is_open, levels, states = {}, {}, dict(self.states)
        for kind, index in by_kind.items():
            is_open[kind], levels[kind], states[kind] = rules[kind].follow(self.state(kind), index, times)
        events, numbers = list(self.events), {kind: np.zeros(len(times), dtype=np.int64) for kind in by_kind}
        for row, kind in self._openings(is_open):
            events.append(Event(kind, int(times[row]), None, -np.inf, 0, "", (), 0))
        for kind, level in levels.items():
            own = [n for n, event in enumerate(events) if event.kind == kind and event.end is None]
            begins = np.searchsorted(times, [events[n].start for n in own])
            for n, begin, end in zip(own, begins, [*begins, len(times)][1:], strict=True):
                inside = np.flatnonzero(is_open[kind][begin:end]) + begin
                numbers[kind][inside] = n + 1
                closing = np.flatnonzero(~is_open[kind][begin:end])
                end_time = int(times[begin + closing[0]]) if len(closing) else None
                events[n] = _grown(events[n], level, times, drivers[kind], inside, end_time)
        return numbers, EventLog(states, tuple(events))

    def ended(self, end: int) -> EventLog:
        """The log in which open events ended at a time, or at their start if that is later."""
        events = tuple(e if e.end is not None else replace(e, end=max(e.start, end)) for e in self.events)
        return EventLog(events=events)

    def _openings(self, is_open: dict[str, NDArray[np.bool_]]) -> list[tuple[int, str]]:
        """Record and kind of each event that opens, in order of time."""
        found = []
        for kind, after in is_open.items():
            before = int(self.is_open(kind))
            found += [(int(row), kind) for row in np.flatnonzero(np.diff(after.astype(int), prepend=before) == 1)]
        return sorted(found)

    def is_open(self, kind: str) -> bool:
        return self.state(kind).is_open

    def state(self, kind: str) -> EventState:
        """Where events of a kind stand."""
        return self.states.get(kind, EventState())


def _grown(
    event: Event,
    level: Array,
    times: NDArray[np.int64],
    drivers: tuple[Sequence[str], Sequence[dict[str, float]]],
    inside: NDArray[np.intp],
    end: int | None,
) -> Event:
    """The event with the records in which it was open."""
    evaluated = inside[~np.isnan(level[inside])]
    if len(evaluated):
        modes, effects = drivers
        peak = evaluated[np.argmax(level[evaluated])]
        if level[peak] > event.peak:
            event = replace(event, peak=float(level[peak]), peak_time=int(times[peak]), modes=modes[peak])
        totals = dict(event.effects)
        for row in evaluated:
            totals |= {name: totals.get(name, 0.0) + size for name, size in effects[row].items()}
        event = replace(event, effects=tuple(sorted(totals.items())))
    return replace(event, end=end, n_alarms=event.n_alarms + len(evaluated))


def leading(sizes: dict[str, float]) -> list[str]:
    """Names of the largest sizes, in standard deviations, and of others that matter."""
    worst = sorted(sizes, key=lambda name: -sizes[name])[:MOST_NAMED]
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
