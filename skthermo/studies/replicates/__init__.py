"""Structures that could have given the training records of a chain, and weather that they may meet."""

from skthermo.studies.replicates._models import checked_models
from skthermo.studies.replicates._replicates import PARTS, Replicates

__all__ = ["PARTS", "Replicates", "checked_models"]
