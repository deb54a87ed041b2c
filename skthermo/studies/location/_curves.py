"""Effects of single causes, tabulated by severity, and added up where there are several."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo.studies.identification import Effects, cubic

SEVERITIES = np.array([0.0, 0.3, 0.6, 0.9])
PLACES = -np.log1p(-SEVERITIES)
"""Between these logarithms of 1 - severity effects are smooth enough for cubic polynomials."""


@dataclass(frozen=True)
class StretchCurves:
    """Change of each observation, (n_causes, n_severities, n_observed), and its slopes by ``PLACES``.

    ``rotation`` leads to the coordinates in which errors of the observations are independent, with unit variance.
    """

    changes: Array
    slopes: Array
    rotation: Array

    @classmethod
    def of(cls, effects: Effects, incidence: NDArray[np.bool_], rotation: Array) -> StretchCurves:
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
            rotation,
        )

    def __call__(self, amounts: Array) -> tuple[Array, Array]:
        """Changes, (..., n_observed), and derivatives, (..., n_observed, n_causes), by severities (..., n_causes)."""
        changes, slopes = self.single(np.arange(amounts.shape[-1]), amounts)
        return changes.sum(axis=-2), np.moveaxis(slopes, -2, -1)

    def at(self, sets: NDArray[np.intp], amounts: Array) -> tuple[Array, Array]:
        """Changes of sets (n_sets, k) with severities (n_sets, n, k), and derivatives, with the axis k more.

        They are in the coordinates of what was observed, (n_sets, n, n_observed).
        """
        changes, slopes = self.single(sets[:, np.newaxis], amounts)
        return changes.sum(axis=-2) @ self.rotation.T, np.moveaxis(slopes @ self.rotation.T, -2, -1)

    def single(self, causes: NDArray[np.intp], severities: Array) -> tuple[Array, Array]:
        """Changes by causes (...,) of some severities (...,), and their derivatives, both (..., n_observed)."""
        return cubic(PLACES, self.changes, self.slopes, causes, -np.log1p(-severities), 1 - severities)
