"""Residuals in standard deviations, by the covariance that residuals have in each record's weather."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline

from skthermo._arrays import Array
from skthermo._weather import TrainingRange, nearest, weather_coordinates
from skthermo.detection._gaussian import Gaussian, check_invertible, patterns, whitenings

NEIGHBOURS = (50, 100, 200, 400, 800)
PSEUDO_ROWS = (5, 15, 50)
"""Candidates: records of similar weather that give a covariance, and the weight of that of all records beside them."""

MOST_PLACES = 5000
"""Largest number of baseline records around which a covariance is computed, or by which the smoothing is chosen."""

NEAR_IN_TIME = 24
"""Baseline records fewer than this many rows apart, a day of hourly ones, do not whiten each other."""

BEYOND = 0.5
"""Each range of the baseline's temperatures that a record is beyond them adds an error of this many deviations."""

ENTRIES = 4_000_000
"""Numbers that are held in memory at a time."""


@dataclass(frozen=True)
class Smoothing:
    """How a covariance follows the weather: over how many similar records, and how strongly drawn to that of all."""

    n_neighbors: int
    n_pseudo: int


@dataclass(frozen=True)
class Spread:
    """Mean of residuals, and their covariance by weather.

    Attributes
    ----------
    overall : Gaussian
        Mean, and covariance in unknown weather.
    smoothing : Smoothing or None
        None if the covariance is the same in all weather.
    reach : TrainingRange
        Temperatures of the records behind it.
    coordinates : Pipeline
        Gives places to rows of weather.
    places : ndarray of shape (n_places, n_coordinates)
    covariances : ndarray of shape (n_places + 1, n_modes, n_modes)
        The last one is the overall covariance.
    """

    overall: Gaussian
    smoothing: Smoothing | None
    reach: TrainingRange
    coordinates: Pipeline | None
    places: Array
    covariances: Array

    @classmethod
    def of(cls, weather: Array, residuals: Array, *, local: bool) -> tuple["Spread", Array]:
        """The spread that a baseline in order of time shows, and the whitened baseline itself.

        A baseline record is whitened by the others, without its neighbours in time.
        """
        overall, learned = Gaussian.of(residuals), ~np.isnan(residuals).all(axis=1)
        check_invertible(overall.covariance, residuals)
        reach = TrainingRange.of(weather, learned)
        usable = np.flatnonzero(learned & ~np.isnan(weather).any(axis=1))
        plain = cls(overall, None, reach, None, np.empty((0, 1)), overall.covariance[np.newaxis])
        white = plain.whiten(weather, residuals)
        if not local or len(usable) < 2 * NEIGHBOURS[0]:
            return plain, white
        coordinates = weather_coordinates(weather[usable])
        history = History(usable, coordinates.transform(weather[usable]), overall, residuals[usable])
        smoothing = history.best_smoothing()
        if smoothing is None:
            return plain, white
        white[usable] = history.whitened(np.arange(len(usable)), smoothing)[0]
        places = history.places[_spread_over(len(usable))]
        covariances = np.concatenate([history.covariances(places, smoothing), plain.covariances])
        return cls(overall, smoothing, reach, coordinates, places, covariances), white

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
        beyond = np.nan_to_num(self.reach.excess(weather)).mean(axis=1)
        white = np.einsum("ij,ijk->ik", self.overall.centred(residuals), roots[case])
        return np.where(present, white / np.sqrt(1 + (BEYOND * beyond[:, np.newaxis]) ** 2), np.nan)

    def _place(self, weather: Array) -> NDArray[np.intp]:
        """The nearest place of every row; the overall covariance where a temperature is missing."""
        place = np.full(len(weather), len(self.covariances) - 1)
        known = ~np.isnan(weather).any(axis=1)
        if self.coordinates is not None and known.any():
            place[known] = nearest(self.places, self.coordinates.transform(weather[known]), 1)[1][:, 0]
        return place


@dataclass(frozen=True)
class History:
    """Baseline records of known weather in order of time.

    Attributes
    ----------
    order : ndarray of shape (n_records,)
        Positions in the baseline.
    places : ndarray of shape (n_records, n_coordinates)
        The weather.
    overall : Gaussian
        Of all residuals.
    residuals : ndarray of shape (n_records, n_modes)
    """

    order: NDArray[np.intp]
    places: Array
    overall: Gaussian
    residuals: Array

    def best_smoothing(self) -> Smoothing | None:
        """The smoothing, or none, under which records are likeliest given the others."""
        rows = _spread_over(len(self.order))
        n_neighbors = [k for k in NEIGHBOURS if k <= len(self.order) // 2]
        candidates = [None, *(Smoothing(k, pseudo) for k in n_neighbors for pseudo in PSEUDO_ROWS)]
        return max(candidates, key=lambda smoothing: self.whitened(rows, smoothing)[1])

    def whitened(self, rows: NDArray[np.intp], smoothing: Smoothing | None) -> tuple[Array, float]:
        """Records whitened by the others without their neighbours in time, and their log-likelihood."""
        white, likelihood = np.empty((len(rows), self.residuals.shape[1])), 0.0
        step = max(ENTRIES // white.shape[1] ** 2, 1)
        for first in range(0, len(rows), step):
            block = rows[first : first + step]
            present = ~np.isnan(self.residuals[block])
            covariances = self.overall.covariance[np.newaxis]
            if smoothing is not None:
                covariances = self.covariances(self.places[block], smoothing, self.order[block])
            roots, log_determinants = whitenings(covariances, present)
            block_white = np.einsum("ij,ijk->ik", self.overall.centred(self.residuals[block]), roots)
            likelihood -= 0.5 * float((block_white**2).sum() + log_determinants.sum())
            white[first : first + step] = np.where(present, block_white, np.nan)
        return white, likelihood

    def covariances(self, places: Array, smoothing: Smoothing, order: NDArray[np.intp] | None = None) -> Array:
        """Mean second moments of the records nearest to each place, drawn to the overall covariance.

        Records near ``order`` in time are left out.
        """
        size, pseudo, overall = smoothing.n_neighbors, smoothing.n_pseudo, self.overall.covariance
        n_asked = size if order is None else size + 2 * NEAR_IN_TIME - 1
        means = np.empty((len(places), *overall.shape))
        step = max(ENTRIES // (n_asked * overall.size), 1)
        for first in range(0, len(places), step):
            block = slice(first, first + step)
            near = nearest(self.places, places[block], n_asked)[1]
            counted = np.ones(near.shape, dtype=bool)
            if order is not None:
                counted = np.abs(self.order[near] - order[block, np.newaxis]) >= NEAR_IN_TIME
                counted &= counted.cumsum(axis=1) <= size
            sums = np.einsum("ij,ijkl->ikl", counted, self._moments[near])
            means[block] = (sums + pseudo * overall) / (counted.sum(axis=1)[:, np.newaxis, np.newaxis] + pseudo)
        return means

    @cached_property
    def _moments(self) -> Array:
        return self.overall.second_moments(self.residuals)


def _spread_over(n_rows: int) -> NDArray[np.intp]:
    return np.linspace(0, n_rows - 1, min(n_rows, MOST_PLACES)).astype(int)
