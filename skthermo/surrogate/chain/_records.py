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

from skthermo._arrays import Array, as_columns, as_floats, patterns
from skthermo._frames import frame_like
from skthermo._gaussian import Gaussian
from skthermo._regressors import fit_weighted, offers, predicted_covariance, reach_of
from skthermo._saved_frames import SavesFrames
from skthermo._times import correlation_time, row_times
from skthermo._validation import last_step
from skthermo._warnings import without_warnings
from skthermo._weather import (
    TrainingRange,
    nearest_in_parts,
    one_in_each_part,
    order_statistic,
    warn_of_unseen,
    weather_coordinates,
)
from skthermo.preprocessing import BlockedKFold, HampelFilter
from skthermo.surrogate.chain._scatter import Scatter
from skthermo.surrogate.chain._service import ServiceRecords

N_FOLDS = 5
CORRELATION_TIMES = 5  # of the residuals in a block of records that are predicted together, at least
DRAWN_FROM = 25  # number of records with the most similar weather that noise is drawn from
SPREAD_OF = 100  # number of records with the most similar weather whose residuals give the spread
COMPARED_WITH = 50  # least number of records with the most similar weather whose mean a residual is compared with
OVERFITTED = 0.75  # ratio of a mapper's own median residual to that out of fold, below which it has learned noise
SIMILAR = 0.1  # share of the records whose weather counts as similar, in means and in runs of drawn records
JITTER = 1e-9  # share of its variance that each mode has of its own, also where two scatter the same
MOST_PLACES = 20_000  # number of records among which neighbours are looked for
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
        """Residuals of whole records for rows of weather in order of time, (n_samples, n_modes).

        A stationary bootstrap: each row takes the record after the one before it took or, where such a run ends, one
        of the records with the most similar weather. A run ends by chance, and where the weather is no longer similar.
        Rows of unknown weather are NaN.
        """
        return self._where_known(weather, lambda known: self.values[self.draw_records(known, random_state)])

    def draw_complete(self, weather: Array, random_state: np.random.RandomState, without_outliers: bool) -> Array:
        """The same, with missing modes, and outliers if asked, drawn anew given the modes that are there.

        They follow the normal distribution of residuals without outliers. Without gaps and outliers, `draw` gives the
        same.
        """
        return self._where_known(
            weather,
            lambda known: self._completed(self.draw_records(known, random_state), random_state, without_outliers),
        )

    def _completed(
        self, records: NDArray[np.intp], random_state: np.random.RandomState, without_outliers: bool
    ) -> Array:
        values = self.usual[records] if without_outliers else self.values[records]
        gaps = np.isnan(values)
        if not gaps.any():
            return values
        expected = self._normal.completed(values)[0]
        roots, of_row = self._normal.error_roots(values)
        drawn = np.einsum("ijk,ik->ij", roots[of_row], random_state.standard_normal(values.shape))
        return np.where(gaps, np.where(np.isnan(expected), self._normal.mean, expected) + drawn, values)

    @cached_property
    def usual(self) -> Array:
        """The residuals, NaN where one is an outlier: far from its neighbours in time."""
        return HampelFilter().fit(self.values).transform(self.values)

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

    def draw_records(self, weather: Array, random_state: np.random.RandomState) -> NDArray[np.intp]:
        """Positions of the records drawn for each row."""
        places, n_records = self.coordinates.transform(weather), len(self.places)
        mean_length = max(1.0, 2 * self.correlation_time - 1)
        ends = random_state.uniform(size=len(places)) < 1 / mean_length
        some, similar = (one_in_each_part(n_records, most) for most in (MOST_PLACES, int(MOST_SIMILAR / SIMILAR)))
        which = random_state.randint(min(DRAWN_FROM, len(some)), size=len(places))
        fresh, farthest = np.empty(len(places), dtype=np.intp), np.empty(len(places))
        for part, _, near in nearest_in_parts(self.places[some], places, DRAWN_FROM):
            fresh[part] = some[near[np.arange(len(near)), which[part]]]
        n_similar = max(DRAWN_FROM, int(SIMILAR * len(similar)))
        for part, distances, _ in nearest_in_parts(self.places[similar], places, n_similar):
            farthest[part] = distances[:, -1]
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
    gives for the inputs, ``weights`` those of the rows, or None, and ``parameter_names`` the columns of the targets.
    ``residuals`` are out of fold; they and the
    ``service``, gaps and outliers, are None until they have been computed.
    """

    temperatures: Any
    frequencies: Any
    inputs: Array
    targets: Array
    learned: Array
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

    def resampled(
        self,
        residuals: WeatherResiduals,
        frequencies_of: Callable[[Array], Array],
        random_state: np.random.RandomState,
    ) -> "TrainingRecords":
        """Records that this structure could have given as well in the same weather, before a mapper learns them.

        Each takes what a record of similar weather left unexplained, of its parameters and of its frequencies, in runs.
        """
        known = ~np.isnan(self.inputs).any(axis=1)
        order = np.argsort(row_times(self.temperatures), kind="stable")
        order = order[known[order]]
        taken = residuals.draw_records(self.inputs[order], random_state)
        targets, measured = np.full_like(self.targets, np.nan), np.full(np.shape(self.frequencies), np.nan)
        targets[order] = self.learned[order] * residuals.ratios[taken]
        measured[order] = frequencies_of(self.learned[order]) * (1 + residuals.values[taken])
        weights = None
        if self.weights is not None:
            weights = np.zeros(len(targets))
            weights[order] = self.weights[residuals.rows[taken]]
        return replace(
            self,
            frequencies=frame_like(self.frequencies, measured),
            targets=targets,
            weights=weights,
            residuals=None,
            service=None,
        )

    def out_of_fold(
        self,
        mapper: Any,
        frequencies_of: Callable[[Array], Array],
        folds: BaseCrossValidator | None = None,
        propagated: Callable[[Array, Array], Array] | None = None,
    ) -> WeatherResiduals:
        """Relative residuals of the records, each predicted by a mapper fitted to the other folds.

        Given are the fitted mapper, the function from parameters to frequencies as they would be measured and, for a
        mapper that states its errors, that from parameters and their covariances to covariances of frequencies. By
        default, a fold holds every fifth of blocks of a week, or longer if the residuals remember for longer.
        """
        order = np.argsort(row_times(self.temperatures), kind="stable")
        measured = as_floats(self.frequencies)
        known = ~np.isnan(self.inputs).any(axis=1) & ~np.isnan(measured).all(axis=1) & self.counted
        order = order[known[order]]
        inputs, theta, measured = self.inputs[order], self.targets[order], measured[order]
        usable = ~np.isnan(theta).any(axis=1)
        if usable.sum() < 2 * N_FOLDS:
            raise ValueError(f"{usable.sum()} records have parameters; expected at least {2 * N_FOLDS} for residuals")
        own = measured / frequencies_of(self.learned[order]) - 1
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
        expected = frequencies_of(predicted)
        values = measured / expected - 1
        known = ~np.isnan(values).all(axis=1)
        residuals = WeatherResiduals(
            inputs[known], values[known], own[known], fold_of[known], order[known], (theta / predicted)[known]
        )
        if covariances is None or propagated is None:
            return residuals
        errors = np.sqrt(np.einsum("ijj->ij", propagated(predicted, covariances))) / expected
        reach = (reach_of(learner, inputs) or (None,))[0]
        return replace(residuals, errors=errors[known], reach=reach, beyond=beyond[known])


def as_frame(table: Any) -> pd.DataFrame:
    """A frame of records, of which the index tells the times."""
    return table if isinstance(table, pd.DataFrame) else pd.DataFrame(as_floats(table), copy=False)
