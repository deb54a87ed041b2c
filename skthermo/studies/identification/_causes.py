"""What may have changed a structure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

HIGHEST_SEVERITY = 0.95  # upper bound of severities
SOMETHING_ELSE, NO_DAMAGE = "something else", "no damage"


@dataclass(frozen=True)
class Cause:
    """One possible cause with one unknown amount, whose most probable value before the records are seen is 0.

    ``scale`` is the standard deviation of the half-normal law of amounts, relative to the severity of the prior.
    """

    name: str
    kind: Literal["damage", "stiffening", "parameter", "mass"] = "damage"
    lowest: float = 0.0
    highest: float = HIGHEST_SEVERITY
    scale: float = 1.0
