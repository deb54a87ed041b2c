"""Effects of single causes, tabulated, and those of several causes together as their sum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skthermo._arrays import Array
from skthermo.studies.identification._causes import Cause
from skthermo.studies.identification._comparison import Effects
from skthermo.studies.identification._evidence import Observed

FARTHEST = 0.3  # amount up to which effects are tabulated; beyond, they are computed where they matter


@dataclass(frozen=True)
class Curves:
    """Effects of each cause at ``nodes`` (n_causes, n_nodes), in the coordinates of what was observed.

    ``values`` and ``slopes`` have the shape (n_causes, n_nodes, n_observed). ``first``, (n_observed, n_causes), are the
    derivatives where nothing has changed, of what was observed itself.
    """

    nodes: Array
    values: Array
    slopes: Array
    first: Array

    @classmethod
    def of(cls, effects: Effects, causes: list[Cause], observed: Observed) -> Curves:
        """Curves of exact effects."""
        nodes = np.array([_nodes(cause.lowest, cause.highest) for cause in causes])
        sets = (nodes[:, :, np.newaxis] * np.eye(len(causes))[:, np.newaxis]).reshape(-1, len(causes))
        different, place = np.unique(sets + 0.0, axis=0, return_inverse=True)  # all begin with no change
        values, slopes = (found[place.ravel()].reshape(*nodes.shape, *found.shape[1:]) for found in effects(different))
        own = np.stack([slopes[column, :, :, column] for column in range(len(causes))])
        none = slopes.reshape(-1, *slopes.shape[2:])[~sets.any(axis=1)][0]
        return cls(nodes, values @ observed.rotation.T, own @ observed.rotation.T, none)

    def at(self, sets: Array, amounts: Array) -> tuple[Array, Array]:
        """Changes by sets (n_sets, k) of amounts (n_sets, n_errors, k), and their derivatives."""
        shape = (*amounts.shape[:-1], self.values.shape[-1])
        change, slopes = np.zeros(shape), []
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
        return change, np.stack(slopes, axis=-1) if slopes else np.zeros((*shape, 0))


def _nodes(lowest: float, highest: float) -> tuple[float, float, float]:
    lowest, highest = max(lowest, -FARTHEST), min(highest, FARTHEST)
    return lowest, 0.0 if lowest < 0 < highest else (lowest + highest) / 2, highest
