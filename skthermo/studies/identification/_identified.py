"""Identified damage, as `identify_damage` returns it: its parts, and what they say in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from skthermo._core.arrays import Array
from skthermo._core.text import SPACE, Sentences, chance_text, listed, percent, probability_text
from skthermo.exceptions import ResultWarning, SkthermoWarning
from skthermo.studies._scenarios import UncertainDamage
from skthermo.studies.identification._causes import NO_DAMAGE, SOMETHING_ELSE, Cause, DamagePrior
from skthermo.studies.identification._shift import ComparedRecords
from skthermo.surrogate.effects import HIGHEST_SEVERITY

ALIKE = 0.95  # cosine between effects from which on indistinguishable causes are named together
PHRASES = {
    "damage": ("a loss of {size}{of stiffness} in {name}", "of {size} in {name}", ""),
    "stiffening": ("a gain of {size}{of stiffness} in {name}", "of {size} in {name}", " stiffer"),
    "lower": ("a fall of {size} in {name}", "of {size} in {name}", " lower"),
    "higher": ("a rise of {size} in {name}", "of {size} in {name}", " higher"),
    "mass": ("added mass of {size} of {name}", "of {size} of {name}", ""),
}
"""Phrases for a cause: first, after another of the same kind, and the ending of its name that this leaves out."""

NAMED, MOST_NAMED = 0.01, 4
"""Probability from which on another explanation is named, and the largest number of those that are."""
SURE = 0.9  # probability from which on the most probable explanation is not followed by averages over all
LIKELY = 0.1  # probability from which on a cause is named among the averages
RARE = 0.05  # p value below which a misfit, or a shift of a healthy structure, is given
CLEAR = 2.0  # standard errors by which a frequency must move to count as moved
PILED_UP = 1.05  # standard errors between the mean of an exponential law and its bound, with some margin
EVEN = 0.1  # relative scatter of shifts up to which they count as even
VISIBLE = 0.1  # largest standard error with which a severity counts as known
IMITATING_SHARE = 0.25  # smallest share in the reproduced effect with which a group counts as imitating another


@dataclass(frozen=True)
class Amount:
    """How much of one cause there is, and its 90 % band."""

    cause: str
    kind: str
    value: float
    lowest: float
    highest: float

    @property
    def size(self) -> str:
        """The amount, with the digits that its band carries."""
        return f"{self._number(self.value)}{SPACE}%"

    @property
    def band(self) -> str:
        """The 90 % interval, from the smaller to the larger amount."""
        low, high = sorted((self.lowest, self.highest), key=abs)
        return f"90{SPACE}% interval {self._number(low)} to {self._number(high)}{SPACE}%"

    @property
    def saying(self) -> str:
        return self.kind if self.kind != "parameter" else "lower" if self.value < 0 else "higher"

    @property
    def subject(self) -> str:
        """The name of what changed, without the direction."""
        return self.cause.removesuffix(PHRASES[self.saying][2])

    def _number(self, value: float) -> str:
        width = abs(self.highest - self.lowest)
        return f"{100 * abs(value):.{0 if width >= 0.03 else 1 if width >= 0.003 else 2}f}"

    def agrees(self, other: Amount) -> bool:
        """Whether another cause's amount is of the same kind and within the band of this one."""
        return self.saying == other.saying and self.lowest <= other.value <= self.highest


