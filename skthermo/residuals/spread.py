"""Covariance of residuals by weather, learned from similar records and wider beyond what they show."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline

from skthermo._core.answers import answer_once
from skthermo._core.arrays import Array, patterns, spread_evenly
from skthermo._core.frames import DAY_NS, has_stamps, row_times
from skthermo.residuals.gaussian import (
    Gaussian,
    Mask,
    Whitenings,
    check_invertible,
    no_smaller,
    whitenings,
)
from skthermo.residuals.weather import (
    FAR_OUTSIDE,
    NO_ERRORS,
    NearestPlaces,
    PredictionError,
    TrainingRange,
    nearest,
    parts,
    weather_coordinates,
)

SHARE = 0.2  # of the records at each end of the weather, which are predicted from the others
USUAL, PRIOR = 9.0, 0.1  # growth that is assumed before an end shows its own, and its weight
FEWEST = 40  # records, of which a fifth shows how predictions err at an end
NEAR_IN_TIME = 24  # rows, a day of hourly ones: the covariance of a record is learned from records at least so far away
MOST_PLACES = 5000  # baseline records, evenly spaced in time, from which covariances by weather are learned
JITTER = 1e-12  # share of its variance that each mode has of its own, so that covariances have roots
FAMILIAR = 0.98  # share of the baseline records that are as close to others in weather as a familiar record is


@dataclass(frozen=True)
class Spread:
    """Mean of residuals and their covariance, by weather where it is known, and wider beyond that of the baseline."""

    overall: Gaussian
    by_weather: WeatherCovariance | None = None
    extrapolation: Extrapolation | None = None

    @classmethod
    def of_all(cls, residuals: Array, errors: PredictionError) -> Spread:
        """That of residuals which are not scaled; a mode without any has no spread."""
        empty = np.isnan(residuals).all(axis=0)
        overall = without_errors(np.where(empty, 0.0, residuals), errors)
        overall.covariance[empty], overall.covariance[:, empty] = 0.0, 0.0
        return cls(overall)

    @classmethod
    def of(cls, residuals: Array, size: Array, errors: PredictionError) -> Spread:
        """The same covariance in all weather; ``size`` holds magnitudes of the frequencies."""
        overall = without_errors(residuals, errors)
        check_invertible(overall.covariance, residuals, size)
        return cls(overall)

    def followed(
        self, weather: Array, residuals: Array, errors: PredictionError, *, floor: bool, near: int = NEAR_IN_TIME
    ) -> tuple[Spread, Array]:
        """Let the covariance follow the weather where it makes a baseline in order of time likelier.

        Also gives the whitened residuals of the baseline, each by records that are not near in time. With a ``floor``,
        the covariance is no smaller than that of all weather where the baseline has no similar weather.
        """
        residuals = self.shrunk(residuals, errors)
        white = self.whiten(weather, residuals)
        usable = np.flatnonzero(~np.isnan(residuals).all(axis=1) & ~np.isnan(weather).any(axis=1))
        if len(usable) < 2 * CANDIDATES[0].n_neighbors:
            return self, white
        coordinates, chosen = weather_coordinates(weather[usable]), spread_evenly(usable, MOST_PLACES)
        places = coordinates.transform(weather[chosen])
        local = History(chosen, places, residuals[chosen], self.overall, near).likeliest()
        if local is None:
            return self, white
        familiar = float(np.quantile(local.distances(order=chosen), FAMILIAR))
        trained = TrainingRange.of(weather, usable) if floor else None
        searched = NearestPlaces(places, local.smoothing.n_neighbors)
        by_weather = WeatherCovariance(coordinates, searched, local.at(), local.smoothing, familiar, trained)
        for part in parts(len(usable), local.numbers_per_record):
            block = usable[part]
            here = coordinates.transform(weather[block])
            by_others, distances = local.at(here, order=block), local.distances(here, order=block)
            by_others = by_weather.floored(by_others, weather[block], distances, self.overall.covariance)
            white[block] = whitened(residuals[block], self.overall, by_others)[0]
        return replace(self, by_weather=by_weather), white

    @property
    def smoothing(self) -> Smoothing | None:
        """Over how many records of similar weather covariances are taken; None if over all."""
        return None if self.by_weather is None else self.by_weather.smoothing

    def covariances(self, weather: Array) -> Array:
        """Covariances of residuals in the weather of each row, (n_samples, n_modes, n_modes)."""
        overall, known = self.overall.covariance, ~np.isnan(weather).any(axis=1)
        covariances = np.repeat(overall[np.newaxis], len(weather), axis=0)
        if self.by_weather is not None and known.any():
            covariances[known] = self.by_weather.at(weather[known], overall)
        if self.extrapolation is not None:
            covariances += self.extrapolation.shares(weather)[:, np.newaxis, np.newaxis] * overall
        return covariances

    def deviations(self, weather: Array) -> Array:
        """Standard deviations of residuals in the weather of each row, (n_samples, n_modes)."""
        return np.sqrt(np.einsum("ijj->ij", self.covariances(np.asarray(weather, dtype=float))))

    def whiten(self, weather: Array, residuals: Array, errors: PredictionError | None = None) -> Array:
        """Residuals of new records in standard deviations and uncorrelated, wider where predictions have errors."""
        white = np.empty_like(residuals)
        for rows, roots in self._in_parts(weather, ~np.isnan(residuals), errors):
            white[rows] = roots.white(residuals[rows] - self.overall.mean)
        return white

    def log_volumes(self, weather: Array, residuals: Array, errors: PredictionError) -> Array:
        """Logarithms of the factors by which `whiten` changes the volume of each row's values."""
        volumes = np.zeros(len(residuals))
        for rows, roots in self._in_parts(weather, ~np.isnan(residuals), errors):
            volumes[rows] = -0.5 * roots.logarithms[roots.pair]
        return volumes

    def roots(
        self, weather: Array, present: NDArray[np.bool_], errors: PredictionError
    ) -> tuple[Array, NDArray[np.intp]]:
        """What `whiten` multiplies rows by, (n_roots, n_modes, n_modes), and which of them is that of each row."""
        found, which, n_roots = [np.empty((0, *self.overall.covariance.shape))], np.empty(len(weather), np.intp), 0
        for rows, some in self._in_parts(weather, present, errors):
            found.append(some.roots)
            which[rows] = some.pair + n_roots
            n_roots += len(some.roots)
        return np.concatenate(found), which

    def shrunk(self, residuals: Array, errors: PredictionError) -> Array:
        """Residuals with the overall covariance also where errors of predictions add to it; NaN without any."""
        again, rows = residuals.copy(), errors.rows
        known = ~np.isnan(residuals[rows]) & (np.diag(self.overall.covariance) > 0)
        shrinkages = self.shrinkages(~np.isnan(residuals), errors)
        moved = (
            np.einsum("ij,ijk->ik", np.nan_to_num(residuals[rows] - self.overall.mean), shrinkages) + self.overall.mean
        )
        again[rows] = np.where(known, moved, np.nan)
        return again

    def shrinkages(self, present: NDArray[np.bool_], errors: PredictionError) -> Array:
        """What `shrunk` multiplies centred rows by, (n_errors, n_modes, n_modes)."""
        covariance = self.overall.covariance
        varied = np.diag(covariance) > 0
        covariance = covariance + np.diag(np.where(varied, JITTER * np.diag(covariance), 1.0))
        found = [np.empty((0, *covariance.shape))]
        for part in parts(len(errors.rows), covariance.size):
            masks = present[errors.rows[part]] & varied
            few, of_row = patterns(masks)
            both = few[:, :, np.newaxis] & few[:, np.newaxis, :]
            back = np.linalg.inv(whitenings(covariance, few)[0] + np.eye(len(varied)) * ~few[:, np.newaxis, :])
            wide = whitenings(covariance + errors.covariances[part], masks)[0]
            found.append(wide @ np.where(both, back, 0.0)[of_row])
        return np.concatenate(found)

    def _in_parts(
        self, weather: Array, present: NDArray[np.bool_], errors: PredictionError | None
    ) -> Iterator[tuple[slice, Whitenings]]:
        """Some rows after others, with their whitenings: memory is bounded."""
        errors = errors or NO_ERRORS
        for rows in parts(len(weather), 2 * self.overall.covariance.size):
            some, here = (weather[rows], present[rows]), errors.of_part(rows)
            size = self.overall.covariance.size * len(some[0])
            asked = *some, here.rows, here.covariances
            yield rows, answer_once(self, asked, size, partial(self._whitenings, *some, here))

    def _whitenings(self, weather: Array, present: NDArray[np.bool_], errors: PredictionError) -> Whitenings:
        if self.by_weather is None and self.extrapolation is None and not len(errors.rows):
            return Whitenings.of(self.overall.covariance[np.newaxis], np.zeros(len(weather), dtype=np.intp), present)
        covariances = self.covariances(weather)
        covariances[errors.rows] += errors.covariances
        return Whitenings.of(covariances, np.arange(len(covariances)), present)


