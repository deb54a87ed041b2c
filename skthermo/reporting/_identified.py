"""Section of a report on identified damage."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from skthermo._formatting import listed, percent, probability_text
from skthermo.reporting._figures import draw_identified_damage
from skthermo.reporting._html import Html, bullets, element, figure, paragraphs, section, table

YES, NO, DOUBTFUL, ALONE = "yes", "no", "doubtful", "yes, if nothing else has changed"
SENTENCES = {
    YES: "{} has lost {} of its stiffness (± {}).",
    ALONE: "{} has lost {} of its stiffness (± {}), if nothing else has changed.",
    DOUBTFUL: "It is doubtful whether {} is damaged: a loss of {} (± {}) may come from what else has changed.",
}
"""What is said of a damaged group, its severity and two standard errors."""


def identified_damage(identified: Any) -> Html:
    """Where damage is, how severe, what it explains, and what cannot be said."""
    found, answers = identified.table, _answers(identified)
    rows = [
        [
            group,
            percent(row["severity"], ".1f") if np.isfinite(row["severity"]) else "cannot be seen",
            f"± {percent(2 * row['standard_error'], '.1f')}" if np.isfinite(row["standard_error"]) else "",
            probability_text(row["p_value"]) if np.isfinite(row["severity"]) else "",
            answers[group],
        ]
        for group, row in found.iterrows()
    ]
    shifts = [
        [
            mode,
            *(f"{100 * row[name]:+.2f} %" for name in ("measured", "explained")),
            f"± {200 * row['standard_error']:.2f} %",
        ]
        for mode, row in identified.shifts.iterrows()
    ]
    parts = [
        paragraphs(
            "Records of the structure as it is now were compared with what the healthy structure would do in the same "
            "weather. The severities below explain how the frequencies have shifted."
        ),
        bullets(identified_sentences(identified)),
        table(
            "Identified damage: share of the stiffness that is lost, and its uncertainty (two standard errors). The "
            "probability is that of such a severity, or a larger one, by chance in a healthy structure.",
            ["Group", "Severity", "Uncertainty", "Probability by chance", "Clearly damaged"],
            rows,
        ),
        table(
            "Mean shift of each natural frequency: measured, and explained by the identified damage.",
            ["Mode", "Measured", "Explained", "Uncertainty of the measured shift"],
            shifts,
        ),
        element("h3", "What cannot be said"),
        bullets(_limits(identified)) or paragraphs("All groups can be seen and told apart by the measured modes."),
        figure(
            "Severity of each group; shift of each natural frequency, measured and explained; and how similar "
            "the effects of the groups are: 1 means that two groups change all modes alike and cannot be told apart.",
            [draw_identified_damage(identified)],
        ),
    ]
    return section("identified", "Identified damage", *parts)


def identified_sentences(identified: Any) -> list[str]:
    """Which groups are damaged, and how surely."""
    answers = _answers(identified)
    found = identified.table[answers != NO]
    sentences = [
        SENTENCES[answers[group]].format(
            group, percent(row["severity"], ".1f"), percent(2 * row["standard_error"], ".1f")
        )
        for group, row in found.iterrows()
    ]
    sentences = sentences or ["No group is clearly damaged."]
    if identified.is_unexplained:
        sentences.insert(0, _misfit(identified))
    if np.isfinite(identified.p_value):
        chance = probability_text(identified.p_value)
        sentences.append(f"The probability that a healthy structure shows such shifts is {chance}.")
    return sentences


def _limits(identified: Any) -> list[str]:
    sentences = [f"{listed(groups)} cannot be told apart by these modes." for groups in identified.confused]
    if len(identified.unseen):
        sentences.append(f"Damage in {listed(identified.unseen)} cannot be seen in these modes.")
    if np.isnan(identified.misfit_p_value):
        sentences.append("There are no more modes than groups, so that any shift can be explained: it proves little.")
    elif identified.is_unexplained:
        sentences.append(_misfit(identified))
    return sentences


def _misfit(identified: Any) -> str:
    return (
        "Damage of these groups does not explain all shifts of the frequencies, so that something else has changed "
        "too, or the model is wrong; severities may be wrong by more than their uncertainties (the probability of such "
        f"a misfit by chance is {probability_text(identified.misfit_p_value)})."
    )


def _answers(identified: Any) -> pd.Series:
    """Whether each group is damaged.

    Where damage does not explain the shifts, standard errors are multiplied by the largest unexplained shift of a mode
    in standard errors, and a severity within two of them is doubtful.
    """
    table = identified.table
    answers = pd.Series(NO, table.index).mask(table["significant"].eq(True), YES)  # missing where a group is not seen
    if not identified.is_unexplained:
        return answers
    factor = max(np.nanmax(np.abs(identified.unexplained), initial=1.0), 1.0)
    small = table["severity"] < 2 * factor * table["standard_error"]
    return answers.mask(answers == YES, small.map({True: DOUBTFUL, False: ALONE}))
