"""Damage detection from frequencies."""

from skthermo.detection._compensator import TemperatureCompensator
from skthermo.detection._mahalanobis import MahalanobisDetector

__all__ = ["MahalanobisDetector", "TemperatureCompensator"]
