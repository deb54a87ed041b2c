"""Identified damage, as `identify_damage` returns it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from skthermo._arguments import seem_rad_per_s
from skthermo._arrays import Array
from skthermo._formatting import SPACE
from skthermo.studies.identification._bounded_fit import HIGHEST_SEVERITY
from skthermo.studies.identification._compared import ComparedRecords
from skthermo.studies.identification._sentences import answer, damaged, limits
from skthermo.studies.scenarios import UncertainDamage

NEAR_2_PI = 0.25  # relative distance from 2 pi up to which ratios of frequencies suggest rad/s
CLEARLY_HIGHER = 2.0  # standard errors by which a frequency must rise to count as higher


@dataclass(frozen=True, eq=False)
class IdentifiedDamage:
    """Damage that explains a shift of frequencies, with its uncertainty.

    Parameters
    ----------
    table : DataFrame
        One row a damage group: ``severity``; ``standard_error`` of that estimate; ``error_alone``, the standard error
        if no other group could be damaged and strengthening counted too; ``p_value`` and ``significant``, whether the
        group is clearly damaged, which none is unless there is damage at all (``p_value`` of all groups together).
        Two standard errors hold 95 % of the errors, also where few independent records determine them.
    shifts : DataFrame
        One row a mode: mean relative shift ``measured`` and ``explained`` by the severities, ``standard_error`` of the
        measured one, ``n_records``, and ``n_independent``, as many independent records as would determine it as well.
    single : DataFrame
        One row a group, the best first: ``severity`` if it alone were damaged, its ``standard_error``, the ``misfit``
        that remains, and ``misfit_p_value``.
    similarity : DataFrame
        Cosines between the effects of the groups that can be seen, in standard errors of the shifts.
    covariance : DataFrame
        Covariance of the severities.
    draws : DataFrame
        Severities of the model's groups that would also explain the shift, within its error; one draw a row.
    confused : list of tuple of str
        Sets of groups of which damage in one looks like damage in the others: beside these, the standard error of its
        severity would be above 10 %, so that only their common effect is known.
    unseen : list of str
        Groups whose severity would have a standard error above 10 %: they are left out.
    members : mapping of str to list of str
        The model's groups behind each group; several if groups are merged.
    p_value : float
        Probability that a healthy structure shows a shift that damage explains as well.
    misfit, misfit_p_value : float
        Sum of squared differences between measured and explained shifts, in standard errors, and the probability of a
        larger one if these groups are all that changed. A low one says that something else changed too.
    widening : float
        Factor of standard errors, covariance and draws of the severities where damage does not explain the shifts: the
        root of the misfit over its degrees of freedom (Birge's ratio); else 1.
    records : ComparedRecords
        The records that were compared, those that could not be, by reason, and how many independent ones they are
        worth.
    significance : float
        Error rate of ``significant`` over all groups together.
    converged : bool
        Whether the severities settled.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.studies import identify_damage
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> later = make_truss_campaign(damage={"top": 0.2}, random_state=1)
    >>> T, F = later.temperatures[:90], later.frequencies[:90]
    >>> found = identify_damage(fem, T, F, ["bottom", "top"], random_state=0)
    >>> print(found.summary())
    Something has changed (probability by chance 0.002).
    top has lost 19.6 % of its stiffness (± 1.2 %).
    Compared: 90 records; with 365 training records.
    The sign ± stands before two standard errors.
    >>> found.scenario().name
    'identified damage'
    """

    table: pd.DataFrame
    shifts: pd.DataFrame
    single: pd.DataFrame
    similarity: pd.DataFrame
    covariance: pd.DataFrame
    draws: pd.DataFrame = field(repr=False)
    confused: list[tuple[str, ...]]
    unseen: list[str]
    members: Mapping[str, list[str]]
    p_value: float
    misfit: float
    misfit_p_value: float
    widening: float
    records: ComparedRecords
    significance: float
    converged: bool

    @property
    def severities(self) -> pd.Series:
        """Severity of each group."""
        return self.table["severity"]

    @property
    def standard_errors(self) -> pd.Series:
        """Standard error of each severity."""
        return self.table["standard_error"]

    @property
    def is_evident(self) -> bool:
        """Whether there is damage: chance alone would hardly give a healthy structure such shifts."""
        return bool(self.p_value <= self.significance)

    @property
    def damaged(self) -> pd.Series:
        """Whether each group is damaged: yes, no, doubtful, or yes if nothing else has changed."""
        return damaged(self)

    @property
    def is_unexplained(self) -> bool:
        """Whether damage of these groups does not explain the shifts."""
        return self.misfit_p_value < self.significance

    @property
    def unexplained(self) -> Array:
        """Measured less explained shift of each mode in standard errors; NaN for a mode that was not measured."""
        shifts = self.shifts
        return ((shifts["measured"] - shifts["explained"]) / shifts["standard_error"]).to_numpy(dtype=float)

    @property
    def likely_cause(self) -> str:
        """What seems to have shifted the frequencies where damage does not: their unit, or a stiffer structure.

        Empty if a group is damaged, the shifts are explained, or nothing suggests a cause.
        """
        rest, known = self.unexplained, self.shifts[self.shifts["measured"].notna()]
        is_damaged = bool(self.table["significant"].eq(True).any())
        if is_damaged or not self.is_unexplained or np.isnan(rest).all():
            return ""
        ratios = 1 + known["measured"].to_numpy(dtype=float)
        if seem_rad_per_s(ratios, NEAR_2_PI):
            return "the measured frequencies are about 2 pi times the predicted ones, perhaps in rad/s; expected Hz"
        n_higher = (known["measured"] > CLEARLY_HIGHER * known["standard_error"]).sum()
        worst = int(np.nanargmax(np.abs(rest)))
        if n_higher == 0 or rest[worst] < 0:
            return ""
        return (
            f"{n_higher} of {len(known)} frequencies rose, that of mode {self.shifts.index[worst]} by "
            f"{self.shifts['measured'].iloc[worst]:.2%}; strengthening is not sought, because severities are not "
            "negative"
        )

    @property
    def damage(self) -> dict[str, float]:
        """Severities of the model's groups that are not 0, for `~skthermo.surrogate.DataInformedFEM.simulate`."""
        found: dict[str, float] = {}
        for group, severity in self.severities.dropna().items():
            for member in self.members[str(group)]:
                if severity > 0:
                    found[member] = 1 - (1 - found.get(member, 0.0)) * (1 - float(severity))
        return found

    def scenario(self, name: str = "identified damage") -> UncertainDamage:
        """This damage as a scenario of a `DetectabilityStudy`, each repeat with other severities within their error.

        Parameters
        ----------
        name : str, default="identified damage"
            Name of the scenario.

        Returns
        -------
        UncertainDamage
            A scenario whose severities are drawn from ``draws``.
        """
        return UncertainDamage(name, self.draws)

    def answer(self) -> list[str]:
        """Whether something has changed, where, and how surely.

        Returns
        -------
        list of str
            Sentences. The first says whether there is a change, and with which probability it would be chance.
        """
        return list(answer(self))

    def limits(self) -> list[str]:
        """What cannot be said.

        Returns
        -------
        list of str
            Sentences; none if damage explains all shifts and all groups can be seen and told apart.
        """
        return list(limits(self))

    def summary(self) -> str:
        """What was found, what cannot be said, and which records were compared.

        Returns
        -------
        str
            One sentence a line.
        """
        lines = [*self.answer(), *self.limits(), *self.records.sentences()]
        if any("±" in line for line in lines):
            lines.append("The sign ± stands before two standard errors.")
        return "\n".join(lines).replace(SPACE, " ")

    def warnings(self) -> Iterator[tuple[str, str]]:
        """What is doubtful.

        Yields
        ------
        kind : str
            Of the warning.
        text : str
            Of the warning.
        """
        yield from self.records.warnings()
        if self.confused:
            sets = "; ".join(" and ".join(group) for group in self.confused)
            yield (
                "confused groups",
                f"groups that these modes cannot tell apart: {sets}. Only their common effect is known; merge=True "
                "gives them one severity",
            )
        if self.unseen:
            names = ", ".join(self.unseen)
            yield "unseen groups", f"groups that these modes do not show, which are left out: {names}"
        highest = ", ".join(str(group) for group, severity in self.severities.items() if severity >= HIGHEST_SEVERITY)
        if highest:
            yield "severity at its bound", f"severity is at its upper bound of {HIGHEST_SEVERITY:.0%}: {highest}"
        if not self.converged:
            yield "unsettled severities", "severities still change from step to step; expected them to settle"
        if self.is_unexplained:
            other = "something else changed too, or the frequencies scatter more than in the training records"
            yield (
                "unexplained shifts",
                f"damage of these groups does not explain the shifts (probability {self.misfit_p_value:.2g}): "
                f"{self.likely_cause or other}",
            )

    def __repr__(self) -> str:
        found = ", ".join(
            f"{group}={row['severity']:.3g} ± {row['standard_error']:.2g}"
            for group, row in self.table.dropna().iterrows()
            if row["severity"] > 0
        )
        return f"IdentifiedDamage({found or 'none'})"
