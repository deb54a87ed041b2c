"""Where in its groups a structure is damaged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skthermo.studies.location._division import Division
from skthermo.studies.location._located import LIKELY, Explained, fewest
from skthermo.studies.location._question import Question

MOST_PIECES, MOST_SLOW_PIECES = 16, 6
"""Into how many pieces a group is divided first; fewer for models that are slow to solve."""

MOST_LEVELS = 4
WORTH_DIVIDING = 0.05  # probability of a group, and of a piece of a damaged group, from which on it is divided further
CANNOT_TELL = 0.75  # share of a group's pieces that may be worth it, before dividing them would tell nothing
NEGLIGIBLE = 1e-5  # probability below which an explanation is left out


def refine(
    ask: Any, divisions: dict[str, Division], fewer: Sequence[str]
) -> tuple[list[Explained], Question, dict[str, Division], list[dict[str, Any]]]:
    """Divide groups, and their probable pieces further, until the shifts do not tell these apart."""
    levels: list[dict[str, Any]] = []
    for level in range(1, MOST_LEVELS + 1):
        explained = ask(divisions)
        finer = {}
        for group, division in divisions.items():
            sets = [(e.members[group], e.probability) for e in explained if group in e.members]
            total = sum(share for _, share in sets)
            shares = np.array(
                [sum(share for members, share in sets if members & set(piece)) for piece in division.pieces]
            )
            levels.append(
                {
                    "level": level,
                    "group": group,
                    "pieces": len(division.pieces),
                    "stretches": sum(1 for _ in division.stretches()),
                    "probability": total,
                    "likely": len(fewest(sets, LIKELY)[0]),
                }
            )
            chosen = (shares > WORTH_DIVIDING * total) & [len(piece) > 1 for piece in division.pieces]
            if total > WORTH_DIVIDING and chosen.any() and chosen.mean() <= CANNOT_TELL:
                finer[group] = division.finer(chosen)
        if not finer:
            break
        divisions = divisions | finer
    return explained, divisions, levels
