"""Covariance of residuals in similar weather."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo._tables.frames import DAY_NS, has_stamps, row_times
from skthermo.residuals.gaussian import Gaussian, Mask, whitenings
from skthermo.residuals.weather import nearest

NEAR_IN_TIME = 24  # rows, a day of hourly ones: the covariance of a record is learned from records at least so far away


class Smoothing(NamedTuple):
    """Over how many records of similar weather a covariance is taken, and as how many that of all records counts."""

    n_neighbors: int
    n_pseudo: int


# The more records, the more the covariance of all may count.
PAIRS = ((50, 5), (50, 15), (100, 5), (100, 15), (200, 15), (200, 50), (400, 50))
CANDIDATES = tuple(Smoothing(*pair) for pair in PAIRS)


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
        return rows, Gaussian.of(rows)

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
    white = np.einsum("ij,ijk->ik", overall.centred(residuals), roots)
    return np.where(present, white, np.nan), -0.5 * float((white**2).sum() + log_determinants.sum())
