"""How probable it is that stretches of groups are damaged."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo._changes import Changes
from skthermo._frequency_effects import FrequencyEffects
from skthermo._warnings import told_around
from skthermo.fem import Structure
from skthermo.studies.identification import (
    SOMETHING_ELSE,
    Cause,
    DamagePrior,
    Observed,
    Posterior,
    Scale,
    Shift,
    compared,
    screen,
)
from skthermo.studies.location._curves import Curves
from skthermo.studies.location._division import Division
from skthermo.studies.location._question import Question, Stretch, on_pieces

ALIKE = 0.98  # cosine between the effects of two stretches from which on modes cannot tell one from the other
AS_PROBABLE = 0.2  # and the ratio of their probabilities from which on that is said


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
    shift: Shift
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
        scale = Scale(observed, curves, causes, self.prior, curves)
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
        twin = on_pieces(self.fem, self.structure, question.parts)
        changes = Changes.of_damage(twin.model, question.names)
        mode_is_known = np.where(np.isnan(self.shift.mean), np.nan, 1.0)[np.newaxis]
        effects = FrequencyEffects.of(twin, self.theta, mode_is_known, changes)
        with told_around(["foreign mode shapes"]):
            comparison = compared(effects, self.shift, self.shapes, self.dofs, self.shape_noise)
        observed = comparison.observed(self.prior.model_error)
        return observed, Curves.of(comparison.effects, question.incidence, observed.rotation)


def alike(question: Question, curves: Curves, probable: NDArray) -> tuple[Stretch, ...]:
    """The most probable part of a group and, if damage elsewhere looks the same, the most probable such place."""
    slopes = curves.slopes[:, 0] @ curves.rotation.T
    slopes = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), np.finfo(float).tiny)
    is_part = np.array([stretch.is_part for stretch in question.stretches])
    best = int(np.where(is_part, probable, -1.0).argmax())
    first = question.stretches[best]
    is_elsewhere = np.array([not stretch.members & first.members for stretch in question.stretches])
    is_alike = is_part & is_elsewhere & (slopes @ slopes[best] > ALIKE) & (probable > AS_PROBABLE * probable[best])
    if not first.is_part or not is_alike.any():
        return ()
    return first, question.stretches[int(np.where(is_alike, probable, -1.0).argmax())]
