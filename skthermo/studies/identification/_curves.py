"""Effects of single causes, tabulated, and those of several causes together as their sum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skthermo._arrays import Array
from skthermo.studies.identification._causes import Cause
from skthermo.studies.identification._comparison import Effects
from skthermo.studies.identification._evidence import Observed


@dataclass(frozen=True)
class Curves:
    """Effects of each cause at ``nodes`` (n_causes, n_nodes), in the coordinates of what was observed.

    ``values``, ``slopes`` and ``errors``, those of the model, relative to its effects, have the shape (n_causes,
    n_nodes, n_observed).
    """

    nodes: Array
    values: Array
    slopes: Array
    errors: Array

    @classmethod
    def of(cls, effects: Effects, causes: list[Cause], observed: Observed) -> Curves:
        """Curves of exact effects."""
        nodes, values, slopes = [], [], []
        for column, cause in enumerate(causes):
            amounts = cause.nodes()
            solved = [effects(amount * np.eye(len(causes))[column]) for amount in amounts]
            nodes.append(amounts)
            values.append([change for change, _ in solved])
            slopes.append([slope[:, column] for _, slope in solved])
        rotated = np.array(values) @ observed.rotation.T
        errors = np.sqrt(np.array(values) ** 2 @ (observed.rotation**2).T)
        return cls(np.array(nodes), rotated, np.array(slopes) @ observed.rotation.T, errors)

    def at(self, sets: Array, amounts: Array) -> tuple[Array, Array, Array]:
        """Changes of sets (n_sets, k) with amounts (n_sets, n_sizes, k), their derivatives, and the model's variances."""
        shape = (*amounts.shape[:-1], self.values.shape[-1])
        change, variance, slopes = np.zeros(shape), np.zeros(shape), []
        for i in range(sets.shape[-1]):
            column, amount = sets[:, i, np.newaxis], amounts[..., i]
            nodes = self.nodes[sets[:, i]]
            left = (amount >= nodes[:, np.newaxis, 1]).astype(int)
            start, end = self.nodes[column, left], self.nodes[column, left + 1]
            width = (end - start)[..., np.newaxis]
            share = ((amount - start) / (end - start))[..., np.newaxis]
            t = np.clip(share, 0.0, 1.0)
            beyond = share - t
            values = self.values[column, left], self.values[column, left + 1]
            tangents = self.slopes[column, left] * width, self.slopes[column, left + 1] * width
            change += (
                (2 * t**3 - 3 * t**2 + 1) * values[0]
                + (t**3 - 2 * t**2 + t) * tangents[0]
                + (3 * t**2 - 2 * t**3) * values[1]
                + (t**3 - t**2) * tangents[1]
                + np.minimum(beyond, 0.0) * tangents[0]
                + np.maximum(beyond, 0.0) * tangents[1]
            )
            slope = (
                (6 * t**2 - 6 * t) * (values[0] - values[1])
                + (3 * t**2 - 4 * t + 1) * tangents[0]
                + (3 * t**2 - 2 * t) * tangents[1]
            )
            slopes.append(slope / width)
            errors = self.errors[column, left], self.errors[column, left + 1]
            variance += (errors[0] + share * (errors[1] - errors[0])) ** 2
        return change, np.stack(slopes, axis=-1) if slopes else np.zeros((*shape, 0)), variance
