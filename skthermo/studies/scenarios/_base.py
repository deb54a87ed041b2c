"""The base of all scenarios, and checks of what a study is given."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skthermo._estimators.arguments import as_mapping
from skthermo._tables.arrays import real_array
from skthermo._validation import check_is_fitted

LOWEST_SEVERITY = -10.0  # lowest severity accepted; a lower number is probably meant in percent


class BaseScenario(ABC):
    """What changes in a structure from the onset on; scenarios of one family differ in severity only.

    The severity is NaN where there is no single one, and the onset None where the change is there from the beginning.
    The repeats of a study take ``n_draws`` different states in turn.
    """

    name: str
    family: str | None
    severity: float | None
    onset: Any = None
    n_draws: int = 1

    @property
    @abstractmethod
    def groups(self) -> tuple[str, ...]:
        """Damage groups that are changed."""

    @property
    def is_healthy(self) -> bool:
        """Whether nothing is changed, so that alarms are false."""
        return not self.groups

    def changes(self, T: Any, repeat: int = 0) -> dict[str, Any]:
        """Arguments of `~skthermo.surrogate.DataInformedFEM.simulate` that change the structure as in this scenario.

        Parameters
        ----------
        T : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures of the records to be simulated.
        repeat : int, default=0
            Number of the repeat of a study.

        Returns
        -------
        dict
            Severities may be arrays with one value for each row of T.

        Raises
        ------
        ValueError
            If damage begins at no record of T.
        """
        if not isinstance(repeat, Integral) or isinstance(repeat, bool) or repeat < 0:
            raise ValueError(f"repeat is {repeat!r:.100}; expected the number of a repeat, from 0 on")
        return self._changes(T, int(repeat))

    @abstractmethod
    def _changes(self, T: Any, repeat: int) -> dict[str, Any]:
        """Hook: the arguments that differ from those of the healthy structure."""


def check_chain(fem: Any) -> None:
    """Raise an error for what is not a fitted chain."""
    if isinstance(fem, type) or not hasattr(fem, "simulate"):
        raise ValueError(f"fem is {fem!r:.200}; expected a fitted DataInformedFEM")
    check_is_fitted(fem)


def check_groups(groups: Sequence[str], known: Any) -> None:
    """Raise an error for damage groups that the model does not have."""
    unknown = [group for group in groups if group not in known]
    if unknown:
        raise ValueError(f"damage groups {unknown} are unknown; expected some of {list(known)}")


def check_name(name: Any) -> None:
    """Raise an error if a scenario's name is not a text."""
    if not isinstance(name, str) or not name:
        raise ValueError(f"name is {name!r}; expected a text, such as 'bottom 20 %'")


def severities_of(damage: Any, name: str) -> dict[str, float]:
    """Severity by group as floats."""
    damage = mapping_of(damage, f"damage of scenario {name!r}", "{group: severity}")
    for group, severity in damage.items():
        if not isinstance(group, str):
            raise ValueError(f"scenario {name!r} has the damage group {group!r:.100}; expected a text")
        if np.ndim(severity):
            raise ValueError(
                f"severity of {group!r} in scenario {name!r} has shape {np.shape(severity)}; expected one number, or "
                "ProgressiveDamage for damage that grows"
            )
        check_severities(severity, group, name)
    return {group: float(severity) for group, severity in damage.items()}


def check_severities(severities: ArrayLike, group: Any, name: str) -> None:
    """Raise an error for severities that no structure can have."""
    values = real_array(severities, f"severity of {group!r} in scenario {name!r}")
    wrong = values[~(np.isfinite(values) & (values < 1) & (values >= LOWEST_SEVERITY))]
    if wrong.size:
        raise ValueError(
            f"scenario {name!r} has severities of {group!r} such as {wrong[0]:g}; expected finite shares of the "
            f"stiffness below 1, not percent (0.2 means 20 %), and not below {LOWEST_SEVERITY:g}"
        )


def mapping_of(values: Any, what: str, expected: str) -> Mapping[str, Any]:
    """A mapping, or a Series with names as one; None becomes an empty one."""
    mapping = {} if values is None else as_mapping(values)
    if not isinstance(mapping, Mapping):
        raise ValueError(f"{what} is {values!r:.200}; expected {expected}")
    return mapping


def only_group(damage: Mapping[str, float]) -> tuple[str | None, float]:
    """The damage group and its severity if there is only one, else None and NaN."""
    return next(iter(damage.items())) if len(damage) == 1 else (None, np.nan)
