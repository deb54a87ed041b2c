"""Covariance of residuals in similar weather."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo._weather import nearest
from skthermo.detection._gaussian import Gaussian, Mask, whitenings

NEIGHBOURS = (50, 100, 200, 400, 800)
PSEUDO_ROWS = (5, 15, 50)
"""Candidates: records of similar weather that give a covariance, and the weight of that of all records beside them."""

NEAR_IN_TIME = 24
"""Records fewer than this many rows apart, a day of hourly ones, do not tell each other's covariance."""

ENTRIES = 4_000_000
"""Numbers that are held in memory at a time."""


@dataclass(frozen=True)
class Smoothing:
    """How a covariance follows the weather: over how many similar records, and how strongly drawn to that of all."""

    n_neighbors: int
    n_pseudo: int


@dataclass(frozen=True)
class Neighbours:
    """Records nearest to some places in weather, and which of them count."""

    rows: NDArray[np.intp]
    counted: Mask


@dataclass(frozen=True)
class History:
    """Records of known weather in order of time.

    Attributes
    ----------
    order : ndarray of shape (n_records,)
        Positions in time.
    places : ndarray of shape (n_records, n_coordinates)
        The weather.
    residuals : ndarray of shape (n_records, n_modes)
    overall : Gaussian
        Of all residuals.
    """

    order: NDArray[np.intp]
    places: Array
    residuals: Array
    overall: Gaussian

    def neighbours(self, size: int, places: Array, order: NDArray[np.intp] | None = None) -> Neighbours:
        """The records nearest to each place, without those near ``order`` in time."""
        if order is None:
            near = nearest(self.places, places, size)[1]
            return Neighbours(near, np.ones(near.shape, dtype=bool))
        return self._far_in_time(size, nearest(self.places, places, size + 2 * NEAR_IN_TIME - 1)[1], order)

    def own_neighbours(self, size: int) -> Neighbours:
        """The records nearest to each of them, without those near in time."""
        if size not in self._own:
            near = self._nearest_to_own[:, : size + 2 * NEAR_IN_TIME - 1]
            self._own[size] = self._far_in_time(size, near, self.order)
        return self._own[size]

    def best_smoothing(self) -> Smoothing | None:
        """The smoothing, or none, under which records are likeliest given the others."""
        plain = whitened(self.residuals, self.overall, self.overall.covariance[np.newaxis])[1]
        candidates: list[tuple[float, Smoothing | None]] = [(plain, None)]
        for size in self._sizes:
            for pseudo in PSEUDO_ROWS:
                local = LocalCovariance(self, Smoothing(size, pseudo))
                likelihood = whitened(self.residuals, self.overall, local(self.own_neighbours(size)))[1]
                candidates.append((likelihood, local.smoothing))
        return max(candidates, key=lambda candidate: candidate[0])[1]

    @property
    def _sizes(self) -> list[int]:
        return [size for size in NEIGHBOURS if size <= len(self.order) // 2]

    @cached_property
    def _own(self) -> dict[int, Neighbours]:
        return {}

    @cached_property
    def _nearest_to_own(self) -> NDArray[np.intp]:
        return nearest(self.places, self.places, max(self._sizes) + 2 * NEAR_IN_TIME - 1)[1]

    def _far_in_time(self, size: int, near: NDArray[np.intp], order: NDArray[np.intp]) -> Neighbours:
        far = np.abs(self.order[near] - order[:, np.newaxis]) >= NEAR_IN_TIME
        return Neighbours(near, far & (far.cumsum(axis=1) <= size))


@dataclass(frozen=True)
class LocalCovariance:
    """Covariance at places in weather.

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

    @cached_property
    def _standard(self) -> tuple[Array, Gaussian]:
        """Records over the standard deviations in their own weather, and their distribution."""
        deviations = np.sqrt(self._variances(self.history.own_neighbours(self.smoothing.n_neighbors)))
        rows = (self.history.residuals - self.history.overall.mean) / deviations
        return rows, Gaussian.of(rows)

    def _variances(self, neighbours: Neighbours) -> Array:
        overall = self.history.overall
        return self._mean((self.history.residuals - overall.mean) ** 2, np.diag(overall.covariance), neighbours)

    def _mean(self, values: Array, prior: Array, neighbours: Neighbours) -> Array:
        """Mean of the neighbours' values, NaN left out, and of pseudo-rows that have the prior's."""
        known, filled = ~np.isnan(values), np.nan_to_num(values)
        means, pseudo = np.empty((len(neighbours.rows), *prior.shape)), self.smoothing.n_pseudo
        step = max(ENTRIES // (neighbours.rows.shape[1] * prior.size), 1)
        for first in range(0, len(means), step):
            rows, counted = (part[first : first + step] for part in (neighbours.rows, neighbours.counted))
            sums = np.einsum("ij,ij...->i...", counted, filled[rows])
            counts = np.einsum("ij,ij...->i...", counted, known[rows], dtype=float)
            means[first : first + step] = (sums + pseudo * prior) / (counts + pseudo)
        return means


def whitened(residuals: Array, overall: Gaussian, covariances: Array) -> tuple[Array, float]:
    """Residuals in standard deviations and uncorrelated, by a covariance each, and their log-likelihood."""
    present = ~np.isnan(residuals)
    roots, log_determinants = whitenings(covariances, present)
    white = np.einsum("ij,ijk->ik", overall.centred(residuals), roots)
    return np.where(present, white, np.nan), -0.5 * float((white**2).sum() + log_determinants.sum())
