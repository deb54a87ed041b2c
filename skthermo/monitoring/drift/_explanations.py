"""Which groups' drift explains the trends of the modes, and what could as well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from skthermo._core.arrays import Array

N_SHAPES = 5  # a line, and the leading components of a random walk beside it
WALKS = np.array([0.0, 0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.032])
"""Standard deviations of what a random walk adds to ln stiffness in a year that are tried."""

RATE = 0.03  # standard deviation of a yearly change of ln stiffness of a group that drifts
PRIOR = {1: 0.8, 2: 0.2}
"""Prior probability that as many groups drift, if any does."""

AS_LIKELY = 3.0  # difference in log evidence up to which explanations are not distinguished: a factor of 20
NOTABLE = 0.05  # change of a group over the records that should be seen, and distinguished from that of others
DRAWS = 999
SIGNIFICANT = 0.01  # probability with which a structure that does not age counts as drifting
TINY = 1e-14  # variance of what cannot change


@dataclass(frozen=True)
class ModeTrends:
    """How ln frequency of each mode went over the records, apart from the weather, and its covariance.

    Coefficients of `shapes_of_time`, mode by mode; ``slopes``, (n_modes, n_groups), are the effects of the groups.
    """

    mean: Array
    covariance: Array
    slopes: Array
    years: float

    @property
    def n_groups(self) -> int:
        return self.slopes.shape[1]

    @property
    def n_shapes(self) -> int:
        return len(self.mean) // len(self.slopes)

    @property
    def walks(self) -> Array:
        """Random walks that are tried: none where there is only a line."""
        return WALKS if self.n_shapes > 1 else WALKS[:1]

    def variances(self, rate: float, walk: float) -> Array:
        """Prior variances of the coefficients of a group's drift, by the deviations of its rate and random walk."""
        waves = (np.arange(1, self.n_shapes) - 0.5) * np.pi
        return np.append((rate * self.years) ** 2, walk**2 * self.years / waves**2)

    def explained_by(self, groups: Sequence[int], walk: float) -> Array:
        """Covariance of the coefficients that drift of some groups gives, beside that of their errors."""
        effects = self.slopes[:, list(groups)]
        return np.kron(effects @ effects.T, np.diag(self.variances(RATE, walk)))

    def misfit(self, groups: Sequence[int]) -> tuple[float, int]:
        """Squared distance of the trends from those that drift of some groups explains, and its degrees of freedom."""
        root = np.linalg.cholesky(self.covariance)
        columns = np.linalg.solve(root, np.kron(self.slopes[:, list(groups)], np.eye(self.n_shapes)))
        target = np.linalg.solve(root, self.mean)
        rest = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
        return float(rest @ rest), len(target) - int(np.linalg.matrix_rank(columns))

    def widening(self, groups: Sequence[int]) -> float:
        """How many times larger a covariance would make the misfit of some groups' drift likely; at least 1."""
        misfit, freedom = self.misfit(groups)
        return max(misfit / freedom, 1.0) if freedom > 0 else 1.0

    def coefficients(self, groups: Sequence[int], walk: float, rate: float) -> tuple[Array, Array]:
        """Coefficients of the drift of some groups if no others drift, group by group, and their covariance."""
        design = np.kron(self.slopes[:, list(groups)], np.eye(self.n_shapes))
        prior = np.tile(np.maximum(self.variances(rate, walk), TINY), len(groups))
        weighted = np.linalg.solve(self.covariance, design)
        covariance = np.linalg.inv(design.T @ weighted + np.diag(1 / prior))
        return covariance @ (weighted.T @ self.mean), covariance

    def widened(self, factor: float) -> ModeTrends:
        return ModeTrends(self.mean, factor * self.covariance, self.slopes, self.years)

    def information(self) -> Array:
        """Information of the linear trend of each group and pair of them, (n_groups, n_groups)."""
        design = np.kron(self.slopes, np.eye(self.n_shapes)[:, :1])
        return design.T @ np.linalg.solve(self.covariance, design)


