"""Bounds of values that a sensor in service may show, beside what it has shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array
from skthermo._core.frames import MISSING_CODES


@dataclass(frozen=True)
class Plausible:
    """Which values can be measured: between bounds by column, and none that loggers write for a missing one.

    A number such as -99 stands for a missing value only where the others of the baseline's column do not reach it.
    """

    lowest: Array
    highest: Array
    least: Array
    most: Array

    @classmethod
    def learned(cls, baseline: pd.DataFrame, targets: Sequence[Any]) -> Plausible:
        """No temperature in kelvin, and none that is 100 degrees beyond the baseline; targets may have any value."""
        is_target = baseline.columns.isin(targets)
        found = cls.beside(*_range(baseline.to_numpy()))
        lowest, highest = np.where(is_target, -np.inf, found.lowest), np.where(is_target, np.inf, found.highest)
        return replace(found, lowest=lowest, highest=highest)

    @classmethod
    def beside(cls, least: Array, most: Array) -> Plausible:
        """Temperatures where these are known: none in kelvin, and none that is 100 degrees beyond them."""
        return cls(np.fmin(least - 100, -80), np.fmax(most + 100, 100), least, most)

    @classmethod
    def of_weather(cls, temperatures: Array) -> Plausible:
        """Temperatures that weather may bring where these are known."""
        least, most = _range(temperatures)
        beyond = np.maximum(most - least, 30)
        return cls(least - beyond, most + beyond, least, most)

    def implausible(self, values: Array) -> NDArray[np.bool_]:
        """Which values no sensor measures."""
        is_marker = np.isin(values, MISSING_CODES) & ~((values >= self.least) & (values <= self.most))
        return is_marker | np.isinf(values) | (values < self.lowest) | (values > self.highest)


def _range(values: Array) -> tuple[Array, Array]:
    """Least and most of each column, numbers that may stand for missing values left out."""
    known = np.where(np.isin(values, MISSING_CODES), np.nan, values)
    return np.fmin.reduce(known), np.fmax.reduce(known)
