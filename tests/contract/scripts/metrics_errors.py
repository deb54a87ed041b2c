"""Errors of predicted frequencies in percent, in a table and as scores."""

import numpy as np
from sklearn.dummy import DummyRegressor

from skthermo.metrics import error_table, frequency_scorer, mape

T, F = np.zeros((4, 1)), np.array([[1.0], [3.0], [2.0], [2.0]])
RESULTS = {
    "mape": mape([[2.0, 4.0], [2.0, 4.0]], [[2.02, 4.0], [1.98, float("nan")]]),
    "table": error_table([[2.0], [4.0]], [[2.02], [4.12]], scenarios=["healthy", "damaged"]),
    "scores": frequency_scorer(DummyRegressor().fit(T, F), T, [[2.5], [1.6], [2.0], [np.nan]]),
}
