"""Which causes explain a shift of frequencies, and how probably."""

from skthermo.studies.identification._causes import SOMETHING_ELSE, Cause
from skthermo.studies.identification._comparison import Comparison
from skthermo.studies.identification._evidence import Observed
from skthermo.studies.identification._explanations import Scale, screen
from skthermo.studies.identification._identified import IdentifiedDamage
from skthermo.studies.identification._identify import compared, identify_damage
from skthermo.studies.identification._observe import observe
from skthermo.studies.identification._posterior import Posterior
from skthermo.studies.identification._prior import DamagePrior
from skthermo.studies.identification._shift import Shift

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
