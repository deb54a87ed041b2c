"""Damage indices of windows: of the mean of their records, or of how many of them are far from the baseline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, betaincinv
from scipy.stats import chi

from skthermo._estimators.warnings import reported_by_caller, without_warnings
from skthermo._tables.arrays import Array, patterns
from skthermo.detection._detectability import explained_share, mean_squares
from skthermo.detection._mahalanobis import MahalanobisDetector
from skthermo.detection._origin import Changes, Origin, with_origin
from skthermo.detection._patterns import as_if_complete
from skthermo.detection._windows import Windows
from skthermo.residuals.cones import Cones
from skthermo.residuals.gaussian import Gaussian, check_invertible, whitenings

CLIPPED = 1.5  # standard deviations within a window beyond which a record moves the mean of the window no more
TOGETHER = 512  # windows whose values a processor keeps at hand
OF_COLUMNS = "implausible-values", "isolated-level", "equal-columns", "few-values"  # kinds of findings
SMALLEST_SIZE = 0.1  # mean square of a projection on a cone that hardly any mode shows
SMALLEST_CHANCE = 1e-50  # indices of windows that are less likely grow in proportion to those of their records


@dataclass(frozen=True)
class MeanLaw:
    """Length of the robust mean of whitened records, over the standard deviation of their mean.

    This grows with the mean ``correlation`` of two whitened records in one window, mode by mode. With ``effects`` of
    some directions on the columns, (n_columns, n_directions), there is also the length of its projection on their cone.
    """

    records: Gaussian
    correlation: Array
    effects: Array | None = None

    @classmethod
    def of(cls, windows: Windows, rows: NDArray[np.intp], effects: Array | None = None) -> MeanLaw:
        """Learned from the records in some rows, and from the windows that end there."""
        records = Gaussian.of(windows.rows[rows])
        check_invertible(records.covariance, windows.rows[rows])
        white = records.whiten(windows.rows)
        sums, counts = windows.sums(np.nan_to_num(white)), windows.sums((~np.isnan(white)).astype(float))
        squares = windows.sums(np.nan_to_num(white) ** 2)
        excess, pairs = (sums**2 - squares)[rows].sum(axis=0), (counts**2 - counts)[rows].sum(axis=0)
        return cls(records, np.clip(excess / np.maximum(pairs, 1), 0.0, 1.0), effects)

    def indices(self, windows: Windows) -> Array:
        """Damage indices of every window, (n_tests, n_windows), the omnibus first; NaN where no record has a mode."""
        standard, counts = self._means(windows)
        present, n_modes = counts > 0, standard.shape[1]
        omnibus = as_if_complete(np.linalg.norm(standard, axis=1), present.sum(axis=1), n_modes)
        if self.effects is None:
            return omnibus[np.newaxis]
        lengths, (masks, mask) = self._projected(standard, counts)[1], patterns(present)
        if not masks.all():
            whole, *sizes = mean_squares(np.vstack([np.ones(n_modes), masks])[:, :, np.newaxis] * self.white_effects)
            lengths = as_if_complete(lengths, np.maximum(sizes, SMALLEST_SIZE)[mask], whole)
        return np.stack([omnibus, np.where(present.any(axis=1), lengths, np.nan)])

    def explained(self, windows: Windows) -> tuple[Array, Array]:
        """Amounts of the directions in every window, and the share of its departure that they explain."""
        standard, counts = self._means(windows)
        amounts, lengths = self._projected(standard, counts)
        amounts[(counts == 0).all(axis=1)] = np.nan
        return amounts, explained_share(lengths, np.linalg.norm(standard, axis=1))

    def _means(self, windows: Windows) -> tuple[Array, Array]:
        """Robust means of whitened records in standard deviations, 0 without any, and how many have each mode."""
        white = self.records.whiten(windows.rows)
        counts, limits = windows.sums((~np.isnan(white)).astype(float)), CLIPPED * np.sqrt(1 - self.correlation)
        columns = zip(white.T, limits, strict=True)
        means = np.column_stack([robust_means(windows.inside(column), limit) for column, limit in columns])
        return np.where(counts > 0, means / self.deviations(counts), 0.0), counts

    def _projected(self, standard: Array, counts: Array) -> tuple[Array, Array]:
        """Amounts of the directions, and length of the projection on their cone."""
        weights = np.where(counts > 0, 1 / self.deviations(counts), 0.0)
        cases, case = np.unique(weights, axis=0, return_inverse=True)
        effects = cases[:, :, np.newaxis] * self.white_effects
        return Cones.of(effects).project(np.einsum("ij,ijk->ik", standard, effects[case]), case)

    def deviations(self, counts: Array) -> Array:
        """Standard deviations of the means of so many whitened records of each mode."""
        return np.sqrt(self.correlation + (1 - self.correlation) / np.maximum(counts, 1))

    @property
    def white_effects(self) -> Array:
        """Whitened effects of the directions, (n_modes, n_directions)."""
        complete = np.ones((1, len(self.correlation)), dtype=bool)
        return whitenings(self.records.covariance[np.newaxis], complete)[0][0] @ self.effects


def robust_means(rows: Array, limit: float) -> Array:
    """Mean of each row, of which no value counts as farther from the median than a limit; NaN left out.

    Moving all values moves it as far, and moving any of them never moves it the other way.
    """
    means = np.empty(len(rows))
    for start in range(0, len(rows), TOGETHER):
        some = rows[start : start + TOGETHER]
        counts, moves = (~np.isnan(some)).sum(axis=1), np.sort(some, axis=1)
        middle = np.maximum([counts - 1, counts], 0) // 2
        medians = np.take_along_axis(moves, middle.T, axis=1).mean(axis=1, keepdims=True)
        np.subtract(some, medians, out=moves)
        np.maximum(np.minimum(moves, limit, out=moves), -limit, out=moves)
        np.copyto(moves, 0.0, where=np.isnan(moves))
        means[start : start + TOGETHER] = medians[:, 0] + moves.sum(axis=1) / np.maximum(counts, 1)
    return means


@dataclass(frozen=True)
class CountLaw:
    """The m-th largest damage index of the n records in a window: it exceeds a threshold where m records do.

    In a window with gaps, the index is the one that is as unlikely in a full window of independent records, by the
    binomial law.
    """

    detector: MahalanobisDetector
    n: int
    m: int
    changes: Array | None = None

    @classmethod
    def of(
        cls,
        windows: Windows,
        rows: NDArray[np.intp],
        detector: MahalanobisDetector,
        m: int | None,
        changes: Array | None = None,
    ) -> CountLaw:
        """Learned from the records in some rows by an unfitted detector, which may need to know what changes make of
        them."""
        with reported_by_caller(OF_COLUMNS):  # the whole baseline has been checked
            detector.set_params(threshold="quantile").fit(_known(windows.rows[rows], changes))
        n = int(np.median(windows.sizes))
        if m is not None and m > n:
            raise ValueError(f"m is {m}, but windows hold {n} records; expected at most as many")
        return cls(detector, n, (n + 1) // 2 if m is None else m, changes)

    def indices(self, windows: Windows) -> Array:
        """Damage index of every window, (1, n_windows); NaN where no record has a mode."""
        with without_warnings():  # the alarm counts windows that are not evaluated
            single = self.detector.damage_index(_known(windows.rows, self.changes))
        return self._as_if_full(windows.inside(single), windows.rows.shape[1])[np.newaxis]

    def _as_if_full(self, single: Array, n_modes: int) -> Array:
        """The m-th largest index of each row, m in proportion to the records that are there."""
        count = (~np.isnan(single)).sum(axis=1)
        m = np.maximum(np.rint(self.m * count / self.n), 1).astype(int)
        value = -np.take_along_axis(np.sort(-single, axis=1), np.minimum(m, single.shape[1])[:, np.newaxis] - 1, axis=1)
        value, partial = value[:, 0], (count != self.n) & (count > 0)
        value[partial] = self._equally_likely(value[partial], m[partial], count[partial], n_modes)
        return value

    def _equally_likely(self, value: Array, m: NDArray[np.intp], count: NDArray[np.intp], n_modes: int) -> Array:
        """Indices in a full window that are as unlikely as these, the m-th of ``count``."""
        farthest = chi.isf(betaincinv(m, count - m + 1, SMALLEST_CHANCE), n_modes)
        chance = betainc(m, count - m + 1, chi.sf(np.minimum(value, farthest), n_modes))
        full = chi.isf(betaincinv(self.m, self.n - self.m + 1, np.maximum(chance, SMALLEST_CHANCE)), n_modes)
        return np.maximum(value / farthest, 1.0) * full


def _known(rows: Array, matrix: Array | None) -> Array:
    """A copy of some rows, of which a detector knows what relative changes of the frequencies make of them."""
    rows = rows.copy()
    if matrix is None:
        return rows
    return with_origin(rows, Origin(partial(np.zeros, len(rows)), partial(Changes.of_all, matrix, len(rows))))
