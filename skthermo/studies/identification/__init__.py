"""Which causes explain a shift of frequencies, and how probably."""

from skthermo.studies.identification._identified import IdentifiedDamage
from skthermo.studies.identification._identify import compared, identify_damage
from skthermo.studies.identification.measured import Shift, observe
from skthermo.studies.identification.weighing import (
    SOMETHING_ELSE,
    Cause,
    Comparison,
    DamagePrior,
    Observed,
    Posterior,
    Scale,
    screen,
)

__all__ = [
    "SOMETHING_ELSE",
    "Cause",
    "Comparison",
    "DamagePrior",
    "IdentifiedDamage",
    "Observed",
    "Posterior",
    "Scale",
    "Shift",
    "compared",
    "identify_damage",
    "observe",
    "screen",
]
