import numpy as np
import pandas as pd
from sklearn.dummy import DummyRegressor

from skthermo.metrics import (
    error_table,
    frequency_scorer,
    mape,
    minimum_detectable_damage,
    probability_of_detection,
    probability_of_false_alarm,
    time_to_detection,
)


def metrics_errors():
    """Errors of predicted frequencies in percent, in a table and as scores."""
    T, F = np.zeros((4, 1)), np.array([[1.0], [3.0], [2.0], [2.0]])
    return {
        "mape": mape([[2.0, 4.0], [2.0, 4.0]], [[2.02, 4.0], [1.98, float("nan")]]),
        "table": error_table([[2.0], [4.0]], [[2.02], [4.12]], scenarios=["healthy", "damaged"]),
        "scores": frequency_scorer(DummyRegressor().fit(T, F), T, [[2.5], [1.6], [2.0], [np.nan]]),
    }


def metrics_rates():
    """Rates of alarms, the smallest damage found, the time until it is found."""
    nan = float("nan")
    days = pd.Series([1.0, 2.0, nan, 4.0, 5.0], pd.date_range("2026-03-01", periods=5))
    return {
        "false alarms": probability_of_false_alarm([1.0, 2.0, 4.0, 1.5, nan], threshold=3.0),
        "detection": probability_of_detection([3.5, 2.0, 4.0, 5.0], threshold=3.0),
        "smallest": minimum_detectable_damage([0.1, 0.2, 0.3], [0.26, 0.95, 1.0]),
        "none": minimum_detectable_damage([0.1, 0.2], [0.26, 0.5], level=0.9),
        "records": time_to_detection([5.0, 1.0, 2.0, 4.0, 5.0], threshold=3.0, onset=1),
        "time": str(time_to_detection(days, 3.0, onset="2026-03-02")),
    }
