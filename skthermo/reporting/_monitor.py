"""The page on a monitor: how a structure stands at the time at which it is written, and its drawings."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from functools import partial
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from skthermo._core.frames import DAY, YEAR, as_moment, midnight, midnights_between
from skthermo.fem import Structure
from skthermo.monitoring import Monitor
from skthermo.plotting import DamageIndexDisplay, PredictionDisplay
from skthermo.reporting._page import Drawing, Row, draw, draw_structure, rows_of, settings_of
from skthermo.reporting.answers import acknowledgement, counted_reasons, event_sentences, regime_text

Time: TypeAlias = str | datetime | None


class Standing:
    """What a monitor says at the time at which its page is written, by the clock where none is given.

    ``errors`` are the stages that failed, such as "update" where the newest records could not be evaluated; ``worn``
    are groups whose slow loss of stiffness has reached the limit; ``opened`` are events that have not ended, but for
    those to be watched; ``known`` are those that the owner has acknowledged as damage; ``waiting`` are numbers of
    events that have ended and were not acknowledged: nobody has to explain a watch, or a sensor. ``drift`` is None
    where it is not followed, and ``faults`` of sensors begin with the newest.
    """

    def __init__(self, monitor: Monitor, now: Time, limit: float, errors: Iterable[str] = ()):
        self.monitor, self.limit, self.errors = monitor, limit, tuple(dict.fromkeys(errors))
        self.now, self.last = as_moment(now, monitor.last_.tz), monitor.last_
        self.status, self.days, self.evaluations = monitor.status(self.now), monitor.days_, monitor.evaluations_
        self.has_records = self.status.records.newest is not None
        self.years = (self.last - self.days.index[0]) / YEAR if self.has_records else 0.0
        self.faults = rows_of(monitor.faults_[::-1])
        self.drift = None if monitor.drift_ is None else rows_of(monitor.drift_)
        self.worn = [one["name"] for one in self.drift or () if one["significant"] and one["change"] <= -limit]
        self.opened = [event for event in self.status.events if event["kind"] != "watch"]
        self.events = events = monitor.events_
        is_explained = events["acknowledged"].astype(bool)
        self.known = events[is_explained & ~events["harmless"].astype(bool)]
        is_open = events["end"].isna() | ~events["kind"].isin(["damage", "drift"])
        self.waiting = events.index[~is_open & ~is_explained].tolist()

    @property
    def state(self) -> str:
        """The monitor's at the time of the page; not healthy either after an error, or with much stiffness lost."""
        said = self.status.state
        if self.errors and said not in ("alarm", "drift"):
            return "not evaluated"
        return "attention" if said == "healthy" and self.worn else said

    @property
    def since(self) -> pd.Timestamp:
        """When the present state began; if it is healthy, after the last damage event or with the service."""
        kinds = {"alarm": ["damage", "fault"], "drift": ["drift"], "watch": ["watch"]}.get(self.state, [])
        if opened := [event["since"] for event in self.status.events if event["kind"] in kinds]:
            return min(opened)
        if self.state == "known damage":
            return self.known["start"].min()
        if self.state == "not evaluated":
            return self.status.records.evaluated or self.status.records.baseline_end
        ends = self.events.loc[self.events["kind"] == "damage", "end"]
        return ends.max() if len(ends) else self.days.index[0]

    @property
    def history(self) -> list[Row]:
        """Events, the newest first, each with the sensors that failed in its time, before the monitor had noticed."""
        rows = rows_of(self.events[::-1])
        for event in rows:
            start, end = event["start"] - DAY, event["end"] or self.last
            failing = [one for one in self.faults if one["since"] <= end and one["detected"] > start]
            event["failed"] = sorted({str(one["column"]) for one in failing})
        return rows

    @property
    def recent(self) -> Row:
        """How many records came in the month up to the newest one, were evaluated, and were so with a remark."""
        month = self.evaluations[self.evaluations.index > self.last - pd.Timedelta(days=31)]
        known = month[month["state"] != "not evaluated"]
        return {"n_records": len(month), "n_evaluated": len(known), "n_doubtful": int((known["reason"] != "").sum())}

    @property
    def unknown(self) -> Row:
        """How many records were not evaluated and why, remarks on others, and how many days had no record."""
        is_unknown, reasons = self.evaluations["state"] == "not evaluated", self.evaluations["reason"]
        n_days = len(midnights_between(self.days.index[0], self.days.index[-1]))
        return {
            "number": int(self.monitor.counts_["n_not_evaluated"]),
            "reasons": list(counted_reasons(reasons[is_unknown]).items()),
            "remarks": list(counted_reasons(reasons[~is_unknown]).items()),
            "n_days": n_days,
            "silent": n_days - len(self.days),
        }

    @property
    def spans(self) -> list[Row]:
        """What drawings of the damage index show: the records of the last "month", the days of the last "year" and,
        where it is longer, those of all of the "service"."""
        start, whole = self.last - pd.Timedelta(days=31), self.days.index[0]
        month = self.evaluations[self.evaluations.index >= start]
        n_alarms, n_unknown = (int((month["state"] == state).sum()) for state in ("alarm", "not evaluated"))
        counts = {"n_alarms": n_alarms, "n_unknown": n_unknown, "highest": month["index"].max()}
        table = month[["index", "threshold"]]
        spans = [{"name": "month", "start": start, "table": table, "number": len(month), **counts}]
        starts = {"year": midnight(max(self.last - YEAR, whole)), "service": whole}
        for name, start in list(starts.items())[: 2 if self.years > 1.1 else 1]:
            days = self.days[self.days.index >= start]
            number = len(midnights_between(days.index[0], self.last))
            table = pd.DataFrame({"highest of the day": days["index_max"], "median": days["index_median"]})
            table["threshold"] = self.monitor.threshold_
            counts = {"n_alarms": int((days["n_alarms"] > 0).sum()), "highest": days["index_max"].max()}
            counts["n_unknown"] = number - int((days["n_evaluated"] > 0).sum())
            spans.append({"name": name, "start": start, "table": table, "number": number, **counts})
        return spans

    def draw_span(self, span: Row, title: str, alt: str) -> Drawing:
        """Damage index of each record, or the highest and the median of each day."""
        by = "record" if span["name"] == "month" else "day"
        make = partial(DamageIndexDisplay.from_estimator, self.monitor, start=span["start"], by=by)
        name = f"damage index of {'all of the service' if span['name'] == 'service' else 'the last ' + span['name']}"
        table, place = span["table"].rename_axis("date"), "outside lower center"
        return draw(make, alt, title, height=3.4, name=name, table=table, legend=place)

    def draw_drift(self, alt: str) -> list[Drawing]:
        """Change of each group's stiffness by day; nothing where none is known yet."""
        shown = 100 * self.days.filter(regex="^drift ").rename(columns=lambda name: name[len("drift ") :]).astype(float)
        if not shown.notna().any(axis=None):
            return []
        table = shown.rename(columns="change of {} (%)".format).rename_axis("date")
        make = partial(PredictionDisplay.from_predictions, shown, unit="%", kind="lines", quantity="change")
        return [draw(make, alt, height=1.0 + 1.4 * shown.shape[1], name="change of stiffness", table=table)]


def monitor_facts(standing: Standing, structure: Structure | None = None) -> dict[str, Any]:
    """What the template of the page on a monitor is given."""
    monitor = standing.monitor
    parts = {"monitor": monitor, "detector": monitor.detector_, "model": monitor.fem}
    groups = monitor.smallest_changes_.groups if structure is not None else {}
    losses = {name: loss for name, loss in groups.items() if name in structure.groups and np.isfinite(loss)}
    return {
        "written": standing.now,
        "standing": standing,
        "monitor": monitor,
        "losses": losses,
        "draw_detectable": partial(draw_structure, structure, losses=losses),
        "sentences_of": partial(event_sentences, monitor),
        "regimes": regime_text(monitor),
        "acknowledgement": acknowledgement,
        "call": None,
        "settings": settings_of(parts, but=("monitor: detector", "monitor: fem")),
        "identified": None,
        "fleet": None,
    }
