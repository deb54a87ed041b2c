"""The records that a chain was fitted to, and its residuals by weather: their spread, intervals, realistic noise."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.model_selection import KFold
from sklearn.pipeline import Pipeline

from skthermo._arrays import Array, as_columns, as_floats
from skthermo._dependence import correlation_time
from skthermo._regressors import weights_for
from skthermo._saved_frames import SavesFrames
from skthermo._scatter import Scatter
from skthermo._times import row_times
from skthermo._validation import last_step
from skthermo._weather import TrainingRange, nearest, order_statistic, weather_coordinates

N_FOLDS = 5
DRAWN_FROM = 25  # number of records with the most similar weather that noise is drawn from
SPREAD_OF = 100  # number of records with the most similar weather whose residuals give the spread
COMPARED_WITH = 50  # least number of records with the most similar weather whose mean a residual is compared with
OVERFITTED = 0.9  # ratio of a mapper's own median residual to that out of fold, below which it has learned noise
SIMILAR = 0.1  # share of the records whose weather counts as similar, in means and in runs of drawn records


@dataclass(frozen=True)
class WeatherResiduals:
    """Relative residuals of records in order of time, and the weather of each.

    ``weather``, (n_records, n_inputs), are inputs of the temperature mapper, lags included. ``values``, (n_records,
    n_modes), are measured frequencies over out-of-fold predictions, minus 1; ``own`` the same from predictions of the
    mapper that learned from all records. ``folds`` are the periods of time.
    """

    weather: Array
    values: Array
    own: Array
    folds: NDArray[np.intp]

    @cached_property
    def coordinates(self) -> Pipeline:
        """Principal components of the standardised weather."""
        return weather_coordinates(self.weather)

    @cached_property
    def places(self) -> Array:
        """The records in these coordinates."""
        return self.coordinates.transform(self.weather)

    def spread(self, weather: Array) -> Array:
        """Root mean square of the residuals in similar weather, (n_samples, n_modes); NaN where weather is unknown."""
        return self._where_known(weather, lambda known: self._spread(known, np.ones(len(self.values), dtype=bool)))

    def expected(self, weather: Array) -> Array:
        """Mean residual that the mapper leaves in similar weather, (n_samples, n_modes); NaN where it is unknown."""
        everywhere = np.ones(len(self.own), dtype=bool)
        return self._where_known(weather, lambda known: self._similar_mean(self.own, known, everywhere))

    def shares(self, weather: Array) -> Array:
        """Share of each record in the mean of the expected residuals over all rows, (n_records, n_modes)."""
        known, shares = weather[~np.isnan(weather).any(axis=1)], np.zeros_like(self.values)
        if len(known):
            for mode, near in enumerate(self._similar(self.values, known, np.ones(len(self.own), dtype=bool))):
                shares[:, mode] = np.bincount(near.ravel(), minlength=len(self.own)) / max(near.size, 1)
        return shares

    def n_expected(self, weather: Array) -> Array:
        """Effective sample size of the mean of the expected residuals over all rows, (n_modes,); 0 without any."""
        squares = (self.shares(weather) ** 2).sum(axis=0)
        return np.divide(1.0, squares, out=np.zeros(self.n_modes), where=squares > 0)

    def less_similar(self, values: Array) -> Array:
        """Values of the records, (n_records, n_columns), less the mean of those in similar weather."""
        return values - self._similar_mean(values, self.weather, np.ones(len(values), dtype=bool))

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return self.values.shape[1]

    @cached_property
    def scatter(self) -> Scatter:
        """How records scatter around what similar weather explains, and how long they remember it."""
        return Scatter.of(self)

    @property
    def is_overfitted(self) -> bool:
        """Whether the mapper's own residuals are clearly smaller than those of the same records out of fold."""
        own, out_of_fold = (np.nanmedian(np.abs(values), axis=0) for values in (self.own, self.values))
        return bool((own < OVERFITTED * out_of_fold).any())

    def quantiles(self, confidence: float) -> Array:
        """Spreads from the prediction that hold the records with a given probability, (n_modes,)."""
        return np.array([order_statistic(column[~np.isnan(column)], confidence) for column in self._scores.T])

    def draw(self, weather: Array, random_state: np.random.RandomState) -> Array:
        """Residuals of whole records for rows of weather in order of time, (n_samples, n_modes).

        A stationary bootstrap: each row takes the record after the one before it took or, where such a run ends, one
        of the records with the most similar weather. A run ends by chance, and where the weather is no longer similar.
        Rows of unknown weather are NaN.
        """
        return self._where_known(weather, lambda known: self.noise[self._drawn(known, random_state)])

    def _drawn(self, weather: Array, random_state: np.random.RandomState) -> NDArray[np.intp]:
        """Positions of the records drawn for each row."""
        places, n_records = self.coordinates.transform(weather), len(self.places)
        near = nearest(self.places, places, DRAWN_FROM)[1]
        farthest = nearest(self.places, places, max(DRAWN_FROM, int(SIMILAR * n_records)))[0][:, -1]
        ends = random_state.uniform(size=len(places)) < 1 / self._mean_block_length
        fresh = near[np.arange(len(places)), random_state.randint(near.shape[1], size=len(places))]
        taken = np.empty(len(places), dtype=int)
        record = n_records
        for row in range(len(places)):
            record += 1
            is_over = ends[row] or record >= n_records
            if is_over or np.linalg.norm(self.places[record] - places[row]) > farthest[row]:
                record = fresh[row]
            taken[row] = record
        return taken

    @cached_property
    def noise(self) -> Array:
        """Scatter of the records around what similar weather shows out of fold, and what the mapper leaves there.

        A fold that must extrapolate has an error that the mapper of all records has not.
        """
        return self.less_similar(self.values) + self.expected(self.weather)

    def _where_known(self, weather: Array, of_known: Callable[[Array], Array]) -> Array:
        """Results for the rows of weather that are complete, NaN for others."""
        known = ~np.isnan(weather).any(axis=1)
        result = np.full((len(weather), self.n_modes), np.nan)
        if known.any():
            result[known] = of_known(weather[known])
        return result

    def _similar_mean(self, values: Array, weather: Array, rows: NDArray[np.bool_]) -> Array:
        """Mean of some records' values in weather most like that of each row, mode by mode."""
        means = np.full((len(weather), values.shape[1]), np.nan)
        for mode, near in enumerate(self._similar(values, weather, rows)):
            if near.size:
                means[:, mode] = values[near, mode].mean(axis=1)
        return means

    def _similar(self, values: Array, weather: Array, rows: NDArray[np.bool_]) -> Iterator[NDArray[np.intp]]:
        """For each mode, positions of the records with weather most like that of each row, (n_samples, n_similar)."""
        wanted, number = self.coordinates.transform(weather), max(COMPARED_WITH, int(SIMILAR * len(values)))
        found: dict[bytes, NDArray[np.intp]] = {}  # modes that are there in the same records have the same neighbours
        for column in values.T:
            known = np.flatnonzero(rows & ~np.isnan(column))
            if known.tobytes() not in found:
                near = known[nearest(self.places[known], wanted, number)[1]] if known.size else known
                found[known.tobytes()] = near
            yield found[known.tobytes()]

    def _spread(self, weather: Array, rows: NDArray[np.bool_]) -> Array:
        """The spread that some of the records give, the wider the farther weather is beyond their range."""
        wanted, spread = self.coordinates.transform(weather), np.empty((len(weather), self.values.shape[1]))
        for mode, values in enumerate(self.values.T):
            known = np.flatnonzero(rows & ~np.isnan(values))
            near = known[nearest(self.places[known], wanted, SPREAD_OF)[1]] if known.size else known
            spread[:, mode] = np.sqrt((values[near] ** 2).mean(axis=1)) if known.size else np.inf
        excess = TrainingRange.of(self.weather, rows).excess(weather).mean(axis=1)
        return spread * (1 + excess)[:, np.newaxis]

    @cached_property
    def _scores(self) -> Array:
        """Absolute residuals over the spread that the records of the other periods give for their weather."""
        scores = np.empty_like(self.values)
        for fold in np.unique(self.folds):
            test = self.folds == fold
            scores[test] = np.abs(self.values[test]) / self._spread(self.weather[test], ~test)
        return scores

    @cached_property
    def _mean_block_length(self) -> float:
        """Mean length of the runs: twice the correlation time of what similar weather does not explain, minus one."""
        near = nearest(self.places, self.places, SPREAD_OF)[1]
        filled = np.where(np.isnan(self.values), 0.0, self.values)
        means = filled[near].sum(axis=1) / np.maximum((~np.isnan(self.values))[near].sum(axis=1), 1)
        return max(1.0, 2 * max(correlation_time(column) for column in (self.values - means).T) - 1)


