"""Drawings of a page on a monitor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from skthermo._core.frames import midnight, midnights_between
from skthermo.fem import Structure
from skthermo.plotting import DamageIndexDisplay, PredictionDisplay, StructureDisplay
from skthermo.reporting._chart import chart
from skthermo.reporting._figures import draw, fold_legend
from skthermo.reporting._html import Html
from skthermo.reporting._readable import Values
from skthermo.reporting.service._standing import MONTH, YEAR, Standing

LONGEST = pd.Timedelta(days=400)  # longer services are drawn as a whole, too


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
        start = standing.last - MONTH
        shown = standing.evaluations[standing.evaluations.index >= start]
        n_alarms, n_unknown = (int((shown["state"] == state).sum()) for state in ("alarm", "not evaluated"))
        highest = shown["index"].max()
        found.append(Span("month", start, shown[["index", "threshold"]], len(shown), n_alarms, n_unknown, highest))
    whole = standing.monitor.days_.index[0]
    starts = {"year": midnight(max(standing.last - YEAR, whole))}
    if standing.last - whole > LONGEST:
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


def losses_on(structure: Structure | None, losses: Mapping[str, float]) -> dict[str, float]:
    """Losses that raise an alarm, of groups that can be drawn."""
    groups = [] if structure is None else structure.groups
    return {name: loss for name, loss in losses.items() if name in groups and np.isfinite(loss)}


def draw_detectable(structure: Structure, losses: Mapping[str, float], alt: str) -> Html:
    """The smallest loss of stiffness of each member's group that raises an alarm."""

    def make() -> StructureDisplay:
        percents = {name: 100 * loss for name, loss in losses.items()}
        display = StructureDisplay.from_structure(structure, percents, label="smallest loss (%)")
        fold_legend(display.figure_, "lower center" if structure.dimension == 3 else "outside lower center")
        return display

    return draw(make, alt, height=None, width=6.2)


def chart_year(standing: Standing, alt: str) -> Html:
    """Highest damage index of each day in the last year, without matplotlib, for a page among many."""
    days = standing.days_until(standing.last)
    damage = standing.events[standing.events["kind"] == "damage"]
    ends = damage["end"].fillna(standing.last)
    spans = [
        (start.tz_localize(None), end.tz_localize(None))
        for start, end in zip(damage["start"], ends, strict=True)
        if end.tz_localize(None) >= days.index[0]
    ]
    return chart(days["index_max"], days["n_alarms"] > 0, standing.monitor.threshold_, alt, spans)


def draw_drift(standing: Standing, alt: str) -> list[Html]:
    """Change of each group's stiffness by day; nothing where none is known yet."""
    days = standing.monitor.days_
    columns = [name for name in days.columns if str(name).startswith("drift ")]
    if not columns or not days[columns].notna().any(axis=None):
        return []
    changes = 100 * days[columns].astype(float)
    changes = changes.set_axis([f"change of {str(name).removeprefix('drift ')} (%)" for name in columns], axis=1)
    values = Values("change of stiffness", changes.rename_axis("date"))
    shown = changes.set_axis([str(name).removeprefix("drift ") for name in columns], axis=1)

    def make() -> PredictionDisplay:
        return PredictionDisplay.from_predictions(shown, unit="%", kind="lines", quantity="change")

    return [draw(make, alt, height=1.0 + 1.4 * len(columns), values=values)]
