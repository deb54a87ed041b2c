"""Normal distributions of coefficients: from a prior and a bridge's information to a posterior."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import logsumexp

from skthermo._arrays import Array

STEPS = 25  # to the deviation of a bridge on its own
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
    blocks = np.zeros((n_outputs, n_functions, n_outputs, n_functions))
    blocks[np.arange(n_outputs), :, np.arange(n_outputs)] = root.transpose(0, 2, 1)[:, :, :]
    transposed = blocks.transpose(0, 1, 2, 3).reshape(J.shape)
    B = solve_triangular(L, transposed, lower=True)
    evidence = m @ h - m @ J @ m / 2 - np.log(np.diag(L)).sum() + e @ shift / 2
    return Posterior(float(evidence), m + shift, B.T @ B)


def alone(J: Array, h: Array, n_outputs: int, typical: Array | None = None) -> CoefficientPrior:
    """N(0, tau^2 I) for each output, with the most likely tau; a typical tau^2 counts as a few coefficients more."""
    n_functions = len(h) // n_outputs
    eye = np.eye(n_functions)
    zeros = np.zeros((n_outputs, n_functions))
    variances = np.full(n_outputs, START**2) if typical is None else typical
    count = 0.0 if typical is None else TYPICAL_COUNT
    start = variances
    for _ in range(STEPS):
        found = posterior(J, h, zeros, np.sqrt(variances)[:, np.newaxis, np.newaxis] * eye)
        squares = (found.mean**2).reshape(n_outputs, n_functions).sum(axis=1)
        left_open = np.diag(found.covariance).reshape(n_outputs, n_functions).sum(axis=1) / variances
        known = n_functions - left_open  # MacKay: number of coefficients that the records determine
        updated = np.maximum((squares + count * start) / (np.maximum(known, JITTER) + count), SMALLEST**2)
        settled = np.abs(np.log(updated / variances)).max() < SETTLED
        variances = updated
        if settled:
            break
    return CoefficientPrior(zeros, np.sqrt(variances)[:, np.newaxis, np.newaxis] * eye)


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
