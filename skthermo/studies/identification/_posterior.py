"""Probabilities of explanations and draws of the amounts of their causes, for one model or averaged over several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from skthermo._effects import ALL_GROUPS
from skthermo._tables.arrays import Array
from skthermo.studies.identification._boxes import draws, log_probability
from skthermo.studies.identification._causes import NO_DAMAGE, SOMETHING_ELSE, Cause
from skthermo.studies.identification._evidence import ERROR_FACTORS, Amounts
from skthermo.studies.identification._explanations import Scale, Weight

KEPT = 1e-5  # probability of explanations that are kept
N_DRAWS, FEWEST = 4000, 200  # draws of all explanations together, and of each
CANDIDATES = 4  # for each draw
BAND = (0.05, 0.95)


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

    def estimates(self, least: float) -> pd.DataFrame:
        """Amounts of the causes of each explanation that is at least so probable, if it is right."""
        rows = {
            (one.name, cause): _summary(values, np.full(len(values), 1 / len(values)))
            for one in self.explanations
            if one.probability >= least
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
    number = FEWEST + int(N_DRAWS * probability)
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
