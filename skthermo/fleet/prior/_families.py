"""Empirical Bayes: the distribution of coefficients in each family, from what many bridges tell of theirs."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skthermo._tables.arrays import Array
from skthermo.fleet.prior._information import Information
from skthermo.fleet.prior._posterior import CoefficientPrior, posterior

ROUND_COUNT = 3.0  # bridges as which a round covariance counts
COVARIATE_PENALTY = 1.0  # bridges as which it counts that a covariate has no effect
LEAST_SHARE = 1e-6  # with which a bridge counts that hardly follows its family
STEPS = 60
TOLERANCE = 0.01  # relative change of the mean variance that ends the iteration


@dataclass(frozen=True)
class CoefficientFamily:
    """Coefficients of a bridge of covariates z are N(M'z, Sigma), of ``n_draws`` that were seen.

    ``precision`` is Z'Z + penalty, the precision of M in units of Sigma.
    """

    M: Array
    Sigma: Array
    precision: Array
    n_draws: float

    def moments(self, z: Array) -> tuple[Array, Array]:
        """Mean and covariance for known M and Sigma."""
        return z @ self.M, self.Sigma

    def predictive(self, z: Array, unknown: Array) -> tuple[Array, Array]:
        """Mean and covariance of another bridge's coefficients, for M and Sigma as uncertain as they are.

        The covariance is that of Student's distribution; ``unknown`` is that of the covariates.
        """
        inverse = np.linalg.inv(self.precision)
        used = len(z) - np.trace(inverse @ penalty(len(z)))
        count = self.n_draws + ROUND_COUNT
        width = (1 + z @ inverse @ z) * count / max(count - used - 2, 1.0)
        return z @ self.M, width * self.Sigma + self.M.T @ unknown @ self.M


@dataclass(frozen=True)
class Member:
    """A bridge of the fleet: its information, the family of each output, covariates, and its prior on its own."""

    information: Information
    families: Sequence[Hashable | None]
    z: Array
    unknown: Array
    own: CoefficientPrior

    def prior(self, families: Mapping[Hashable, CoefficientFamily], *, predictive: bool = False) -> CoefficientPrior:
        """What the fleet says of its coefficients; of outputs that no family says anything about, its own prior."""
        mean, root = self.own.mean.copy(), self.own.root.copy()
        moments = {}
        for i, name in enumerate(self.families):
            if name in families:
                if name not in moments:
                    family = families[name]
                    m, S = family.predictive(self.z, self.unknown) if predictive else family.moments(self.z)
                    moments[name] = m, np.linalg.cholesky(S)
                mean[i], root[i] = moments[name]
        return CoefficientPrior(mean, root)


def penalty(n_columns: int) -> Array:
    """Precision with which covariates have no effect; none for the constant."""
    return COVARIATE_PENALTY * np.diag(np.arange(n_columns) > 0).astype(float)


Moments = Sequence[tuple[Array, Array]]  # mean and covariance of each bridge's coefficients


def learn_families(
    members: Sequence[Member],
    names: Sequence[Hashable],
    follows: Mapping[tuple[int, Hashable], float],
    start: Moments | None = None,
    n_steps: int = STEPS,
) -> dict[Hashable, CoefficientFamily]:
    """Expectation maximisation on the bridges' information, each weighed by its probability of following a family.

    It starts from moments of their coefficients, by default those that each learns on its own.
    """
    if start is None:
        start = [posterior(member.information.J, member.information.h, *member.own)[1:] for member in members]
    families = maximise(members, names, follows, start)
    for _ in range(n_steps):
        updated = maximise(members, names, follows, expect(members, families))
        changes = [abs(np.log(np.trace(updated[n].Sigma) / np.trace(families[n].Sigma))) for n in names]
        families = updated
        if max(changes, default=0.0) < TOLERANCE:
            break
    return families


def expect(members: Sequence[Member], families: Mapping[Hashable, CoefficientFamily]) -> Moments:
    """Posterior moments of the bridges' coefficients, given the families."""
    return [posterior(one.information.J, one.information.h, *one.prior(families))[1:] for one in members]


def maximise(
    members: Sequence[Member], names: Sequence[Hashable], follows: Mapping[tuple[int, Hashable], float], found: Moments
) -> dict[Hashable, CoefficientFamily]:
    """The most likely families given posterior moments of the bridges' coefficients."""
    families = {}
    for name in names:
        z, b, covariances, shares = [], [], 0.0, []
        for number, (member, (mean, covariance)) in enumerate(zip(members, found, strict=True)):
            share = max(follows.get((number, name), 1.0), LEAST_SHARE)
            n_outputs = member.information.n_outputs
            n_functions = len(mean) // n_outputs
            blocks = covariance.reshape(n_outputs, n_functions, n_outputs, n_functions)
            for i, family in enumerate(member.families):
                if family == name:
                    z.append(member.z)
                    b.append(mean.reshape(n_outputs, n_functions)[i])
                    covariances = covariances + share * blocks[i, :, i]
                    shares.append(share)
        Z, b, r = np.array(z), np.array(b), np.array(shares)
        ridge = penalty(Z.shape[1])
        precision = Z.T @ (r[:, np.newaxis] * Z) + ridge
        M = np.linalg.solve(precision, Z.T @ (r[:, np.newaxis] * b))
        left = b - Z @ M
        scatter = left.T @ (r[:, np.newaxis] * left) + covariances + M.T @ ridge @ M
        n_draws = float(r.sum())
        round_variance = np.trace(scatter) / len(scatter) / n_draws
        Sigma = (scatter + ROUND_COUNT * round_variance * np.eye(len(scatter))) / (n_draws + ROUND_COUNT)
        families[name] = CoefficientFamily(M, (Sigma + Sigma.T) / 2, precision, n_draws)
    return families
