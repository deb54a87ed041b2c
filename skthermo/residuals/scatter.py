"""How records scatter around what is expected in their weather, and how uncertain that leaves means of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # which loads scipy.signal once it is used
import scipy.fft
from numpy.typing import NDArray
from scipy.optimize import nnls

from skthermo._tables.arrays import Array

MOST_LAGS = 120  # number of records later up to which covariances are compared
N_TIMES = 12  # number of correlation times that are tried
N_DRAWN, MOST_DRAWN = 100_000, 64
"""Size of the simulated records of which covariances are expected, and largest number of their columns."""

PSEUDO_RECORDS = 12  # weight, in independent records, of the correlations of single records beside those of one part
FEWEST = 20  # number of training records of a mode below which its scatter counts as unknown
SMALLEST = 1e-3  # eigenvalue of correlations


@dataclass(frozen=True)
class Scatter:
    """Covariances of records as the sum of an independent part and of one that fades from record to record.

    ``parts``, (2, n_modes, n_modes), are those of single records, and zero for modes of which too little is known;
    ``memory`` is the correlation of the second part with itself one record later. ``n_records``, (n_modes,), were
    learned from.
    """

    parts: Array
    memory: float
    n_records: NDArray[np.intp]

    @classmethod
    def of(cls, residuals: Any) -> Scatter:
        """Learn from `BaselineResiduals` what weather similar to theirs does not explain.

        Residuals of records that the mapper has learned are too small, those out of fold too large; products of one
        with the other lie between. What the comparison with similar weather takes away is known from simulated records.
        """
        of_fold = residuals.less_similar(residuals.values)
        own = of_fold if residuals.is_overfitted else residuals.less_similar(residuals.own)
        n_records = (~np.isnan(own)).sum(axis=0)
        found = covariances(own, of_fold, int(np.clip(len(own) // 4, 2, MOST_LAGS)))
        known = np.flatnonzero((n_records >= FEWEST) & (np.diag(found[0]) > 0))
        parts, memory = np.zeros((2, *found[0].shape)), 0.0
        if known.size:
            inside = np.ix_(known, known)
            memory, parts[0][inside], parts[1][inside] = _split(
                found[:, known][:, :, known], n_records[known], residuals.less_similar, len(own)
            )
        return cls(parts, memory, n_records)

    @classmethod
    def independent(cls, deviations: Array, n_records: int) -> Scatter:
        """Independent records and modes of known standard deviations, (n_modes,)."""
        covariance = np.diag(deviations**2)
        return cls(np.array([covariance, 0 * covariance]), 0.0, np.full(len(deviations), n_records))

    @property
    def variances(self) -> Array:
        """Variance of single records, (n_modes,)."""
        return np.diag(self.parts.sum(axis=0))

    @property
    def numbers(self) -> Array:
        """As many independent records as determine each part, (2, n_modes)."""
        return np.outer([1.0, (1 - self.memory) / (1 + self.memory)], self.n_records)

    @property
    def n_trained(self) -> float:
        """As many independent records as would determine the mean of all modes as well as the training records do."""
        most = int(self.n_records.max(initial=0))
        weights = (np.arange(most)[:, np.newaxis] < self.n_records) / np.maximum(self.n_records, 1)
        numbers = self.n_independent(self.of_sums(weights, np.arange(most)))
        return float(numbers[self.variances > 0].min(initial=np.inf))

    def n_independent(self, parts: Array) -> Array:
        """As many independent records as would have a mean with such variances, (n_modes,)."""
        variances = np.diag(parts.sum(axis=0))
        return np.divide(self.variances, variances, out=np.zeros(len(variances)), where=variances > 0)

    def freedom(self, parts: Array) -> float:
        """Degrees of freedom of a covariance, (2, n_modes, n_modes), by parts: Satterthwaite's, mean of the modes."""
        variances = np.diagonal(parts, axis1=1, axis2=2)[:, self.variances > 0]
        squares = (variances**2 / self.numbers[:, self.variances > 0]).sum(axis=0)
        return float((variances.sum(axis=0) ** 2 / squares).mean())

    def of_sums(self, weights: Array, places: Array) -> Array:
        """Covariance of weighted sums of records in order of place, (2, n_modes, n_modes), by parts.

        Weights are (n_records, n_modes); places count records.
        """
        kept = self.memory ** np.diff(places, prepend=places[:1])
        before = _running_sums(weights, kept)
        after = _running_sums(weights[::-1], np.roll(kept[::-1], 1))[::-1]
        return self.parts * np.array([weights.T @ weights, weights.T @ (before + after - weights)])


