"""Damage indices that mean the same whichever modes a record has."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from skthermo._arrays import Array
from skthermo._weather import order_statistic
from skthermo.detection._gaussian import Mask, patterns

CHANCE = 0.95
"""Patterns get thresholds of their own only if they differ by more than chance would with this probability."""


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

    Attributes
    ----------
    masks : ndarray of shape (n_patterns, n_modes)
        Patterns of modes that are there.
    factors : ndarray of shape (n_patterns,)
    elsewhere : float
        Factor of all other patterns.
    """

    masks: Mask
    factors: Array
    elsewhere: float

    @classmethod
    def of(cls, index: Array, present: Mask, contamination: float) -> "PatternScale":
        """Learned from a baseline, shrunk to one common factor where a pattern is rare or the patterns are alike."""
        masks, of_row = patterns(present)
        known = ~np.isnan(index)
        thresholds = np.array(
            [order_statistic(index[known & (of_row == pattern)], 1 - contamination) for pattern in range(len(masks))]
        )
        enough = np.isfinite(thresholds)
        masks, counts = masks[enough], np.bincount(of_row[known], minlength=len(enough))[enough]
        if len(masks) < 2:
            return cls(masks[:0], np.empty(0), 1.0)
        steepness = _steepness(np.log(index[known]), contamination)
        logs, common = _shrunk(np.log(thresholds[enough]), contamination * (1 - contamination) * steepness**2 / counts)
        complete = masks.all(axis=1)
        reference = logs[complete][0] if complete.any() else common
        return cls(masks, np.exp(reference - logs), float(np.exp(reference - common)))

    def __call__(self, present: Mask) -> Array:
        """Factors of rows, by which of their modes are there."""
        masks, of_row = patterns(present)
        same = (masks[:, np.newaxis] == self.masks).all(axis=2)
        factors = np.where(same.any(axis=1), same @ self.factors, self.elsewhere)
        return np.where(masks.all(axis=1), 1.0, factors)[of_row]


def _steepness(log_index: Array, contamination: float) -> float:
    """How fast the logarithm of a quantile grows with its probability, near the threshold."""
    low, high = 1 - min(2 * contamination, 0.9), 1 - contamination / 2
    return float(np.diff(np.quantile(log_index, [low, high]))[0] / (high - low))


def _shrunk(values: Array, variances: Array) -> tuple[Array, float]:
    """Values drawn towards their common mean as in a random-effects model, and that mean."""
    weights = 1 / variances
    mean = float(np.average(values, weights=weights))
    scatter = (weights * (values - mean) ** 2).sum() - chi2.ppf(CHANCE, len(values) - 1)
    between = max(scatter / (weights.sum() - (weights**2).sum() / weights.sum()), 0.0)
    return mean + (values - mean) * between / (between + variances), mean