@dataclass
class TrainingRecords(SavesFrames):
    """Records that `DataInformedFEM.fit` was given, in their order, and what M2 learned from them.

    ``inputs`` are those of M2, lags included, ``targets`` the parameters that it learned, and ``weights`` those of the
    rows, or None. ``residuals`` are out of fold, and None until they have been computed.
    """

    temperatures: Any
    frequencies: Any
    inputs: Array
    targets: Array
    weights: Array | None
    residuals: WeatherResiduals | None = None

    @property
    def trained(self) -> NDArray[np.bool_]:
        """Which rows trained M2."""
        return ~(np.isnan(self.inputs).any(axis=1) | np.isnan(self.targets).any(axis=1))

    def out_of_fold(self, mapper: Any, frequencies_of: Callable[[Array], Array]) -> WeatherResiduals:
        """Relative residuals of the records, each predicted by a mapper fitted on other periods of time.

        Given are the fitted mapper, and the function from parameters to frequencies as they would be measured.
        """
        order = np.argsort(row_times(self.temperatures), kind="stable")
        inputs, theta, measured = self.inputs[order], self.targets[order], as_floats(self.frequencies)[order]
        rows = np.flatnonzero(~np.isnan(inputs).any(axis=1) & ~np.isnan(measured).all(axis=1))
        usable = ~np.isnan(theta[rows]).any(axis=1)
        if usable.sum() < 2 * N_FOLDS:
            raise ValueError(f"{usable.sum()} records have parameters; expected at least {2 * N_FOLDS} for residuals")
        learner, predicted, folds = last_step(mapper), np.full_like(theta[rows], np.nan), np.empty(len(rows), dtype=int)
        for fold, (train, test) in enumerate(KFold(N_FOLDS).split(rows)):
            train = train[usable[train]]
            weights = None if self.weights is None else self.weights[order][rows][train]
            fitted = clone(learner).fit(inputs[rows][train], theta[rows][train], **weights_for(learner, weights))
            predicted[test], folds[test] = as_columns(fitted.predict(inputs[rows][test])), fold
        own = as_columns(mapper.predict(self.temperatures))[order][rows]
        values, own = (measured[rows] / frequencies_of(theta) - 1 for theta in (predicted, own))
        known = ~np.isnan(values).all(axis=1)
        return WeatherResiduals(inputs[rows][known], values[known], own[known], folds[known])
