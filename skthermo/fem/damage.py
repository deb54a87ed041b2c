"""Damage groups of a model as users name them, and the directions in which small losses move its frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from skthermo._core.arrays import Array, as_floats, check_names

if TYPE_CHECKING:
    import pandas as pd

ALL_GROUPS = "all groups"  # the name of an even change of all of them
LossKind = Literal["stiffness", "section"]  # of what damage groups lose


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


def check_kind(kind: Any) -> None:
    """Raise an error for what is no kind of loss."""
    if not isinstance(kind, str) or kind not in get_args(LossKind):
        raise ValueError(f"kind is {kind!r:.200}; expected 'stiffness' or 'section'")


def kind_option(model: Any, kind: LossKind) -> dict[str, LossKind]:
    """The argument of a model's methods for a kind of loss; none for stiffness, which every model can lose."""
    check_kind(kind)
    if kind == "section" and not hasattr(model, "group_mass"):
        raise ValueError(
            f"{model!r} does not know the mass of its damage groups, which a loss of section takes away; expected "
            "kind='stiffness', or an AffineModel that knows it, as Structure.assemble or group_mass gives it"
        )
    return {} if kind == "stiffness" else {"kind": kind}


def direction_name(group: str, kind: LossKind) -> str:
    """The name of the loss of a group among directions and parameters."""
    return group if kind == "stiffness" else f"{group}, section"


def damage_directions(
    model: Any, groups: Sequence[str] | None = None, kind: LossKind | None = None, theta: Array | None = None
) -> pd.DataFrame:
    """Directions of a model at theta (1, n_parameters), by default its nominal state, exact where the model can have
    parameters for damage."""
    theta = np.ones((1, len(model.parameter_names))) if theta is None else theta
    slopes, names = [], []
    for one, own in losses(model, groups, kind).items():
        names += [direction_name(group, one) for group in own]
        if hasattr(model, "with_damage_parameters"):
            changed = model.with_damage_parameters(own, **kind_option(model, one))
            rows = np.hstack([theta, np.ones((1, len(own)))])
            slopes += [*-changed.jacobian(rows)[0][:, -len(own) :].T / changed.frequencies(rows)[0]]
        else:
            slopes += [_difference(model, group, one, theta) for group in own]
    return as_directions(np.array(slopes), names, range(model.n_modes))


def losses(model: Any, groups: Sequence[str] | None, kind: LossKind | None) -> dict[LossKind, list[str]]:
    """Damage groups of each kind of loss; by default those that have mass are of both."""
    names = list(read_groups(model, None if groups is None else check_names(groups, "groups")))
    if kind is not None:
        check_kind(kind)
        return {kind: names}
    masses = getattr(model, "group_mass", {})
    heavy = [name for name in names if name in masses and masses[name].nnz]
    return {"stiffness": names, "section": heavy} if heavy else {"stiffness": names}


def _difference(model: Any, group: str, kind: LossKind, theta: Array, step: float = 1e-3) -> Array:
    """Central difference of the logarithms of the frequencies by the severity of a group."""
    changed = (model.damaged({group: loss}, **kind_option(model, kind)) for loss in (step, -step))
    above, below = (np.log(as_floats(one.frequencies(theta)))[0] for one in changed)
    return (above - below) / (2 * step)


def as_directions(slopes: Array, names: Sequence[str], modes: Sequence[Any]) -> pd.DataFrame:
    """A row for each loss that moves a frequency, by more than rounding (1e-9)."""
    import pandas as pd

    moved: Any = np.any(np.abs(slopes) > 1e-9, axis=1)
    if not moved.any():
        raise ValueError(f"no loss of the groups {list(names)} moves a frequency; expected one that does")
    return pd.DataFrame(slopes[moved], [name for name, has in zip(names, moved, strict=True) if has], list(modes))
