"""Which stretches of divided groups explain a shift, and how probably."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._effects import FrequencyEffects, StructuralChanges
from skthermo._estimators.warnings import reported_by_caller
from skthermo._tables.arrays import Array
from skthermo.fem import Structure
from skthermo.studies.identification import (
    SOMETHING_ELSE,
    Cause,
    Curves,
    DamagePrior,
    FrequencyShift,
    Observed,
    Posterior,
    Scale,
    compared,
    screen,
)
from skthermo.studies.location._division import Division
from skthermo.surrogate import with_model

PLAUSIBLE = 0.01  # probability of several groups together from which on each of them is divided in turn

ALIKE = 0.98  # cosine between the effects of two stretches from which on modes cannot tell one from the other
AS_PROBABLE = 0.2  # and the ratio of their probabilities from which on both are named


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


@dataclass(frozen=True)
class Explained:
    """One explanation: the damaged members and the severity of each group in it, and its probability."""

    probability: float
    members: Mapping[str, frozenset[Hashable]]
    severities: Mapping[str, float]
    has_else: bool


@dataclass(frozen=True)
class Answer:
    """Explanations by stretches, and two probable stretches that look alike, if there are such."""

    explained: Sequence[Explained]
    alike: tuple[Stretch, ...]


@dataclass(frozen=True)
class MeasuredShift:
    """A measured shift of frequencies, and of shapes if there are any, to be explained by stretches of groups.

    ``contents`` are the model's groups in each group, and ``together`` the groups that probably explain it together.
    ``theta`` is a row of parameters, the mean of the records.
    """

    fem: Any
    structure: Structure
    contents: Mapping[str, Sequence[str]]
    shift: FrequencyShift
    theta: Array
    prior: DamagePrior
    together: Sequence[tuple[str, ...]]
    shapes: Any = None
    dofs: Any = None
    shape_noise: Any = None

    def explained(self, divisions: Mapping[str, Division], random: np.random.RandomState) -> Answer:
        """Explanations by stretches of divided groups, and by groups that are not divided."""
        question = Question.of(self.fem.model, self.contents, divisions)
        observed, curves = self._curves(question)
        labels = [f"{stretch.group} [{number}]" for number, stretch in enumerate(question.stretches)]
        causes = [Cause(label, scale=stretch.scale) for label, stretch in zip(labels, question.stretches, strict=True)]
        scale = Scale(observed, None, causes, self.prior, curves)
        sets, logs = zip(*question.explanations(self.prior, self.together), strict=True)
        posterior = Posterior.of(scale, screen(scale, sets, logs), np.array(logs), random)
        stretch_of = dict(zip(labels, question.stretches, strict=True))
        explained = []
        for one in posterior.explanations:
            stretches = [stretch_of[label] for label in one.named]
            explained.append(
                Explained(
                    one.probability,
                    {stretch.group: stretch.members for stretch in stretches},
                    dict(zip([stretch.group for stretch in stretches], one.draws.mean(axis=0).tolist(), strict=True)),
                    SOMETHING_ELSE in one.causes,
                )
            )
        probable = np.array([posterior.probability_of(label) for label in labels])
        return Answer(explained, alike(question, curves, probable))

    def _curves(self, question: Question) -> tuple[Observed, Curves]:
        """What was measured, and the effects of all stretches on it."""
        twin = with_model(self.fem, self.structure.divide(self.fem.model, question.parts))
        changes = StructuralChanges.of_damage(twin.model, question.names)
        mode_is_known = np.where(np.isnan(self.shift.mean), np.nan, 1.0)[np.newaxis]
        effects = FrequencyEffects.of(twin, self.theta, mode_is_known, changes)
        with reported_by_caller(["foreign-shapes"]):
            comparison = compared(effects, self.shift, self.shapes, self.dofs, self.shape_noise)
        observed = comparison.observed(self.prior.model_error)
        return observed, Curves.of_stretches(comparison.effects, question.incidence, observed.rotation)


def alike(question: Question, curves: Curves, probable: NDArray) -> tuple[Stretch, ...]:
    """The most probable part of a group and, if damage elsewhere looks the same, the most probable such place."""
    slopes = curves.slopes[:, 0]
    slopes = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), np.finfo(float).tiny)
    is_part = np.array([stretch.is_part for stretch in question.stretches])
    best = int(np.where(is_part, probable, -1.0).argmax())
    first = question.stretches[best]
    is_elsewhere = np.array([not stretch.members & first.members for stretch in question.stretches])
    is_alike = is_part & is_elsewhere & (slopes @ slopes[best] > ALIKE) & (probable > AS_PROBABLE * probable[best])
    if not first.is_part or not is_alike.any():
        return ()
    return first, question.stretches[int(np.where(is_alike, probable, -1.0).argmax())]
