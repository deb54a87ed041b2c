"""Which damage explains a shift of frequencies."""

from skthermo.studies.identification._identified import IdentifiedDamage
from skthermo.studies.identification._identify import identify_damage

__all__ = ["IdentifiedDamage", "identify_damage"]
