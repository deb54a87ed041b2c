"""Sets of causes that may explain what was measured, and how probable each is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, compress
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from skthermo._tables.arrays import Array
from skthermo.studies.identification._causes import Cause, DamagePrior
from skthermo.studies.identification._curves import Curves, Effects
from skthermo.studies.identification._evidence import (
    ELSE_SIZES,
    ERROR_FACTORS,
    Amounts,
    Observed,
    most_probable,
    weighed,
)

MOST_SETS = 5000  # sets of as many causes that are all weighed; beyond it, only those that extend the best smaller ones
AT_ONCE = 400  # sets in memory
N_PARENTS = 50  # smaller sets that are extended then
STEPS = 8  # Gauss-Newton steps on tabulated effects
EXACT_STEPS, SETTLED = 10, 0.05  # on exact effects, and the change of an amount, in standard errors, that ends them
MATTERS = 1e-3  # probability of an explanation from which on its effects are computed exactly

Set = tuple[int, ...]


@dataclass(frozen=True)
class Weight:
    """One set of causes: ``log_evidence`` by errors (`Scale.variances`) and scale (Student).

    ``means`` and ``covariances`` of the amounts have one or two axes more; ``best``, (n_errors, k), are the most
    probable ones by errors, and ``change`` and ``variances``, (n_errors, n_observed), the effects and variances there.
    """

    causes: Set
    log_evidence: Array
    means: Array
    covariances: Array
    best: Array
    change: Array
    variances: Array

    def amounts(self, log_errors: Array) -> Array:
        """The most probable amounts with the most probable errors."""
        return self.best[self._likely(log_errors)]

    def is_as(self, other: Weight, log_errors: Array) -> bool:
        """Whether the amounts differ from others by much less than their standard errors."""
        errors = self._likely(log_errors)
        variances = np.diagonal(self.covariances[errors, self.log_evidence[errors].argmax()], axis1=-2, axis2=-1)
        change = self.amounts(log_errors) - other.amounts(log_errors)
        return bool((np.abs(change) < SETTLED * np.sqrt(variances)).all())

    def _likely(self, log_errors: Array) -> int:
        return int((logsumexp(self.log_evidence, axis=-1) + log_errors).argmax())


@dataclass(frozen=True)
class Correction:
    """Exact less tabulated effects of one set at its amounts ``centre``, and the derivatives of that difference."""

    centre: Array
    offset: Array
    slopes: Array


@dataclass(frozen=True)
class Scale:
    """Weighs sets of causes: observations, exact effects (None if tabulated ones do), and the law of amounts."""

    observed: Observed
    effects: Effects | None
    causes: Sequence[Cause]
    prior: DamagePrior
    curves: Curves = field(repr=False)

    @classmethod
    def of(cls, observed: Observed, effects: Effects, causes: Sequence[Cause], prior: DamagePrior) -> Scale:
        """With effects tabulated."""
        return cls(observed, effects, causes, prior, Curves.of(effects, list(causes), observed))

    @property
    def log_errors(self) -> Array:
        """Logarithms of the prior probabilities of `errors`."""
        some, alone, beside = self.prior.something_else, len(ERROR_FACTORS), len(ELSE_SIZES)
        with np.errstate(divide="ignore"):
            return np.log(np.repeat([(1 - some) / alone, some / beside], [alone, beside]))

    @property
    def variances(self) -> Array:
        """Variances of what was observed, (n_errors, n_observed).

        First without something else and with different errors of the model, then with something else of different size.
        """
        nothing, usual = np.zeros(len(ERROR_FACTORS)), np.ones(len(ELSE_SIZES))
        return self.observed.variances(np.append(nothing, ELSE_SIZES), np.append(ERROR_FACTORS, usual))

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
        law = self.law(sets)
        variances = np.broadcast_to(self.variances, (len(sets), *self.variances.shape))
        amounts = np.zeros((*variances.shape[:2], sets.shape[1]))
        for step in range(STEPS if sets.shape[1] else 1):
            change, slopes = self.curves.at(sets, amounts)
            if corrections is not None:
                centre, offset, slope = (
                    np.stack([getattr(one, name) for one in corrections])[:, np.newaxis]
                    for name in ("centre", "offset", "slopes")
                )
                change = change + offset + (slope @ (amounts - centre)[..., np.newaxis])[..., 0]
                slopes = slopes + slope
            target = self.observed.measured - change + (slopes @ amounts[..., np.newaxis])[..., 0]
            if step < STEPS - 1:
                amounts = most_probable(slopes, target, variances, law)
        found = weighed(self.observed, slopes, target, variances, law, log_prior[:, np.newaxis] + self.log_errors)
        return [
            Weight(tuple(causes.tolist()), *parts)
            for causes, *parts in zip(sets, *found, amounts, change, variances, strict=True)
        ]

    def exact(self, weights: Sequence[Weight]) -> list[Correction]:
        """Exact less tabulated effects of sets of causes at their most probable amounts."""
        full = np.zeros((len(weights), len(self.causes)))
        for row, weight in zip(full, weights, strict=True):
            row[list(weight.causes)] = weight.amounts(self.log_errors)
        changes, slopes = self.effects(full)
        changes, slopes = changes @ self.observed.rotation.T, self.observed.rotation @ slopes
        found = []
        for row, change, slope, weight in zip(full, changes, slopes, weights, strict=True):
            columns = list(weight.causes)
            tabulated, tangents = self.curves.at(np.array([columns], dtype=int), row[columns][np.newaxis, np.newaxis])
            found.append(Correction(row[columns], change - tabulated[0, 0], slope[:, columns] - tangents[0, 0]))
        return found

    def needs_refinement(self, weight: Weight) -> bool:
        """Whether tabulated effects are not those of its most probable amounts."""
        if len(weight.causes) > 1:
            return True
        return not self.curves.are_small(weight.causes, weight.amounts(self.log_errors)).all()

    def with_large(self, weights: Sequence[Weight]) -> Scale:
        """The same with large amounts tabulated for those causes that have them in the best set of its size.

        Best with something else, and best without it, which would hide large damage that is not tabulated yet.
        """
        far = set()
        for share in dict.fromkeys([self.prior.something_else, 0.0]):
            scale = replace(self, prior=replace(self.prior, something_else=share))
            best = best_of_each(weights, np.array([total(scale, weight) for weight in weights]))
            for weight in compress(weights, best):
                is_small = self.curves.are_small(weight.causes, weight.amounts(scale.log_errors))
                far |= {cause for cause in compress(weight.causes, ~is_small) if not self.curves.is_whole[cause]}
        return replace(self, curves=self.curves.whole(self.effects, sorted(far), self.observed)) if far else self


def screen(
    scale: Scale, sets: Sequence[Set], log_priors: Sequence[float], corrections: Sequence[Correction] | None = None
) -> list[Weight]:
    """Weights of sets of causes by tabulated effects, which may be corrected."""
    found: list[Weight] = [None] * len(sets)  # type: ignore[list-item]
    for size in sorted({len(one) for one in sets}):
        places = [place for place, one in enumerate(sets) if len(one) == size]
        for first in range(0, len(places), AT_ONCE):
            some = places[first : first + AT_ONCE]
            columns = np.array([sets[place] for place in some], dtype=int).reshape(len(some), size)
            corrected = None if corrections is None else [corrections[place] for place in some]
            weights = scale.weigh(columns, np.array([log_priors[place] for place in some]), corrected)
            for place, weight in zip(some, weights, strict=True):
                found[place] = weight
    return found


def refine(scale: Scale, found: list[Weight], log_priors: Sequence[float]) -> list[Weight]:
    """The same weights, with exact effects of the sets that matter at their most probable amounts."""
    found, settled = list(found), np.zeros(len(found), dtype=bool)
    for _ in range(EXACT_STEPS):
        logs = np.array([log_prior + total(scale, weight) for weight, log_prior in zip(found, log_priors, strict=True)])
        matter = np.flatnonzero(((logs - logsumexp(logs) > np.log(MATTERS)) | best_of_each(found, logs)) & ~settled)
        unsettled = [place for place in matter if scale.needs_refinement(found[place])]
        if not unsettled:
            break
        before = [found[place] for place in unsettled]
        priors = [log_priors[place] for place in unsettled]
        after = screen(scale, [weight.causes for weight in before], priors, scale.exact(before))
        for place, old, new in zip(unsettled, before, after, strict=True):
            found[place], settled[place] = new, new.is_as(old, scale.log_errors)
    return found


def best_of_each(weights: Sequence[Weight], logs: Array) -> NDArray[np.bool_]:
    """Whether a set is the most probable of its size, by the logarithms of their probabilities."""
    sizes = np.array([len(weight.causes) for weight in weights])
    best = [np.where(sizes == size, logs, -np.inf).argmax() for size in np.unique(sizes)]
    return np.isin(np.arange(len(sizes)), best)


def total(scale: Scale, weight: Weight) -> float:
    """Log evidence of a set of causes, with or without something else."""
    return float(logsumexp(weight.log_evidence + scale.log_errors[:, np.newaxis]))


def explanations(scale: Scale) -> tuple[list[Weight], Array]:
    """All sets of as many causes as the prior allows, and the logarithms of their prior probabilities."""
    found, priors = all_sets(scale)
    while (further := scale.with_large(found)) is not scale:
        scale = further
        found, priors = all_sets(scale)
    return refine(scale, found, priors), np.array(priors)


def all_sets(scale: Scale) -> tuple[list[Weight], list[float]]:
    """All sets by tabulated effects. Where there are too many, the best smaller ones are extended by every cause."""
    n_combined = sum(not cause.is_even for cause in scale.causes)  # even changes explain alone
    numbers = np.array(scale.prior.numbers)[: n_combined + 1]
    numbers = numbers / numbers.sum()
    found: list[Weight] = []
    priors: list[float] = []
    for size, probability in enumerate(numbers):
        if probability == 0:
            continue
        n_causes = len(scale.causes) if size < 2 else n_combined
        every = comb(n_causes, size)
        sets: list[Set] = list(combinations(range(n_causes), size)) if every <= MOST_SETS else []
        if not sets:
            best = sorted(zip(found, priors, strict=True), key=lambda one: -total(scale, one[0]) - one[1])
            parents = [one.causes for one, _ in best if len(one.causes) == size - 1][:N_PARENTS]
            sets = list(dict.fromkeys(tuple(sorted({*p, c})) for p in parents for c in range(n_combined) if c not in p))
        causes = scale.causes
        sets = [one for one in sets if not any(causes[a].excludes(causes[b]) for a, b in combinations(one, 2))]
        priors += [float(np.log(probability / every))] * len(sets)
        found += screen(scale, sets, priors[-len(sets) :])
    return found, priors
