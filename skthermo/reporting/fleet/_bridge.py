"""How one of many bridges stands, and where that places it among the others."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from skthermo._tables.text import counted, duration_text, listed, percent
from skthermo.reporting._chart import line
from skthermo.reporting._html import Html
from skthermo.reporting.service import Standing, moment

FAILED, UNWATCHED = "not fitted", "no monitor"
UNKNOWN_STATES = ("not evaluated", FAILED, UNWATCHED)
NOT_SIGNIFICANT = "not significant after correction for many bridges; inspect"
FAILURES = {
    "records": "Its records could not be read",
    "maker": "Its model could not be built",
    "fit": "Its model could not be fitted to its records",
    "monitor": "Its monitor could not be fitted",
    "saving": "What was fitted could not be saved",
    "process": "The program that fitted it was stopped",
    "new records": "Its new records could not be read",
    "update": "Its new records could not be evaluated",
}
"""What failed, in an owner's words, by the stage of the error."""
MONTH = 31  # days of which the table says how many were evaluated

SIGNIFICANT, OPEN, UNEXPLAINED, RAISED, WORN, SILENT, BROKEN, WITHOUT_MONITOR, DRIFTING, WELL = range(10)
"""Places of a bridge, the worst first: an open event that is significant among all bridges; another open event; one
that would be significant, has ended and was not explained; a raised index; much stiffness lost; not evaluated; not
fitted; without a monitor; a drift beyond its error; healthy."""


@dataclass(frozen=True)
class Bridge:
    """State of a bridge in the table of a fleet, and what its page is about."""

    name: Hashable
    state: str
    place: int
    size: float = 0.0  # among those in the same place: the larger, the worse
    since: pd.Timestamp = pd.NaT
    why: str = ""
    index: str = ""
    line: Html = field(default_factory=Html)
    drift: str = ""
    days: str = ""
    n_warnings: int = 0
    duration: str = ""  # of the alarm
    note: str = ""  # in small print

    @property
    def order(self) -> tuple[int, float]:
        """By which bridges are sorted, the worst first."""
        return self.place, -self.size

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
        opened = standing.opened("damage")
        threshold = float(standing.monitor.threshold_)
        highest = float(opened["peak"].max()) / threshold if len(opened) else np.nan
        change, drift = _drift(standing)
        place, size, duration, note = WELL, change, "", ""
        if standing.state == "alarm":
            place, size = (SIGNIFICANT if is_significant else OPEN), highest
            duration = f" for {duration_text(max(standing.now - opened['start'].min(), standing.status.step))}"
            note = "" if is_significant else NOT_SIGNIFICANT
        elif unexplained:
            place, size = UNEXPLAINED, float(standing.events.loc[list(unexplained), "peak"].max()) / threshold
        elif standing.state == "watch":
            place, size = RAISED, float(standing.opened("watch")["peak"].max()) / threshold
        elif standing.state == "attention":
            place = WORN
        elif standing.state == "not evaluated":
            place, size = SILENT, (standing.now - standing.doubt.since) / pd.Timedelta("1D")
        elif change > 0:
            place = DRIFTING
        days = standing.days_until(standing.now)
        month = days.iloc[-MONTH:]
        n_evaluated = int((month["n_evaluated"] > 0).sum())
        return cls(
            name,
            standing.state,
            place,
            size,
            _since(standing, opened),
            _why(standing, opened, unexplained),
            _index(standing, threshold, highest),
            line(days["index_max"], threshold),
            drift,
            f"{n_evaluated} of {counted(len(month), 'day')}" if standing.has_records else "none",
            n_warnings,
            duration,
            note,
        )


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


def _why(standing: Standing, opened: pd.DataFrame, unexplained: Sequence[int]) -> str:
    """What an owner should know beside the state."""
    texts = []
    if standing.state == "alarm":
        modes = listed(sorted({mode for text in opened["modes"] if text for mode in str(text).split(", ")}))
        texts.append(f"Modes that drive it: {modes}." if modes else "")
        groups = listed(sorted({group for text in opened["groups"] if text for group in str(text).split(", ")}))
        texts.append(f"Explained by a loss of stiffness of {groups}." if groups else "")
        if standing.status.is_late:
            texts.append(f"No record since {moment(standing.last, is_short=True)}.")
    elif standing.state == "watch":
        texts.append("The damage index is raised, below the level of an alarm.")
    elif standing.state == "not evaluated":
        texts.append(f"{standing.doubt.explanation}.")
    elif standing.state == "attention":
        texts.append(f"{listed(standing.worn)} lost {percent(standing.limit)} or more of the stiffness slowly.")
    if standing.error and standing.state == "alarm":
        texts.append(f"{standing.error}.")
    if unexplained:
        number = f"Event{'' if len(unexplained) == 1 else 's'} {listed(list(unexplained))}"
        texts.append(f"{number} would be significant, but ended before it was explained.")
    if len(standing.failed):
        more = f" and {len(standing.failed) - 3} more" if len(standing.failed) > 3 else ""
        texts.append(f"Failed sensors: {listed(list(standing.failed['column'])[:3])}{more}.")
    return " ".join(text for text in texts if text)


def _drift(standing: Standing) -> tuple[float, str]:
    """Largest loss of stiffness beyond its error, and its text in the table."""
    found = standing.monitor.drift_
    if found is None:
        return 0.0, "not followed"
    certain = found[found["significant"].astype(bool)]
    if not len(certain):
        return 0.0, "none beyond its error"
    group = certain["change"].abs().idxmax()
    change = float(certain.at[group, "change"])
    return max(-float(certain["change"].min()), 0.0), f"{group}: {percent(change, '+.1f')}"


def _index(standing: Standing, threshold: float, highest: float) -> str:
    """Newest evaluated damage index over the threshold, and the highest of an event that is open."""
    known = standing.evaluations["index"].dropna()
    if not len(known):
        return "none evaluated"
    text = f"{known.iloc[-1] / threshold:.2f}"
    return f"{text}, highest {highest:.2f}" if highest == highest else text
