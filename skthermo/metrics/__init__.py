"""How well damage is detected, and how well frequencies are predicted."""

from skthermo.metrics._detectability import (
    minimum_detectable_damage,
    probability_of_detection,
    probability_of_false_alarm,
    time_to_detection,
)
from skthermo.metrics._errors import complete_r2, error_table, frequency_scorer, mape

__all__ = [
    "complete_r2",
    "error_table",
    "frequency_scorer",
    "mape",
    "minimum_detectable_damage",
    "probability_of_detection",
    "probability_of_false_alarm",
    "time_to_detection",
]
