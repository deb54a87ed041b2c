"""Changes of a structure by unknown amounts: of groups' stiffness, of parameters, and of mass."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skthermo._arrays import Array, Matrix

HIGHEST_SEVERITY = 0.95  # largest loss of stiffness that is considered
LEVELS = (1 / 3, 2 / 3, 1.0)  # shares of the bounds for which reduced models are made, when they are needed


@dataclass(frozen=True)
class Changes:
    """What some amounts do to theta: they multiply its columns by 1 + direction * amount.

    The columns are the model's parameters, then 1 - severity of each of the model's damage ``groups``, then 1 + amount
    of each of the added ``masses``. ``directions`` are (n_causes, n_columns), and ``bounds``, (n_causes, 2), the lowest
    and the highest amounts that reduced models cover.
    """

    groups: Sequence[str]
    directions: Array
    bounds: Array
    masses: Mapping[str, Matrix] = field(default_factory=dict, repr=False)

    @classmethod
    def of_damage(cls, model: Any, groups: Sequence[str]) -> "Changes":
        """Severities of some groups of a model."""
        directions = np.hstack([np.zeros((len(groups), len(model.parameter_names))), -np.eye(len(groups))])
        return cls(groups, directions, np.tile([0.0, HIGHEST_SEVERITY], (len(groups), 1)))

    @property
    def n_parameters(self) -> int:
        """Number of columns that are the model's parameters."""
        return self.directions.shape[1] - len(self.groups) - len(self.masses)

    def factors(self, amounts: Array) -> Array:
        """What multiplies each column, (..., n_columns), for amounts (..., n_causes)."""
        return np.prod(1 + self.directions * amounts[..., np.newaxis], axis=-2)

    def slopes(self, amounts: Array) -> Array:
        """Derivatives of the logarithms of the factors by the amounts, (..., n_columns, n_causes)."""
        return (self.directions / (1 + self.directions * amounts[..., np.newaxis])).swapaxes(-2, -1)

    def rows(self, theta: Array, amounts: Array) -> Array:
        """Rows of theta with every set of amounts, (n_sets, n_rows, n_columns)."""
        further = np.ones((len(theta), len(self.groups) + len(self.masses)))
        return np.hstack([theta, further]) * self.factors(amounts)[:, np.newaxis]

    def levels(self, amounts: Array) -> Array:
        """The level of each set of amounts, (n_sets,)."""
        shares = np.abs(amounts / np.abs(self.bounds).max(axis=1)).max(axis=1, initial=0.0)
        return np.array(LEVELS)[np.minimum(np.searchsorted(LEVELS, shares), len(LEVELS) - 1)]

    def ranges(self, level: float) -> Array:
        """Lowest and highest factor of each column up to a level, (n_columns, 2)."""
        ends = 1 + self.directions * level * self.bounds.T[:, :, np.newaxis]
        return np.column_stack([ends.min(axis=0).prod(axis=0), ends.max(axis=0).prod(axis=0)])

    def are_exact(self, model: Any) -> bool:
        """Whether a model takes all of the columns."""
        return (not self.groups or hasattr(model, "with_damage_parameters")) and (
            not self.masses or hasattr(model, "with_mass_parameters")
        )

    def simulator(self, simulator: Any, amounts: Array) -> Any:
        """The simulator of the structure with one set of amounts, for the model's own columns of theta."""
        factors = self.factors(amounts)[self.n_parameters :]
        severities = 1 - factors[: len(self.groups)]
        damage = {group: float(s) for group, s in zip(self.groups, severities, strict=True) if s}
        changed = simulator.damaged(damage)
        for times, mass in zip(factors[len(self.groups) :] - 1, self.masses.values(), strict=True):
            changed = changed.changed("with_added", mass=times * mass) if times else changed
        return changed
