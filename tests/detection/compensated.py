"""Records and compensators for tests."""

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import TemperatureCompensator
from skthermo.preprocessing import LagFeatures

YEAR = make_truss_campaign(2, samples_per_year=100, random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
X = T.join(F)
MODES = list(F.columns)
POSITIONS = [X.columns.get_loc(mode) for mode in MODES]


def compensator(estimator=None, **options):
    estimator = KNeighborsRegressor(3) if estimator is None else estimator
    return TemperatureCompensator(estimator, **({"targets": MODES} | options))


def with_gaps(columns, rows):
    holed = X.copy()
    holed.iloc[rows, [X.columns.get_loc(column) for column in columns]] = np.nan
    return holed


def hourly(n_rows=120):
    """Frequencies that follow the temperature of now and of two hours ago."""
    hours = pd.date_range("2025-01-01", periods=n_rows, freq="h")
    T1 = pd.Series(np.random.default_rng(0).normal(10, 5, n_rows), hours)
    return pd.DataFrame({"T1": T1, "f1": 4 - 0.01 * T1 - 0.02 * T1.shift(2).fillna(0)}).iloc[2:]


LAGGED = make_pipeline(LagFeatures([0, 2], freq="1h", tolerance="0h", padding="nan"), LinearRegression())
