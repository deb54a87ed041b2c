"""Responses that the weather predicts: implausible values of one of them, and columns that were exchanged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, median, robust_deviation
from skthermo.monitoring.sensors._thermometers import local_days
from skthermo.residuals.gaussian import Gaussian

FAR = 25.0  # robust deviations from the prediction within which no value is implausible
SHARE = 0.25  # of a response's level, within which none is: no damage changes one frequency alone by more
BEYOND = 3.0  # times what the baseline's own records are away from it, all but one in a thousand
UNMOVED = 0.2  # median of all responses' distances, in such limits, up to which one moves alone
FEWEST = 3  # responses of which one can be seen to move alone
ENORMOUS = 1000.0  # limits beyond which a value is implausible, whatever the others do
SAME_SIZE = 10.0  # ratio of the levels of two responses, and of their scatter, up to which they may be exchanged
NEARER = 0.5  # distance of both from their places when exchanged, over that as they are
CERTAIN = 20.0  # logarithm of the odds that two responses are exchanged
LARGEST = 50.0  # logarithm of the odds that one record may add
LEAST = 1e-4  # of the level, or of the scatter, below which no deviation is
JITTER = 1e-6  # share of its variance that each column has of its own, also where two show the same


@dataclass(frozen=True)
class Responses:
    """Responses in their own units beside what the weather predicts, and how far those of the baseline are from that.

    ``together`` is the distribution of temperatures and responses, these from ``centre`` in their ``scatter``;
    ``limits`` are distances from which a value that moves alone is implausible, ``deviations`` those of daily medians.
    """

    together: Gaussian
    centre: Array
    scatter: Array
    lowest: Array
    highest: Array
    limits: Array
    deviations: Array
    pairs: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, temperatures: Array, values: Array, stamps: pd.DatetimeIndex, units: Sequence[str]) -> Responses:
        centre, scatter = median(values), robust_deviation(values)
        least = np.where(scatter > 0, LEAST * scatter, np.where(centre != 0, LEAST * np.abs(centre), LEAST))
        scatter = np.maximum(np.nan_to_num(scatter), np.nan_to_num(least, nan=LEAST))
        rows = np.hstack([temperatures, (values - centre) / scatter])
        together = Gaussian.of(rows[~np.isnan(rows).all(axis=1)])
        own = np.diag(JITTER * np.maximum(np.diag(together.covariance), LEAST**2))
        together = Gaussian(together.mean, together.covariance + own)
        sizes = (np.maximum(np.abs(centre), scatter), scatter)
        pairs = tuple(
            (a, b)
            for a, b in combinations(range(len(centre)), 2)
            if units[a] == units[b] and all(max(size[[a, b]]) <= SAME_SIZE * min(size[[a, b]]) for size in sizes)
        )
        lowest, highest = np.fmin.reduce(values), np.fmax.reduce(values)
        bare = cls(together, centre, scatter, lowest, highest, np.empty(0), np.empty(0), pairs)
        rest = bare.residuals(temperatures, values)[0]
        reached = np.array([np.nanquantile(c, 0.999) if len(c) else 0.0 for c in _known(np.abs(rest))])
        scale = np.maximum(np.nan_to_num(robust_deviation(rest)), least)
        limits = np.fmax(np.fmax(FAR * scale, SHARE * np.abs(centre)), BEYOND * reached)
        by_day = pd.DataFrame(rest).groupby(local_days(stamps)).median().to_numpy()
        deviations = np.maximum(np.nan_to_num(robust_deviation(by_day), nan=np.inf), least)
        return cls(together, centre, scatter, lowest, highest, limits, deviations, pairs)

    def residuals(self, temperatures: Array, values: Array) -> tuple[Array, Array]:
        """Responses minus those that the weather predicts, and these."""
        rows = np.hstack([temperatures, np.full(values.shape, np.nan)])
        expected = self.centre + self.scatter * self.together.completed(rows)[0][:, temperatures.shape[1] :]
        expected = np.clip(np.where(np.isnan(expected), self.centre, expected), self.lowest, self.highest)
        return values - expected, expected

    def implausible(self, values: Array, rest: Array) -> NDArray[np.bool_]:
        """Values farther from the prediction than damage explains while the others of their record stay.

        Whatever the others do, none is enormous, and none is zero or below where all of the baseline are above.
        """
        size = np.abs(rest) / self.limits
        with np.errstate(invalid="ignore"):
            far, never = size > 1, (size > ENORMOUS) | ((values <= 0) & (self.lowest > 0))
        if not far.any() or rest.shape[1] < FEWEST:
            return never
        rows = far.any(axis=1)
        far[rows] &= (median(size[rows].T) < UNMOVED)[:, np.newaxis]
        return far | never

    def odds_of_exchange(self, rest: Array, expected: Array) -> Array:
        """Logarithm of the odds that a day's values of each pair are exchanged, against their being in place.

        Two are exchanged only where both come much nearer to their places by it: one has risen and the other one
        fallen, by about their distance. No damage does that, and the odds are as bad as can be otherwise.
        """
        today, places = median(rest), median(expected)
        found = np.zeros(len(self.pairs))
        for pair, (first, second) in enumerate(self.pairs):
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


def _known(values: Array) -> list[Array]:
    return [column[~np.isnan(column)] for column in values.T]
