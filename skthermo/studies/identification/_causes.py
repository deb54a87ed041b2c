"""What may have changed, and what is thought of it beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse

from skthermo._core.arrays import MatrixLike, check_names, is_real, real_array
from skthermo.fem.damage import ALL_GROUPS, read_groups
from skthermo.surrogate.effects import HIGHEST_SEVERITY, StructuralChanges

MOST_CAUSES = 3  # largest number of causes in one explanation

MOST_STIFFER = 1.0  # largest share of stiffness that a group may gain
MOST_HIGHER = 1.0  # largest relative increase of a parameter
MOST_TIMES = 3.0  # how many times a mass pattern may be added
LIKELY_TIMES = 5.0  # scale of the number of times, relative to that of severities
SOMETHING_ELSE, NO_DAMAGE = "something else", "no damage"


@dataclass(frozen=True)
class DamagePrior:
    """What is thought of damage before the records are seen: how many causes, how severe, and what else.

    Parameters
    ----------
    numbers : tuple of float, default=(0.5, 0.3, 0.15, 0.05)
        Probabilities that none, one, two or three causes changed the structure; at most four numbers, which add up
        to 1. All sets of as many causes are equally probable.
    severity : float, default=0.2
        Scale of severities: the standard deviation of the half-normal law before it ends at a cause's bounds, or the
        largest severity of the uniform law.
    law : {"half-normal", "uniform"}, default="half-normal"
        Law of severities.
    something_else : float, default=0.05
        Probability that something else shifted the frequencies too: a shift of each mode, independent from mode to
        mode, of unknown size; 0 leaves it out.
    model_error : float, default=0.03
        Standard deviation of the error of the model's effect on each mode, relative to that effect. It may be three
        times as large or as small, as the misfit of the modes says; the effect on all modes together is as uncertain.

    Raises
    ------
    ValueError
        If a value is not possible.

    Examples
    --------
    >>> from skthermo.studies import DamagePrior
    >>> DamagePrior(severity=0.3).law
    'half-normal'
    """

    numbers: tuple[float, ...] = (0.5, 0.3, 0.15, 0.05)
    severity: float = 0.2
    law: Literal["half-normal", "uniform"] = "half-normal"
    something_else: float = 0.05
    model_error: float = 0.03

    def __post_init__(self) -> None:
        numbers = real_array(self.numbers, "numbers")
        if (
            numbers.ndim != 1
            or not 1 < len(numbers) <= MOST_CAUSES + 1
            or not (numbers >= 0).all()
            or not np.isclose(numbers.sum(), 1)
        ):
            raise ValueError(
                f"numbers is {self.numbers!r}; expected probabilities of none, one, two and at most three causes, "
                "which add up to 1"
            )
        if not isinstance(self.law, str) or self.law not in ("half-normal", "uniform"):
            raise ValueError(f"law is {self.law!r}; expected 'half-normal' or 'uniform'")
        for name, lowest, highest in (("severity", 0, 1), ("something_else", 0, 1), ("model_error", 0, 1)):
            value = getattr(self, name)
            if not is_real(value) or not lowest <= value <= highest or (name == "severity" and value == 0):
                raise ValueError(f"{name} is {value!r}; expected a number between {lowest} and {highest}")
        object.__setattr__(self, "numbers", tuple(numbers.tolist()))


@dataclass(frozen=True)
class Cause:
    """Something that may have changed, by one unknown amount between ``ci_low`` and ``ci_high``, one of them 0.

    Amounts are severities of damage (below 0 for stiffening), relative changes of a parameter, or how many times a
    mass pattern was added. ``scale`` is the standard deviation of the half-normal law of amounts, relative to the
    severity of the prior. ``of`` names the model's groups, the parameter, or the mass pattern.
    """

    name: str
    kind: Literal["damage", "stiffening", "parameter", "mass"] = "damage"
    lowest: float = 0.0
    highest: float = HIGHEST_SEVERITY
    scale: float = 1.0
    of: tuple[str, ...] = ()
    is_even: bool = False  # the same in all groups, which explains alone

    def excludes(self, other: Cause) -> bool:
        """Whether only one of them can be true: one is even, or both change the same thing in opposite directions."""
        if self.is_even or other.is_even:
            return True
        acts_on = ({"damage": "stiffness", "stiffening": "stiffness"}.get(one.kind, one.kind) for one in (self, other))
        is_same = len(set(acts_on)) == 1 and bool(set(self.of) & set(other.of))
        return is_same and (self.highest > 0) != (other.highest > 0)


def read_causes(
    model: Any,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    stiffening: bool | Sequence[str] | None = None,
    parameters: Sequence[str] | None = None,
    added_mass: Mapping[str, MatrixLike] | None = None,
    *,
    even: bool = False,
) -> tuple[list[Cause], StructuralChanges]:
    """Causes that are asked for, an even loss in all groups if wanted, and what they do to the model's parameters."""
    members = read_groups(model, groups)
    stiffer = _read_stiffening(model, members, stiffening)
    asked = [parameters] if isinstance(parameters, str) else parameters or []
    moved = check_names(asked, "parameters", model.parameter_names)
    masses = _read_masses(model, added_mass)
    causes = [Cause(name, of=tuple(of)) for name, of in members.items()]
    causes += [Cause(f"{name} stiffer", "stiffening", -MOST_STIFFER, 0.0, of=tuple(of)) for name, of in stiffer.items()]
    for name in moved:
        causes.append(Cause(f"{name} lower", "parameter", -HIGHEST_SEVERITY, 0.0, of=(name,)))
        causes.append(Cause(f"{name} higher", "parameter", 0.0, MOST_HIGHER, of=(name,)))
    causes += [Cause(name, "mass", 0.0, highest, LIKELY_TIMES, of=(name,)) for name, (_, highest) in masses.items()]
    names = [cause.name for cause in causes]
    reserved = [name for name in names if name in (SOMETHING_ELSE, NO_DAMAGE, ALL_GROUPS, "")]
    if reserved:
        raise ValueError(
            f"causes have the names {reserved}; expected other names in groups or added_mass, since "
            f"{SOMETHING_ELSE!r}, {NO_DAMAGE!r} and {ALL_GROUPS!r} are explanations of their own"
        )
    repeated = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if repeated:
        raise ValueError(f"the causes {repeated} have the same names; expected other names in groups or added_mass")
    if even and len(members) > 1:
        everything = tuple(dict.fromkeys(name for of in members.values() for name in of))
        causes.append(Cause(ALL_GROUPS, of=everything, is_even=True))
    return causes, changes_of(model, causes, {name: mass for name, (mass, _) in masses.items()})


