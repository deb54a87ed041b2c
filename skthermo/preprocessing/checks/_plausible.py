"""Values that can be measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo._tables.frames import MARKERS

NO_WEATHER = 30.0  # degrees, or the range of known ones, outside that range, which no weather gives


@dataclass(frozen=True)
class Plausible:
    """Which values can be measured: between bounds by column, and none that loggers write for a missing one."""

    lowest: Array
    highest: Array

    @classmethod
    def of(cls, baseline: pd.DataFrame, targets: Sequence[Any]) -> Plausible:
        """No frequency of zero or below, no temperature in kelvin; missing values of the baseline are NaN.

        What is 100 degrees beyond the baseline is no temperature.
        """
        is_target = baseline.columns.isin(targets)
        values = baseline.to_numpy()
        least, most = np.fmin.reduce(values), np.fmax.reduce(values)
        positive = np.where(least > 0, np.nextafter(0, 1), -np.inf)
        lowest = np.where(is_target, positive, np.fmin(least - 100, -80))
        return cls(lowest, np.where(is_target, np.inf, np.fmax(most + 100, 100)))

    @classmethod
    def of_weather(cls, temperatures: Array) -> Plausible:
        """Temperatures that weather may bring where these are known."""
        lowest, highest = np.fmin.reduce(temperatures), np.fmax.reduce(temperatures)
        beyond = np.maximum(highest - lowest, NO_WEATHER)
        return cls(lowest - beyond, highest + beyond)

    @classmethod
    def of_anything(cls, n_columns: int) -> Plausible:
        """All values but those that loggers write for a missing one."""
        return cls(np.full(n_columns, -np.inf), np.full(n_columns, np.inf))

    def implausible(self, values: Array) -> NDArray[np.bool_]:
        """Which values no sensor measures."""
        return np.isin(values, MARKERS) | (values < self.lowest) | (values > self.highest)

    def cleaned(self, records: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
        """Records with NaN for what no sensor measures, and a phrase about each that had such values."""
        values = records.to_numpy()
        wrong = self.implausible(values)
        told = [""] * len(records)
        for row in np.flatnonzero(wrong.any(axis=1)):
            parts = [f"{records.columns[k]} is {values[row, k]:g}" for k in np.flatnonzero(wrong[row])]
            told[row] = f"{', '.join(parts)}: taken as missing"
        return records.mask(wrong) if wrong.any() else records, told
