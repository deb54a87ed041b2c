"""Residuals of frequencies from temperatures, in standard deviations by weather."""

from skthermo.detection.compensation._compensator import TemperatureCompensator

__all__ = ["TemperatureCompensator"]
