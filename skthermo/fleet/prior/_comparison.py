"""Does pooling help? Each bridge's records by what the other bridges say of it, and by a prior of its own."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import t as student

from skthermo._tables.arrays import Array
from skthermo.fleet.prior._families import CoefficientFamily, Member, expect, learn_families
from skthermo.fleet.prior._posterior import ATYPICAL, Mixture, follow_chance, mixture, posterior

LEAST_BRIDGES = 3
LEAST_DEVIATION = 1.0  # of a bridge's gain: that a few are alike is chance
LEVEL = 0.95  # probability with which a gain must be one
COUNT = 10.0  # bridges as which it counts that few are atypical
MOST_LEFT_OUT = 50  # bridges that are left out one at a time; of more, groups are
FEW = 60  # bridges of which one changes little of what is known of the others: fewer take more steps without it
FAR, FEW_MEMBERS = 3.0, 5  # times the median distance from the median: atypical, among at least so many
SETTLED = 0.05
ROUNDS = 3  # in which atypical are found, and the families learned without them


def groups(n_bridges: int) -> list[list[int]]:
    """Bridges that are left out together."""
    n_groups = min(n_bridges, MOST_LEFT_OUT)
    return [list(range(i, n_bridges, n_groups)) for i in range(n_groups)]


def left_out(
    members: Sequence[Member],
    names: Sequence[Hashable],
    follows: Mapping[tuple[int, Hashable], float],
    families: Mapping[Hashable, CoefficientFamily],
    probabilities: Mapping[Hashable, float],
) -> list[Mixture]:
    """Every bridge's posterior by families that are learned without it."""
    found: dict[int, Mixture] = {}
    moments, n_steps = expect(members, families), FEW // len(members)
    for group in groups(len(members)):
        kept = [i for i in range(len(members)) if i not in group]
        others = {(place, name): follows.get((i, name), 1.0) for place, i in enumerate(kept) for name in names}
        rest = [members[i] for i in kept]
        known = [name for name in names if sum(name in member.families for member in rest) > 0]
        without = learn_families(rest, known, others, [moments[i] for i in kept], n_steps)
        for i in group:
            member = members[i]
            prior = member.prior(without, predictive=True)
            chances = {name: p for name, p in probabilities.items() if name in without}
            found[i] = mixture(member.information.J, member.information.h, member.families, prior, member.own, chances)
    return [found[i] for i in range(len(members))]


@dataclass(frozen=True)
class PoolingComparison:
    """Families, the probability of following each, tables by family and by bridge, and the bridges' coefficients."""

    families: dict[Hashable, CoefficientFamily]
    probabilities: dict[Hashable, float]
    by_family: pd.DataFrame
    by_bridge: pd.DataFrame
    coefficients: dict[Hashable, Array]

    @classmethod
    def of(
        cls, members: Sequence[Member], bridges: Sequence[Hashable], names: Sequence[Hashable], covariance: Array
    ) -> PoolingComparison:
        """Learn families, leave bridges out, and learn again without the weight of atypical."""
        probabilities = dict.fromkeys(names, 1 - ATYPICAL)
        several = [name for name in names if sum(name in member.families for member in members) > 1]
        follows = seem_to_follow(members, several, covariance)
        families = learn_families(members, names, follows)
        for _ in range(ROUNDS):
            before = follows
            chances = {name: probabilities[name] for name in several}
            found = left_out(members, several, follows, families, chances)
            follows = {(i, name): share for i, one in enumerate(found) for name, share in one.follows.items()}
            for name in several:
                shares = [follows[i, name] for i, member in enumerate(members) if name in member.families]
                probabilities[name] = (sum(shares) + (1 - ATYPICAL) * COUNT) / (len(shares) + COUNT)
            families = learn_families(members, names, follows, expect(members, families))
            if max((abs(share - before.get(key, 1.0)) for key, share in follows.items()), default=0.0) < SETTLED:
                break
        table = by_bridge(found, bridges, probabilities)
        comparison = by_family(table, members, names)
        pooled = {name: families[name] for name in names if comparison.loc[name, "is_pooled"]}
        chances = {name: probabilities[name] for name in pooled}
        coefficients = {
            bridge: mixture(
                member.information.J, member.information.h, member.families, member.prior(pooled), member.own, chances
            ).mean.reshape(member.information.n_outputs, -1)
            for bridge, member in zip(bridges, members, strict=True)
        }
        return cls(pooled, chances, comparison, table, coefficients)


def seem_to_follow(
    members: Sequence[Member], names: Sequence[Hashable], covariance: Array
) -> dict[tuple[int, Hashable], float]:
    """1, or 0 for bridges that on their own respond far from the median of their family, in the fleet's weather."""
    own = [posterior(m.information.J, m.information.h, *m.own).mean.reshape(len(m.families), -1) for m in members]
    follows = {}
    for name in names:
        of_family = [(i, own[i][j]) for i, m in enumerate(members) for j, f in enumerate(m.families) if f == name]
        b = np.array([coefficients for _, coefficients in of_family])
        away = b - np.median(b, axis=0)
        distances = np.sqrt(np.einsum("ij,jk,ik->i", away, covariance, away))
        far = (distances > FAR * np.median(distances)) & (len(b) >= FEW_MEMBERS)
        for (i, _), is_far in zip(of_family, far, strict=True):
            follows[i, name] = min(follows.get((i, name), 1.0), 0.0 if is_far else 1.0)
    return follows


def by_bridge(
    found: Sequence[Mixture], bridges: Sequence[Hashable], probabilities: Mapping[Hashable, float]
) -> pd.DataFrame:
    """Log likelihoods alone, and by the mixture of following the others and being on its own."""
    rows = []
    for bridge, one in zip(bridges, found, strict=True):
        for name, share in one.follows.items():
            alone, chance = one.without_family[name], follow_chance(probabilities[name])
            pooled = float(np.logaddexp(np.log(chance) + one.with_family[name], np.log1p(-chance) + alone))
            rows.append((bridge, name, alone, pooled, pooled - alone, share))
    columns = ["bridge", "family", "alone", "pooled", "gain", "pooling_probability"]
    return pd.DataFrame(rows, columns=columns).set_index(["bridge", "family"])


def by_family(table: pd.DataFrame, members: Sequence[Member], names: Sequence[Hashable]) -> pd.DataFrame:
    """Sums over bridges; a family is pooled where its gain is clearly positive and enough bridges have it."""
    rows = []
    for name in names:
        n_bridges = sum(name in member.families for member in members)
        part = table[table.index.get_level_values("family") == name]
        gain, error = float(part["gain"].sum()), np.nan
        if n_bridges > 1:
            error = float(max(part["gain"].std(), LEAST_DEVIATION) * np.sqrt(n_bridges))
        is_pooled = n_bridges >= LEAST_BRIDGES and gain > student.ppf(LEVEL, n_bridges - 1) * error
        rows.append((name, n_bridges, part["alone"].sum(), part["pooled"].sum(), gain, error, bool(is_pooled)))
    columns = ["family", "n_bridges", "alone", "pooled", "gain", "standard_error", "is_pooled"]
    return pd.DataFrame(rows, columns=columns).set_index("family")
