"""Sections of a page on a monitor: slow drift of the structure, and sensors."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np
import pandas as pd

from skthermo._tables.text import SPACE, listed, percent, probability_text, significant
from skthermo.reporting._html import Section, bullets, figure, paragraphs, section, table
from skthermo.reporting.service._figures import draw_drift
from skthermo.reporting.service._standing import YEAR, Standing, moment

N_ERRORS = 2  # standard errors on either side of an estimate
FARTHEST = 100.0  # years ahead, beyond which nothing is foretold
KINDS = {
    "dead": "gives no value",
    "stuck": "repeats one value",
    "implausible": "shows what cannot be",
    "offset": "has jumped",
    "drift": "drifts",
    "disagree": "contradicts another sensor",
    "swapped": "is swapped with another",
}


def drift_sentences(standing: Standing) -> list[str]:
    """Whether the structure drifts, how much each group that does, and when it reaches a limit."""
    found = standing.monitor.drift_
    if found is None:
        return ["Slow drift is not followed: that needs a model of the structure."]
    certain = found[found["significant"].astype(bool)]
    if not len(certain):
        return [f"No drift of stiffness is seen{_by_chance(found)}."]
    return [f"The structure drifts{_by_chance(found)}."] + [
        _group(name, row, standing.last, standing.limit) for name, row in certain.iterrows()
    ]


def _by_chance(found: pd.DataFrame) -> str:
    """The p value of the drift, in brackets."""
    return f" (probability by chance {probability_text(found['p_value'].iloc[0])})"


def _group(name: Hashable, row: pd.Series, last: pd.Timestamp, limit: float) -> str:
    change, rate = float(row["change"]), float(row["per_year"])
    verb = "lost" if change < 0 else "gained"
    text = f"{name} has {verb} {_size(change, row['standard_error'])} of its stiffness since the baseline"
    if not np.isfinite(rate):
        return f"{text}."
    speed = "loses" if rate < 0 else "gains"
    return f"{text}, and {speed} {_size(rate, row['per_year_error'])} a year. {_reached(row, last, limit)}"


def _size(value: float, error: float) -> str:
    """A size in percent with two standard errors."""
    return f"{100 * abs(value):.1f}{SPACE}% (±{SPACE}{percent(N_ERRORS * error, '.1f')})"


def _reached(row: pd.Series, last: pd.Timestamp, limit: float) -> str:
    """When a loss of so much is reached at this rate; what lies beyond a lifetime is not foretold."""
    left, rate, error = limit + float(row["change"]), -float(row["per_year"]), N_ERRORS * float(row["per_year_error"])
    at = f"A loss of {percent(limit)}"
    if left <= 0:
        return f"{at} has been reached."
    if rate <= 0:
        return ""
    middle, soonest = left / rate, left / (rate + error) if np.isfinite(error) else np.nan
    latest = left / (rate - error) if rate > error else np.inf
    if middle > FARTHEST:
        return f"At this rate, it takes more than {FARTHEST:.0f} years until {at[0].lower()}{at[1:]}."
    ends = ""
    if np.isfinite(soonest):
        until = f"{_year(last, latest)}" if latest <= FARTHEST else "an unknown year"
        ends = (
            f" (between {_year(last, soonest)} and {until})"
            if latest <= FARTHEST
            else (f" ({_year(last, soonest)} at the earliest)")
        )
    return f"{at} is reached in about {_year(last, middle)} at this rate{ends}."


def _year(last: pd.Timestamp, years: float) -> str:
    return f"{last + years * YEAR:%Y}"


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
                *(_signed(row[a], row[b]) for a, b in (("change", "standard_error"), ("per_year", "per_year_error"))),
            ]
            + ["yes" if row["significant"] else "no"]
            for name, row in found.iterrows()
        ]
        columns = ["Group", "Change so far", "Change a year", "Drifts"]
        parts += [paragraphs(meaning), figure(caption, [] if drawn is None else [drawn])]
        parts.append(table("Change of stiffness by group, ± two standard errors.", columns, rows))
    return section("drift", "Slow change of the structure", *parts, link="Slow change")


def _signed(value: float, error: float) -> str:
    if not np.isfinite(value):
        return "not known"
    size = significant(100 * N_ERRORS * error)
    return f"{100 * value:+.2f}{SPACE}% ±{SPACE}{size}{SPACE}%"


def sensor_sentences(standing: Standing) -> list[str]:
    """What does not work at present."""
    if not standing.monitor.sensors:
        return ["Sensors are not watched."]
    if not len(standing.failed):
        return ["All sensors work." if standing.has_records else "No sensor has been seen to fail."]
    targets = set(standing.monitor.targets_)
    return [
        f"{'Mode' if fault['column'] in targets else 'Thermometer'} {fault['column']}: "
        f"{KINDS.get(fault['kind'], fault['kind'])}, since {moment(fault['since'])}"
        + (f" ({fault['detail']})." if fault["detail"] else ".")
        for _, fault in standing.failed.iterrows()
    ]


def sensors(standing: Standing) -> Section:
    """Faults that last, and those that are over."""
    known = standing.monitor.faults_
    parts = [bullets(sensor_sentences(standing))]
    if standing.monitor.sensors:
        meaning = (
            "Each thermometer is compared with what the others tell of it, and each natural frequency with the others "
            "and the weather. The monitor goes on without a sensor that fails. A change that could be damage is never "
            "put down to a sensor."
        )
        parts.append(paragraphs(meaning))
    if len(known):
        columns = ["Sensor", "What", "Since", "Noticed", "Until", "Detail"]
        names = listed(sorted({str(name) for name in known["column"]}))
        rows = [
            [
                str(fault["column"]),
                KINDS.get(fault["kind"], fault["kind"]),
                moment(fault["since"], is_short=True),
                moment(fault["detected"], is_short=True),
                moment(fault["until"], is_short=True) or "it lasts",
                fault["detail"],
            ]
            for _, fault in known.iloc[::-1].iterrows()
        ]
        parts.append(table(f"Faults of sensors, the newest first: {names}.", columns, rows, is_cards=True))
    return section("sensors", "Sensors", *parts)
