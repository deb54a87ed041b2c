"""Frequencies as piecewise-linear functions of the weather, by ridge regression, and neighbours in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import (
    NORMAL,
    Array,
    means_of_known,
    median,
    piecewise_linear,
    robust_deviation,
    spread_evenly,
)
from skthermo.preprocessing.folds import out_of_fold


@dataclass(frozen=True)
class WeatherLines:
    """Principal components of the temperatures, gaps filled by the other sensors, and piecewise-linear functions of
    each."""

    centre: Array
    scale: Array
    components: Array
    knots: Array

    @classmethod
    def learned(cls, temperatures: Array) -> WeatherLines:
        """As many components, up to three, as explain 99 % of the variance; the lines break at their quartiles."""
        values = temperatures[spread_evenly(np.arange(len(temperatures)), 20_000)]
        centre = np.nan_to_num(means_of_known(values))
        scale = np.sqrt(means_of_known((values - centre) ** 2))
        scale = np.where(scale > 1e-12 * np.maximum(np.abs(centre), 1.0), scale, np.inf)
        standard = filled_by_row((values - centre) / scale)
        standard = standard[~np.isnan(standard).any(axis=1)]
        variances, vectors = np.linalg.eigh(standard.T @ standard)
        n_needed = 1 + np.searchsorted(np.cumsum(variances[::-1]), 0.99 * max(variances.sum(), 1e-300))
        components = vectors[:, ::-1][:, : min(3, n_needed)].T
        return cls(centre, scale, components, np.quantile(standard @ components.T, (0.25, 0.5, 0.75), axis=0))

    def inputs(self, temperatures: Array) -> tuple[Array, Array]:
        """Components of each row, (n_samples, n_components), NaN where no sensor has a value; and a constant beside
        piecewise-linear functions of them."""
        places = filled_by_row((temperatures - self.centre) / self.scale) @ self.components.T
        return places, np.hstack([np.ones((len(places), 1)), piecewise_linear(places, self.knots)])


def filled_by_row(standard: Array) -> Array:
    """Standardised values with gaps filled by the mean of the other sensors; NaN in rows without any."""
    return np.where(np.isnan(standard), means_of_known(standard, axis=1)[:, np.newaxis], standard)


def ridge(inputs: Array, values: Array) -> Array:
    """Ridge coefficients of each column of values, (n_inputs, n_columns), from the rows that have all inputs and the
    value; the first input is a constant."""
    usable = ~np.isnan(inputs).any(axis=1)
    X, Y = (inputs, values) if usable.all() else (inputs[usable], values[usable])
    known, coefficients = ~np.isnan(Y), np.zeros((inputs.shape[1], values.shape[1]))
    columns = [slice(None)] if known.all() else range(values.shape[1])
    for some in columns:
        A, y = (X, Y) if known.all() else (X[known[:, some]], Y[known[:, some], some])
        penalty = np.full(A.shape[1], 1e-4 * max(len(A), 1))
        penalty[0] = 1e-9
        coefficients[:, some] = np.linalg.solve(A.T @ A + np.diag(penalty), A.T @ y)
    return coefficients


def predicted_by_weather(inputs: Array, values: Array, folds: NDArray[np.intp], *, trim: bool = True) -> Array:
    """Predictions of each fold's rows from at most 20,000 of the others, far values left out of the second of two fits
    by ``trim``."""
    centre = median(values)
    learned = values - centre

    def learn(train: NDArray[np.intp]):
        rows = spread_evenly(train, 20_000)
        coefficients = ridge(inputs[rows], learned[rows])
        return lambda test: inputs[test] @ coefficients

    predicted = out_of_fold(learn, folds)
    if trim:
        learned = without_far(learned, learned - predicted)
        predicted = out_of_fold(learn, folds)
    return predicted + centre


def without_far(values: Array, residuals: Array) -> Array:
    """NaN in place of values whose residuals are more than five robust deviations from the median of their column."""
    with np.errstate(invalid="ignore"):
        far = np.abs(residuals - median(residuals)) > 5.0 * robust_deviation(residuals)
    return np.where(far, np.nan, values)


def distances_from_neighbours(values: Array, times: Array, window: int | pd.Timedelta) -> tuple[Array, Array]:
    """Distance of each value from the median of its neighbours in time, and the standard deviation of the distances,
    by the median of the neighbours' distances."""
    order = np.argsort(times, kind="stable")
    table = pd.DataFrame(values[order])
    if isinstance(window, pd.Timedelta):
        table.index = pd.to_datetime(times[order], unit="ns")
    around = {"window": window, "center": True, "min_periods": 1}
    distances = table - table.rolling(**around).median()
    local = NORMAL * distances.abs().rolling(**around).median()
    back = np.argsort(order)
    return distances.to_numpy()[back], local.to_numpy()[back]
