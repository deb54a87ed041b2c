"""Shift of measured frequencies from the healthy structure's in the same weather, and how sure it is."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._arguments import check_noise
from skthermo._arrays import Array, as_floats
from skthermo.studies._chain import healthy_frequencies

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
    modes : list
        Names of the modes.
    """

    mean: Array
    covariance: Array
    n_records: NDArray[np.intp]
    n_periods: int
    modes: Sequence[Any]


def measured_shift(fem: Any, T: Any, theta: Array, F: Array, noise: ArrayLike | Literal["fitted"]) -> Shift:
    """The shift, and its covariance by what healthy periods of the training records show, each judged by the others.

    The parameters theta are those at the temperatures T.

    Raises
    ------
    ValueError
        If the noise is neither "fitted" nor relative standard deviations above 0.
    """
    residuals, number = fem.expected_residuals(T, return_number=True)
    shifts = np.log(F / (healthy_frequencies(fem, theta, warn=True) * (1 + as_floats(residuals))))
    mean, n_records = _mean(shifts), (~np.isnan(shifts)).sum(axis=0)
    scale = np.sqrt(1 / np.maximum(n_records, 1) + 1 / np.maximum(number, 1))
    trained = fem.residuals_.values
    if not isinstance(noise, str):
        deviations = check_noise(noise, len(mean))
        if (deviations == 0).any():
            raise ValueError(f"noise is {noise!r}; expected standard deviations above 0, which errors are derived from")
        return Shift(mean, np.diag((deviations * scale) ** 2), n_records, len(trained), fem.mode_names_)
    if noise != "fitted":
        raise ValueError(f'noise is {noise!r}; expected "fitted" or relative standard deviations')
    n_rows = max(int(n_records.max()), 1)
    n_periods = int(np.clip(len(trained) // n_rows, N_PERIODS, min(MOST_PERIODS, max(len(trained) // 2, 2))))
    periods = [(np.log1p(period), compared) for period, compared in fem.residuals_.by_period(n_periods)]
    covariance = covariance_of_record(periods)
    judged = ~np.isnan(np.diag(covariance))
    covariance = np.where(np.outer(judged, judged), covariance, np.eye(len(mean)))
    mean = np.where(judged, mean, np.nan)
    return Shift(mean, covariance * np.outer(scale, scale), n_records, n_periods + PSEUDO_PERIODS, fem.mode_names_)


def covariance_of_record(periods: list[tuple[Array, Array]]) -> Array:
    """Covariance, (n_modes, n_modes), of independent records whose means would scatter as those of the periods do.

    Serial correlation makes it larger than that of single records. It is NaN for modes without a record. A dozen means
    say little about correlations of several modes. They are drawn to the correlations of single records, with the
    variance that the means show.

    Parameters
    ----------
    periods : list of (ndarray of shape (n_records, n_modes), ndarray of shape (n_modes,))
        Residuals of each period less what others show in similar weather, and how many records that stands on.
    """
    n_periods = len(periods)
    means = []
    for period, compared in periods:
        counts = np.maximum((~np.isnan(period)).sum(axis=0), 1)
        means.append(_mean(period) / np.sqrt(1 / counts + 1 / np.maximum(compared, 1)))
    single, of_means = _products(np.concatenate([period for period, _ in periods])), _products(np.array(means))
    known = np.flatnonzero(np.diag(single) > 0)
    inflation = max(1.0, float((np.diag(of_means)[known] / np.diag(single)[known]).mean())) if known.size else 1.0
    shrunk = (n_periods * of_means + PSEUDO_PERIODS * inflation * single) / (n_periods + PSEUDO_PERIODS)
    covariance, inside = np.full_like(shrunk, np.nan), np.ix_(known, known)
    covariance[inside] = _positive_definite(shrunk[inside])
    return covariance


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