@dataclass(frozen=True)
class Explanations:
    """Sets of one or two groups, or all groups alike, whose drift may explain the trends, the best first.

    ``evidence`` is the logarithm of how many times likelier the trends are with each than without any drift, and
    ``walk`` the standard deviation of each set's random walk in a year. ``p_value`` is the probability that trends
    without drift give one group as much evidence. ``confounded`` are the groups of which a drift would give as good an
    account of a notable drift of a group.
    """

    sets: list[tuple[int, ...]]
    evidence: Array
    walk: Array
    p_value: float
    widening: float
    confounded: dict[int, list[int]]
    unobservable: NDArray[np.bool_]

    @classmethod
    def of(
        cls, trends: ModeTrends, freedom: float, random: np.random.RandomState, even: Sequence[int] = ()
    ) -> Explanations:
        """Weigh all sets of one or two groups, and ``even`` changes alone; draws give the p value."""
        unobservable = _structure(trends)[1]
        seen = np.flatnonzero(~unobservable).tolist() or list(range(trends.n_groups))
        singles = [(group,) for group in seen]
        first = max(singles, key=lambda one: max(_evidences(trends, one)))
        widening = trends.widening(first)
        pairs = list(combinations([group for group in seen if group not in even], 2))
        widening = min([widening, *(trends.widening(pair) for pair in pairs if first[0] in pair)])
        trends = trends.widened(widening)
        sets = [*singles, *pairs]
        table = np.array([_evidences(trends, one) for one in sets])
        sizes = np.array([len(one) for one in sets])
        prior = np.array([np.log(PRIOR[size] / (sizes == size).sum()) for size in sizes])
        evidence = np.logaddexp.reduce(table, axis=1) - np.log(len(trends.walks))
        walk = trends.walks[table.argmax(axis=1)]
        order = np.argsort(-(evidence + prior), kind="stable")
        observed = table[: len(singles)].max()
        p_value = _chance(trends, singles, observed, freedom, random)
        confounded, unobservable = _structure(trends)
        found = evidence + prior
        return cls([sets[i] for i in order], found[order], walk[order], p_value, widening, confounded, unobservable)

    @property
    def probabilities(self) -> Array:
        weights = np.exp(self.evidence - self.evidence.max())
        return weights / weights.sum()

    def instead(self, group: int) -> list[int]:
        """Groups that explain the trends about as well in the place of one of the best set."""
        best = self.sets[0]
        others = set(best) - {group}
        rivals = [
            next(iter(set(one) - others))
            for one, evidence in zip(self.sets, self.evidence, strict=True)
            if len(one) == len(best) and others < set(one) and self.evidence[0] - evidence <= AS_LIKELY
        ]
        return sorted({group, *rivals} - others)


def _evidences(trends: ModeTrends, groups: Sequence[int]) -> list[float]:
    """Logarithm of how many times likelier the trends are with drift of some groups than without, for each walk."""
    found = []
    for walk in trends.walks:
        quadratic, logarithm = _form(trends, groups, walk)
        found.append(float(trends.mean @ quadratic @ trends.mean - logarithm) / 2)
    return found


def _form(trends: ModeTrends, groups: Sequence[int], walk: float) -> tuple[Array, float]:
    """Matrix of the quadratic form, and the logarithm of the determinants' ratio, of the evidence."""
    total = trends.covariance + trends.explained_by(groups, walk)
    precisions = np.linalg.inv(trends.covariance), np.linalg.inv(total)
    logarithm = np.linalg.slogdet(total)[1] - np.linalg.slogdet(trends.covariance)[1]
    return precisions[0] - precisions[1], logarithm


def _chance(
    trends: ModeTrends, singles: Sequence[Sequence[int]], observed: float, freedom: float, random: np.random.RandomState
) -> float:
    """Probability that errors alone give as much evidence, from draws."""
    root = np.linalg.cholesky(trends.covariance)
    draws = random.standard_normal((DRAWS, len(root))) @ root.T
    draws *= np.sqrt(freedom / random.chisquare(freedom, size=(DRAWS, 1)))
    largest = np.full(DRAWS, -np.inf)
    for groups in singles:
        for walk in trends.walks:
            quadratic, logarithm = _form(trends, groups, walk)
            largest = np.maximum(largest, (((draws @ quadratic) * draws).sum(axis=1) - logarithm) / 2)
    return float((1 + (largest >= observed).sum()) / (1 + DRAWS))


def _structure(trends: ModeTrends) -> tuple[dict[int, list[int]], NDArray[np.bool_]]:
    """Groups of which a notable drift looks like drift of others, with these, and groups that are not seen."""
    information = trends.information()
    own = np.diag(information)
    seen = own * NOTABLE**2 >= 4.0
    with np.errstate(divide="ignore", invalid="ignore"):
        left = NOTABLE**2 * (own[:, np.newaxis] - information**2 / own)
    alike = (left < 4.0) & seen & seen[:, np.newaxis] & ~np.eye(len(own), dtype=bool)
    return {int(one): np.flatnonzero(alike[one]).tolist() for one in np.flatnonzero(alike.any(axis=1))}, ~seen
