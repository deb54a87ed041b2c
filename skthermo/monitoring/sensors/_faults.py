"""Faults of sensors, with their beginning and end."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from skthermo._tables.frames import DAY_NS, as_index

SOON = 7 * DAY_NS  # nanoseconds after its end in which a fault that comes again is the same
COLUMNS = ["column", "kind", "since", "detected", "until", "detail"]
LEFT_OUT = ("dead", "stuck", "implausible", "offset", "drift")
DEPARTURES = ("offset", "drift", "disagree")
MONTH = 30.4  # days


@dataclass(frozen=True)
class Fault:
    """Position of its column, the other one where two are concerned (else -1), times in nanoseconds, None as it lasts.

    ``size`` is the departure or the repeated value, ``rate`` that of a drift in a day.
    """

    kind: str
    column: int
    since: int
    detected: int
    other: int = -1
    size: float = 0.0
    rate: float = 0.0
    until: int | None = None

    def detail(self, other: Hashable, unit: str) -> str:
        value = f"{self.size:.6g} {unit}".rstrip()
        return {
            "dead": "has had no value for longer than gaps of the baseline",
            "stuck": f"repeats {value}; left out",
            "implausible": f"shows implausible values, such as {value}; left out",
            "offset": f"{self.size:+.1f} degrees beside what the other thermometers predict; left out",
            "drift": f"{self.rate * MONTH:+.2f} degrees a month, {self.size:+.1f} so far, beside what the other "
            "thermometers predict; left out",
            "disagree": f"{abs(self.size):.1f} degrees between what it, {other!r} and any others predict: which is "
            "wrong is not known; records are healthy only if they are so without either",
            "swapped": f"its values are in the column of {other!r}; put back in place",
        }[self.kind]


@dataclass(frozen=True)
class SensorFaults:
    """All faults in the order in which they were detected."""

    faults: tuple[Fault, ...] = ()

    def lasting(self, *kinds: str) -> list[Fault]:
        return [fault for fault in self.faults if fault.until is None and fault.kind in kinds]

    def left_out(self) -> dict[int, Fault]:
        """By position of each column that is left out, the fault for which it is."""
        return {fault.column: fault for fault in self.lasting(*LEFT_OUT)}

    def opened(self, fault: Fault) -> SensorFaults:
        """With one more fault, or with that one again which has just ended."""
        same = (fault.column, fault.other, fault.kind)
        for known in reversed(self.faults):
            lasts = known.until is None or known.until > fault.since - SOON
            if (known.column, known.other, known.kind) == same and lasts:
                return self.changed(known, until=None)
        return SensorFaults((*self.faults, fault))

    def changed(self, fault: Fault, **values: Any) -> SensorFaults:
        return SensorFaults(tuple(replace(one, **values) if one is fault else one for one in self.faults))

    def notes(self, names: Sequence[Hashable], zone: str) -> list[str]:
        """What is left out or put back in place for the faults that last."""
        return [
            f"{names[fault.column]} and {names[fault.other]} are exchanged and were put back in place"
            if fault.kind == "swapped"
            else f"{names[fault.column]} is left out ({fault.kind} since {as_index([fault.since], zone)[0]:%Y-%m-%d})"
            for fault in self.lasting(*LEFT_OUT, "swapped")
        ]

    def table(self, names: Sequence[Hashable], zone: str, units: Sequence[str]) -> pd.DataFrame:
        """One row a fault, two where two columns are concerned."""
        rows = [
            [names[own], fault.kind, fault.since, fault.detected, fault.until, fault.detail(names[other], units[own])]
            for fault in self.faults
            for own, other in [(fault.column, fault.other), (fault.other, fault.column)][: 1 if fault.other < 0 else 2]
        ]
        columns = dict(zip(COLUMNS, zip(*rows, strict=True) if rows else [()] * len(COLUMNS), strict=True))
        table = {name: pd.Series(list(values), dtype=object) for name, values in columns.items()}
        return pd.DataFrame(table | {name: as_index(columns[name], zone) for name in ("since", "detected", "until")})
