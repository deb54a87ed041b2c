"""Measured shifts beside the effects of causes, in standard errors."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.studies.identification.weighing._evidence import Observed

Effects = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Part:
    """Shifts of one kind, of frequencies or of mode shapes: NaN where nothing was measured; (n_observed,) each.

    Effects are a function from amounts of all causes, (..., n_causes), to the change and its derivatives. Errors follow
    Student's law with ``freedom``.
    """

    effects: Effects
    measured: Array
    covariance: Array
    freedom: float = np.inf

    @property
    def known(self) -> NDArray[np.intp]:
        return np.flatnonzero(~np.isnan(self.measured))


@dataclass(frozen=True)
class Comparison:
    """All measured shifts, and the effects of all causes on them."""

    parts: list[Part]

    def observed(self, model_error: float = 0.0) -> Observed:
        """What was measured."""
        return Observed.of(
            [(p.measured[p.known], p.covariance[np.ix_(p.known, p.known)], p.freedom) for p in self.parts],
            model_error,
        )

    def effects(self, amounts: Array) -> tuple[Array, Array]:
        """Changes, (..., n_observed), and their derivatives, (..., n_observed, n_causes)."""
        solved = [part.effects(amounts) for part in self.parts]
        changes = [change[..., part.known] for (change, _), part in zip(solved, self.parts, strict=True)]
        slopes = [slope[..., part.known, :] for (_, slope), part in zip(solved, self.parts, strict=True)]
        return np.concatenate(changes, axis=-1), np.concatenate(slopes, axis=-2)

    def slopes(self, n_causes: int) -> Array:
        """Effects of small amounts in standard errors, (n_observed, n_causes)."""
        return self.observed().rotation @ self.effects(np.zeros(n_causes))[1]
