"""Out-of-fold residuals of a chain, by weather: their spread, intervals, and realistic noise."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.neighbors import NearestNeighbors
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo._arrays import Array
from skthermo.surrogate._applicability import TrainingRange

FACTOR = 1

NEIGHBOURS = 25
"""Number of records with the most similar weather that noise is drawn from."""

SPREAD_NEIGHBOURS = 100
"""Number of records with the most similar weather whose residuals give the spread."""

SIMILAR = 0.1
"""Share of the records whose weather counts as similar: a drawn run of records goes on while it lasts."""

EXPLAINED = 0.99
"""Share of the variance of the inputs that the coordinates of weather keep."""


@dataclass(frozen=True)
class WeatherResiduals:
    """Relative residuals of records in order of time, and the weather of each.

    Attributes
    ----------
    weather : Array of shape (n_records, n_inputs)
        Inputs of the temperature mapper.
    values : Array of shape (n_records, n_modes)
        Measured frequencies over out-of-fold predictions, minus 1; NaN where a mode is missing.
    folds : ndarray of shape (n_records,)
        The fold of each record.
    """

    weather: Array
    values: Array
    folds: NDArray[np.intp]

    @cached_property
    def coordinates(self):
        """Principal components of standardised weather."""
        return make_pipeline(StandardScaler(), PCA(EXPLAINED)).fit(self.weather)

    @cached_property
    def places(self) -> Array:
        """The records in these coordinates."""
        return self.coordinates.transform(self.weather)

    def spread(self, weather: Array) -> Array:
        """Root mean square of the residuals in similar weather, wider beyond the range of the records."""
        return self._spread(np.ones(len(self.folds), dtype=bool), weather)

    @cached_property
    def scores(self) -> Array:
        """Absolute residuals over the spread that the other folds give for their weather."""
        scores = np.full_like(self.values, np.nan)
        for fold in np.unique(self.folds):
            test = self.folds == fold
            scores[test] = np.abs(self.values[test]) / self._spread(~test, self.weather[test])
        return scores

    def _spread(self, rows: NDArray[np.bool_], weather: Array) -> Array:
        near = self._neighbours(self.places[rows], self.coordinates.transform(weather), SPREAD_NEIGHBOURS)
        excess = TrainingRange.of(self.weather, rows).excess(weather).mean(axis=1, keepdims=True)
        return np.sqrt(np.nanmean(self.values[rows][near] ** 2, axis=1)) * (1 + FACTOR * excess)

    def _neighbours(self, places, wanted, n):
        return NearestNeighbors(n_neighbors=min(n, len(places))).fit(places).kneighbors(wanted, return_distance=False)

    def quantiles(self, confidence: float) -> Array:
        """Order statistics of the scores of each mode: the ceil((n + 1) confidence)-th of n; infinite if n is too small."""
        return np.array([conformal_quantile(column[~np.isnan(column)], confidence) for column in self.scores.T])

    @cached_property
    def unexplained(self) -> Array:
        """Residuals minus their mean in similar weather, over their spread."""
        n_neighbours = min(SPREAD_NEIGHBOURS, len(self.places))
        near = NearestNeighbors(n_neighbors=n_neighbours).fit(self.places).kneighbors(return_distance=False)
        return (self.values - np.nanmean(self.values[near], axis=1)) / np.nanstd(self.values[near], axis=1)

    def draw(self, weather: Array, random_state: np.random.RandomState) -> Array:
        """Residuals of whole records, drawn for rows of weather in order of time."""
        places = self.coordinates.transform(weather)
        n_records = len(self.places)
        neighbours = NearestNeighbors(n_neighbors=min(NEIGHBOURS, n_records)).fit(self.places)
        near = neighbours.kneighbors(places, return_distance=False)
        far = (
            NearestNeighbors(n_neighbors=max(1, int(SIMILAR * n_records))).fit(self.places).kneighbors(places)[0][:, -1]
        )
        stop = 1 / mean_run(self.unexplained)
        chances, picks = random_state.uniform(size=len(places)), random_state.randint(near.shape[1], size=len(places))
        donors = np.empty(len(places), dtype=int)
        donor = n_records
        for row, place in enumerate(places):
            donor += 1
            goes_on = chances[row] > stop and donor < n_records
            if not goes_on or np.linalg.norm(self.places[donor] - place) > far[row]:
                donor = near[row, picks[row]]
            donors[row] = donor
        return self.values[donors]


def conformal_quantile(scores: Array, confidence: float) -> float:
    rank = int(np.ceil((len(scores) + 1) * confidence))
    return float(np.sort(scores)[rank - 1]) if rank <= len(scores) else np.inf


def mean_run(values: Array) -> float:
    """Mean length of runs of records that keep the serial correlation: twice the integrated correlation time."""
    times = [correlation_time(column) for column in values.T]
    return max(1.0, 2 * max(times) - 1)


def correlation_time(series: Array) -> float:
    """1 + 2 * sum of the autocorrelations up to the first that is not clearly above zero."""
    centred = series - np.nanmean(series)
    variance, time = np.nanmean(centred**2), 1.0
    for lag in range(1, len(series) // 10):
        correlation = np.nanmean(centred[lag:] * centred[:-lag]) / variance
        if not correlation > 2 / np.sqrt(len(series)):
            break
        time += 2 * correlation
    return time
