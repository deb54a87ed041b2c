"""Identified damage, as `identify_damage` returns it."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
import pandas as pd

from skthermo._core.arrays import Array, check_probability
from skthermo._core.text import SPACE, Sentences, chance_text, counted, listed, percent, probability_text, significant
from skthermo.exceptions import ResultWarning, SkthermoWarning
from skthermo.studies._scenarios import UncertainDamage
from skthermo.studies.identification._causes import NO_DAMAGE, SOMETHING_ELSE
from skthermo.studies.identification._evidence import Explanation


@dataclass(frozen=True, eq=False)
class IdentifiedDamage(Sentences):
    """Explanations of a shift of frequencies with their probabilities, and what follows for each possible cause.

    An explanation is a set of up to three causes, or none; causes are damage of a group or, with a structure, of a
    stretch of its members, and what else was asked for.

    Parameters
    ----------
    table : DataFrame
        One row a cause or, with a structure, a member: ``probability`` that it has changed; ``severity``, its mean over
        all explanations, where those without it count as 0, with ``standard_error``; ``ci_low`` and ``ci_high``, which
        cover it with a probability of 90 %; ``if_damaged``, its mean where it has changed, and ``highest_if_damaged``,
        which it then does not exceed with a probability of 95 %. Of causes also ``error_alone``, the standard error if
        nothing else could have changed, ``error_together``, if all others may have changed as much as is likely
        beforehand, and ``kind``: "damage", "stiffening", "parameter" or "mass". Of members also ``group``, ``line``
        of connected members of the group, ``element``, the number along the line, and ``is_likely``, whether it is
        among `likely_members`.
    groups : DataFrame
        The same by cause, also with a structure.
    shifts : DataFrame
        One row a mode: mean relative shift ``measured`` and ``explained`` by the causes, the mean over explanations,
        ``standard_error`` of the measured one, ``n_records``, and ``n_independent``, as many independent records as
        would determine it as well.
    draws : DataFrame
        Severities of the model's groups, drawn from all explanations by their probability; one draw a row. Of whole
        groups, also with a structure.
    damage : dict of str to float
        Severities of the model's groups in the most probable explanation by whole groups, for ``simulate``.
    p_value : float
        Probability that a healthy structure shows as large a shift.
    misfit_p_value : float
        Of a larger misfit than that of the most probable explanation, if it is right; NaN if it has as many causes as
        there are modes. A low one says that something else changed too.
    similarity : DataFrame
        Cosines between the effects of the causes, in standard errors of the shifts.
    records : Series
        How many records were given and compared, and left out by reason; how many independent ones they and the
        training records are worth.
    explained : sequence of explanations
        All explanations with a probability above .001 %, with draws of their amounts.

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

    table: pd.DataFrame
    groups: pd.DataFrame
    shifts: pd.DataFrame
    draws: pd.DataFrame = field(repr=False)
    damage: dict[str, float]
    p_value: float
    misfit_p_value: float
    similarity: pd.DataFrame = field(repr=False)
    records: pd.Series = field(repr=False)
    explained: Sequence[Explanation] = field(repr=False)

    @cached_property
    def explanations(self) -> pd.DataFrame:
        """One row an explanation, the most probable first, down to a probability of .1 %.

        Its name joins its causes by " + "; "no damage" is the one without, and "something else" stands for any other
        shift. ``probability``; ``misfit``, the sum of squared differences between measured and explained shifts, in
        standard errors, at its most probable severities; ``text``, such as "side span 12 %, main stays 4 %".
        """
        rows = []
        for one in _listed(self.explained):
            texts = [f"{cause.name} {_percent(self.estimates.loc[(one.name, cause.name)])}" for cause in one.causes]
            text = ", ".join(texts + [SOMETHING_ELSE] * one.has_else) or NO_DAMAGE
            rows.append({"probability": one.probability, "misfit": one.misfit, "text": text})
        return pd.DataFrame(rows, [one.name for one in _listed(self.explained)])

    @cached_property
    def estimates(self) -> pd.DataFrame:
        """Amount of each cause in each explanation, by explanation and cause, if that explanation is right.

        Mean ``severity``, ``standard_error``, and ``ci_low`` and ``ci_high``, which cover it with a probability of
        90 %.
        """
        amounts = {
            (one.name, cause.name): summary(values, np.ones(len(values)))
            for one in _listed(self.explained)
            for cause, values in zip(one.causes, one.draws.T, strict=True)
        }
        index = pd.MultiIndex.from_tuples(list(amounts), names=["explanation", "cause"])
        return pd.DataFrame(list(amounts.values()), index, AMOUNT)

    @property
    def probability_of_damage(self) -> float:
        """Probability that anything changed."""
        return 1 - min(sum(one.probability for one in self.explained if not one.causes and not one.has_else), 1.0)

    @property
    def probability_other(self) -> float:
        """Probability that something else than the named causes shifted the frequencies."""
        return min(sum(one.probability for one in self.explained if one.has_else), 1.0)

    @property
    def unobservable(self) -> list[str]:
        """Causes whose severity alone would have a standard error above 10 %.

        Their probability hardly differs from what the prior says.
        """
        return list(self.groups.index[self.groups["error_alone"] > 0.1])

    @property
    def indistinguishable(self) -> list[tuple[str, str]]:
        """Pairs of causes that these modes show, but do not distinguish."""
        shown = self.similarity.drop(index=self.unobservable, columns=self.unobservable)
        errors = self.groups["error_alone"]
        found = []
        for one, other in combinations(shown, 2):
            apart = np.sqrt(max(1 - max(shown.loc[one, other], 0.0) ** 2, 0.0))  # of the effect of each
            if apart * 0.1 < max(errors[one], errors[other]):
                found.append((one, other))
        return found

    @property
    def most_probable(self) -> tuple[str, ...]:
        """Causes of the most probable explanation, "something else" among them; empty for "no damage"."""
        best = self.explained[0]
        return (*(cause.name for cause in best.causes), *([SOMETHING_ELSE] * best.has_else))

    @property
    def probability(self) -> float:
        """Probability of the most probable explanation."""
        return self.explained[0].probability

    @property
    def severities(self) -> pd.Series:
        """Amount of each cause, or of each member, the mean over all explanations."""
        return self.table["severity"]

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

    def likely_members(self, probability: float = 0.9, group: str | None = None) -> list[Hashable]:
        """The fewest rows of the table that hold all damaged ones with a probability, given that there are any.

        Parameters
        ----------
        probability : float, default=0.9
            Between 0 and 1.
        group : str, optional
            Only damage in this group. By default in any that these modes show.

        Returns
        -------
        list of members
            The most probable first; none if there is no damage.

        Raises
        ------
        ValueError
            If the group is unknown, or the probability is not between 0 and 1.
        """
        if group is not None and group not in self.groups.index:
            raise ValueError(f"unknown group {group!r}; expected one of {sorted(self.groups.index)}")
        wanted = {group} if group is not None else set(self.groups.index).difference(self.unobservable)
        return fewest(self.explained, wanted, check_probability(probability, "probability"))

    def _answer(self) -> Iterator[str]:
        best = self.explained[0]
        is_healthy = not best.causes and not best.has_else
        shown = " observable in these modes" if is_healthy and self.unobservable else ""
        yield f"Most probable: {self._phrase(best.name)}{shown}, probability {chance_text(best.probability)}."
        others = [one for one in self.explained[1:] if one.probability >= 0.02 and one.name in self.explanations.index]
        if others:
            texts = [f"{self.explanations['text'][one.name]} ({chance_text(one.probability)})" for one in others[:4]]
            yield f"Less probable: {'; '.join(texts)}."
        if is_healthy:
            bounds = self.groups["highest_if_damaged"].drop(self.unobservable)
            losses = [f"{percent(bound, '.2g')} in {name}" for name, bound in bounds[bounds > 0].items()]
            yield f"95{SPACE}% upper bounds on undetected losses of stiffness: {listed(losses)}."
        else:
            yield f"Probability of no change: {chance_text(1 - self.probability_of_damage)}."
        records = self.records
        yield (
            f"{counted(int(records['compared']), 'record')} (worth {significant(records['independent'])} independent "
            f"ones) compared with {counted(int(records['trained']), 'training record')} (worth "
            f"{significant(records['independent of trained'])})."
        )

    def _phrase(self, name: str) -> str:
        """An explanation with the bands of its amounts."""
        if name not in self.estimates.index.get_level_values(0):
            return str(self.explanations["text"][name])
        bands = [
            (f"a loss of {_percent(row)} of stiffness in {cause}" if is_loss else f"{cause} {_percent(row)}")
            + f" (90{SPACE}% interval {percent(row['ci_low'], '.2g')} to {percent(row['ci_high'], '.2g')})"
            for (cause, row), is_loss in zip(
                self.estimates.loc[name].iterrows(),
                [one.kind == "damage" for one in self.explained[0].causes],
                strict=True,
            )
        ]
        return listed(bands + [SOMETHING_ELSE] * self.explained[0].has_else)

    def _limits(self) -> Iterator[str]:
        for causes in self.indistinguishable:
            yield f"{listed(causes)} cannot be distinguished by these modes."
        if self.unobservable:
            yield f"Damage in {listed(self.unobservable, 'or')} is unobservable in these modes."
        if self.p_value < 0.05 and not self.explained[0].causes and not self.explained[0].has_else:
            yield f"Such shifts are rare in a healthy structure (p value {probability_text(self.p_value)})."
        if self.misfit_p_value < 0.05:
            yield (
                "The most probable explanation does not explain all of the shifts (p value "
                f"{probability_text(self.misfit_p_value)})."
            )

    def warnings(self) -> Iterator[SkthermoWarning]:
        """What the answer leaves open.

        Yields
        ------
        SkthermoWarning
            With its ``kind``.
        """
        likely = set(self.groups.index[self.groups["probability"] >= 0.1])
        pairs = [" and ".join(pair) for pair in self.indistinguishable if likely.intersection(pair)]
        open_ = [f"which of {pair} has changed" for pair in pairs] + [f"damage of {name}" for name in self.unobservable]
        if open_:
            yield ResultWarning(
                f"these modes do not show {listed(open_, 'nor')}. Take records over a longer time, or measure mode "
                "shapes or other modes",
                "indistinguishable-groups",
            )
        if self.explained[0].has_else or self.misfit_p_value < 0.05:
            yield ResultWarning(
                "the causes that were sought do not explain the shifts. There may be damage outside these groups, a "
                "stiffer part, a change of mass or of a support, a wrong sensor, modes that were exchanged, or a wrong "
                "model. See shifts and stiffening",
                "unexplained-shifts",
            )

    def __repr__(self) -> str:
        best = self.explanations.iloc[0]
        return f"IdentifiedDamage({best['text'] or best.name}, probability {self.probability:.2g})"


