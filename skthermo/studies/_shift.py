"""Shift of measured frequencies from the healthy structure's in the same weather, and how sure it is."""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._arrays import Array, as_floats
from skthermo.fem import check_noise

N_PERIODS, MOST_PERIODS = 12, 60
"""Number of periods that the training records are divided into: more where the new records are few."""

PSEUDO_PERIODS = 24
"""How many periods the correlations of single records count as, beside those of the periods' means."""


class Shift(NamedTuple):
    """Mean relative shift of each mode.

    Attributes
    ----------
    mean : ndarray of shape (n_modes,)
        Mean of ln(measured / predicted), less what the training records in similar weather show; NaN for a mode that
        was not measured.
    covariance : ndarray of shape (n_modes, n_modes)
        Of its errors.
    n_records : ndarray of shape (n_modes,)
        How many records it is the mean of.
    n_periods : int
        How many independent periods the covariance stands on, pseudo-periods included.
    """

    mean: Array
    covariance: Array
    n_records: NDArray[np.intp]
    n_periods: int


def measured_shift(fem: Any, T: Any, F: Array, noise: ArrayLike | Literal["fitted"]) -> Shift:
    """The shift, and its covariance by what healthy periods of the training records show, each judged by the others."""
    expected = as_floats(fem.predict(T)) * (1 + as_floats(fem.expected_residuals(T)))
    shifts = np.log(F / expected)
    mean, n_records = _mean(shifts), (~np.isnan(shifts)).sum(axis=0)
    trained = fem.residuals_.values
    if not isinstance(noise, str):
        counts = 1 / np.maximum(n_records, 1) + 1 / np.maximum((~np.isnan(trained)).sum(axis=0), 1)
        return Shift(mean, np.diag(check_noise(noise, len(mean)) ** 2 * counts), n_records, len(trained))
    n_rows = max(int(n_records.max()), 1)
    n_periods = int(np.clip(len(trained) // n_rows, N_PERIODS, min(MOST_PERIODS, max(len(trained) // 2, 2))))
    periods = [np.log1p(period) for period in fem.residuals_.by_period(n_periods)]
    covariance = covariance_of_period(periods)
    lengths = len(trained) / n_periods / np.maximum(n_records, 1)  # periods in the training records per new period
    scale = np.sqrt(lengths + np.maximum(1 - lengths, 0.0) / n_periods)
    return Shift(mean, covariance * np.outer(scale, scale), n_records, n_periods + PSEUDO_PERIODS)


def covariance_of_period(periods: list[Array]) -> Array:
    """Covariance of a period's mean residual, (n_modes, n_modes).

    A dozen means say little about correlations of several modes. They are drawn to the correlations of single records,
    with the variance of the means: serial correlation makes it larger than that of independent records.
    """
    n_periods = len(periods)
    means = np.array([_mean(period) for period in periods])
    rows = np.concatenate(periods)
    single = _products(rows) * n_periods / len(rows)
    of_means = _products(means)
    inflation = max(1.0, float(np.nanmean(np.diag(of_means) / np.diag(single))))
    shrunk = (n_periods * of_means + PSEUDO_PERIODS * inflation * single) / (n_periods + PSEUDO_PERIODS)
    return _positive_definite(shrunk)


def _mean(values: Array) -> Array:
    known = ~np.isnan(values)
    sums = np.where(known, values, 0.0).sum(axis=0)
    return np.divide(sums, known.sum(axis=0), out=np.full(len(sums), np.nan), where=known.any(axis=0))


def _products(values: Array) -> Array:
    """Mean products of columns, over the rows that have both; zero where none has."""
    known = (~np.isnan(values)).astype(float)
    filled = np.nan_to_num(values)
    return filled.T @ filled / np.maximum(known.T @ known, 1)


def _positive_definite(matrix: Array) -> Array:
    """The nearest matrix with the same variances whose correlations are possible."""
    deviations = np.sqrt(np.diag(matrix))
    values, vectors = np.linalg.eigh(matrix / np.outer(deviations, deviations))
    correlations = vectors * np.maximum(values, 1e-3) @ vectors.T
    scale = deviations / np.sqrt(np.diag(correlations))
    return correlations * np.outer(scale, scale)
