"""Which damage groups can be told apart by their effects."""

import numpy as np
from scipy.optimize import nnls

from skthermo._arrays import Array

VISIBLE = 0.1  # largest standard error with which a severity counts as known
IMITATING_SHARE = 0.25  # smallest share in the reproduced effect with which a group counts as imitating another


def cosines(slopes: Array) -> Array:
    """Cosines between the whitened effects of groups, (n_groups, n_groups)."""
    unit = slopes / np.linalg.norm(slopes, axis=0)
    return unit.T @ unit


def errors_alone(slopes: Array) -> Array:
    """Standard error of each severity if no other group could be damaged, (n_groups,)."""
    return 1 / np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)


def confused_groups(slopes: Array) -> list[tuple[int, ...]]:
    """Sets of groups of which damage in one looks like damage in the others, most similar first.

    Only the part of an effect that no non-negative combination of other groups reproduces is informative.
    """
    found: dict[tuple[int, ...], float] = {}
    lengths = np.linalg.norm(slopes, axis=0)
    unit = slopes / lengths
    for group in range(unit.shape[1] if unit.shape[1] > 1 else 0):
        others = np.delete(np.arange(unit.shape[1]), group)
        shares, rest = nnls(unit[:, others], unit[:, group])
        if rest * lengths[group] * VISIBLE < 1:
            members = tuple(sorted([group, *others[shares >= IMITATING_SHARE].tolist()]))
            found[members] = min(rest, found.get(members, 1.0))
    return sorted((members for members in found if len(members) > 1), key=lambda members: found[members])
