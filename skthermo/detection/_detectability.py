"""How tests against cones and in any direction are joined, and which damage they find."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._tables.arrays import Array, real_array
from skthermo.residuals.cones import Cones

N_DRAWS = 2000  # normal records, by which rates of detection are estimated
N_DRAWS_OF_PATTERN = 400  # by which the mean squared length of projections is
TAIL, FEWEST_IN_TAIL = 0.1, 20  # share of the baseline that shows how rare large indices are, and least number of it
BEYOND = 5.0  # standard deviations above the threshold at which every record is found
STEPS = np.linspace(0.0, 1.0, 21)  # shares of the largest amount that are tried


@dataclass(frozen=True)
class Tail:
    """Squared indices of a baseline above a level, and by how much they exceed it on average, outliers apart."""

    level: float
    excess: float

    @classmethod
    def of(cls, index: Array) -> Tail:
        """Of the highest tenth of the indices, or more of a short baseline; by their median, because of outliers."""
        squares = index[np.isfinite(index)] ** 2
        share = min(max(TAIL, FEWEST_IN_TAIL / max(len(squares), 1)), 0.5)
        level = float(np.quantile(squares, 1 - share))
        above = squares[squares > level]
        return cls(level, float(np.median(above) - level) / np.log(2) if len(above) else 0.0)


@dataclass(frozen=True)
class JoinedTests:
    """The index of the cone and that of the omnibus, joined so that the latter gives a share of the false alarms.

    Squares of either index exceed their tails exponentially. The omnibus index is expressed as the index of the cone
    that is exceeded as often, times what the shares of both are to each other; the larger of the two counts.
    """

    cone: Tail
    omnibus: Tail
    share: float

    @classmethod
    def of(cls, cone: Array, omnibus: Array, share: float) -> JoinedTests:
        """Learned from the indices of a baseline."""
        return cls(Tail.of(cone), Tail.of(omnibus), share)

    def __call__(self, cone: Array, omnibus: Array) -> Array:
        if self.share in (0, 1):
            return omnibus if self.share else cone
        ratio = self.cone.excess / self.omnibus.excess if self.omnibus.excess > 0 else 1.0
        rarer = np.log((1 - self.share) / self.share)
        squared = self.cone.level + ratio * (omnibus**2 - self.omnibus.level) - self.cone.excess * rarer
        return np.maximum(cone, np.sqrt(np.maximum(squared, 0.0)))


@dataclass(frozen=True)
class Detectability:
    """Which amounts of each direction normal records let a threshold find, none above the ``largest``.

    ``white`` are the effects of the directions on what is tested, whitened, (n_modes, n_directions).
    """

    tests: JoinedTests
    white: Array
    names: Sequence[Any]
    threshold: float
    largest: float

    def pod(self, severities: ArrayLike) -> pd.DataFrame:
        """Share of records above the threshold, by severity and direction."""
        amounts = np.ravel(real_array(severities, "severities"))
        if not ((amounts >= 0) & (amounts <= self.largest)).all():
            expected = "losses from 0 to 1" if self.largest == 1 else "amounts that are not negative"
            raise ValueError(f"severities is {severities!r:.200}; expected {expected}")
        rates = [self._rates_of(direction, amounts) for direction in range(len(self.names))]
        return pd.DataFrame(np.transpose(rates), pd.Index(amounts, name="severity"), list(self.names))

    def smallest(self, level: float) -> pd.Series:
        """Smallest amount that is found in a share of the records; infinite where not even the largest is."""
        found = [self._smallest(effect, level) for effect in range(len(self.names))]
        return pd.Series(found, pd.Index(list(self.names), name="direction"), dtype=float)

    def _smallest(self, direction: int, level: float) -> float:
        """The first of some steps that is found often enough, and again of finer ones before it."""
        length = max(float(np.linalg.norm(self.white[:, direction])), np.finfo(float).tiny)
        low, high = 0.0, min((self.threshold + BEYOND) / length, self.largest)
        for _ in range(2):
            steps = low + STEPS * (high - low)
            reached = np.flatnonzero(self._rates_of(direction, steps) >= level)
            if not len(reached):
                return np.inf
            last = max(reached[0], 1)
            low, high = float(steps[last - 1]), float(steps[last])
        return high

    def _rates_of(self, direction: int, amounts: Array) -> Array:
        """Shares of normal rows with each amount above the threshold."""
        draws = np.random.RandomState(0).standard_normal((N_DRAWS, len(self.white)))
        moved = draws + np.outer(amounts, self.white[:, direction])[:, np.newaxis]
        moved = moved.reshape(-1, len(self.white))
        lengths = Cones.of(self.white).project(moved @ self.white, np.zeros(len(moved), dtype=np.intp))[1]
        above = self.tests(lengths, np.linalg.norm(moved, axis=1)) > self.threshold
        return above.reshape(len(amounts), -1).mean(axis=1)


def mean_squares(white: Array) -> Array:
    """Mean squared length of the projections of normal rows on the cones of some effects, (n_cones, n_modes, n_dir)."""
    draws = np.random.RandomState(0).standard_normal((N_DRAWS_OF_PATTERN, white.shape[1]))
    which: NDArray[np.intp] = np.repeat(np.arange(len(white)), N_DRAWS_OF_PATTERN)
    lengths = Cones.of(white).project((draws @ white).reshape(len(which), -1), which)[1]
    return (lengths.reshape(len(white), -1) ** 2).mean(axis=1)


def explained_share(lengths: Array, distances: Array) -> Array:
    """Share of squared distances that lies in a cone, from the lengths of the projections on it."""
    known = distances > 0
    return np.divide(np.minimum(lengths, distances) ** 2, distances**2, out=np.full(len(lengths), np.nan), where=known)
