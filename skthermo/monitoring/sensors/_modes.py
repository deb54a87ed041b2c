"""Frequencies that no structure has: absurd values of a mode, and columns of modes that were exchanged."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, median, robust_deviation
from skthermo.monitoring.sensors._thermometers import local_days
from skthermo.residuals.gaussian import Gaussian

ABSURD = 0.25  # change of a frequency, as a logarithm, that no damage gives to one mode alone
UNMOVED = 0.05  # median of the changes of all modes up to which one moves alone
FEWEST = 3  # modes of which one can be told to move alone
NEARER = 0.5  # distance of both from their places when exchanged, over that as they are
CERTAIN = 20.0  # logarithm of the odds that two modes are exchanged
LARGEST = 50.0  # logarithm of the odds that one record may add
LEAST_DEVIATION = 1e-4  # of the logarithm of a frequency
JITTER = 1e-6  # share of its variance that each column has of its own, also where two show the same


@dataclass(frozen=True)
class Modes:
    """Logarithms of frequencies that the weather foretells, and how far daily medians are from them in the baseline."""

    together: Gaussian
    centre: Array
    lowest: Array
    highest: Array
    deviations: Array

    @classmethod
    def of(cls, temperatures: Array, frequencies: Array, stamps: pd.DatetimeIndex) -> Modes:
        """Learn from the baseline."""
        logs = _logarithms(frequencies)
        lowest, highest = np.fmin.reduce(logs), np.fmax.reduce(logs)
        rows = np.hstack([temperatures, logs])
        together = Gaussian.of(rows[~np.isnan(rows).all(axis=1)])
        own = np.diag(np.maximum(JITTER * np.diag(together.covariance), JITTER * LEAST_DEVIATION**2))
        together = Gaussian(together.mean, together.covariance + own)
        bare = cls(together, median(logs), lowest, highest, np.empty(0))
        rest = pd.DataFrame(bare.logarithms(temperatures, frequencies)[0])
        by_day = rest.groupby(local_days(stamps)).median().to_numpy()
        deviations = robust_deviation(by_day)
        deviations = np.maximum(np.nan_to_num(deviations, nan=np.inf), LEAST_DEVIATION)
        return cls(together, bare.centre, lowest, highest, deviations)

    def logarithms(self, temperatures: Array, frequencies: Array) -> tuple[Array, Array]:
        """Logarithms of frequencies beside those that the weather foretells, and of these."""
        rows = np.hstack([temperatures, np.full(frequencies.shape, np.nan)])
        expected = self.together.completed(rows)[0][:, temperatures.shape[1] :]
        expected = np.clip(np.where(np.isnan(expected), self.centre, expected), self.lowest, self.highest)
        return _logarithms(frequencies) - expected, expected

    def absurd(self, rest: Array) -> NDArray[np.bool_]:
        """Values that moved by tens of percent while the other modes of their record stay."""
        with np.errstate(invalid="ignore"):
            far = np.abs(rest) > ABSURD
        if not far.any() or rest.shape[1] < FEWEST:
            return far & False
        rows = far.any(axis=1)
        far[rows] &= (median(np.abs(rest[rows]).T) < UNMOVED)[:, np.newaxis]
        return far

    def pairs(self) -> list[tuple[int, int]]:
        """Pairs of modes, by position."""
        return list(combinations(range(len(self.lowest)), 2))

    def odds_of_exchange(self, rest: Array, expected: Array) -> Array:
        """Logarithm of the odds that a day's values of each pair are exchanged, against their being in place.

        Modes are exchanged only where both come much nearer to their places by it: the lower column has risen and the
        upper one fallen, by about their distance. No damage does that, and the odds are as bad as can be otherwise.
        """
        today, places = median(rest), median(expected)
        found = np.zeros(len(self.pairs()))
        for pair, (first, second) in enumerate(self.pairs()):
            both = [first, second]
            if np.isnan(today[both]).any():
                continue
            gap = places[second] - places[first]
            here = today[both] / self.deviations[both]
            exchanged = np.array([today[second] + gap, today[first] - gap]) / self.deviations[both]
            odds = (here @ here - exchanged @ exchanged) / 2
            is_near = (np.abs(exchanged) < NEARER * np.abs(here)).all()
            found[pair] = min(odds, LARGEST) if is_near else -LARGEST
        return found


def _logarithms(frequencies: Array) -> Array:
    """Logarithms; very small where a frequency is not positive."""
    return np.log(np.where(frequencies > 0, frequencies, np.where(np.isnan(frequencies), np.nan, 1e-300)))
