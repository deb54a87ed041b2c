"""Drawings of a page on a monitor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from skthermo._tables.frames import midnight, midnights_between
from skthermo._tables.text import counted, percent, significant
from skthermo.fem import Structure
from skthermo.plotting import MonitorDisplay, StructureDisplay
from skthermo.reporting._chart import chart
from skthermo.reporting._figures import draw, fold_legend
from skthermo.reporting._html import Html
from skthermo.reporting._readable import Values
from skthermo.reporting.service._standing import MONTH, YEAR, Standing

LONGEST = pd.Timedelta(days=400)  # longer services are drawn as a whole, too


def draw_month(standing: Standing) -> list[Html]:
    """Damage index of each record in the month before the newest one; nothing without any."""
    if not len(standing.evaluations):
        return []
    start = standing.last - MONTH
    evaluated = standing.evaluations[standing.evaluations.index >= start]
    alarms, unknown = ((evaluated["state"] == state).sum() for state in ("alarm", "not evaluated"))
    alt = (
        f"Damage index of {counted(len(evaluated), 'record')} of the last month: {alarms:,} in alarm, {unknown:,} not "
        f"evaluated. {_highest(evaluated['index'])}"
    )
    values = Values("damage index of the last month", evaluated[["index", "threshold"]].rename_axis("date"))
    title = "The last month, by record"
    return [_drawn(standing, alt, title, values=values, start=start, by="record", parts=["index"])]


def draw_days(standing: Standing) -> list[Html]:
    """Highest and median damage index of each day in the last year and, where service is longer, in all of it."""
    drawn = []
    whole = standing.monitor.days_.index[0]
    spans = {"The last year, by day": midnight(max(standing.last - YEAR, whole))}
    if standing.last - whole > LONGEST:
        spans["All of the service, by day"] = whole
    for title, start in spans.items():
        days = standing.monitor.days_[standing.monitor.days_.index >= start]
        n_days = len(midnights_between(days.index[0], standing.last))
        n_without = n_days - int((days["n_evaluated"] > 0).sum())
        alt = (
            f"{title}: {counted(n_days, 'day')}, {int((days['n_alarms'] > 0).sum()):,} with an alarm, "
            f"{n_without:,} without an evaluated record. {_highest(days['index_max'])}"
        )
        values = Values(f"damage index {title.split(',')[0]}", _daily(days, standing.monitor.threshold_))
        drawn.append(_drawn(standing, alt, title, values=values, start=start, parts=["index"]))
    return drawn


def draw_detectable(structure: Structure | None, losses: Mapping[str, float]) -> list[Html]:
    """The smallest loss of stiffness of each member's group that raises an alarm; nothing where none does."""
    groups = [] if structure is None else structure.groups
    seen = {name: 100 * loss for name, loss in losses.items() if name in groups and np.isfinite(loss)}
    if structure is None or not seen:
        return []
    alt = "Drawing of the structure. Smallest losses that raise an alarm: " + "; ".join(
        f"{name} {percent(loss / 100, '.2g')}" for name, loss in seen.items()
    )

    def make() -> StructureDisplay:
        display = StructureDisplay.from_structure(structure, seen, label="smallest loss (%)")
        fold_legend(display.figure_, "lower center" if structure.dimension == 3 else "outside lower center")
        return display

    return [draw(make, f"{alt}.", height=None, width=6.2)]


def chart_year(standing: Standing) -> Html:
    """Highest damage index of each day in the last year, without matplotlib, for a page among many."""
    days = standing.days_until(standing.last)
    damage = standing.events[standing.events["kind"] == "damage"]
    ends = damage["end"].fillna(standing.last)
    spans = [
        (start.tz_localize(None), end.tz_localize(None))
        for start, end in zip(damage["start"], ends, strict=True)
        if end.tz_localize(None) >= days.index[0]
    ]
    alarms = int((days["n_alarms"] > 0).sum())
    alt = (
        f"Damage index of {counted(len(days), 'day')}: {alarms:,} with an alarm, "
        f"{int(days['index_max'].isna().sum()):,} without an evaluated record. {_highest(days['index_max'])}"
    )
    return chart(days["index_max"], days["n_alarms"] > 0, standing.monitor.threshold_, alt, spans)


def draw_drift(standing: Standing) -> list[Html]:
    """Change of each group's stiffness by day; nothing where none is known yet."""
    days = standing.monitor.days_
    columns = [name for name in days.columns if str(name).startswith("drift ")]
    if not columns or not days[columns].notna().any(axis=None):
        return []
    names = ", ".join(str(name).removeprefix("drift ") for name in columns)
    alt = f"Change of stiffness over time of the groups {names}."
    changes = 100 * days[columns].astype(float)
    changes = changes.set_axis([f"change of {str(name).removeprefix('drift ')} (%)" for name in columns], axis=1)
    values = Values("change of stiffness", changes.rename_axis("date"))
    return [_drawn(standing, alt, parts=["drift"], height=3.0, values=values)]


def _daily(days: pd.DataFrame, threshold: float) -> pd.DataFrame:
    """Damage index of each day, for those who read it."""
    columns = {"highest of the day": days["index_max"], "median": days["index_median"], "threshold": threshold}
    return pd.DataFrame(columns).rename_axis("date")


def _drawn(
    standing: Standing, alt: str, title: str = "", *, values: Values, height: float = 3.4, **options: object
) -> Html:
    """A display of the monitor, with its legend below."""

    def make() -> MonitorDisplay:
        display = MonitorDisplay.from_estimator(standing.monitor, **options)
        fold_legend(display.figure_, "outside lower center")
        return display

    return draw(make, alt, title, height=height, values=values)


def _highest(index: pd.Series) -> str:
    highest = index.max()
    return f"The highest index is {significant(highest, 3)}." if highest == highest else "None was evaluated."