@dataclass(frozen=True)
class Statement:
    """What may have changed, how much, and how probable that is, for a sentence or a table.

    Each of ``changes`` holds the amounts of causes of which one has changed, the most probable first.
    """

    changes: tuple[tuple[Amount, ...], ...]
    has_else: bool
    probability: float

    @property
    def is_healthy(self) -> bool:
        return not self.changes and not self.has_else

    @property
    def is_else(self) -> bool:
        """Whether something has changed, and none of the causes that were sought."""
        return not self.changes and self.has_else

    @property
    def label(self) -> str:
        """Causes with their amounts, for a table or a drawing."""
        parts = [f"{listed([one.cause for one in amounts], 'or')} {amounts[0].size}" for amounts in self.changes]
        return ", ".join(parts + [SOMETHING_ELSE] * self.has_else) or NO_DAMAGE

    def beside(self, first: Statement) -> str:
        """The one thing that it holds beside another explanation, if the rest is about the same; else nothing."""
        known = {amounts[0].cause: amounts[0] for amounts in first.changes}
        own = [amounts for amounts in self.changes if amounts[0].cause not in known]
        shared = [amounts[0] for amounts in self.changes if amounts[0].cause in known]
        # the same amounts, within the width of their bands
        is_same = len(shared) == len(known) and all(
            abs(known[one.cause].value - one.value) <= abs(known[one.cause].highest - known[one.cause].lowest)
            for one in shared
        )
        if first.is_healthy or not is_same or len(own) + self.has_else - first.has_else != 1:
            return ""
        return _phrase(own[0], False, False).removeprefix("a loss of ").rstrip(",") if own else SOMETHING_ELSE

    def phrase(self, in_full: bool = False) -> str:
        """Causes with their amounts as part of a sentence; in full with what is lost, and the bands."""
        if self.is_else:
            return "something else than damage of these groups"
        said: list[str] = []
        for place, amounts in enumerate(self.changes):
            is_further = place > 0 and amounts[0].saying == self.changes[place - 1][0].saying
            said.append(_phrase(amounts, is_further, in_full))
        said += [SOMETHING_ELSE] * self.has_else
        joined = listed(said) if not any(part.endswith(",") for part in said) else " and ".join(said)
        return joined.rstrip(",") or NO_DAMAGE


def _phrase(amounts: Sequence[Amount], is_further: bool, in_full: bool) -> str:
    """One cause, or several that cannot be distinguished; those whose amounts agree share them."""
    first, texts = amounts[0], []
    shared = [one for one in amounts if first.agrees(one)]
    for one in [first, *(one for one in amounts if one not in shared)]:
        saying = PHRASES[one.saying][is_further or (one is not first and one.saying == first.saying)]
        names = listed([other.subject for other in (shared if one is first else [one])], "or")
        text = saying.format_map({"size": one.size, "name": names, "of stiffness": " of stiffness" * in_full})
        texts.append(text + (f" ({one.band})" if in_full else ""))
    return " or ".join(texts) + (", which these modes cannot distinguish," if len(amounts) > 1 else "")


def statements(found: IdentifiedDamage) -> list[Statement]:
    """Explanations, the most probable first; those that these modes cannot distinguish are one.

    They differ only in causes that look alike, or in causes that these modes do not show.
    """
    sets = found.separability.alike()
    together: dict[frozenset[Any], list[tuple[float, tuple[str, ...]]]] = {}
    known: set[tuple[str, ...]] = set()
    for name, probability in found.explanations["probability"].items():
        causes = causes_of(found, str(name))
        seen = tuple(cause for cause in causes if cause not in found.separability.unobservable)
        shown = seen if seen in known else causes
        known.add(causes)
        key = frozenset(next((group for group in sets if cause in group), cause) for cause in shown)
        together.setdefault(key, []).append((float(probability), causes))
    said = [_joined(found, members, sets) for members in together.values()]
    return sorted(said, key=lambda one: -one.probability)


def _joined(
    found: IdentifiedDamage, members: list[tuple[float, tuple[str, ...]]], sets: list[frozenset[str]]
) -> Statement:
    """The most probable of the explanations with the fewest causes, and what its causes may be taken for."""
    fewest = min(len(causes) for _, causes in members)
    first, *others = (causes for _, causes in members if len(causes) == fewest)
    changes = []
    for cause in first:
        if cause == SOMETHING_ELSE:
            continue
        alike = next((group for group in sets if cause in group), frozenset())
        amounts = {cause: amount_of(found, first, cause)}
        for causes in others:
            for other in causes:
                if other in alike and other not in first:
                    amounts.setdefault(other, amount_of(found, causes, other))
        changes.append(tuple(amounts.values()))
    return Statement(tuple(changes), SOMETHING_ELSE in first, sum(probability for probability, _ in members))


