"""Changes of a structure by unknown amounts: of groups' stiffness, of parameters, and of mass."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

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

    def severities(self, amounts: Array) -> Array:
        """Severities of the model's groups, (..., n_groups)."""
        return 1 - self.factors(amounts)[..., self.n_parameters :][..., : len(self.groups)]


@dataclass(frozen=True)
class ChangedStructure:
    """A fitted chain's model with further columns of theta for the amounts of changes.

    Simulators are kept by the highest level that their reduced model covers.
    """

    fem: Any
    changes: Changes
    simulators: dict[float, Any] = field(default_factory=dict, repr=False)

    @property
    def is_exact(self) -> bool:
        """Whether the model takes all of the columns."""
        groups, masses, model = self.changes.groups, self.changes.masses, self.fem.model
        has_groups = not groups or hasattr(model, "with_damage_parameters")
        return has_groups and (not masses or hasattr(model, "with_mass_parameters"))

    def linearise(self, theta: Array, sets: Array, dofs: NDArray[np.intp] | None = None) -> list[Array]:
        """Frequencies for some sets of amounts, (n_sets, n_rows, n_modes), and derivatives of ln f by the amounts.

        With ``dofs``, also the shapes there, (n_sets, n_rows, n_dofs, n_modes), and their derivatives.
        """
        rows, levels = self.changes.rows(theta, sets), self.changes.levels(sets)
        results: list[Array] = []
        for level in np.unique(levels):
            own = levels == level
            flat = rows[own].reshape(-1, rows.shape[2])
            solved = self._simulator(level).linearise(flat, self.fem.n_jobs, dofs, relative=True)
            results = results or [np.empty((*rows.shape[:2], *array.shape[1:])) for array in solved]
            for result, array in zip(results, solved, strict=True):
                result[own] = array.reshape(-1, *result.shape[1:])
        inner = self.changes.slopes(sets)[:, np.newaxis]
        results[1] = results[1] @ inner
        if dofs is not None:
            results[3] = results[3] @ inner[:, np.newaxis]
        return results

    def with_amounts(self, theta: Array, amounts: Array) -> tuple[Any, Array]:
        """The simulator of the structure with one set of amounts, and its own rows of theta."""
        factors = self.changes.factors(amounts)
        times = factors[self.changes.n_parameters + len(self.changes.groups) :] - 1
        severities = zip(self.changes.groups, self.changes.severities(amounts).tolist(), strict=True)
        simulator = self.fem.simulator_.damaged({group: severity for group, severity in severities if severity})
        for number, mass in zip(times, self.changes.masses.values(), strict=True):
            simulator = simulator.changed("with_added", mass=number * mass) if number else simulator
        return simulator, theta * factors[: theta.shape[1]]

    def _simulator(self, level: float) -> Any:
        """The simulator that has the amounts as further columns of theta."""
        if level not in self.simulators:
            groups, masses, ranges = self.changes.groups, self.changes.masses, self.changes.ranges(level)
            self.simulators[level] = self.fem.simulator_.with_columns(groups, masses, ranges)
        return self.simulators[level]
