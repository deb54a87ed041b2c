"""Changes of a structure by unknown amounts: of groups' stiffness, of parameters, and of mass."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, Matrix

HIGHEST_SEVERITY = 0.95  # largest loss of stiffness that is considered
NEAR = 1 / 3  # share of the bounds up to which amounts have a reduced model; one for all of them would be large
BEYOND = 0.02  # margin of what multiplies a column
AROUND = 0.05  # margin of theta around the weather's, within which a reduced model is accurate


@dataclass(frozen=True)
class StructuralChanges:
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
    def of_damage(cls, model: Any, groups: Sequence[str]) -> "StructuralChanges":
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

    def are_near(self, amounts: Array) -> NDArray[np.bool_]:
        """Which sets of amounts a reduced model covers, (n_sets,)."""
        return (np.abs(amounts) <= NEAR * np.abs(self.bounds).max(axis=1)).all(axis=1)

    def near(self) -> Array:
        """Lowest and highest factor of each column by the amounts that a reduced model covers, (n_columns, 2)."""
        ends = 1 + self.directions * NEAR * self.bounds.T[:, :, np.newaxis]
        margin = BEYOND * self.directions.any(axis=0)
        return np.column_stack([ends.min(axis=0).prod(axis=0) - margin, ends.max(axis=0).prod(axis=0) + margin])

    def severities(self, amounts: Array) -> Array:
        """Severities of the model's groups, (..., n_groups)."""
        return 1 - self.factors(amounts)[..., self.n_parameters :][..., : len(self.groups)]


@dataclass(frozen=True)
class ChangedStructure:
    """A fitted chain's model with further columns of theta for the amounts of changes.

    Simulators are kept, one for large amounts and one for those that a reduced model covers.
    """

    fem: Any
    changes: StructuralChanges
    simulators: dict[bool, Any] = field(default_factory=dict, repr=False)

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
        rows = self.changes.rows(theta, sets)
        are_near = self.changes.are_near(sets) & self._is_slow
        results: list[Array] = []
        for near in np.unique(are_near):
            own = are_near == near
            flat = rows[own].reshape(-1, rows.shape[2])
            solved = self._simulator(bool(near), theta).linearise(flat, self.fem.n_jobs, dofs, relative=True)
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

    @property
    def _is_slow(self) -> bool:
        """Whether a reduced model saves time."""
        model = self.fem.model
        is_sparse = getattr(model, "prefer", "threads") == "processes" and hasattr(model, "reduced")
        return is_sparse or hasattr(model, "full") or self.fem.simulator_.reduced is not None

    def _around(self, theta: Array) -> Array:
        """Bounds of the parameters that the chain has learned, which are the same for all records, or of theta too."""
        rows = self.fem.records_.learned
        for _ in range(2):
            lowest, highest = (1 - AROUND) * np.nanmin(rows, axis=0), (1 + AROUND) * np.nanmax(rows, axis=0)
            if ((lowest <= theta) & (theta <= highest)).all():
                break
            rows = np.vstack([rows, theta])
        return np.column_stack([lowest, highest])

    def _simulator(self, near: bool, theta: Array) -> Any:
        """The simulator that has the amounts as further columns of theta, around some rows of it."""
        if near not in self.simulators:
            groups, masses, simulator = self.changes.groups, self.changes.masses, self.fem.simulator_
            box = simulator.box
            if box is None:
                box = self._around(theta)
            box = np.vstack([box, np.ones((len(groups) + len(masses), 2))]) * self.changes.near()
            self.simulators[near] = simulator.with_columns(groups, masses, box if near else None)
        return self.simulators[near]