def causes_of(found: IdentifiedDamage, name: str) -> tuple[str, ...]:
    """The causes of an explanation by its name."""
    amounts = found.estimates.index
    named = [str(cause) for explanation, cause in amounts if explanation == name]
    has_else = " + ".join(named) != name and name != NO_DAMAGE
    return (*named, SOMETHING_ELSE) if has_else else tuple(named)


def amount_of(found: IdentifiedDamage, causes: Sequence[str], cause: str) -> Amount:
    """How much of a cause there is within an explanation."""
    row = found.estimates.loc[(" + ".join(causes), cause)]
    values = [float(row[name]) for name in ("severity", "ci_low", "ci_high")]
    return Amount(cause, str(found.table["kind"].get(cause, "damage")), *values)


def _others(first: Statement, others: Sequence[Statement]) -> Iterator[str]:
    """What else could be: the most probable explanation with one thing more, then others."""
    probable = [one for one in others if not one.is_healthy and one.probability >= NAMED]
    more = {more: one for one in probable if (more := one.beside(first))}
    named = [f"{extra} ({chance_text(one.probability)})" for extra, one in more.items()][:MOST_NAMED]
    texts = [f"about the same and {listed(named, 'or')}"] if named else []
    different = [one for one in probable if one not in more.values()][:MOST_NAMED]
    texts += [f"{one.phrase()} ({chance_text(one.probability)})" for one in different]
    if texts:
        yield f"Less probable: {'; '.join(texts)}."


def _averages(found: IdentifiedDamage, first: Statement) -> Iterator[str]:
    """Causes that are likely over all explanations together, unless they are those of the first and sure."""
    table = found.table[
        (found.table["probability"] >= LIKELY) & ~found.table.index.isin(found.separability.unobservable)
    ]
    in_first = {amounts[0].cause for amounts in first.changes}
    if in_first.issuperset(table.index) and (table["probability"] >= SURE).all():
        return
    named = []
    for cause, row in table.sort_values("probability", ascending=False, kind="stable").head(MOST_NAMED).iterrows():
        amount = Amount(str(cause), row["kind"], row["severity"], row["ci_low"], row["ci_high"])
        word = "damaged" if row["kind"] == "damage" else "changed"
        probability = f"{word} with probability {chance_text(row['probability'])}"
        named.append(f"{cause} {amount.size} ({amount.band}; {probability})")
    if named:
        yield f"Averaged over all explanations: {'; '.join(named)}."


def _unnoticed(found: IdentifiedDamage) -> Iterator[str]:
    table = found.table[(found.table["kind"] == "damage") & ~found.table.index.isin(found.separability.unobservable)]
    losses = [f"{percent(bound, '.2g')} in {group}" for group, bound in table["highest_if_damaged"].dropna().items()]
    if losses:
        yield f"95{SPACE}% upper bounds on undetected losses of stiffness: {listed(losses)}."


def _is_at_bound(found: IdentifiedDamage, cause: str) -> bool:
    """Whether the law of a severity piles up at its upper bound, so that its mean is a standard error below it."""
    if cause not in found.table.index or found.table.loc[cause, "kind"] != "damage":
        return False
    amount = found.estimates.loc[(found.explanations.index[0], cause)]
    return bool(amount["severity"] + PILED_UP * amount["standard_error"] >= HIGHEST_SEVERITY)


def _departure(found: IdentifiedDamage) -> str:
    shifts = found.shifts
    worst = int(np.nanargmax(np.abs(found.unexplained)))
    measured, explained = (float(shifts[name].iloc[worst]) for name in ("measured", "explained"))
    error = float(shifts["standard_error"].iloc[worst])
    return (
        f"mode {shifts.index[worst]} has the largest residual, a measured shift of {_signed(measured)} (standard error "
        f"{100 * error:.2f}{SPACE}%) and an explained one of {_signed(explained)}"
    )


