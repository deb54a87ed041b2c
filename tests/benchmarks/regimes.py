"""Regimes where the scatter of residuals changes, by false alarms and damage found.

    OMP_NUM_THREADS=1 python tests/benchmarks/regimes.py [--parts z24 winters]

- z24: four folds, in each of which a quarter of the healthy records, a contiguous one, is held back. The data are in
  the folder that SKTHERMO_DATA names.
- winters: thirty bridges of ``make_fleet`` learn six weeks of two-hourly records to March, and evaluate the
  spring; in the damaged one, the first damage group has lost 20 %.

"No extrapolation" is the default whose residuals count as much outside the baseline's weather as inside.

The exit code is 1 if the default gives more than 4 % false alarms in spring, or misses half of the damage.
"""

import sys
from contextlib import nullcontext
from unittest.mock import patch

import numpy as np
import pandas as pd
from directions import by_threshold, indices, over_folds, z24_folds
from harness import arguments, compensated, joined, last_step, modes_of, shown

from skthermo.datasets import make_fleet, make_z24
from skthermo.detection import DirectionalDetector
from skthermo.residuals.weather import Extrapolation

SEEDS = 0, 1, 7
WAYS = {'"auto", default': "auto", "None": None, "no extrapolation": "auto"}
LAST = {"directions of the FE model": lambda: DirectionalDetector(make_z24()), "Mahalanobis": lambda: None}


def as_inside(way):
    """In the way without extrapolation, residuals have one variance in any weather."""
    if way != "no extrapolation":
        return nullcontext()
    return patch.object(Extrapolation, "variances", lambda self, weather: np.ones(len(weather)))


def z24():
    found = {}
    for baseline, tables in z24_folds():
        for way, regimes in WAYS.items():
            for what, last in LAST.items():
                with as_inside(way):
                    detector = compensated(modes_of(baseline), last(), regimes=regimes).fit(baseline)
                    one = indices(detector, tables)
                found.setdefault(f"{what}, {way}", []).append((one, by_threshold(last_step(detector), one)))
    rows = {}
    for what, folds in found.items():
        own = pd.DataFrame([one for _, one in folds]).mean().add_prefix("own threshold, ")
        rows[what] = over_folds([one for one, _ in folds]) | own.to_dict()
    title = "Z24, four quarters held back in turn: damaged records found at measured false alarms, %"
    shown(title, pd.DataFrame(rows).T.rename_axis("detector and regimes"), 1)
    return False


def winters():
    rates = {}
    for bridge in (one for seed in SEEDS for one in make_fleet(10, atypical=0.0, random_state=seed).values()):
        baseline, *later = (
            joined(bridge.records(n_days, start, samples_per_day=12, damage=damage))
            for n_days, start, damage in (
                (42, "2025-01-18", None),
                (92, "2025-03-01", None),
                (92, "2025-03-01", {bridge.groups[0]: 0.2}),
            )
        )
        for way, regimes in WAYS.items():
            with as_inside(way):
                detector = compensated(modes_of(baseline), regimes=regimes).fit(baseline)
                decisions = [detector.predict(records) for records in later]
            rates.setdefault(way, []).append([100 * (one[one != 0] == -1).mean() for one in decisions])
    rows = {}
    for way, each in rates.items():
        false, found = np.transpose(each)
        rows[way] = {"false alarms": false.mean(), "of the worst bridge": false.max(), "damage found": found.mean()}
    table = pd.DataFrame(rows).T.rename_axis("regimes")
    shown("Thirty bridges, six weeks of winter learned: alarms in the spring, Mahalanobis, 2 % asked for, %", table, 1)
    false, _, found = table.iloc[0]
    return false > 4 or found < 50


PARTS = {"z24": z24, "winters": winters}


def main():
    return int(sum(PARTS[part]() for part in arguments(__doc__, parts=PARTS).parts) > 0)


if __name__ == "__main__":
    sys.exit(main())
