"""Rates of alarms, the smallest damage found, the time until it is found."""

import pandas as pd

from skthermo.metrics import (
    minimum_detectable_damage,
    probability_of_detection,
    probability_of_false_alarm,
    time_to_detection,
)

nan = float("nan")
days = pd.Series([1.0, 2.0, nan, 4.0, 5.0], pd.date_range("2026-03-01", periods=5))
RESULTS = {
    "false alarms": probability_of_false_alarm([1.0, 2.0, 4.0, 1.5, nan], threshold=3.0),
    "detection": probability_of_detection([3.5, 2.0, 4.0, 5.0], threshold=3.0),
    "smallest": minimum_detectable_damage([0.1, 0.2, 0.3], [0.26, 0.95, 1.0]),
    "none": minimum_detectable_damage([0.1, 0.2], [0.26, 0.5], level=0.9),
    "records": time_to_detection([5.0, 1.0, 2.0, 4.0, 5.0], threshold=3.0, onset=1),
    "time": str(time_to_detection(days, 3.0, onset="2026-03-02")),
}
