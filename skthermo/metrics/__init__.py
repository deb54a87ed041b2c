"""How well damage is detected, and how well frequencies are predicted.

It uses NumPy and SciPy alone. Start with ``_detectability.py``.
"""

from skthermo.metrics._detectability import (
    minimum_detectable_damage,
    probability_of_detection,
    probability_of_false_alarm,
    time_to_detection,
)
from skthermo.metrics.errors import error_table, frequency_scorer, mape

__all__ = [
    "error_table",
    "frequency_scorer",
    "mape",
    "minimum_detectable_damage",
    "probability_of_detection",
    "probability_of_false_alarm",
    "time_to_detection",
]
