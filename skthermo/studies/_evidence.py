"""How probable sets of causes are, given measured changes, and draws of their amounts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import comb

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import log_ndtr, logsumexp, ndtr, ndtri_exp

from skthermo._core.arrays import Array
from skthermo.studies._causes import NO_DAMAGE, SOMETHING_ELSE, Cause, DamagePrior
from skthermo.studies._measured import ObservedChange

DRAWS_EACH = 500


@dataclass(frozen=True)
class DamageExplanation:
    """Causes that explain the changes: their probability, and draws of their amounts, (n_draws, n_causes).

    ``change``, (n_observed,), is what the most probable amounts explain, and ``misfit`` the sum of squares of the rest
    in standard errors.
    """

    causes: tuple[Cause, ...]
    has_else: bool
    probability: float
    draws: Array = field(repr=False)
    change: Array = field(repr=False)
    misfit: float

    @property
    def name(self) -> str:
        return " + ".join([cause.name for cause in self.causes] + [SOMETHING_ELSE] * self.has_else) or NO_DAMAGE

    @property
    def is_healthy(self) -> bool:
        return not self.causes and not self.has_else


@dataclass(frozen=True)
class Weight:
    """One set of causes by something else of each size, none first: log probability (n_errors,) up to a constant.

    The amounts follow normal laws within bounds, ``means`` (n_errors, k) and ``covariances``, and explain ``change``
    (n_errors, n_observed) where they are most probable, near ``places`` (n_errors, k).
    """

    causes: tuple[int, ...]
    log_prior: float
    logs: Array
    means: Array
    covariances: Array
    places: Array
    change: Array


def effects_of(observed: ObservedChange, causes: Sequence[Cause], n_solved: int = 9) -> Array:
    """Changes by each cause alone, (n_solved, n_causes, n_observed), at shares of its bound on a logarithmic scale."""
    ends = np.linspace(0, 1, n_solved)[1:] ** 2  # small amounts are usual
    found = np.zeros((n_solved, len(causes), len(observed.change)))
    for place, cause in enumerate(causes):
        amounts = cause.direction * np.expm1(ends * np.log1p(cause.direction * cause.bound))
        found[1:, place] = [observed.response([cause], [amount]) for amount in amounts]
        unsolved = np.isnan(found[1:, place]).any(axis=1)
        if unsolved.any():
            raise ValueError(
                f"the model gives NaN where {cause.name} has changed by {amounts[unsolved][0]:.2f}; expected a number "
                f"for every mode at each change up to {amounts[-1]:.2f}"
            )
    return found


class Evidence:
    """Weighs sets of causes in coordinates in which the errors of what was observed are independent.

    Errors follow Student's law. The model is wrong by a share of what it explains, which is about what was measured.
    Something else shifts each mode by between .05 and 13 %. Effects of single causes are splines, and added.
    """

    def __init__(
        self, observed: ObservedChange, causes: Sequence[Cause], effects: Array, prior: DamagePrior, freedom: float
    ) -> None:
        self.observed, self.causes, self.prior, self.freedom = observed, causes, prior, freedom
        error = np.diag((prior.model_error * observed.change) ** 2)
        variances, self.rotation = np.linalg.eigh(observed.covariance + error)
        sizes = np.append(0.0, 0.0005 * 4.0 ** np.arange(5))
        self.variances, self.change = variances + sizes[:, np.newaxis] ** 2, observed.change @ self.rotation
        some = prior.something_else
        with np.errstate(divide="ignore"):
            self.log_errors = np.log(np.append(1 - some, np.full(len(sizes) - 1, some / (len(sizes) - 1))))

        ends = np.array([cause.bound for cause in causes])
        directions = np.array([cause.direction for cause in causes])
        self.scales = np.log1p(directions * ends)
        spline = CubicSpline(np.linspace(0, 1, len(effects)) ** 2, effects @ self.rotation)
        steps = np.linspace(0, 1, 801)
        factors = np.exp(np.outer(steps, self.scales))
        self.amounts = directions * (factors - 1)  # (n_steps, n_causes)
        self.effects = spline(steps)
        self.slopes = spline(steps, 1) / (directions * self.scales * factors)[..., np.newaxis]
        widths = prior.severity * np.array([cause.scale for cause in causes])
        if prior.law == "uniform":
            ends, widths = np.sign(ends) * np.minimum(np.abs(ends), widths), 100 * widths
        self.deviations, self.lowest, self.highest = widths, np.minimum(ends, 0), np.maximum(ends, 0)
        self.directions = directions

    def explanations(self, random: np.random.RandomState) -> list[DamageExplanation]:
        """All sets of up to three causes and what remains of them, the most probable first."""
        weights = self._screened()
        for _ in range(2):  # effects of several causes together are not quite their sum
            likely = logsumexp(np.concatenate([one.logs for one in weights])) + np.log(1e-3)
            weights = [self._refined(one) if one.causes and logsumexp(one.logs) > likely else one for one in weights]
        everything = logsumexp(np.concatenate([one.logs for one in weights]))
        found = []
        for weight in weights:
            for errors in (np.array([0]), np.arange(1, len(self.log_errors))):
                probability = float(np.exp(logsumexp(weight.logs[errors]) - everything))
                if probability > 1e-5:
                    found.append(self._explanation(weight, errors, probability, random))
        return sorted(found, key=lambda one: -one.probability)

    def _screened(self) -> list[Weight]:
        """Weights of all sets, with the effects of their causes added."""
        together = [place for place, cause in enumerate(self.causes) if not cause.alone]
        numbers = np.array(self.prior.numbers[: len(together) + 1])
        numbers = np.log(np.maximum(numbers / numbers.sum(), 1e-300))
        n_single = len({cause.group for cause in self.causes})
        weights = self._weighed([()], [numbers[0]])
        shares = [numbers[1] + np.log(cause.share / n_single) for cause in self.causes]
        weights += self._weighed([(place,) for place in range(len(self.causes))], shares)
        n_together = len(together)
        if n_together > 30:
            alone = [logsumexp(one.logs) for one in weights[1:]]
            together = sorted(together, key=lambda place: -alone[place])[:30]
        for size in range(2, len(numbers)):
            share = numbers[size] - np.log(comb(n_together, size))
            sets = [
                some
                for some in combinations(together, size)
                if not any(self.causes[a].excludes(self.causes[b]) for a, b in combinations(some, 2))
            ]
            weights += self._weighed(sets, [share] * len(sets)) if sets else []
        return weights

    def _refined(self, weight: Weight) -> Weight:
        """The weight with the exact effect of all causes together at the most probable amounts."""
        causes, amounts = list(weight.causes), weight.places[weight.logs.argmax()]
        exact = self.observed.response([self.causes[one] for one in causes], amounts.tolist()) @ self.rotation
        added = self._near(np.array([causes]), amounts[np.newaxis, np.newaxis])[1][0, 0]
        return self._weighed([weight.causes], [weight.log_prior], exact - added)[0]

    def _near(self, sets: Array, amounts: Array) -> tuple[Array, Array, Array]:
        """Effects of sets (n_sets, k) at the steps next to amounts (n_sets, n_errors, k), added over their causes.

        The amounts there, the change (n_sets, n_errors, n_observed), and its slopes with an axis more.
        """
        columns = sets[:, np.newaxis]
        shares = np.log1p(self.directions[columns] * amounts) / self.scales[columns]
        steps = np.rint(shares * (len(self.amounts) - 1)).astype(int)
        change = self.effects[steps, columns].sum(axis=2)
        return self.amounts[steps, columns], change, np.moveaxis(self.slopes[steps, columns], 2, 3)

    def _weighed(
        self, sets: Sequence[tuple[int, ...]], log_priors: Sequence[float], offset: Array | float = 0
    ) -> list[Weight]:
        """Evidence of sets of equal size k, with effects that are linear near the most probable amounts."""
        columns = np.array(sets, dtype=int)[:, np.newaxis]
        (n_errors, n_observed), size = self.variances.shape, columns.shape[-1]
        lowest, highest, deviations = self.lowest[columns], self.highest[columns], self.deviations[columns]
        means = np.zeros((len(sets), n_errors, size))
        for _ in range(8 if size else 1):  # Gauss-Newton
            places, change, slopes = self._near(columns[:, 0], np.clip(means, lowest, highest))
            target = self.change - offset - change + (slopes @ places[..., np.newaxis])[..., 0]
            weighted = np.swapaxes(slopes / self.variances[..., np.newaxis], -1, -2)
            precisions = weighted @ slopes + deviations[..., np.newaxis] ** -2 * np.eye(size)
            right = weighted @ target[..., np.newaxis]
            means = np.linalg.solve(precisions, right)[..., 0]
        explained = change + offset + (slopes @ (np.clip(means, lowest, highest) - places)[..., np.newaxis])[..., 0]
        misfit = (target**2 / self.variances).sum(axis=-1) - (right[..., 0] * means).sum(axis=-1)
        volume = (
            np.log(self.variances).sum(axis=-1) + np.linalg.slogdet(precisions * deviations[..., np.newaxis] ** 2)[1]
        )
        logs = -volume / 2 - (self.freedom + n_observed) / 2 * np.log1p(misfit / self.freedom)
        scale = (self.freedom + misfit) / (self.freedom + n_observed)
        covariances = np.linalg.inv(precisions) * scale[..., np.newaxis, np.newaxis]
        lattice = (0.5 + np.outer([0.8191725, 0.6710436, 0.5497005][:size], np.arange(64))) % 1
        logs = logs + logsumexp(truncated(means, covariances, lowest, highest, lattice)[1], axis=-1) - np.log(64)
        logs = logs - np.log(ndtr(highest / deviations) - ndtr(lowest / deviations)).sum(axis=-1)
        logs = logs + np.array(log_priors)[:, np.newaxis] + self.log_errors
        return [Weight(*one) for one in zip(sets, log_priors, logs, means, covariances, places, explained, strict=True)]

    def _explanation(
        self, weight: Weight, errors: Array, probability: float, random: np.random.RandomState
    ) -> DamageExplanation:
        """One set of causes, with or without something else."""
        logs, columns = weight.logs[errors], list(weight.causes)
        chosen = errors[random.choice(len(errors), size=4 * DRAWS_EACH, p=np.exp(logs - logsumexp(logs)))]
        lowest, highest = self.lowest[columns], self.highest[columns]
        uniform = random.uniform(size=(len(columns), 4 * DRAWS_EACH, 1))
        draws, shares = truncated(weight.means[chosen], weight.covariances[chosen], lowest, highest, uniform)
        shares = np.exp(shares[:, 0] - shares.max())
        draws = draws[random.choice(4 * DRAWS_EACH, size=DRAWS_EACH, p=shares / shares.sum()), :, 0]
        # an error of the effects by the same factor in all modes shows in no misfit
        factors = np.exp(self.prior.model_error * random.standard_normal((DRAWS_EACH, 1)))
        likely = errors[logs.argmax()]
        causes, change = tuple(self.causes[place] for place in columns), weight.change[likely]
        misfit = float(((self.change - change) ** 2 / self.variances[likely]).sum())
        amounts = np.clip(draws * factors, lowest, highest)
        return DamageExplanation(causes, bool(errors[0]), probability, amounts, change @ self.rotation.T, misfit)


def truncated(mean: Array, covariance: Array, lowest: Array, highest: Array, uniform: Array) -> tuple[Array, Array]:
    """Draws of normal laws within bounds, (..., k, n), and the logarithms of their weights, (..., n).

    Genz: one variable after the other, given those before, from uniform numbers (k, ..., n); the mean of the weights is
    the probability of the bounds. In the upper tail the variable is turned, as logarithms are accurate in the lower.
    """
    roots = np.linalg.cholesky(covariance)
    draws = np.zeros((*mean.shape, uniform.shape[-1]))
    logs = np.zeros((*mean.shape[:-1], draws.shape[-1]))
    for i in range(mean.shape[-1]):
        centre = mean[..., i, np.newaxis] + (roots[..., i, np.newaxis, :i] @ draws[..., :i, :])[..., 0, :]
        low, high = ((ends[..., i, np.newaxis] - centre) / roots[..., i, i, np.newaxis] for ends in (lowest, highest))
        turned = low > 0
        low, high = np.where(turned, -high, low), np.where(turned, -low, high)
        below, above = log_ndtr(low), log_ndtr(high)
        inside = above + np.log(-np.expm1(np.minimum(below - above, -1e-300)))
        values = np.clip(ndtri_exp(np.logaddexp(below, np.log(uniform[i]) + inside)), low, high)
        draws[..., i, :] = np.where(turned, -values, values)
        logs += inside
    return mean[..., np.newaxis] + roots @ draws, logs


def averaged(each: Sequence[Sequence[DamageExplanation]]) -> list[DamageExplanation]:
    """The explanations of models that are equally probable, each with the draws of all of them."""
    by_name: dict[str, list[DamageExplanation]] = {}
    for one in (one for explained in each for one in explained):
        by_name.setdefault(one.name, []).append(one)
    found = []
    for some in by_name.values():
        weights = np.array([one.probability for one in some])
        shares = weights / weights.sum()
        draws = [one.draws[: int(np.ceil(DRAWS_EACH * share))] for one, share in zip(some, shares, strict=True)]
        change, misfit = shares @ [one.change for one in some], shares @ [one.misfit for one in some]
        probability = float(weights.sum()) / len(each)
        averages = {"probability": probability, "change": change, "misfit": float(misfit)}
        found.append(replace(some[0], draws=np.concatenate(draws), **averages))
    return sorted(found, key=lambda one: -one.probability)
