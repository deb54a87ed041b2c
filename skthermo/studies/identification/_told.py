"""Explanations in words: those that these modes cannot tell apart are told together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import pandas as pd

from skthermo._formatting import SPACE, listed
from skthermo.studies.identification.weighing import NO_DAMAGE, SOMETHING_ELSE

ALIKE = 0.95  # cosine between effects from which on causes that are confused are said together
TOLD = {
    "damage": ("a loss of {size}{of stiffness} in {name}", "of {size} in {name}", ""),
    "stiffening": ("a gain of {size}{of stiffness} in {name}", "of {size} in {name}", " stiffer"),
    "lower": ("a fall of {size} in {name}", "of {size} in {name}", " lower"),
    "higher": ("a rise of {size} in {name}", "of {size} in {name}", " higher"),
    "mass": ("added mass of {size} of {name}", "of {size} of {name}", ""),
}
"""What is said of a cause: first, after another of the same kind, and the ending of its name that this leaves out."""


def either(names: Sequence[str]) -> str:
    """One of these names, in a sentence."""
    return " or ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


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
        """The band, from the smaller to the larger amount."""
        low, high = sorted((self.lowest, self.highest), key=abs)
        return f"between {self._number(low)} and {self._number(high)}{SPACE}%"

    @property
    def saying(self) -> str:
        """What is said of it: a key of ``TOLD``."""
        return self.kind if self.kind != "parameter" else "lower" if self.value < 0 else "higher"

    @property
    def subject(self) -> str:
        """The name of what changed, without the direction."""
        return self.cause.removesuffix(TOLD[self.saying][2])

    def _number(self, value: float) -> str:
        width = abs(self.highest - self.lowest)
        return f"{100 * abs(value):.{0 if width >= 0.03 else 1 if width >= 0.003 else 2}f}"

    def agrees(self, other: Amount) -> bool:
        """Whether another cause's amount is of the same kind and within the band of this one."""
        return self.saying == other.saying and self.lowest <= other.value <= self.highest

    def resembles(self, other: Amount) -> bool:
        """Whether another amount of the same cause differs by no more than the width of the band."""
        return abs(self.value - other.value) <= abs(self.highest - self.lowest)


@dataclass(frozen=True)
class Told:
    """What may have changed, how much, and how probable that is, as it is told.

    Each of ``changes`` holds the amounts of causes of which one has changed, the most probable first.
    """

    changes: tuple[tuple[Amount, ...], ...]
    has_else: bool
    probability: float

    @property
    def is_healthy(self) -> bool:
        """Whether nothing has changed."""
        return not self.changes and not self.has_else

    @property
    def is_else(self) -> bool:
        """Whether something has changed, and none of the causes that were sought."""
        return not self.changes and self.has_else

    @property
    def label(self) -> str:
        """Causes with their amounts, for a table or a drawing."""
        parts = [f"{either([one.cause for one in amounts])} {amounts[0].size}" for amounts in self.changes]
        return ", ".join(parts + [SOMETHING_ELSE] * self.has_else) or NO_DAMAGE

    def beside(self, first: Told) -> str:
        """The one thing that it holds beside another explanation, if the rest is about the same; else nothing."""
        known = {amounts[0].cause: amounts[0] for amounts in first.changes}
        own = [amounts for amounts in self.changes if amounts[0].cause not in known]
        shared = [amounts[0] for amounts in self.changes if amounts[0].cause in known]
        is_same = len(shared) == len(known) and all(known[one.cause].resembles(one) for one in shared)
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
    """One cause, or several that cannot be told apart; those whose amounts agree share them."""
    first, texts = amounts[0], []
    shared = [one for one in amounts if first.agrees(one)]
    for one in [first, *(one for one in amounts if one not in shared)]:
        saying = TOLD[one.saying][is_further or (one is not first and one.saying == first.saying)]
        names = either([other.subject for other in (shared if one is first else [one])])
        text = saying.format_map({"size": one.size, "name": names, "of stiffness": " of stiffness" * in_full})
        texts.append(text + (f" ({one.band})" if in_full else ""))
    return " or ".join(texts) + (", which these modes cannot tell apart," if len(amounts) > 1 else "")


def told(found: Any) -> list[Told]:
    """Explanations, the most probable first; those that these modes cannot tell apart are one.

    They differ only in causes that look alike, or in causes that these modes do not show.
    """
    sets = alike_sets(found.confused, found.similarity)
    together: dict[frozenset[Any], list[tuple[float, tuple[str, ...]]]] = {}
    known: set[tuple[str, ...]] = set()
    for name, probability in found.explanations["probability"].items():
        causes = causes_of(found, str(name))
        seen = tuple(cause for cause in causes if cause not in found.unseen)
        shown = seen if seen in known else causes
        known.add(causes)
        key = frozenset(next((group for group in sets if cause in group), cause) for cause in shown)
        together.setdefault(key, []).append((float(probability), causes))
    said = [_joined(found, members, sets) for members in together.values()]
    return sorted(said, key=lambda one: -one.probability)


def _joined(found: Any, members: list[tuple[float, tuple[str, ...]]], sets: list[frozenset[str]]) -> Told:
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
    return Told(tuple(changes), SOMETHING_ELSE in first, sum(probability for probability, _ in members))


def causes_of(found: Any, name: str) -> tuple[str, ...]:
    """The causes of an explanation by its name."""
    amounts = found.estimates.index
    named = [str(cause) for explanation, cause in amounts if explanation == name]
    return (*named, SOMETHING_ELSE) if name.endswith(SOMETHING_ELSE) else tuple(named)


def amount_of(found: Any, causes: Sequence[str], cause: str) -> Amount:
    """How much of a cause there is within an explanation."""
    row = found.estimates.loc[(" + ".join(causes), cause)]
    values = (float(row[name]) for name in ("severity", "lowest", "highest"))
    return Amount(cause, str(found.table["kind"].get(cause, "damage")), *values)


def alike_sets(confused: Sequence[Sequence[str]], similarity: pd.DataFrame) -> list[frozenset[str]]:
    """Sets of causes whose effects are nearly the same, among those that are confused."""
    sets: list[frozenset[str]] = []
    for members in confused:
        for one, other in combinations(members, 2):
            if similarity.loc[one, other] >= ALIKE:
                touched = [group for group in sets if one in group or other in group]
                joined = frozenset({one, other}).union(*touched)
                sets = [group for group in sets if group not in touched] + [joined]
    return sets
