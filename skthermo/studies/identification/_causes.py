"""What may have changed, and how probable that is beforehand."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import scipy.sparse

from skthermo._core.arrays import Array, MatrixLike, check_names, is_real, real_array
from skthermo.fem.damage import ALL_GROUPS, read_groups

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
    model_error : float, default=0.05
        Standard deviation of the error of the model's effect on each mode, relative to that effect; the effect on all
        modes together is as uncertain.

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
    model_error: float = 0.05

    def __post_init__(self) -> None:
        numbers = real_array(self.numbers, "numbers")
        if numbers.shape not in ((2,), (3,), (4,)) or (numbers < 0).any() or not np.isclose(numbers.sum(), 1):
            raise ValueError(
                f"numbers is {self.numbers!r}; expected probabilities of none, one, two and at most three causes, "
                "which add up to 1"
            )
        if not isinstance(self.law, str) or self.law not in ("half-normal", "uniform"):
            raise ValueError(f"law is {self.law!r}; expected 'half-normal' or 'uniform'")
        for name in ("severity", "something_else", "model_error"):
            value = getattr(self, name)
            if not is_real(value) or not 0 <= value <= 1 or (name == "severity" and value == 0):
                raise ValueError(f"{name} is {value!r}; expected a number between 0 and 1")
        object.__setattr__(self, "numbers", tuple(numbers.tolist()))


@dataclass(frozen=True, eq=False)
class Cause:
    """Something that may have changed, by one unknown amount between 0 and a bound, which may be negative.

    Amounts are severities of damage (below 0 for stiffening), relative changes of a parameter, or how many times a
    mass pattern was added. ``of`` names the model's groups or the parameter that changes. ``rows`` are the rows of a
    table in which it counts: its own, those of all groups, or the members of a stretch of ``group``. ``scale`` is the
    standard deviation of the amount over the prior's severity, and ``share`` the part of its group's prior
    probability. One that is ``alone`` explains without others.
    """

    name: str
    kind: Literal["damage", "stiffening", "parameter", "mass"] = "damage"
    bound: float = 0.95
    of: tuple[str, ...] = ()
    mass: Any = None
    scale: float = 1.0
    rows: tuple[Hashable, ...] = ()
    group: str = ""
    share: float = 1.0
    alone: bool = False

    @property
    def direction(self) -> int:
        """1 + direction * amount is the factor of what changes."""
        return -1 if self.kind in ("damage", "stiffening") else 1

    def excludes(self, other: Cause) -> bool:
        """Whether both change the same thing, in opposite directions."""
        is_same = self.direction == other.direction and set(self.of) & set(other.of)
        return bool(is_same) and (self.bound > 0) != (other.bound > 0)


def read_causes(
    model: Any,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None,
    stiffening: bool | Sequence[str] | None,
    parameters: Sequence[str] | None,
    added_mass: Mapping[str, MatrixLike] | None,
) -> list[Cause]:
    """Causes that are asked for, and an even loss in all groups."""
    members = read_groups(model, groups)
    causes = [Cause(name, of=tuple(of)) for name, of in members.items()]
    known = {name: [name] for name in model.groups} | members
    if stiffening is None or isinstance(stiffening, bool | np.bool_):
        stiffer = list(members) if stiffening else []
    else:
        stiffer = check_names([stiffening] if isinstance(stiffening, str) else stiffening, "stiffening", sorted(known))
    causes += [Cause(f"{name} stiffer", "stiffening", -1.0, tuple(known[name])) for name in stiffer]
    asked = [parameters] if isinstance(parameters, str) else parameters or []
    for name in check_names(asked, "parameters", model.parameter_names):
        causes += [
            Cause(f"{name} {way}", "parameter", end, (name,)) for way, end in (("lower", -0.95), ("higher", 1.0))
        ]
    causes += [  # up to three times; what takes mass away, once at most; once is as likely as usual
        Cause(name, "mass", 3.0 if lowest >= 0 else 1.0, mass=mass, scale=5.0)
        for name, (mass, lowest) in _read_masses(model, added_mass).items()
    ]
    names = [cause.name for cause in causes]
    wrong = [name for name in names if name in (SOMETHING_ELSE, NO_DAMAGE, ALL_GROUPS, "") or names.count(name) > 1]
    if wrong:
        raise ValueError(
            f"causes have the names {wrong}; expected names in groups or added_mass that differ from each other and "
            f"from {SOMETHING_ELSE!r}, {NO_DAMAGE!r} and {ALL_GROUPS!r}"
        )
    causes = [replace(cause, rows=(cause.name,), group=cause.name) for cause in causes]
    if len(members) > 1:
        everything = tuple(dict.fromkeys(name for of in members.values() for name in of))
        causes.append(Cause(ALL_GROUPS, of=everything, rows=tuple(members), group=ALL_GROUPS, alone=True))
    return causes


def _read_masses(model: Any, added_mass: Any) -> dict[str, tuple[Any, float]]:
    """Mass patterns, and the lowest mass of each."""
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
        found[name] = (matrix, float((matrix if matrix.ndim == 1 else matrix.diagonal()).min()))
    return found


def changed(model: Any, theta: Array, causes: Sequence[Cause], amounts: Sequence[float]) -> tuple[Any, Array]:
    """The model, and its parameters theta (1, n_parameters), after some amounts of causes."""
    stiffness: dict[str, float] = {}
    theta = theta.copy()
    for cause, amount in zip(causes, amounts, strict=True):
        match cause.kind:
            case "mass":
                model = model.with_added(mass=amount * cause.mass)
            case "parameter":
                theta[:, list(model.parameter_names).index(cause.of[0])] *= 1 + amount
            case _:
                for name in cause.of:
                    stiffness[name] = stiffness.get(name, 1.0) * (1 - amount)
    damage = {name: float(1 - factor) for name, factor in stiffness.items()}
    return (model.damaged(damage) if damage else model), theta
