"""A cheap regression of frequencies on the weather that outliers hardly move."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, as_floats, median, piecewise_linear, robust_deviation, spread_evenly

MOST_COORDINATES = 3  # principal components of the weather
EXPLAINED = 0.99  # share of its variance that is enough
N_FILLS = 20  # steps in which the components fill gaps
KNOTS = (0.25, 0.5, 0.75)  # quantiles at which lines may break
MOST_LEARNED = 20_000  # rows, evenly spread, from which anything is learned
PENALTY = 1e-4  # of the ridge, per row
TRIMMED = 5.0  # robust deviations beyond which a row does not train a second time


@dataclass(frozen=True)
class WeatherBasis:
    """Principal components of the temperatures, gaps filled by them, and lines that break at quantiles of each."""

    centre: Array
    scale: Array
    components: Array
    knots: Array

    @classmethod
    def of(cls, temperatures: Array) -> WeatherBasis:
        """Learn from records."""
        values = temperatures[spread_evenly(np.arange(len(temperatures)), MOST_LEARNED)]
        known = ~np.isnan(values)
        counts = np.maximum(known.sum(axis=0), 1)
        centre = np.where(known, values, 0.0).sum(axis=0) / counts
        scale = np.sqrt(np.where(known, (values - centre) ** 2, 0.0).sum(axis=0) / counts)
        scale = np.where(scale > 1e-12 * np.maximum(np.abs(centre), 1.0), scale, np.inf)
        standard = (values - centre) / scale
        filled = np.where(known, standard, 0.0)
        for _ in range(N_FILLS if not known.all() else 1):
            variances, vectors = np.linalg.eigh(filled.T @ filled)
            variances, vectors = variances[::-1], vectors[:, ::-1]
            n_needed = 1 + np.searchsorted(np.cumsum(variances), EXPLAINED * max(variances.sum(), 1e-300))
            components = vectors[:, : min(MOST_COORDINATES, n_needed)].T
            filled = np.where(known, standard, filled @ components.T @ components)
        return cls(centre, scale, components, np.quantile(filled @ components.T, KNOTS, axis=0))

    def coordinates(self, temperatures: Array) -> Array:
        """Components of each row, (n_samples, n_components); NaN where no sensor has a value."""
        known = ~np.isnan(temperatures)
        standard = np.where(known, (temperatures - self.centre) / self.scale, 0.0)
        places = standard @ self.components.T
        gaps = ~known.all(axis=1)
        for _ in range(N_FILLS if gaps.any() else 0):
            places[gaps] = np.where(known[gaps], standard[gaps], places[gaps] @ self.components) @ self.components.T
        places[~known.any(axis=1)] = np.nan
        return places

    def lines(self, places: Array) -> Array:
        """Piecewise-linear functions of the coordinates, with a constant first."""
        return np.hstack([np.ones((len(places), 1)), piecewise_linear(places, self.knots)])


class Grams(NamedTuple):
    """Products of inputs with inputs and with each mode, by fold."""

    inputs: Array
    targets: Array
    counts: Array

    @classmethod
    def of(cls, inputs: Array, values: Array, folds: NDArray[np.intp]) -> Grams:
        """Products over the rows of each fold that have an input and a value."""
        n_folds, n_modes, n_inputs = folds.max() + 1, values.shape[1], inputs.shape[1]
        grams = cls(
            np.zeros((n_folds, n_modes, n_inputs, n_inputs)),
            np.zeros((n_folds, n_modes, n_inputs)),
            np.zeros((n_folds, n_modes)),
        )
        usable = ~np.isnan(inputs).any(axis=1)
        for fold in range(n_folds):
            rows = np.flatnonzero(usable & (folds == fold))
            X, Y = inputs[rows], values[rows]
            known = ~np.isnan(Y)
            whole = X.T @ X if known.any() else None
            for mode in range(n_modes):
                n_known = np.count_nonzero(known[:, mode])
                if not n_known:
                    continue
                x = X if n_known == len(X) else X[known[:, mode]]
                grams.inputs[fold, mode] = whole if n_known == len(X) else x.T @ x
                grams.targets[fold, mode] = x.T @ Y[known[:, mode], mode]
                grams.counts[fold, mode] = n_known
        return grams

    def coefficients(self) -> Array:
        """Ridge coefficients of each mode, (n_modes, n_inputs)."""
        return _ridge(*(part.sum(axis=0) for part in self))

    def coefficients_without_each(self) -> Array:
        """The same without each of the folds, (n_folds, n_modes, n_inputs)."""
        others = 1.0 - np.eye(len(self.counts))
        return _ridge(*(np.tensordot(others, part, 1) for part in self))


def _ridge(gram: Array, target: Array, counts: Array) -> Array:
    penalty = PENALTY * np.maximum(counts, 1.0)[..., np.newaxis] * np.ones(gram.shape[-1])
    penalty[..., 0] = 1e-9  # of the constant
    return np.linalg.solve(gram + penalty[..., np.newaxis] * np.eye(gram.shape[-1]), target[..., np.newaxis])[..., 0]


@dataclass(frozen=True)
class WeatherRegression:
    """Frequencies as piecewise-linear functions of the weather."""

    basis: WeatherBasis
    coefficients: Array
    centre: Array

    @classmethod
    def of(cls, temperatures: Array, frequencies: Array) -> WeatherRegression:
        """Learn from records, the second time without what was far away the first time."""
        rows = spread_evenly(np.arange(len(temperatures)), MOST_LEARNED)
        basis, known = WeatherBasis.of(temperatures), frequencies[rows]
        centre = median(known)
        inputs, values = basis.lines(basis.coordinates(temperatures[rows])), known - centre
        fold = np.zeros(len(rows), dtype=np.intp)
        for _ in range(2):
            coefficients = Grams.of(inputs, values, fold).coefficients()
            values = without_far(values, values - inputs @ coefficients.T)
        return cls(basis, coefficients, centre)

    def predict(self, temperatures: Array) -> Array:
        """Frequencies, (n_samples, n_modes); NaN where no sensor has a value."""
        return self.basis.lines(self.basis.coordinates(as_floats(temperatures))) @ self.coefficients.T + self.centre


def out_of_fold(inputs: Array, values: Array, folds: NDArray[np.intp], *, trim: bool = True) -> Array:
    """Predictions of each fold's rows from the others, far values left out of the second of two fits by ``trim``."""
    centre = median(values)
    centred = trained = values - centre
    for _ in range(2 if trim else 1):
        predicted = np.empty_like(values)
        for fold, coefficients in enumerate(Grams.of(inputs, trained, folds).coefficients_without_each()):
            rows = folds == fold
            predicted[rows] = inputs[rows] @ coefficients.T
        trained = without_far(centred, centred - predicted)
    return predicted + centre


def without_far(values: Array, residuals: Array) -> Array:
    """NaN in place of values whose residuals are far from the median of their column."""
    with np.errstate(invalid="ignore"):
        far = np.abs(residuals - median(residuals)) > TRIMMED * robust_deviation(residuals)
    return np.where(far, np.nan, values)
