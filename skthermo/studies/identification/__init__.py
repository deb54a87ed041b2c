"""Which causes explain a shift of frequencies, and how probably."""

from skthermo.studies.identification._identified import IdentifiedDamage
from skthermo.studies.identification._identify import identify_damage
from skthermo.studies.identification._prior import DamagePrior

__all__ = ["DamagePrior", "IdentifiedDamage", "identify_damage"]
