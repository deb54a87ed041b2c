"""One basis of functions of the weather for all bridges of a fleet."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from skthermo._tables.arrays import Array, piecewise_linear, real_array, spread_evenly
from skthermo.residuals.weather import TrainingRange

ROWS_EACH = 1000  # of a bridge, evenly spread: each bridge counts alike
SMALLEST = 1e-5  # share of the variance of the inputs that a principal component needs
BREAKING = 0.02  # share from which lines in a component break


@dataclass(frozen=True)
class FleetBasis:
    """Principal components of the inputs, and piecewise-linear functions of the largest, of zero mean in the fleet.

    The lines break at quantiles of the weather of all bridges and have unit variance there. Beyond the weather of the
    fleet they go on straight. ``covariance`` is that of the functions in the fleet. ``names`` are those of the inputs,
    None where they have none.
    """

    names: Sequence[Hashable] | None
    middle: Array
    components: Array
    knots: Array
    centre: Array
    scale: Array
    covariance: Array
    reach: TrainingRange

    @classmethod
    def of(cls, tables: Sequence[Array], n_knots: int, names: Sequence[Hashable] | None = None) -> FleetBasis:
        """The basis for the weather of some bridges, each (n_samples, n_inputs) without gaps."""
        pooled = np.concatenate([table[spread_evenly(np.arange(len(table)), ROWS_EACH)] for table in tables])
        middle, deviations = pooled.mean(axis=0), pooled.std(axis=0)
        varying = deviations > 1e-9 * np.maximum(np.abs(middle), 1.0)
        scale = np.where(varying, deviations, np.inf)
        variances, vectors = np.linalg.eigh(np.atleast_2d(np.cov((pooled - middle) / scale, rowvar=False, bias=True)))
        shares, vectors = variances[::-1] / max(variances.sum(), 1e-300), vectors[:, ::-1]
        vectors = vectors * np.where(
            np.linspace(2, 1, len(vectors)) @ vectors < 0, -1.0, 1.0
        )  # eigenvectors have no sign
        components = vectors[:, shares > SMALLEST].T / scale
        places = (pooled - middle) @ components.T
        n_breaking = max(int((shares > BREAKING).sum()), 1)
        knots = np.quantile(places[:, :n_breaking], np.linspace(0, 1, n_knots + 2)[1:-1], axis=0)
        ends = [end(table, axis=0) for table in tables for end in (np.min, np.max)]
        shown = [f"T{i + 1}" for i in range(pooled.shape[1])] if names is None else names
        reach = TrainingRange(np.min(ends, axis=0), np.max(ends, axis=0), shown)
        plain = cls(names, middle, components, knots, np.zeros(1), np.ones(1), np.empty((0, 0)), reach)
        lines = plain(pooled)
        scale = np.where(np.arange(lines.shape[1]) < places.shape[1], 1.0, np.maximum(lines.std(axis=0), 1e-12))
        covariance = np.atleast_2d(np.cov(lines / scale, rowvar=False))
        return replace(plain, centre=lines.mean(axis=0), scale=scale, covariance=covariance)

    @property
    def n_functions(self) -> int:
        return len(self.scale)

    def steady(self, temperatures: Array) -> Array:
        """The functions where all inputs have been at one temperature for long."""
        return self(np.repeat(temperatures[:, np.newaxis], self.n_inputs, axis=1))

    @property
    def n_inputs(self) -> int:
        return len(self.middle)

    def __call__(self, inputs: Array) -> Array:
        """The functions at rows of complete inputs, (n_samples, n_functions)."""
        places = (inputs - self.middle) @ self.components.T
        n_breaking = self.knots.shape[1]
        lines = piecewise_linear(places[:, :n_breaking], self.knots)[:, n_breaking:]
        return (np.hstack([places, lines]) - self.centre) / self.scale


def steady_changes(
    basis: FleetBasis, temperatures: ArrayLike, reference: float | None, reach: TrainingRange
) -> tuple[Array, Array]:
    """Temperatures, and the functions there less those at a reference, by default the middle of some weather."""
    values = np.atleast_1d(real_array(temperatures, "temperatures"))
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise ValueError(f"temperatures are {temperatures!r:.100}; expected finite degrees Celsius in one row")
    middle = float(np.mean([reach.lowest, reach.highest])) if reference is None else float(reference)
    return values, basis.steady(values) - basis.steady(np.array([middle]))
