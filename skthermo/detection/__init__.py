"""Damage detection from frequencies."""

from skthermo.detection._fused import FusedDetector
from skthermo.detection._mahalanobis import MahalanobisDetector
from skthermo.detection._outlier import OutlierDetector
from skthermo.detection.compensation import TemperatureCompensator
from skthermo.detection.windows import WindowedAlarm

__all__ = ["FusedDetector", "MahalanobisDetector", "OutlierDetector", "TemperatureCompensator", "WindowedAlarm"]
