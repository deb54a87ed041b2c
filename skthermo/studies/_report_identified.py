"""Section of a report on identified damage."""

from typing import Any

import numpy as np

from skthermo.studies._report_figures import draw_identified_damage
from skthermo.studies._report_html import Html, bullets, element, figure, paragraphs, section, table
from skthermo.studies._report_numbers import exact, listed, probability

UNLIKELY = 0.05


def identified_damage(identified: Any) -> Html:
    """Where damage is, how severe, what it explains, and what cannot be said."""
    found = identified.table
    clear = found["significant"].eq(True)  # missing where a group cannot be seen
    rows = [
        [
            group,
            exact(row["severity"]) if np.isfinite(row["severity"]) else "cannot be seen",
            f"± {exact(2 * row['standard_error'])}" if np.isfinite(row["standard_error"]) else "",
            probability(row["p_value"]) if np.isfinite(row["severity"]) else "",
            "yes" if clear[group] else "no",
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
            "Severity of each group; shift of each natural frequency, measured and explained; and how alike "
            "the effects of the groups are: 1 means that two groups change all modes alike and cannot be told apart.",
            [draw_identified_damage(identified)],
        ),
    ]
    return section("identified", "Identified damage", *parts)


def identified_sentences(identified: Any) -> list[str]:
    """Which groups are damaged, and how surely."""
    found = identified.table[identified.table["significant"].eq(True)]
    sentences = [
        f"{group} has lost {exact(row['severity'])} of its stiffness (± {exact(2 * row['standard_error'])})."
        for group, row in found.iterrows()
    ]
    sentences = sentences or ["No group is clearly damaged."]
    p_value = float(getattr(identified, "p_value", np.nan))
    if np.isfinite(p_value):
        sentences.append(f"The probability that a healthy structure shows such shifts is {probability(p_value)}.")
    return sentences


def _limits(identified: Any) -> list[str]:
    sentences = [f"{listed(groups)} cannot be told apart by these modes." for groups in identified.confused]
    if len(identified.unseen):
        sentences.append(f"Damage in {listed(identified.unseen)} cannot be seen in these modes.")
    misfit = float(identified.misfit_p_value)
    if np.isnan(misfit):
        sentences.append("There are no more modes than groups, so that any shift can be explained: it proves little.")
    elif misfit < UNLIKELY:
        sentences.append(
            "Damage of these groups does not explain all shifts, so that something else has changed too (the "
            f"probability of such a misfit by chance is {probability(misfit)})."
        )
    return sentences
