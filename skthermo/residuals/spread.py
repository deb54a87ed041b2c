"""Residuals in standard deviations, by the covariance that residuals have in each record's weather."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline

from skthermo._tables.arrays import Array, patterns, spread_evenly
from skthermo.residuals.gaussian import Gaussian, check_invertible, log_determinants, whiten_by, whitenings
from skthermo.residuals.local_covariance import (
    CANDIDATES,
    NEAR_IN_TIME,
    History,
    Smoothing,
    whitened,
)
from skthermo.residuals.weather import PredictionError, TrainingRange, nearest, parts, weather_coordinates

MOST_PLACES = 5000  # baseline records, evenly spaced in time, from which covariances by weather are learned
JITTER = 1e-12  # share of its variance that each mode has of its own, so that covariances have roots
ERROR_PER_RANGE = 0.5  # standard deviations for each range of the baseline's temperatures that a record is beyond them


@dataclass(frozen=True)
class Spread:
    """Mean of residuals, and their covariance by weather.

    ``covariances`` are those at the ``places`` of the baseline's weather; the last one is the overall covariance, for
    unknown weather. ``smoothing`` says how closely they follow it. Beyond the ``reach`` of the baseline's temperatures
    residuals may be larger.
    """

    overall: Gaussian
    covariances: Array
    reach: TrainingRange | None
    smoothing: Smoothing | None = None
    coordinates: Pipeline | None = None
    places: Array | None = None

    @classmethod
    def of_all(cls, residuals: Array, errors: PredictionError) -> Spread:
        """That of residuals which are not scaled; a mode without any has no spread."""
        empty = np.isnan(residuals).all(axis=0)
        overall = without_errors(np.where(empty, 0.0, residuals), errors)
        overall.covariance[empty], overall.covariance[:, empty] = 0.0, 0.0
        return cls(overall, overall.covariance[np.newaxis], None)

    @classmethod
    def of(
        cls,
        weather: Array,
        residuals: Array,
        size: Array,
        errors: PredictionError,
        *,
        local: bool,
        widens: bool,
        near: int = NEAR_IN_TIME,
    ) -> tuple[Spread, Array]:
        """Learn from a baseline in order of time; whiten each of its records by others, which are not near in time.

        ``size`` holds magnitudes of the frequencies, ``errors`` what is known of those of predictions. With ``widens``,
        a local spread is wider beyond the baseline's temperatures.
        """
        overall, learned = without_errors(residuals, errors), ~np.isnan(residuals).all(axis=1)
        check_invertible(overall.covariance, residuals, size)
        reach = TrainingRange.of(weather, learned) if local and widens else None
        plain = cls(overall, overall.covariance[np.newaxis], reach)
        residuals = plain.shrunk(residuals, errors)
        white = plain.whiten(weather, residuals)
        usable = np.flatnonzero(learned & ~np.isnan(weather).any(axis=1))
        if not local or len(usable) < 2 * CANDIDATES[0].n_neighbors:
            return plain, white
        coordinates = weather_coordinates(weather[usable])
        chosen = spread_evenly(usable, MOST_PLACES)
        places = coordinates.transform(weather[chosen])
        covariance = History(chosen, places, residuals[chosen], overall, near).likeliest()
        if covariance is None:
            return plain, white
        for part in parts(len(usable), covariance.numbers_per_record):
            block = usable[part]
            by_others = covariance.at(coordinates.transform(weather[block]), order=block)
            white[block] = whitened(residuals[block], overall, by_others)[0]
        covariances = np.concatenate([covariance.at(), plain.covariances])
        return cls(overall, covariances, reach, covariance.smoothing, coordinates, places), white

    def deviations(self, weather: Array) -> Array:
        """Standard deviations of residuals in the weather of each row, (n_samples, n_modes)."""
        variances = np.einsum("ijj->ij", self.covariances)[self._place(np.asarray(weather, dtype=float))]
        return np.sqrt(variances) * self._widening(weather)[:, np.newaxis]

    def whiten(self, weather: Array, residuals: Array, errors: PredictionError | None = None) -> Array:
        """Residuals of new records in standard deviations and uncorrelated, wider where predictions have errors."""
        white = np.empty_like(residuals)
        for rows in parts(len(residuals), residuals.shape[1] ** 2):
            by_place = whiten_by(self.covariances, self._place(weather[rows]), residuals[rows] - self.overall.mean)
            white[rows] = by_place / self._widening(weather[rows])[:, np.newaxis]
        if errors is None:
            return white
        for rows, covariances in self._in_error(errors):
            wider = self.covariances[self._place(weather[rows])] + covariances
            by_row = whitened(residuals[rows], self.overall, wider)[0]
            white[rows] = by_row / self._widening(weather[rows])[:, np.newaxis]
        return white

    def log_volumes(self, weather: Array, residuals: Array, errors: PredictionError) -> Array:
        """Logarithms of the factors by which `whiten` changes the volume of each row's values."""
        volumes, present = np.zeros(len(residuals)), ~np.isnan(residuals)
        for rows in parts(len(residuals), residuals.shape[1] ** 2):
            volumes[rows] = log_determinants(self.covariances, self._place(weather[rows]), present[rows])
        for rows, covariances in self._in_error(errors):
            wider = self.covariances[self._place(weather[rows])] + covariances
            volumes[rows] = whitenings(wider, present[rows])[1]
        return -0.5 * volumes - present.sum(axis=1) * np.log(self._widening(weather))

    def shrunk(self, residuals: Array, errors: PredictionError) -> Array:
        """Residuals with the overall covariance also where errors of predictions add to it; NaN without any."""
        covariance, again = self.overall.covariance, residuals.copy()
        varied = np.diag(covariance) > 0
        covariance = covariance + np.diag(np.where(varied, JITTER * np.diag(covariance), 1.0))
        for rows, covariances in self._in_error(errors):
            few = np.where(varied, residuals[rows], np.nan)
            white = whitened(few, self.overall, covariance + covariances)[0]
            masks, of_row = patterns(~np.isnan(few))
            present = masks[:, :, np.newaxis] & masks[:, np.newaxis, :]
            roots = np.linalg.inv(whitenings(covariance, masks)[0] + np.eye(len(varied)) * ~masks[:, np.newaxis, :])
            back = np.einsum("ij,ijk->ik", np.nan_to_num(white), np.where(present, roots, 0.0)[of_row])
            again[rows] = np.where(np.isnan(few), np.nan, back + self.overall.mean)
        return again

    def _in_error(self, errors: PredictionError) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Rows whose predictions have errors, and the covariances of these, some after others: memory is bounded."""
        for part in parts(len(errors.rows), len(self.overall.mean) ** 2):
            yield errors.rows[part], errors.covariances[part]

    def _widening(self, weather: Array) -> Array:
        """Factor of the deviations where weather is beyond that of the baseline."""
        if self.reach is None:
            return np.ones(len(weather))
        varied = self.reach.highest > self.reach.lowest
        excess = np.nan_to_num(self.reach.excess(weather))[:, varied]
        return np.sqrt(1 + (ERROR_PER_RANGE * excess.sum(axis=1) / max(varied.sum(), 1)) ** 2)

    def _place(self, weather: Array) -> NDArray[np.intp]:
        """The nearest place of every row; the overall covariance where a temperature is missing."""
        place = np.full(len(weather), len(self.covariances) - 1)
        known = ~np.isnan(weather).any(axis=1)
        if self.places is not None and known.any():
            place[known] = nearest(self.places, self.coordinates.transform(weather[known]), 1)[1][:, 0]
        return place


def without_errors(residuals: Array, errors: PredictionError) -> Gaussian:
    """Distribution of what residuals are without the errors of predictions that are known of each row."""
    return Gaussian.of(residuals, errors.of_all(*residuals.shape) if len(errors.rows) else None)
