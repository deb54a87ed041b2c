"""States of the structure in simulated records: damage, strengthening and other changes; checks that studies share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._core.arrays import as_mapping, check_model, check_names, is_real, mapping_of, real_array
from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import Table, row_times, time_of
from skthermo.fem import FEModel
from skthermo.fem.damage import LossKind, check_kind, direction_name
from skthermo.surrogate import DataInformedFEM


class BaseScenario:
    """What changes in a structure from the onset on; scenarios of one family differ in severity only.

    The severity is NaN where there is no single one, and the onset None where the change is there from the beginning.
    The repeats of a study take ``n_draws`` different states in turn.
    """

    name: str
    damage: Mapping[str, float] | None
    family: str | None
    severity: float | None
    kind: LossKind = "stiffness"
    onset: Any = None
    n_draws: int = 1

    @property
    def groups(self) -> tuple[str, ...]:
        """Damage groups that are changed."""
        return tuple(group for group, severity in (self.damage or {}).items() if severity)

    @property
    def is_healthy(self) -> bool:
        """Whether nothing is changed, so that alarms are false."""
        return not self.groups

    def changes(self, T: Table, repeat: int = 0) -> dict[str, Any]:
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
        changes = self._changes(T, int(repeat))
        return changes | {"kind": self.kind} if self.kind != "stiffness" else changes

    def _changes(self, T: Table, repeat: int) -> dict[str, Any]:
        """Hook: the arguments that differ from those of the healthy structure."""
        raise NotImplementedError


def check_chain(fem: DataInformedFEM) -> None:
    """Raise an error for what is not a fitted chain."""
    if isinstance(fem, type) or not hasattr(fem, "simulate"):
        raise ValueError(f"fem is {fem!r:.200}; expected a fitted DataInformedFEM")
    check_is_fitted(fem)


def checked_models(fem: DataInformedFEM, models: Any) -> list[FEModel]:
    """Models that a chain can be refitted with, or an error."""
    if isinstance(models, str) or not isinstance(models, Sequence) or not len(models):
        raise ValueError(f"models is {models!r:.200}; expected a list of FE models, such as sample_models gives")
    wanted = list(fem.model.parameter_names), fem.model.n_modes
    for number, model in enumerate(models):
        found = list(getattr(model, "parameter_names", [])), getattr(model, "n_modes", None)
        if found != wanted:
            raise ValueError(
                f"model {number} of models is {model!r:.200} with parameters {found[0]} and {found[1]} modes; expected "
                f"the chain's {wanted[0]} and {wanted[1]} modes"
            )
    return list(models)


def check_name(name: Any, kind: LossKind) -> None:
    """Raise an error if a scenario's name is not a text, or what damage takes is no kind of loss."""
    if not isinstance(name, str) or not name:
        raise ValueError(f"name is {name!r}; expected a text, such as 'bottom 20 %'")
    check_kind(kind)


def severities_of(damage: Any, name: str) -> dict[str, float]:
    """Severity by group as floats."""
    damage = mapping_of({} if damage is None else damage, f"damage of scenario {name!r}", "{group: severity}")
    for group, severity in damage.items():
        if np.ndim(severity):
            what = f"severity of {group!r} in scenario {name!r} has shape {np.shape(severity)}"
            raise ValueError(f"{what}; expected one number, or ProgressiveDamage for damage that grows")
        check_severities(severity, group, name)
    return {group: float(severity) for group, severity in damage.items()}


def check_severities(severities: ArrayLike, group: Any, name: str, *, lowest: float = -10.0) -> None:
    """Raise an error for severities that no structure can have; a lower one is probably meant in percent."""
    values = real_array(severities, f"severity of {group!r} in scenario {name!r}")
    wrong = values[~(np.isfinite(values) & (values < 1) & (values >= lowest))]
    if wrong.size:
        raise ValueError(
            f"scenario {name!r} has severities of {group!r} such as {wrong[0]:g}; expected finite shares of the "
            f"stiffness below 1, not percent (0.2 means 20 %), and not below {lowest:g}"
        )


