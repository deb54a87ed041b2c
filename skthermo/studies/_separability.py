"""Which damage groups can be told apart by their effects."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from skthermo._arrays import Array

ALIKE = 0.9
"""Cosine from which effects cannot be told apart: the error of a severity is more than twice that of the group
alone."""

PART = 0.25
"""Share of an effect from which another group counts as one of those that imitate it."""


def cosines(slopes: Array) -> Array:
    """Cosines between the whitened effects of groups, (n_groups, n_groups)."""
    unit = slopes / np.linalg.norm(slopes, axis=0)
    return unit.T @ unit


def confused_groups(slopes: Array) -> list[tuple[int, ...]]:
    """Sets of groups of which one has nearly the effect of the others together, most alike first."""
    found: dict[tuple[int, ...], float] = {}
    unit = slopes / np.linalg.norm(slopes, axis=0)
    for group in range(unit.shape[1] if unit.shape[1] > 1 else 0):
        others = np.delete(np.arange(unit.shape[1]), group)
        shares, distance = nnls(unit[:, others], unit[:, group])
        cosine = np.sqrt(max(1 - distance**2, 0.0))
        if cosine >= ALIKE:
            members = tuple(sorted([group, *others[shares >= PART].tolist()]))
            found[members] = max(cosine, found.get(members, 0.0))
    return sorted(found, key=lambda members: -found[members])


def merge_confused(slopes: Array, members: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Groups merged two by two, the most alike first, until all can be told apart; each as members of ``slopes``."""
    merged = [tuple(group) for group in members]
    while True:
        together = np.column_stack([slopes[:, list(group)].sum(axis=1) for group in merged])
        confused = confused_groups(together)
        if not confused:
            return merged
        alike = np.triu(cosines(together), 1)
        inside = np.zeros_like(alike, dtype=bool)
        inside[np.ix_(confused[0], confused[0])] = True
        first, second = np.unravel_index(np.where(inside, alike, -np.inf).argmax(), alike.shape)
        kept = [group for place, group in enumerate(merged) if place not in (first, second)]
        merged = sorted([*kept, tuple(sorted(merged[first] + merged[second]))])