def _percent(row: pd.Series) -> str:
    return percent(row["severity"], ".2g" if abs(row["severity"]) < 0.995 else ".0f")


def severities_of(one: Explanation, amounts: Array) -> dict[str, float]:
    """Severities of the model's groups by the amounts of an explanation's causes."""
    factors: dict[str, float] = {}
    for cause, amount in zip(one.causes, amounts, strict=True):
        if cause.direction < 0:
            factors |= {name: factors.get(name, 1.0) * (1 - amount) for name in cause.of}
    return {name: float(1 - factor) for name, factor in factors.items()}


def fewest(explained: Sequence[Explanation], groups: Collection[str], probability: float) -> list[Hashable]:
    """Rows of a table that hold all changed ones of some groups, those added first that hold most for their number."""
    sets = [
        (one.probability, rows)
        for one in explained
        if (rows := frozenset(row for cause in one.causes if cause.group in groups for row in cause.rows))
    ]
    total, held, chosen = sum(share for share, _ in sets), 0.0, {}
    while sets and held < probability * total * (1 - 1e-9):
        more = {rows.difference(chosen) for _, rows in sets}
        gain = {new: sum(s for s, rows in sets if rows <= chosen.keys() | new) / len(new) for new in more}
        chosen |= dict.fromkeys(sorted(max(gain, key=lambda new: gain[new]), key=str))
        held += sum(share for share, rows in sets if rows <= chosen.keys())
        sets = [(share, rows) for share, rows in sets if not rows <= chosen.keys()]
    return list(chosen)


