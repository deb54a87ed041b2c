"""Which causes explain a shift of frequencies, how probably, and where in its groups a structure is damaged."""

from skthermo.studies.identification._causes import DamagePrior
from skthermo.studies.identification._identify import IdentifiedDamage, identify_damage

__all__ = ["DamagePrior", "IdentifiedDamage", "identify_damage"]
