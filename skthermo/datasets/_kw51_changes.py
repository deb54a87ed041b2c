"""Changes of KW51's stiffness in time: retrofit, drift, damage."""

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from skthermo.datasets._kw51_truth import truth_model

YEAR = 8766.0  # hours


def stiffness_factors(
    index: pd.DatetimeIndex,
    strengthened: Mapping[str, pd.Series],
    drift: Mapping[str, float] | None,
    damage: Mapping[str, float] | None,
    damage_from: Any,
) -> pd.DataFrame:
    """Factor of the stiffness of each changed group in every hour.

    Raises
    ------
    ValueError
        If a group is unknown, a value is not a number, no stiffness is left, or the time of damage is not in the index.
    """
    years = pd.Series(np.arange(len(index)) / YEAR, index)
    is_damaged = pd.Series(index >= _onset(index, damage_from), index)
    lost = {
        "drift": {group: rate * years for group, rate in _by_group(drift, "drift").items()},
        "damage": {group: severity * is_damaged for group, severity in _by_group(damage, "damage").items()},
    }
    factors = {group: 1 + share for group, share in strengthened.items()}
    for what, groups in lost.items():
        for group, share in groups.items():
            if share.max() >= 1:
                raise ValueError(f"{what} of group {group!r} takes away {share.max():g} of its stiffness; expected < 1")
            factors[group] = factors.get(group, 1.0) * (1 - share)
    return pd.DataFrame(factors, index)


def _by_group(values: Mapping[str, float] | None, what: str) -> Mapping[str, float]:
    """The values, checked."""
    values = {} if values is None else values
    groups = truth_model().groups
    if not isinstance(values, Mapping) or not set(values) <= set(groups):
        raise ValueError(f"{what} is {values!r:.200}; expected a mapping whose keys are some of {sorted(groups)}")
    for group, value in values.items():
        if not isinstance(value, Real) or not np.isfinite(value):
            raise ValueError(f"{what} of group {group!r} is {value!r}; expected a finite number")
    return values


def _onset(index: pd.DatetimeIndex, damage_from: Any) -> pd.Timestamp:
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
