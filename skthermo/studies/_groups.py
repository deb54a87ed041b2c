"""Damage groups to look for."""

from collections.abc import Mapping, Sequence
from typing import Any


def read_groups(model: Any, groups: Sequence[str] | Mapping[str, Sequence[str]] | None) -> dict[str, list[str]]:
    """Groups of the model by name; several of them where they are joined.

    Raises
    ------
    ValueError
        If the model cannot be damaged, a group is unknown, or there is none.
    """
    if not hasattr(model, "damaged") or not hasattr(model, "groups"):
        raise ValueError(f"{model!r} has no damage groups; expected a model that can be damaged, such as AffineModel")
    known = model.groups
    if groups is None:
        members = {name: [name] for name in _not_made_of_others(known)}
    elif isinstance(groups, Mapping):
        members = {str(name): [joined] if isinstance(joined, str) else list(joined) for name, joined in groups.items()}
    else:
        members = {name: [name] for name in ([groups] if isinstance(groups, str) else groups)}
    asked = [name for joined in members.values() for name in joined]
    unknown = [name for name in asked if name not in known]
    if unknown:
        raise ValueError(f"unknown damage groups {unknown}; expected some of {sorted(known)}")
    if not asked or not all(members.values()):
        raise ValueError(f"groups is {groups!r}; expected one or more of {sorted(known)}")
    return members


def _not_made_of_others(known: Mapping[str, Any]) -> list[str]:
    """Groups without those whose terms smaller groups have."""
    terms = {name: set(positions) for name, positions in known.items()}
    kept = []
    for name, own in terms.items():
        smaller = [other for other in terms.values() if other < own]
        if not smaller or set().union(*smaller) != own:
            kept.append(name)
    return kept
