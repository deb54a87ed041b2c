"""Residuals in standard deviations, by the covariance that residuals have in each record's weather."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline

from skthermo._estimators.answers import answer_once
from skthermo._tables.arrays import Array, patterns, spread_evenly
from skthermo.residuals.extrapolation import Extrapolation
from skthermo.residuals.gaussian import (
    Gaussian,
    Whitenings,
    check_invertible,
    no_smaller,
    whitenings,
    whitenings_of,
)
from skthermo.residuals.local_covariance import CANDIDATES, NEAR_IN_TIME, History, Smoothing, whitened
from skthermo.residuals.weather import (
    FAR_OUTSIDE,
    NearestPlaces,
    PredictionError,
    TrainingRange,
    parts,
    weather_coordinates,
)

MOST_PLACES = 5000  # baseline records, evenly spaced in time, from which covariances by weather are learned
JITTER = 1e-12  # share of its variance that each mode has of its own, so that covariances have roots
FAMILIAR = 0.98  # share of the baseline records that are as close to others in weather as a familiar record is


@dataclass(frozen=True)
class WeatherCovariance:
    """Covariances at the places of the baseline's weather, each of which is taken for the weather around it.

    Records that are farther from the places than ``familiar``, or outside the ``trained`` range, get a covariance that
    is, to the extent that they are, no smaller than that of all weather: wholly at twice the distance, or far outside.
    Without ``trained``, none does.
    """

    coordinates: Pipeline
    places: Array
    covariances: Array
    smoothing: Smoothing
    familiar: float
    trained: TrainingRange | None = None

    def at(self, weather: Array, overall: Array) -> Array:
        """Covariances in the weather of rows, (n_rows, n_modes, n_modes)."""
        distances, near = self._searched.of(self.coordinates.transform(weather))
        return self.floored(self.covariances[near[:, 0]], weather, distances, overall)

    @cached_property
    def _searched(self) -> NearestPlaces:
        return NearestPlaces(self.places, self.smoothing.n_neighbors)

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
        by_weather = WeatherCovariance(coordinates, places, local.at(), local.smoothing, familiar, trained)
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
            volumes[rows] = -0.5 * roots.log_determinants
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
        moved = np.einsum("ij,ijk->ik", self.overall.centred(residuals[rows]), shrinkages) + self.overall.mean
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
        errors = errors or PredictionError.none()
        for rows in parts(len(weather), 2 * self.overall.covariance.size):
            some, here = (weather[rows], present[rows]), errors.of_part(rows)
            size = self.overall.covariance.size * len(some[0])
            asked = *some, here.rows, here.covariances
            yield rows, answer_once(self, asked, size, partial(self._whitenings, *some, here))

    def _whitenings(self, weather: Array, present: NDArray[np.bool_], errors: PredictionError) -> Whitenings:
        if self.by_weather is None and self.extrapolation is None and not len(errors.rows):
            return whitenings_of(self.overall.covariance[np.newaxis], np.zeros(len(weather), dtype=np.intp), present)
        covariances = self.covariances(weather)
        covariances[errors.rows] += errors.covariances
        return whitenings_of(covariances, np.arange(len(covariances)), present)


def without_errors(residuals: Array, errors: PredictionError) -> Gaussian:
    """Distribution of what residuals are without the errors of predictions that are known of each row."""
    return Gaussian.of(residuals, errors.of_all(*residuals.shape) if len(errors.rows) else None)
