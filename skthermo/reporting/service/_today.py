"""Section of a page on a monitor: how the structure is today."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from skthermo._tables.text import counted, listed, significant
from skthermo.reporting._html import Html, Section, bullets, element, joined, paragraphs, section
from skthermo.reporting.service._changes import drift_sentences, sensor_sentences
from skthermo.reporting.service._standing import ALARM, ATTENTION, HEALTHY, NOT_EVALUATED, Standing, moment

EXCLAMATION = "M12 5.5v8.5M12 17.2v1.3"
SYMBOLS = {HEALTHY: "M6 12.5l4 4 8-9", ALARM: EXCLAMATION, ATTENTION: EXCLAMATION, NOT_EVALUATED: "M6 12h12"}
"""Lines within a circle: a tick, an exclamation mark, a dash."""

MOST_NAMED = 5  # largest number of events in a sentence


def today(standing: Standing) -> Section:
    """State, and what an owner should know, in a few sentences."""
    sentences = [*_newest(standing), *_events(standing), *sensor_sentences(standing)]
    sentences += drift_sentences(standing)
    words = (
        "A record is one measurement of temperatures and natural frequencies. Its damage index says how far the "
        "frequencies are from those of the healthy structure in the same weather. An event begins when the index "
        "exceeds its threshold, and ends when it has stayed low for a while. An alarm does not prove damage, and "
        "healthy means that no change is seen, not that there is none."
    )
    state = banner(standing.state, moment(standing.now), standing.headline(), standing.explanation())
    return first_section("Today", state, sentences, _what_to_do(standing), words)


def first_section(title: str, state: Html, sentences: Iterable[str], steps: Sequence[str], words: str) -> Section:
    """What an owner reads first: the state, what is known, what to do, and what the words mean."""
    parts = [state, bullets(sentences)]
    parts += [element("h3", "What to do"), bullets(steps)] if steps else []
    return section("today", title, *parts, element("h3", "What the words mean"), paragraphs(words))


def banner(state: str, written: str, headline: str, *sentences: str) -> Html:
    """A state as a symbol, a line and some sentences in its colour, and the time when the page was written."""
    as_of = (
        f"As of {written}, when this page was written. A page that is older than it should be says nothing of today."
    )
    lines = [element("p", headline, class_="headline"), *(element("p", text) for text in sentences)]
    words = element("div", joined([*lines, element("p", as_of, class_="soft")]))
    return element("div", symbol(state), words, class_=f"state {state.replace(' ', '-')}")


def symbol(state: str) -> Html:
    """A state as a drawing within a circle, in the colour that stands around it."""
    path = element("path", d=SYMBOLS[state])
    return element("svg", element("circle", cx=12, cy=12, r=11), path, viewBox="0 0 24 24", aria_hidden="true")


def _newest(standing: Standing) -> list[str]:
    if not standing.has_records:
        return []
    newest = standing.evaluations.iloc[-1] if len(standing.evaluations) else None
    text = f"The newest record is of {moment(standing.last)}; one usually comes every {standing.step_text}."
    if newest is not None and newest["index"] == newest["index"]:
        text += f" Its damage index is {significant(newest['index'], 3)}; an event begins above "
        text += f"{significant(newest['threshold'], 3)}."
    return [text, standing.recent()]


def _events(standing: Standing) -> list[str]:
    sentences = []
    for number, event in standing.events[standing.events["end"].isna()].iterrows():
        text = f"Event {number} ({event['kind']}) has been open since {moment(event['start'])}"
        text += f"; modes that drive it: {event['modes']}." if event["modes"] else "."
        sentences.append(text)
    if not len(standing.opened("damage")):
        sentences.insert(0, "No damage event is open.")
    waiting = _waiting(standing)
    if len(waiting) == 1:
        sentences.append(f"Event {waiting[0]} has ended, and nobody has said yet what it was.")
    elif waiting:
        shown = listed(waiting) if len(waiting) <= MOST_NAMED else f"{waiting[0]} to {waiting[-1]}"
        number = counted(len(waiting), "event")
        sentences.append(f"{number}: {shown} have ended, and nobody has said yet what they were.")
    return sentences


def _waiting(standing: Standing) -> list[int]:
    """Numbers of events that have ended and were not acknowledged."""
    events = standing.events
    return events.index[events["end"].notna() & ~events["acknowledged"].astype(bool)].tolist()


def _what_to_do(standing: Standing) -> list[str]:
    steps = []
    if standing.state == ATTENTION:
        steps.append("Ask an engineer to look at the parts that have lost stiffness.")
    if standing.state == ALARM:
        steps.append(
            "Ask an engineer to look at the structure, beginning with what the modes named above depend on, and at the "
            "raw records: works on the structure, unusual loads or ice may be the cause too."
        )
    if standing.is_silent or standing.is_ahead or standing.error or not standing.has_records:
        steps.append("Check the data logger, its clock, and the job that hands records to the monitor.")
    elif standing.state == NOT_EVALUATED:
        steps.append("Check the sensors and modes that the reason names: without them, nothing is watched.")
    if len(standing.failed):
        steps.append("Have the failed sensors repaired; the section on sensors lists them.")
    if _waiting(standing) or len(standing.events[standing.events["end"].isna()]):
        steps.append("When it is known what an event was, acknowledge it, so that the monitor can learn from it.")
    return steps
