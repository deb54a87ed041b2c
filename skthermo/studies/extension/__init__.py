"""Which further measurement would make smaller damage detectable."""

from skthermo.studies.extension._what_to_add import what_to_add

__all__ = ["what_to_add"]
