"""Structures that could have given the training records of a chain, and weather that they may meet."""

from skthermo.studies.worlds._models import checked_models
from skthermo.studies.worlds._worlds import PARTS, Worlds

__all__ = ["PARTS", "Worlds", "checked_models"]
