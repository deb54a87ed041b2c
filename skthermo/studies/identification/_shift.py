"""Shift of measured frequencies from the healthy structure's in the same weather, and its error."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._arguments import check_noise
from skthermo._arrays import Array, as_floats
from skthermo.studies.identification._frequency_effects import healthy_frequencies

N_PERIODS, MOST_PERIODS = 12, 60
"""Fewest and most periods that the training records are divided into; the fewer the new records, the more periods."""

PSEUDO_PERIODS = 24  # weight, in periods, of the correlations of single records beside those of the periods' means


class Shift(NamedTuple):
    """Mean relative shift of each mode, and how many records it is the mean of; NaN for a mode that was not measured.

    It is the mean of ln(measured / predicted), less what the training records in similar weather show. ``n_periods``
    are the degrees of freedom of the covariance of its errors: the number of periods, pseudo-periods included.
    """

    mean: Array
    covariance: Array
    n_records: NDArray[np.intp]
    n_periods: int
    modes: Sequence[Any]


def measured_shift(fem: Any, T: Any, theta: Array, F: Array, noise: ArrayLike | Literal["fitted"]) -> Shift:
    """The shift at temperatures T with parameters theta, and its covariance from periods of the training records."""
    residuals, number = fem.expected_residuals(T, return_number=True)
    shifts = np.log(F / (healthy_frequencies(fem, theta, warn=True) * (1 + as_floats(residuals))))
    mean, n_records = _mean(shifts), (~np.isnan(shifts)).sum(axis=0)
    scale = np.sqrt(1 / np.maximum(n_records, 1) + 1 / np.maximum(number, 1))
    trained = fem.residuals_.values
    if not isinstance(noise, str):
        deviations = check_noise(noise, len(mean), fem.mode_names_)
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

    A period is its residuals, (n_records, n_modes), less those of other periods in similar weather, and the number of
    records of these for each mode. Serial correlation makes the covariance larger than that of single records. It is
    NaN for modes without a record. A dozen means hardly determine correlations, so that these are shrunk to those of
    single records.
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
    """Mean products of two columns each, over rows in which both have values; 0 without such rows."""
    known = (~np.isnan(values)).astype(float)
    filled = np.nan_to_num(values)
    return filled.T @ filled / np.maximum(known.T @ known, 1)


def _positive_definite(matrix: Array) -> Array:
    """A positive definite matrix with the same variances."""
    deviations = np.sqrt(np.diag(matrix))
    values, vectors = np.linalg.eigh(matrix / np.outer(deviations, deviations))
    correlations = vectors * np.maximum(values, 1e-3) @ vectors.T
    scale = deviations / np.sqrt(np.diag(correlations))
    return correlations * np.outer(scale, scale)