def likely_causes(found: IdentifiedDamage) -> str:
    """What may have shifted the frequencies where damage does not: what the shifts suggest, then what is usual."""
    known, rest = found.shifts[found.shifts["measured"].notna()], found.unexplained
    measured, error = (known[name].to_numpy(dtype=float) for name in ("measured", "standard_error"))
    n_rose, mean, worst = int((measured > CLEAR * error).sum()), float(measured.mean()), int(np.nanargmax(np.abs(rest)))
    causes = []
    if len(known) > 2 and measured.std() < EVEN * abs(mean):
        causes.append(
            f"another clock of the logger, or mass or stiffness all over the structure: all frequencies moved by about "
            f"{_signed(mean)}"
        )
    elif n_rose and rest[worst] > 0 and not found.table["kind"].eq("stiffening").any():
        causes.append(
            f"strengthening, which was not sought (stiffening=...): {n_rose} of {len(known)} frequencies rose, that "
            f"of mode {found.shifts.index[worst]} by {_signed(found.shifts['measured'].iloc[worst])}"
        )
    elif (np.abs(rest) > CLEAR).sum() == 1:
        causes.append(f"another mode taken for mode {found.shifts.index[worst]}, which alone departs")
    usual = "damage outside these groups, a change of mass or of a support, a wrong sensor, or a wrong model"
    return "; or ".join([*causes, usual])


def _signed(shift: float) -> str:
    return f"{100 * shift + 0.0:+.2f}{SPACE}%".replace("-0.00", "+0.00")


def explanation_text(causes: Sequence[str], amounts: Sequence[float]) -> str:
    """An explanation with its amounts, such as "side span 12 %, main stays 4 %"."""
    sizes = [percent(abs(amount), ".2g" if abs(amount) < 0.995 else ".0f") for amount in amounts]
    parts = [f"{cause} {size}" for cause, size in zip(causes, sizes, strict=False)]
    return ", ".join([*parts, *causes[len(amounts) :]]) or NO_DAMAGE


@dataclass(frozen=True, eq=False, repr=False)
class Separability:
    """Which causes the measured modes show, and which they distinguish.

    Parameters
    ----------
    similarity : DataFrame
        Cosines between the effects of the causes, in standard errors of the shifts.
    indistinguishable : list of tuple of str
        Sets of causes of which one looks like the others in these modes.
    unobservable : list of str
        Causes whose severity alone would have a standard error above 10 %. Their probability hardly differs from what
        the prior says.
    precision : DataFrame
        One row a cause: the least standard error that any method can reach (Cramer-Rao), ``alone`` if nothing else
        could have changed, and ``together`` if all other causes may have changed as much as is likely beforehand. With
        mode shapes, ``alone_without_shapes`` and ``together_without_shapes`` are what frequencies alone would give.
    """

    similarity: pd.DataFrame
    indistinguishable: list[tuple[str, ...]]
    unobservable: list[str]
    precision: pd.DataFrame

    @classmethod
    def of(cls, slopes: Array, nominal: Array, causes: Sequence[Cause], precision: pd.DataFrame) -> Separability:
        """From effects of small amounts, (n_observed, n_causes), in standard errors, at the parameters of the records
        and at the model's nominal state."""
        names = [cause.name for cause in causes]
        is_seen = precision["alone"].to_numpy() <= VISIBLE
        seen = np.flatnonzero(is_seen)
        sets = indistinguishable_groups(nominal[:, seen]) + indistinguishable_groups(slopes[:, seen])
        return cls(
            similarity=pd.DataFrame(cosines(nominal), names, names),
            indistinguishable=list(dict.fromkeys(tuple(names[seen[column]] for column in one) for one in sets)),
            unobservable=[name for name, is_shown in zip(names, is_seen, strict=True) if not is_shown],
            precision=precision,
        )

    def alike(self) -> list[frozenset[str]]:
        """Sets of causes whose effects are nearly the same, among those that are indistinguishable."""
        sets: list[frozenset[str]] = []
        for members in self.indistinguishable:
            for one, other in combinations(members, 2):
                if self.similarity.loc[one, other] >= ALIKE:
                    touched = [group for group in sets if one in group or other in group]
                    joined = frozenset({one, other}).union(*touched)
                    sets = [group for group in sets if group not in touched] + [joined]
        return sets

    def sentences(self) -> Iterator[str]:
        """What these modes do not determine."""
        for causes in self.indistinguishable:
            yield f"{listed(causes)} cannot be distinguished by these modes: only their common effect is known."
        if self.unobservable:
            yield f"Damage in {listed(self.unobservable, 'or')} is unobservable in these modes."

    def warnings(self) -> Iterator[SkthermoWarning]:
        """What is doubtful."""
        if self.indistinguishable:
            sets = "; ".join(" and ".join(causes) for causes in self.indistinguishable)
            yield ResultWarning(
                f"these modes cannot distinguish groups: {sets}. Only their common effect is known. Measure their "
                "shapes, or other modes",
                "indistinguishable-groups",
            )
        if self.unobservable:
            yield ResultWarning(
                f"these modes do not show damage of {', '.join(self.unobservable)}: its severity would have a standard "
                f"error above {VISIBLE:.0%}. Take records over a longer time, or measure other modes",
                "unobservable-groups",
            )

    def __repr__(self) -> str:
        return "\n".join(self.sentences()) or "These modes show and distinguish all causes."


