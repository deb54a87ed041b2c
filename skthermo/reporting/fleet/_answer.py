"""What an owner of many bridges should know first, in plain sentences."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import pandas as pd

from skthermo._tables.text import counted, counted_number, significant
from skthermo.reporting._html import Html, Section, element, paragraphs, section, table
from skthermo.reporting.fleet._bridge import CALLED, FAILED, OPEN, UNEXPLAINED, UNKNOWN_STATES, UNWATCHED, Bridge
from skthermo.reporting.service import ALARM, ATTENTION, HEALTHY, NOT_EVALUATED, banner, first_section

MOST_NAMED = 5  # largest number of bridges in a sentence

COUNTED = {
    ALARM: "in alarm",
    ATTENTION: "without an alarm, but with much stiffness lost slowly",
    NOT_EVALUATED: "not evaluated by the monitor",
    FAILED: "that could not be fitted",
    UNWATCHED: "without a monitor",
    HEALTHY: "healthy",
}
"""States in words, the worst first."""


def answer(bridges: Sequence[Bridge], links: Mapping[Hashable, str], found: Any, written: str) -> Section:
    """How many bridges are in which state, which ones need somebody, and what to do."""
    numbers = pd.Series([bridge.state for bridge in bridges]).value_counts()
    counts = [f"{numbers[state]:,} {text}" for state, text in COUNTED.items() if numbers.get(state, 0)]
    unknown = int(sum(numbers.get(state, 0) for state in UNKNOWN_STATES))
    unexplained = sum(bridge.place == UNEXPLAINED for bridge in bridges)
    state = ALARM if ALARM in numbers else ATTENTION if unexplained or ATTENTION in numbers else HEALTHY
    state = NOT_EVALUATED if unknown and state == HEALTHY else state
    headline = _headline(numbers, len(bridges), unknown, unexplained)
    standing = banner(state, written, headline, f"Of {counted(len(bridges), 'bridge')}: {'; '.join(counts)}.")
    known = [
        _named(bridges, links, CALLED, "In alarm, and standing out among all bridges"),
        _named(bridges, links, OPEN, "In alarm, but no more than chance may give among so many bridges"),
        _named(bridges, links, UNEXPLAINED, "An event has ended, and nobody has said what it was"),
        *_false_alarms(found),
    ]
    if unknown:
        known.append(
            f"Nothing is known of {counted(unknown, 'bridge')}: without a judged record there is no alarm, and no "
            "alarm there does not mean healthy."
        )
    words = (
        "A monitor compares the natural frequencies of a bridge with those of its healthy time in the same weather. "
        "An event begins when its damage index exceeds a threshold. An alarm does not prove damage, and healthy means "
        "that no change is seen, not that there is none."
    )
    known = [text for text in known if text]
    return first_section("The bridges today", standing, known, _steps(bridges), words)


def _headline(numbers: pd.Series, total: int, unknown: int, unexplained: int) -> str:
    all_of = f"{total:,}"
    if ALARM in numbers:
        return f"{numbers[ALARM]:,} of {all_of} bridges {_is(numbers[ALARM])} in alarm"
    if unexplained:
        return f"No alarm now, but {unexplained:,} of {all_of} bridges had one that nobody has explained"
    if ATTENTION in numbers:
        return f"No alarm, but {numbers[ATTENTION]:,} of {all_of} bridges lost much stiffness slowly"
    if unknown:
        return f"No alarm, but nothing is known of {unknown:,} of {all_of} bridges"
    return f"No alarm: {'the bridge is' if total == 1 else f'all {all_of} bridges are'} healthy"


def _is(number: int) -> str:
    return "is" if number == 1 else "are"


def _named(bridges: Sequence[Bridge], links: Mapping[Hashable, str], place: int, text: str) -> Html:
    """A sentence that names the bridges of one place, the worst first; nothing without any."""
    names = [bridge.name for bridge in bridges if bridge.place == place]
    if not names:
        return Html()
    shown = [element("a", name, href=links[name]) for name in names[:MOST_NAMED]]
    rest = f" and {len(names) - MOST_NAMED:,} more, in the table" if len(names) > MOST_NAMED else ""
    listed = [part for one in shown for part in (", ", one)][1:]
    return element("span", element("strong", f"{text}: "), *listed, f"{rest}.")


def _false_alarms(found: Any) -> list[str]:
    """How many false alarms all monitors raise, which bridges stand out, and how many of these are false."""
    if found is None:
        return []
    n_false = counted_number(float(significant(found.promised_false_per_year, 2)), "false alarm")
    told = f"Even if all bridges stay healthy, their monitors together raise about {n_false} a year."
    if not len(found.table):
        return [told, "There has been no damage event in the last year that was not said to be harmless."]
    return [told, f"{counted(len(found.table), 'damage event')} in the last year.", *found.summary().splitlines()]


def _steps(bridges: Sequence[Bridge]) -> list[str]:
    states, places = {bridge.state for bridge in bridges}, {bridge.place for bridge in bridges}
    steps = []
    if ALARM in states:
        steps.append(
            "Have the bridges in alarm looked at, from the top of the table down. Those further down may be false "
            "alarms; look at their records first."
        )
    if UNEXPLAINED in places:
        steps.append("Find out what the events were that have ended, and acknowledge them.")
    if ATTENTION in states:
        steps.append("Ask an engineer whether the bridges that lost stiffness slowly can bear it.")
    if NOT_EVALUATED in states:
        steps.append("Check loggers and sensors of the bridges that are not evaluated.")
    if FAILED in states:
        steps.append("Ask an engineer to look at the records and the models of the bridges that could not be fitted.")
    if UNWATCHED in states:
        steps.append("Have monitors fitted for the bridges without one.")
    return steps or ["Nothing; look at the date of this page."]


def warnings_of_all(warned: pd.DataFrame, errors: pd.DataFrame) -> Section:
    """How many bridges gave which warnings, and which errors there were."""
    parts = []
    if len(warned):
        kinds = warned.groupby("kind").agg(n=("bridge", "nunique"), first=("message", "first")).sort_values("n")[::-1]
        rows = [
            [str(kind), f"{row['n']:,}", element("span", row["first"], class_="text")] for kind, row in kinds.iterrows()
        ]
        text = "Warnings of the fits, by kind. Those of a bridge stand on its own page."
        parts += [paragraphs(text), table("Warnings by kind.", ["Kind", "Bridges", "The first of them"], rows)]
    else:
        parts.append(paragraphs("There was no warning."))
    if len(errors):
        rows = [[str(row["bridge"]), str(row["error"])] for _, row in errors.iterrows()]
        parts += [element("h3", "Errors"), table("What failed.", ["Bridge", "Error"], rows, is_cards=True)]
    return section("warnings", "Warnings and errors", *parts, link="Warnings")
