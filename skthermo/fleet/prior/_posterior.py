"""Normal distributions of coefficients: from a prior and a bridge's information to a posterior."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import logsumexp

from skthermo._arrays import Array

STEPS = 25  # to the deviation of a bridge on its own
SHAPE_STEPS = 4
SHAPE_COUNT = 3.0  # outputs as which it counts that all functions are alike
TYPICAL_COUNT = 2.0  # coefficients as which a typical deviation counts
START = 0.1  # deviation of coefficients of ln y where nothing else is known
SMALLEST = 1e-8
SETTLED = 0.03  # relative change of tau^2 that ends the iteration
JITTER = 1e-9
MOST_COMBINED = 6  # families of which all combinations are weighed


class CoefficientPrior(NamedTuple):
    """Means, (n_outputs, n_functions), and lower Cholesky roots, (n_outputs, n_functions, n_functions), of covariances.

    Outputs are independent of each other.
    """

    mean: Array
    root: Array


class Posterior(NamedTuple):
    """Log evidence, up to a constant of the records, mean and covariance of all coefficients."""

    evidence: float
    mean: Array
    covariance: Array


def posterior(J: Array, h: Array, mean: Array, root: Array) -> Posterior:
    """N(mean, C C') times exp(-b'J b / 2 + h'b), normalised; C is block diagonal with the roots.

    With K = I + C'J C and e = h - J m: b ~ N(m + C K^-1 C'e, C K^-1 C'), and the log evidence is
    m'h - m'J m / 2 - log|K| / 2 + e'C K^-1 C'e / 2.
    """
    n_outputs, n_functions = mean.shape
    m = mean.ravel()
    half = np.einsum("xai,aij->xaj", J.reshape(-1, n_outputs, n_functions), root)  # J C
    e = h - J @ m
    whole = np.einsum("aij,aiy->ajy", root, half.reshape(n_outputs, n_functions, -1)).reshape(J.shape)
    L = np.linalg.cholesky(np.eye(len(m)) + (whole + whole.T) / 2)
    w = np.einsum("aij,ai->aj", root, e.reshape(mean.shape)).ravel()
    shift = np.einsum("aij,aj->ai", root, cho_solve((L, True), w).reshape(mean.shape)).ravel()
    transposed = np.zeros((n_outputs, n_functions, n_outputs, n_functions))
    transposed[np.arange(n_outputs), :, np.arange(n_outputs)] = root.transpose(0, 2, 1)
    B = solve_triangular(L, transposed.reshape(J.shape), lower=True)
    evidence = m @ h - m @ J @ m / 2 - np.log(np.diag(L)).sum() + e @ shift / 2
    return Posterior(float(evidence), m + shift, B.T @ B)


@dataclass(frozen=True)
class OwnPrior:
    """Coefficients of an output on its own are N(0, tau^2 diag(shape)), with the most likely tau.

    The shape tells which functions are large in any bridge, not what its response is. A family's ``typical`` tau^2
    counts as a few coefficients more.
    """

    shape: Array
    typical: Mapping[Hashable, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls, J: Sequence[Array], h: Sequence[Array], families: Sequence[Sequence[Hashable]], n_functions: int
    ) -> OwnPrior:
        """Learn shape and typical deviations from bridges, by expectation maximisation."""
        found = cls(np.ones(n_functions))
        for _ in range(SHAPE_STEPS):
            ratios, variances = np.full(n_functions, SHAPE_COUNT), {}
            for one_J, one_h, of_output in zip(J, h, families, strict=True):
                prior = found.fitted(one_J, one_h, of_output)
                state = posterior(one_J, one_h, *prior)
                taus = prior.root[:, 0, 0] ** 2 / found.shape[0]
                second = (state.mean**2 + np.diag(state.covariance)).reshape(len(of_output), n_functions)
                ratios += (second / taus[:, np.newaxis]).sum(axis=0)
                for family, tau in zip(of_output, taus, strict=True):
                    variances.setdefault(family, []).append(float(tau))
            shape = ratios / (SHAPE_COUNT + sum(map(len, families)))
            found = cls(shape, {family: float(np.median(values)) for family, values in variances.items()})
        return found

    def fitted(self, J: Array, h: Array, families: Sequence[Hashable]) -> CoefficientPrior:
        """The prior with the most likely deviations."""
        n_outputs, n_functions = len(families), len(self.shape)
        zeros, roots = np.zeros((n_outputs, n_functions)), np.diag(np.sqrt(self.shape))
        middle = float(np.median(list(self.typical.values()))) if self.typical else START**2
        start = np.array([self.typical.get(family, middle) for family in families])
        count, variances = TYPICAL_COUNT if self.typical else 0.0, start
        for _ in range(STEPS):
            found = posterior(J, h, zeros, np.sqrt(variances)[:, np.newaxis, np.newaxis] * roots)
            scaled = np.stack([found.mean**2, np.diag(found.covariance)]).reshape(2, n_outputs, -1) / self.shape
            squares, left_open = scaled.sum(axis=2)
            known = np.maximum(n_functions - left_open / variances, JITTER)  # coefficients that the records determine
            updated = np.maximum((squares + count * start) / (known + count), SMALLEST**2)
            settled = np.abs(np.log(updated / variances)).max() < SETTLED
            variances = updated
            if settled:
                break
        return CoefficientPrior(zeros, np.sqrt(variances)[:, np.newaxis, np.newaxis] * roots)


@dataclass(frozen=True)
class Mixture:
    """Posterior over which families a bridge follows: moments, log evidence, and probability of each family.

    ``with_family`` and ``without_family`` are log evidences given that it does and does not follow one.
    """

    evidence: float
    mean: Array
    covariance: Array
    follows: dict[Hashable, float]
    with_family: dict[Hashable, float]
    without_family: dict[Hashable, float]


def mixture(
    J: Array,
    h: Array,
    families: Sequence[Hashable],
    fleet: CoefficientPrior,
    own: CoefficientPrior,
    probabilities: Mapping[Hashable, float],
) -> Mixture:
    """Average over combinations of families that follow the fleet or are on their own, weighed by their evidence.

    ``families`` are those of the outputs; ``probabilities`` those of following, before any record, of pooled families.
    """
    pooled = [family for family in probabilities if family in families]
    flags = combinations(len(pooled))
    found, weights = [], []
    for row in flags:
        followed = {family for family, flag in zip(pooled, row, strict=True) if flag}
        is_followed = np.array([family in followed for family in families])
        found.append(
            posterior(
                J,
                h,
                np.where(is_followed[:, np.newaxis], fleet.mean, own.mean),
                np.where(is_followed[:, np.newaxis, np.newaxis], fleet.root, own.root),
            )
        )
        chances = [probabilities[f] if flag else 1 - probabilities[f] for f, flag in zip(pooled, row, strict=True)]
        weights.append(np.log(np.maximum(chances, 1e-300)).sum())
    evidences = np.array([one.evidence for one in found])
    logs = np.array(weights) + evidences
    total = float(logsumexp(logs))
    shares = np.exp(logs - total)
    means = np.array([one.mean for one in found])
    mean = shares @ means
    covariance = sum(
        share * (one.covariance + np.outer(one.mean - mean, one.mean - mean))
        for share, one in zip(shares, found, strict=True)
        if share > 1e-12
    )
    with_family, without_family = (
        {
            family: float(logsumexp(logs[flags[:, i] == flag]) - np.log(max(chance(probabilities[family]), 1e-300)))
            for i, family in enumerate(pooled)
        }
        for flag, chance in ((True, lambda p: p), (False, lambda p: 1 - p))
    )
    follows = {family: float(shares[flags[:, i]].sum()) for i, family in enumerate(pooled)}
    return Mixture(total, mean, covariance, follows, with_family, without_family)


def combinations(number: int) -> Array:
    """Rows that say which of some families follow: all combinations of few; else none, all, all but one, only one."""
    if number <= MOST_COMBINED:
        return np.array(list(product([True, False], repeat=number)), dtype=bool).reshape(2**number, number)
    eye = np.eye(number, dtype=bool)
    return np.vstack([np.ones((1, number), dtype=bool), ~eye, eye, np.zeros((1, number), dtype=bool)])