def without_errors(residuals: Array, errors: PredictionError) -> Gaussian:
    """Distribution of what residuals are without the errors of predictions that are known of each row."""
    return Gaussian.fitted(residuals, errors.of_all(*residuals.shape) if len(errors.rows) else None)


@dataclass(frozen=True)
class WeatherCovariance:
    """Covariances at the places of the baseline's weather, each of which is taken for the weather around it.

    Records that are farther from the places than ``familiar``, or outside the ``trained`` range, get a covariance that
    is, to the extent that they are, no smaller than that of all weather: wholly at twice the distance, or far outside.
    Without ``trained``, none does.
    """

    coordinates: Pipeline
    nearest: NearestPlaces
    covariances: Array
    smoothing: Smoothing
    familiar: float
    trained: TrainingRange | None = None

    def at(self, weather: Array, overall: Array) -> Array:
        """Covariances in the weather of rows, (n_rows, n_modes, n_modes)."""
        distances, near = self.nearest.of(self.coordinates.transform(weather))
        return self.floored(self.covariances[near[:, 0]], weather, distances, overall)

    def floored(self, covariances: Array, weather: Array, distances: Array, overall: Array) -> Array:
        """Covariances of rows at mean distances from the places nearest to them, no smaller in unknown weather."""
        if self.trained is None:
            return covariances
        outside = self.trained.excess(weather).max(axis=1) / FAR_OUTSIDE
        unknown = np.clip(np.maximum(distances / self.familiar - 1, outside), 0, 1)[:, np.newaxis, np.newaxis]
        rows = np.flatnonzero(unknown)
        floored = covariances.copy()
        floored[rows] += unknown[rows] * (no_smaller(covariances[rows], overall) - covariances[rows])
        return floored


