"""Measured shifts beside the effects of damage, in standard errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.studies.identification._evidence import Observed

Effects = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Part:
    """Shifts of one kind, of frequencies or of mode shapes: NaN where nothing was measured; (n_observed,) each.

    Effects are a function from severities of the model's groups to the change and its derivatives. ``sizes`` is what
    a relative shift of 1 is; errors follow Student's law with ``freedom``.
    """

    effects: Effects
    measured: Array
    covariance: Array
    sizes: Array
    freedom: float = np.inf

    @property
    def is_known(self) -> NDArray[np.bool_]:
        return ~np.isnan(self.measured)


def remembered(effects: Effects) -> Effects:
    """The same effects, computed once for each set of severities, because all fits begin at the same."""
    solved: dict[bytes, tuple[Array, Array]] = {}

    def at(severities: Array) -> tuple[Array, Array]:
        key = severities.tobytes()
        if key not in solved:
            solved[key] = effects(severities)
        return solved[key]

    return at


@dataclass(frozen=True)
class Comparison:
    """All measured shifts, and the effects of some groups on them.

    ``incidence``, (n_model_groups, n_groups), is 1 where a group contains a group of the model.
    """

    parts: list[Part]
    incidence: Array
    names: Sequence[str] = ()
    of_model: Sequence[str] = ()

    @property
    def contents(self) -> dict[str, list[str]]:
        """The model's groups that each group contains."""
        return {
            name: [group for group, inside in zip(self.of_model, column, strict=True) if inside]
            for name, column in zip(self.names, self.incidence.T, strict=True)
        }

    def slopes(self) -> Array:
        """Effects of small severities in standard errors, (n_observed, n_groups)."""
        return self.whitening @ self.effects(np.zeros(self.incidence.shape[1]))[1]

    def observed(self) -> Observed:
        """What was measured."""
        return Observed.of(
            [
                (p.measured[p.is_known], p.covariance[np.ix_(p.is_known, p.is_known)], p.sizes[p.is_known], p.freedom)
                for p in self.parts
            ]
        )

    def members(self, severities: Array) -> Array:
        """Severities of the model's groups, (..., n_model_groups), by those of the groups, (..., n_groups)."""
        return 1 - np.prod(np.where(self.incidence > 0, 1 - severities[..., np.newaxis, :], 1.0), axis=-1)

    def effects(self, severities: Array) -> tuple[Array, Array]:
        """Changes, (n_observed,), and their derivatives by the severities, (n_observed, n_groups)."""
        members = self.members(severities)
        inner = self.incidence * np.outer(1 - members, 1 / (1 - severities))
        solved = [part.effects(members) for part in self.parts]
        kept = [~np.isnan(part.measured) for part in self.parts]
        changes = [change[rows] for (change, _), rows in zip(solved, kept, strict=True)]
        slopes = [slope[rows] @ inner for (_, slope), rows in zip(solved, kept, strict=True)]
        return np.concatenate(changes), np.vstack(slopes)

    @property
    def whitening(self) -> Array:
        """Matrix that makes the errors of the shifts independent, with unit variance."""
        roots = []
        for part in self.parts:
            rows = ~np.isnan(part.measured)
            lower = np.linalg.cholesky(part.covariance[np.ix_(rows, rows)])
            roots.append(scipy.linalg.solve_triangular(lower, np.eye(len(lower)), lower=True))
        return scipy.linalg.block_diag(*roots)
