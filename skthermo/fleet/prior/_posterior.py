"""Normal distributions of coefficients: from a prior and a bridge's information to a posterior."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import logsumexp

from skthermo._core.arrays import Array

STEPS = 25  # to the deviation of a bridge on its own
SHAPE_STEPS = 4
SHAPE_COUNT = 3.0  # outputs as which it counts that all functions are alike
TYPICAL_COUNT = 2.0  # coefficients as which a typical deviation counts
START = 0.1  # deviation of coefficients of ln y where nothing else is known
SMALLEST = 1e-8
SETTLED = 0.03  # relative change of tau^2 that ends the iteration
JITTER = 1e-9
NEGLIGIBLE = 1e-9  # share of a combination
ATYPICAL, ATYPICAL_FOLLOWS = (
    0.05,
    0.2,
)  # share of bridges of another kind, and of the families that one follows by chance
MOST_TYPICAL = 5.0  # times the typical deviation of its family that coefficients of a bridge on its own have at most


class CoefficientPrior(NamedTuple):
    """Means, (n_outputs, n_functions), and lower Cholesky roots, (n_outputs, n_functions, n_functions), of covariances.

    Outputs are independent of each other.
    """

    mean: Array
    root: Array


class CoefficientPosterior:
    """N(mean, C C') times exp(-b'J b / 2 + h'b); C is block diagonal with the roots of a `CoefficientPrior`.

    With K = I + C'J C = L L' and e = h - J m: b ~ N(m + C K^-1 C'e, C K^-1 C'). ``evidence`` is its logarithm, up to a
    constant of the records.
    """

    def __init__(self, J: Array, h: Array, mean: Array, root: Array):
        n_outputs, n_functions = mean.shape
        m = mean.ravel()
        half = J.reshape(-1, n_outputs, n_functions).transpose(1, 0, 2) @ root  # J C by columns of outputs
        whole = root.transpose(0, 2, 1) @ half.transpose(1, 0, 2).reshape(n_outputs, n_functions, -1)
        whole = whole.reshape(J.shape)
        self._root = root
        self._L = np.linalg.cholesky(np.eye(len(m)) + (whole + whole.T) / 2)
        moved = np.einsum("aij,ai->aj", root, (h - J @ m).reshape(n_outputs, -1)).ravel()  # C'e
        shift = cho_solve((self._L, True), moved, check_finite=False)
        self.evidence = float(m @ h - m @ J @ m / 2 - np.log(np.diag(self._L)).sum() + moved @ shift / 2)
        self.mean = m + np.einsum("aij,aj->ai", root, shift.reshape(n_outputs, -1)).ravel()

    @cached_property
    def covariance(self) -> Array:
        """Covariance of all coefficients."""
        n_outputs, n_functions = self._root.shape[:2]
        transposed = np.zeros((n_outputs, n_functions, n_outputs, n_functions))
        transposed[np.arange(n_outputs), :, np.arange(n_outputs)] = self._root.transpose(0, 2, 1)
        B = solve_triangular(self._L, transposed.reshape(self._L.shape), lower=True, check_finite=False)
        return B.T @ B


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
                state = CoefficientPosterior(one_J, one_h, *prior)
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
            found = CoefficientPosterior(J, h, zeros, np.sqrt(variances)[:, np.newaxis, np.newaxis] * roots)
            scaled = np.stack([found.mean**2, np.diag(found.covariance)]).reshape(2, n_outputs, -1) / self.shape
            squares, left_open = scaled.sum(axis=2)
            known = np.maximum(n_functions - left_open / variances, JITTER)  # coefficients that the records determine
            updated = np.maximum((squares + count * start) / (known + count), SMALLEST**2)
            updated = np.minimum(updated, MOST_TYPICAL**2 * start) if self.typical else updated
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

    Combinations are all following, none, and what is met on the way from either to a combination that no single family
    can improve.

    ``families`` are those of the outputs; ``probabilities`` those of following, before any record, of pooled families.
    """
    pooled = [family for family in probabilities if family in families]
    chances = np.array([probabilities[family] for family in pooled])
    place = {family: i for i, family in enumerate(pooled)}
    known: dict[tuple[bool, ...], tuple[float, CoefficientPosterior]] = {}

    def weight(flags: tuple[bool, ...]) -> float:
        """Log evidence of a combination, and its probability before any record."""
        if flags not in known:
            is_followed = np.array([family in place and flags[place[family]] for family in families])
            mean = np.where(is_followed[:, np.newaxis], fleet.mean, own.mean)
            root = np.where(is_followed[:, np.newaxis, np.newaxis], fleet.root, own.root)
            update = CoefficientPosterior(J, h, mean, root)
            known[flags] = log_chance(flags, chances) + update.evidence, update
        return known[flags][0]

    for start in (True, False):
        climb(weight, (start,) * len(pooled))
    flags = np.array(list(known), dtype=bool).reshape(len(known), len(pooled))
    logs = np.array([log for log, _ in known.values()])
    total = float(logsumexp(logs))
    shares = np.exp(logs - total)
    found = [(s, update) for s, (_, update) in zip(shares, known.values(), strict=True) if s > NEGLIGIBLE]
    mean = sum(share * one.mean for share, one in found)
    covariance = sum(share * (one.covariance + np.outer(one.mean - mean, one.mean - mean)) for share, one in found)
    with_family, without_family = (
        {
            family: float(logsumexp(logs[flags[:, i] == flag]) - np.log(chance(follow_chance(probabilities[family]))))
            for i, family in enumerate(pooled)
        }
        for flag, chance in ((True, lambda p: p), (False, lambda p: 1 - p))
    )
    follows = {family: float(shares[flags[:, i]].sum()) for i, family in enumerate(pooled)}
    return Mixture(total, mean, covariance, follows, with_family, without_family)


def log_chance(flags: Sequence[bool], chances: Array) -> float:
    """Log probability of a combination before any record; an atypical bridge as a whole follows few of its families."""
    usual, atypical = (
        np.log(np.where(flags, p, 1 - p)).sum() for p in (chances, np.full(len(chances), ATYPICAL_FOLLOWS))
    )
    return float(np.logaddexp(np.log1p(-ATYPICAL) + usual, np.log(ATYPICAL) + atypical))


def follow_chance(chance: float) -> float:
    """Probability of following a family before any record, be the bridge atypical or not."""
    return (1 - ATYPICAL) * chance + ATYPICAL * ATYPICAL_FOLLOWS


def climb(weight: Callable[[tuple[bool, ...]], float], flags: tuple[bool, ...]) -> None:
    """Weigh a combination and all that differ in one family, and go on from the best while it is a better one."""
    while True:
        others = [flags[:i] + (not flag,) + flags[i + 1 :] for i, flag in enumerate(flags)]
        best = max(others, key=weight, default=flags)
        if weight(best) <= weight(flags):
            return
        flags = best
