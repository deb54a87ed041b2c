"""Faults that were detected, with their beginning and end."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo._tables.times import DAY_NS

LASTS = np.iinfo(np.int64).min  # end of a fault that lasts
SOON = 7 * DAY_NS  # nanoseconds after its end in which a fault that comes again is the same
COLUMNS = ["column", "kind", "since", "detected", "until", "detail"]
LEFT_OUT = ("dead", "stuck", "implausible", "offset", "drift")
DEPARTURES = ("offset", "drift", "disagree")
MONTH = 30.4  # days


@dataclass(frozen=True)
class SensorFaults:
    """Column of each fault by its position, the other one where two are concerned (else -1), times in nanoseconds.

    ``size`` is the departure or the repeated value, ``rate`` that of a drift in a day.
    """

    column: NDArray[np.int64]
    other: NDArray[np.int64]
    kind: NDArray[np.str_]
    since: NDArray[np.int64]
    detected: NDArray[np.int64]
    until: NDArray[np.int64]
    size: Array
    rate: Array

    @classmethod
    def none(cls) -> SensorFaults:
        """No fault."""
        whole, real = np.empty(0, dtype=np.int64), np.empty(0)
        return cls(whole, whole, np.empty(0, dtype="<U11"), whole, whole, whole, real, real)

    def lasting(self, *kinds: str) -> list[int]:
        """Positions of the faults that last, of these kinds."""
        return [int(fault) for fault in np.flatnonzero(self.until == LASTS) if self.kind[fault] in kinds]

    def left_out(self, n_columns: int) -> NDArray[np.int64]:
        """Position of the fault for which each column is left out; -1 where it is not."""
        found = np.full(n_columns, -1)
        for fault in self.lasting(*LEFT_OUT):
            found[self.column[fault]] = fault
        return found

    def opened(
        self,
        kind: str,
        column: int,
        since: int,
        detected: int,
        *,
        other: int = -1,
        size: float = 0.0,
        rate: float = 0.0,
    ) -> SensorFaults:
        """With one more fault, or with that one again which has just ended."""
        same = (self.column == column) & (self.other == other) & (self.kind == kind)
        again = np.flatnonzero(same & (self.until > since - SOON))
        if again.size:
            return self.with_values(int(again[-1]), until=LASTS)
        values = (column, other, kind, since, detected, LASTS, size, rate)
        whole = (np.append(getattr(self, part.name), value) for part, value in zip(fields(self), values, strict=True))
        return SensorFaults(*whole)

    def with_values(self, fault: int, **values: str | float) -> SensorFaults:
        """With other values of one fault."""
        changed = {name: getattr(self, name).copy() for name in values}
        for name, value in values.items():
            changed[name][fault] = value
        return replace(self, **changed)

    def notes(self, names: Sequence[Hashable]) -> list[str]:
        """What is left out or put back in place for the faults that last."""
        texts = []
        for fault in self.lasting(*LEFT_OUT, "swapped"):
            name, kind, since = names[self.column[fault]], self.kind[fault], pd.Timestamp(int(self.since[fault]))
            if kind == "swapped":
                texts.append(f"{name} and {names[self.other[fault]]} are exchanged and were put back in place")
            else:
                texts.append(f"{name} is left out ({kind} since {since:%Y-%m-%d})")
        return texts

    def table(self, names: Sequence[Hashable], zone: str, units: Sequence[str]) -> pd.DataFrame:
        """One row a fault, two where two columns are concerned."""
        rows = []
        for fault in range(len(self.column)):
            ours, other = int(self.column[fault]), int(self.other[fault])
            for column, partner in [(ours, other), (other, ours)][: 1 if other < 0 else 2]:
                times = (int(part[fault]) for part in (self.since, self.detected, self.until))
                rows.append(
                    [names[column], str(self.kind[fault]), *times, self._detail(fault, names, partner, units[column])]
                )
        table = pd.DataFrame(rows, columns=COLUMNS)
        for name in ("since", "detected", "until"):
            stamps = pd.DatetimeIndex(np.array(table[name].tolist(), dtype="datetime64[ns]"))
            table[name] = stamps if not zone else stamps.tz_localize("UTC").tz_convert(zone)
        return table

    def _detail(self, fault: int, names: Sequence[Hashable], partner: int, unit: str) -> str:
        """What was seen, and what is done about it."""
        size, rate = self.size[fault], self.rate[fault]
        return {
            "dead": "has had no value for longer than gaps of the baseline",
            "stuck": f"repeats {f'{size:.6g} {unit}'.rstrip()}; left out",
            "implausible": f"shows implausible values, such as {f'{size:.6g} {unit}'.rstrip()}; left out",
            "offset": f"{size:+.1f} degrees beside what the other thermometers predict; left out",
            "drift": f"{rate * MONTH:+.2f} degrees a month, {size:+.1f} so far, beside what the other thermometers "
            "predict; left out",
            "disagree": f"{abs(size):.1f} degrees between what it, {names[partner]!r} and any others predict: which "
            "is wrong is not known, none is left out",
            "swapped": f"its values are in the column of {names[partner]!r}; put back in place",
        }[str(self.kind[fault])]
