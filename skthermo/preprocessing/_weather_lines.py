"""Frequencies as piecewise-linear functions of the weather, by ridge regression, and neighbours in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import (
    NORMAL,
    Array,
    median,
    piecewise_linear,
    robust_deviation,
    rows_by_pattern,
    spread_evenly,
)
from skthermo.preprocessing.folds import out_of_fold


@dataclass(frozen=True)
class WeatherLines:
    """Principal components of the temperatures, gaps filled by them, and piecewise-linear functions of each."""

    centre: Array
    scale: Array
    components: Array
    knots: Array

    @classmethod
    def learned(cls, temperatures: Array) -> WeatherLines:
        """As many components, up to three, as explain 99 % of the variance; the lines break at their quartiles."""
        values = temperatures[spread_evenly(np.arange(len(temperatures)), 20_000)]
        known = ~np.isnan(values)
        counts = np.maximum(known.sum(axis=0), 1)
        centre = np.where(known, values, 0.0).sum(axis=0) / counts
        scale = np.sqrt(np.where(known, (values - centre) ** 2, 0.0).sum(axis=0) / counts)
        scale = np.where(scale > 1e-12 * np.maximum(np.abs(centre), 1.0), scale, np.inf)
        standard = (values - centre) / scale
        filled = np.where(known, standard, 0.0)
        for _ in range(1 if known.all() else 20):  # steps in which the components fill gaps
            variances, vectors = np.linalg.eigh(filled.T @ filled)
            variances, vectors = variances[::-1], vectors[:, ::-1]
            n_needed = 1 + np.searchsorted(np.cumsum(variances), 0.99 * max(variances.sum(), 1e-300))
            components = vectors[:, : min(3, n_needed)].T
            filled = np.where(known, standard, filled @ components.T @ components)
        return cls(centre, scale, components, quartiles(filled @ components.T))

    def coordinates(self, temperatures: Array) -> Array:
        """Components of each row, (n_samples, n_components); NaN where no sensor has a value."""
        known = ~np.isnan(temperatures)
        standard = np.where(known, (temperatures - self.centre) / self.scale, 0.0)
        places = standard @ self.components.T
        gaps = ~known.all(axis=1)
        for _ in range(20 if gaps.any() else 0):
            places[gaps] = np.where(known[gaps], standard[gaps], places[gaps] @ self.components) @ self.components.T
        places[~known.any(axis=1)] = np.nan
        return places

    def inputs(self, places: Array) -> Array:
        """A constant, and piecewise-linear functions of the coordinates."""
        return np.hstack([np.ones((len(places), 1)), piecewise_linear(places, self.knots)])


def quartiles(values: Array) -> Array:
    """The quartiles of each column, at which piecewise-linear functions of it break."""
    return np.quantile(values, (0.25, 0.5, 0.75), axis=0)


def products(inputs: Array, values: Array) -> tuple[Array, Array, Array]:
    """Products of inputs with inputs and with each mode, and the number of rows that have an input and a value:
    (n_modes, n_inputs, n_inputs), (n_modes, n_inputs) and (n_modes,). Sums of them are those of all rows."""
    n_modes, n_inputs = values.shape[1], inputs.shape[1]
    gram, targets, counts = np.zeros((n_modes, n_inputs, n_inputs)), np.zeros((n_modes, n_inputs)), np.zeros(n_modes)
    usable = ~np.isnan(inputs).any(axis=1)
    for known, modes in rows_by_pattern(~np.isnan(values.T) & usable):
        X = inputs if known.all() else inputs[known]
        gram[modes], counts[modes] = X.T @ X, len(X)
        targets[modes] = (X.T @ values[np.ix_(known, modes)]).T
    return gram, targets, counts


def ridge(gram: Array, targets: Array, counts: Array, sets: Sequence[Sequence[int]] | None = None) -> Array:
    """Ridge coefficients of each mode, (n_modes, n_inputs), from `products`; the first input is a constant.

    With sets of inputs, each of which begins with the constant, the result is (n_sets, n_modes, n_inputs), zero for
    inputs that a set has not.
    """
    n_inputs = gram.shape[-1]
    penalty = np.tile(1e-4 * np.maximum(counts, 1.0)[:, np.newaxis], n_inputs)
    penalty[:, 0] = 1e-9
    penalised = gram + penalty[..., np.newaxis] * np.eye(n_inputs)
    if sets is None:
        return np.linalg.solve(penalised, targets[..., np.newaxis])[..., 0]
    coefficients = np.zeros((len(sets), *targets.shape))
    for own, columns in zip(coefficients, sets, strict=True):
        part = penalised[:, np.asarray(columns)[:, np.newaxis], columns]
        own[:, columns] = np.linalg.solve(part, targets[:, columns, np.newaxis])[..., 0]
    return coefficients


def predicted_by_ridge(
    inputs: Array, values: Array, folds: NDArray[np.intp], sets: Sequence[Sequence[int]] | None = None
) -> Array:
    """Values of each fold as `ridge` predicts them from the other folds; with sets, (n_samples, n_sets, n_modes)."""
    n_folds = folds.max() + 1
    of_folds = [products(inputs[folds == fold], values[folds == fold]) for fold in range(n_folds)]
    by_fold = [np.stack(parts) for parts in zip(*of_folds, strict=True)]

    def learn(train: NDArray[np.intp]):
        others = np.bincount(folds[train], minlength=n_folds) > 0
        coefficients = ridge(*(np.tensordot(others, part, 1) for part in by_fold), sets)
        return lambda test: np.moveaxis(inputs[test] @ np.swapaxes(coefficients, -1, -2), -2, 0)

    return out_of_fold(learn, folds)


def predicted_by_weather(inputs: Array, values: Array, folds: NDArray[np.intp], *, trim: bool = True) -> Array:
    """Predictions of each fold's rows from the others, far values left out of the second of two fits by ``trim``."""
    centre = median(values)
    predicted = predicted_by_ridge(inputs, values - centre, folds)
    if trim:
        predicted = predicted_by_ridge(inputs, without_far(values - centre, values - centre - predicted), folds)
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
