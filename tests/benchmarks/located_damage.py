"""Whether damaged members are where `identify_damage` says, and how few members it names.

    OMP_NUM_THREADS=1 python tests/benchmarks/located_damage.py

Some neighbouring members of a random group lose 20 to 50 % of their stiffness, in the truss (the thermo-mechanical
truth, 1 % noise, 120 records) and in the cable-stayed footbridge (60 days, .15 % noise). The chains are fitted to a
year of healthy records. Their FE model is right, or each member of the truth differs from it, by
5 % of its stiffness (standard deviation), which no parameter can follow. Cases in which damage has a probability below
one half are counted and left out.

Prints how often all damaged members are in the set of 90 %, how many members this set has, and how often the true
group is the most probable, beside the same by whole groups. The exit code is 1 if a target is missed.
"""

import sys

import numpy as np
import pandas as pd
from harness import arguments, is_missed, shown
from structures import FOOTBRIDGE_GROUPS, footbridge
from structures import Footbridge as Measured

from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
from skthermo.fem import add_noise
from skthermo.preprocessing import BiasAligner
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM

SEVERITIES = 0.2, 0.5
OFF = 0.05  # relative standard deviation of the members' stiffnesses from those of the model
N_TRUSS, N_DAYS, DAILY_NOISE = 120, 60, 0.0015
LEVEL = 0.9
PARAMETERS = "bottom", "top", "diagonal", "vertical"


class Truss:
    """A year of the truss that trains, and records of a later year."""

    name, groups, noise, options = "truss", PARAMETERS, 0.01, {}

    def __init__(self, seed):
        self.structure, self.model = truss_structure(), make_truss()
        year = make_truss_campaign(random_state=2 * seed)
        later = make_truss_campaign(samples_per_year=N_TRUSS, random_state=2 * seed + 1)
        self.truth, self.modes = year.model, list(year.frequencies.columns)
        self.weather = (year.temperatures, year.theta.to_numpy()), (later.temperatures, later.theta.to_numpy())


class Footbridge:
    """A year of daily means of the footbridge that trains, and two months of the next."""

    name, groups, noise, options = "footbridge", FOOTBRIDGE_GROUPS, DAILY_NOISE, {"reduce": True}
    modes = Measured.modes

    def __init__(self, seed):
        bridge, self.structure = Measured(seed), footbridge()
        self.truth = self.structure.assemble(FOOTBRIDGE_GROUPS, n_modes=len(self.modes))
        self.model = self.structure.assemble(FOOTBRIDGE_GROUPS, n_modes=len(self.modes), track=True)
        T = bridge.T.resample("1D").mean()
        theta = pd.DataFrame(bridge.theta, bridge.T.index).resample("1D").mean().to_numpy()
        self.weather = tuple((T[rows], theta[rows]) for rows in (slice(0, 365), slice(365, 365 + N_DAYS)))


class Truth:
    """The structure as it is: its members differ from those of the model by some shares of their stiffness."""

    def __init__(self, bridge, off, seed):
        self.bridge = bridge
        names = {group: {f"{m} of {group}": [m] for m in bridge.structure.groups[group]} for group in bridge.groups}
        self.model = bridge.structure.divide(bridge.truth, names)
        random = np.random.default_rng(seed)
        self.factors = {name: 1 + off * random.normal() for own in names.values() for name in own}

    def frequencies(self, which, seed, group=None, members=(), severity=0.0):
        """Records of the training (0) or of later (1), with damage in some members."""
        lost = {f"{member} of {group}": severity for member in members}
        severities = {name: 1 - factor * (1 - lost.get(name, 0.0)) for name, factor in self.factors.items()}
        T, theta = self.bridge.weather[which]
        clean = self.model.damaged(severities).frequencies(theta)
        return T, pd.DataFrame(add_noise(clean, self.bridge.noise, random_state=seed), T.index, self.bridge.modes)

    def chain(self, seed):
        model = self.bridge.model
        aligner = BiasAligner(model, method="scale")
        fem = DataInformedFEM(model, aligner=aligner, random_state=0, **self.bridge.options)
        return fem.fit(*self.frequencies(0, seed))


def case(places, random):
    """A random group, some neighbouring members of it, and their severity."""
    group = random.choice(sorted(places))
    lines = [line for line in places[group] if len(line) > 1]
    line = lines[random.integers(len(lines))]
    length = int(random.integers(1, max(len(line) // 2, 1) + 1))
    first = int(random.integers(0, len(line) - length + 1))
    return group, list(line[first : first + length]), random.uniform(*SEVERITIES)


def evaluated(truth, fem, places, seed, n_cases):
    """One row a case."""
    random, rows = np.random.default_rng(seed), []
    for number in range(n_cases):
        group, members, severity = case(places, random)
        T, F = truth.frequencies(1, 1000 * seed + number, group, members, severity)
        located = identify_damage(fem, T, F, list(places), structure=truth.bridge.structure, random_state=0)
        whole = identify_damage(fem, T, F, list(places), random_state=0)
        likely = located.likely_members(LEVEL)
        rows.append(
            {
                "seen": located.probability_of_damage > 0.5,
                "held": set(members) <= set(likely),
                "size": len(likely) / len(located.table),
                "of group": sum(map(len, places[group])) / len(located.table),
                "first": located.groups["probability"].idxmax() == group,
                "plain first": whole.table["probability"].idxmax() == group,
            }
        )
    return rows


def summary(cases, healthy):
    """Shares in percent."""
    seen = cases[cases["seen"]]
    shares = 100 * seen.mean()
    return {
        "damage seen": f"{len(seen)} of {len(cases)}",
        "all damaged members in the set of 90 %": shares["held"],
        "this set, of all members": shares["size"],
        "the true group, of all members": shares["of group"],
        "true group first": shares["first"],
        "true group first, by whole groups": shares["plain first"],
        "healthy records: highest probability of damage": 100 * max(healthy),
    }


def main():
    options = arguments(
        __doc__,
        structures=dict.fromkeys(["truss", "footbridge"]),
        seeds=(2, "chains of each structure and model"),
        cases=(8, "of each chain"),
    )
    models, table = {"right model": 0.0, "members 5 % off": OFF}, {}
    for kind in (Truss, Footbridge):
        if kind.name not in options.structures:
            continue
        found, healthy = {which: [] for which in models}, {which: [] for which in models}
        for seed in range(options.seeds):
            bridge = kind(seed)
            for which, off in models.items():
                truth = Truth(bridge, off, seed)
                fem = truth.chain(seed)
                first = identify_damage(fem, *truth.frequencies(1, seed), structure=bridge.structure)
                healthy[which].append(first.probability_of_damage)
                places = {group: [] for group in bridge.groups if group not in first.unobservable}
                for (group, _), line in first.table.groupby(["group", "line"], sort=False):
                    if group in places:
                        places[group].append(list(line.index))
                found[which] += evaluated(truth, fem, places, seed, options.cases)
        table |= {f"{kind.name}, {which}": summary(pd.DataFrame(rows), healthy[which]) for which, rows in found.items()}
    table = pd.DataFrame(table).T.rename_axis("structure")
    shown("Some members of one group lose 20 to 50 %; percent of the cases in which damage was seen", table, 0)
    missed = 0
    for name, held in table["all damaged members in the set of 90 %"].items():
        least = 70 if name.endswith("off") else 80  # of few cases: 90 % less two standard deviations
        missed += is_missed(name, held, f">= {least}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