@dataclass(frozen=True, repr=False)
class Probabilities:
    """Probabilities over all explanations, and of shifts by chance.

    Parameters
    ----------
    damage : float
        That anything changed.
    other : float
        That something else than the named causes shifted the frequencies, beside them or alone.
    even : float
        That all groups lost the same share of their stiffness, as where a whole structure ages or gains mass: "all
        groups" in ``explanations``, which nobody has to ask for. In ``table`` it is damage of each group.
    p_value : float
        That a healthy structure shows as large a shift.
    misfit_p_value : float
        Of a larger misfit than that of the most probable explanation, if it is right; NaN if it has as many causes as
        there are modes. A low one says that something else changed too.
    """

    damage: float
    other: float
    even: float
    p_value: float
    misfit_p_value: float

    def __repr__(self) -> str:
        return f"Probabilities({', '.join(f'{name}={value:.2g}' for name, value in vars(self).items())})"


@dataclass(frozen=True, eq=False)
class IdentifiedDamage(Sentences):
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
        ``severity``, ``standard_error``, and ``ci_low`` and ``ci_high``, which cover it with a probability of 90 %.
    table : DataFrame
        One row a cause: ``probability`` that it is among the causes; ``severity``, its mean over all explanations,
        where those without it count as 0, with ``standard_error``; ``ci_low`` and ``ci_high``, which cover it with a
        probability of 90 %; ``if_damaged``, its mean where it is among the causes, and ``highest_if_damaged``, which it
        then does not exceed with a probability of 95 %; ``error_alone``, the standard error
        if nothing else could have changed and the amount could have either sign; ``kind``: "damage", "stiffening",
        "parameter" or "mass".
    shifts : DataFrame
        One row a mode: mean relative shift ``measured`` and ``explained`` by the causes, the mean over explanations,
        ``standard_error`` of the measured one, ``n_records``, and ``n_independent``, as many independent records as
        would determine it as well.
    draws : DataFrame
        Severities of the model's groups, drawn from all explanations by their probability; one draw a row.
    members : mapping of str to list of str
        The model's groups behind each cause; none for a cause that is no group.
    probabilities : part
        That anything changed, ``damage``; that something else than the named causes shifted the frequencies, ``other``;
        that all groups lost the same share of their stiffness, ``even``; ``p_value``, that a healthy structure shows as
        large a shift; ``misfit_p_value``, of a larger misfit than that of the most probable explanation, if it is right
        (NaN if it has as many causes as there are modes). A low one says that something else changed too.
    separability : part
        What these modes do not determine, which it prints: ``indistinguishable``, sets of causes of which one looks
        like the others; ``unobservable``, causes whose severity alone would have a standard error above 10 %, and whose
        probability hardly differs from what the prior says; ``similarity``, cosines between their effects in standard
        errors of the shifts; ``precision``, the least standard error of each cause that any method can reach
        (Cramer-Rao), ``alone`` if nothing else could have changed and ``together`` if all other causes may have changed
        as much as is likely beforehand, with shapes also ``alone_without_shapes`` and ``together_without_shapes``.
    records : part
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
    draws: pd.DataFrame = field(repr=False)
    members: Mapping[str, list[str]]
    probabilities: Probabilities
    separability: Separability
    records: ComparedRecords
    prior: DamagePrior

    @property
    def most_probable(self) -> tuple[str, ...]:
        """Causes of the most probable explanation, "something else" among them; empty for "no damage"."""
        return causes_of(self, str(self.explanations.index[0]))

    @property
    def rest(self) -> float:
        """Probability of all explanations that are not listed."""
        return float(max(1 - sum(self.explanations["probability"]), 0.0))

    @property
    def probability(self) -> float:
        """Probability of the most probable explanation."""
        return float(self.explanations["probability"].iloc[0])

    @property
    def severities(self) -> pd.Series:
        """Amount of each cause, the mean over all explanations."""
        return self.table["severity"]

    @property
    def unexplained(self) -> Array:
        """Measured less explained shift of each mode in standard errors; NaN for a mode that was not measured."""
        shifts = self.shifts
        return ((shifts["measured"] - shifts["explained"]) / shifts["standard_error"]).to_numpy(dtype=float)

    @property
    def summary_table(self) -> pd.DataFrame:
        """Explanations as statements, those that these modes cannot distinguish as one, the most probable first.

        By ``label``, such as "pier 1 or pier 2 12 %": ``probability``; ``text``, part of a sentence with 90 % bands.
        """
        rows = [(one.label, one.probability, one.phrase(in_full=True)) for one in statements(self)]
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

    def _answer(self) -> Iterator[str]:
        explanations = statements(self)
        first, *others = explanations
        shown = " observable in these modes" if self.separability.unobservable else ""
        yield (
            f"Most probable: {first.phrase(in_full=True)}{shown * first.is_healthy}, probability "
            f"{chance_text(first.probability)}."
        )
        if first.has_else:
            what = (
                "No damage of these groups explains"
                if first.is_else
                else "Damage of these groups alone does not explain"
            )
            yield f"{what} the shifts: {_departure(self)}."
            yield f"Likely causes: {likely_causes(self)}."
        yield from _others(first, others)
        if not first.is_healthy:
            unchanged = sum(one.probability for one in explanations if one.is_healthy)
            observable = "observable " if self.separability.unobservable else ""
            yield f"Probability of no {observable}change: {chance_text(unchanged)}."
        if first.probability < SURE and not first.is_else:
            yield from _averages(self, first)
        if first.is_healthy:
            yield from _unnoticed(self)

    def _limits(self) -> Iterator[str]:
        best = statements(self)[0]
        yield from self.separability.sentences()
        if best.is_healthy and self.probabilities.p_value < RARE:
            rare = probability_text(self.probabilities.p_value)
            yield f"However, such shifts are rare in a healthy structure (p value {rare})."
        if np.isnan(self.probabilities.misfit_p_value):
            yield "There are no more shifts than causes: the fit explains any shift and cannot be tested."
        elif self.probabilities.misfit_p_value < RARE and not best.has_else:
            yield (
                "The most probable explanation does not explain all of the shifts (p value "
                f"{probability_text(self.probabilities.misfit_p_value)}): {_departure(self)}."
            )
        if self.rest >= NAMED:
            yield f"Explanations that are not listed have a probability of {chance_text(self.rest)} together."

    def _remarks(self) -> Iterator[str]:
        return self.records.sentences()

    def warnings(self) -> Iterator[SkthermoWarning]:
        """What is doubtful.

        Yields
        ------
        SkthermoWarning
            With its ``kind``.
        """
        yield from self.records.warnings()
        yield from self.separability.warnings()
        best = statements(self)[0]
        highest = [str(cause) for cause in self.most_probable if _is_at_bound(self, cause)]
        if highest:
            yield ResultWarning(
                f"the severity is at its upper bound of {HIGHEST_SEVERITY:.0%}: {', '.join(highest)}. Usually "
                "something else has changed. See summary_table",
                "severity-at-bound",
            )
        if best.has_else or self.probabilities.misfit_p_value < RARE:
            doubt = (
                f"probability of something else {chance_text(self.probabilities.other)}"
                if best.has_else
                else f"probability of such a misfit by chance {chance_text(self.probabilities.misfit_p_value)}"
            )
            yield ResultWarning(
                f"damage of these groups alone does not explain the shifts ({doubt}). Likely causes: "
                f"{likely_causes(self)}",
                "unexplained-shifts",
            )

    def __repr__(self) -> str:
        best = self.explanations.iloc[0]
        return f"IdentifiedDamage({best['text'] or best.name}, probability {self.probability:.2g})"


