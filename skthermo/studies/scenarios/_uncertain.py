"""Damage that is known with uncertainty."""

from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from skthermo.studies.scenarios._base import BaseScenario, check_name, check_severities, only_group


@dataclass(frozen=True, eq=False, repr=False)
class UncertainDamage(BaseScenario):
    """Damage that is known with uncertainty: every repeat of a study takes another draw of its severities.

    Parameters
    ----------
    name : str
        Unique in a study.
    draws : DataFrame of shape (n_draws, n_groups)
        Severities; columns are damage groups of the model. Repeats beyond the last draw begin again with the first.

    Attributes
    ----------
    family : None
        It belongs to no family, because its records have many severities.
    severity : float
        Mean severity of the damage group, if there is one alone, else NaN.

    Raises
    ------
    ValueError
        If the name is not a text, or ``draws`` is not a frame of possible severities.

    Examples
    --------
    >>> import pandas as pd
    >>> from skthermo.studies import UncertainDamage
    >>> settled = UncertainDamage("settled pier", pd.DataFrame({"pier": [0.24, 0.31, 0.28]}))
    >>> settled
    UncertainDamage('settled pier', pier=0.277, 3 draws)
    >>> settled.changes(None, repeat=1)
    {'damage': {'pier': 0.31}}
    """

    name: str
    draws: pd.DataFrame
    family: None = field(init=False, default=None)
    severity: float = field(init=False)

    def __post_init__(self) -> None:
        check_name(self.name)
        if not isinstance(self.draws, pd.DataFrame) or not self.draws.size:
            raise ValueError(f"draws is {self.draws!r:.200}; expected a frame with a column for each damage group")
        if self.draws.columns.has_duplicates:
            raise ValueError(f"draws has the columns {list(self.draws.columns)}; expected each damage group once")
        for group, severities in self.draws.items():
            check_severities(severities, group, self.name)
        means = {str(group): float(mean) for group, mean in self.draws.mean().items()}
        object.__setattr__(self, "severity", only_group(means)[1])

    @property
    def n_draws(self) -> int:  # type: ignore[override]
        """How many different states there are."""
        return len(self.draws)

    @property
    def groups(self) -> tuple[str, ...]:
        """Damage groups that it changes."""
        return tuple(self.draws.columns)

    def _changes(self, T: Any, repeat: int) -> dict[str, Any]:
        draw = self.draws.iloc[repeat % len(self.draws)]
        return {"damage": {group: float(severity) for group, severity in draw.items()}}

    def __repr__(self) -> str:
        means = ", ".join(f"{group}={mean:.3g}" for group, mean in self.draws.mean().items())
        return f"UncertainDamage({self.name!r}, {means}, {len(self.draws)} draws)"
