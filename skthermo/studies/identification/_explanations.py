"""Sets of causes that may explain what was measured, and how probable each is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import comb

import numpy as np
from scipy.special import logsumexp

from skthermo._arrays import Array
from skthermo.studies.identification._causes import Cause
from skthermo.studies.identification._comparison import Effects
from skthermo.studies.identification._curves import Curves
from skthermo.studies.identification._evidence import (
    ELSE_SIZES,
    Amounts,
    Observed,
    most_probable,
    weighed,
)
from skthermo.studies.identification._prior import DamagePrior

MOST_SETS = 5000  # sets of as many causes that are all weighed; beyond it, only those that extend the best smaller ones
AT_ONCE = 400  # sets in memory
N_PARENTS = 50  # smaller sets that are extended then
STEPS = 8  # Gauss-Newton steps on tabulated effects
EXACT_STEPS, SETTLED = 10, 1e-5  # on exact effects, and the change of an amount that ends them
MATTERS = 1e-3  # probability of an explanation from which on its effects are computed exactly

Set = tuple[int, ...]


@dataclass(frozen=True)
class Weight:
    """One set of causes: ``log_evidence`` by size of something else, the first of which is 0, and scale (Student).

    ``means`` and ``covariances`` of the amounts have one or two axes more; ``best`` are the most probable ones by size,
    (n_sizes, k), and ``change`` (n_sizes, n_observed) and ``variances`` the effects and variances there.
    """

    causes: Set
    log_evidence: Array
    means: Array
    covariances: Array
    best: Array
    change: Array
    variances: Array


@dataclass(frozen=True)
class Correction:
    """Exact less tabulated effects of one set at its amounts ``centre``, and the derivatives of that difference."""

    centre: Array
    offset: Array
    slopes: Array


@dataclass(frozen=True)
class Scale:
    """Weighs sets of causes: observations, tabulated and exact effects, and the prior law of amounts."""

    observed: Observed
    effects: Effects
    causes: Sequence[Cause]
    prior: DamagePrior
    curves: Curves = field(repr=False)

    @classmethod
    def of(cls, observed: Observed, effects: Effects, causes: Sequence[Cause], prior: DamagePrior) -> Scale:
        """With effects tabulated."""
        return cls(observed, effects, causes, prior, Curves.of(effects, list(causes), observed))

    @property
    def log_sizes(self) -> Array:
        """Logarithms of the prior probabilities of the sizes of something else, the first of which is 0."""
        some = self.prior.something_else
        with np.errstate(divide="ignore"):
            return np.log(np.append(1 - some, np.full(len(ELSE_SIZES), some / len(ELSE_SIZES))))

    def law(self, sets: Array) -> Amounts:
        """Law of the amounts of sets of causes (n_sets, k) before the records are seen."""
        scales = np.array([cause.scale for cause in self.causes])[sets] * self.prior.severity
        lowest, highest = (
            np.array([getattr(cause, end) for cause in self.causes])[sets] for end in ("lowest", "highest")
        )
        if self.prior.law == "uniform":
            return Amounts(100 * scales, np.maximum(lowest, -scales), np.minimum(highest, scales))
        return Amounts(scales, lowest, highest)

    def weigh(self, sets: Array, log_prior: Array, corrections: Sequence[Correction] | None = None) -> list[Weight]:
        """Weights of sets of causes (n_sets, k), by tabulated effects that may be corrected."""
        law, sizes = self.law(sets), np.append(0.0, ELSE_SIZES)
        amounts = np.zeros((len(sets), len(sizes), sets.shape[1]))
        other = 1 + sizes[:, np.newaxis] ** 2 * self.observed.elsewhere
        for step in range(STEPS if sets.shape[1] else 1):
            change, slopes, variances = self.curves.at(sets, amounts)
            if corrections is not None:
                centre, offset, slope = (
                    np.stack([getattr(one, name) for one in corrections])[:, np.newaxis]
                    for name in ("centre", "offset", "slopes")
                )
                change = change + offset + (slope @ (amounts - centre)[..., np.newaxis])[..., 0]
                slopes = slopes + slope
            variances = other + self.prior.model_error**2 * variances
            target = self.observed.measured - change + (slopes @ amounts[..., np.newaxis])[..., 0]
            if step < STEPS - 1:
                amounts = most_probable(slopes, target, variances, law)
        found = weighed(self.observed, slopes, target, variances, law, log_prior[:, np.newaxis] + self.log_sizes)
        return [
            Weight(tuple(causes.tolist()), *parts)
            for causes, *parts in zip(
                sets, found.log_evidence, found.means, found.covariances, amounts, change, variances, strict=True
            )
        ]

    def refined(self, weight: Weight, log_prior: float) -> Weight:
        """The same set by its exact effects at its most probable amounts."""
        sets = np.array([weight.causes], dtype=int)
        before = None
        for _ in range(EXACT_STEPS):
            size = int((logsumexp(weight.log_evidence, axis=-1) + self.log_sizes).argmax())
            amounts = weight.best[size]
            if before is not None and np.abs(amounts - before).max(initial=0.0) < SETTLED:
                break
            before = amounts
            full = np.zeros(len(self.causes))
            full[list(weight.causes)] = amounts
            change, slopes = self.effects(full)
            tabulated, tangents, _ = self.curves.at(sets, amounts[np.newaxis, np.newaxis])
            correction = Correction(
                amounts,
                self.observed.rotation @ change - tabulated[0, 0],
                self.observed.rotation @ slopes[:, list(weight.causes)] - tangents[0, 0],
            )
            weight = self.weigh(sets, np.array([log_prior]), [correction])[0]
        return weight

    def needs_refinement(self, weight: Weight) -> bool:
        """Whether tabulated effects are not those of its most probable amounts."""
        if len(weight.causes) > 1:
            return True
        nodes, amount = self.curves.nodes[list(weight.causes)], weight.best[0]
        return bool((amount < nodes[:, 0]).any() or (amount > nodes[:, -1]).any())


def weigh(scale: Scale, sets: Sequence[Set], log_priors: Sequence[float]) -> list[Weight]:
    """Weights of an explicit list of sets of causes; exact for those that matter."""
    return refine(scale, screen(scale, sets, log_priors), log_priors)


def screen(scale: Scale, sets: Sequence[Set], log_priors: Sequence[float]) -> list[Weight]:
    """Weights of sets of causes by tabulated effects."""
    found: list[Weight] = [None] * len(sets)  # type: ignore[list-item]
    for size in sorted({len(one) for one in sets}):
        places = [place for place, one in enumerate(sets) if len(one) == size]
        for first in range(0, len(places), AT_ONCE):
            some = places[first : first + AT_ONCE]
            columns = np.array([sets[place] for place in some], dtype=int).reshape(len(some), size)
            for place, weight in zip(some, scale.weigh(columns, np.array([log_priors[p] for p in some])), strict=True):
                found[place] = weight
    return found


def refine(scale: Scale, found: list[Weight], log_priors: Sequence[float]) -> list[Weight]:
    """The same weights, exact for the sets that matter."""
    found = list(found)
    logs = np.array([log_prior + total(scale, weight) for weight, log_prior in zip(found, log_priors, strict=True)])
    probable = np.exp(logs - logsumexp(logs))
    for place in np.flatnonzero(probable > MATTERS):
        if scale.needs_refinement(found[place]):
            found[place] = scale.refined(found[place], log_priors[place])
    return found


def total(scale: Scale, weight: Weight) -> float:
    """Log evidence of a set of causes, with or without something else."""
    return float(logsumexp(weight.log_evidence + scale.log_sizes[:, np.newaxis]))


def explanations(scale: Scale) -> tuple[list[Weight], Array]:
    """All sets of as many causes as the prior allows, and the logarithms of their prior probabilities.

    Where there are too many, the best smaller ones are extended by every other cause.
    """
    numbers = np.array(scale.prior.numbers)[: len(scale.causes) + 1]
    numbers = numbers / numbers.sum()
    found: list[Weight] = []
    priors: list[float] = []
    for size, probability in enumerate(numbers):
        if probability == 0:
            continue
        every = comb(len(scale.causes), size)
        sets: list[Set] = list(combinations(range(len(scale.causes)), size)) if every <= MOST_SETS else []
        if not sets:
            best = sorted(zip(found, priors, strict=True), key=lambda one: -total(scale, one[0]) - one[1])
            parents = [one.causes for one, _ in best if len(one.causes) == size - 1][:N_PARENTS]
            sets = list(
                dict.fromkeys(tuple(sorted({*p, c})) for p in parents for c in range(len(scale.causes)) if c not in p)
            )
        sets = [one for one in sets if is_possible(one, scale.causes)]
        priors += [float(np.log(probability / every))] * len(sets)
        found += screen(scale, sets, priors[-len(sets) :])
    return refine(scale, found, priors), np.array(priors)


def is_possible(causes: Set, all_causes: Sequence[Cause]) -> bool:
    """Whether no two of the causes oppose each other."""
    return not any(all_causes[a].opposes(all_causes[b]) for a, b in combinations(causes, 2))