def covariances(first: Array, second: Array, n_lags: int) -> Array:
    """Mean products of columns 0, 1, ... records apart, (n_lags, n_modes, n_modes), over pairs that are known."""
    known = [(~np.isnan(table)).astype(float) for table in (first, second)]
    filled = [np.nan_to_num(table) for table in (first, second)]
    found = np.empty((n_lags, first.shape[1], first.shape[1]))
    for lag in range(n_lags):
        sums, pairs = (a[lag:].T @ b[: len(b) - lag] + b[lag:].T @ a[: len(a) - lag] for a, b in (filled, known))
        found[lag] = (sums + sums.T) / np.maximum(pairs + pairs.T, 1)
    return found


def _split(
    found: Array, n_records: NDArray[np.intp], less_similar: Callable[[Array], Array], n_rows: int
) -> tuple[float, Array, Array]:
    """Memory, and covariances of the independent and of the fading part, that explain the covariances that were found.

    Without clear signs of a fading part, its covariance is zero.
    """
    times = np.geomspace(1.5, max(n_rows / 8, 3.0), N_TIMES)
    memories = np.append(0.0, (times - 1) / (times + 1))
    expected = _expected(memories, less_similar, n_rows, len(found))
    single = np.diag(found[0])
    of_modes = np.diagonal(found, axis1=1, axis2=2) / single
    fits = [[nnls(expected[[0, place]].T, column) for column in of_modes.T] for place in range(len(memories))]
    misfits = [sum(n * rest**2 for n, (_, rest) in zip(n_records, fit, strict=True)) for fit in fits]
    best = int(np.argmin(misfits))
    if misfits[0] - misfits[best] <= 2 * (len(n_records) + 1):  # as the same number of parameters explain of noise
        best = 0
    memory, total = float(memories[best]), _correlations(found[0], single)
    if best == 0:
        variances = single * (expected[0] @ of_modes) / (expected[0] @ expected[0])
        return memory, _covariance(total, variances), np.zeros_like(total)
    variances = single * np.array([shares for shares, _ in fits[best]]).T
    matrices = np.linalg.lstsq(expected[[0, best]].T, found.reshape(len(found), -1), rcond=None)[0]
    parts = []
    for part, faded in enumerate((1.0, (1 - memory) / (1 + memory))):
        known = faded * n_records.min()
        own = _correlations(matrices[part].reshape(total.shape), variances[part])
        own = np.where(np.isnan(own), total, own)
        parts.append(_covariance((known * own + PSEUDO_RECORDS * total) / (known + PSEUDO_RECORDS), variances[part]))
    return memory, parts[0], parts[1]


def _expected(memories: Array, less_similar: Callable[[Array], Array], n_rows: int, n_lags: int) -> Array:
    """Covariances of simulated records of unit variance, once similar weather has taken its share.

    They are (n_memories, n_lags); the records are drawn alike in every call.
    """
    n_drawn = int(np.clip(N_DRAWN // n_rows, 2, MOST_DRAWN))
    start = 500
    shocks = np.random.RandomState(0).standard_normal((start + n_rows, n_drawn))
    noise = [np.sqrt(1 - m**2) * scipy.signal.lfilter([1.0], [1.0, -m], shocks, axis=0)[start:] for m in memories]
    rest = np.split(less_similar(np.hstack(noise)), len(memories), axis=1)
    n_pairs = n_drawn * (n_rows - np.arange(n_lags))
    return np.array([_lagged_products(one, n_lags).sum(axis=1) / n_pairs for one in rest])


def _lagged_products(columns: Array, n_lags: int) -> Array:
    """Sums of the products of values 0, 1, ... rows apart, (n_lags, n_columns)."""
    length = scipy.fft.next_fast_len(len(columns) + n_lags, real=True)
    spectra = scipy.fft.rfft(columns, length, axis=0)
    return np.asarray(scipy.fft.irfft(spectra.real**2 + spectra.imag**2, length, axis=0)[:n_lags])


def _correlations(matrix: Array, variances: Array) -> Array:
    """A matrix over the roots of variances; NaN where one of these is zero."""
    scale = np.sqrt(np.outer(variances, variances))
    return np.clip(np.divide(matrix, scale, out=np.full_like(scale, np.nan), where=scale > 0), -1, 1)


def _covariance(correlations: Array, variances: Array) -> Array:
    """The covariance with these variances whose correlations are positive definite and close to the given ones."""
    np.fill_diagonal(correlations, 1.0)
    values, vectors = np.linalg.eigh(correlations)
    positive = vectors * np.maximum(values, SMALLEST) @ vectors.T
    scale = np.sqrt(variances / np.diag(positive))
    return positive * np.outer(scale, scale)


def _running_sums(values: Array, kept: Array) -> Array:
    """Sums of the values up to each row, of which the share ``kept`` comes from the row before."""
    if (kept[1:] == kept[-1]).all():
        return np.asarray(scipy.signal.lfilter([1.0], [1.0, -kept[-1]], values, axis=0))
    sums = values.copy()
    for row in range(1, len(sums)):
        sums[row] += kept[row] * sums[row - 1]
    return sums
