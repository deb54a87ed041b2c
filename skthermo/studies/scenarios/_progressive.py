"""Damage that begins during the records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skthermo._tables.times import row_times, time_of
from skthermo.studies.scenarios._base import BaseScenario, check_name, only_group, severities_of


@dataclass(frozen=True, eq=False)
class ProgressiveDamage(BaseScenario):
    """Damage that begins during the records, suddenly or growing.

    Parameters
    ----------
    name : str
        Unique in a study.
    damage : mapping of str to float
        Final severity by damage group of the model.
    onset : int or time
        When damage begins: the number of a record counted from 0 or, for temperatures on a ``DatetimeIndex``, a time.
    end : int or time, optional
        When the final severity is reached; in between it grows linearly. By default damage is sudden.

    Attributes
    ----------
    family : str or None
        The damage group of sudden damage, if there is one alone. Growing damage belongs to no family, because its
        records have many severities.
    severity : float
        Final severity of the damage group, if there is one alone, else NaN.

    Raises
    ------
    ValueError
        If the name is not a text, or a severity is impossible.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.studies import ProgressiveDamage
    >>> crack = ProgressiveDamage("growing crack", {"bottom": 0.2}, onset=2, end=4)
    >>> crack.changes(np.zeros((6, 3)))["damage"]["bottom"]
    array([0. , 0. , 0. , 0.1, 0.2, 0.2])
    """

    name: str
    damage: Mapping[str, float]
    onset: Any
    end: Any = None
    family: str | None = field(init=False)
    severity: float = field(init=False)

    def __post_init__(self) -> None:
        check_name(self.name)
        damage = severities_of(self.damage, self.name)
        family, severity = only_group(damage)
        object.__setattr__(self, "damage", damage)
        object.__setattr__(self, "family", family if self.end is None else None)
        object.__setattr__(self, "severity", severity)

    @property
    def groups(self) -> tuple[str, ...]:
        """Damage groups that it changes."""
        return tuple(group for group, severity in self.damage.items() if severity)

    def _changes(self, T: Any, repeat: int) -> dict[str, Any]:
        times, onset = row_times(T), time_of(T, self.onset, "onset")
        end = onset if self.end is None else time_of(T, self.end, "end")
        if not np.isfinite(end) or end < onset or onset > times.max():
            raise ValueError(
                f"scenario {self.name!r} has onset {self.onset!r} and end {self.end!r} for {len(times)} records; "
                "expected an onset that is not after the last record, and an end that is not before it"
            )
        grown = (times - onset) / (end - onset) if end > onset else (times >= onset).astype(float)
        return {"damage": {group: np.clip(grown, 0, 1) * severity for group, severity in self.damage.items()}}
