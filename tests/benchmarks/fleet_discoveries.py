"""False discoveries among the alarms of many bridges, under laws of noise that the p values do not know.

    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_discoveries.py
    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_discoveries.py --quick

Fleets of 40 bridges with six modes, whose weather is known: a year of daily residuals as baseline and a year in service
under a law of `false_alarm_rates.py`. Four of them lose stiffness 115 days before its end: shifts of 1 to 4 robust
standard deviations of the modes, times .8, .5, .3 and .1. Events are those of a ``Monitor`` with a
``MahalanobisDetector``, without its checks of records, which would take most of the time.

"all alarms" are open events, "own tails" is the procedure of Benjamini and Hochberg at 10 % with p values by each
bridge's own baseline, "discoveries" is ``Fleet.discoveries``. FDR is the mean share of healthy ones among the bridges
that are found, and "found" the share of the damaged ones, by shift. The exit code is 1 if an FDR of the discoveries is
above .15.
"""

import sys
import time

import numpy as np
import pandas as pd
from false_alarm_rates import LAWS, STAMPS, YEAR, drawn
from harness import arguments
from scipy.stats import false_discovery_control

from skthermo.detection import MahalanobisDetector
from skthermo.fleet._discoveries import discover
from skthermo.monitoring._events import find_events
from skthermo.monitoring._threshold import estimate_false_alarms

FDR, MOST, N_BRIDGES, SHIFTS = 0.1, 0.15, 40, (1.0, 2.0, 3.0, 4.0)
SETS_IN, PATTERN = YEAR + 250, np.array([0.8, 0.5, 0.3, 0.1, 0.0, 0.0])


class Served:
    """What the fleet asks of a monitor after its year in service."""

    def __init__(self, law, seed, shift, persistence):
        z = drawn(law, (len(STAMPS), len(PATTERN)), np.random.default_rng(seed))[: 2 * YEAR]
        z[SETS_IN:] -= shift * PATTERN * 1.4826 * np.median(np.abs(z[:YEAR]), axis=0)
        records = pd.DataFrame(z, STAMPS[: 2 * YEAR])
        detector = MahalanobisDetector().fit(records[:YEAR])
        self.false_alarm_estimate_ = estimate_false_alarms(
            pd.Series(detector.baseline_index_, STAMPS[:YEAR]), persistence=persistence
        )
        index, rule = detector.damage_index(records[YEAR:]), self.false_alarm_estimate_.rule
        self.events_ = find_events(np.asarray(index), STAMPS[YEAR : 2 * YEAR], rule)
        self.events_ = self.events_.assign(kind="damage", modes="", acknowledged=False, harmless=False)
        self.days_, self.last_ = records[YEAR:], STAMPS[2 * YEAR - 1]

    def years_watched(self, since=None):
        return 1.0

    def event_p_values(self, since=None, *, tail_shape=None):
        peaks = self.events_["peak"]
        return peaks.map(lambda peak: self.false_alarm_estimate_.p_value(peak, 1.0, tail_shape)).astype(float)

    @property
    def is_open(self):
        return self.events_["end"].isna()


def measures(found):
    found, n_damaged = np.asarray(found), len(SHIFTS)
    shares = {f"found {shift:g}": float(found[n]) for n, shift in enumerate(SHIFTS)}
    return {"FDR": found[n_damaged:].sum() / max(found.sum(), 1)} | shares


def main():
    options = arguments(
        __doc__,
        laws=(["iid", "ar .5", "t3", "outliers .1 %", "outliers .5 %"], None, list(LAWS)),
        fleets=(20, "of each law"),
        persistence=[1, 3],
        seed=0,
        quick=(False, "two fleets of each law"),
    )
    start, rows, shifts = time.perf_counter(), [], [*SHIFTS, *[0.0] * (N_BRIDGES - len(SHIFTS))]
    for law in options.laws:
        for fleet in range(2 if options.quick else options.fleets):
            seeds = np.random.SeedSequence([options.seed, fleet]).generate_state(N_BRIDGES)
            for persistence in options.persistence:
                monitors = {n: Served(law, seeds[n], shift, persistence) for n, shift in enumerate(shifts)}
                standings = {n: {"last": one.last_, "state": ""} for n, one in monitors.items()}
                found = discover(monitors, standings, FDR, 365.25)
                p = [one.event_p_values()[one.is_open].min() for one in monitors.values()]
                own = false_discovery_control(np.nan_to_num(p, nan=1.0)) <= FDR
                ways = {
                    "all alarms": [one.is_open.any() for one in monitors.values()],
                    "own tails": own,
                    "discoveries": [n in found.bridges for n in monitors],
                }
                of = {"law": law, "persistence": persistence}
                rows += [of | {"rule": name} | measures(way) for name, way in ways.items()]
    summary = pd.DataFrame(rows).groupby(["persistence", "law", "rule"], sort=False).mean()
    print(summary.round(2).to_string())
    print(f"{time.perf_counter() - start:.0f} s")
    return 0 if (summary.xs("discoveries", level="rule")["FDR"] <= MOST).all() else 1


if __name__ == "__main__":
    sys.exit(main())