@dataclass(frozen=True)
class History:
    """Residuals of records at positions in time and places in weather, and the distribution of all residuals.

    Records fewer than ``near`` positions apart do not tell each other's covariance.
    """

    order: NDArray[np.intp]
    places: Array
    residuals: Array
    overall: Gaussian
    near: int = NEAR_IN_TIME

    def neighbours(self, size: int, places: Array | None = None, order: NDArray[np.intp] | None = None) -> Neighbours:
        """The records nearest to each place, by default that of each record, without those near ``order`` in time."""
        number = size if order is None else size + self.most_near
        of_own = (part[:, :number] for part in self._nearest)
        distances, near = of_own if places is None else nearest(self.places, places, number)
        if order is None:
            return Neighbours(near, np.ones(near.shape, dtype=bool), distances)
        far = np.abs(self.order[near] - order[:, np.newaxis]) >= self.near
        return Neighbours(near, far & (far.cumsum(axis=1) <= size), distances)

    @cached_property
    def _nearest(self) -> tuple[Array, NDArray[np.intp]]:
        """Distances and positions of the records nearest to each record, as many as any candidate asks for."""
        most = max(one.n_neighbors for one in self._candidates)
        return nearest(self.places, self.places, most + self.most_near)

    @property
    def _candidates(self) -> list[Smoothing]:
        return [one for one in CANDIDATES if one.n_neighbors <= len(self.order) // 2]

    @cached_property
    def most_near(self) -> int:
        """The most records that may be near one in time."""
        return int((np.searchsorted(self.order, self.order + 2 * self.near - 1) - np.arange(len(self.order))).max())

    def likeliest(self) -> LocalCovariance | None:
        """The covariance by weather, or none, under which records are likeliest given the others."""
        candidates = [LocalCovariance(self, one) for one in self._candidates]
        plain = whitened(self.residuals, self.overall, self.overall.covariance[np.newaxis])[1]
        likelihoods = [plain, *(candidate.likelihood() for candidate in candidates)]
        return [None, *candidates][int(np.argmax(likelihoods))]


def rows_near_in_time(X: Any) -> int:
    """Number of records in a day, if they have stamps and are more than hourly."""
    if not has_stamps(X) or len(X) < 2:
        return NEAR_IN_TIME
    step = np.median(np.diff(np.sort(row_times(X))))
    return int(np.clip(DAY_NS / max(step, 1.0), NEAR_IN_TIME, max(NEAR_IN_TIME, len(X) // 20)))


@dataclass(frozen=True)
class LocalCovariance:
    """Covariance at places in weather, as the records of the most similar weather show it.

    Standard deviations come from the modes that records have, correlations from records completed by the correlation
    in all weather.
    """

    history: History
    smoothing: Smoothing

    def __call__(self, neighbours: Neighbours) -> Array:
        """Covariances that the neighbours of each place show."""
        rows, standard = self._standard
        correlation = self._mean(standard.second_moments(rows), standard.covariance, neighbours)
        scale = np.sqrt(self._variances(neighbours) / np.einsum("ijj->ij", correlation))
        return scale[:, :, np.newaxis] * correlation * scale[:, np.newaxis, :]

    def at(self, places: Array | None = None, order: NDArray[np.intp] | None = None) -> Array:
        """Covariances at places, by default those of the records, without the records near ``order`` in time."""
        return self(self.history.neighbours(self.smoothing.n_neighbors, places, order))

    def distances(self, places: Array | None = None, order: NDArray[np.intp] | None = None) -> Array:
        """Mean distances of places from the records that covariances `at` them are taken from."""
        return self.history.neighbours(self.smoothing.n_neighbors, places, order).mean_distances

    @property
    def numbers_per_record(self) -> int:
        """How many numbers `at` holds in memory for each place."""
        return self.smoothing.n_neighbors + self.history.most_near + self.history.overall.covariance.size

    def likelihood(self) -> float:
        """Log-likelihood of the records, each given the others."""
        return whitened(self.history.residuals, self.history.overall, self(self._own))[1]

    @cached_property
    def _own(self) -> Neighbours:
        return self.history.neighbours(self.smoothing.n_neighbors, order=self.history.order)

    @cached_property
    def _standard(self) -> tuple[Array, Gaussian]:
        """Records over the standard deviations in their own weather, and their distribution."""
        rows = (self.history.residuals - self.history.overall.mean) / np.sqrt(self._variances(self._own))
        return rows, Gaussian.fitted(rows)

    def _variances(self, neighbours: Neighbours) -> Array:
        overall = self.history.overall
        return self._mean((self.history.residuals - overall.mean) ** 2, np.diag(overall.covariance), neighbours)

    def _mean(self, values: Array, prior: Array, neighbours: Neighbours) -> Array:
        """Mean of the neighbours' values, NaN left out, and of pseudo-rows that have the prior's."""
        known, filled = ~np.isnan(values).reshape(len(values), -1), np.nan_to_num(values).reshape(len(values), -1)
        weights, pseudo = neighbours.weights(len(values)), self.smoothing.n_pseudo
        counts = weights @ (np.ones((len(values), 1)) if known.all() else known.astype(float))
        means = (weights @ filled + pseudo * prior.ravel()) / (counts + pseudo)
        return means.reshape(-1, *prior.shape)


def whitened(residuals: Array, overall: Gaussian, covariances: Array) -> tuple[Array, float]:
    """Residuals in standard deviations and uncorrelated, by a covariance each, and their log-likelihood."""
    present = ~np.isnan(residuals)
    roots, log_determinants = whitenings(covariances, present)
    white = np.einsum("ij,ijk->ik", np.nan_to_num(residuals - overall.mean), roots)
    return np.where(present, white, np.nan), -0.5 * float((white**2).sum() + log_determinants.sum())


@dataclass(frozen=True)
class Neighbours:
    """Records nearest to some places in weather, and which of them count."""

    rows: NDArray[np.intp]
    counted: Mask
    distances: Array

    @property
    def mean_distances(self) -> Array:
        """Mean distance from each place of the records that count."""
        return np.where(self.counted, self.distances, 0.0).sum(axis=1) / np.maximum(self.counted.sum(axis=1), 1)

    def weights(self, n_records: int) -> scipy.sparse.csr_array:
        """A row for each place: 1 at the records that count, else 0."""
        rows, ends = self.rows[self.counted], np.append(0, self.counted.sum(axis=1).cumsum())
        return scipy.sparse.csr_array((np.ones(len(rows)), rows, ends), (len(self.rows), n_records))


class Smoothing(NamedTuple):
    """Over how many records of similar weather a covariance is taken, and as how many that of all records counts."""

    n_neighbors: int
    n_pseudo: int


# The more records, the more the covariance of all may count.
PAIRS = ((50, 5), (50, 15), (100, 5), (100, 15), (200, 15), (200, 50), (400, 50))
CANDIDATES = tuple(Smoothing(*pair) for pair in PAIRS)


@dataclass(frozen=True)
class Extrapolation:
    """Variance of predictions outside the weather that they learned from, in shares of that of the residuals.

    Where a column is e ranges below the lowest value of the baseline, or above the highest, the share is ``growth *
    log(1 + e^2)``: the column that is farthest outside counts, and each end has a growth of its own.
    """

    trained: TrainingRange
    growth: Array

    @classmethod
    def of(cls, weather: Array, overall: Gaussian, residuals_of: Callable[[NDArray[np.bool_]], Array]) -> Extrapolation:
        """Learned from the coldest and from the warmest fifth of some records, each predicted from the other records.

        ``residuals_of`` gives the residuals of the records of a mask, predicted from all others; the growth at an end
        is the ratio of what these exceed ``overall`` by to what a growth of 1 would give.
        """
        everywhere = TrainingRange.of(weather, slice(None))
        width = np.where(everywhere.highest > everywhere.lowest, everywhere.highest - everywhere.lowest, 1.0)
        warmth, growth = np.mean((weather - everywhere.lowest) / width, axis=1), np.full(2, USUAL)
        for end, along in enumerate((-warmth, warmth)):
            apart = along > np.nanquantile(along, 1 - SHARE)
            if not apart.any():
                continue
            distance = _outside(TrainingRange.of(weather, ~apart), weather[apart])[:, end]
            residuals = residuals_of(apart)
            counts = (~np.isnan(residuals)).sum(axis=1)
            excess = np.nansum(overall.whiten(residuals) ** 2, axis=1) - counts
            expected = distance @ (counts * np.log1p(distance**2))
            growth[end] = max((distance @ excess + PRIOR * USUAL) / (expected + PRIOR), 0.0)
        return cls(everywhere, growth)

    def shares(self, weather: Array) -> Array:
        """Variance of the predictions in the weather of each row over that of the residuals; NaN counts as inside."""
        return np.log1p(_outside(self.trained, weather) ** 2) @ self.growth


def _outside(trained: TrainingRange, weather: Array) -> Array:
    """How far each row is below and above a range, by its farthest column, in units of that of the column."""
    excess = np.nan_to_num(trained.excess(weather))
    below, above = np.where(weather < trained.lowest, excess, 0.0), np.where(weather > trained.highest, excess, 0.0)
    return np.column_stack([below.max(axis=1), above.max(axis=1)])
