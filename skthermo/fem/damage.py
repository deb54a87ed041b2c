"""Damage groups of a model as users name them, and the directions in which small losses move its frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from skthermo._core.arrays import Array, as_floats, check_names

if TYPE_CHECKING:
    import pandas as pd

ALL_GROUPS = "all groups"  # the name of an even change of all of them


def read_groups(model: Any, groups: Sequence[str] | Mapping[str, Sequence[str]] | None) -> dict[str, list[str]]:
    """Groups of the model by name, each with the groups that it joins; by default those that no others make up."""
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


def damage_directions(model: Any, groups: Sequence[str] | None = None) -> pd.DataFrame:
    """Directions of a model at its nominal state, exact where the model can have parameters for damage."""
    names = names_of_groups(model, groups)
    if hasattr(model, "with_damage_parameters"):
        changed = model.with_damage_parameters(names)
        theta = np.ones((1, len(changed.parameter_names)))
        slopes = -changed.jacobian(theta)[0][:, -len(names) :].T / changed.frequencies(theta)[0]
    else:
        slopes = np.array([_difference(model, name) for name in names])
    return as_directions(slopes, names, range(model.n_modes))


def names_of_groups(model: Any, groups: Sequence[str] | None) -> list[str]:
    """The damage groups that a user names, or those that no others make up."""
    return list(read_groups(model, None if groups is None else check_names(groups, "groups")))


def _difference(model: Any, group: str, step: float = 1e-3) -> Array:
    """Central difference of the logarithms of the frequencies by the severity of a group."""
    nominal = np.ones((1, len(model.parameter_names)))
    above, below = (np.log(as_floats(model.damaged({group: loss}).frequencies(nominal)))[0] for loss in (step, -step))
    return (above - below) / (2 * step)


def as_directions(slopes: Array, groups: Sequence[str], modes: Sequence[Any]) -> pd.DataFrame:
    """A row for each group that moves a frequency, by more than rounding (1e-9)."""
    import pandas as pd

    moved: Any = np.any(np.abs(slopes) > 1e-9, axis=1)
    if not moved.any():
        raise ValueError(f"no loss of stiffness of the groups {groups} moves a frequency; expected one that does")
    return pd.DataFrame(slopes[moved], [group for group, has in zip(groups, moved, strict=True) if has], list(modes))
