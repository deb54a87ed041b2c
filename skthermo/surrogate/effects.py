"""Changes of a structure by unknown amounts: their effects on its parameters, and on its frequencies over some
weather."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, as_floats
from skthermo._core.estimators import check_is_fitted
from skthermo.fem.damage import LossKind, as_directions, direction_name, losses

HIGHEST_SEVERITY = 0.95  # largest loss of stiffness that is considered


@dataclass(frozen=True)
class StructuralChanges:
    """Effects of some amounts on theta, whose columns they multiply by 1 + direction * amount.

    The columns are the model's parameters, then 1 - severity of each of the model's damage ``groups``, of losses of a
    ``kind``. ``directions`` are (n_causes, n_columns), and ``bounds``, (n_causes, 2), the lowest and the highest
    amounts that reduced models cover.
    """

    groups: Sequence[str]
    directions: Array
    bounds: Array
    near_share: float = 1 / 3  # of the bounds, up to which amounts have a reduced model; one for all would be large
    kind: LossKind = "stiffness"

    @classmethod
    def of_damage(cls, model: Any, groups: Sequence[str], kind: LossKind = "stiffness") -> "StructuralChanges":
        """Severities of some groups of a model."""
        directions = np.hstack([np.zeros((len(groups), len(model.parameter_names))), -np.eye(len(groups))])
        return cls(groups, directions, np.tile([0.0, HIGHEST_SEVERITY], (len(groups), 1)), kind=kind)

    @property
    def n_parameters(self) -> int:
        """Number of columns that are the model's parameters."""
        return self.directions.shape[1] - len(self.groups)

    def factors(self, amounts: Array) -> Array:
        """Factors of the columns, (..., n_columns), for amounts (..., n_causes)."""
        return np.prod(1 + self.directions * amounts[..., np.newaxis], axis=-2)

    def slopes(self, amounts: Array) -> Array:
        """Derivatives of the logarithms of the factors by the amounts, (..., n_columns, n_causes)."""
        return (self.directions / (1 + self.directions * amounts[..., np.newaxis])).swapaxes(-2, -1)

    def rows(self, theta: Array, amounts: Array) -> Array:
        """Rows of theta with every set of amounts, (n_sets, n_rows, n_columns)."""
        return np.hstack([theta, np.ones((len(theta), len(self.groups)))]) * self.factors(amounts)[:, np.newaxis]

    def are_near(self, amounts: Array) -> NDArray[np.bool_]:
        """Which sets of amounts a reduced model covers, (n_sets,)."""
        return (np.abs(amounts) <= self.near_share * np.abs(self.bounds).max(axis=1)).all(axis=1)

    def near(self) -> Array:
        """Lowest and highest factor of each column by the amounts that a reduced model covers, (n_columns, 2)."""
        ends = 1 + self.directions * self.near_share * self.bounds.T[:, :, np.newaxis]
        margin = 0.02 * self.directions.any(axis=0)
        return np.column_stack([ends.min(axis=0).prod(axis=0) - margin, ends.max(axis=0).prod(axis=0) + margin])

    def severities(self, amounts: Array) -> Array:
        """Severities of the model's groups, (..., n_groups)."""
        return 1 - self.factors(amounts)[..., self.n_parameters :]