def changes_of(model: Any, causes: Sequence[Cause], masses: Mapping[str, Any]) -> StructuralChanges:
    """What the amounts of causes do to the parameters of a model."""
    parameters = list(model.parameter_names)
    of_groups = [cause for cause in causes if cause.kind in ("damage", "stiffening")]
    groups = list(dict.fromkeys(name for cause in of_groups for name in cause.of))
    directions = np.zeros((len(causes), len(parameters) + len(groups) + len(masses)))
    first_group, first_mass = len(parameters), len(parameters) + len(groups)
    for row, cause in zip(directions, causes, strict=True):
        if cause.kind == "parameter":
            row[parameters.index(cause.of[0])] = 1
        elif cause.kind == "mass":
            row[first_mass + list(masses).index(cause.of[0])] = 1
        else:
            row[[first_group + groups.index(name) for name in cause.of]] = -1
    return StructuralChanges(groups, directions, np.array([(cause.lowest, cause.highest) for cause in causes]), masses)


def _read_stiffening(
    model: Any, members: Mapping[str, Sequence[str]], stiffening: bool | Sequence[str] | None
) -> Mapping[str, Sequence[str]]:
    """Groups that may have become stiffer, as those of the model."""
    if stiffening is None or isinstance(stiffening, bool | np.bool_):
        return members if stiffening else {}
    known = {name: [name] for name in model.groups} | dict(members)
    names = check_names([stiffening] if isinstance(stiffening, str) else stiffening, "stiffening", sorted(known))
    return {name: known[name] for name in names}


def _read_masses(model: Any, added_mass: Mapping[str, MatrixLike] | None) -> dict[str, tuple[Any, float]]:
    """Mass patterns, and how many times each may be added; what takes mass away, once at most."""
    if added_mass is None:
        return {}
    if not isinstance(added_mass, Mapping) or not all(isinstance(name, str) for name in added_mass):
        raise ValueError(f"added_mass is {added_mass!r:.200}; expected a mapping of name to masses in kg")
    if added_mass and not hasattr(model, "with_added"):
        raise ValueError(f"added_mass is given, but {model!r} has no method 'with_added'; expected an AffineModel")
    found = {}
    for name, mass in added_mass.items():
        try:
            model.with_added(mass=mass)
        except ValueError as error:
            raise ValueError(f"added_mass {name!r}: {error}") from error
        matrix = mass if scipy.sparse.issparse(mass) else np.asarray(mass, dtype=float)
        if not abs(matrix).max() > 0:
            raise ValueError(f"added_mass {name!r} is 0 everywhere; expected kg at some degrees of freedom")
        lowest = (matrix if matrix.ndim == 1 else matrix.diagonal()).min()
        found[name] = (matrix, MOST_TIMES if lowest >= 0 else 1.0)
    return found
