"""Calibration of the p values of `identify_damage` in healthy windows of records, and the damage that is identified.

    OMP_NUM_THREADS=1 python tests/benchmarks/healthy_windows.py

A chain without settings learns a year of records of a structure of known truth: the truss by its thermo-mechanical
law, a cable-stayed footbridge, and a girder of four spans of which two parameters follow the weather slowly. Noise is
independent or correlated by .5 from record to record. Windows of 15, 60 and 365 days of the three years that follow,
all healthy, give the share of p values of .05 or less, which should be 4 to 7 %. Beside it stands the power: the share
of windows of 60 days with damage of 5, 10 and 20 % in one group in which this group alone is the most probable
explanation, and the share with p values of .05 or less.

Windows of one chain share its errors, so that the standard error of each share is that of means over chains, and at
least that of independent windows. Settings
were chosen on seeds below 100. The exit code is 1 if a share is outside its target by more than two standard errors.
"""

import sys

import numpy as np
import pandas as pd
from harness import arguments
from structures import KNOWN, Campaign

from skthermo.studies import DamagePrior, identify_damage

TRAINING_DAYS = 365
N_YEARS, LENGTHS, DAMAGED_DAYS = 3, (15, 60, 365), 60
MOST_WINDOWS = 18  # of each length and chain
SEVERITIES = (0.05, 0.1, 0.2)
LEVEL, TARGET = 0.05, (0.04, 0.07)
ONE_CAUSE = DamagePrior(numbers=(0.5, 0.5))


def healthy(campaign, memory):
    """The p value of each window."""
    T, F = campaign.structure.records(365 * N_YEARS, {}, memory, 500_000 + campaign.seed)
    for length in LENGTHS:
        starts = np.arange(0, len(T) - length + 1, length)
        for start in starts[:: max(len(starts) // MOST_WINDOWS, 1)]:
            rows = slice(start, start + length)
            found = identify_damage(
                campaign.fem, T[rows], F[rows], [campaign.structure.groups[0]], prior=ONE_CAUSE, random_state=0
            )
            yield {"length": length, "p": found.probabilities.p_value}


def damaged(campaign, memory):
    """Whether damage is identified, and the p value of each window."""
    groups = campaign.structure.groups
    for number, severity in enumerate(SEVERITIES * 2):
        group = groups[(campaign.seed + number) % len(groups)]
        T, F = campaign.structure.records(
            DAMAGED_DAYS, {group: severity}, memory, 600_000 + 10 * campaign.seed + number
        )
        found = identify_damage(campaign.fem, T, F, list(groups), random_state=0)
        yield {"severity": severity, "identified": found.most_probable == (group,), "p": found.probabilities.p_value}


def shares(table, by):
    """Percent with a p value up to the level, with the standard error of means over chains."""
    low = table.assign(low=100.0 * (table["p"] <= LEVEL))
    of_chains = low.groupby([*by, "seed"], sort=False)["low"].mean().groupby(level=list(range(len(by))), sort=False)
    by_chance = 100 * np.sqrt(LEVEL * (1 - LEVEL) / low.groupby(by, sort=False).size().to_numpy())
    error = np.maximum(of_chains.sem().fillna(0.0), by_chance)  # of few chains, none may have a low one
    return pd.DataFrame({"p <= .05, %": of_chains.mean(), "error": error})


def main():
    options = arguments(
        __doc__,
        structures=(["truss", "footbridge", "girder"], None, list(KNOWN)),
        correlations=[0.0, 0.5],
        first=(100, "seed of the first chain; those below 100 chose settings"),
        seeds=(20, "number of chains of each structure and correlation"),
        quick=(False, "4 chains each"),
        healthy=(False, "without the power"),
    )
    windows, states = [], []
    for name in options.structures:
        for memory in options.correlations:
            for seed in range(options.first, options.first + (4 if options.quick else options.seeds)):
                campaign = Campaign(KNOWN[name](), seed, memory=memory, is_plain=True, n_days=TRAINING_DAYS)
                of_chain = {"structure": name, "correlation": memory, "seed": seed}
                windows += [of_chain | one for one in healthy(campaign, memory)]
                states += [] if options.healthy else [of_chain | one for one in damaged(campaign, memory)]
            done = pd.DataFrame(windows).query("structure == @name and correlation == @memory")
            print(shares(done, ["structure", "correlation", "length"]).round(1).to_string(), flush=True)
    windows = pd.DataFrame(windows)
    print("\nHealthy windows")
    found = shares(windows, ["structure", "correlation", "length"])
    print(pd.concat([found, shares(windows, ["length"])]).round(1).to_string())
    print(
        f"p values in tenths, %: {np.round(100 * np.histogram(windows['p'], 10, (0, 1))[0] / len(windows)).astype(int)}"
    )
    if states:
        states = pd.DataFrame(states)
        print("\nDamaged windows, %")
        power = states.assign(low=states["p"] <= LEVEL).groupby(["structure", "correlation", "severity"], sort=False)
        print((100 * power[["identified", "low"]].mean()).round(0).to_string())
        print(
            (100 * states.assign(low=states["p"] <= LEVEL).groupby("severity")[["identified", "low"]].mean()).round(0)
        )
    off = (found["p <= .05, %"] - found["p <= .05, %"].clip(*(100 * np.array(TARGET)))).abs()
    missed = found[off > 2 * found["error"]]
    print(f"\n{len(missed)} of {len(found)} shares are outside {TARGET} by more than two standard errors")
    return int(len(missed) > 0)


if __name__ == "__main__":
    sys.exit(main())