def tabulated(explained: Sequence[Explanation], rows: Mapping[Hashable, Collection[Hashable]]) -> pd.DataFrame:
    """Probability of each row that some of its entries have changed, and by how much on average."""
    found = []
    for entries in rows.values():
        parts = []
        for one in explained:
            inside = [not set(entries).isdisjoint({*cause.rows, cause.group}) for cause in one.causes]
            if any(inside):
                parts.append((one.probability, 1 - np.prod(1 - one.draws[:, inside], axis=1)))
        values = np.concatenate([*(draws for _, draws in parts), np.zeros(1)])
        shares = [np.full(len(draws), share / len(draws)) for share, draws in parts]
        probability = min(sum(share for share, _ in parts), 1.0)
        present = summary(values[:-1], np.concatenate(shares)) if parts else dict.fromkeys(AMOUNT, np.nan)
        averages = summary(values, np.concatenate([*shares, [1 - probability]]))
        farthest = present["ci_low" if present["severity"] < 0 else "ci_high"]
        extremes = {"if_damaged": present["severity"], "highest_if_damaged": farthest}
        found.append({"probability": probability, **averages, **extremes})
    return pd.DataFrame(found, pd.Index(list(rows), tupleize_cols=False))


AMOUNT = ["severity", "standard_error", "ci_low", "ci_high"]


def summary(values: Array, weights: Array) -> dict[str, float]:
    """Mean, standard deviation and 90 % band of weighted values."""
    weights, order = weights / weights.sum(), np.argsort(values)
    mean, shares = float(weights @ values), np.cumsum(weights[order])
    ends = [float(values[order][min(np.searchsorted(shares, end), len(values) - 1)]) for end in (0.05 - 1e-12, 0.95)]
    return dict(zip(AMOUNT, [mean, float(np.sqrt(weights @ (values - mean) ** 2)), *ends], strict=True))


def _listed(explained: Sequence[Explanation]) -> Sequence[Explanation]:
    """Explanations with a probability of .1 % or more, or the most probable one."""
    return [one for one in explained if one.probability >= 1e-3] or explained[:1]


def drawn(
    explained: Sequence[Explanation], groups: Sequence[str], number: int, random: np.random.RandomState
) -> pd.DataFrame:
    """Severities of the model's groups, of explanations by their probability."""
    probable = np.array([one.probability for one in explained])
    rows = []
    for place in random.choice(len(probable), size=number, p=probable / probable.sum()):
        one = explained[place]
        rows.append(severities_of(one, one.draws[random.randint(len(one.draws))]))
    return pd.DataFrame(rows, columns=list(groups)).fillna(0.0)
