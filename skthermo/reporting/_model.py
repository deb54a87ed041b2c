"""What a model has learned from, and what it predicts."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd

from skthermo._core.arrays import as_floats, spread_evenly
from skthermo._core.frames import column_names
from skthermo._core.text import period_text
from skthermo._core.warnings import without_warnings
from skthermo.reporting._figures import chosen_sensor
from skthermo.reporting._templates import Row
from skthermo.surrogate import DataInformedFEM

MOST_PREDICTED = 1000  # number of records that are drawn over temperature


def records_of(T: pd.DataFrame, F: pd.DataFrame) -> dict[str, Any]:
    """Number, period and usual distance of records, and ranges of their temperatures and frequencies."""
    has_times = isinstance(F.index, pd.DatetimeIndex) and len(F) > 1
    sensors = _sensors(T)
    return {
        "n": len(F),
        "period": period_text(F.index),
        "step": pd.Series(F.index).diff().abs().median() if has_times else None,
        "sensors": sensors,
        "has_lags": len(sensors) < len(T.columns),
        "modes": [_range(name, values) for name, values in F.items()],
    }


def training_tables(fem: DataInformedFEM) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Temperatures and frequencies that the chain learned from, as frames."""
    T, F = fem.records_.temperatures, fem.records_.frequencies
    index = next((table.index for table in (F, T) if isinstance(table, pd.DataFrame)), None)
    names = column_names(T, "T"), column_names(F, "f")
    first, second = (pd.DataFrame(as_floats(t), index, [str(n) for n in c]) for t, c in zip((T, F), names, strict=True))
    return first, second


def over_temperature(
    fem: DataInformedFEM, T: pd.DataFrame, F: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame, pd.Series]:
    """Measured and predicted frequencies of some rows, evenly spread, and the temperature that they follow."""
    rows = spread_evenly(np.arange(len(T)), MOST_PREDICTED)
    with without_warnings():  # the report of the fit counts the gaps of these records
        frequencies = as_floats(fem.predict(fem.records_.temperatures))[rows]
    measured = F.iloc[rows]
    predicted = pd.DataFrame(frequencies, measured.index, measured.columns)
    return measured, predicted, chosen_sensor(T, F).iloc[rows]


def _sensors(T: pd.DataFrame) -> list[Row]:
    """One row for each sensor: lags, which `~skthermo.preprocessing.LagFeatures` calls sensor_lag1, are counted."""
    columns: dict[str, list[tuple[int, str]]] = {}
    for name in T.columns:
        lagged = re.fullmatch(r"(.+)_lag(\d+)", name)
        sensor, lag = (lagged[1], int(lagged[2])) if lagged else (name, -1)
        columns.setdefault(sensor, []).append((lag, name))
    rows = []
    for sensor, found in columns.items():
        first = min(found)[1]
        n_lags = sum(lag > 0 for lag, _ in found) if len(found) > 1 else 0
        rows.append({**_range(sensor if n_lags else first, T[first]), "n_lags": n_lags})
    return rows


def _range(name: object, values: pd.Series) -> Row:
    """Lowest, mean and highest value, and the share that is missing."""
    return {
        "name": name,
        "lowest": values.min(),
        "mean": values.mean(),
        "highest": values.max(),
        "missing": values.isna().mean(),
    }
