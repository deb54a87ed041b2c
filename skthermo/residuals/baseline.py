"""Relative residuals of healthy records by weather: their scatter and memory, intervals, draws of realistic noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy  # which loads scipy.signal once it is used
import scipy.fft
import scipy.sparse
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline

from skthermo._core.arrays import Array, means_of_known, median
from skthermo._core.frames import correlation_times
from skthermo.exceptions import WeatherWarning
from skthermo.preprocessing import HampelFilter
from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.numbers import independent_records
from skthermo.residuals.weather import (
    TrainingRange,
    mean_of_nearest,
    nearest_in_parts,
    one_in_each_part,
    weather_coordinates,
)

JITTER = 1e-9  # share of its variance that each mode has of its own, also where two scatter the same
MOST_PLACES = 20_000  # number of records among which neighbours are looked for
MOST_SIMILAR = 500  # number of similar records that stand for all of them


@dataclass(frozen=True)
class BaselineResiduals:
    """Relative residuals of records in order of time, and the weather of each.

    ``weather``, (n_records, n_inputs), are inputs of the temperature mapper, lags included. ``values``, (n_records,
    n_modes), are measured frequencies over out-of-fold predictions, minus 1; ``own`` the same from predictions of the
    mapper that learned from all records. ``folds`` tells which records were predicted together, and ``rows`` which rows
    of the training records they are. ``findings`` say in which weather residuals are not to be trusted.
    """

    weather: Array
    values: Array
    own: Array
    folds: NDArray[np.intp]
    rows: NDArray[np.intp] | None = None
    findings: tuple[WeatherWarning, ...] = ()

    @cached_property
    def coordinates(self) -> Pipeline:
        """Principal components of the standardised weather."""
        return weather_coordinates(self.weather)

    @cached_property
    def places(self) -> Array:
        """The records in these coordinates."""
        return self.coordinates.transform(self.weather)

    @property
    def n_modes(self) -> int:
        return self.values.shape[1]

    def spread(self, weather: Array) -> Array:
        """Root mean square of the residuals in similar weather, (n_samples, n_modes); NaN where weather is unknown."""

        def of_known(known: Array) -> Array:
            beyond = TrainingRange.spanned(self.weather, slice(None)).excess(known).mean(axis=1)
            return self._spread(self.values, known, beyond)

        return self._where_known(weather, of_known)

    def expected(self, weather: Array) -> Array:
        """Mean residual that the mapper leaves in similar weather, (n_samples, n_modes); NaN where it is unknown."""
        return self._where_known(weather, lambda known: self._similar_mean(self.own, known))

    def quantiles(self, confidence: float) -> Array:
        """Spreads from the prediction that hold the records with a given probability, (n_modes,)."""
        return np.array([order_statistic(column[~np.isnan(column)], confidence) for column in self._scores.T])

    def draw(self, weather: Array, random_state: np.random.RandomState) -> Array:
        """Residuals for rows of weather in order of time, (n_samples, n_modes), with the gaps of whole records.

        A smoothed stationary bootstrap: each row takes the record after the one before it took or, where such a run
        ends by chance, one of the 25 records with the most similar weather. In weather that scatters more or less than
        the weather of its records, a run is scaled, or ends where the factor is 2. A second draw of its own
        is added with a small weight, so that the largest residual of the training records is not the largest of all.
        Rows of unknown weather are NaN.
        """
        return self._where_known(weather, partial(self._smoothed, self.drawn, random_state, False))

    def draw_complete(self, weather: Array, random_state: np.random.RandomState, without_outliers: bool) -> Array:
        """The same, with missing modes, and outliers if asked, drawn anew given the modes that are there.

        They follow the normal distribution of residuals without outliers. Without gaps and outliers, `draw` gives the
        same.
        """
        values = self.usual if without_outliers else self.drawn
        return self._where_known(weather, partial(self._smoothed, values, random_state, True))

    def _smoothed(self, values: Array, random_state: np.random.RandomState, is_complete: bool, weather: Array) -> Array:
        """Values as drawn, and others of the usual ones, added with the bandwidth of Silverman's rule."""
        similar = self._similar(weather)
        taken, other = self._taken(similar, random_state), self._taken(similar, random_state)
        n_modes, n_independent = self.n_modes, len(values) / self.correlation_time
        bandwidth = (4 / ((n_modes + 2) * n_independent)) ** (1 / (n_modes + 4))
        angle, mean = np.arctan(bandwidth), similar @ self._levels[0]
        first = self._completed(values[taken], random_state) if is_complete else values[taken]
        second = self._completed(self.usual[other], random_state)
        first, second = self._carried(first, taken, similar) - mean, self._carried(second, other, similar) - mean
        return mean + np.cos(angle) * first + np.sin(angle) * second

    def _completed(self, values: Array, random_state: np.random.RandomState) -> Array:
        gaps = np.isnan(values)
        if not gaps.any():
            return values
        expected = self._normal.completed(values)[0]
        roots, of_row = self._normal.error_roots(values)
        drawn = np.einsum("ijk,ik->ij", roots[of_row], random_state.standard_normal(values.shape))
        return np.where(gaps, np.where(np.isnan(expected), self._normal.mean, expected) + drawn, values)

    @cached_property
    def usual(self) -> Array:
        """The drawn residuals, NaN where one is an outlier: far from its neighbours in time."""
        return HampelFilter().fit(self.drawn).transform(self.drawn)

    @cached_property
    def drawn(self) -> Array:
        """Residuals for drawing noise: the mean of the residuals out of fold and of the mapper of all records.

        The former hold the errors of mappers of fewer records besides the errors of the mapper that simulates. The
        latter are too small, and do not count where the mapper has learned noise: where they change from record to
        record by less than three quarters of the former.
        """
        own, out_of_fold = np.abs(np.diff(self.own, axis=0)), np.abs(np.diff(self.values, axis=0))
        is_overfitted = np.nansum(median(own)) < 0.75 * np.nansum(median(out_of_fold))
        return self.values if is_overfitted else (self.values + self.own) / 2

    @cached_property
    def level_errors(self) -> Array:
        """Relative standard error of each mode's standard deviation, (n_modes,), from its fourth moment; without
        outliers, and with as many records as are independent."""
        centred = self.usual - means_of_known(self.usual)
        squares = means_of_known(centred**2)
        kurtosis = means_of_known(centred**4) / np.maximum(squares, np.finfo(float).tiny) ** 2
        n_independent = (~np.isnan(self.usual)).sum(axis=0) / self.correlation_time
        return np.nan_to_num(np.sqrt(np.maximum(kurtosis - 1, 0.0) / np.maximum(4 * n_independent, 1.0)))

    @property
    def outliers(self) -> Array:
        """Those of the residuals that are outliers, NaN elsewhere."""
        return np.where(np.isnan(self.usual), self.values, np.nan)

    @cached_property
    def _normal(self) -> Gaussian:
        """Normal distribution of the residuals without outliers."""
        found = Gaussian.fitted(self.usual)
        return Gaussian(found.mean, found.covariance + JITTER * np.diag(np.diag(found.covariance)))

    def _similar(self, weather: Array) -> scipy.sparse.csr_array:
        """Equal weights of the records with the most similar weather, (n_rows, n_records)."""
        some, wanted = one_in_each_part(len(self.places), MOST_PLACES), self.coordinates.transform(weather)
        near = np.concatenate([found for _, found in nearest_in_parts(self.places[some], wanted, 25)])
        ends = np.arange(0, near.size + 1, near.shape[1])
        weights = np.full(near.size, 1 / near.shape[1])
        return scipy.sparse.csr_array((weights, some[near].ravel(), ends), (len(near), len(self.places)))

    def _taken(self, similar: scipy.sparse.csr_array, random_state: np.random.RandomState) -> NDArray[np.intp]:
        """Positions of records in runs for rows with some similar records.

        The mean length of a run is 1 and six times the memory less 1. The memory is the correlation time, or the number
        of records that are worth an independent one where that is more than chance explains (the 99 % quantile of the
        variance of a dozen means): a slow part that is small moves means, and hardly the correlation.
        """
        n_rows, n_records = similar.shape
        slow, by_chance = n_records / independent_records(self.values), 2.25 * self.correlation_time
        memory = slow if slow > by_chance else self.correlation_time
        ends = np.flatnonzero(random_state.uniform(size=n_rows) < 1 / (1 + 6 * (memory - 1)))
        which = random_state.randint(similar.indptr[1], size=n_rows)
        taken = similar.indices.reshape(n_rows, -1)[np.arange(n_rows), which].astype(np.intp)
        if len(ends) == n_rows:
            return taken
        logs, here = np.log(self._levels[1]), np.log(np.sqrt(similar @ self._levels[1] ** 2))
        starts = np.union1d([0], ends)
        stops = np.append(starts[1:], n_rows)
        while len(starts):  # runs; each may end early, where another one begins
            lengths = stops - starts
            first, run = np.cumsum(lengths) - lengths, np.repeat(np.arange(len(starts)), lengths)
            step = np.arange(len(run)) - first[run]
            rows, records = starts[run] + step, taken[starts][run] + step
            is_other = records >= n_records
            some = ~is_other & (step > 0)
            changes = np.abs(here[rows[some]] - logs[records[some]])
            is_other[some] = (changes > np.log(2.0)).any(axis=1)
            reached = np.minimum.reduceat(np.where(is_other, step, lengths[run]), first)
            kept = step < reached[run]
            taken[rows[kept]] = records[kept]
            goes_on = reached < lengths
            starts, stops = (starts + reached)[goes_on], stops[goes_on]
        return taken

    def _carried(self, values: Array, taken: NDArray[np.intp], similar: scipy.sparse.csr_array) -> Array:
        """Values of the records that rows took, with the mean and the deviation of the weather of the rows."""
        mean, deviation = self._levels
        scale = np.sqrt(similar @ deviation**2) / deviation[taken]
        return np.asarray(similar @ mean + (values - mean[taken]) * scale)

    @cached_property
    def _levels(self) -> tuple[Array, Array]:
        """Mean and standard deviation of residuals in the weather of each record, outliers left out.

        The 100 records with the most similar weather give them.
        """
        mean = np.nan_to_num(self._local_mean(self.usual, self.weather, 100, MOST_PLACES))
        square = np.nan_to_num(self._local_mean(self.usual**2, self.weather, 100, MOST_PLACES))
        size = np.sqrt(np.maximum(np.nanmax(square, axis=0, initial=0), np.finfo(float).tiny))
        return mean, np.maximum(np.sqrt(np.maximum(square - mean**2, 0.0)), JITTER * size)

    @cached_property
    def correlation_time(self) -> float:
        """The longest of all modes, in records, of what similar weather does not explain."""
        means = self._local_mean(self.values, self.weather, 100, MOST_PLACES)
        return float(correlation_times(self.values - means).max())

    def _where_known(self, weather: Array, of_known: Callable[[Array], Array]) -> Array:
        """Results for the rows of weather that are complete, NaN for others."""
        known = ~np.isnan(weather).any(axis=1)
        result = np.full((len(weather), self.n_modes), np.nan)
        if known.any():
            result[known] = of_known(weather[known])
        return result

    def _similar_mean(self, values: Array, weather: Array) -> Array:
        """Mean of the records' values in the weather most similar to each row's, mode by mode."""
        return self._local_mean(values, weather, self._n_compared, int(MOST_SIMILAR / 0.1))

    @property
    def _n_compared(self) -> int:
        """Number of records with the most similar weather whose mean a residual is compared with: a tenth."""
        return int(np.clip(0.1 * len(self.values), 50, MOST_SIMILAR))

    def _local_mean(self, values: Array, weather: Array, number: int, most: int) -> Array:
        """Mean of the values of a number of records in the weather most similar to each row's, among ``most``."""
        wanted, used = self.coordinates.transform(weather), compared(values, most)
        rows = used.any(axis=1)
        return mean_of_nearest(self.places[rows], values[rows], used[rows], wanted, number)

    def _spread(self, values: Array, weather: Array, beyond: Array) -> Array:
        """The spread of residuals in weather, the wider the farther this is beyond what was learned from."""
        squares = self._local_mean(values**2, weather, 100, MOST_PLACES)
        return np.sqrt(np.where(np.isnan(squares), np.inf, squares)) * (1 + beyond)[:, np.newaxis]

    @cached_property
    def _scores(self) -> Array:
        """Absolute residuals over the spread that the records of the other folds give for their weather."""
        scores = np.empty_like(self.values)
        for fold in np.unique(self.folds):
            test = self.folds == fold
            weather = self.weather[test]
            beyond = TrainingRange.spanned(self.weather, ~test).excess(weather).mean(axis=1)
            spread = self._spread(np.where(test[:, np.newaxis], np.nan, self.values), weather, beyond)
            scores[test] = np.abs(self.values[test]) / spread
        return scores


def compared(values: Array, most: int) -> NDArray[np.bool_]:
    """Which values count: all that are there or, of more than ``most`` records, the most complete one of equal parts.

    All modes count in the same records, so that one search for neighbours serves them.
    """
    there = ~np.isnan(values)
    rows = np.flatnonzero(there.any(axis=1))
    if len(rows) <= most:
        return there
    part, n_there = np.arange(len(rows)) * most // len(rows), there[rows].sum(axis=1)
    order = np.lexsort((np.random.RandomState(0).uniform(size=len(rows)), n_there, part))
    chosen = rows[order[np.append(np.flatnonzero(np.diff(part)), len(rows) - 1)]]
    return there & np.isin(np.arange(len(values)), chosen)[:, np.newaxis]


def order_statistic(scores: Array, confidence: float) -> float:
    """The ceil((n + 1) confidence)-th smallest of n scores; infinite if n is too small for the confidence."""
    rank = int(np.ceil((len(scores) + 1) * confidence))
    return float(np.sort(scores)[rank - 1]) if rank <= len(scores) else np.inf
