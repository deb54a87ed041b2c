"""Modes that stand among the temperatures, and temperatures that stand among the modes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, as_floats, median, robust_deviation, spread_evenly
from skthermo._tables.frames import Table, column_names
from skthermo.exceptions import RecordsWarning

MOST_ROWS, LEAST_ROWS = 2000, 30  # evenly spread, that are looked at
STEADY = 0.15  # variation of a frequency at most
AS_STEADY = 3.0  # times the variation of the other modes, at most, of a mode
UNSTEADY = 5.0  # times the variation of modes, at least, of a temperature
MAGNITUDES = 10.0  # by which a mode may be below the lowest or above the highest of the others
TOGETHER, ALIKE = 0.1, 0.6  # rank correlation of two modes, and of two temperatures
DEGREES, RATIO = 20.0, 3.0  # difference of the medians and ratio of the deviations of two temperatures


def misplaced_columns(temperatures: Table, frequencies: Table) -> Iterator[RecordsWarning]:
    """A warning about temperatures that behave like frequencies, and one about frequencies that behave like
    temperatures.

    Frequencies are positive, vary by a few percent of their median, and rise and fall together. Temperatures in degrees
    Celsius vary by far more, and are nearly equal.
    """
    if len(temperatures) < LEAST_ROWS:
        return
    T, F = Columns.of(temperatures, "T"), Columns.of(frequencies, "f")
    steady = F.variation[F.variation <= STEADY]
    usual = np.median(steady) if len(steady) else np.min(T.variation, initial=STEADY)
    is_temperature = (F.variation >= UNSTEADY * usual) & (len(steady) > 0 or (T.variation <= STEADY).any())
    is_mode = (T.variation <= AS_STEADY * F.variation[~is_temperature].max(initial=0.0)) & F.reach(T)
    is_mode &= T.variation <= STEADY
    if not is_mode.any() and not is_temperature.any():
        return
    ranks = pd.DataFrame(np.hstack([T.values, F.values])).corr("spearman", min_periods=LEAST_ROWS).fillna(0).to_numpy()
    n_sensors = len(T.names)
    among, across = ranks[:n_sensors, :n_sensors], ranks[:n_sensors, n_sensors:]
    together = across[:, ~is_temperature].mean(axis=1) if not is_temperature.all() else np.zeros(n_sensors)
    is_mode &= together > np.maximum(among[:, ~is_mode].max(axis=1, initial=-1.0), TOGETHER)
    is_temperature &= ((across > ALIKE) & T.nearly(F))[~is_mode].any(axis=0)
    if is_mode.any():
        yield RecordsWarning(
            f"the columns {T.named(is_mode)} behave like frequencies: they vary as little as the modes, and with them. "
            "A mode that predicts the others hides damage. Put all modes among the targets, and only temperatures "
            "beside them",
            "modes-among-temperatures",
        )
    if is_temperature.any():
        yield RecordsWarning(
            f"the targets {F.named(is_temperature)} behave like temperatures: they vary by far more than the modes, "
            "and are nearly equal to other temperatures. A detector would evaluate the weather. Give only frequencies "
            "as targets",
            "temperatures-among-modes",
        )


class Columns:
    """Columns of a table with their robust statistics."""

    def __init__(self, values: Array, names: list):
        self.values, self.names = values, names
        self.median, self.deviation = median(values), robust_deviation(values)
        positive = (np.fmin.reduce(values) > 0) & (self.deviation > 0)
        self.variation = np.divide(self.deviation, self.median, out=np.full(len(names), np.inf), where=positive)

    @classmethod
    def of(cls, table: Table, default: str) -> Columns:
        """Rows of a table, evenly spread."""
        rows = spread_evenly(np.arange(len(table)), MOST_ROWS)
        return cls(as_floats(table)[rows], column_names(table, default))

    def named(self, chosen: NDArray[np.bool_]) -> list:
        return [name for name, is_chosen in zip(self.names, chosen, strict=True) if is_chosen]

    def reach(self, others: Columns) -> NDArray[np.bool_]:
        """Which others have about the magnitude of some of these."""
        lowest, highest = np.nanmin(self.median) / MAGNITUDES, np.nanmax(self.median) * MAGNITUDES
        return (others.median >= lowest) & (others.median <= highest)

    def nearly(self, others: Columns) -> NDArray[np.bool_]:
        """Which pairs with others could be temperatures of the same place, (n_columns, n_others)."""
        difference = np.abs(self.median[:, np.newaxis] - others.median)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.deviation[:, np.newaxis] / others.deviation
        return (difference <= DEGREES) & (ratio >= 1 / RATIO) & (ratio <= RATIO)
