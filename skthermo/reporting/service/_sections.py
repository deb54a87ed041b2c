"""The page on a monitor: its sections in their order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from skthermo._tables.text import (
    SPACE,
    capital,
    counted,
    counted_number,
    duration_text,
    listed,
    percent,
    probability_text,
    share_text,
    significant,
)
from skthermo.fem import Structure
from skthermo.monitoring import Monitor
from skthermo.reporting._html import Html, Section, bullets, element, figure, joined, paragraphs, section, table
from skthermo.reporting._settings import parameters, settings
from skthermo.reporting.service._figures import chart_year, draw_days, draw_detectable, draw_drift, draw_month
from skthermo.reporting.service._standing import (
    ONE_DAY,
    YEAR,
    Standing,
    moment,
)

MOST_REASONS = 12  # largest number of reasons in a table
MOST_LISTED = 30  # largest number of events in the table
MOST_NAMED = 5  # largest number of events in a sentence
N_ERRORS = 2  # standard errors on either side of an estimate
FARTHEST = 100.0  # years ahead, beyond which nothing is predicted
DETECTABLE = "What raises an alarm"
EXCLAMATION = "M12 5.5v8.5M12 17.2v1.3"
SYMBOLS = {
    "healthy": "M6 12.5l4 4 8-9",
    "watch": "M6 14l6-6 6 6",
    "alarm": EXCLAMATION,
    "attention": EXCLAMATION,
    "not evaluated": "M6 12h12",
}
"""Lines within a circle: a tick, an angle that points upwards, an exclamation mark, a dash."""
FAULTS = {
    "dead": "gives no value",
    "stuck": "repeats one value",
    "implausible": "shows implausible values",
    "offset": "has jumped",
    "drift": "drifts",
    "disagree": "contradicts another sensor",
    "swapped": "is swapped with another",
}
KINDS = {
    "watch": "in which the damage index was raised, below an alarm",
    "measurement or structure": "in which a response was set aside: its sensor, or the structure, has changed",
}


def monitor_page(
    standing: Standing, structure: Structure | None = None, *, is_one_of_many: bool = False
) -> tuple[Html, list[Section]]:
    """What stands above the sections, and these, the settings last; one of many has smaller drawings."""
    return paragraphs(*introduction(standing.monitor)), [
        today(standing),
        events(standing),
        _index(standing, is_one_of_many),
        drift(standing, is_drawn=not is_one_of_many),
        sensors(standing),
        not_evaluated(standing),
        false_alarms(standing),
        detectable(standing, structure),
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
            "moved to its new level, stand for weather that has not come since."
        )
    return sentences


def today(standing: Standing) -> Section:
    """State, and what an owner should know, in a few sentences."""
    sentences = [*_newest(standing), *_open_events(standing), *sensor_sentences(standing), *drift_sentences(standing)]
    smallest = capital(f"{standing.monitor.smallest_changes_}")
    sentences.append(f"{smallest}, in weather like that of the baseline. Smaller changes count as healthy.")
    words = (
        "A record is one measurement of temperatures and responses, such as natural frequencies. Its damage index says "
        "how far the responses are from those of the healthy structure in the same weather. An event begins when the "
        "index exceeds its threshold, and ends when it has stayed low for a while. An alarm does not prove damage, and "
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
    text = f"The newest record is of {moment(standing.last)}; one usually comes every {standing.step_text}."
    newest = standing.evaluations.iloc[-1] if len(standing.evaluations) else None
    if newest is not None and newest["index"] == newest["index"]:
        text += f" Its damage index is {significant(newest['index'], 3)}; an event begins above "
        text += f"{significant(newest['threshold'], 3)}."
    return [text, standing.recent()]


def _open_events(standing: Standing) -> list[str]:
    sentences = [] if len(standing.opened("damage")) else ["No damage event is open."]
    for number, event in standing.events[standing.events["end"].isna()].iterrows():
        text = f"Event {number} ({event['kind']}) has been open since {moment(event['start'])}"
        text += f"; modes that drive it: {event['modes']}." if event["modes"] else "."
        sentences.append(f"{text} {_explained(event)}".rstrip())
    waiting = _waiting(standing)
    if len(waiting) == 1:
        sentences.append(f"Event {waiting[0]} has ended, and nobody has said yet what it was.")
    elif waiting:
        shown = listed(waiting) if len(waiting) <= MOST_NAMED else f"{waiting[0]} to {waiting[-1]}"
        number = counted(len(waiting), "event")
        sentences.append(f"{number}: {shown} have ended, and nobody has said yet what they were.")
    return sentences


def _explained(event: pd.Series) -> str:
    """The parts whose loss of stiffness explains an event."""
    return f"A loss of stiffness of {event['groups']} explains most of it." if event["groups"] else ""


def _waiting(standing: Standing) -> list[int]:
    """Numbers of events that have ended and were not acknowledged; nobody has to explain a watch."""
    events = standing.events[standing.events["kind"] != "watch"]
    return events.index[events["end"].notna() & ~events["acknowledged"].astype(bool)].tolist()


def _what_to_do(standing: Standing) -> list[str]:
    steps = []
    if standing.state == "watch":
        steps.append("Look at the raw records and at the weather, and wait for the next days.")
    if standing.state == "attention":
        steps.append("Ask an engineer to look at the parts that have lost stiffness.")
    if len(standing.opened("damage")):
        parts = listed(list(dict.fromkeys(filter(None, standing.opened("damage")["groups"]))))
        first = parts or "what the modes named above depend on"
        steps.append(
            f"Ask an engineer to look at the structure, beginning with {first}, and at the raw records: works on the "
            "structure, unusual loads or ice may be the cause too."
        )
    if len(standing.opened("measurement or structure")):
        steps.append(
            "The sensor or the structure has changed where a response was set aside: look at both. If it is the "
            "sensor, acknowledge the event as harmless: the other responses are evaluated from then on."
        )
    if standing.status.is_late or standing.status.is_ahead or standing.error or not standing.has_records:
        steps.append("Check the data logger, its clock, and the job that hands records to the monitor.")
    elif standing.state == "not evaluated":
        steps.append("Check the sensors and modes that the reason names: without them, nothing is watched.")
    if len(standing.failed):
        steps.append("Have the failed sensors repaired; the section on sensors lists them.")
    if _waiting(standing) or (standing.events["end"].isna() & (standing.events["kind"] != "watch")).any():
        steps.append("When it is known what an event was, acknowledge it, so that the monitor can learn from it.")
    return steps


def events(standing: Standing) -> Section:
    """All events, the newest first."""
    known = standing.events
    if not len(known):
        text = "There has been no event." if standing.has_records else "No record has come yet, and so no event."
        return section("events", "Events", paragraphs(text))
    counts = known["kind"].value_counts()
    damage = int(counts.get("damage", 0))
    text = f"There {'has' if damage == 1 else 'have'} been {counted(damage, 'damage event')} so far"
    others = [f"{counts[kind]:,} {what}" for kind, what in KINDS.items() if counts.get(kind)]
    text = "; and ".join([text, *others]) + "."
    rest = len(known) - MOST_LISTED
    older = f"The table lists the newest {MOST_LISTED}; {rest:,} older ones are in the monitor." if rest > 0 else ""
    columns = ["Event", "Kind", "Start", "End", "Highest index", "Modes", "Parts", "Records", "Acknowledged", "Note"]
    rows = [_cells(standing, number, event) for number, event in known.iloc[::-1].head(MOST_LISTED).iterrows()]
    caption = (
        "Events, the newest first. Highest index: the largest damage index of the event; the threshold is "
        f"{significant(standing.monitor.threshold_, 3)} now. Modes: those that changed most, the first the most. "
        "Parts: those whose loss of stiffness explains most of it, where the monitor has a model. "
        "Records: how many were in alarm."
    )
    return section("events", "Events", paragraphs(text, older), table(caption, columns, rows, is_cards=True))


def _cells(standing: Standing, number: object, event: pd.Series) -> list[object]:
    note = "; ".join(filter(None, [event["note"], _failing(standing, event)]))
    said = "yes, harmless" if event["harmless"] else "yes, not harmless" if event["acknowledged"] else "not yet"
    return [
        f"{number}",
        event["kind"],
        moment(event["start"], is_short=True),
        moment(event["end"], is_short=True) or element("strong", "still open"),
        f"{significant(event['peak'], 3)} on {moment(event['peak_time'], is_short=True)}",
        event["modes"] or "none named",
        event["groups"] or "none named",
        f"{event['n_alarms']:,}",
        said,
        element("span", note, class_="text") if note else "",
    ]


def _failing(standing: Standing, event: pd.Series) -> str:
    """Sensors that failed in the time of an event, before the monitor had noticed."""
    faults = standing.monitor.faults_
    end = standing.last if pd.isna(event["end"]) else event["end"]
    names = {
        str(fault["column"])
        for _, fault in faults.iterrows()
        if fault["since"] <= end and event["start"] < fault["detected"] + ONE_DAY
    }
    return f"{listed(sorted(names))} failed at that time" if names else ""


def _index(standing: Standing, is_small: bool) -> Section:
    """Damage indices of the last month and of the last year; a small drawing shows the days of the year only."""
    title = "Damage index"
    if not standing.has_records:
        return section("index", title, paragraphs("No record has come since the baseline."))
    below = "below the dashed line are as the healthy structure; an event begins above it"
    unknown = "nothing is known of them"
    if is_small:
        caption = (
            "Highest damage index of each day in the year up to the newest record, of "
            f"{moment(standing.last)}. Dots {below}, and is shaded. Ticks at the bottom are days without an evaluated "
            f"record: {unknown}."
        )
        return section("index", title, element("figure", chart_year(standing), element("figcaption", caption)))
    text = (
        f"The drawings end with the newest record, of {moment(standing.last)}. Points {below}. Grey ticks at the "
        f"bottom are records or days that were not evaluated, days without any record among them: {unknown}."
    )
    drawn = [draw_month(standing)] if len(standing.evaluations) else []
    caption = "Damage index: of each record in the last month; the highest and the median of each day in longer times."
    return section("index", title, paragraphs(text), figure(caption, drawn + draw_days(standing)))


def drift_sentences(standing: Standing) -> list[str]:
    """Whether the structure drifts, how much each group that does, and when it reaches a limit."""
    found = standing.monitor.drift_
    if found is None:
        return ["Slow drift is not followed: that needs a model of the structure."]
    certain = found[found["significant"].astype(bool)]
    by_chance = f"seen with a probability of {probability_text(found['p_value'].iloc[0])} by chance"
    if not len(certain):
        return [f"No slow change of stiffness is certain; one as large would be {by_chance}."]
    sentences = [f"The stiffness changes slowly; a change as large would be {by_chance}."]
    for name, row in certain.iterrows():
        change, rate = float(row["change"]), float(row["per_year"])
        verb, speed = "lost" if change < 0 else "gained", "loses" if rate < 0 else "gains"
        text = f"{name} has {verb} {_size(change, row['standard_error'])} of its stiffness since the baseline"
        if np.isfinite(rate):
            text += f", and {speed} {_size(rate, row['per_year_error'])} a year"
        sentences.append(f"{text}. {_reached(row, standing) if np.isfinite(rate) else ''}".rstrip())
    return sentences


def _size(value: float, error: float) -> str:
    """A size in percent with two standard errors."""
    return f"{100 * abs(value):.1f}{SPACE}% (±{SPACE}{percent(N_ERRORS * error, '.1f')})"


def _reached(row: pd.Series, standing: Standing) -> str:
    """When a loss of so much is reached at this rate; what lies beyond a lifetime is not predicted."""
    left = standing.limit + float(row["change"])
    rate, error = -float(row["per_year"]), N_ERRORS * float(row["per_year_error"])
    loss = f"loss of {percent(standing.limit)}"
    if left <= 0:
        return f"A {loss} has been reached."
    if rate <= 0:
        return ""
    if left / rate > FARTHEST:
        return f"At this rate, it takes more than {FARTHEST:.0f} years until a {loss}."
    ends = ""
    if np.isfinite(error):
        soonest, latest = left / (rate + error), left / (rate - error) if rate > error else np.inf
        years = [f"{standing.last + span * YEAR:%Y}" for span in (soonest, latest) if span <= FARTHEST]
        ends = f" (between {years[0]} and {years[1]})" if len(years) > 1 else f" ({years[0]} at the earliest)"
    return f"A {loss} is reached in about {standing.last + left / rate * YEAR:%Y} at this rate{ends}."


def drift(standing: Standing, *, is_drawn: bool = True) -> Section:
    """Drift by group: in words, perhaps as a drawing, and in numbers."""
    found = standing.monitor.drift_
    parts = [bullets(drift_sentences(standing))]
    if found is not None:
        meaning = (
            "Structures age: parts lose stiffness slowly. The monitor follows this with the model of the structure, "
            "and takes it out before it evaluates, so that slow ageing raises no false alarm. Errors are two standard "
            "errors. The structure counts as drifting if one that does not age would seem to drift as much with a "
            "probability of 1 % at most. The drift is then that of the one or two groups, or of all groups alike, "
            "which explain it best."
        )
        drawn = draw_drift(standing) if is_drawn else None
        caption = "Change of the stiffness of each group since the baseline, with two standard errors at its end."
        rows = [
            [
                name,
                _signed(row["change"], row["standard_error"]),
                _signed(row["per_year"], row["per_year_error"]),
                "yes" if row["significant"] else "no",
            ]
            for name, row in found.iterrows()
        ]
        columns = ["Group", "Change so far", "Change a year", "Drifts"]
        parts += [paragraphs(meaning), figure(caption, [] if drawn is None else [drawn])]
        parts.append(table("Change of stiffness by group, ± two standard errors.", columns, rows))
    return section("drift", "Slow change of the structure", *parts, link="Slow change")


def _signed(value: float, error: float) -> str:
    if not np.isfinite(value):
        return "not known"
    return f"{100 * value:+.2f}{SPACE}% ±{SPACE}{significant(100 * N_ERRORS * error)}{SPACE}%"


def sensor_sentences(standing: Standing) -> list[str]:
    """What does not work at present."""
    if not standing.monitor.sensors:
        return ["Sensors are not watched."]
    if not len(standing.failed):
        return ["All sensors work." if standing.has_records else "No sensor has been seen to fail."]
    targets = set(standing.monitor.targets_)
    return [
        f"{'Mode' if fault['column'] in targets else 'Thermometer'} {fault['column']}: "
        f"{FAULTS.get(fault['kind'], fault['kind'])}, since {moment(fault['since'])}"
        + (f" ({fault['detail']})." if fault["detail"] else ".")
        for _, fault in standing.failed.iterrows()
    ]


def sensors(standing: Standing) -> Section:
    """Faults that last, and those that are over."""
    known = standing.monitor.faults_
    parts = [bullets(sensor_sentences(standing))]
    if standing.monitor.sensors:
        meaning = (
            "Each thermometer is compared with what the other thermometers and the references predict, and each "
            "response with the others and the weather. The monitor goes on without a thermometer that fails. A change "
            "that could be damage is never attributed to a sensor: a response that changes alone, by more than damage "
            "explains, is set aside, and the structure is not called healthy until somebody has looked at it."
        )
        parts.append(paragraphs(meaning))
    if len(known):
        columns = ["Sensor", "What", "Since", "Noticed", "Until", "Detail"]
        names = listed(sorted({str(name) for name in known["column"]}))
        rows = [
            [
                str(fault["column"]),
                FAULTS.get(fault["kind"], fault["kind"]),
                moment(fault["since"], is_short=True),
                moment(fault["detected"], is_short=True),
                moment(fault["until"], is_short=True) or "it lasts",
                fault["detail"],
            ]
            for _, fault in known.iloc[::-1].iterrows()
        ]
        parts.append(table(f"Faults of sensors, the newest first: {names}.", columns, rows, is_cards=True))
    return section("sensors", "Sensors", *parts)


def not_evaluated(standing: Standing) -> Section:
    """How many records were not evaluated, and why."""
    counts, evaluated, days = standing.monitor.counts_, standing.evaluations, standing.monitor.days_
    title, of_baseline = "What was not evaluated", _set_aside(standing.monitor.set_aside_)
    if not standing.has_records:
        return section("not_evaluated", title, paragraphs("No record has come since the baseline."), of_baseline)
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
    is_unknown = evaluated["state"] == "not evaluated"
    since = f"since {moment(evaluated.index[0])}" if len(evaluated) else ""
    forgotten = unknown - int(is_unknown.sum()) - sum(int(counts.get(name, 0)) for name in ("n_too_late", "n_ahead"))
    older = f"Why {forgotten:,} older ones of them were not evaluated is no longer kept." if forgotten > 0 else ""
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
    return section("not_evaluated", title, *parts, of_baseline)


def _set_aside(found: pd.DataFrame) -> Html:
    """A table of the baseline's values that count as missing; nothing without any."""
    rows = [
        [
            str(one["column"]),
            f"{one['n_rows']:,}",
            *(moment(one[end], is_short=True) for end in ("from", "to")),
            one["detail"],
        ]
        for _, one in found.iterrows()
    ]
    caption = "Of the baseline, values that cannot be measurements and count as missing. Look at these sensors."
    return table(caption, ["Sensor", "Values", "First", "Last", "What"], rows, is_cards=True) if rows else Html()


