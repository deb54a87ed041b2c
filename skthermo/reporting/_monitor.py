"""The page on a monitor: how a structure stands at the time at which it is written, and its drawings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from skthermo._core.frames import DAY, YEAR, as_moment, midnight, midnights_between
from skthermo.fem import Structure
from skthermo.monitoring import Monitor, MonitorStatus
from skthermo.plotting import DamageIndexDisplay, PredictionDisplay
from skthermo.reporting._drawings import Values, draw, draw_detectable, fold_legend, losses_on
from skthermo.reporting._page import Html, Row, rows_of, settings_of, versions

Time: TypeAlias = str | datetime | None


class Doubt(NamedTuple):
    """Why it is not known whether a structure is healthy, and since when.

    Kinds are "error", "no records", "ahead" of a newest record in the future, "late" of one that is too old, and
    "reason" of records that are not evaluated: ``reason`` is the newest one's.
    """

    kind: str
    since: pd.Timestamp
    last: pd.Timestamp
    now: pd.Timestamp
    step: pd.Timedelta
    errors: tuple[str, ...]
    reason: str


class Reached(NamedTuple):
    """When a loss is reached: now, later than anything is predicted, or about a time between two others, if these are
    known."""

    is_past: bool = False
    is_far: bool = False
    about: pd.Timestamp | None = None
    soonest: pd.Timestamp | None = None
    latest: pd.Timestamp | None = None


@dataclass(frozen=True, eq=False)
class Standing:
    """A monitor, the time at which its page is written, in the time zone of the records, and a limit of slow loss.

    ``errors`` are the stages that failed, such as "update" where the newest records could not be evaluated.
    """

    monitor: Monitor
    now: pd.Timestamp
    limit: float
    errors: tuple[str, ...] = ()

    @classmethod
    def at(cls, monitor: Monitor, now: Time, limit: float, errors: Iterable[str] = ()) -> Standing:
        """Now is by the clock where no time is given."""
        return cls(monitor, as_moment(now, monitor.last_.tz), limit, tuple(dict.fromkeys(errors)))

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
        return self.status.records.newest is not None

    @property
    def last(self) -> pd.Timestamp:
        return self.monitor.last_

    @property
    def state(self) -> str:
        """The monitor's at the time of the page; not healthy either after an error, or with much stiffness lost."""
        said = self.status.state
        if said in ("healthy", "watch") and self.errors:
            return "not evaluated"
        return "attention" if said == "healthy" and self.worn else said

    @property
    def worn(self) -> list[str]:
        """Groups whose slow loss of stiffness has reached the limit."""
        drift = self.monitor.drift_
        if drift is None:
            return []
        return [str(name) for name in drift.index[drift["significant"].astype(bool) & (drift["change"] <= -self.limit)]]

    @property
    def alarm_since(self) -> pd.Timestamp:
        """When the first of the open events began that make an alarm."""
        starts = [
            opened["start"].min() for kind in ("damage", "measurement or structure") if len(opened := self.opened(kind))
        ]
        return min(starts, default=self.last)

    @property
    def is_set_aside(self) -> bool:
        """Whether a response that moved too far is all that makes an alarm."""
        return not len(self.opened("damage")) and bool(len(self.opened("measurement or structure")))

    @property
    def doubt(self) -> Doubt:
        """Why it is not known whether the structure is healthy, and since when."""
        since, reason = self.last, ""
        if self.errors:
            kind = "error"
        elif not self.has_records:
            kind = "no records"
        elif self.status.records.is_ahead or self.status.records.is_late:
            kind = "ahead" if self.status.records.is_ahead else "late"
        else:
            kind, since = "reason", self.not_evaluated_since
            reason = str(self.evaluations["reason"].iloc[-1]) if len(self.evaluations) else ""
        return Doubt(kind, since, self.last, self.now, self.status.records.step, self.errors, reason)

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

    @property
    def recent(self) -> tuple[int, int]:
        """How many records came in the month up to the newest one, and how many of them were evaluated."""
        days = self.monitor.days_
        days = days[days.index > self.last - pd.Timedelta(days=31)]
        return int(days["n_records"].sum()), int(days["n_evaluated"].sum())

    @property
    def n_doubtful(self) -> int:
        """How many of the records of that month that were evaluated have a remark."""
        recent = self.evaluations[self.evaluations.index > self.last - pd.Timedelta(days=31)]
        return int(((recent["state"] != "not evaluated") & (recent["reason"] != "")).sum())

    @property
    def newest(self) -> Row | None:
        """The newest record, if it was evaluated."""
        rows = rows_of(self.evaluations.tail(1))
        return rows[0] if rows and np.isfinite(rows[0]["index"]) else None

    @cached_property
    def history(self) -> list[Row]:
        """Events, the newest first, each with the sensors that failed in its time."""
        return [{**event, "failed": self._failing(event)} for event in rows_of(self.events[::-1])]

    @property
    def waiting(self) -> list[int]:
        """Numbers of events that have ended and were not acknowledged; nobody has to explain a watch."""
        events = self.events[self.events["kind"] != "watch"]
        return events.index[events["end"].notna() & ~events["acknowledged"].astype(bool)].tolist()

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of events by kind."""
        return {str(kind): int(number) for kind, number in self.events["kind"].value_counts().items()}

    def _failing(self, event: Row) -> list[str]:
        """Sensors that failed in the time of an event, before the monitor had noticed."""
        faults, end = self.monitor.faults_, event["end"] or self.last
        during = [one for one in rows_of(faults) if one["since"] <= end and event["start"] < one["detected"] + DAY]
        return sorted({str(fault["column"]) for fault in during})

    @property
    def faults(self) -> list[Row]:
        """Faults of sensors, the newest first."""
        return rows_of(self.monitor.faults_[::-1])

    @property
    def drift(self) -> list[Row] | None:
        """Change of the stiffness of each group, and when a loss of the limit is reached; None where it is not
        followed."""
        found = self.monitor.drift_
        if found is None:
            return None
        return [{**row, "reached": self._reached(row)} for row in rows_of(found)]

    def _reached(self, row: Row) -> Reached | None:
        """When a loss of so much is reached at this rate, with two standard errors; None if it is not."""
        left = self.limit + row["change"]
        if not np.isfinite(row["per_year"]) or (left > 0 and row["per_year"] >= 0):
            return None
        if left <= 0:
            return Reached(is_past=True)
        rate, error = -row["per_year"], row["per_year_error"]
        speeds = [rate, rate + 2 * error, rate - 2 * error] if np.isfinite(error) else [rate]
        spans = [left / speed if speed > 0 else np.inf for speed in speeds]
        if spans[0] > 100:  # years, beyond which nothing is predicted
            return Reached(is_far=True)
        return Reached(False, False, *(self.last + span * YEAR if span <= 100 else None for span in spans))

    @property
    def unknown(self) -> dict[str, Any]:
        """How many records were not evaluated, why, as far as that is kept, and how many days had no record."""
        counts, days = self.monitor.counts_, self.monitor.days_
        is_unknown = self.evaluations["state"] == "not evaluated"
        remarks = self.evaluations.loc[~is_unknown, "reason"]
        explained = int(is_unknown.sum()) + sum(int(counts.get(name, 0)) for name in ("n_too_late", "n_ahead"))
        n_days = (days.index[-1] - days.index[0]).days + 1
        return {
            "number": int(counts["n_not_evaluated"]),
            "forgotten": int(counts["n_not_evaluated"]) - explained,
            "n_days": n_days,
            "silent": n_days - len(days),
            "noticed": [
                name for name, number in counts.items() if number and name not in ("n_records", "n_not_evaluated")
            ],
            "since": self.evaluations.index[0] if len(self.evaluations) else None,
            "reasons": list(self.evaluations.loc[is_unknown, "reason"].value_counts().items()),
            "remarks": list(remarks[remarks != ""].value_counts().items()),
        }


class Span(NamedTuple):
    """What a drawing of the damage index shows: the records of the last "month", the days of the last "year", or those
    of all of the "service"."""

    name: str
    start: pd.Timestamp
    table: pd.DataFrame
    number: int
    n_alarms: int
    n_unknown: int
    highest: float


def spans_of(standing: Standing) -> list[Span]:
    """The last month, if records of it are kept, the last year and, where service is longer, all of it."""
    found = []
    if len(standing.evaluations):
        start = standing.last - pd.Timedelta(days=31)
        shown = standing.evaluations[standing.evaluations.index >= start]
        n_alarms, n_unknown = (int((shown["state"] == state).sum()) for state in ("alarm", "not evaluated"))
        highest = shown["index"].max()
        found.append(Span("month", start, shown[["index", "threshold"]], len(shown), n_alarms, n_unknown, highest))
    whole = standing.monitor.days_.index[0]
    starts = {"year": midnight(max(standing.last - YEAR, whole))}
    if standing.last - whole > pd.Timedelta(days=400):
        starts["service"] = whole
    for name, start in starts.items():
        days = standing.monitor.days_[standing.monitor.days_.index >= start]
        number = len(midnights_between(days.index[0], standing.last))
        n_unknown = number - int((days["n_evaluated"] > 0).sum())
        values = {"highest of the day": days["index_max"], "median": days["index_median"]}
        table = pd.DataFrame(values).assign(threshold=standing.monitor.threshold_)
        n_alarms = int((days["n_alarms"] > 0).sum())
        found.append(Span(name, start, table, number, n_alarms, n_unknown, days["index_max"].max()))
    return found


def draw_span(standing: Standing, span: Span, title: str, alt: str) -> Html:
    """Damage index of each record, or the highest and the median of each day."""
    what = "all of the service" if span.name == "service" else f"the last {span.name}"
    values = Values(f"damage index of {what}", span.table.rename_axis("date"))
    by = "record" if span.name == "month" else "day"

    def make() -> DamageIndexDisplay:
        display = DamageIndexDisplay.from_estimator(standing.monitor, start=span.start, by=by)
        fold_legend(display.figure_, "outside lower center")
        return display

    return draw(make, alt, title, height=3.4, values=values)


def draw_drift(standing: Standing, alt: str) -> list[Html]:
    """Change of each group's stiffness by day; nothing where none is known yet."""
    changes = 100 * standing.monitor.days_.filter(regex="^drift ").astype(float)
    shown = changes.rename(columns=lambda name: name.removeprefix("drift "))
    if not shown.notna().any(axis=None):
        return []
    table = shown.rename(columns="change of {} (%)".format).rename_axis("date")
    make = partial(PredictionDisplay.from_predictions, shown, unit="%", kind="lines", quantity="change")
    return [draw(make, alt, height=1.0 + 1.4 * shown.shape[1], values=Values("change of stiffness", table))]


