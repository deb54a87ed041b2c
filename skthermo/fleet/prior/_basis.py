"""One basis of functions of the weather for all bridges of a fleet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skthermo._arrays import Array, broken_lines, spread_evenly
from skthermo._weather import TrainingRange

ROWS_EACH = 1000  # of a bridge, evenly spread: each bridge counts alike
EXPLAINED = 0.9999  # share of the variance of all broken lines that the basis keeps
MOST_FUNCTIONS = 24


@dataclass(frozen=True)
class FleetBasis:
    """Principal components u(T), (n_samples, n_functions), of broken lines in all inputs, with zero mean in the fleet.

    The lines break at quantiles of the weather of all bridges, and each is standardised by its deviation there. Beyond
    the weather of the fleet they go on straight. ``names`` are those of the inputs, None where they have none.
    """

    names: Sequence[Any] | None
    knots: Array
    centre: Array
    scale: Array
    components: Array
    reach: TrainingRange

    @classmethod
    def of(cls, tables: Sequence[Array], n_knots: int, names: Sequence[Any] | None = None) -> FleetBasis:
        """The basis for the weather of some bridges, each (n_samples, n_inputs) without gaps."""
        pooled = np.concatenate([table[spread_evenly(np.arange(len(table)), ROWS_EACH)] for table in tables])
        knots = np.quantile(pooled, np.linspace(0, 1, n_knots + 2)[1:-1], axis=0)
        lines = broken_lines(pooled, knots)
        centre, scale = lines.mean(axis=0), lines.std(axis=0)
        scale = np.where(scale > 1e-9 * np.maximum(np.abs(centre), 1.0), scale, np.inf)
        variances, vectors = np.linalg.eigh(np.cov((lines - centre) / scale, rowvar=False, bias=True))
        variances, vectors = np.maximum(variances[::-1], 0.0), vectors[:, ::-1]
        n_needed = 1 + int(np.searchsorted(np.cumsum(variances), EXPLAINED * variances.sum()))
        components = vectors[:, : min(n_needed, MOST_FUNCTIONS)].T
        largest = np.abs(components).argmax(axis=1)[:, np.newaxis]
        components = components * np.sign(np.take_along_axis(components, largest, axis=1))  # eigenvectors have no sign
        ends = [end(table, axis=0) for table in tables for end in (np.min, np.max)]
        shown = [f"T{i + 1}" for i in range(pooled.shape[1])] if names is None else names
        return cls(names, knots, centre, scale, components, TrainingRange(np.min(ends, 0), np.max(ends, 0), shown))

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        return self.knots.shape[1]

    def __call__(self, inputs: Array) -> Array:
        """The functions at rows of complete inputs."""
        return (broken_lines(inputs, self.knots) - self.centre) / self.scale @ self.components.T
