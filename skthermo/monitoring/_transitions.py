"""What has changed in a monitor: events that open and close, sensors that fail, detectors that take over."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import pandas as pd

from skthermo.monitoring._events import Event
from skthermo.monitoring.sensors import Fault


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
            yield Transition("opened", event.start, newest, event.kind, number, detail=_drivers(event))
        if event.end is not None and (was is None or was.end is None):
            yield Transition("closed", event.end, newest, event.kind, number, detail=f"peak {event.peak:.4g}")
    for number, event in known.items():
        yield Transition("withdrawn", event.start, newest, event.kind, number, detail="by records that came late")


def _drivers(event: Event) -> str:
    """Modes that drive an event, and the damage groups that explain it."""
    return event.modes + (f"; explained by a loss of stiffness of {event.groups}" if event.groups else "")


def _is_same(one: Event, other: Event) -> bool:
    """Whether two events of one kind have a time in common."""
    ends_after = one.end is None or one.end > other.start
    return one.kind == other.kind and ends_after and (other.end is None or other.end > one.start)


def fault_changes(
    before: Sequence[Fault], after: Sequence[Fault], names: Sequence[Any], units: Sequence[str], newest: int
) -> Iterator[Transition]:
    """Sensors that have failed, in another way than before perhaps, and those that are used again."""
    for old, new in zip_longest(before, after):
        if old == new:
            continue
        is_other = old is None or new is None or (old.column, old.other) != (new.column, new.other)
        failed = new is not None and (is_other or old.kind != new.kind or (old.until is not None and new.until is None))
        ended = new if new is not None and new.until is not None and (failed or old.until is None) else None
        if is_other and old is not None and old.until is None:
            yield _of_fault("put back", old, names, units, newest, newest)
        if failed:
            yield _of_fault("fault", new, names, units, new.since, newest)
        if ended is not None:
            yield _of_fault("put back", ended, names, units, ended.until, newest)


def _of_fault(
    what: str, fault: Fault, names: Sequence[Any], units: Sequence[str], time: int, newest: int
) -> Transition:
    columns = [str(names[place]) for place in (fault.column, fault.other) if place >= 0]
    detail = fault.detail(names[fault.other], units[fault.column]) if what == "fault" else ""
    return Transition(what, time, newest, fault.kind, column=", ".join(columns), detail=detail)
