"""How probable sets of causes are, given measured shifts, and draws of their amounts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, compress
from math import comb

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from scipy.special import log_ndtr, logsumexp, ndtri_exp

from skthermo._core.arrays import Array
from skthermo.fem.damage import ALL_GROUPS
from skthermo.studies.identification._causes import NO_DAMAGE, SOMETHING_ELSE, Cause, DamagePrior
from skthermo.studies.identification._curves import Curves, Effects, Observed

ELSE_SIZES = 0.0005 * 4.0 ** np.arange(5)  # relative shifts by which something else may move the modes
ERROR_FACTORS = np.array([1 / 3, 1.0, 3.0])  # of the model's error, which is not well known either
NEGLIGIBLE = 18.0  # difference of a logarithm of a probability below which a term adds nothing
SWEEPS = 25  # steps of a search along each amount in turn
MOST_SETS = 5000  # sets of as many causes that are all weighed; beyond it, only those that extend the best smaller ones
AT_ONCE = 400  # sets in memory
N_PARENTS = 50  # smaller sets that are extended then
STEPS = 8  # Gauss-Newton steps on tabulated effects
EXACT_STEPS, SETTLED = 10, 0.05  # on exact effects, and the change of an amount, in standard errors, that ends them
MATTERS = 1e-3  # probability of an explanation from which on its effects are computed exactly

Set = tuple[int, ...]
Correction = tuple[Array, Array, Array]
"""Amounts of a set, exact less tabulated effects there, and the derivatives of that difference."""

N_NODES = 12  # quadrature nodes in each dimension but the last
NODES, WEIGHTS = np.polynomial.legendre.leggauss(N_NODES)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2
KEPT = 1e-5  # probability of explanations that are kept
MOST_DRAWS, FEWEST = 4000, 200  # draws of all explanations together, and of each
CANDIDATES = 4  # for each draw
BAND = (0.05, 0.95)


@dataclass(frozen=True)
class Amounts:
    """Law of the amounts of the causes of each of some sets before the records are seen: normal, within bounds.

    Arrays of shape (n_sets, n_causes of a set).
    """

    deviations: Array
    lowest: Array
    highest: Array

    @property
    def precisions(self) -> Array:
        return self.deviations**-2

    def log_inside(self) -> Array:
        """Logarithm of the probability of the bounds, (n_sets,)."""
        sides = [stats.norm.cdf(bound / self.deviations) for bound in (self.highest, self.lowest)]
        return np.log(sides[0] - sides[1]).sum(axis=-1)


def most_probable(slopes: Array, target: Array, variances: Array, law: Amounts) -> Array:
    """Amounts within their bounds, (n_sets, n_errors, k), of linear effects (n_sets, n_errors, n_observed, k)."""
    weighted = slopes / variances[..., np.newaxis]
    inner = np.swapaxes(weighted, -1, -2) @ slopes
    size = inner.shape[-1]
    inner = inner + law.precisions[:, np.newaxis, :, np.newaxis] * np.eye(size)
    right = (weighted * target[..., np.newaxis]).sum(axis=-2)
    found = np.zeros_like(right)
    for _ in range(SWEEPS if size > 1 else 1):
        for i in range(size):
            rest = right[..., i] - (inner[..., i, :] * found).sum(axis=-1) + inner[..., i, i] * found[..., i]
            found[..., i] = np.clip(
                rest / inner[..., i, i], law.lowest[:, np.newaxis, i], law.highest[:, np.newaxis, i]
            )
    return found


def weighed(
    observed: Observed, slopes: Array, target: Array, variances: Array, law: Amounts, log_prior: Array
) -> tuple[Array, Array, Array]:
    """Log evidence of linear effects, (n_sets, n_errors, n_scales), and means and covariances of amounts, normal laws.

    These have one or two axes more, for the causes of a set, and end at the bounds. ``log_prior``, (n_sets, n_errors),
    counts in what may be neglected, and not in the evidence.
    """
    size = slopes.shape[-1]
    own = np.where(observed.is_scaled, 1 - observed.of_model, 0.0)  # without the model's error
    inverse = own * (1 / observed.scales[:, np.newaxis] - 1)  # what a scale adds
    spread = variances[:, :, np.newaxis, :] + inverse
    weighted = slopes[:, :, np.newaxis] / spread[..., np.newaxis]
    inner = np.swapaxes(weighted, -1, -2) @ slopes[:, :, np.newaxis]
    inner = inner + law.precisions[:, np.newaxis, np.newaxis, :, np.newaxis] * np.eye(size)
    right = (weighted * target[:, :, np.newaxis, :, np.newaxis]).sum(axis=-2)
    covariances = np.linalg.inv(inner)
    means = (covariances @ right[..., np.newaxis])[..., 0]
    logs = observed.log_scales - (np.log(2 * np.pi * spread) + target[:, :, np.newaxis] ** 2 / spread).sum(axis=-1) / 2
    logs = logs + ((right * means).sum(axis=-1) - np.linalg.slogdet(inner)[1]) / 2
    logs = logs + (np.log(law.precisions).sum(axis=-1) / 2 - law.log_inside())[:, np.newaxis, np.newaxis]
    # the probability of the bounds only lowers them, and is at most that of any one of them
    most = logs + log_prior[..., np.newaxis]
    where = np.nonzero(most > most.max() - NEGLIGIBLE)
    lowest, highest = law.lowest[where[0]], law.highest[where[0]]
    one = log_marginal(means[where], covariances[where], lowest, highest)
    most[where] += one
    kept = most[where] > most[where].max() - NEGLIGIBLE
    where = tuple(place[kept] for place in where)
    inside = log_probability(means[where], covariances[where], lowest[kept], highest[kept])
    log_evidence = np.full(logs.shape, -np.inf)
    log_evidence[where] = logs[where] + inside
    return log_evidence, means, covariances


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
                centre, offset, slope = (np.stack(part)[:, np.newaxis] for part in zip(*corrections, strict=True))
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
            found.append((row[columns], change - tabulated[0, 0], slope[:, columns] - tangents[0, 0]))
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


@dataclass(frozen=True)
class Explanation:
    """Causes that explain the shifts, with or without something else: its probability, and draws of the amounts.

    ``draws`` (n_draws, n_causes of it), ``change`` (n_observed,) at their most probable values, and ``misfit``, the
    sum of squares of what is not explained in standard errors.
    """

    causes: tuple[str, ...]
    probability: float
    draws: Array
    change: Array
    misfit: float

    @property
    def name(self) -> str:
        return " + ".join(self.causes) or NO_DAMAGE

    @property
    def named(self) -> tuple[str, ...]:
        return tuple(cause for cause in self.causes if cause != SOMETHING_ELSE)


@dataclass(frozen=True)
class Posterior:
    """Explanations, the most probable first; the probability that is missing to 1 belongs to those not kept."""

    explanations: Sequence[Explanation]

    @classmethod
    def of(cls, scale: Scale, weights: Sequence[Weight], log_priors: Array, random: np.random.RandomState) -> Posterior:
        """Of weighed sets of causes."""
        terms = [w.log_evidence + scale.log_errors[:, np.newaxis] + p for w, p in zip(weights, log_priors, strict=True)]
        totals = np.array([logsumexp(term) for term in terms])
        everything, found = logsumexp(totals), []
        alone, beside = slice(0, len(ERROR_FACTORS)), slice(len(ERROR_FACTORS), None)
        holds = np.array([[cause in weight.causes for weight in weights] for cause in range(len(scale.causes))])
        best_of_causes = set(np.where(holds, totals, -np.inf).argmax(axis=1).tolist())
        for place, (weight, term) in enumerate(zip(weights, terms, strict=True)):
            for errors, more in ((alone, ()), (beside, (SOMETHING_ELSE,))):
                logs = term[errors] - everything
                probability = min(float(np.exp(logsumexp(logs))), 1.0)
                if probability > KEPT or (place in best_of_causes and probability > 0):
                    found.append(_explanation(scale, weight, logs, errors, more, random))
        return cls(sorted(found, key=lambda one: -one.probability))

    @classmethod
    def mean(cls, posteriors: Sequence[Posterior]) -> Posterior:
        """Average over models that are equally probable."""
        of_name: dict[str, list[Explanation]] = {}
        for posterior in posteriors:
            for one in posterior.explanations:
                of_name.setdefault(one.name, []).append(one)
        return cls(
            sorted((_joined(some, len(posteriors)) for some in of_name.values()), key=lambda one: -one.probability)
        )

    def probability_of(self, cause: str) -> float:
        return min(sum(one.probability for one in self.explanations if cause in one.causes), 1.0)

    def table(self, causes: Sequence[Cause]) -> pd.DataFrame:
        """Average amount of each cause over all explanations, where those without it count as 0.

        An even loss in all groups is damage of each.
        """
        alike = {"damage": (ALL_GROUPS,)}
        rows = [self._average((cause.name, *alike.get(cause.kind, ()))) for cause in causes]
        return pd.DataFrame(rows, index=[cause.name for cause in causes])

    def listed(self, least: float) -> list[Explanation]:
        """Explanations that are at least so probable, or else the most probable one."""
        return [one for one in self.explanations if one.probability >= least] or [self.explanations[0]]

    def estimates(self, least: float) -> pd.DataFrame:
        """Amounts of the causes of each explanation that is listed, if it is right."""
        rows = {
            (one.name, cause): _summary(values, np.full(len(values), 1 / len(values)))
            for one in self.listed(least)
            for cause, values in zip(one.named, one.draws.T, strict=True)
        }
        index = pd.MultiIndex.from_tuples(list(rows), names=["explanation", "cause"])
        return pd.DataFrame(
            list(rows.values()), index=index, columns=["severity", "standard_error", "ci_low", "ci_high"]
        )

    def drawn(self, causes: Sequence[str], number: int, random: np.random.RandomState) -> Array:
        """Draws of the amounts of all causes, (number, n_causes), of explanations by their probability."""
        probable = np.array([one.probability for one in self.explanations])
        chosen = random.choice(len(probable), size=number, p=probable / probable.sum())
        found = np.zeros((number, len(causes)))
        for row, place in enumerate(chosen):
            one = self.explanations[place]
            columns = [list(causes).index(cause) for cause in one.named]
            found[row, columns] = one.draws[random.randint(len(one.draws))]
        return found

    def explained(self) -> Array:
        """Mean over the explanations of what the named causes explain, (n_observed,)."""
        probable = np.array([one.probability for one in self.explanations])
        return probable @ np.array([one.change for one in self.explanations]) / probable.sum()

    def _average(self, names: Sequence[str]) -> dict[str, float]:
        values, weights = [], []
        for one in self.explanations:
            for cause in set(names).intersection(one.named):
                values.append(one.draws[:, one.named.index(cause)])
                weights.append(np.full(len(values[-1]), one.probability / len(values[-1])))
        inside, weight = np.concatenate([*values, np.zeros(0)]), np.concatenate([*weights, np.zeros(0)])
        everything = sum(one.probability for one in self.explanations)
        probability = min(weight.sum() / everything, 1.0)
        present = (
            _summary(inside, weight) if weight.sum() > 0 else dict.fromkeys(("severity", "ci_low", "ci_high"), np.nan)
        )
        all_values, all_weights = np.append(inside, 0.0), np.append(weight, max(everything - weight.sum(), 0.0))
        averages = _summary(all_values, all_weights)
        farthest = present["ci_low" if present["severity"] < 0 else "ci_high"]
        extremes = {"if_damaged": present["severity"], "highest_if_damaged": farthest}
        return {"probability": probability, **averages, **extremes}


def _summary(values: Array, weights: Array) -> dict[str, float]:
    """Mean, standard deviation and 90 % band of weighted values."""
    weights = weights / weights.sum()
    mean = float(weights @ values)
    order = np.argsort(values)
    shares = np.cumsum(weights[order])
    ends = [float(values[order][min(np.searchsorted(shares, share - 1e-12), len(values) - 1)]) for share in BAND]
    error = float(np.sqrt(max(weights @ (values - mean) ** 2, 0.0)))
    return {"severity": mean, "standard_error": error, "ci_low": ends[0], "ci_high": ends[1]}


def _explanation(
    scale: Scale, weight: Weight, logs: Array, errors: slice, more: tuple[str, ...], random: np.random.RandomState
) -> Explanation:
    """One set of causes as an explanation, with some errors, by the logarithms of their weights."""
    probability, law = float(np.exp(logsumexp(logs))), scale.law(np.array([weight.causes], dtype=int))
    drawn = _drawn(logs, weight.means[errors], weight.covariances[errors], law, probability, random)
    # what a misfit cannot show: an effect that is too large or too small by the same factor in all modes
    factors = np.exp(scale.prior.model_error * random.standard_normal(drawn.shape))
    drawn = np.clip(drawn * factors, law.lowest[0], law.highest[0])
    likely = int(logsumexp(logs, axis=-1).argmax()) + errors.start
    rest = scale.observed.measured - weight.change[likely]
    change = np.linalg.solve(scale.observed.rotation, weight.change[likely])
    causes = tuple(scale.causes[cause].name for cause in weight.causes) + more
    return Explanation(causes, probability, drawn, change, float((rest**2 / weight.variances[likely]).sum()))


def _drawn(
    logs: Array, means: Array, covariances: Array, law: Amounts, probability: float, random: np.random.RandomState
) -> Array:
    """Draws of the amounts of one explanation, from a mixture of normal laws within bounds."""
    number = FEWEST + int(MOST_DRAWS * probability)
    size = means.shape[-1]
    if size == 0:
        return np.zeros((1, 0))
    shares = np.exp(logs - logs.max()).ravel()
    chosen = random.choice(len(shares), size=CANDIDATES * number, p=shares / shares.sum())
    bounds = [np.broadcast_to(bound, (len(chosen), size)) for bound in (law.lowest, law.highest)]
    law_of = means.reshape(-1, size)[chosen], covariances.reshape(-1, size, size)[chosen]
    values, weights = draws(*law_of, *bounds, random)
    _, first, place = np.unique(chosen, return_index=True, return_inverse=True)
    inside = log_probability(*(array[first] for array in (*law_of, *bounds)))
    likely = np.exp(weights - inside[place])
    return values[random.choice(len(values), size=number, p=likely / likely.sum())]


def _joined(some: Sequence[Explanation], number: int) -> Explanation:
    probable = np.array([one.probability for one in some])
    share = min(len(one.draws) / one.probability for one in some)
    kept = [one.draws[: max(int(share * one.probability), 1)] for one in some]
    weights = probable / probable.sum()
    return Explanation(
        some[0].causes,
        float(probable.sum()) / number,
        np.concatenate(kept),
        weights @ np.array([one.change for one in some]),
        float(weights @ [one.misfit for one in some]),
    )


def log_probability(mean: Array, covariance: Array, lowest: Array, highest: Array) -> Array:
    """Logarithm of the probability that a normal vector is within bounds, (...,), for arrays (..., k).

    The variables are integrated one after the other, each given those before (Genz); nodes are shares of the
    probability of each interval, so that bounds far out in the tail are no harder than others.
    """
    shape, size = mean.shape[:-1], mean.shape[-1]
    if size == 0:
        return np.zeros(shape)
    grid = np.meshgrid(*[NODES] * (size - 1), indexing="ij")
    shares = np.stack([axis.ravel() for axis in grid]) if grid else np.zeros((0, 1))
    weights = np.prod(np.stack(np.meshgrid(*[WEIGHTS] * (size - 1), indexing="ij")), axis=0).ravel() if grid else 1.0
    logs = _sequence(mean, covariance, lowest, highest, shares)[1]
    largest = logs.max(axis=-1)
    return largest + np.log((weights * np.exp(logs - largest[..., np.newaxis])).sum(axis=-1))


def log_marginal(mean: Array, covariance: Array, lowest: Array, highest: Array) -> Array:
    """Logarithm of the smallest probability of a single variable to be within its bounds, (...,)."""
    scale = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    return _log_between((lowest - mean) / scale, (highest - mean) / scale)[0].min(axis=-1, initial=0.0)


def draws(
    mean: Array, covariance: Array, lowest: Array, highest: Array, random: np.random.RandomState
) -> tuple[Array, Array]:
    """One draw of each of several normal laws within bounds, (n, k), and the logarithms of its weights, (n,)."""
    shares = random.uniform(size=(mean.shape[-1], len(mean), 1))
    values, logs = _sequence(mean, covariance, lowest, highest, shares)
    return values[..., 0], logs[..., 0]


def _sequence(mean: Array, covariance: Array, lowest: Array, highest: Array, shares: Array) -> tuple[Array, Array]:
    """Values at shares of the probability of each interval given the values before, and the logs of their product."""
    factor = np.linalg.cholesky(covariance)
    size, known = mean.shape[-1], []
    total = np.zeros((*mean.shape[:-1], shares.shape[-1]))
    for i in range(size):
        shift = mean[..., i, np.newaxis] + sum(
            (factor[..., i, j, np.newaxis] * known[j] for j in range(i)), np.zeros_like(total)
        )
        scale = factor[..., i, i, np.newaxis]
        lower, upper = (lowest[..., i, np.newaxis] - shift) / scale, (highest[..., i, np.newaxis] - shift) / scale
        inside, below, lower, upper, flipped = _log_between(lower, upper)
        total = total + inside
        if i < len(shares):
            share = np.where(flipped, 1 - shares[i], shares[i])
            value = ndtri_exp(np.logaddexp(below, np.log(share) + inside))
            value = np.clip(value, lower, upper)
            known.append(np.where(flipped, -value, value))
    if not known:
        return np.zeros((*total.shape[:-1], 0, total.shape[-1])), total
    standard = np.stack(known, axis=-2)
    n = standard.shape[-2]
    return mean[..., :n, np.newaxis] + factor[..., :n, :n] @ standard, total


def _log_between(lower: Array, upper: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Logarithm of a standard normal probability, by the lower tail, with the bounds there and what was turned."""
    flipped = lower > 0  # the lower tail is the one with accurate logarithms
    lower, upper = np.where(flipped, -upper, lower), np.where(flipped, -lower, upper)
    below, above = log_ndtr(lower), log_ndtr(upper)
    return above + np.log(-np.expm1(np.minimum(below - above, -1e-300))), below, lower, upper, flipped
