"""How probable sets of causes are, given measured changes, and draws of their amounts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import comb

import numpy as np
from scipy.special import log_ndtr, logsumexp, ndtr, ndtri_exp

from skthermo._core.arrays import Array
from skthermo.studies.identification._causes import NO_DAMAGE, SOMETHING_ELSE, Cause, DamagePrior
from skthermo.studies.identification._effects import Curves, Observed


@dataclass(frozen=True)
class Explanation:
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


@dataclass(frozen=True)
class Weight:
    """One set of causes by something else of each size, none first: log probability (n_errors,) up to a constant.

    The amounts follow normal laws within bounds, ``means`` (n_errors, k) and ``covariances``, and explain ``change``
    (n_errors, n_observed) at ``places``, the most probable amounts (n_errors, k).
    """

    causes: tuple[int, ...]
    log_prior: float
    logs: Array
    means: Array
    covariances: Array
    places: Array
    change: Array

    @property
    def total(self) -> float:
        return float(logsumexp(self.logs))


class Evidence:
    """Weighs sets of causes in coordinates in which the errors of what was observed are independent.

    Errors follow Student's law. The model is wrong by a share of what it explains, which is about what was measured.
    Something else shifts each mode by between .05 and 13 %.
    """

    def __init__(
        self, observed: Observed, causes: Sequence[Cause], curves: Curves, prior: DamagePrior, freedom: float
    ) -> None:
        error = np.diag((prior.model_error * observed.change) ** 2)
        variances, self.rotation = np.linalg.eigh(observed.covariance + error)
        sizes = np.append(0.0, 0.0005 * 4.0 ** np.arange(5))
        self.variances = variances + sizes[:, np.newaxis] ** 2
        some = prior.something_else
        with np.errstate(divide="ignore"):
            self.log_errors = np.log(np.append(1 - some, np.full(len(sizes) - 1, some / (len(sizes) - 1))))
        self.observed, self.causes, self.prior, self.freedom = observed, causes, prior, freedom
        self.change, self.curves = observed.change @ self.rotation, curves.rotated(self.rotation)
        ends, widths = curves.bounds, prior.severity * np.array([cause.scale for cause in causes])
        if prior.law == "uniform":
            ends, widths = np.sign(ends) * np.minimum(np.abs(ends), widths), 100 * widths
        self.deviations, self.lowest, self.highest = widths, np.minimum(ends, 0), np.maximum(ends, 0)

    def explanations(self, random: np.random.RandomState) -> list[Explanation]:
        """All sets of up to three causes and what remains of them, the most probable first."""
        weights = self._screened()
        for _ in range(2):  # effects of several causes together are not quite their sum
            likely = logsumexp([weight.total for weight in weights]) + np.log(1e-3)
            weights = [self._refined(one) if one.causes and one.total > likely else one for one in weights]
        everything = logsumexp([weight.total for weight in weights])
        found = []
        for weight in weights:
            for errors, has_else in ((slice(0, 1), False), (slice(1, None), True)):
                probability = float(np.exp(logsumexp(weight.logs[errors]) - everything))
                if probability > 1e-5:
                    found.append(self._explanation(weight, errors, has_else, probability, random))
        return sorted(found, key=lambda one: -one.probability)

    def _screened(self) -> list[Weight]:
        """Weights of all sets, with the effects of their causes added."""
        together = [place for place, cause in enumerate(self.causes) if not cause.alone]
        numbers = np.array(self.prior.numbers[: len(together) + 1])
        numbers = np.log(np.maximum(numbers / numbers.sum(), 1e-300))
        n_single = len({cause.group for cause in self.causes})
        weights = self.weigh([()], [numbers[0]])
        shares = [numbers[1] + np.log(cause.share / n_single) for cause in self.causes]
        weights += self.weigh([(place,) for place in range(len(self.causes))], shares)
        for size in range(2, len(numbers)):
            number = comb(len(together), size)
            if number > 5000:
                alone = {weight.causes[0]: weight.total for weight in weights if len(weight.causes) == 1}
                together = sorted(together, key=lambda place: -alone[place])[:30]
            sets = [
                some
                for some in combinations(together, size)
                if not any(self.causes[a].excludes(self.causes[b]) for a, b in combinations(some, 2))
            ]
            weights += self.weigh(sets, [numbers[size] - np.log(number)] * len(sets))
        return weights

    def _refined(self, weight: Weight) -> Weight:
        """The weight with the exact effect of all causes together at the most probable amounts."""
        causes, place = [self.causes[one] for one in weight.causes], int(weight.logs.argmax())
        exact = self.observed.response(causes, weight.places[place].tolist()) @ self.rotation
        added = self.curves.at(np.array([weight.causes]), weight.places[[place]][np.newaxis])[1][0, 0]
        return self.weigh([weight.causes], [weight.log_prior], exact - added)[0]

    def weigh(
        self, sets: Sequence[tuple[int, ...]], log_priors: Sequence[float], offset: Array | float = 0
    ) -> list[Weight]:
        """Evidence of sets of equal size k, with effects that are linear near the most probable amounts."""
        found: list[Weight] = []
        for first in range(0, len(sets), 500):
            some = np.array(sets[first : first + 500], dtype=int).reshape(len(sets[first : first + 500]), -1)
            found += self._weighed(some, log_priors[first : first + 500], offset)
        return found

    def _weighed(self, sets: Array, log_priors: Sequence[float], offset: Array | float) -> list[Weight]:
        n_observed, size = len(self.change), sets.shape[1]
        variances = np.broadcast_to(self.variances, (len(sets), *self.variances.shape))
        deviations, lowest, highest = (
            np.broadcast_to(ends[sets][:, np.newaxis], (*variances.shape[:2], size))
            for ends in (self.deviations, self.lowest, self.highest)
        )
        means = np.zeros(deviations.shape)
        for _ in range(8 if size else 1):
            places, change, slopes = self.curves.at(sets, np.clip(means, lowest, highest))
            target = self.change - offset - change + (slopes @ places[..., np.newaxis])[..., 0]
            weighted = np.swapaxes(slopes / variances[..., np.newaxis], -1, -2)
            precisions = weighted @ slopes + deviations[..., np.newaxis] ** -2 * np.eye(size)
            covariances = np.linalg.inv(precisions)
            right = weighted @ target[..., np.newaxis]
            means = (covariances @ right)[..., 0]
        misfit = (target**2 / variances).sum(axis=-1) - (right[..., 0] * means).sum(axis=-1)
        volume = np.log(variances).sum(axis=-1) + 2 * np.log(deviations).sum(axis=-1) + np.linalg.slogdet(precisions)[1]
        logs = -volume / 2 - (self.freedom + n_observed) / 2 * np.log1p(misfit / self.freedom)
        covariances = covariances * ((self.freedom + misfit) / (self.freedom + n_observed))[..., np.newaxis, np.newaxis]
        lattice = (0.5 + np.outer([0.8191725, 0.6710436, 0.5497005][:size], np.arange(128))) % 1
        inside = logsumexp(truncated(means, covariances, lowest, highest, lattice)[1], axis=-1) - np.log(128)
        logs = logs + inside - np.log(ndtr(highest / deviations) - ndtr(lowest / deviations)).sum(axis=-1)
        logs = logs + np.array(log_priors)[:, np.newaxis] + self.log_errors
        rows = zip(sets.tolist(), log_priors, logs, means, covariances, places, change + offset, strict=True)
        return [Weight(tuple(causes), *rest) for causes, *rest in rows]

    def _explanation(
        self, weight: Weight, errors: slice, has_else: bool, probability: float, random: np.random.RandomState
    ) -> Explanation:
        """One set of causes, with or without something else."""
        logs, columns = weight.logs[errors], list(weight.causes)
        chosen = random.choice(len(logs), size=2000, p=np.exp(logs - logsumexp(logs)))
        means, covariances = weight.means[errors][chosen], weight.covariances[errors][chosen]
        ends = [np.broadcast_to(ends[columns], means.shape) for ends in (self.lowest, self.highest)]
        draws, shares = truncated(means, covariances, *ends, random.uniform(size=(len(columns), 2000, 1)))
        shares = np.exp(shares[:, 0] - shares.max())
        draws = draws[random.choice(2000, size=500, p=shares / shares.sum()), :, 0]
        # an error of the effects by the same factor in all modes shows in no misfit
        factors = np.exp(self.prior.model_error * random.standard_normal((500, 1)))
        likely = int(logs.argmax()) + (errors.start or 0)
        rest = (self.change - weight.change[likely]) ** 2 / self.variances[likely]
        return Explanation(
            tuple(self.causes[place] for place in columns),
            has_else,
            probability,
            np.clip(draws * factors, self.lowest[columns], self.highest[columns]),
            weight.change[likely] @ self.rotation.T,
            float(rest.sum()),
        )


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
