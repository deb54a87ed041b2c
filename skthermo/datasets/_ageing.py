"""Stiffness that a structure loses: slowly, at once, or both."""

from collections.abc import Collection, Mapping
from datetime import datetime

import numpy as np
import pandas as pd

from skthermo._tables.arrays import is_real

Stamp = str | datetime | None


def stiffness_factors(
    index: pd.DatetimeIndex,
    records_per_year: float,
    groups: Collection[str],
    drift: Mapping[str, float] | None,
    damage: Mapping[str, float] | None,
    damage_from: Stamp,
    strengthened: Mapping[str, pd.Series] | None = None,
) -> pd.DataFrame:
    """Factor of the stiffness of each changed group in every record."""
    years = pd.Series(np.arange(len(index)) / records_per_year, index)
    is_damaged = pd.Series(index >= _onset(index, damage_from), index)
    lost = {
        "drift": {group: rate * years for group, rate in _by_group(drift, "drift", groups).items()},
        "damage": {group: severity * is_damaged for group, severity in _by_group(damage, "damage", groups).items()},
    }
    factors = {group: 1 + share for group, share in (strengthened or {}).items()}
    for what, shares in lost.items():
        for group, share in shares.items():
            if share.max() >= 1:
                raise ValueError(f"{what} of group {group!r} takes away {share.max():g} of its stiffness; expected < 1")
            factors[group] = factors.get(group, 1.0) * (1 - share)
    return pd.DataFrame(factors, index)


def _by_group(values: Mapping[str, float] | None, what: str, groups: Collection[str]) -> Mapping[str, float]:
    """The values, checked."""
    values = {} if values is None else values
    if not isinstance(values, Mapping) or not set(values) <= set(groups):
        raise ValueError(f"{what} is {values!r:.200}; expected a mapping whose keys are some of {sorted(groups)}")
    for group, value in values.items():
        if not is_real(value) or not np.isfinite(value):
            raise ValueError(f"{what} of group {group!r} is {value!r}; expected a finite number")
    return values


def _onset(index: pd.DatetimeIndex, damage_from: Stamp) -> pd.Timestamp:
    """When the damage begins."""
    if damage_from is None:
        return index[0]
    try:
        onset = pd.Timestamp(damage_from)
        if index[0] <= onset <= index[-1]:
            return onset
    except (TypeError, ValueError) as error:
        raise ValueError(f"damage_from is {damage_from!r}; expected a time without time zone ({error})") from error
    raise ValueError(f"damage_from is {damage_from!r}; expected a time from {index[0]} to {index[-1]}")
