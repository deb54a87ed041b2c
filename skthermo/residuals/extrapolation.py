"""How much more predictions err in weather that is colder or warmer than what they learned from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.weather import TrainingRange

SHARE = 0.2  # of the records at each end of the weather, which are predicted from the others
USUAL, PRIOR = 9.0, 0.1  # growth that is assumed before an end shows its own, and its weight
FEWEST = 40  # records, of which a fifth shows how predictions err at an end


@dataclass(frozen=True)
class Extrapolation:
    """Variance of predictions outside the weather that they learned from, in shares of that of the residuals.

    Where a column is e ranges below the lowest value of the baseline, or above the highest, the share is ``growth *
    log(1 + e^2)``: the column that is farthest outside counts, and each end has a growth of its own.
    """

    trained: TrainingRange
    growth: Array

    @classmethod
    def of(cls, weather: Array, overall: Gaussian, residuals_of: Callable[[NDArray[np.bool_]], Array]) -> Extrapolation:
        """Learned from the coldest and from the warmest fifth of some records, each predicted from the other records.

        ``residuals_of`` gives the residuals of the records of a mask, predicted from all others; the growth at an end
        is the ratio of what these exceed ``overall`` by to what a growth of 1 would give.
        """
        everywhere = TrainingRange.of(weather, slice(None))
        width = np.where(everywhere.highest > everywhere.lowest, everywhere.highest - everywhere.lowest, 1.0)
        warmth, growth = np.mean((weather - everywhere.lowest) / width, axis=1), np.full(2, USUAL)
        for end, along in enumerate((-warmth, warmth)):
            apart = along > np.nanquantile(along, 1 - SHARE)
            if not apart.any():
                continue
            distance = _outside(TrainingRange.of(weather, ~apart), weather[apart])[:, end]
            residuals = residuals_of(apart)
            counts = (~np.isnan(residuals)).sum(axis=1)
            excess = np.nansum(overall.whiten(residuals) ** 2, axis=1) - counts
            expected = distance @ (counts * np.log1p(distance**2))
            growth[end] = max((distance @ excess + PRIOR * USUAL) / (expected + PRIOR), 0.0)
        return cls(everywhere, growth)

    def shares(self, weather: Array) -> Array:
        """Variance of the predictions in the weather of each row over that of the residuals; NaN counts as inside."""
        return np.log1p(_outside(self.trained, weather) ** 2) @ self.growth


def _outside(trained: TrainingRange, weather: Array) -> Array:
    """How far each row is below and above a range, by its farthest column, in units of that of the column."""
    below = np.where(weather < trained.lowest, weather, np.nan)
    above = np.where(weather > trained.highest, weather, np.nan)
    return np.column_stack([np.nan_to_num(trained.excess(side)).max(axis=1) for side in (below, above)])