@dataclass(frozen=True)
class ChangedStructure:
    """A fitted chain's model with further columns of theta for the amounts of changes.

    For small amounts it has a reduced model, which also covers the rows of theta ``around`` which it will be asked.
    """

    fem: Any
    changes: StructuralChanges
    around: Array = field(repr=False)

    @property
    def is_exact(self) -> bool:
        """Whether the model takes all of the columns."""
        return not self.changes.groups or hasattr(self.fem.model, "with_damage_parameters")

    def linearise(self, theta: Array, sets: Array) -> list[Array]:
        """Frequencies for some sets of amounts, (n_sets, n_rows, n_modes), and derivatives of ln f by the amounts."""
        rows = self.changes.rows(theta, sets)
        are_near = self.changes.are_near(sets) & self._is_slow
        results: list[Array] = []
        for near in np.unique(are_near):
            own = are_near == near
            flat = rows[own].reshape(-1, rows.shape[2])
            solved = (self._near if near else self._anywhere).linearise(flat, self.fem.n_jobs, relative=True)
            results = results or [np.empty((*rows.shape[:2], *array.shape[1:])) for array in solved]
            for result, array in zip(results, solved, strict=True):
                result[own] = array.reshape(-1, *result.shape[1:])
        results[1] = results[1] @ self.changes.slopes(sets)[:, np.newaxis]
        return results

    def with_amounts(self, theta: Array, amounts: Array) -> tuple[Any, Array]:
        """The simulator of the structure with one set of amounts, and its own rows of theta."""
        severities = zip(self.changes.groups, self.changes.severities(amounts).tolist(), strict=True)
        damage = {group: severity for group, severity in severities if severity}
        simulator = self.fem.simulator_.damaged(damage, self.changes.kind)
        return simulator, theta * self.changes.factors(amounts)[: theta.shape[1]]

    @property
    def _is_slow(self) -> bool:
        """Whether a reduced model saves time."""
        model = self.fem.model
        is_sparse = getattr(model, "prefer", "threads") == "processes" and hasattr(model, "reduced")
        return is_sparse or hasattr(model, "full") or self.fem.simulator_.reduced is not None

    @cached_property
    def _anywhere(self) -> Any:
        """The simulator that has the amounts as further columns of theta."""
        return self.fem.simulator_.with_columns(self.changes.groups, {}, None, self.changes.kind)

    @cached_property
    def _near(self) -> Any:
        """The same, with a reduced model for small amounts."""
        box = self.fem.simulator_.box
        if box is None:
            box = self._bounds()
        box = np.vstack([box, np.ones((len(self.changes.groups), 2))]) * self.changes.near()
        return self.fem.simulator_.with_columns(self.changes.groups, {}, box, self.changes.kind)

    def _bounds(self) -> Array:
        """Bounds of the parameters that the chain has learned, or of those ``around`` too, with a margin of 5 %."""
        rows = self.fem.records_.learned
        for _ in range(2):
            lowest, highest = 0.95 * np.nanmin(rows, axis=0), 1.05 * np.nanmax(rows, axis=0)
            if ((lowest <= self.around) & (self.around <= highest)).all():
                break
            rows = np.vstack([rows, self.around])
        return np.column_stack([lowest, highest])


