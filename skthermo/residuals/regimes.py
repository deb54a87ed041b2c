"""Regimes of the weather: where the scatter of residuals changes, as it does when bearings or asphalt freeze."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.covariance import ledoit_wolf

from skthermo._core.arrays import Array
from skthermo.preprocessing.folds import out_of_fold

Mask = NDArray[np.bool_]


def change_of_scatter(
    weather: Array,
    residuals: Array,
    fold_of: NDArray[np.intp],
    *,
    least_gain: float = 0.02,
    least_rows: int = 40,
    least_folds: int = 3,
) -> tuple[int, float] | None:
    """The input and its value at which the scatter of residuals changes most; None where held-out weeks show no change.

    Records on either side of the value have a normal distribution each, with a shrunk covariance [LW04]_. The split has
    to make the records of held-out folds likelier than one distribution for all does.

    Parameters
    ----------
    weather : ndarray of shape (n_records, n_inputs)
        Inputs of the regression.
    residuals : ndarray of shape (n_records, n_modes)
        Out of fold; rows with NaN are left out.
    fold_of : ndarray of int of shape (n_records,)
        Folds of blocks of time.
    least_gain : float, default=0.02
        Logarithm of the likelihood, per record, that a split has to gain.
    least_rows : int, default=40
        Records that each side needs in every training set.
    least_folds : int, default=3
        Folds in which each side needs a record, so that one cold week is no regime.

    Returns
    -------
    tuple of (int, float) or None
        Position of the input, and the highest value of the first regime.
    """
    known = ~(np.isnan(residuals).any(axis=1) | np.isnan(weather).any(axis=1)) & (fold_of >= 0)
    weather, residuals, fold_of = weather[known], residuals[known], fold_of[known]
    if len(residuals) < 2 * least_rows:
        return None

    def likelihood(side: Mask) -> float:
        folds = np.where(side, fold_of, -1)
        rows_by_fold = np.bincount(fold_of[side], minlength=fold_of.max() + 1)
        if (rows_by_fold > 0).sum() < least_folds or (side.sum() - rows_by_fold).min() < least_rows:
            return -np.inf

        def learn(train: NDArray[np.intp]):
            rows = residuals[train[side[train]]]
            mean, covariance = rows.mean(axis=0), ledoit_wolf(rows)[0]
            return lambda test: log_density(residuals[test] - mean, covariance)

        return float(np.nansum(out_of_fold(learn, folds)))

    one, best = likelihood(np.ones(len(residuals), dtype=bool)), (least_gain * len(residuals), None)
    for column, values in enumerate(weather.T):
        for value in np.unique(np.quantile(values, np.linspace(0.1, 0.9, 9))):
            low = values <= value
            gain = likelihood(low) + likelihood(~low) - one
            if gain > best[0]:
                best = gain, (column, float(value))
    return best[1]


def log_density(rows: Array, covariance: Array) -> Array:
    """Logarithm of the normal density of centred rows, but for a constant."""
    root = np.linalg.cholesky(covariance)
    white = np.linalg.solve(root, rows.T)
    return -np.log(np.diag(root)).sum() - 0.5 * (white**2).sum(axis=0)
