"""Effects of single causes, tabulated by severity, and added up where there are several."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array

SEVERITIES = np.array([0.0, 0.3, 0.6, 0.9])
PLACES = -np.log1p(-SEVERITIES)
"""Between these logarithms of 1 - severity effects are smooth enough for cubic polynomials."""

Effects = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Curves:
    """Change of each observation, (n_causes, n_severities, n_observed), and its slopes by ``PLACES``."""

    changes: Array
    slopes: Array

    @classmethod
    def of(cls, effects: Effects, incidence: NDArray[np.bool_]) -> Curves:
        """Of causes that each damage some groups by one severity; incidence is (n_causes, n_groups)."""
        sets = incidence[:, np.newaxis] * SEVERITIES[:, np.newaxis]
        sets = np.vstack([np.zeros((1, incidence.shape[1])), sets[:, 1:].reshape(-1, incidence.shape[1])])
        changes, slopes = effects(sets)
        inner = (1 - sets[1:]).reshape(len(incidence), -1, 1, incidence.shape[1]) * incidence[:, np.newaxis, np.newaxis]
        damaged = slopes[1:].reshape(len(incidence), -1, *slopes.shape[1:])
        at_zero = np.broadcast_to(slopes[0] @ incidence.T, (1, slopes.shape[1], len(incidence))).transpose(2, 0, 1)
        changes = changes[1:].reshape(len(incidence), -1, changes.shape[1])
        return cls(
            np.concatenate([np.zeros_like(changes[:, :1]), changes], axis=1),
            np.concatenate([at_zero, (damaged * inner).sum(axis=-1)], axis=1),
        )

    def __call__(self, amounts: Array) -> tuple[Array, Array]:
        """Changes, (..., n_observed), and derivatives, (..., n_observed, n_causes), by severities (..., n_causes)."""
        place = -np.log1p(-amounts)
        left = np.clip(np.searchsorted(PLACES, place, side="right") - 1, 0, len(PLACES) - 2)
        width = (PLACES[left + 1] - PLACES[left])[..., np.newaxis]
        x = (place - PLACES[left])[..., np.newaxis] / width
        cause = np.arange(amounts.shape[-1])
        low, high = self.changes[cause, left], self.changes[cause, left + 1]
        start, end = self.slopes[cause, left] * width, self.slopes[cause, left + 1] * width
        rise, square, cube = high - low, 2 * start + end, start + end
        changes = low + x * (start + x * (3 * rise - square + x * (cube - 2 * rise)))
        slopes = (start + x * (2 * (3 * rise - square) + x * 3 * (cube - 2 * rise))) / width
        return changes.sum(axis=-2), np.moveaxis(slopes / (1 - amounts[..., np.newaxis]), -2, -1)
