"""Section of a report on identified damage."""

from __future__ import annotations

from typing import Any

import numpy as np

from skthermo._formatting import percent, probability_text
from skthermo.reporting._figures import draw_identified_damage
from skthermo.reporting._html import Html, bullets, element, figure, paragraphs, section, table


def identified_damage(identified: Any) -> Html:
    """Where damage is, how severe, what it explains, and what cannot be said."""
    found, answers = identified.table, identified.damaged
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
        bullets(identified.answer()),
        paragraphs(*identified.records.sentences()),
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
        bullets(identified.limits()) or paragraphs("All groups can be seen and told apart by the measured modes."),
        figure(
            "Severity of each group; shift of each natural frequency, measured and explained; and how similar "
            "the effects of the groups are: 1 means that two groups change all modes alike and cannot be told apart.",
            [draw_identified_damage(identified)],
        ),
    ]
    return section("identified", "Identified damage", *parts)
