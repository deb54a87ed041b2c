"""Sections of a page on a monitor: events, and what its promise of few false alarms means."""

from __future__ import annotations

from collections.abc import Hashable

import pandas as pd

from skthermo._tables.text import counted, counted_number, duration_text, listed, significant
from skthermo.reporting._html import Section, element, paragraphs, section, table
from skthermo.reporting.service._standing import ONE_DAY, Standing, moment

MOST_LISTED = 30  # largest number of events in the table
COLUMNS = ["Event", "Kind", "Start", "End", "Highest index", "Modes", "Records", "Acknowledged", "Note"]


def events(standing: Standing) -> Section:
    """All events, the newest first."""
    known = standing.events
    if not len(known):
        text = "There has been no event." if standing.has_records else "No record has come yet, and so no event."
        return section("events", "Events", paragraphs(text))
    damage, others = (int(count) for count in ((known["kind"] == "damage").sum(), (known["kind"] != "damage").sum()))
    text = f"There {'has' if damage == 1 else 'have'} been {counted(damage, 'damage event')} so far"
    text += f", and {others:,} in which the structure was stiffer, which is reported but no damage." if others else "."
    rest = len(known) - MOST_LISTED
    older = f"The table lists the newest {MOST_LISTED}; {rest:,} older ones are in the monitor." if rest > 0 else ""
    rows = [_cells(standing, number, event) for number, event in known.iloc[::-1].head(MOST_LISTED).iterrows()]
    caption = "Events, the newest first, with the modes that drive each, the worst first, and its number of records."
    return section("events", "Events", paragraphs(text, older), table(caption, COLUMNS, rows, is_cards=True))


def _cells(standing: Standing, number: Hashable, event: pd.Series) -> list[object]:
    note = "; ".join(filter(None, [event["note"], _failing(standing, event)]))
    said = "yes, harmless" if event["harmless"] else "yes, not harmless" if event["acknowledged"] else "not yet"
    return [
        f"{number}",
        event["kind"],
        moment(event["start"], is_short=True),
        moment(event["end"], is_short=True) or element("strong", "still open"),
        f"{significant(event['peak'], 3)} on {moment(event['peak_time'], is_short=True)}",
        event["modes"] or "none named",
        f"{event['n_alarms']:,}",
        said,
        element("span", note, class_="text") if note else "",
    ]


def _failing(standing: Standing, event: pd.Series) -> str:
    """Sensors that failed in the time of an event, before the monitor had noticed."""
    faults = standing.monitor.faults_
    end = standing.last if pd.isna(event["end"]) else event["end"]
    at_that_time = [
        fault["since"] <= end and event["start"] < fault["detected"] + ONE_DAY for _, fault in faults.iterrows()
    ]
    names = sorted({str(name) for name in faults.loc[at_that_time, "column"]}) if any(at_that_time) else []
    return f"{listed(names)} failed at that time" if names else ""


def promise(standing: Standing) -> Section:
    """What was asked for, what is expected, and how many events there were."""
    monitor, promised = standing.monitor, standing.monitor.false_alarm_estimate_
    asked = counted_number(monitor.false_alarms_per_year, "false alarm")
    expected, years = promised.expected, standing.years
    number = int((standing.events["kind"] == "damage").sum())
    sentences = [
        f"The monitor is set so that a structure that stays healthy gives {asked} a year on average: an alarm without "
        "damage. Fewer would be bought with damage that is found later, or not at all.",
        f"Expected are {significant(expected, 2)} a year; in a single year there may be {promised.lowest:,} to "
        f"{promised.highest:,} by chance.",
    ]
    if standing.has_records:
        harmless = int(((standing.events["kind"] == "damage") & standing.events["harmless"].astype(bool)).sum())
        by_chance, time = significant(expected * years, 2), duration_of(years)
        seen = f"In {time} of service there {'was' if number == 1 else 'were'} {counted(number, 'damage event')}"
        seen += f", {harmless:,} of them said to be harmless" if number else ""
        sentences.append(f"{seen}. About {by_chance} false alarms were to be expected in this time.")
    unseen = getattr(promised, "unseen", "")
    if unseen:
        sentences.append(f"Nothing is promised for {unseen}, because the baseline has no records of that time of year.")
    sentences.append("The promise says nothing of damage that is missed: a study of detectability answers that.")
    rows = [
        ["Threshold, above which an event begins", significant(monitor.threshold_, 4)],
        ["Level at or below which the index stays before it ends", significant(monitor.clear_threshold_, 4)],
        ["Time for which it stays there", duration_text(pd.Timedelta(promised.rule.hold))],
        ["Years of baseline behind it", significant(promised.n_years, 2)],
        ["How the threshold was found", element("span", promised.method, class_="text")],
        ["Which changes are damage", {"both": "softening and stiffening"}.get(monitor.direction, monitor.direction)],
    ]
    return section(
        "promise",
        "What the promise means",
        paragraphs(*sentences),
        table("The rule for events, for the engineer.", ["What", "Value"], rows),
        link="The promise",
    )


def duration_of(years: float) -> str:
    """A time in years, or in days where it is short."""
    return f"{significant(years, 2)} years" if years >= 1 else counted(round(365.25 * years) + 1, "day")
