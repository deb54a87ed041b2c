"""Losses of cross-section, which take mass with the stiffness, beside losses of stiffness alone.

    OMP_NUM_THREADS=1 python tests/benchmarks/section_losses.py [--parts truss fleet rates] [--seeds 3]

- truss, fleet, footbridge: a year is learned, another one evaluated, healthy and with losses of both kinds. Fleet:
  six-hourly records of three bridges with models that are a little wrong, 5 %. Footbridge: one with frost, 5 %.
  Detectors know directions of losses of stiffness, of section, of both kinds as `DirectionalDetector` takes them from a
  model, that each frequency falls, or none (the Mahalanobis distance). Shares of records in alarm by their own
  thresholds, with the false alarms, and where the threshold leaves 2 % of the healthy records in alarm.
- rates: Table 3 of the paper, which reduces cross-sections, by the thermo-mechanical truss: this package's geometry,
  and another one of the family that was searched, with other phases of season and day at the third thermocouple. Means
  of the draws whose healthy rate is within .7 points of the paper's.
- frequencies: changes of the frequencies by a loss of a tenth, of the truss and of KW51's model.

The exit code is 1 if directions of both kinds find less of losses of section than the Mahalanobis distance does.
"""

import sys

import numpy as np
import pandas as pd
from harness import arguments, compensated, joined, modes_of, recipes, shown
from structures import Footbridge

from skthermo.datasets import make_fleet, make_kw51, make_truss, make_truss_campaign, steel_modulus, truss_structure
from skthermo.detection import DirectionalDetector, MahalanobisDetector
from skthermo.fem import Structure
from skthermo.studies import sweep

KINDS = ("stiffness", "section")
BOTH, OMNIBUS = "directions of both kinds", "Mahalanobis"


def detectors(model, targets):
    last = {f"directions of {kind}": DirectionalDetector(model.damage_directions(kind=kind)) for kind in KINDS}
    last |= {BOTH: DirectionalDetector(model), "falls, no model": DirectionalDetector(), OMNIBUS: None}
    return {name: compensated(targets, one) for name, one in last.items()}


def truss(seed):
    later = {
        (kind, group): joined(make_truss_campaign(damage={group: 0.1}, kind=kind, random_state=seed + 1000))
        for kind in KINDS
        for group in ("bottom", "top", "diagonal")
    }
    baseline, healthy = (joined(make_truss_campaign(random_state=one)) for one in (seed, seed + 1000))
    yield make_truss(), baseline, healthy, later


def fleet(seed):
    for bridge in make_fleet(3, random_state=seed).values():
        options = {"samples_per_day": 4, "random_state": 1}
        baseline, healthy = (joined(bridge.records(365, start, **options)) for start in ("2023-01-01", "2024-01-01"))
        groups = [name for name in bridge.groups if bridge.model.group_mass[name].nnz]
        later = {
            (kind, "a group"): joined(bridge.records(365, "2024-01-01", damage={group: 0.05}, kind=kind, **options))
            for kind in KINDS
            for group in groups[:1]
        }
        yield bridge.model, baseline, healthy, later


def footbridge(seed):
    bridge = Footbridge(seed)
    later = {
        (kind, group): bridge.evaluated({group: 0.05}, kind=kind)
        for kind in KINDS
        for group in ("side span", "main span", "main stays")
    }
    yield bridge.model, bridge.training(False), bridge.evaluated({}), later


STRUCTURES = {
    "truss": (truss, "Truss, daily records of a second year: losses of 10 %"),
    "fleet": (fleet, "Three bridges whose models are a little wrong, a second year: losses of 5 % of one group"),
    "footbridge": (footbridge, "Footbridge with frost, a second year: losses of 5 %"),
}


def found(part, options):
    structure, title = STRUCTURES[part]
    rows = {}
    for seed in range(options.seeds if part == "truss" else 1):
        for model, baseline, healthy, later in structure(100 + seed):
            for name, detector in detectors(model, modes_of(baseline)).items():
                detector.fit(baseline)
                index = -detector.score_samples(healthy)
                level = np.nanquantile(index, 0.98)
                row = {("own threshold", "false alarms"): np.mean(detector.predict(healthy) == -1)}
                for (kind, group), table in later.items():
                    own = -detector.score_samples(table)
                    what = f"{kind}, {group}"
                    row["own threshold", what] = np.mean(detector.predict(table) == -1)
                    row["2 % false alarms", what] = np.mean(own[~np.isnan(own)] > level)
                rows.setdefault(name, []).append(row)
    table = 100 * pd.DataFrame({name: pd.DataFrame(each).mean() for name, each in rows.items()}).T
    for threshold in ("own threshold", "2 % false alarms"):
        columns = [what for which, what in table if which == threshold]
        own = table[[(threshold, what) for what in columns]].set_axis(columns, axis=1)
        shown(f"{title}, found at {threshold}, %", own.rename_axis("detector"), 0 if threshold[0] == "2" else 1)
    of_section = [column for column in table if column[1].startswith("section")]
    return table.loc[BOTH, of_section].mean() < table.loc[OMNIBUS, of_section].mean()