def _reasons(caption: str, reasons: pd.Series) -> Html:
    """A table of reasons with their numbers, the most frequent first; nothing without any."""
    found = reasons.value_counts()
    rows = [[reason, f"{number:,}"] for reason, number in found.head(MOST_REASONS).items()]
    rest = found.iloc[MOST_REASONS:]
    rows += [[f"{len(rest):,} other reasons", f"{int(rest.sum()):,}"]] if len(rest) else []
    return table(caption, ["Reason", "Records"], rows) if rows else Html()


def false_alarms(standing: Standing) -> Section:
    """How many false alarms were asked for and are expected, and how many events there were."""
    monitor, estimate = standing.monitor, standing.monitor.false_alarm_estimate_
    asked = counted_number(monitor.false_alarms_per_year, "false alarm")
    expected, years = estimate.expected, standing.years
    damage = standing.events[standing.events["kind"] == "damage"]
    sentences = [
        f"The monitor is set so that a structure that stays healthy gives {asked} a year on average: an alarm without "
        "damage. With fewer false alarms, damage is detected later or not at all.",
        f"Expected are {significant(expected, 2)} a year; in a single year there may be {estimate.lowest:,} to "
        f"{estimate.highest:,} by chance.",
    ]
    if standing.has_records:
        number, harmless = len(damage), int(damage["harmless"].astype(bool).sum())
        time = f"{significant(years, 2)} years" if years >= 1 else counted(round(365.25 * years) + 1, "day")
        seen = f"In {time} of service there {'was' if number == 1 else 'were'} {counted(number, 'damage event')}"
        seen += f", {harmless:,} of them said to be harmless" if number else ""
        by_chance = significant(expected * years, 2)
        sentences.append(f"{seen}. About {by_chance} false alarms were to be expected in this time.")
    if monitor.watch_threshold_ is not None:
        often = counted_number(monitor.watch_per_year, "time")
        sentences.append(f"A structure that stays healthy reaches the lower level of a watch {often} a year by chance.")
    if missing_season := getattr(estimate, "missing_season", ""):
        sentences.append(f"Nothing is known of {missing_season}: the baseline has no records of that time of year.")
    sentences.append("This says nothing of damage that is missed: a study of detectability answers that.")
    rows = [
        ["Threshold, above which an event begins", significant(monitor.threshold_, 4)],
        ["Level at or below which the index stays before it ends", significant(monitor.clear_threshold_, 4)],
        ["Time for which it stays there", duration_text(pd.Timedelta(estimate.rule.hold))],
        ["Years of baseline behind it", significant(estimate.n_years, 2)],
        ["How the threshold was found", element("span", estimate.method, class_="text")],
    ]
    if monitor.watch_threshold_ is not None:
        rows.insert(1, ["Level above which a watch begins", significant(monitor.watch_threshold_, 4)])
    rule = table("The rule for events, for the engineer.", ["What", "Value"], rows)
    return section("false_alarms", "False alarms", paragraphs(*sentences), rule)


