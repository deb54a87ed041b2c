"""Identified damage, as `identify_damage` returns it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import pandas as pd

from skthermo._arrays import Array
from skthermo._formatting import SPACE
from skthermo.studies.identification._sentences import answer, limits, warnings
from skthermo.studies.identification._told import told
from skthermo.studies.identification.measured import ComparedRecords
from skthermo.studies.identification.weighing import DamagePrior
from skthermo.studies.scenarios import UncertainDamage

UNLIKELY = 0.05  # probability of a misfit by chance below which it is said


@dataclass(frozen=True, eq=False)
class IdentifiedDamage:
    """Explanations of a shift of frequencies with their probabilities, and what follows for each possible cause.

    An explanation is a set of up to three causes, or none; causes are damage of a group, and what else was asked for.

    Parameters
    ----------
    explanations : DataFrame
        One row an explanation, the most probable first, down to a probability of .1 %. Its name joins its causes by
        " + "; "no damage" is the one without, and "something else" stands for any other shift. ``probability``;
        ``misfit``, the sum of squared differences between measured and explained shifts, in standard errors, at its
        most probable severities; ``text``, such as "side span 12 %, main stays 4 %".
    estimates : DataFrame
        Amount of each cause in each explanation, by explanation and cause, if that explanation is right: mean
        ``severity``, ``standard_error``, and ``lowest`` and ``highest``, which hold it with a probability of 90 %.
    table : DataFrame
        One row a cause: ``probability`` that it is among the causes; ``severity``, its mean over all explanations,
        where those without it count as 0, with ``standard_error``; ``lowest`` and ``highest``, which hold it with a
        probability of 90 %; ``if_damaged``, its mean where it is among the causes, and ``highest_if_damaged``, which it
        then does not exceed with a probability of 95 %; ``error_alone``, the standard error
        if nothing else could have changed and the amount could have either sign; ``kind``: "damage", "stiffening",
        "parameter" or "mass".
    shifts : DataFrame
        One row a mode: mean relative shift ``measured`` and ``explained`` by the causes, the mean over explanations,
        ``standard_error`` of the measured one, ``n_records``, and ``n_independent``, as many independent records as
        would determine it as well.
    rest : float
        Probability of all explanations that are not listed.
    most_probable : tuple of str
        Causes of the most probable explanation, "something else" among them; empty for "no damage".
    probability_of_damage : float
        Probability that anything changed.
    probability_of_else : float
        Probability that something else than the named causes shifted the frequencies, beside them or alone.
    similarity : DataFrame
        Cosines between the effects of the causes, in standard errors of the shifts.
    confused : list of tuple of str
        Sets of causes of which one looks like the others in these modes.
    unseen : list of str
        Causes whose severity alone would have a standard error above 10 %. Their probability hardly differs from what
        the prior says.
    members : mapping of str to list of str
        The model's groups behind each cause; none for a cause that is no group.
    draws : DataFrame
        Severities of the model's groups, drawn from all explanations by their probability; one draw a row.
    precision : DataFrame
        One row a cause: the least standard error that any method can reach (Cramer-Rao), ``alone`` if nothing else
        could have changed, and ``together`` if all other causes may have changed as much as is likely beforehand. With
        mode shapes, ``alone_without_shapes`` and ``together_without_shapes`` are what frequencies alone would give.
    p_value : float
        Probability that a healthy structure shows as large a shift.
    misfit_p_value : float
        Probability of a larger misfit than that of the most probable explanation, if it is right; NaN if it has as
        many causes as there are modes. A low one says that something else changed too.
    records : ComparedRecords
        The records that were compared, those that were left out, by reason, and how many independent ones they are
        worth.
    prior : DamagePrior
        What was thought of damage before.

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
    >>> found.most_probable
    ('top',)
    >>> found.scenario().name
    'identified damage'
    """

    explanations: pd.DataFrame
    estimates: pd.DataFrame
    table: pd.DataFrame
    shifts: pd.DataFrame
    rest: float
    most_probable: tuple[str, ...]
    probability_of_damage: float
    probability_of_else: float
    similarity: pd.DataFrame
    confused: list[tuple[str, ...]]
    unseen: list[str]
    members: Mapping[str, list[str]]
    draws: pd.DataFrame = field(repr=False)
    precision: pd.DataFrame
    p_value: float
    misfit_p_value: float
    records: ComparedRecords
    prior: DamagePrior

    @property
    def probability(self) -> float:
        """Probability of the most probable explanation."""
        return float(self.explanations["probability"].iloc[0])

    @property
    def severities(self) -> pd.Series:
        """Amount of each cause, the mean over all explanations."""
        return self.table["severity"]

    @property
    def standard_errors(self) -> pd.Series:
        """Standard error of each amount."""
        return self.table["standard_error"]

    @property
    def is_unexplained(self) -> bool:
        """Whether the most probable explanation leaves more of the shifts unexplained than chance would."""
        return self.misfit_p_value < UNLIKELY

    @property
    def unexplained(self) -> Array:
        """Measured less explained shift of each mode in standard errors; NaN for a mode that was not measured."""
        shifts = self.shifts
        return ((shifts["measured"] - shifts["explained"]) / shifts["standard_error"]).to_numpy(dtype=float)

    @property
    def told(self) -> pd.DataFrame:
        """Explanations as they are told, those that these modes cannot tell apart as one, the most probable first.

        By ``label``, such as "pier 1 or pier 2 12 %": ``probability``; ``text``, part of a sentence with 90 % bands.
        """
        rows = [(one.label, one.probability, one.phrase(in_full=True)) for one in told(self)]
        return pd.DataFrame(rows, columns=["label", "probability", "text"]).set_index("label")

    @property
    def damage(self) -> dict[str, float]:
        """Severities of the model's groups in the most probable explanation, for ``simulate`` of the chain."""
        found: dict[str, float] = {}
        for cause in self.most_probable:
            for member in self.members.get(cause, []):
                severity = float(self.estimates.loc[(self.explanations.index[0], cause), "severity"])
                found[member] = 1 - (1 - found.get(member, 0.0)) * (1 - severity)
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
        """What is most probable, how probable, and what else could be.

        Returns
        -------
        list of str
            Sentences. The first names the most probable explanation; those that these modes cannot tell apart are told
            together.
        """
        return list(answer(self))

    def limits(self) -> list[str]:
        """What cannot be told: causes that look alike or cannot be seen, and what no explanation explains.

        Returns
        -------
        list of str
            Sentences; none if the most probable explanation explains all shifts, and all causes can be seen and told
            apart.
        """
        return list(limits(self))

    def summary(self) -> str:
        """What is most probable and what else could be, what cannot be told, and which records were left out.

        Returns
        -------
        str
            One sentence a line.
        """
        return "\n".join([*self.answer(), *self.limits(), *self.records.sentences()]).replace(SPACE, " ")

    def warnings(self) -> Iterator[tuple[str, str]]:
        """What is doubtful.

        Yields
        ------
        kind : str
            Of the warning.
        text : str
            Of the warning.
        """
        yield from warnings(self)

    def __repr__(self) -> str:
        best = self.explanations.iloc[0]
        return f"IdentifiedDamage({best['text'] or best.name}, probability {self.probability:.2g})"
