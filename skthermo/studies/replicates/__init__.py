"""Structures that could have given the training records of a chain, and weather that they may meet."""

from skthermo.studies.replicates._replicates import N_DRAWS, PARTS, Replicates, checked_models

__all__ = ["N_DRAWS", "PARTS", "Replicates", "checked_models"]
