"""Section of a report on identified damage."""

from __future__ import annotations

import pandas as pd

from skthermo._tables.text import SPACE, bounds_text, capital, chance_text, share_text
from skthermo.reporting._figures import draw_identified_damage
from skthermo.reporting._html import Html, Section, bar, bullets, element, figure, paragraphs, section, table
from skthermo.reporting._readable import Values, csv_link
from skthermo.studies import IdentifiedDamage

LEAST = 0.005  # probability from which on an explanation has a row
UNITS = {
    "damage": "loss of stiffness",
    "stiffening": "gain of stiffness",
    "parameter": "change",
    "mass": "added, as a share of the given mass",
}
"""What the amounts of a cause are, by its kind."""


def identified_damage(identified: IdentifiedDamage) -> Section:
    """What is most probable, what else could be, how severe, and what the modes do not determine."""
    parts = [
        paragraphs(
            "Records of the structure as it is now were compared with predictions of the healthy structure in the same "
            "weather. Each explanation of the shifts of the frequencies has a probability; these add up to 100 %."
        ),
        bullets(identified.answer()),
        _explanations(identified),
        element("h3", "What the modes do not determine"),
        bullets(identified.limits()) or paragraphs("The measured modes show and distinguish all groups."),
        paragraphs(*identified.records.sentences()),
        table(
            "Every group: the probability that it has changed, and by how much on average over all explanations, with "
            "a credible interval of 90 %. The last column is what a group, if it has changed, does not exceed with a "
            "probability of 95 %.",
            ["Group", "Probability", "What changes", "On average", "Bounds", "If changed, up to"],
            [_row(str(cause), row, cause in identified.unobservable) for cause, row in identified.table.iterrows()],
            is_cards=True,
        ),
        _shifts(identified),
        figure(
            "Explanations with their probabilities; severity of each group, on average over all explanations; shift of "
            "each natural frequency, measured and explained.",
            [draw_identified_damage(identified)],
        ),
        element(
            "p",
            csv_link(Values("identified damage", identified.table.rename_axis("group")), "Table of all groups (CSV)"),
        ),
    ]
    return section("identified", "Identified damage", *parts)


def _explanations(identified: IdentifiedDamage) -> Html:
    probable = identified.summary_table[identified.summary_table["probability"] >= LEAST]
    explanations = [
        [capital(row["text"]), bar(row["probability"], chance_text(row["probability"]))]
        for _, row in probable.iterrows()
    ]
    return table(
        "Explanations with their probabilities, and credible intervals of 90 % of the severities if the explanation is "
        "right.",
        ["Explanation", "Probability"],
        explanations,
    )


def _shifts(identified: IdentifiedDamage) -> Html:
    shifts = [
        [
            mode,
            *(f"{100 * row[name]:+.2f}{SPACE}%" for name in ("measured", "explained")),
            f"±{SPACE}{200 * row['standard_error']:.2f}{SPACE}%",
        ]
        for mode, row in identified.shifts.iterrows()
    ]
    return table(
        "Mean shift of each natural frequency: measured, with two standard errors, and explained on average over all "
        "explanations.",
        ["Mode", "Measured", "Explained", "Error of the measured"],
        shifts,
    )


def _row(cause: str, row: pd.Series, is_unobservable: bool) -> list[str]:
    if is_unobservable:
        return [cause, "unobservable", UNITS[row["kind"]], "not known", "", ""]
    amounts = row[["severity", "ci_low", "ci_high", "highest_if_damaged"]].astype(float)
    lowest, highest = sorted(amounts[["ci_low", "ci_high"]].abs())
    return [
        cause,
        chance_text(row["probability"]),
        UNITS[row["kind"]],
        share_text(abs(amounts["severity"])),
        bounds_text(lowest, highest),
        share_text(abs(amounts["highest_if_damaged"])),
    ]
