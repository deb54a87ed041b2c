"""The records that a chain was fitted to, and its residuals by weather: their spread, intervals, realistic noise."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
import scipy.sparse
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.model_selection import BaseCrossValidator
from sklearn.pipeline import Pipeline

from skthermo._arrays import Array, as_columns, as_floats, median, patterns, robust_deviation, spread_evenly
from skthermo._frames import frame_like
from skthermo._gaussian import Gaussian
from skthermo._regressors import fit_weighted, offers, predicted_covariance, reach_of
from skthermo._saved_frames import SavesFrames
from skthermo._times import correlation_time, row_times
from skthermo._validation import last_step
from skthermo._warnings import without_warnings
from skthermo._weather import (
    SensorRegression,
    TrainingRange,
    nearest_in_parts,
    one_in_each_part,
    order_statistic,
    warn_of_unseen,
    weather_coordinates,
)
from skthermo.preprocessing import BlockedKFold, HampelFilter
from skthermo.surrogate.chain._discrepancy import Discrepancy, ratio_regressor, ratios_of
from skthermo.surrogate.chain._scatter import Scatter
from skthermo.surrogate.chain._service import ServiceRecords

N_FOLDS = 5
CORRELATION_TIMES = 5  # of the residuals in a block of records that are predicted together, at least
DRAWN_FROM = 25  # number of records with the most similar weather that noise is drawn from
RUNS = 6  # times the correlation time less 1, and 1 more, is the mean length of a run of drawn records
MOST_SCALED = 2.0  # ratio of the scatter in the weather of a row and of its record beyond which a run ends
SPREAD_OF = 100  # number of records with the most similar weather whose residuals give the spread
COMPARED_WITH = 50  # least number of records with the most similar weather whose mean a residual is compared with
OVERFITTED = 0.75  # ratio of a mapper's own median residual to that out of fold, below which it has learned noise
SIMILAR = 0.1  # share of the records whose weather counts as similar, in means
JITTER = 1e-9  # share of its variance that each mode has of its own, also where two scatter the same
MOST_PLACES = 20_000  # number of records among which neighbours are looked for
MOST_NOISE = 0.1  # relative standard deviation of records, at most, that counts as noise
MOST_FOR_NOISE = 3000  # records, spread evenly, that the noise is estimated from
MOST_SIMILAR = 500  # number of similar records that stand for all of them


@dataclass(frozen=True)
class WeatherResiduals:
    """Relative residuals of records in order of time, and the weather of each.

    ``weather``, (n_records, n_inputs), are inputs of the temperature mapper, lags included. ``values``, (n_records,
    n_modes), are measured frequencies over out-of-fold predictions, minus 1; ``own`` the same from predictions of the
    mapper that learned from all records. ``folds`` tells which records were predicted together, and ``rows`` which rows
    of the training records they are. ``ratios``, (n_records, n_parameters), are the parameters of the records over
    out-of-fold predictions. ``errors``, (n_records, n_modes), are the relative standard deviations of out-of-fold
    predictions as a mapper states them, None if it does not; ``reach`` is the weather within which they hold, all by
    default, and ``beyond``, (n_records,), how far each record was outside that of the mapper that predicted it.
    """

    weather: Array
    values: Array
    own: Array
    folds: NDArray[np.intp]
    rows: NDArray[np.intp] | None = None
    ratios: Array | None = None
    errors: Array | None = None
    reach: TrainingRange | None = None
    beyond: Array | None = None

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
        """Number of modes."""
        return self.values.shape[1]

    def spread(self, weather: Array) -> Array:
        """Root mean square of the residuals in similar weather, (n_samples, n_modes); NaN where weather is unknown.

        Without what the mapper states of the errors of its predictions.
        """

        def of_known(known: Array) -> Array:
            if self.errors is not None and self.reach is None:
                return self._spread(known, self._all, np.zeros(len(known)))
            reach = self.reach or TrainingRange.of(self.weather, self._all)
            return self._spread(known, self._all, reach.excess(known).mean(axis=1))

        return self._where_known(weather, of_known)

    def expected(self, weather: Array) -> Array:
        """Mean residual that the mapper leaves in similar weather, (n_samples, n_modes); NaN where it is unknown."""
        return self._where_known(weather, lambda known: self._similar_mean(self.own, known, self._all))

    def shares(self, weather: Array) -> Array:
        """Share of each record in the mean of the expected residuals over all rows, (n_records, n_modes)."""
        shares = np.zeros_like(self.values)
        weather = weather[~np.isnan(weather).any(axis=1)]
        wanted = self.coordinates.transform(weather) if len(weather) else weather
        for modes, known in self._present(self.values, self._all, int(MOST_SIMILAR / SIMILAR)):
            counts = np.zeros(len(known))
            for _, _, near in nearest_in_parts(self.places[known], wanted, self._n_compared):
                counts += np.bincount(near.ravel(), minlength=len(known))
            shares[np.ix_(known, modes)] = (counts / max(counts.sum(), 1))[:, np.newaxis]
        return shares

    def n_expected(self, weather: Array) -> Array:
        """Effective sample size of the mean of the expected residuals over all rows, (n_modes,); 0 without any."""
        squares = (self.shares(weather) ** 2).sum(axis=0)
        return np.divide(1.0, squares, out=np.zeros(self.n_modes), where=squares > 0)

    def less_similar(self, values: Array) -> Array:
        """Values of the records, (n_records, n_columns), less the mean of those in similar weather."""
        return values - self._similar_mean(values, self.weather, self._all)

    @cached_property
    def scatter(self) -> Scatter:
        """How records scatter around what similar weather explains, and how long they remember it."""
        return Scatter.of(self)

    def independent_scatter(self, deviations: Array) -> Scatter:
        """The same for independent records and modes of stated relative standard deviations, (n_modes,)."""
        return Scatter.independent(deviations, len(self.values))

    @property
    def is_overfitted(self) -> bool:
        """Whether the mapper's own residuals are clearly smaller than those of the same records out of fold."""
        own, out_of_fold = (np.nanmedian(np.abs(values), axis=0) for values in (self.own, self.values))
        return bool(own.mean() < OVERFITTED * out_of_fold.mean())

    def quantiles(self, confidence: float) -> Array:
        """Spreads from the prediction that hold the records with a given probability, (n_modes,)."""
        return np.array([order_statistic(column[~np.isnan(column)], confidence) for column in self._scores.T])

    def draw(self, weather: Array, random_state: np.random.RandomState) -> Array:
        """Residuals for rows of weather in order of time, (n_samples, n_modes), with the gaps of whole records.

        A smoothed stationary bootstrap: each row takes the record after the one before it took or, where such a run
        ends by chance, one of the records with the most similar weather. In weather that scatters more or less than
        that of its records, a run is scaled, or ends where that is a factor of `MOST_SCALED`. A second draw of its own
        is added with a small weight, so that the largest residual of the training records is not the largest of all.
        Rows of unknown weather are NaN.
        """
        return self._where_known(weather, lambda known: self._smoothed(self.drawn, known, random_state, False))

    def draw_complete(self, weather: Array, random_state: np.random.RandomState, without_outliers: bool) -> Array:
        """The same, with missing modes, and outliers if asked, drawn anew given the modes that are there.

        They follow the normal distribution of residuals without outliers. Without gaps and outliers, `draw` gives the
        same.
        """
        values = self.usual if without_outliers else self.drawn
        return self._where_known(weather, lambda known: self._smoothed(values, known, random_state, True))

    def _smoothed(self, values: Array, weather: Array, random_state: np.random.RandomState, is_complete: bool) -> Array:
        """Values as drawn, and others of the usual ones, added with the bandwidth of Silverman's rule."""
        similar = self._similar(weather)
        draws = [self._taken(similar, random_state) for _ in range(2)]
        n_modes, n_independent = self.n_modes, len(values) / self.correlation_time
        bandwidth = (4 / ((n_modes + 2) * n_independent)) ** (1 / (n_modes + 4))
        angle, mean = np.arctan(bandwidth), similar @ self._levels[0][:, :n_modes]
        first = self._completed(values[draws[0]], random_state) if is_complete else values[draws[0]]
        second = self._completed(self.usual[draws[1]], random_state)
        first, second = (
            self._carried(of_rows, taken, similar) - mean for of_rows, taken in zip((first, second), draws, strict=True)
        )
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
        """What noise is drawn from: between the residuals out of fold and those of the mapper of all records.

        The former hold the errors of mappers of fewer records, beside those of the mapper that simulates; the latter
        are too small, and do not count where it has learned noise: where they change less from record to record.
        """
        own, out_of_fold = (np.diff(values, axis=0) for values in (self.own, self.values))
        with without_warnings():  # of modes that are never there twice in a row
            sizes = [np.nanmean(np.nanmedian(np.abs(changes), axis=0)) for changes in (own, out_of_fold)]
        return self.values if sizes[0] < OVERFITTED * sizes[1] else (self.values + self.own) / 2

    @property
    def outliers(self) -> Array:
        """Those of the residuals that are outliers, NaN elsewhere."""
        return np.where(np.isnan(self.usual), self.values, np.nan)

    @cached_property
    def _normal(self) -> Gaussian:
        """Normal distribution of the residuals without outliers."""
        with without_warnings():
            found = Gaussian.of(self.usual)
        return Gaussian(found.mean, found.covariance + JITTER * np.diag(np.diag(found.covariance)))

    def draw_records(self, weather: Array, random_state: np.random.RandomState) -> tuple[NDArray[np.intp], list[Array]]:
        """Positions of the records drawn for each row, and their residuals and ratios as they are in its weather."""
        similar = self._similar(weather)
        taken = self._taken(similar, random_state)
        columns = self.drawn if self.ratios is None else np.hstack([self.drawn, self.ratios])
        return taken, np.split(self._carried(columns[taken], taken, similar), [self.n_modes], axis=1)

    def _similar(self, weather: Array) -> scipy.sparse.csr_array:
        """Equal weights of the records with the most similar weather, (n_rows, n_records)."""
        places, some = self.coordinates.transform(weather), one_in_each_part(len(self.places), MOST_PLACES)
        near = np.vstack([found for _, _, found in nearest_in_parts(self.places[some], places, DRAWN_FROM)])
        ends = np.arange(0, near.size + 1, near.shape[1])
        weights = np.full(near.size, 1 / near.shape[1])
        return scipy.sparse.csr_array((weights, some[near].ravel(), ends), (len(near), len(self.places)))

    def _taken(self, similar: scipy.sparse.csr_array, random_state: np.random.RandomState) -> NDArray[np.intp]:
        """Positions of records in runs for rows with some similar records."""
        n_rows, n_records = similar.shape
        ends = np.flatnonzero(random_state.uniform(size=n_rows) < 1 / (1 + RUNS * (self.correlation_time - 1)))
        which = random_state.randint(similar.indptr[1], size=n_rows)
        taken = similar.indices.reshape(n_rows, -1)[np.arange(n_rows), which].astype(np.intp)
        if len(ends) == n_rows:
            return taken
        logs = np.log(self._levels[1][:, : self.n_modes])
        here, row = np.log(self._scatter_at(similar)[:, : self.n_modes]), 0
        while row < n_rows:
            later = np.searchsorted(ends, row, side="right")
            stop = min(ends[later] if later < len(ends) else n_rows, row + n_records - taken[row])
            records = np.arange(taken[row], taken[row] + stop - row)
            is_other = (np.abs(here[row:stop] - logs[records]) > np.log(MOST_SCALED)).any(axis=1)
            length = 1 + int(np.argmax(np.append(is_other[1:], True)))
            taken[row : row + length] = records[:length]
            row += length
        return taken

    def _carried(self, values: Array, taken: NDArray[np.intp], similar: scipy.sparse.csr_array) -> Array:
        """Values of the records that rows took, with the mean and the deviation of the weather of the rows."""
        n_columns = values.shape[1]
        mean, deviation = (level[:, :n_columns] for level in self._levels)
        scale = self._scatter_at(similar)[:, :n_columns] / deviation[taken]
        return np.asarray(similar @ mean + (values - mean[taken]) * scale)

    def _scatter_at(self, similar: scipy.sparse.csr_array) -> Array:
        return np.sqrt(similar @ self._levels[1] ** 2)

    @cached_property
    def _levels(self) -> tuple[Array, Array]:
        """Mean and standard deviation of residuals and ratios in the weather of each record, outliers left out."""
        columns = self.usual if self.ratios is None else np.hstack([self.usual, self.ratios])
        mean, square = (
            np.nan_to_num(self._local_mean(some, self.weather, self._all, SPREAD_OF, MOST_PLACES))
            for some in (columns, columns**2)
        )
        size = np.sqrt(np.maximum(np.nanmax(square, axis=0, initial=0), np.finfo(float).tiny))
        return mean, np.maximum(np.sqrt(np.maximum(square - mean**2, 0.0)), JITTER * size)

    @cached_property
    def correlation_time(self) -> float:
        """The longest of all modes, in records, of what similar weather does not explain."""
        means = self._local_mean(self.values, self.weather, self._all, SPREAD_OF, MOST_PLACES)
        return max(correlation_time(column) for column in (self.values - means).T)

    @property
    def _all(self) -> NDArray[np.bool_]:
        return np.ones(len(self.values), dtype=bool)

    def _where_known(self, weather: Array, of_known: Callable[[Array], Array]) -> Array:
        """Results for the rows of weather that are complete, NaN for others."""
        known = ~np.isnan(weather).any(axis=1)
        result = np.full((len(weather), self.n_modes), np.nan)
        if known.any():
            result[known] = of_known(weather[known])
        return result

    def _similar_mean(self, values: Array, weather: Array, rows: NDArray[np.bool_]) -> Array:
        """Mean of some records' values in weather most like that of each row, mode by mode."""
        return self._local_mean(values, weather, rows, self._n_compared, int(MOST_SIMILAR / SIMILAR))

    @property
    def _n_compared(self) -> int:
        return int(np.clip(SIMILAR * len(self.values), COMPARED_WITH, MOST_SIMILAR))

    def _local_mean(self, values: Array, weather: Array, rows: NDArray[np.bool_], number: int, most: int) -> Array:
        """Mean of the values of a number of records in weather most like that of each row, among so many at most."""
        wanted, means = self.coordinates.transform(weather), np.full((len(weather), values.shape[1]), np.nan)
        for modes, known in self._present(values, rows, most):
            of_known = values[np.ix_(known, modes)]
            for part, _, near in nearest_in_parts(self.places[known], wanted, number):
                ends = np.arange(0, near.size + 1, near.shape[1])
                sums = scipy.sparse.csr_array((np.ones(near.size), near.ravel(), ends), (len(near), len(known)))
                means[part, modes] = sums @ of_known / near.shape[1]
        return means

    def _present(
        self, values: Array, rows: NDArray[np.bool_], most: int
    ) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Modes that are there in the same records, and positions of these among some rows, or of so many of them."""
        present = (rows[:, np.newaxis] & ~np.isnan(values)).T
        masks, of_mode = patterns(present)
        for pattern, mask in enumerate(masks):
            known = np.flatnonzero(mask)
            if known.size:
                yield np.flatnonzero(of_mode == pattern), known[one_in_each_part(len(known), most)]

    def _spread(self, weather: Array, rows: NDArray[np.bool_], beyond: Array) -> Array:
        """The spread that some of the records give, the wider the farther weather is beyond what was learned from."""
        squares = self._local_mean(self._scattered**2, weather, rows, SPREAD_OF, MOST_PLACES)
        return np.sqrt(np.where(np.isnan(squares), np.inf, squares)) * (1 + beyond)[:, np.newaxis]

    @cached_property
    def _scattered(self) -> Array:
        """The residuals, less the share of each that is as a rule an error that the mapper states."""
        if self.errors is None or not self.errors.any():
            return self.values
        variances = self.errors[:, :, np.newaxis] ** 2 * np.eye(self.n_modes)
        own = np.diag(Gaussian.of(self.values, variances).covariance)
        return self.values * np.sqrt(own / (own + self.errors**2))

    @cached_property
    def _scores(self) -> Array:
        """Absolute residuals over the spread that the records of the other folds give for their weather."""
        scores = np.empty_like(self.values)
        for fold in np.unique(self.folds):
            test = self.folds == fold
            weather = self.weather[test]
            others = TrainingRange.of(self.weather, ~test).excess(weather).mean(axis=1)
            beyond = others if self.beyond is None else self.beyond[test]
            scores[test] = np.abs(self._scattered[test]) / self._spread(weather, ~test, beyond)
        return scores


@dataclass
class TrainingRecords(SavesFrames):
    """Records that `DataInformedFEM.fit` was given, in their order, and what M2 learned from them.

    ``inputs`` are those of M2, lags included, ``targets`` the parameters that it learned, ``learned`` those that it
    gives for the inputs, ``usable`` the frequencies without outliers, ``modelled`` the FE model's frequencies at
    ``learned``, in the measured domain, ``weights`` those of the rows, or None, and ``parameter_names`` the columns of
    the targets. ``residuals`` are out of fold; they and the ``service``, gaps and outliers, are None until they have
    been computed.
    """

    temperatures: Any
    frequencies: Any
    inputs: Array
    targets: Array
    learned: Array
    usable: Array
    modelled: Array
    weights: Array | None
    parameter_names: Sequence[str]
    residuals: WeatherResiduals | None = None
    service: ServiceRecords | None = None

    @property
    def trained(self) -> NDArray[np.bool_]:
        """Which rows trained M2."""
        return ~(np.isnan(self.inputs).any(axis=1) | np.isnan(self.targets).any(axis=1)) & self.counted

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Which rows have a weight, or had no mode that could give them one."""
        if self.weights is None:
            return np.ones(len(self.inputs), dtype=bool)
        return (self.weights > 0) | np.isnan(as_floats(self.frequencies)).all(axis=1)

    @property
    def ratios(self) -> Array:
        """Measured over modelled frequencies, which a discrepancy learns, (n_rows, n_modes)."""
        return self.usable / self.modelled

    def learns(self, regressor: Any, mapper: Any, sensors: SensorRegression) -> Discrepancy:
        """The discrepancy that a regressor learns of these records, beside a fitted mapper."""
        folds = BlockedKFold(N_FOLDS).fold_of(as_frame(self.temperatures))
        chain = {"mapper": mapper, "sensors": sensors}
        return Discrepancy.of(regressor, self.inputs, self.ratios, self.weights, folds, **chain)

    def resampled(
        self, residuals: WeatherResiduals, discrepancy: Discrepancy, random_state: np.random.RandomState
    ) -> "TrainingRecords":
        """Records that this structure could have given as well in the same weather, before a mapper learns them.

        Each takes what a record of similar weather left unexplained, of its parameters and of its frequencies, in runs.
        """
        known = ~np.isnan(self.inputs).any(axis=1)
        order = np.argsort(row_times(self.temperatures), kind="stable")
        order = order[known[order]]
        taken, (values, ratios) = residuals.draw_records(self.inputs[order], random_state)
        targets, measured = np.full_like(self.targets, np.nan), np.full(np.shape(self.frequencies), np.nan)
        targets[order] = self.learned[order] * ratios
        expected = self.modelled[order] * np.exp(discrepancy.at(self.inputs[order]))
        measured[order] = expected * (1 + values)
        weights = None
        if self.weights is not None:
            weights = np.zeros(len(targets))
            weights[order] = self.weights[residuals.rows[taken]]
        return replace(
            self,
            frequencies=frame_like(self.frequencies, measured),
            usable=measured,
            targets=targets,
            weights=weights,
            residuals=None,
            service=None,
        )

    def out_of_fold(
        self,
        mapper: Any,
        frequencies_of: Callable[[Array], Array],
        discrepancy: Discrepancy,
        folds: BaseCrossValidator | None = None,
        propagated: Callable[[Array, Array], Array] | None = None,
    ) -> WeatherResiduals:
        """Relative residuals of the records, each predicted by a mapper and a discrepancy of the other folds.

        Given are the fitted mapper, the function from parameters to frequencies in the measured domain, the discrepancy
        and, for a mapper that states its errors, the function from parameters and their covariances to covariances of
        ln f. By default, a fold holds every fifth of blocks of a week, or longer if
        the residuals remember for longer.
        """
        order = np.argsort(row_times(self.temperatures), kind="stable")
        measured = as_floats(self.frequencies)
        known = ~np.isnan(self.inputs).any(axis=1) & ~np.isnan(measured).all(axis=1) & self.counted
        order = order[known[order]]
        inputs, theta, measured = self.inputs[order], self.targets[order], measured[order]
        usable = ~np.isnan(theta).any(axis=1)
        if usable.sum() < 2 * N_FOLDS:
            raise ValueError(f"{usable.sum()} records have parameters; expected at least {2 * N_FOLDS} for residuals")
        own = measured / (self.modelled[order] * np.exp(discrepancy.at(inputs))) - 1
        records = as_frame(self.temperatures).iloc[order]
        if folds is None:
            known = ~np.isnan(own).all(axis=1)
            in_sample = WeatherResiduals(inputs[known], own[known], own[known], np.zeros(known.sum(), dtype=np.intp))
            folds = BlockedKFold(N_FOLDS).remembering(records, CORRELATION_TIMES * in_sample.correlation_time)
        learner, predicted, fold_of = last_step(mapper), np.full_like(theta, np.nan), np.zeros(len(order), dtype=int)
        named, states = pd.DataFrame(theta, columns=list(self.parameter_names)), offers(mapper, "predict_covariance")
        covariances, beyond = np.zeros((*theta.shape, theta.shape[1])) if states else None, np.zeros(len(order))
        for fold, (train, test) in enumerate(folds.split(records)):
            train = train[usable[train]]
            weights = None if self.weights is None else self.weights[order][train]
            fitted = fit_weighted(clone(learner), inputs[train], named.iloc[train], weights)
            predicted[test], fold_of[test] = as_columns(fitted.predict(inputs[test])), fold
            if covariances is not None:
                covariances[test] = predicted_covariance(fitted, inputs[test])
                found = reach_of(fitted, inputs[test])
                beyond[test] = 0.0 if found is None else found[0].excess(found[1]).mean(axis=1)
        if not states:
            warn_of_unseen(records, fold_of, "standard deviations, intervals and noise are guesses there")
        modelled = frequencies_of(predicted)
        expected = np.full_like(modelled, np.nan)
        for fold in range(fold_of.max() + 1):
            train, test = usable & (fold_of != fold), fold_of == fold
            weights = None if self.weights is None else self.weights[order]
            # ratios to predictions that are out of fold themselves, so that the model is not solved for each fold
            learned = discrepancy.relearned(inputs, self.usable[order] / modelled, weights, train)
            expected[test] = modelled[test] * np.exp(learned.at(inputs[test]))
        values = measured / expected - 1
        known = ~np.isnan(values).all(axis=1)
        residuals = WeatherResiduals(
            inputs[known], values[known], own[known], fold_of[known], order[known], (theta / predicted)[known]
        )
        if covariances is None or propagated is None:
            return residuals
        errors = np.sqrt(np.einsum("ijj->ij", propagated(predicted, covariances)))
        reach = (reach_of(learner, inputs) or (None,))[0]
        return replace(residuals, errors=errors[known], reach=reach, beyond=beyond[known])


