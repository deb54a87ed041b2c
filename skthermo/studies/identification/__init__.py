"""Which causes explain a shift of frequencies, and how probably."""

from skthermo.studies.identification._causes import SOMETHING_ELSE, Cause, DamagePrior
from skthermo.studies.identification._curves import Curves, Effects, ShiftComparison
from skthermo.studies.identification._evidence import Observed
from skthermo.studies.identification._explanations import Scale, screen
from skthermo.studies.identification._identified import IdentifiedDamage
from skthermo.studies.identification._identify import compared, identify_damage
from skthermo.studies.identification._observe import observe
from skthermo.studies.identification._posterior import Posterior
from skthermo.studies.identification._shift import FrequencyShift

__all__ = [
    "SOMETHING_ELSE",
    "Cause",
    "Curves",
    "ShiftComparison",
    "DamagePrior",
    "Effects",
    "IdentifiedDamage",
    "Observed",
    "Posterior",
    "Scale",
    "FrequencyShift",
    "compared",
    "identify_damage",
    "observe",
    "screen",
]