def detectable(standing: Standing, structure: Structure | None) -> Section:
    """By how much responses have to fall, or parts to lose stiffness, until there is an alarm."""
    smallest = standing.monitor.smallest_changes_
    text = (
        f"The smallest changes that raise an alarm within {duration_text(smallest.within)}, in weather like that of "
        "the baseline: half of the records are then above the threshold. Smaller changes count as healthy."
    )
    seen = {name: loss for name, loss in smallest.groups.items() if np.isfinite(loss)}
    if structure is None or not set(seen) & set(structure.groups):
        return section("detectable", DETECTABLE, paragraphs(text), _smallest_changes(standing))
    caption = (
        "The structure: a member has the colour of the smallest loss of stiffness of its group that raises an alarm. "
        "Grey ones are in no group, or no loss of theirs raises an alarm."
    )
    drawn = figure(caption, [draw_detectable(structure, seen)])
    return section("detectable", DETECTABLE, paragraphs(text), drawn, _smallest_changes(standing))


def _smallest_changes(standing: Standing) -> Html:
    """Each response alone, all of them, and the damage groups."""
    smallest, units = standing.monitor.smallest_changes_, standing.monitor.units_

    def amount(fall: float, unit: str) -> str:
        if not np.isfinite(fall):
            return "none is seen"
        return percent(fall, ".2g") if smallest.is_relative else f"{significant(fall)}{SPACE}{unit}"

    falls = {"all responses by one share": smallest.common} if smallest.is_relative else {}
    falls |= {f"{name} alone": fall for name, fall in smallest.single.items()}
    rows = [[name, amount(fall, str(units.get(name.removesuffix(" alone")) or ""))] for name, fall in falls.items()]
    rows += [
        [f"loss of stiffness of {name}", percent(loss, ".2g") if np.isfinite(loss) else "none is seen"]
        for name, loss in smallest.groups.items()
    ]
    return table("Smallest changes that raise an alarm.", ["What falls", "Smallest change"], rows)


def _settings(monitor: Monitor) -> Section:
    detector = monitor.detector_
    parts = dict(detector.named_steps) if hasattr(detector, "named_steps") else {"detector": detector}
    rows = parameters({"monitor": monitor, **parts, "model": monitor.fem}, but=("monitor: detector", "monitor: fem"))
    units = monitor.units_
    is_target = {name: name in set(monitor.targets_) for name in monitor.baseline_.columns}
    for title, wanted in (("responses", True), ("temperatures", False)):
        names = [
            f"{name} ({units[name]})" if units.get(name) else f"{name}" for name in units if is_target[name] == wanted
        ]
        rows += [[title, element("code", ", ".join(names) or "none")]]
    return settings("For the engineer who looks after this monitor.", "Settings of the monitor and its parts.", rows)
