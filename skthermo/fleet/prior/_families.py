"""Empirical Bayes: the distribution of coefficients in each family, from what many bridges tell of theirs."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.linalg import block_diag

from skthermo._core.arrays import Array, is_real
from skthermo.fleet.prior._information import Information
from skthermo.fleet.prior._posterior import CoefficientPosterior, CoefficientPrior

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


def learn_families(
    members: Sequence[Member],
    names: Sequence[Hashable],
    follows: Mapping[tuple[int, Hashable], float],
    start: Sequence[CoefficientPosterior] | None = None,
    n_steps: int = STEPS,
) -> dict[Hashable, CoefficientFamily]:
    """Expectation maximisation on the bridges' information, each weighed by its probability of following a family.

    It starts from their coefficients, by default those that each learns on its own.
    """
    if start is None:
        start = [CoefficientPosterior(one.information.J, one.information.h, *one.own) for one in members]
    families = maximise(members, names, follows, start)
    for _ in range(n_steps):
        updated = maximise(members, names, follows, expect(members, families))
        changes = [abs(np.log(np.trace(updated[n].Sigma) / np.trace(families[n].Sigma))) for n in names]
        families = updated
        if max(changes, default=0.0) < TOLERANCE:
            break
    return families


def expect(members: Sequence[Member], families: Mapping[Hashable, CoefficientFamily]) -> list[CoefficientPosterior]:
    """The bridges' coefficients, given the families."""
    return [CoefficientPosterior(one.information.J, one.information.h, *one.prior(families)) for one in members]


def maximise(
    members: Sequence[Member],
    names: Sequence[Hashable],
    follows: Mapping[tuple[int, Hashable], float],
    found: Sequence[CoefficientPosterior],
) -> dict[Hashable, CoefficientFamily]:
    """The most likely families given what is known of the bridges' coefficients."""
    families = {}
    for name in names:
        z, b, covariances, shares = [], [], 0.0, []
        for number, (member, one) in enumerate(zip(members, found, strict=True)):
            share = max(follows.get((number, name), 1.0), LEAST_SHARE)
            n_outputs = member.information.n_outputs
            n_functions = len(one.mean) // n_outputs
            blocks = one.covariance.reshape(n_outputs, n_functions, n_outputs, n_functions)
            for i, family in enumerate(member.families):
                if family == name:
                    z.append(member.z)
                    b.append(one.mean.reshape(n_outputs, n_functions)[i])
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


@dataclass(frozen=True)
class Covariates:
    """A row (1, standardised numbers, centred indicators of categories) for a bridge; 0 where a covariate is unknown.

    ``centre`` and ``scale`` are those of numbers by name; ``shares`` of categories by name and value.
    """

    numbers: Mapping[Hashable, tuple[float, float]]
    shares: Mapping[Hashable, Mapping[Any, float]]

    @classmethod
    def of(cls, table: pd.DataFrame | None, bridges: Sequence[Hashable]) -> tuple[Covariates, Array, list[Array]]:
        """The encoding, the rows of the bridges, and the covariances of what is unknown of them."""
        numbers, shares = {}, {}
        if table is not None:
            if not isinstance(table, pd.DataFrame):
                raise ValueError(
                    f"covariates is {table!r:.100}; expected a DataFrame with a row for each bridge's name"
                )
            missing = [name for name in bridges if name not in table.index]
            if missing or not table.index.is_unique:
                raise ValueError(
                    f"covariates have the rows {list(table.index)[:20]}; expected each bridge's name once, and lack "
                    f"{missing[:20]}"
                )
            table = table.loc[list(bridges)]
            for name, column in table.items():
                known = column[~column.isna()]
                if not len(known):
                    raise ValueError(f"covariate {name!r} is missing for all {len(column)} bridges; expected values")
                if pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
                    values = known.to_numpy(dtype=float)
                    numbers[name] = (float(values.mean()), float(values.std()) or 1.0)
                else:
                    counts = known.value_counts()
                    shares[name] = {value: counts[value] / len(known) for value in sorted(counts.index, key=str)}
        found = cls(numbers, shares)
        rows = [found.row(None if table is None else table.loc[name].to_dict()) for name in bridges]
        return found, np.array([row for row, _ in rows]), [unknown for _, unknown in rows]

    def row(self, covariates: Mapping[Hashable, Any] | pd.Series | None) -> tuple[Array, Array]:
        """The numbers of one bridge, (n_columns,), and the covariance of those that are unknown."""
        given = {} if covariates is None else dict(covariates)
        unknown = [name for name in given if name not in self.numbers and name not in self.shares]
        if unknown:
            raise ValueError(f"covariates {unknown} are unknown; expected some of {[*self.numbers, *self.shares]}")
        values, covariances = [1.0], [np.zeros((1, 1))]
        for name, (centre, scale) in self.numbers.items():
            value = given.get(name)
            if value is None or pd.isna(value):
                values, covariances = [*values, 0.0], [*covariances, np.ones((1, 1))]
                continue
            if not is_real(value):
                raise ValueError(f"covariate {name!r} is {value!r}; expected a number, as for the other bridges")
            values, covariances = [*values, (float(value) - centre) / scale], [*covariances, np.zeros((1, 1))]
        for name, shares in self.shares.items():
            value, share = given.get(name), np.array(list(shares.values()))
            if value is None or pd.isna(value):
                values = [*values, *np.zeros(len(share))]
                covariances.append(np.diag(share) - np.outer(share, share))
                continue
            if value not in shares:
                raise ValueError(f"covariate {name!r} is {value!r}; expected one of {list(shares)}, or None if unknown")
            values = [*values, *(np.array([value == known for known in shares], dtype=float) - share)]
            covariances.append(np.zeros((len(share), len(share))))
        return np.array(values), block_diag(*covariances)