def only_group(damage: Mapping[str, float], kind: LossKind) -> tuple[str | None, float]:
    """The family of a loss of a single damage group and its severity, else None and NaN."""
    if len(damage) != 1:
        return None, np.nan
    group, severity = next(iter(damage.items()))
    return direction_name(group, kind), severity


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
    kind : {"stiffness", "section"}, default="stiffness"
        What damage takes: stiffness alone or, with cross-section, mass too. The family of a loss of section is by
        default named as in "bottom, section".

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
    kind: LossKind = field(default="stiffness", kw_only=True)

    def __post_init__(self) -> None:
        check_name(self.name, self.kind)
        damage = severities_of(self.damage, self.name)
        given = {} if self.parameters is None else self.parameters
        factors = mapping_of(given, f"parameters of scenario {self.name!r}", "{parameter: factor}")
        if self.family is not None and (not isinstance(self.family, str) or not self.family):
            raise ValueError(f"family of scenario {self.name!r} is {self.family!r:.100}; expected a text")
        alone = not (factors or self.stiffness is not None or self.mass is not None)
        family, severity = only_group(damage, self.kind) if alone else (None, np.nan)
        if self.severity is not None:
            if not is_real(self.severity):
                raise ValueError(f"severity of scenario {self.name!r} is {self.severity!r:.100}; expected a number")
            if not np.isnan(self.severity):
                check_severities(self.severity, self.family, self.name)
        object.__setattr__(self, "damage", damage)
        object.__setattr__(self, "parameters", factors)
        object.__setattr__(self, "family", family if self.family is None else self.family)
        object.__setattr__(self, "severity", severity if self.severity is None else float(self.severity))

    @property
    def is_healthy(self) -> bool:
        """Whether nothing is changed, so that alarms are false."""
        return not (self.groups or any(factor != 1 for factor in (self.parameters or {}).values())) and (
            self.stiffness is None and self.mass is None
        )

    def _changes(self, T: Table, repeat: int) -> dict[str, Any]:
        asked = {"damage": self.damage or None, "parameters": self.parameters or None}
        asked |= {"stiffness": self.stiffness, "mass": self.mass}
        return {name: value for name, value in asked.items() if value is not None}

    def __repr__(self) -> str:
        return f"Scenario({', '.join([repr(self.name), *(f'{k}={_short(v)}' for k, v in self.changes(None).items())])})"


def read_scenarios(given: Table, model: FEModel) -> list[BaseScenario]:
    """Scenarios of a study of a model, mappings of groups to severities among them; an error if they are wrong."""
    if isinstance(given, type) or not isinstance(given, Iterable):
        raise ValueError(f"scenarios is {given!r:.200}; expected a list of scenarios, as sweep makes it")
    scenarios, known = [_as_scenario(one) for one in given], getattr(model, "groups", None)
    names = {scenario.name for scenario in scenarios if isinstance(scenario, BaseScenario)}
    if not names or len(names) < len(scenarios):
        raise ValueError(f"scenarios are {scenarios!r:.500}; expected one or more, each with a name of its own")
    unknown = {group for one in scenarios for group in one.groups if known is not None and group not in known}
    if unknown:
        raise ValueError(f"damage groups {sorted(unknown, key=str)} are unknown; expected some of {list(known)}")
    return scenarios


def _as_scenario(given: BaseScenario | Mapping[str, float]) -> BaseScenario:
    """A scenario of a mapping of groups to severities, with a name such as "soil 18 %, piers 5 %"; others as they are.

    An empty mapping is the healthy structure.
    """
    mapping = as_mapping(given)
    if not isinstance(mapping, Mapping):
        return given
    damage = severities_of(mapping, f"{dict(mapping)!r:.100}")
    name = ", ".join(f"{group} {100 * severity:g} %" for group, severity in damage.items())
    return Scenario(name or "healthy", damage)


def _short(value: object) -> str:
    shape = getattr(value, "shape", None)
    return repr(value) if shape is None else f"<{'x'.join(map(str, shape))} matrix>"


