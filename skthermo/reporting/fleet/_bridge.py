"""How one of many bridges stands, and where that places it among the others."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from skthermo.reporting._chart import line
from skthermo.reporting._html import Html
from skthermo.reporting.service import Doubt, Standing

FAILED, UNWATCHED = "not fitted", "no monitor"
UNKNOWN_STATES = ("not evaluated", FAILED, UNWATCHED)
MONTH = 31  # days of which the table says how many were evaluated

PLACES = (
    "significant",
    "open",
    "unexplained",
    "raised",
    "worn",
    "silent",
    "broken",
    "without monitor",
    "drifting",
    "well",
)
"""Places of a bridge, the worst first: an open event that is significant among all bridges; another open event; one
that would be significant, has ended and was not explained; a raised index; much stiffness lost; not evaluated; not
fitted; without a monitor; a drift beyond its error; healthy."""


@dataclass(frozen=True)
class Bridge:
    """State of a bridge in the table of a fleet.

    ``size`` orders those in the same place: the larger, the worse. ``alarm_for`` is how long it is in alarm, ``modes``
    and ``groups`` drive and explain the alarm, ``index`` and ``highest`` are over the threshold, ``drift`` is the group
    that has changed most beyond its error, with its change. ``errors`` are stages that failed; ``unread`` is the
    "monitor" or "model" whose file cannot be read.
    """

    name: Hashable
    state: str
    place: str
    size: float = 0.0
    is_watched: bool = False
    since: pd.Timestamp = pd.NaT
    alarm_for: pd.Timedelta | None = None
    modes: list[str] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    silent_since: pd.Timestamp | None = None
    doubt: Doubt | None = None
    worn: list[str] = field(default_factory=list)
    unexplained: list[int] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    errors: tuple[str, ...] = ()
    unread: str = ""
    index: float | None = None
    highest: float | None = None
    line: Html = field(default_factory=Html)
    is_followed: bool = False
    drift: tuple[str, float] | None = None
    n_evaluated: int = 0
    n_days: int = 0
    n_warnings: int = 0

    @property
    def order(self) -> tuple[int, float]:
        """By which bridges are sorted, the worst first."""
        return PLACES.index(self.place), -self.size

    @classmethod
    def watched(
        cls,
        name: Hashable,
        standing: Standing,
        *,
        is_significant: bool = False,
        unexplained: Sequence[int] = (),
        n_warnings: int = 0,
    ) -> Bridge:
        """A bridge as its monitor evaluates it; ``unexplained`` are the numbers of its events that have ended so."""
        opened, state = standing.opened("damage"), standing.state
        threshold = float(standing.monitor.threshold_)
        highest = float(opened["peak"].max()) / threshold if len(opened) else None
        certain = [group for group in standing.drift or () if group["significant"]]
        largest = max(certain, key=lambda group: abs(group["change"]), default=None)
        lost = max([-group["change"] for group in certain], default=0.0)
        place, size = "drifting" if lost > 0 else "well", max(lost, 0.0)
        if state == "alarm":
            place, size = ("significant" if is_significant else "open"), np.nan if highest is None else highest
        elif unexplained:
            place, size = "unexplained", float(standing.events.loc[list(unexplained), "peak"].max()) / threshold
        elif state == "watch":
            place, size = "raised", float(standing.opened("watch")["peak"].max()) / threshold
        elif state == "attention":
            place = "worn"
        elif state == "not evaluated":
            place, size = "silent", (standing.now - standing.doubt.since) / pd.Timedelta("1D")
        days = standing.days_until(standing.now)
        month, known = days.iloc[-MONTH:], standing.evaluations["index"].dropna()
        is_alarm = state == "alarm"
        return cls(
            name,
            state,
            place,
            size,
            is_watched=True,
            since=_since(standing, opened),
            alarm_for=max(standing.now - opened["start"].min(), standing.status.records.step) if is_alarm else None,
            modes=_names(opened["modes"]),
            groups=_names(opened["groups"]),
            silent_since=standing.last if standing.status.records.is_late else None,
            doubt=standing.doubt if state == "not evaluated" else None,
            worn=standing.worn,
            unexplained=list(unexplained),
            failed=[str(column) for column in standing.failed["column"]],
            errors=standing.errors,
            index=float(known.iloc[-1]) / threshold if len(known) else None,
            highest=highest,
            line=line(days["index_max"], threshold),
            is_followed=standing.drift is not None,
            drift=None if largest is None else (largest["name"], largest["change"]),
            n_evaluated=int((month["n_evaluated"] > 0).sum()),
            n_days=len(month) if standing.has_records else 0,
            n_warnings=n_warnings,
        )


def _names(texts: pd.Series) -> list[str]:
    """Names in texts that list them."""
    return sorted({name for text in texts if text for name in str(text).split(", ")})


def _since(standing: Standing, opened: pd.DataFrame) -> pd.Timestamp:
    """Since when a bridge is in its state; healthy since its last damage event, or since its service began."""
    if len(opened):
        return opened["start"].min()
    if standing.state == "watch":
        return standing.opened("watch")["start"].min()
    if standing.state == "not evaluated":
        return standing.doubt.since
    ends = standing.events.loc[standing.events["kind"] == "damage", "end"]
    return ends.max() if len(ends) else standing.monitor.days_.index[0]
