"""Structures that could have given the training records of a chain, and weather that they may meet."""

from skthermo.studies.replicates._replicates import PARTS, Replicates, checked_models

__all__ = ["PARTS", "Replicates", "checked_models"]