def cosines(slopes: Array) -> Array:
    """Cosines between the whitened effects of groups, (n_groups, n_groups)."""
    unit = slopes / np.linalg.norm(slopes, axis=0)
    return unit.T @ unit


def errors_alone(slopes: Array) -> Array:
    """Standard error of each severity if no other group could be damaged, (n_groups,)."""
    return 1 / np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)


def errors_together(slopes: Array, causes: Sequence[Cause], severity: float) -> Array:
    """Standard error of each amount if all others may have changed as much as is likely beforehand, (n_causes,)."""
    information = slopes.T @ slopes + np.diag([(severity * cause.scale) ** -2 for cause in causes])
    errors = []
    for column, cause in enumerate(causes):
        beside = [other for other, one in enumerate(causes) if other == column or not cause.excludes(one)]
        inverse = np.linalg.inv(information[np.ix_(beside, beside)])
        errors.append(np.sqrt(inverse[beside.index(column), beside.index(column)]))
    return np.array(errors)


def precision(slopes: Array, n_frequencies: int, causes: Sequence[Cause], severity: float) -> pd.DataFrame:
    """Cramer-Rao bounds of each cause alone and beside the others; if there are shapes, without them, too.

    The first rows of the slopes, (n_observed, n_causes), in standard errors, are those of frequencies.
    """
    parts = {"": slopes}
    if len(slopes) > n_frequencies:
        parts["_without_shapes"] = slopes[:n_frequencies]
    columns = {f"alone{name}": errors_alone(part) for name, part in parts.items()}
    columns |= {f"together{name}": errors_together(part, causes, severity) for name, part in parts.items()}
    return pd.DataFrame(columns, index=[cause.name for cause in causes])


