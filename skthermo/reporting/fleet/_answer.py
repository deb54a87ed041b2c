"""What an owner of many bridges should know first, in plain sentences."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import pandas as pd

from skthermo._tables.text import counted
from skthermo.reporting._html import Html, Section, element, paragraphs, section, table
from skthermo.reporting.fleet._bridge import FAILED, FAILURES, UNEXPLAINED, UNKNOWN_STATES, UNWATCHED, Bridge
from skthermo.reporting.service import banner, first_section

MOST_NAMED = 5  # largest number of bridges in a sentence

COUNTED = {
    "alarm": "in alarm",
    "watch": "to be watched, with a raised damage index but no alarm",
    "attention": "without an alarm, but with much stiffness lost slowly",
    "not evaluated": "not evaluated by the monitor",
    FAILED: "that could not be fitted",
    UNWATCHED: "without a monitor",
    "healthy": "healthy",
}
"""States in words, the worst first."""

STEPS = {
    "alarm": "Inspect the bridges in alarm, from the top of the table down; of those that are not significant, "
    "the records first.",
    "watch": "Look at the records of the bridges that are to be watched.",
    UNEXPLAINED: "Find out what the events were that have ended, and acknowledge them.",
    "attention": "Ask an engineer whether the bridges that lost stiffness slowly can bear it.",
    "not evaluated": "Check loggers and sensors of the bridges that are not evaluated.",
    FAILED: "Ask an engineer to look at the records and the models of the bridges that could not be fitted.",
    UNWATCHED: "Have monitors fitted for the bridges without one.",
}
"""What to do where a bridge has a state or a place."""


def answer(bridges: Sequence[Bridge], links: Mapping[Hashable, str], found: Any, written: str) -> Section:
    """How many bridges are in which state, which ones are in alarm and for how long, and what to do."""
    numbers = pd.Series([bridge.state for bridge in bridges]).value_counts()
    counts = [f"{numbers[state]:,} {text}" for state, text in COUNTED.items() if numbers.get(state, 0)]
    unknown = int(sum(numbers.get(state, 0) for state in UNKNOWN_STATES))
    unexplained = [bridge for bridge in bridges if bridge.place == UNEXPLAINED]
    state = "alarm" if "alarm" in numbers else "attention" if unexplained or "attention" in numbers else "healthy"
    state = "watch" if "watch" in numbers and state == "healthy" else state
    state = "not evaluated" if unknown and state == "healthy" else state
    headline = _headline(numbers, len(bridges), unknown, len(unexplained))
    standing = banner(state, written, headline, f"Of {counted(len(bridges), 'bridge')}: {'; '.join(counts)}.")
    alarms = [bridge for bridge in bridges if bridge.state == "alarm"]
    known = [
        _named(alarms, links, "In alarm"),
        _named(unexplained, links, "An event that would be significant has ended, and is not yet explained"),
        *([] if found is None else found.summary().splitlines()),
    ]
    if unknown:
        known.append(
            f"Nothing is known of {counted(unknown, 'bridge')}: without an evaluated record there is no alarm, and no "
            "alarm there does not mean healthy."
        )
    words = (
        "A monitor compares the natural frequencies of a bridge with those of its healthy time in the same weather. "
        "An event begins when its damage index exceeds a threshold for most of several records. An alarm does not "
        "prove damage, and healthy means that no change is seen, not that there is none."
    )
    return first_section("The bridges today", standing, [text for text in known if text], _steps(bridges), words)


def _headline(numbers: pd.Series, total: int, unknown: int, unexplained: int) -> str:
    all_of = f"{total:,}"
    if "alarm" in numbers:
        return f"{numbers['alarm']:,} of {all_of} bridges {_is(numbers['alarm'])} in alarm"
    if unexplained:
        return f"No alarm now, but {unexplained:,} of {all_of} bridges had one that nobody has explained"
    if "attention" in numbers:
        return f"No alarm, but {numbers['attention']:,} of {all_of} bridges lost much stiffness slowly"
    if "watch" in numbers:
        return f"No alarm, but {numbers['watch']:,} of {all_of} bridges {_is(numbers['watch'])} to be watched"
    if unknown:
        return f"No alarm, but nothing is known of {unknown:,} of {all_of} bridges"
    return f"No alarm: {'the bridge is' if total == 1 else f'all {all_of} bridges are'} healthy"


def _is(number: int) -> str:
    return "is" if number == 1 else "are"


def _named(bridges: Sequence[Bridge], links: Mapping[Hashable, str], text: str) -> Html:
    """A sentence that names bridges, the worst first, with how long they are in alarm and their small print."""
    if not bridges:
        return Html()
    notes = {one.name: [element("small", f" ({one.note})")] for one in bridges if one.note}
    shown = [
        element("span", element("a", one.name, href=links[one.name]), one.duration, *notes.get(one.name, ()))
        for one in bridges[:MOST_NAMED]
    ]
    rest = f" and {len(bridges) - MOST_NAMED:,} more, in the table" if len(bridges) > MOST_NAMED else ""
    listed = [part for one in shown for part in (", ", one)][1:]
    return element("span", element("strong", f"{text}: "), *listed, f"{rest}.")


def _steps(bridges: Sequence[Bridge]) -> list[str]:
    present = {bridge.state for bridge in bridges} | {bridge.place for bridge in bridges}
    return [text for what, text in STEPS.items() if what in present] or ["Nothing; look at the date of this page."]


def warnings_of_all(warned: pd.DataFrame, errors: pd.DataFrame) -> Section:
    """How many bridges gave which warnings, and which errors there were."""
    parts = []
    if len(warned):
        kinds = warned.groupby("kind").agg(n=("bridge", "nunique"), first=("message", "first")).sort_values("n")[::-1]
        rows = [
            [str(kind), f"{row['n']:,}", element("span", row["first"], class_="text")] for kind, row in kinds.iterrows()
        ]
        text = "Warnings of the fits, by kind. Those of a bridge are on its own page."
        parts += [paragraphs(text), table("Warnings by kind.", ["Kind", "Bridges", "The first of them"], rows)]
    else:
        parts.append(paragraphs("There was no warning."))
    parts += errors_of(in_words(errors))
    return section("warnings", "Warnings and errors", *parts, link="Warnings")


def in_words(errors: pd.DataFrame) -> pd.DataFrame:
    """Errors of bridges, and what failed in an owner's words."""
    return errors.assign(what=errors["stage"].map(FAILURES).fillna("Something failed"))


def errors_of(errors: pd.DataFrame, unread: str = "") -> list[Html]:
    """What failed, in an owner's words and in those of the program; nothing without errors."""
    rows = [[str(row["bridge"]), row["what"], _message(row["error"])] for _, row in errors.iterrows()]
    rows += [["monitor", "Its file cannot be read", _message(unread)]] if unread else []
    columns = ["Bridge", "What failed", "Message for the engineer"]
    return [element("h3", "Errors"), table("What failed.", columns, rows, is_cards=True)] if rows else []


def _message(error: object) -> Html:
    return element("code", error)
