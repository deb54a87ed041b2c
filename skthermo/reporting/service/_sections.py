"""The page on a monitor: its sections in their order, and those on records."""

from __future__ import annotations

import pandas as pd

from skthermo._tables.text import counted, share_text
from skthermo.monitoring import Monitor
from skthermo.reporting._html import Html, Section, element, figure, paragraphs, section, table
from skthermo.reporting._settings import parameters, settings
from skthermo.reporting.service._changes import drift, sensors
from skthermo.reporting.service._events import events, promise
from skthermo.reporting.service._figures import chart_year, draw_days, draw_month
from skthermo.reporting.service._standing import NOT_EVALUATED, Standing, moment
from skthermo.reporting.service._today import today

MOST_REASONS = 12  # largest number of reasons in a table


def monitor_page(standing: Standing, *, is_one_of_many: bool = False) -> tuple[Html, list[Section]]:
    """What stands above the sections, and these, the settings last; one of many has smaller drawings."""
    return paragraphs(*introduction(standing.monitor)), [
        today(standing),
        events(standing),
        _index(standing, is_one_of_many),
        drift(standing, is_drawn=not is_one_of_many),
        sensors(standing),
        not_evaluated(standing),
        promise(standing),
        _settings(standing.monitor),
    ]


def introduction(monitor: Monitor) -> list[str]:
    """What the monitor learned from, and how many records have come since."""
    first, last = (moment(time) for time in monitor.trained_.index[[0, -1]])
    n_records = int(monitor.counts_["n_records"])
    sentences = [
        f"The monitor learned from records of the healthy structure from {first} to {last}, and compares new ones with "
        f"them. Since the baseline, {counted(n_records, 'record')} {'has' if n_records == 1 else 'have'} come."
    ]
    if monitor.since_ is not None:
        sentences.append(
            f"The structure was changed: as it is since {moment(monitor.since_)}, it counts as healthy. Older records, "
            "moved to its new frequencies, stand for weather that has not come since."
        )
    return sentences


def _index(standing: Standing, is_small: bool) -> Section:
    """Damage indices of the last month and of the last year; a small drawing shows the days of the year only."""
    title = "Damage index"
    if not standing.has_records:
        return section("index", title, paragraphs("No record has come since the baseline."))
    if is_small:
        caption = (
            "Highest damage index of each day in the year up to the newest record, of "
            f"{moment(standing.last)}. Dots below the dashed line are as the healthy structure; an event begins above "
            "it, and is shaded. Ticks at the bottom are days without an evaluated record: nothing is known of them."
        )
        return section("index", title, element("figure", chart_year(standing), element("figcaption", caption)))
    text = (
        f"The drawings end with the newest record, of {moment(standing.last)}. Points below the dashed line are as the "
        "healthy structure; an event begins above it. Grey ticks at the bottom are records or days that were not "
        "evaluated, days without any record among them: nothing is known of them."
    )
    drawn = [draw_month(standing)] if len(standing.evaluations) else []
    caption = "Damage index: of each record in the last month; the highest and the median of each day in longer times."
    return section("index", title, paragraphs(text), figure(caption, drawn + draw_days(standing)))


def not_evaluated(standing: Standing) -> Section:
    """How many records were not evaluated, and why."""
    counts, evaluated, days = standing.monitor.counts_, standing.evaluations, standing.monitor.days_
    title = "What was not evaluated"
    if not standing.has_records:
        return section("not_evaluated", title, paragraphs("No record has come since the baseline."))
    number, unknown = int(counts["n_records"]), int(counts["n_not_evaluated"])
    n_days = (days.index[-1] - days.index[0]).days + 1
    text = f"All of {counted(number, 'record')} were evaluated."
    if unknown:
        text = (
            f"Of {counted(number, 'record')} in service, {unknown:,} ({share_text(unknown / number)}) were not "
            "evaluated. They count neither as healthy nor as alarms: nothing is known of them."
        )
    silent = n_days - len(days)
    without = f"There was no record on {silent:,} of {counted(n_days, 'day')}." if silent else "Records came every day."
    is_unknown = evaluated["state"] == NOT_EVALUATED
    since = f"since {moment(evaluated.index[0])}" if len(evaluated) else ""
    forgotten = unknown - int(is_unknown.sum()) - int(counts.get("n_too_late", 0))
    older = (
        f"Why {forgotten:,} of them, which are older, were not evaluated is no longer kept." if forgotten > 0 else ""
    )
    parts = [paragraphs(text, older, without)]
    caption = f"Why records were not evaluated: those that are kept, {since}."
    parts.append(_reasons(caption, evaluated.loc[is_unknown, "reason"].replace("", "no reason given")))
    remarks = evaluated.loc[~is_unknown, "reason"]
    parts.append(_reasons(f"Remarks on records that were evaluated all the same, {since}.", remarks[remarks != ""]))
    names = {
        "n_repeated": "that came again, and were counted once",
        "n_late": "that came late, and were evaluated all the same",
        "n_too_late": "that came too late to be evaluated",
        "n_ahead": "that are stamped too far ahead, and are set aside",
        "n_left_out": "(single values) that came and were left out",
    }
    rows = [[f"Records {text}", f"{int(counts[name]):,}"] for name, text in names.items() if counts.get(name)]
    parts.append(table("What else was noticed.", ["What", "Number"], rows) if rows else Html())
    return section("not_evaluated", title, *parts)


def _reasons(caption: str, reasons: pd.Series) -> Html:
    """A table of reasons with their numbers, the most frequent first; nothing without any."""
    found = reasons.value_counts()
    rows = [[reason, f"{number:,}"] for reason, number in found.head(MOST_REASONS).items()]
    rest = found.iloc[MOST_REASONS:]
    rows += [[f"{len(rest):,} other reasons", f"{int(rest.sum()):,}"]] if len(rest) else []
    return table(caption, ["Reason", "Records"], rows) if rows else Html()


def _settings(monitor: Monitor) -> Section:
    """Parameters of the monitor, of its detector and of the model."""
    detector = monitor.detector_
    parts = dict(detector.named_steps) if hasattr(detector, "named_steps") else {"detector": detector}
    rows = parameters({"monitor": monitor, **parts, "model": monitor.fem}, but=("monitor: detector", "monitor: fem"))
    targets = [str(name) for name in monitor.targets_]
    others = [str(name) for name in monitor.baseline_.columns if name not in set(monitor.targets_)]
    rows += [["natural frequencies", element("code", ", ".join(targets))]]
    rows += [["temperatures", element("code", ", ".join(others) or "none")]]
    return settings("For the engineer who looks after this monitor.", "Settings of the monitor and its parts.", rows)
