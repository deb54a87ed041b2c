"""Effects of damage groups on the frequencies, averaged over the weather of some records."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skthermo._arguments import check_names
from skthermo._arrays import Array, as_floats, spread_evenly

MOST_ROWS, MOST_SLOW_ROWS = 100, 24
"""Number of records over which effects are averaged; fewer for models that are slow to solve."""

STEP = 1e-3  # step of differences in severity, for models without damage parameters, and in ln frequency
LEVELS = (0.3, 0.6, 1.0)  # highest severities for which reduced models are made, each when it is needed


@dataclass(frozen=True)
class FrequencyEffects:
    """Mean change of the logarithms of the measured frequencies that severities cause.

    It is the mean over rows of theta in the weather of some records, with weights (n_rows, n_modes). Simulators with
    damage parameters are kept by the highest severity that their reduced model covers.
    """

    fem: Any
    theta: Array
    weights: Array
    groups: Sequence[str]
    healthy: Array
    simulators: dict[float, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, fem: Any, theta: Array, F: Array, groups: Sequence[str]) -> "FrequencyEffects":
        """Effects at the parameters of some records; a mode's mean is over those records that have it."""
        is_slow = fem.simulator_.reduced is None and getattr(fem.model, "prefer", "processes") == "processes"
        present = ~(np.isnan(F) | np.isnan(theta).any(axis=1, keepdims=True))
        rows = np.flatnonzero(present.any(axis=1))
        most = MOST_SLOW_ROWS if is_slow else MOST_ROWS
        rows = spread_evenly(rows, most)
        healthy = np.log(healthy_frequencies(fem, theta[rows]))
        weights = np.where(np.isnan(healthy), 0.0, present[rows])
        weights = np.where(weights.any(axis=0), weights, ~np.isnan(healthy))
        return cls(fem, theta[rows], weights / np.maximum(weights.sum(axis=0), 1), groups, healthy)

    def nominal(self) -> "FrequencyEffects":
        """The same effects at the model's nominal state.

        Parameters that the records do not determine may have drifted, so that a symmetric structure is no longer
        symmetric and mirrored groups would seem to differ.
        """
        theta = np.ones((1, self.theta.shape[1]))
        healthy = np.log(healthy_frequencies(self.fem, theta))
        return FrequencyEffects(self.fem, theta, np.ones_like(healthy), self.groups, healthy)

    def __call__(self, severities: Array) -> tuple[Array, Array]:
        """Change of each mode, (n_modes,), and its derivatives by the severities, (n_modes, n_groups)."""
        exact = hasattr(self.fem.model, "with_damage_parameters")
        frequencies, slopes = (self._linearised if exact else self._differenced)(severities)
        measured, elasticity = self._measured(frequencies)
        change = self._mean(np.log(measured) - self.healthy)
        relative = elasticity[:, :, np.newaxis] * slopes
        return change, np.stack([self._mean(column) for column in np.moveaxis(relative, 2, 0)], axis=1)

    def _linearised(self, severities: Array) -> tuple[Array, Array]:
        """Frequencies, and exact derivatives of their logarithms by the severities."""
        level = next(level for level in LEVELS if severities.max() <= level)
        if level not in self.simulators:
            self.simulators[level] = self.fem.simulator_.with_damage_parameters(self.groups, 0.0, level)
        simulator = self.simulators[level]
        theta = np.hstack([self.theta, np.tile(1 - severities, (len(self.theta), 1))])
        frequencies, jacobian = simulator.linearise(theta, self.fem.n_jobs, relative=True)
        return frequencies, -jacobian[:, :, -len(self.groups) :] / (1 - severities)

    def _differenced(self, severities: Array) -> tuple[Array, Array]:
        frequencies = self._damaged(severities)
        return frequencies, central_differences(self._damaged, severities) / frequencies[:, :, np.newaxis]

    def _damaged(self, severities: Array) -> Array:
        damage = dict(zip(self.groups, severities.tolist(), strict=True))
        return self.fem.simulator_.damaged(damage).frequencies(self.theta, self.fem.n_jobs, warn=False)

    def _measured(self, frequencies: Array) -> tuple[Array, Array]:
        """Frequencies in the measured domain, and their relative change per relative change of the model's."""
        lower, middle, higher = (
            as_floats(self.fem.aligner_.inverse_transform(frequencies * (1 + step))) for step in (-STEP, 0, STEP)
        )
        return middle, (higher - lower) / (2 * STEP * middle)

    def _mean(self, values: Array) -> Array:
        known = np.where(np.isnan(values), 0.0, self.weights)
        return (known * np.nan_to_num(values)).sum(axis=0) / np.maximum(known.sum(axis=0), np.finfo(float).tiny)


def healthy_frequencies(fem: Any, theta: Array, *, warn: bool = False) -> Array:
    """Frequencies of the undamaged structure in the measured domain, in Hz, (n_rows, n_modes)."""
    return as_floats(fem.aligner_.inverse_transform(fem.simulator_.frequencies(theta, fem.n_jobs, warn=warn)))


def central_differences(function: Callable[[Array], Array], severities: Array) -> Array:
    """Derivatives of a function by each severity, along a new last axis."""
    steps = STEP * np.eye(len(severities))
    return np.stack([(function(severities + h) - function(severities - h)) / (2 * STEP) for h in steps], axis=-1)


def read_groups(model: Any, groups: Sequence[str] | Mapping[str, Sequence[str]] | None) -> dict[str, list[str]]:
    """Groups of the model by name; several of them where they are joined."""
    if not hasattr(model, "damaged") or not hasattr(model, "groups"):
        raise ValueError(f"{model!r} has no damage groups; expected a model that can be damaged, such as AffineModel")
    known = model.groups
    if groups is None:
        members = {name: [name] for name in _not_made_of_others(known)}
    elif isinstance(groups, Mapping):
        members = {str(name): [joined] if isinstance(joined, str) else list(joined) for name, joined in groups.items()}
    else:
        members = {name: [name] for name in check_names([groups] if isinstance(groups, str) else groups, "groups")}
    asked = [name for joined in members.values() for name in joined]
    unknown = [name for name in asked if name not in known]
    if unknown:
        raise ValueError(f"unknown damage groups {unknown}; expected some of {sorted(known)}")
    if not asked or not all(members.values()):
        raise ValueError(f"groups is {groups!r}; expected one or more of {sorted(known)}")
    return members


def _not_made_of_others(known: Mapping[str, Any]) -> list[str]:
    """Groups without those whose terms are all in smaller groups."""
    terms = {name: set(positions) for name, positions in known.items()}
    kept = []
    for name, own in terms.items():
        smaller = [other for other in terms.values() if other < own]
        if not smaller or set().union(*smaller) != own:
            kept.append(name)
    return kept