def measurement_noise(mapper: Any, T: Any, F: Any) -> Array:
    """Relative standard deviations of frequencies about a regression on what an unfitted mapper sees of the weather.

    Out of fold, and by medians, so that outliers and rare weather hardly move them; (n_modes,).
    """
    rows = spread_evenly(np.argsort(row_times(T), kind="stable"), MOST_FOR_NOISE)
    logs, inputs = np.log(as_floats(F)), T
    if isinstance(mapper, Pipeline):
        with without_warnings():
            inputs = clone(mapper[:-1]).fit_transform(T, np.where(np.isnan(logs), median(logs), logs))
    inputs, residuals = as_floats(inputs)[rows], logs[rows] - median(logs)
    measured, records = np.exp(residuals), as_frame(T).iloc[rows]
    folds = BlockedKFold(N_FOLDS).fold_of(records) if len(rows) >= N_FOLDS else np.zeros(len(rows))
    known = ~np.isnan(inputs).any(axis=1)
    for one in ratios_of(ratio_regressor(), inputs, measured, None):
        for fold in range(N_FOLDS):
            learned = one.refitted(ratio_regressor(), inputs, measured, None, one.rows[folds[one.rows] != fold])
            test = np.flatnonzero((folds == fold) & known)
            if learned.regressor is not None and len(test):
                residuals[np.ix_(test, one.modes)] -= learned.logs(inputs[test])
    return np.minimum(robust_deviation(residuals), MOST_NOISE)


def as_frame(table: Any) -> pd.DataFrame:
    """A frame of records, of which the index tells the times."""
    return table if isinstance(table, pd.DataFrame) else pd.DataFrame(as_floats(table), copy=False)
