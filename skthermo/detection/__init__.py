"""Damage detection from frequencies: temperature removed, a damage index, a threshold for stated false alarms.

It uses ``residuals`` and ``preprocessing``; detectors take an FE model or a chain, and need none. Start with
``_base.py``, what all detectors share, then ``_directional.py``.
"""

from skthermo.detection._base import DamageDetector
from skthermo.detection._compensated import CompensatedDetector
from skthermo.detection._compensator import TemperatureCompensator
from skthermo.detection._directional import DirectionalDetector
from skthermo.detection._mahalanobis import MahalanobisDetector
from skthermo.detection._outlier import OutlierDetector

__all__ = [
    "CompensatedDetector",
    "DamageDetector",
    "DirectionalDetector",
    "MahalanobisDetector",
    "OutlierDetector",
    "TemperatureCompensator",
]
