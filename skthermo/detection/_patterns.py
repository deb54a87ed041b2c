"""Damage indices that mean the same whichever modes a record has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from skthermo._tables.arrays import Array, patterns
from skthermo.residuals.gaussian import Mask

CHANCE = 0.95  # groups of rows get factors only if they differ by more than chance would with this probability
PATTERN_SHARE = 0.1  # of a pattern's rows above the level that gives its factor; alarms alone are too few for that
FEWEST_ROWS = 50  # of a group that gets a factor of its own


def as_if_complete(distances: Array, n_present: Array, n_modes: int) -> Array:
    """Distance in ``n_modes`` dimensions that a normal record exceeds as often as its own in ``n_present``.

    By the approximation of Wilson and Hilferty: the cube root of a chi-square number is nearly normal.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        here, there = 2 / (9 * n_present), 2 / (9 * n_modes)
        normal = (np.cbrt(distances**2 / n_present) - (1 - here)) / np.sqrt(here)
        squared = n_modes * (1 - there + normal * np.sqrt(there)) ** 3
        mapped = np.sqrt(squared)
    return np.where(n_present == n_modes, distances, np.where(n_present == 0, np.nan, mapped))


@dataclass(frozen=True)
class PatternScale:
    """Factors that make the indices of every pattern of missing modes exceed one threshold equally often.

    A pattern's factor is that of all rows with as many modes, at the threshold, times its own, at the highest tenth of
    its rows. Both are drawn to 1 as far as groups differ no more than by chance. Complete rows have the factor 1.
    """

    by_number: Array
    masks: Mask
    by_pattern: Array

    @classmethod
    def of(cls, index: Array, present: Mask, contamination: float) -> PatternScale:
        """Learned from the indices of a baseline."""
        known = np.isfinite(index)
        index, present = index[known], present[known]
        by_number = _factors(index, present.sum(axis=1), present.shape[1] + 1, contamination, trend=True)
        masks, of_row = patterns(present)
        by_pattern = _factors(
            index * by_number[present.sum(axis=1)], of_row, len(masks), max(contamination, PATTERN_SHARE)
        )
        scale = cls(by_number, masks, by_pattern)
        complete = scale._raw(np.ones((1, present.shape[1]), dtype=bool))[0]
        return cls(by_number / complete, masks, by_pattern)

    def __call__(self, present: Mask) -> Array:
        """Factors of rows, by which of their modes are there."""
        masks, of_row = patterns(present)
        return self._raw(masks)[of_row]

    def _raw(self, masks: Mask) -> Array:
        same = (masks[:, np.newaxis] == self.masks).all(axis=2)
        return self.by_number[masks.sum(axis=1)] * np.where(same.any(axis=1), same @ self.by_pattern, 1.0)


def _factors(index: Array, group: NDArray[np.intp], n_groups: int, share: float, *, trend: bool = False) -> Array:
    """Factors that make the groups exceed one level equally often, 1 where a group is small.

    With ``trend``, they are drawn to a straight line over the numbers of the groups.
    """
    counts = np.bincount(group, minlength=n_groups)
    large = np.flatnonzero(counts >= max(FEWEST_ROWS, 1 / share))
    if len(large) < 2:
        return np.ones(n_groups)
    logs = np.log(index)
    values = np.array([np.quantile(logs[group == one], 1 - share) for one in large])
    low, high = 1 - min(2 * share, 0.9), 1 - share / 2
    steepness = np.diff(np.quantile(logs, [low, high]))[0] / (high - low)
    factors = np.ones(n_groups)
    variances = share * (1 - share) * steepness**2 / counts[large]
    line = _line(large, values, variances) if trend else 0.0
    factors[large] = np.exp(-line - _effects(values - line, variances))
    return factors


def _line(numbers: Array, values: Array, variances: Array) -> Array:
    """Differences from the mean on a straight line, shrunk; zero if chance may have caused them."""
    weights = 1 / variances
    x = numbers - np.average(numbers, weights=weights)
    information = (weights * x * x).sum()
    slope = (weights * x * values).sum() / information
    evidence = slope**2 * information
    return slope * (1 - 1 / evidence) * x if evidence > chi2.ppf(CHANCE, 1) else np.zeros(len(x))


def _effects(values: Array, variances: Array) -> Array:
    """Differences from the mean, shrunk as in a random-effects model; zero if chance may have caused them."""
    weights = 1 / variances
    differences = values - np.average(values, weights=weights)
    excess = (weights * differences**2).sum() - chi2.ppf(CHANCE, len(values) - 1)
    between = max(excess / (weights.sum() - (weights**2).sum() / weights.sum()), 0.0)
    return differences * between / (between + variances)
