"""Sections of a report on the answer, and on what would be detected and what not."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import pandas as pd

from skthermo._tables.text import bounds_text, counted, duration_text, percent, share_text
from skthermo._validation import last_step
from skthermo.detection import MahalanobisDetector
from skthermo.reporting._figures import draw_curve, draw_damage_indices
from skthermo.reporting._findings import COLUMNS, LEVEL, REFERENCE, SIMULATED, Finding, with_severities
from skthermo.reporting._html import Html, Section, bar, bullets, element, figure, paragraphs, section, table
from skthermo.studies import DetectabilityStudy, ProgressiveDamage, Scenario, UncertainDamage

MOST_NAMED = 12  # largest number of scenarios that are named or drawn in a section
RELIABLE = 0.95  # share of the cases in which damage is detected within the reported time
State: TypeAlias = Scenario | ProgressiveDamage | UncertainDamage
WITHIN = {"1D": "a day", "7D": "a week", "30D": "30 days"}


def answer(study: DetectabilityStudy, findings: Sequence[Finding], identified: Sequence[str]) -> Section:
    """The answer in a few sentences, those on identified damage first."""
    rows = study.results_[study.results_["source"] == SIMULATED]
    parts = []
    if identified:
        parts += [element("h3", "The structure as it is now"), bullets(identified)]
    parts += [element("h3", "Smallest damage that would be detected reliably"), _smallest(rows, findings)]
    parts += [element("h3", "False alarms"), _false_alarms(rows)]
    parts += [element("h3", "Time to detection"), _how_soon(study)]
    parts += [element("h3", "What would not be detected"), _missed(rows)]
    parts += [element("h3", "What the words mean"), _meaning(study)]
    return section("answer", "The answer", *parts)


def _meaning(study: DetectabilityStudy) -> Html:
    """How the answer was found, and what its words mean."""
    return paragraphs(
        "Temperature moves the natural frequencies of a structure, and so does damage. A computer model, which has "
        "learned from measurements how temperature moves this structure, simulated it in the same weather without "
        f"damage and with damage. {_share_evaluated(study)}",
        "A record is one measurement of temperatures and natural frequencies. Damage of 20 % means that the members of "
        "a group lose 20 % of their stiffness, their resistance to deformation. Damage counts as detected reliably if "
        f"at least {share_text(LEVEL)} of the records of the damaged structure raise an alarm.",
        f"Bounds of rates cover the true rate with {percent(study.confidence_)} confidence, as far as the scatter of "
        "the measurements is concerned. They cover neither weather of another kind nor errors of the model. "
        f"{_expected(study)}",
    )


def _how_soon(study: DetectabilityStudy) -> Html:
    """Sentences on the smallest damage of each family that is soon detected, and on the healthy structure."""
    is_healthy = dict(zip(study.results_["scenario"], study.results_["measure"] == "PFA", strict=True))
    smallest = study.time_to_detection(level=RELIABLE, smallest=True)
    smallest = smallest.sort_values("scenario", key=lambda names: names.map(is_healthy), kind="stable")
    return bullets(_named(row["scenario"], f"{row['text']}.") for _, row in smallest.iterrows())


def _named(name: object, text: str) -> Html:
    return element("span", element("strong", f"{name}:"), f" {text}")


def times(study: DetectabilityStudy) -> list[Html]:
    """What the time to detection is, and a table of it for all scenarios."""
    waits = study.time_to_detection(level=RELIABLE)
    shown = [name for name in waits if f"{name} healthy" in waits and waits[name].notna().any()]
    meaning = (
        "Damage may begin on any day of the simulated weather, and is detected with the first alarm after that. The "
        "chance of a false alarm of the healthy structure within the same time grows, too."
    )
    delayed = float(waits["not_evaluated"].max())
    if delayed:
        meaning += f" In {share_text(delayed)} of the time no record can be evaluated, which delays detection."
    labels = (WITHIN.get(name, f"{name} records" if name.isdigit() else name) for name in shown)
    columns = ["Scenario", *(f"Alarm within {label}" for label in labels), "In half of the cases", "In 95 of 100"]
    cells = [
        [row["scenario"], *(_chance(row, name) for name in shown), _time(row["median"]), _time(row["reliable"])]
        for _, row in waits.iterrows()
    ]
    caption = (
        "Chance of an alarm within a time from the beginning of the damage, with bounds of "
        f"{percent(study.confidence_)} confidence, and time to the first alarm."
    )
    return [element("h3", "How soon damage would be detected"), paragraphs(meaning), table(caption, columns, cells)]


def _chance(row: pd.Series, name: str) -> str:
    if np.isnan(row[name]):
        return "records too short or too rare"
    return f"{share_text(row[name])} ({bounds_text(*(row[name + bound] for bound in (' ci_low', ' ci_high')))})"


def _time(wait: pd.Timedelta | float) -> str:
    return "longer than the records" if pd.isna(wait) else duration_text(wait)


def _expected(study: DetectabilityStudy) -> str:
    """What a measured campaign should show, where more than the scatter of the measurements was simulated."""
    if study.uncertainty_ is None:
        return ""
    return (
        f"What the alarms of one measured campaign should show, with {percent(study.confidence_)} probability, stands "
        f"beside the bounds. {study.uncertainty_summary()}"
    )


def _smallest(rows: pd.DataFrame, findings: Sequence[Finding]) -> Html:
    """A sentence for each family with severities, also for those that have no smallest one."""
    tested = with_severities(rows)
    if not len(tested):
        return paragraphs("No damage group was tested on its own, so that there is no smallest damage to report.")
    sentences = {found.family: found.sentence() for found in findings}
    unclear = "not defined, as damage and strengthening, or one severity twice, were tested together."
    return bullets(_named(family, sentences.get(str(family), unclear)) for family in tested["family"].unique())


def _smallest_table(rows: pd.DataFrame, findings: Sequence[Finding]) -> list[Html]:
    """The smallest severities with their bounds, and those on the fitted curves; nothing without any."""
    tested = with_severities(rows)
    if not len(tested):
        return []
    cells = {found.family: found.cells() for found in findings}
    unclear = ["not defined", "", "", "", "damage and strengthening together, or one severity twice"]
    families = (str(family) for family in tested["family"].unique())
    caption = (
        "Smallest tested severity from which on damage is detected reliably, with the bounds that follow from those of "
        "the rates. On a curve through the tested severities, a90 is detected in 90 % of the records, and a90/95 so "
        "with 95 % confidence."
    )
    return [table(caption, COLUMNS, [cells.get(family, [family, *unclear]) for family in families], is_cards=True)]


def _share_evaluated(study: DetectabilityStudy) -> str:
    """How many simulated records the alarm system evaluated."""
    unknown = {name: index.isna() for (_, name, source), index in study.indices_.items() if source == SIMULATED}
    number, total = (int(sum(count)) for count in zip(*((u.sum(), len(u)) for u in unknown.values()), strict=True))
    if not number:
        return "The alarm system evaluated every simulated record."
    return (
        f"The alarm system could not evaluate {number:,} of {counted(total, 'record')} of the first simulation, as "
        "they lack what it needs (see the warnings under Settings). They count neither as healthy nor as alarms."
    )


def found_and_missed(study: DetectabilityStudy, findings: Sequence[Finding]) -> Section:
    """Rates of all scenarios, curves and damage indices."""
    results = study.results_
    scenarios = {scenario.name: scenario for scenario in study.scenarios_}
    introduction = (
        "Every scenario was simulated in the same weather, "
        f"{counted(int(results['n_repeats'].max()), 'time')}, each time with other scatter of the measurements. For "
        "the healthy structure, alarms are false and should be few; for a damaged one, they should be many."
    )
    introduction += _beginning(study)
    if (results["source"] == REFERENCE).any():
        introduction += " Rows called reference are of records that were given to compare the simulations with."
    is_distance = isinstance(last_step(study.detectors_[study.detector_name()]), MahalanobisDetector)
    distance = " The index is the Mahalanobis distance, not squared." if is_distance else ""
    parts = [
        paragraphs(introduction),
        *_smallest_table(results[results["source"] == SIMULATED], findings),
        _alarms(study, scenarios),
        *times(study),
        figure(
            "Share of records in alarm over the severity of the damage, in percent of the stiffness. Dots with bars: "
            "tested severities with intervals of 95 % confidence. Line and band: a curve through them, with its "
            "interval of 95 % confidence.",
            [draw_curve(found, found.curve) for found in findings if found.curve is not None],
            "How the share of alarms grows with damage",
        ),
        figure(
            "Damage index of every record: how far its frequencies are from those of the healthy structure, compared "
            "with the usual scatter. Above the threshold there is an alarm. Healthy records should be below it, "
            f"records of the damaged structure above.{distance}",
            _damage_indices(study, findings, scenarios),
            "What the alarm system sees",
        ),
    ]
    return section("found", "What would be detected and what not", *parts, link="What would be detected")


def _alarms(study: DetectabilityStudy, scenarios: Mapping[str, State]) -> Html:
    """A row for each scenario and source."""
    has_bands = study.uncertainty_ is not None
    columns = ["Scenario", "What is changed", "Records in alarm", "Bounds"]
    columns += ["In one measured campaign"] if has_bands else []
    columns += ["Records evaluated", "Mean time to the first alarm"]
    cells = [
        [
            row["scenario"] + (" (reference)" if row["source"] == REFERENCE else ""),
            element("span", described(scenarios.get(row["scenario"])), class_="text"),
            bar(row["rate"], share_text(row["rate"])),
            bounds_text(row["ci_low"], row["ci_high"]),
            *([bounds_text(row["pi_low"], row["pi_high"])] if has_bands else []),
            f"{row['n_records']:,}{_share_not_evaluated(study, row)}",
            duration_text(row["time_to_detection"]),
        ]
        for _, row in study.results_.iterrows()
    ]
    return table("Alarms in every scenario.", columns, cells)


def _share_not_evaluated(study: DetectabilityStudy, row: pd.Series) -> str:
    """What share of the records of a scenario was not evaluated; nothing if all were."""
    share = float(study.indices_[row["detector"], row["scenario"], row["source"]].isna().mean())
    return f" ({share_text(share)} not evaluated)" if share else ""


def _beginning(study: DetectabilityStudy) -> str:
    """A sentence that says when the time to the first alarm begins."""
    weather = study.indices_[next(key for key in study.indices_ if key[2] == SIMULATED)].index
    first = f", {_place(weather.min())}" if isinstance(weather, pd.DatetimeIndex) else ""
    return (
        " The time to the first alarm begins with the damage or, where that is there from the beginning or there is "
        f"none, with the first record of the simulated weather{first}."
    )


def described(scenario: State | None) -> str:
    """What a scenario changes, in words."""
    if scenario is None:
        return ""
    is_uncertain = hasattr(scenario, "draws")
    damage = scenario.draws.mean().round(3) if is_uncertain else getattr(scenario, "damage", None) or {}
    changes = [
        f"{group}: {percent(abs(severity))} {'less' if severity > 0 else 'more'} stiffness"
        for group, severity in damage.items()
        if severity
    ]
    changes += [f"{name} times {factor:g}" for name, factor in (getattr(scenario, "parameters", None) or {}).items()]
    changes += [f"added {what}" for what in ("stiffness", "mass") if getattr(scenario, what, None) is not None]
    text = ", ".join(changes) or "nothing"
    if is_uncertain:
        text += ", known with uncertainty"
    if scenario.onset is not None:
        text += f", from {_place(scenario.onset)} on"
    end = getattr(scenario, "end", None)
    return text if end is None else f"{text}, growing until {_place(end)}"


def _place(onset: object) -> str:
    return f"record {onset}" if isinstance(onset, int | np.integer) else f"{pd.Timestamp(onset):%Y-%m-%d %H:%M}"


def _false_alarms(rows: pd.DataFrame) -> Html:
    healthy = rows[rows["measure"] == "PFA"]
    if not len(healthy):
        return paragraphs("The healthy structure was not among the scenarios: how often alarms are false is not known.")
    sentences = []
    for _, row in healthy.iterrows():
        name = "the healthy structure" if len(healthy) == 1 else f"the healthy structure in scenario {row['scenario']}"
        if row["rate"]:
            often = f"about one record in {round(1 / row['rate']):,}" if row["rate"] < 0.4 else "far too many"
            text = f"Of the records of {name}, {share_text(row['rate'])} raise an alarm, {often}"
        else:
            text = f"No record of {name} raises an alarm"
        sentences.append(f"{text} (bounds: {bounds_text(row['ci_low'], row['ci_high'])}).")
    return paragraphs(*sentences)


def _missed(rows: pd.DataFrame) -> Html:
    damaged = rows[rows["measure"] == "POD"]
    missed = damaged[damaged["rate"] < LEVEL].sort_values("rate", kind="stable")
    if not len(damaged):
        return paragraphs("No damage was tested.")
    if not len(missed):
        return paragraphs("All damage that was tested is detected reliably. Less was not tested.")
    names = [f"{row['scenario']} ({share_text(row['rate'])})" for _, row in missed.head(MOST_NAMED).iterrows()]
    return paragraphs(
        f"Of {counted(len(damaged), 'damaged state')}, {len(missed):,} would not be detected reliably. Shares of "
        f"records in alarm: {', '.join(names)}{', ...' if len(missed) > MOST_NAMED else ''}."
    )


def _damage_indices(
    study: DetectabilityStudy, findings: Sequence[Finding], scenarios: Mapping[str, State]
) -> list[Html]:
    """One drawing for each family, and for each scenario that belongs to none."""
    detector = study.detector_name()
    if study.thresholds_[detector] is None:
        return []
    rows = study.results_[study.results_["source"] == SIMULATED]
    healthy = rows.loc[rows["measure"] == "PFA", "scenario"].head(1).tolist()
    shown = []
    for found in findings:
        severity = found.smallest if found.is_found else found.severities[-1]
        shown += rows.loc[(rows["family"] == found.family) & (rows["severity"] == severity), "scenario"].tolist()
    shown += rows.loc[(rows["measure"] == "POD") & rows["family"].isna(), "scenario"].tolist()
    drawn = []
    for name in shown[:MOST_NAMED]:
        indices = {scenario: study.indices_[detector, scenario, SIMULATED] for scenario in (*healthy, name)}
        onset = scenarios[name].onset if name in scenarios else None
        drawn.append(draw_damage_indices(study, indices, onset))
    return drawn
