"""Causes, what is thought of them before, and how probable explanations are in the light of measured shifts."""

from skthermo.studies.identification.weighing._causes import (
    HIGHEST_SEVERITY,
    NO_DAMAGE,
    SOMETHING_ELSE,
    Cause,
    read_causes,
)
from skthermo.studies.identification.weighing._comparison import Comparison, Part
from skthermo.studies.identification.weighing._evidence import Observed
from skthermo.studies.identification.weighing._explanations import Scale, explanations, screen
from skthermo.studies.identification.weighing._posterior import Posterior
from skthermo.studies.identification.weighing._prior import DamagePrior

__all__ = [
    "HIGHEST_SEVERITY",
    "NO_DAMAGE",
    "SOMETHING_ELSE",
    "Cause",
    "Comparison",
    "DamagePrior",
    "Observed",
    "Part",
    "Posterior",
    "Scale",
    "explanations",
    "read_causes",
    "screen",
]
