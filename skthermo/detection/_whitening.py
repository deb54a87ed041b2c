"""Residuals in standard deviations, by the covariance that residuals have in each record's weather."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline

from skthermo._arrays import Array
from skthermo._weather import TrainingRange, nearest, weather_coordinates
from skthermo.detection._gaussian import Gaussian, check_invertible, patterns, whitenings
from skthermo.detection._local_covariance import ENTRIES, NEIGHBOURS, History, LocalCovariance, Smoothing, whitened

MOST = 5000
"""Largest number of baseline records, evenly spaced in time, that tell covariances by weather."""

BEYOND = 0.5
"""Each range of the baseline's temperatures that a record is beyond them adds an error of this many deviations."""


@dataclass(frozen=True)
class Spread:
    """Mean of residuals, and their covariance by weather.

    Attributes
    ----------
    overall : Gaussian
        Mean, and covariance in unknown weather.
    smoothing : Smoothing or None
        None if the covariance is the same in all weather.
    reach : TrainingRange or None
        Temperatures of the records behind it, beyond which residuals may be larger.
    coordinates : Pipeline
        Gives places to rows of weather.
    places : ndarray of shape (n_places, n_coordinates)
    covariances : ndarray of shape (n_places + 1, n_modes, n_modes)
        The last one is the overall covariance.
    """

    overall: Gaussian
    smoothing: Smoothing | None
    reach: TrainingRange | None
    coordinates: Pipeline | None
    places: Array
    covariances: Array

    @classmethod
    def of(cls, weather: Array, residuals: Array, size: Array, *, local: bool) -> tuple["Spread", Array]:
        """The spread that a baseline in order of time shows, and the whitened baseline itself.

        A baseline record is whitened by the others, without its neighbours in time. ``size`` holds magnitudes of the
        frequencies.
        """
        overall, learned = Gaussian.of(residuals), ~np.isnan(residuals).all(axis=1)
        check_invertible(overall.covariance, residuals, size)
        reach = TrainingRange.of(weather, learned) if local else None
        usable = np.flatnonzero(learned & ~np.isnan(weather).any(axis=1))
        plain = cls(overall, None, reach, None, np.empty((0, 1)), overall.covariance[np.newaxis])
        white = plain.whiten(weather, residuals)
        if not local or len(usable) < 2 * NEIGHBOURS[0]:
            return plain, white
        coordinates = weather_coordinates(weather[usable])
        places = coordinates.transform(weather[usable])
        told = np.linspace(0, len(usable) - 1, min(len(usable), MOST)).astype(int)
        history = History(usable[told], places[told], residuals[usable[told]], overall)
        smoothing = history.best_smoothing()
        if smoothing is None:
            return plain, white
        covariance = LocalCovariance(history, smoothing)
        step = max(ENTRIES // smoothing.n_neighbors, 1)
        for first in range(0, len(usable), step):
            block = usable[first : first + step]
            near = history.neighbours(smoothing.n_neighbors, places[first : first + step], order=block)
            white[block] = whitened(residuals[block], overall, covariance(near))[0]
        at_places = covariance(history.neighbours(smoothing.n_neighbors, history.places))
        covariances = np.concatenate([at_places, plain.covariances])
        return cls(overall, smoothing, reach, coordinates, history.places, covariances), white

    def deviations(self, weather: Array) -> Array:
        """Standard deviations of residuals in the weather of each row, (n_samples, n_modes)."""
        variances = np.einsum("ijj->ij", self.covariances)[self._place(np.asarray(weather, dtype=float))]
        return np.sqrt(variances) * self._widening(weather)[:, np.newaxis]

    def whiten(self, weather: Array, residuals: Array) -> Array:
        """Residuals of new records in standard deviations and uncorrelated."""
        white = np.empty_like(residuals)
        step = max(ENTRIES // residuals.shape[1] ** 2, 1)
        for first in range(0, len(residuals), step):
            rows = slice(first, first + step)
            white[rows] = self._whiten(weather[rows], residuals[rows])
        return white

    def _whiten(self, weather: Array, residuals: Array) -> Array:
        present = ~np.isnan(residuals)
        masks, pattern = patterns(present)
        cases, case = np.unique(self._place(weather) * len(masks) + pattern, return_inverse=True)
        roots = whitenings(self.covariances[cases // len(masks)], masks[cases % len(masks)])[0]
        white = np.einsum("ij,ijk->ik", self.overall.centred(residuals), roots[case])
        return np.where(present, white / self._widening(weather)[:, np.newaxis], np.nan)

    def _widening(self, weather: Array) -> Array:
        """Factor of the deviations where weather is beyond that of the baseline."""
        if self.reach is None:
            return np.ones(len(weather))
        varied = self.reach.highest > self.reach.lowest
        excess = np.nan_to_num(self.reach.excess(weather))[:, varied]
        return np.sqrt(1 + (BEYOND * excess.sum(axis=1) / max(varied.sum(), 1)) ** 2)

    def _place(self, weather: Array) -> NDArray[np.intp]:
        """The nearest place of every row; the overall covariance where a temperature is missing."""
        place = np.full(len(weather), len(self.covariances) - 1)
        known = ~np.isnan(weather).any(axis=1)
        if self.coordinates is not None and known.any():
            place[known] = nearest(self.places, self.coordinates.transform(weather[known]), 1)[1][:, 0]
        return place
