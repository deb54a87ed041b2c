"""Does pooling help? Each bridge's records by what the other bridges say of it, and by a prior of its own."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.stats import t as student

from skthermo.fleet.prior._families import Family, Member, learn_families
from skthermo.fleet.prior._posterior import Mixture, mixture

LEAST_BRIDGES = 3
LEVEL = 0.95  # probability with which a gain must be one
ALIENS, COUNT = 0.05, 10.0  # share of aliens before any is seen, and bridges as which it counts
MOST_LEFT_OUT = 50  # bridges that are left out one at a time; of more, groups are
WARM_STEPS, FEW = 3, 60  # steps of the iteration without a bridge, the more the fewer bridges there are
ROUNDS = 3  # in which aliens are found, and the families learned without them


def groups(n_bridges: int) -> list[list[int]]:
    """Bridges that are left out together."""
    n_groups = min(n_bridges, MOST_LEFT_OUT)
    return [list(range(i, n_bridges, n_groups)) for i in range(n_groups)]


def left_out(
    members: Sequence[Member],
    names: Sequence[Hashable],
    follows: Mapping[tuple[int, Hashable], float],
    families: Mapping[Hashable, Family],
    probabilities: Mapping[Hashable, float],
) -> list[Mixture]:
    """Every bridge's posterior by families that are learned without it."""
    found: dict[int, Mixture] = {}
    for group in groups(len(members)):
        kept = [i for i in range(len(members)) if i not in group]
        others = {(place, name): follows.get((i, name), 1.0) for place, i in enumerate(kept) for name in names}
        rest = [members[i] for i in kept]
        known = [name for name in names if sum(name in member.families for member in rest) > 0]
        n_steps = max(WARM_STEPS, FEW // max(len(members), 1))
        without = learn_families(rest, known, others, {name: families[name] for name in known}, n_steps)
        for i in group:
            member = members[i]
            prior = member.prior(without, predictive=True)
            chances = {name: p for name, p in probabilities.items() if name in without}
            found[i] = mixture(member.information.J, member.information.h, member.families, prior, member.own, chances)
    return [found[i] for i in range(len(members))]


def compare(
    members: Sequence[Member], bridges: Sequence[Hashable], names: Sequence[Hashable]
) -> tuple[dict[Hashable, Family], dict[Hashable, float], pd.DataFrame, pd.DataFrame]:
    """Families, probabilities of following them, and the tables by family and by bridge."""
    follows = {(i, name): 1.0 for i in range(len(members)) for name in names}
    probabilities = dict.fromkeys(names, 1 - ALIENS)
    several = [name for name in names if sum(name in member.families for member in members) > 1]
    families = learn_families(members, names, follows)
    for _ in range(ROUNDS):
        outcome = left_out(members, several, follows, families, {name: probabilities[name] for name in several})
        before = dict(follows)
        for i, found in enumerate(outcome):
            follows |= {(i, name): share for name, share in found.follows.items()}
        for name in several:
            own = [follows[i, name] for i, member in enumerate(members) if name in member.families]
            probabilities[name] = (sum(own) + (1 - ALIENS) * COUNT) / (len(own) + COUNT)
        families = learn_families(members, names, follows, families)
        if max((abs(follows[key] - before[key]) for key in follows), default=0.0) < 0.05:
            break
    rows = []
    for bridge, found in zip(bridges, outcome, strict=True):
        for name in several:
            if name in found.follows:
                alone = found.without_family[name]
                chance = probabilities[name]
                pooled = float(np.logaddexp(np.log(chance) + found.with_family[name], np.log1p(-chance) + alone))
                rows.append((bridge, name, alone, pooled, pooled - alone, found.follows[name]))
    columns = ["bridge", "family", "alone", "pooled", "gain", "follows"]
    by_bridge = pd.DataFrame(rows, columns=columns).set_index(["bridge", "family"])
    return families, probabilities, by_family(by_bridge, members, names), by_bridge


def by_family(by_bridge: pd.DataFrame, members: Sequence[Member], names: Sequence[Hashable]) -> pd.DataFrame:
    """Sums over bridges; a family is pooled where its gain is clearly positive and enough bridges have it."""
    rows = []
    for name in names:
        n_bridges = sum(name in member.families for member in members)
        part = by_bridge[by_bridge.index.get_level_values("family") == name]
        gain, error = float(part["gain"].sum()), np.nan
        if n_bridges > 1:
            error = float(part["gain"].std() * np.sqrt(n_bridges))
        is_pooled = n_bridges >= LEAST_BRIDGES and gain > student.ppf(LEVEL, n_bridges - 1) * error
        rows.append((name, n_bridges, part["alone"].sum(), part["pooled"].sum(), gain, error, bool(is_pooled)))
    columns = ["family", "n_bridges", "alone", "pooled", "gain", "standard_error", "is_pooled"]
    return pd.DataFrame(rows, columns=columns).set_index("family")