def indistinguishable_groups(slopes: Array) -> list[tuple[int, ...]]:
    """Sets of two or three groups of which one looks like the other or the other two together, most similar first.

    Only the part of an effect that no non-negative combination of the others reproduces is informative.
    """
    lengths = np.linalg.norm(slopes, axis=0)
    alike, size = cosines(slopes), slopes.shape[1]
    found: dict[tuple[int, ...], float] = {}
    for group in range(size):
        others = np.delete(np.arange(size), group)
        rest = np.sqrt(np.maximum(1 - np.maximum(alike[group, others], 0.0) ** 2, 0.0))
        for other in np.flatnonzero(rest * lengths[group] * VISIBLE < 1):
            members = tuple(sorted((group, int(others[other]))))
            found[members] = min(float(rest[other]), found.get(members, 1.0))
    pairs = list(found)
    for group in range(size):
        first, second = np.triu_indices(size, 1)
        along, first_along, second_along = alike[first, second], alike[group, first], alike[group, second]
        left = np.maximum(1 - along**2, np.finfo(float).eps)
        shares = (first_along - along * second_along) / left, (second_along - along * first_along) / left
        rest = np.sqrt(np.maximum(1 - shares[0] * first_along - shares[1] * second_along, 0.0))
        looks = (rest * lengths[group] * VISIBLE < 1) & (np.minimum(*shares) >= IMITATING_SHARE)
        for place in np.flatnonzero(looks & (first != group) & (second != group)):
            members = tuple(sorted((group, int(first[place]), int(second[place]))))
            if not any(set(pair) <= set(members) for pair in pairs):
                found[members] = min(float(rest[place]), found.get(members, 1.0))
    return sorted(found, key=lambda members: found[members])
