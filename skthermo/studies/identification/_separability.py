"""Which damage groups can be distinguished by their effects."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from skthermo._tables.arrays import Array
from skthermo.studies.identification._causes import Cause

VISIBLE = 0.1  # largest standard error with which a severity counts as known
IMITATING_SHARE = 0.25  # smallest share in the reproduced effect with which a group counts as imitating another


def cosines(slopes: Array) -> Array:
    """Cosines between the whitened effects of groups, (n_groups, n_groups)."""
    unit = slopes / np.linalg.norm(slopes, axis=0)
    return unit.T @ unit


def errors_alone(slopes: Array) -> Array:
    """Standard error of each severity if no other group could be damaged, (n_groups,)."""
    return 1 / np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)


def errors_together(slopes: Array, causes: Sequence[Cause], severity: float) -> Array:
    """Standard error of each amount if all others may have changed as much as is likely beforehand, (n_causes,)."""
    information = slopes.T @ slopes + np.diag([(severity * cause.scale) ** -2 for cause in causes])
    errors = []
    for column, cause in enumerate(causes):
        beside = [other for other, one in enumerate(causes) if other == column or not cause.excludes(one)]
        inverse = np.linalg.inv(information[np.ix_(beside, beside)])
        errors.append(np.sqrt(inverse[beside.index(column), beside.index(column)]))
    return np.array(errors)


def precision(slopes: Array, n_frequencies: int, causes: Sequence[Cause], severity: float) -> pd.DataFrame:
    """Cramer-Rao bounds of each cause alone and beside the others; if there are shapes, without them, too.

    The first rows of the slopes, (n_observed, n_causes), in standard errors, are those of frequencies.
    """
    parts = {"": slopes}
    if len(slopes) > n_frequencies:
        parts["_without_shapes"] = slopes[:n_frequencies]
    columns = {f"alone{name}": errors_alone(part) for name, part in parts.items()}
    columns |= {f"together{name}": errors_together(part, causes, severity) for name, part in parts.items()}
    return pd.DataFrame(columns, index=[cause.name for cause in causes])


def indistinguishable_groups(slopes: Array) -> list[tuple[int, ...]]:
    """Sets of two or three groups of which one looks like the other or the other two together, most similar first.

    Only the part of an effect that no non-negative combination of the others reproduces is informative.
    """
    lengths = np.linalg.norm(slopes, axis=0)
    alike, size = cosines(slopes), slopes.shape[1]
    found: dict[tuple[int, ...], float] = {}
    for group in range(size):
        others = np.delete(np.arange(size), group)
        rest = np.sqrt(np.maximum(1 - np.maximum(alike[group, others], 0.0) ** 2, 0.0))
        for other in np.flatnonzero(rest * lengths[group] * VISIBLE < 1):
            members = tuple(sorted((group, int(others[other]))))
            found[members] = min(float(rest[other]), found.get(members, 1.0))
    pairs = list(found)
    for group in range(size):
        first, second = np.triu_indices(size, 1)
        along, first_along, second_along = alike[first, second], alike[group, first], alike[group, second]
        left = np.maximum(1 - along**2, np.finfo(float).eps)
        shares = (first_along - along * second_along) / left, (second_along - along * first_along) / left
        rest = np.sqrt(np.maximum(1 - shares[0] * first_along - shares[1] * second_along, 0.0))
        looks = (rest * lengths[group] * VISIBLE < 1) & (np.minimum(*shares) >= IMITATING_SHARE)
        for place in np.flatnonzero(looks & (first != group) & (second != group)):
            members = tuple(sorted((group, int(first[place]), int(second[place]))))
            if not any(set(pair) <= set(members) for pair in pairs):
                found[members] = min(float(rest[place]), found.get(members, 1.0))
    return sorted(found, key=lambda members: found[members])