def thermal_truss(height=2.0, apex=2.4):
    """The truss whose parameters are the moduli of its thermal zones, with other heights of its top chord and apex."""
    given = truss_structure()
    heights = {0.0: 0.0, 2.0: height, 2.4: apex}
    nodes = {name: (x, heights[y]) for name, (x, y) in given.nodes.items()}
    zones, groups = ("T1", "T2", "T3"), ("bottom", "top", "diagonal", "vertical")
    return Structure(nodes, given.members, given.supports, given.groups).assemble(zones, groups=groups)


def year(random, season, day):
    """Temperatures of equations (11) to (13), with other phases of season and day at the third thermocouple."""
    record = np.arange(1, 366)[:, np.newaxis]
    cycles = np.array([15, 20, 25]) * np.sin(2 * np.pi * record / 365 + np.array([0, 0, season]))
    cycles = cycles + np.array([20, 16, 20]) * np.sin(np.array([0, 0, day]))
    return np.array([15, 15, 17]) + cycles + np.array([3, 2, 8]) * random.standard_normal((365, 3))


def rates_of(model, kind, seeds, season=np.pi / 6, day=np.pi / 6, noise=0.01):
    """Percent of records in alarm, (n_seeds, n_scenarios): healthy first."""
    losses = [{group: loss} for group, loss in LOSSES.values()]
    states = [model, *(model.damaged(loss, kind=kind) for loss in losses)]
    rows = []
    for seed in range(seeds):
        random = np.random.RandomState(seed)

        def drawn(state, random=random, weather=None):
            clean = state.frequencies(steel_modulus(year(random, season, day) if weather is None else weather))
            return clean * (1 + noise * random.standard_normal(clean.shape))

        detector = MahalanobisDetector(contamination=0.02, threshold="quantile").fit(drawn(model))
        weather = year(random, season, day)
        index = [detector.damage_index(drawn(state, weather=weather)) for state in states]
        rows.append([100 * np.mean(one > detector.threshold_) for one in index])
    return np.array(rows)


LOSSES = {
    f"{group} {loss:.0%}".replace("%", " %"): (group, loss)
    for group, losses in {"bottom": (0.1, 0.2, 0.3), "top": (0.1, 0.2, 0.3), "diagonal": (0.1, 0.2)}.items()
    for loss in losses
}


def rates(options):
    scenarios = [scenario.name for scenario in sweep(make_truss(), groups=["bottom", "top", "diagonal"])]
    known = dict(zip(scenarios, recipes("truss").PAPER_RATES["reference"], strict=True))
    paper = [known[name] for name in ("healthy", *LOSSES)]
    cases = {
        "stiffness": rates_of(thermal_truss(), "stiffness", options.draws),
        "section": rates_of(thermal_truss(), "section", options.draws),
        "section, chord at 2.9 m, apex at 1.9 m, phases -0.2 and 1.1": rates_of(
            thermal_truss(2.9, 1.9), "section", options.draws, -0.2, 1.1
        ),
    }
    rows = {"paper, one realisation": [*paper, 1]}
    for name, found in cases.items():
        near = np.abs(found[:, 0] - paper[0]) < 0.7
        rows[f"losses of {name}"] = [*found[near].mean(axis=0), near.sum()]
    table = pd.DataFrame(rows, ["healthy", *LOSSES, "draws"]).T.rename_axis("what")
    shown("Table 3, thermo-mechanical truss: records in alarm where 4 % of the healthy ones are, %", table, 0)


def frequencies(options):
    rows = {}
    for name, model, groups in (("truss", make_truss(), ("bottom", "diagonal")), ("KW51", make_kw51(), ("arch",))):
        nominal = np.ones((1, len(model.parameter_names)))
        for group in groups:
            for kind in KINDS:
                after = model.damaged({group: 0.1}, kind=kind).frequencies(nominal)[0]
                change = 100 * (after / model.frequencies(nominal)[0] - 1)
                rows[f"{name}, {kind}, {group}"] = dict(zip(range(1, 1 + len(change)), change, strict=True))
    table = pd.DataFrame(rows).T.rename_axis("loss of 10 %").add_prefix("mode ")
    shown("Changes of the frequencies by a loss of 10 %, %", table, 1)


def main():
    parts = [*STRUCTURES, "rates", "frequencies"]
    options = arguments(__doc__, parts=dict.fromkeys(parts), seeds=3, draws=200)
    missed = [found(part, options) for part in options.parts if part in STRUCTURES]
    for part in (rates, frequencies):
        if part.__name__ in options.parts:
            part(options)
    return int(any(missed))


if __name__ == "__main__":
    sys.exit(main())
