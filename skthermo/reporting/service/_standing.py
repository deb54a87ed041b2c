"""How a structure stands by its monitor, at the time at which a page is written."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import NamedTuple, TypeAlias

import pandas as pd

from skthermo._tables.frames import as_moment, midnight
from skthermo._tables.text import SPACE, counted, counted_number, duration_text, listed, percent
from skthermo.monitoring import Monitor, MonitorStatus

ONE_DAY, MONTH, YEAR = pd.Timedelta(days=1), pd.Timedelta(days=31), pd.Timedelta(days=365.25)
Time: TypeAlias = str | datetime | None

SET_ASIDE = "measurement or structure"  # the kind of events of responses that moved too far


class Doubt(NamedTuple):
    """Why it is not known whether a structure is healthy: since when, in a line and in a sentence."""

    since: pd.Timestamp
    headline: str
    explanation: str


@dataclass(frozen=True, eq=False)
class Standing:
    """A monitor, the time at which its page is written, in the time zone of the records, and a limit of slow loss.

    ``error`` says in words that the newest records could not be evaluated, if they could not.
    """

    monitor: Monitor
    now: pd.Timestamp
    limit: float
    error: str = ""

    @classmethod
    def of(cls, monitor: Monitor, now: Time = None, limit: float = 0.1, error: str = "") -> Standing:
        """Now is by the clock where no time is given."""
        return cls(monitor, as_moment(now, monitor.last_.tz), limit, error)

    @cached_property
    def events(self) -> pd.DataFrame:
        return self.monitor.events_

    @cached_property
    def evaluations(self) -> pd.DataFrame:
        return self.monitor.evaluations_

    @cached_property
    def status(self) -> MonitorStatus:
        """The facts by the time at which the page is written."""
        return self.monitor.status(self.now)

    @property
    def has_records(self) -> bool:
        return self.status.newest is not None

    @property
    def last(self) -> pd.Timestamp:
        return self.monitor.last_

    @property
    def state(self) -> str:
        """The monitor's at the time of the page; not healthy either after an error, or with much stiffness lost."""
        said = self.status.state
        if said in ("healthy", "watch") and self.error:
            return "not evaluated"
        return "attention" if said == "healthy" and self.worn else said

    @property
    def worn(self) -> list[str]:
        """Groups whose slow loss of stiffness has reached the limit."""
        drift = self.monitor.drift_
        if drift is None:
            return []
        return [str(name) for name in drift.index[drift["significant"].astype(bool) & (drift["change"] <= -self.limit)]]

    def headline(self) -> str:
        if self.state == "alarm":
            starts = [self.opened(kind)["start"].min() for kind in ("damage", SET_ASIDE) if len(self.opened(kind))]
            return f"Alarm since {moment(min(starts, default=self.last))}"
        if self.state == "watch":
            return f"Watch since {moment(self.opened('watch')['start'].min())}: no alarm, but a raised damage index"
        if self.state == "healthy":
            return "Healthy: no alarm"
        if self.state == "attention":
            return "No alarm, but much stiffness has been lost slowly"
        return self.doubt.headline

    def explanation(self) -> str:
        """What the headline means, and why."""
        if self.state == "alarm":
            text = (
                "The natural frequencies are not those of the healthy structure in this weather. That may be damage; "
                "an engineer should look at the structure and at the records."
            )
            if not len(self.opened("damage")) and len(self.opened(SET_ASIDE)):
                text = "A response moved too far to be evaluated. Its sensor or the structure has changed."
            if self.status.is_late:
                text += f" No record has come since {moment(self.last)}, so that nothing is known of the days since."
            return f"{text} {self.error}." if self.error else text
        if self.state == "attention":
            return (
                f"{listed(self.worn)} {'has' if len(self.worn) == 1 else 'have'} lost {percent(self.limit)} or more of "
                "the stiffness since the baseline. The monitor takes slow drift out before it evaluates, so that this "
                "raises no alarm. An engineer should evaluate whether the structure can bear it."
            )
        if self.state == "watch":
            return (
                "The damage index is above the level from which on the structure is to be watched, and below that of "
                f"an alarm. A healthy structure has {counted_number(self.monitor.watch_per_year, 'such event')} a year."
            )
        if self.state == "healthy":
            return f"The newest record, of {moment(self.last)}, is as those of the healthy structure."
        return f"{self.doubt.explanation}. Whether the structure is healthy now is not known."

    @property
    def doubt(self) -> Doubt:
        """Why it is not known whether the structure is healthy, and since when."""
        last, gone = moment(self.last), duration_text(self.now - self.last)
        if self.error:
            return Doubt(self.last, "Not evaluated: its new records could not be used", self.error)
        if not self.has_records:
            text = f"No record has come since the baseline, which ends on {last}"
            return Doubt(self.last, "Not evaluated: no record since the baseline", text)
        if self.status.is_ahead:
            text = f"The newest record is of {last}, a time after {moment(self.now)}, when this page was written"
            return Doubt(self.last, "Not evaluated: the dates of the records are wrong", text)
        if self.status.is_late:
            text = f"A record usually comes every {self.step_text}; the newest is {gone} old"
            return Doubt(self.last, f"Not evaluated: no record since {last}", text)
        reason = str(self.evaluations["reason"].iloc[-1]) if len(self.evaluations) else ""
        since = self.not_evaluated_since
        return Doubt(since, f"Not evaluated since {moment(since)}", f"Because: {reason or 'no reason is given'}")

    @property
    def step_text(self) -> str:
        """Usual time between records, as in "every day"."""
        return duration_text(self.status.step).removeprefix("1 ")

    @property
    def not_evaluated_since(self) -> pd.Timestamp:
        """First record after the last one that was evaluated."""
        days, evaluated = self.monitor.days_, self.evaluations
        known = evaluated.index[evaluated["state"] != "not evaluated"]
        if len(known):
            return evaluated.index[evaluated.index > known[-1]][0]
        some = days.index[days["n_evaluated"] > 0]
        after = days.index[days.index > some[-1]] if len(some) else days.index
        return after[0] if len(after) else self.last

    def opened(self, kind: str) -> pd.DataFrame:
        """Events of a kind that have not ended."""
        return self.events[self.events["end"].isna() & (self.events["kind"] == kind)]

    @cached_property
    def failed(self) -> pd.DataFrame:
        faults = self.monitor.faults_
        return faults[faults["until"].isna()]

    @property
    def years(self) -> float:
        return (self.last - self.monitor.days_.index[0]) / YEAR if self.has_records else 0.0

    def days_until(self, end: pd.Timestamp) -> pd.DataFrame:
        """Days in service within the year up to a time, those without a record included, without a time zone."""
        days = self.monitor.days_.tz_localize(None)
        last = end.tz_localize(None).normalize()
        first = max(last - YEAR, days.index[0]).normalize() if len(days) else last
        return days.reindex(pd.date_range(first, max(first, last), freq="D"))

    def recent(self) -> str:
        """How many records of the last month were evaluated."""
        days = self.monitor.days_
        days = days[days.index > self.last - MONTH]
        number, evaluated = int(days["n_records"].sum()), int(days["n_evaluated"].sum())
        which = f"{evaluated:,}" if evaluated < number else "all"
        return f"Of {counted(number, 'record')} in the month up to the newest one, {which} were evaluated."


def moment(time: Time, *, is_short: bool = False) -> str:
    """A time as text that stays on one line: its day, and the hour where it is not midnight; nothing for none."""
    if pd.isna(time):
        return ""
    stamp = pd.Timestamp(time)
    month = stamp.month_name()[: 3 if is_short else None]
    day = SPACE.join([str(stamp.day), month, str(stamp.year)])
    return day if stamp == midnight(stamp) else f"{day}, {stamp:%H:%M}"
