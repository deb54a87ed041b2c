"""Errors of the mean of some records' residuals, as long as records remember, and the probability of such a mean."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy import stats

from skthermo._core.arrays import Array, median, robust_deviation
from skthermo._core.saved_frames import SavesFrames
from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.numbers import independent_records


@dataclass(frozen=True)
class MeanErrors(SavesFrames):
    """How means of residuals scatter while nothing changes, as learned from healthy ones.

    ``known`` are the modes that were learned, (n_modes,), and ``limits`` the residuals between which one is no outlier,
    (2, n_modes). ``covariance`` is the covariance of a record, (n_known, n_known), ``for_one`` how many records in a
    row are worth one independent one, and ``n_trained`` how many independent ones were learned from, (n_modes,).
    ``is_estimated`` says whether the covariance was.
    """

    known: Array
    limits: Array
    covariance: Array
    for_one: Array
    n_trained: Array
    is_estimated: bool = True

    @classmethod
    def learned(cls, residuals: Array, *, least: int = 20, farthest: float = 6.0, slow: float = 2.0) -> MeanErrors:
        """From residuals of healthy records in order of time, (n_records, n_modes); a mode needs so many values.

        Modes may share a slow influence, such as moisture, that hardly shows in single records: in directions in which
        the means of a dozen parts scatter more than ``slow`` times as expected, their own variance counts.
        """
        reach = farthest * robust_deviation(residuals)
        limits = np.stack([median(residuals) - reach, median(residuals) + reach])
        values = np.where((residuals < limits[0]) | (residuals > limits[1]), np.nan, residuals)
        counts = (~np.isnan(values)).sum(axis=0)
        known = counts >= least
        for_one = np.array([records_for_one(column) for column in values.T])
        covariance = Gaussian.fitted(values[:, known][~np.isnan(values[:, known]).all(axis=1)]).covariance
        parts = pd.DataFrame(values[:, known]).groupby(np.arange(len(values)) * 12 // len(values)).mean()
        if known.any() and len(parts) == 12 and parts.notna().all(axis=None):
            roots = np.sqrt(for_one[known])
            root = np.linalg.cholesky(covariance * np.outer(roots, roots) + 1e-12 * np.diag(np.diag(covariance)))
            scaled = np.linalg.solve(root, (parts - parts.mean()).to_numpy().T * np.sqrt(counts[known] / 12)[:, None])
            variances, directions = np.linalg.eigh(scaled @ scaled.T / 11)
            wide = root @ directions
            covariance = (wide * np.where(variances > slow, variances, 1.0)) @ wide.T / np.outer(roots, roots)
        return cls(known, limits, covariance, for_one, np.maximum(counts / for_one, 1.0))

    def stated(self, deviations: Array) -> MeanErrors:
        """The same records as independent ones with such standard deviations."""
        covariance = np.diag(deviations[self.known] ** 2)
        ones, n_trained = np.ones_like(self.for_one), self.n_trained * self.for_one
        return replace(self, covariance=covariance, for_one=ones, n_trained=n_trained, is_estimated=False)

    @property
    def deviations(self) -> Array:
        """Standard deviation of a record's residuals, (n_modes,); NaN where it is not known."""
        found = np.full(len(self.known), np.nan)
        found[self.known] = np.sqrt(np.diag(self.covariance))
        return found

    def of_mean(self, n_records: Array, scatter: Array | float = 1.0) -> tuple[Array, float]:
        """Covariance of the mean of so many records of each mode, NaN where there is none, and its degrees of freedom.

        Errors of the healthy mean are included. ``scatter`` is how much more than healthy ones the records themselves
        scatter. The freedom is Hotelling's where the covariance was estimated.
        """
        some = self.known & (n_records > 0)
        n_independent = np.maximum(n_records / self.for_one, 1.0)
        roots = np.sqrt(np.broadcast_to(scatter, some.shape) ** 2 / n_independent + 1 / self.n_trained)[some]
        freedom = float(self.n_trained[some].mean() - 1)
        single = self.covariance[np.ix_(some[self.known], some[self.known])]
        if self.is_estimated:
            remaining = max(freedom - some.sum() + 1, 3.0)
            single, freedom = single * max(freedom, 3.0) / remaining, remaining
        covariance = np.full((len(some), len(some)), np.nan)
        covariance[np.ix_(some, some)] = single * np.outer(roots, roots)
        return covariance, freedom


def records_for_one(residuals: Array) -> float:
    """How many records of a mode in a row are worth one independent one.

    From the variance of the means of a dozen parts or, if that gives more, from the correlation of neighbours.
    """
    number = (~np.isnan(residuals)).sum()
    neighbours = np.clip(np.nan_to_num(pd.Series(residuals).autocorr()), 0, 0.98) if number > 2 else 0.0
    return max(number / independent_records(residuals), (1 + neighbours) / (1 - neighbours))


def chance_of(misfit: float, n_free: int, freedom: float) -> float:
    """Probability (F) of a larger squared misfit by chance; NaN without anything free."""
    return float(stats.f.sf(misfit / n_free, n_free, freedom)) if n_free > 0 else float("nan")
