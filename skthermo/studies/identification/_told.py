"""Explanations in words: those that these modes cannot tell apart are told together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import pandas as pd

from skthermo._formatting import SPACE, significant
from skthermo.studies.identification._causes import NO_DAMAGE, SOMETHING_ELSE

ALIKE = 0.95  # cosine between effects from which on causes that are confused are said together
TOLD = {
    "damage": ("a loss of {size}{of stiffness} in {name}", "of {size} in {name}"),
    "stiffening": ("a gain of {size}{of stiffness} in {name}", "of {size} in {name}"),
    "parameter": ("a change of {size} in {name}", "of {size} in {name}"),
    "mass": ("added mass of {size} times {name}", "of {size} times {name}"),
}
"""What is said of a cause by its kind: of the first of the kind, and of those that follow it."""


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
        return f"{self._number(self.value)}{self._unit}"

    @property
    def band(self) -> str:
        """The band, from the smaller to the larger amount."""
        low, high = sorted((self.lowest, self.highest), key=abs if self.kind == "stiffening" else float)
        return f"between {self._number(low)} and {self._number(high)}{self._unit}"

    @property
    def _unit(self) -> str:
        return "" if self.kind == "mass" else f"{SPACE}%"

    def _number(self, value: float) -> str:
        if self.kind == "mass":
            return significant(value)
        width = abs(self.highest - self.lowest)
        decimals = 0 if width >= 0.03 else 1 if width >= 0.003 else 2
        sign = "+" if self.kind == "parameter" else ""
        return f"{100 * (abs(value) if self.kind == 'stiffening' else value):{sign}.{decimals}f}"

    def agrees(self, other: Amount) -> bool:
        """Whether another cause's amount is of the same kind and within the band of this one."""
        return self.kind == other.kind and self.lowest <= other.value <= self.highest


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

    def phrase(self, in_full: bool = False) -> str:
        """Causes with their amounts as part of a sentence; in full with what is lost, and the bands."""
        if self.is_else:
            return "something else than damage of these groups"
        said, kinds = [], set()
        for amounts in self.changes:
            said.append(_phrase(amounts, amounts[0].kind in kinds, in_full))
            kinds.add(amounts[0].kind)
        return " and ".join(said + [SOMETHING_ELSE] * self.has_else).rstrip(",") or NO_DAMAGE


def _phrase(amounts: Sequence[Amount], is_further: bool, in_full: bool) -> str:
    """One cause, or several that cannot be told apart; those whose amounts agree share them."""
    first, texts = amounts[0], []
    shared = [one for one in amounts if first.agrees(one)]
    for one in [first, *(one for one in amounts if one not in shared)]:
        saying = TOLD[one.kind][is_further or (one is not first and one.kind == first.kind)]
        names = either([other.cause for other in (shared if one is first else [one])])
        text = saying.format_map({"size": one.size, "name": names, "of stiffness": " of stiffness" * in_full})
        texts.append(text + (f" ({one.band})" if in_full else ""))
    return " or ".join(texts) + (", which these modes cannot tell apart," if len(amounts) > 1 else "")


def told(found: Any) -> list[Told]:
    """Explanations, the most probable first; those that these modes cannot tell apart are one.

    They differ only in causes that look alike, or in causes that these modes do not show.
    """
    sets = alike_sets(found.confused, found.similarity)
    together: dict[frozenset[Any], list[tuple[float, tuple[str, ...]]]] = {}
    listed: set[tuple[str, ...]] = set()
    for name, probability in found.explanations["probability"].items():
        causes = causes_of(found, str(name))
        seen = tuple(cause for cause in causes if cause not in found.unseen)
        shown = seen if seen in listed else causes
        listed.add(causes)
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
