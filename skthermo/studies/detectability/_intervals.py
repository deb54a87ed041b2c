"""Confidence intervals of a rate of alarms over serially dependent records."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta, t

from skthermo._tables.arrays import Array
from skthermo._tables.frames import correlation_times

BLOCK = 10  # length of a block, in correlation times
LEAST_FREEDOM = 10  # fewest degrees of freedom of the variance; blocks are shortened to reach them
FEW_ALARMS = 10  # minimum number of alarms, and of records without one, to estimate their variance


@dataclass(frozen=True)
class Rate:
    """Rate of alarms over evaluated records, its bounds, and the number of independent records with the same error."""

    n_alarms: int
    n_records: int
    n_effective: float
    lowest: float
    highest: float

    @property
    def rate(self) -> float:
        """Share of the records in alarm; NaN without records."""
        return self.n_alarms / self.n_records if self.n_records else float("nan")


def rate_of(decisions: Array, confidence: float = 0.95, whole_repeats: bool = False) -> Rate:
    """Rate of negative decisions, with Clopper-Pearson bounds of the effective number of records.

    Decisions, (n_repeats, n_records), are of the same records with different noise, in order of time, and NaN where
    there is none. With ``whole_repeats``, all records of a repeat depend on each other.
    """
    evaluated = ~np.isnan(decisions)
    n_alarms, n_records = int((decisions < 0).sum()), int(evaluated.sum())
    if not n_records:
        return Rate(0, 0, 0.0, 0.0, 1.0)
    if all(np.array_equal(repeat, decisions[0], equal_nan=True) for repeat in decisions[1:]):
        decisions = decisions[:1]  # repeats without noise count once
    blocks = Blocks.of(decisions, whole_repeats and len(decisions) > 1)
    n_effective = _n_effective(blocks, decisions, confidence)
    bounds = clopper_pearson(n_alarms / n_records * n_effective, n_effective, confidence)
    return Rate(n_alarms, n_records, n_effective, *bounds)


def clopper_pearson(n_alarms: float, n_records: float, confidence: float) -> tuple[float, float]:
    """Exact bounds of a binomial probability, by quantiles of the beta distribution, also for fractions."""
    tail = (1 - confidence) / 2
    lowest = beta.ppf(tail, n_alarms, n_records - n_alarms + 1) if n_alarms > 0 else 0.0
    highest = beta.isf(tail, n_alarms + 1, n_records - n_alarms) if n_alarms < n_records else 1.0
    return float(lowest), float(highest)


@dataclass(frozen=True)
class Blocks:
    """Contiguous blocks of records by their first ones, whose sums in different repeats are independent.

    Evaluated records are those with a decision, (n_repeats, n_records).
    """

    starts: NDArray[np.intp]
    evaluated: NDArray[np.bool_]

    @classmethod
    def of(cls, decisions: Array, whole_repeats: bool = False) -> "Blocks":
        """Blocks of several correlation times, or of all records of a repeat."""
        n_repeats, n_records = decisions.shape
        if whole_repeats:
            return cls(np.zeros(1, dtype=int), ~np.isnan(decisions))
        time = correlation_times(_scatter(decisions).T).mean()
        strata = max(n_repeats - 1, 1)
        number = max(n_records / (BLOCK * time), LEAST_FREEDOM / strata + (n_repeats == 1))
        number = int(np.clip(np.ceil(number), 1, n_records))
        return cls(np.linspace(0, n_records, number, endpoint=False).astype(int), ~np.isnan(decisions))

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the variance."""
        n_repeats, n_blocks = len(self.evaluated), len(self.starts)
        return max((n_repeats - 1) * n_blocks if n_repeats > 1 else n_blocks - 1, 1)

    def sums(self, values: Array) -> Array:
        """Sums over the evaluated records of each repeat and block, (n_repeats, n_blocks)."""
        return np.add.reduceat(np.where(self.evaluated, values, 0.0), self.starts, axis=1)

    def variance(self, values: Array) -> Array:
        """Variance of the mean of values: between repeats within blocks or, of a single repeat, between blocks."""
        sums, counts = self.sums(values), self.sums(np.ones(self.evaluated.shape))
        axis = 0 if len(sums) > 1 else 1
        number = sums.shape[axis]
        means = sums.sum(axis=axis, keepdims=True) / np.maximum(counts.sum(axis=axis, keepdims=True), 1)
        return number / max(number - 1, 1) * ((sums - means * counts) ** 2).sum() / counts.sum() ** 2


def _n_effective(blocks: Blocks, decisions: Array, confidence: float) -> float:
    """Number of records over the design effect, for an interval whose variance is estimated (Korn & Graubard 1998)."""
    alarms, n_records = (decisions < 0).astype(float), blocks.evaluated.sum()
    rate = alarms.sum() / n_records
    effects = [1.0]
    if 0 < rate < 1:
        effects.append(blocks.variance(alarms) / (rate * (1 - rate) / n_records))
    if min(rate, 1 - rate) * n_records < FEW_ALARMS:  # the decisions are correlated at least as much as their signs
        scatter = _scatter(decisions)
        variance = np.nanmean(scatter**2)
        if variance > 0:
            effects.append(blocks.variance(np.nan_to_num(scatter)) / (variance / n_records))
    tail = (1 - confidence) / 2
    return float(n_records / max(effects) * min((t.isf(tail, n_records - 1) / t.isf(tail, blocks.freedom)) ** 2, 1.0))


def _scatter(decisions: Array) -> Array:
    """Decisions less their mean: over the repeats, or over the records of a single one."""
    counts = np.maximum((~np.isnan(decisions)).sum(axis=0 if len(decisions) > 1 else 1, keepdims=True), 1)
    return decisions - np.nansum(decisions, axis=0 if len(decisions) > 1 else 1, keepdims=True) / counts