def monitor_facts(standing: Standing, structure: Structure | None = None) -> dict[str, Any]:
    """What the template of the page on a monitor is given."""
    monitor = standing.monitor
    detector = monitor.detector_
    parts = dict(detector.named_steps) if hasattr(detector, "named_steps") else {"detector": detector}
    parts = {"monitor": monitor, **parts, "model": monitor.fem}
    return {
        "written": standing.now,
        "standing": standing,
        "monitor": monitor,
        "structure": structure,
        "draw": {one.__name__: one for one in (draw_detectable, draw_drift, draw_span, losses_on, spans_of)},
        "settings": settings_of(parts, but=("monitor: detector", "monitor: fem")),
        "columns": _columns(monitor),
        "versions": versions(),
        "identified": None,
        "fleet": None,
    }


def _columns(monitor: Monitor) -> dict[str, list[str]]:
    """Names of the columns with their units: responses, and temperatures."""
    found: dict[str, list[str]] = {"responses": [], "temperatures": []}
    for name, unit in monitor.units_.items():
        kind = "responses" if name in set(monitor.targets_) else "temperatures"
        says_it = f"[{unit}]" in str(name) or f"({unit})" in str(name)
        found[kind].append(f"{name}" if says_it or not unit else f"{name} ({unit})")
    return found
