"""Which stretches of divided groups explain a shift."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import combinations
from math import comb
from typing import Any

import numpy as np

from skthermo._arrays import Array
from skthermo.fem import Structure
from skthermo.studies.identification import DamagePrior
from skthermo.studies.location._division import Division

PLAUSIBLE = 0.01  # probability of several groups together from which on each of them is divided in turn


@dataclass(frozen=True)
class Stretch:
    """A whole group, or a part of it, some neighbouring pieces, as a cause."""

    group: str
    columns: tuple[int, ...]
    members: frozenset[Hashable]
    prior: float
    scale: float
    is_part: bool


@dataclass(frozen=True)
class Question:
    """Stretches of groups as causes, and the explanations that they make up with their prior probabilities.

    ``names`` are the damage groups of the divided model whose severities the stretches' ``columns`` count.
    """

    stretches: Sequence[Stretch]
    names: Sequence[str]
    parts: Mapping[str, Mapping[str, Sequence[Hashable]]]

    @classmethod
    def of(cls, model: Any, contents: Mapping[str, Sequence[str]], divisions: Mapping[str, Division]) -> Question:
        """Of groups that consist of the model's groups, each divided or, by default, whole."""
        stretches, names, parts = [], [], {}
        for group, own in contents.items():
            first = len(names)
            division = divisions.get(group)
            if division is None:
                names += [name for name in own if name not in names]
                columns = tuple(names.index(name) for name in own)
                stretches.append(Stretch(group, columns, frozenset(members_of(model, own)), 1.0, 1.0, False))
                continue
            labels = [f"{group}, piece {number}" for number in range(1, len(division.pieces) + 1)]
            names += labels
            for name in own:
                inside = set(members_of(model, [name]))
                named = {
                    label: inside.intersection(piece) for label, piece in zip(labels, division.pieces, strict=True)
                }
                parts[name] = {label: members for label, members in named.items() if members}
            for positions, prior, scale in division.stretches():
                members = frozenset(member for position in positions for member in division.pieces[position])
                columns = tuple(first + position for position in positions)
                is_part = len(positions) < len(division.pieces)
                stretches.append(Stretch(group, columns, members, prior, scale, is_part))
        return cls(stretches, names, parts)

    @property
    def incidence(self) -> Array:
        """Which stretch contains which of the divided model's groups, (n_stretches, n_names)."""
        found = np.zeros((len(self.stretches), len(self.names)), dtype=bool)
        for row, stretch in zip(found, self.stretches, strict=True):
            row[list(stretch.columns)] = True
        return found

    def of_group(self, group: str) -> list[int]:
        """Positions of the stretches of a group, the whole of it first."""
        return [position for position, stretch in enumerate(self.stretches) if stretch.group == group]

    def explanations(
        self, prior: DamagePrior, together: Sequence[tuple[str, ...]]
    ) -> Iterator[tuple[tuple[int, ...], float]]:
        """Sets of stretches and the logarithms of their prior probabilities.

        Of several groups, given as ``together``, one after the other is divided, while the others are whole.
        """
        groups = list(dict.fromkeys(stretch.group for stretch in self.stretches))
        by_group = {group: self.of_group(group) for group in groups}
        yield (), np.log(prior.numbers[0])
        for number, share in enumerate(prior.numbers[1:], 1):
            for chosen in combinations(groups, number):
                if (number > 2 and chosen not in together) or not share:
                    continue
                each = share / comb(len(groups), number)
                divided = [group for group in chosen if len(by_group[group]) > 1]
                if (number > 1 and chosen not in together) or not divided:
                    yield tuple(by_group[group][0] for group in chosen), np.log(each)
                    continue
                for group in divided:
                    others = tuple(by_group[other][0] for other in chosen if other != group)
                    for position in by_group[group]:
                        yield (position, *others), np.log(each / len(divided) * self.stretches[position].prior)


def members_of(model: Any, names: Sequence[str]) -> list[Hashable]:
    """Members of a structure whose stiffness some damage groups of a model scale."""
    positions = dict.fromkeys(position for name in names for position in model.groups[name])
    return list(dict.fromkeys(member for position in positions for member, _ in model.contents[position]))


def on_pieces(fem: Any, structure: Structure, parts: Mapping[str, Mapping[str, Sequence[Hashable]]]) -> Any:
    """The fitted chain with its model exchanged for one of the same frequencies, whose groups are divided."""
    twin = copy(fem)
    twin.model = structure.divide(fem.model, parts)
    twin.simulator_ = replace(fem.simulator_, model=twin.model, reduced=None, box=None)
    return twin
