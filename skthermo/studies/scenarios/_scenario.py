"""Changes of the structure that are the same in all records, one at a time or as a sweep over severities."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skthermo._estimators.arguments import as_mapping, check_names
from skthermo._tables.arrays import HUGE, is_real, real_array
from skthermo.studies.scenarios._base import (
    BaseScenario,
    check_groups,
    check_name,
    check_severities,
    mapping_of,
    only_group,
    severities_of,
)


@dataclass(frozen=True, eq=False, repr=False)
class Scenario(BaseScenario):
    """A change of the structure, the same in all records.

    Parameters
    ----------
    name : str
        Unique in a study.
    damage : mapping of str to float, optional
        Severity by damage group of the model: 0.5 halves the stiffness, -0.15 adds 15 %.
    parameters : mapping of str to float, optional
        Factor by parameter of the model, for changes that are not damage, such as 1.02 for ballast that adds 2 % mass.
    stiffness : matrix of shape (n_dof, n_dof), optional
        Added to the model's in N/m.
    mass : matrix of shape (n_dof, n_dof) or array of shape (n_dof,), optional
        Added to the model's in kg; a vector holds lumped masses.
    family : str, optional
        Scenarios of one family differ in severity only, and have a curve of the probability of detection together. By
        default the damage group, if there is one alone.
    severity : float, optional
        Position on that curve. By default the severity of the damage group, if there is one alone, else NaN.

    Raises
    ------
    ValueError
        If the name is not a text, or a severity or factor is impossible.

    Examples
    --------
    >>> from skthermo.studies import Scenario
    >>> Scenario("healthy")
    Scenario('healthy')
    >>> damaged = Scenario("lower chord, a fifth", {"bottom": 0.2})
    >>> damaged.family, damaged.severity
    ('bottom', 0.2)
    """

    name: str
    damage: Mapping[str, float] | None = None
    parameters: Mapping[str, float] | None = field(default=None, kw_only=True)
    stiffness: Any = field(default=None, kw_only=True)
    mass: Any = field(default=None, kw_only=True)
    family: str | None = field(default=None, kw_only=True)
    severity: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        check_name(self.name)
        damage = severities_of(self.damage, self.name)
        given = mapping_of(self.parameters, f"parameters of scenario {self.name!r}", "{parameter: factor}")
        wrong = [f for f in given.values() if not is_real(f) or not 0 < f < HUGE]
        if wrong:
            raise ValueError(
                f"scenario {self.name!r} has the factor {wrong[0]!r:.99}; expected finite and positive ones"
            )
        factors = {name: float(factor) for name, factor in given.items()}
        if self.family is not None and (not isinstance(self.family, str) or not self.family):
            raise ValueError(f"family of scenario {self.name!r} is {self.family!r:.100}; expected a text")
        if self.severity is not None:
            if not is_real(self.severity):
                raise ValueError(f"severity of scenario {self.name!r} is {self.severity!r:.100}; expected a number")
            if not np.isnan(self.severity):
                check_severities(self.severity, self.family, self.name)
        alone = not (factors or self.stiffness is not None or self.mass is not None)
        family, severity = only_group(damage) if alone else (None, np.nan)
        object.__setattr__(self, "damage", damage)
        object.__setattr__(self, "parameters", factors)
        object.__setattr__(self, "family", family if self.family is None else self.family)
        object.__setattr__(self, "severity", severity if self.severity is None else float(self.severity))

    @property
    def groups(self) -> tuple[str, ...]:
        """Damage groups that it changes."""
        return tuple(group for group, severity in (self.damage or {}).items() if severity)

    @property
    def is_healthy(self) -> bool:
        """Whether nothing is changed, so that alarms are false."""
        return not (self.groups or any(factor != 1 for factor in (self.parameters or {}).values())) and (
            self.stiffness is None and self.mass is None
        )

    def _changes(self, T: Any, repeat: int) -> dict[str, Any]:
        asked = {"damage": self.damage or None, "parameters": self.parameters or None}
        asked |= {"stiffness": self.stiffness, "mass": self.mass}
        return {name: value for name, value in asked.items() if value is not None}

    def __repr__(self) -> str:
        return f"Scenario({', '.join([repr(self.name), *(f'{k}={_short(v)}' for k, v in self.changes(None).items())])})"


def read_scenarios(given: Any, model: Any) -> list[BaseScenario]:
    """Scenarios of a study of a model, mappings of groups to severities among them; an error if they are wrong."""
    if isinstance(given, type) or not isinstance(given, Iterable):
        raise ValueError(f"scenarios is {given!r:.200}; expected a list of scenarios, as sweep makes it")
    scenarios, groups = [_as_scenario(one) for one in given], getattr(model, "groups", None)
    wrong = [scenario for scenario in scenarios if not isinstance(scenario, BaseScenario)]
    names = [scenario.name for scenario in scenarios if isinstance(scenario, BaseScenario)]
    if wrong or not names or len(set(names)) < len(names):
        raise ValueError(f"scenarios are {scenarios!r:.500}; expected one or more, each with a name of its own")
    for scenario in scenarios:
        if groups is not None:
            check_groups(scenario.groups, groups)
    return scenarios


def _as_scenario(given: Any) -> Any:
    """A scenario of a mapping of groups to severities, with a name such as "soil 18 %, piers 5 %"; others as they are.

    An empty mapping is the healthy structure.
    """
    mapping = as_mapping(given)
    if not isinstance(mapping, Mapping):
        return given
    damage = severities_of(mapping, f"{dict(mapping)!r:.100}")
    name = ", ".join(f"{group} {100 * severity:g} %" for group, severity in damage.items())
    return Scenario(name or "healthy", damage)


def _short(value: Any) -> str:
    shape = getattr(value, "shape", None)
    return repr(value) if shape is None else f"<{'x'.join(map(str, shape))} matrix>"


def sweep(
    model: Any, severities: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5), groups: Sequence[str] | None = None
) -> list[Scenario]:
    """The healthy structure, and damage of every group at every severity.

    Parameters
    ----------
    model : FE model or DataInformedFEM
        With damage groups.
    severities : sequence of float, default=(0.1, 0.2, 0.3, 0.4, 0.5)
        Shares of the stiffness that are lost; negative ones are gained.
    groups : sequence of str, optional
        Damage groups; by default all.

    Returns
    -------
    list of Scenario
        With names such as "healthy" and "bottom 20 %". Each group is a family. If there are severities of both signs,
        the strengthening of a group is a family of its own, such as "bottom strengthened", since no curve of detection
        can hold both.

    Raises
    ------
    ValueError
        If a group is unknown, a severity is impossible, or the model has no damage groups.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.studies import sweep
    >>> [scenario.name for scenario in sweep(make_truss(), (0.1, 0.2), ["bottom", "top"])]
    ['healthy', 'bottom 10 %', 'bottom 20 %', 'top 10 %', 'top 20 %']
    >>> [scenario.family for scenario in sweep(make_truss(), (-0.1, 0.2), ["bottom"])]
    [None, 'bottom strengthened', 'bottom']
    """
    model = getattr(model, "model", model)
    known = getattr(model, "groups", None)
    if not known:
        raise ValueError(f"{model!r:.200} has no damage groups; expected a model with 'groups', such as AffineModel")
    if isinstance(model, type):
        raise ValueError(f"model is {model!r:.200}; expected an FE model, not its class")
    chosen = list(known) if groups is None else check_names(groups, "groups")
    check_groups(chosen, known)
    shares = real_array(severities, "severities")
    if shares.ndim != 1 or not chosen or len(np.unique(shares)) < shares.size:
        raise ValueError(
            f"severities is {severities!r:.200} and groups {groups!r:.200}; expected different severities, such as "
            "(0.1, 0.2), and groups"
        )
    if (shares == 0).any():
        raise ValueError(f"severities is {severities!r:.200}; expected none of 0, which is the healthy structure")
    severities = shares.tolist()
    has_both = min(severities, default=0) < 0 < max(severities, default=0)

    def scenario(group: str, severity: float) -> Scenario:
        family = f"{group} strengthened" if has_both and severity < 0 else None
        return Scenario(f"{group} {100 * severity:g} %", {group: severity}, family=family)

    return [Scenario("healthy"), *(scenario(group, severity) for group in chosen for severity in severities)]
