"""What may have changed a structure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

HIGHEST_SEVERITY = 0.95  # upper bound of severities
FARTHEST = 0.3  # amount up to which effects are tabulated
SOMETHING_ELSE, NO_DAMAGE = "something else", "no damage"


@dataclass(frozen=True)
class Cause:
    """One possible cause with one unknown amount, whose most probable value before the records are seen is 0.

    ``scale`` is the standard deviation of the half-normal law of amounts, relative to the severity of the prior.
    Of several causes ``of`` the same group, an explanation has at most one.
    """

    name: str
    kind: Literal["damage", "stiffening", "parameter", "mass"] = "damage"
    lowest: float = 0.0
    highest: float = HIGHEST_SEVERITY
    scale: float = 1.0
    of: str = ""

    def nodes(self) -> tuple[float, float, float]:
        """Amounts at which its effects are tabulated; beyond them, they are computed where they matter."""
        lowest, highest = max(self.lowest, -FARTHEST), min(self.highest, FARTHEST)
        return lowest, 0.0 if lowest < 0 < highest else (lowest + highest) / 2, highest
