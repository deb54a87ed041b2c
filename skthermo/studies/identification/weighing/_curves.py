"""Effects of single causes, tabulated, and those of several causes together as their sum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.studies.identification.weighing._causes import Cause
from skthermo.studies.identification.weighing._comparison import Effects
from skthermo.studies.identification.weighing._evidence import Observed

SHARES = np.array([0.0, 1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 11 / 12, 1.0])  # of the bounds, where effects are tabulated
N_SMALL = 3  # nodes that all causes have; those of larger amounts are computed for causes that need them


@dataclass(frozen=True)
class Curves:
    """Effects of each cause at shares of its bound, in the coordinates of what was observed.

    ``values`` and ``slopes``, by that share, have the shape (n_causes, n_nodes, n_observed); beyond a third of the
    bound they are extrapolated unless ``is_whole``. ``first``, (n_observed, n_causes), are the derivatives of what was
    observed itself, where nothing has changed.
    """

    bounds: Array
    values: Array
    slopes: Array
    first: Array
    is_whole: NDArray[np.bool_]

    @classmethod
    def of(cls, effects: Effects, causes: Sequence[Cause], observed: Observed) -> Curves:
        """Curves of exact effects of small amounts."""
        bounds = np.array([cause.highest if cause.highest > 0 else cause.lowest for cause in causes])
        small = SHARES[1:N_SMALL]
        solved, slopes = effects(np.vstack([np.zeros(len(causes)), *_single(bounds, range(len(causes)), small)]))
        values = np.zeros((len(causes), len(SHARES), solved.shape[1]))
        tangents = np.zeros_like(values)
        tangents[:, 0] = slopes[0].T * bounds[:, np.newaxis]
        for column in range(len(causes)):
            rows = 1 + column * len(small) + np.arange(len(small))
            values[column, 1:N_SMALL], tangents[column, 1:N_SMALL] = (
                solved[rows],
                slopes[rows, :, column] * bounds[column],
            )
        beyond = (SHARES[N_SMALL:] - SHARES[N_SMALL - 1])[:, np.newaxis]
        last = tangents[:, N_SMALL - 1 : N_SMALL]
        values[:, N_SMALL:] = values[:, N_SMALL - 1 : N_SMALL] + beyond * last
        tangents[:, N_SMALL:] = last
        turned = (array @ observed.rotation.T for array in (values, tangents))
        return cls(bounds, *turned, slopes[0], np.zeros(len(causes), dtype=bool))

    def whole(self, effects: Effects, columns: Sequence[int], observed: Observed) -> Curves:
        """The same with exact effects of large amounts of some causes."""
        values, tangents, is_whole = self.values.copy(), self.slopes.copy(), self.is_whole.copy()
        large = SHARES[N_SMALL:]
        solved, slopes = effects(np.vstack(_single(self.bounds, columns, large)))
        for place, column in enumerate(columns):
            rows = place * len(large) + np.arange(len(large))
            values[column, N_SMALL:] = solved[rows] @ observed.rotation.T
            tangents[column, N_SMALL:] = slopes[rows, :, column] @ observed.rotation.T * self.bounds[column]
            is_whole[column] = True
        return replace(self, values=values, slopes=tangents, is_whole=is_whole)

    def are_small(self, causes: Sequence[int], amounts: Array) -> NDArray[np.bool_]:
        """Whether amounts of causes, (n_causes,), are within those that all causes are tabulated for."""
        return np.abs(amounts) <= SHARES[N_SMALL - 1] * np.abs(self.bounds[list(causes)])

    def at(self, sets: Array, amounts: Array) -> tuple[Array, Array]:
        """Changes by sets (n_sets, k) of amounts (n_sets, n_errors, k), and their derivatives."""
        shape = (*amounts.shape[:-1], self.values.shape[-1])
        change, slopes = np.zeros(shape), []
        for i in range(sets.shape[-1]):
            column = sets[:, i, np.newaxis]
            share = amounts[..., i] / self.bounds[column]
            left = np.searchsorted(SHARES[1:-1], share, side="right")
            width = (SHARES[left + 1] - SHARES[left])[..., np.newaxis]
            t = (share - SHARES[left])[..., np.newaxis] / width
            values = self.values[column, left], self.values[column, left + 1]
            tangents = self.slopes[column, left] * width, self.slopes[column, left + 1] * width
            change += (
                (2 * t**3 - 3 * t**2 + 1) * values[0]
                + (t**3 - 2 * t**2 + t) * tangents[0]
                + (3 * t**2 - 2 * t**3) * values[1]
                + (t**3 - t**2) * tangents[1]
            )
            slope = (
                (6 * t**2 - 6 * t) * (values[0] - values[1])
                + (3 * t**2 - 4 * t + 1) * tangents[0]
                + (3 * t**2 - 2 * t) * tangents[1]
            )
            slopes.append(slope / (width * self.bounds[column][..., np.newaxis]))
        return change, np.stack(slopes, axis=-1) if slopes else np.zeros((*shape, 0))


def _single(bounds: Array, columns: Sequence[int], shares: Array) -> list[Array]:
    """Amounts with one cause alone, at shares of its bound."""
    return [share * bounds[column] * np.eye(len(bounds))[column] for column in columns for share in shares]
