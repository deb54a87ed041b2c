"""Where in its groups a structure is damaged."""

from skthermo.studies.location._locate import locate_damage
from skthermo.studies.location._located import LocatedDamage

__all__ = ["LocatedDamage", "locate_damage"]