@dataclass(frozen=True)
class FrequencyEffects:
    """Mean change of the logarithms of the measured frequencies that some amounts of change cause, as a weighted sum
    over a few rows of theta, with weights (n_rows, n_modes)."""

    structure: ChangedStructure
    theta: Array
    weights: Array
    healthy: Array

    @classmethod
    def averaged(cls, fem: Any, theta: Array, F: Array, changes: StructuralChanges) -> "FrequencyEffects":
        """Effects at the parameters of some records; a mode's mean is over those records that have it."""
        known = ~(np.isnan(theta).any(axis=1) | np.isnan(F).all(axis=1))
        present = ~np.isnan(F[known])
        few, weights = typical_rows(theta[known], np.where(present.any(axis=0), present, True))
        return cls.at(ChangedStructure(fem, changes, few), few, weights)

    @classmethod
    def at(cls, structure: ChangedStructure, theta: Array, weights: Array) -> "FrequencyEffects":
        """Effects at some rows of theta; without changes, they are 0 also where the model is reduced."""
        if structure.is_exact:
            frequencies = structure.linearise(theta, np.zeros((1, len(structure.changes.bounds))))[0][0]
            healthy = as_floats(structure.fem.aligner_.inverse_transform(frequencies))
        else:
            healthy = healthy_frequencies(structure.fem, theta)
        return cls(structure, theta, weights, np.log(healthy))

    def nominal(self) -> "FrequencyEffects":
        """The same effects at the model's nominal state: drifted parameters make mirrored groups seem to differ."""
        theta = np.ones((1, self.theta.shape[1]))
        return FrequencyEffects.at(self.structure, theta, np.ones((1, self.healthy.shape[1])))

    def __call__(self, amounts: Array) -> tuple[Array, Array]:
        """Change of each mode, (..., n_modes), and its derivatives, (..., n_modes, n_causes), for (..., n_causes).

        Many sets of amounts together take less time than one by one.
        """
        sets = np.atleast_2d(amounts)
        results = [self._changed(part) for part in np.array_split(sets, 1 + len(sets) * len(self.theta) // 5000)]
        change, slopes = (np.concatenate(arrays) for arrays in zip(*results, strict=True))
        return (change[0], slopes[0]) if np.ndim(amounts) == 1 else (change, slopes)

    def _changed(self, sets: Array) -> tuple[Array, Array]:
        solve = self.structure.linearise if self.structure.is_exact else self._differenced
        frequencies, slopes = solve(self.theta, sets)
        measured, elasticity = self._measured(frequencies)
        change = self._mean(np.log(measured) - self.healthy)
        return change, self._mean(elasticity[..., np.newaxis] * slopes)

    def _differenced(self, theta: Array, sets: Array) -> list[Array]:
        def at(amounts: Array) -> Array:
            simulator, rows = self.structure.with_amounts(theta, amounts)
            return simulator.frequencies(rows, self.structure.fem.n_jobs)

        frequencies = np.stack([at(amounts) for amounts in sets])
        slopes = np.stack([amount_slopes(at, amounts) for amounts in sets])
        return [frequencies, slopes / frequencies[..., np.newaxis]]

    def _measured(self, frequencies: Array) -> tuple[Array, Array]:
        """Frequencies in the measured domain, and their relative change per relative change of the model's."""
        flat = frequencies.reshape(-1, frequencies.shape[-1])
        lower, middle, higher = (
            as_floats(self.structure.fem.aligner_.inverse_transform(flat * (1 + step))).reshape(frequencies.shape)
            for step in (-0.001, 0, 0.001)
        )
        return middle, (higher - lower) / (0.002 * middle)

    def _mean(self, values: Array) -> Array:
        """Mean over rows, the second axis, with each mode's weights."""
        weights = self.weights if values.ndim == 3 else self.weights[..., np.newaxis]
        known = np.where(np.isnan(values), 0.0, weights)
        return (known * np.nan_to_num(values)).sum(axis=1) / np.maximum(known.sum(axis=1), np.finfo(float).tiny)


def typical_rows(theta: Array, present: NDArray[np.bool_]) -> tuple[Array, Array]:
    """A few rows of theta, and weights (n_rows, n_modes) that give the mean and the mean square along each principal
    direction of ln theta over all rows that have a mode. The mean of any quadratic function of them is exact, but for
    products of different directions."""
    shares = present / present.sum(axis=0)
    if len(theta) <= 3:
        return theta, shares
    logs = np.log(theta)
    centre = logs.mean(axis=0)
    _, sizes, axes = np.linalg.svd(logs - centre, full_matrices=False)
    deviations = sizes / np.sqrt(len(logs))
    n_axes = min(int((deviations > 3e-4).sum()), 6)
    axes, steps = axes[:n_axes], np.sqrt(max(n_axes, 3)) * deviations[:n_axes, np.newaxis]
    places = ((logs - centre) @ axes.T).T / steps
    mean, square = places @ shares, places**2 @ shares
    rows = np.vstack([centre[np.newaxis], centre + steps * axes, centre - steps * axes])
    return np.exp(rows), np.vstack([1 - square.sum(axis=0), (square + mean) / 2, (square - mean) / 2])


def healthy_frequencies(fem: Any, theta: Array) -> Array:
    """Frequencies of the undamaged model in the measured domain, without discrepancy, in Hz, (n_rows, n_modes)."""
    return as_floats(fem.aligner_.inverse_transform(fem.simulator_.frequencies(theta, fem.n_jobs)))


def amount_slopes(function: Callable[[Array], Array], amounts: Array, step: float = 1e-3) -> Array:
    """Central differences of a function by each amount, along a new last axis."""
    steps = step * np.eye(len(amounts))
    return np.stack([(function(amounts + h) - function(amounts - h)) / (2 * step) for h in steps], axis=-1)


def damage_directions(fem: Any, groups: Sequence[str] | None = None, kind: LossKind | None = None) -> pd.DataFrame:
    """Directions of a fitted chain, at the mean of its parameters, in the measured domain."""
    check_is_fitted(fem)
    mean = np.nanmean(as_floats(fem.parameters_), axis=0, keepdims=True)
    slopes, names = [], []
    for one, own in losses(fem.model, groups, kind).items():
        structure = ChangedStructure(fem, StructuralChanges.of_damage(fem.model, own, one), mean)
        effects = FrequencyEffects.at(structure, mean, np.ones((1, len(fem.mode_names_))))
        slopes += [*effects(np.zeros(len(own)))[1].T]
        names += [direction_name(group, one) for group in own]
    return as_directions(np.array(slopes), names, fem.mode_names_)