def sweep(
    model: FEModel,
    severities: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5),
    groups: Sequence[str] | None = None,
    *,
    kind: LossKind = "stiffness",
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
    kind : {"stiffness", "section"}, default="stiffness"
        What damage takes, as in `Scenario`.

    Returns
    -------
    list of Scenario
        With names such as "healthy" and "bottom 20 %", or "bottom, section 20 %". Each group is a family. If there are
        severities of both signs, the strengthening of a group is a family of its own, such as "bottom strengthened",
        since no curve of detection can hold both.

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
    check_model(model)
    chosen = list(known) if groups is None else check_names(groups, "groups", known)
    shares = real_array(severities, "severities")
    if shares.ndim != 1 or not chosen or len({0.0, *shares}) < shares.size + 1:
        raise ValueError(
            f"severities is {severities!r:.200} and groups {groups!r:.200}; expected different severities other than "
            "0, such as (0.1, 0.2), and groups"
        )
    severities = shares.tolist()
    has_both = min(severities, default=0) < 0 < max(severities, default=0)

    def scenario(group: str, severity: float) -> Scenario:
        name = direction_name(group, kind)
        family = f"{name} strengthened" if has_both and severity < 0 else None
        return Scenario(f"{name} {100 * severity:g} %", {group: severity}, family=family, kind=kind)

    return [Scenario("healthy"), *(scenario(group, severity) for group in chosen for severity in severities)]


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
    kind : {"stiffness", "section"}, default="stiffness"
        What damage takes, as in `Scenario`.

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
    kind: LossKind = field(default="stiffness", kw_only=True)

    def __post_init__(self) -> None:
        check_name(self.name, self.kind)
        damage = severities_of(self.damage, self.name)
        family, severity = only_group(damage, self.kind)
        object.__setattr__(self, "damage", damage)
        object.__setattr__(self, "family", family if self.end is None else None)
        object.__setattr__(self, "severity", severity)

    def _changes(self, T: Table, repeat: int) -> dict[str, Any]:
        times, onset = row_times(T), time_of(T, self.onset, "onset")
        end = onset if self.end is None else time_of(T, self.end, "end")
        if not np.isfinite(end) or end < onset or onset > times.max():
            raise ValueError(
                f"scenario {self.name!r} has onset {self.onset!r} and end {self.end!r} for {len(times)} records; "
                "expected an onset that is not after the last record, and an end that is not before it"
            )
        grown = (times - onset) / (end - onset) if end > onset else (times >= onset).astype(float)
        return {"damage": {group: np.clip(grown, 0, 1) * severity for group, severity in self.damage.items()}}


@dataclass(frozen=True, eq=False, repr=False)
class UncertainDamage(BaseScenario):
    """Damage that is known with uncertainty: every repeat of a study takes another draw of its severities.

    Parameters
    ----------
    name : str
        Unique in a study.
    draws : DataFrame of shape (n_draws, n_groups)
        Severities; columns are damage groups of the model. Repeats beyond the last draw begin again with the first.
    kind : {"stiffness", "section"}, default="stiffness"
        What damage takes, as in `Scenario`.

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
    kind: LossKind = field(default="stiffness", kw_only=True)

    def __post_init__(self) -> None:
        check_name(self.name, self.kind)
        if not isinstance(self.draws, pd.DataFrame) or not self.draws.size:
            raise ValueError(f"draws is {self.draws!r:.200}; expected a frame with a column for each damage group")
        if self.draws.columns.has_duplicates:
            raise ValueError(f"draws has the columns {list(self.draws.columns)}; expected each damage group once")
        for group, severities in self.draws.items():
            check_severities(severities, group, self.name)
        means = {str(group): float(mean) for group, mean in self.draws.mean().items()}
        object.__setattr__(self, "severity", only_group(means, self.kind)[1])

    @property
    def n_draws(self) -> int:  # type: ignore[override]
        """How many different states there are."""
        return len(self.draws)

    @property
    def groups(self) -> tuple[str, ...]:
        """Damage groups that it changes."""
        return tuple(self.draws.columns)

    def _changes(self, T: Table, repeat: int) -> dict[str, Any]:
        draw = self.draws.iloc[repeat % len(self.draws)]
        return {"damage": {group: float(severity) for group, severity in draw.items()}}

    def __repr__(self) -> str:
        means = ", ".join(f"{group}={mean:.3g}" for group, mean in self.draws.mean().items())
        kind = "" if self.kind == "stiffness" else f", kind={self.kind!r}"
        return f"UncertainDamage({self.name!r}, {means}, {len(self.draws)} draws{kind})"
