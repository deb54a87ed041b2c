"""How often intervals of a rate of alarms hold it, for independent and serially correlated records.

    OMP_NUM_THREADS=1 python tests/benchmarks/detectability_intervals.py

Decisions are Gaussian AR(1) noise less a limit. Of several repeats, the limit has a season, and the rate asked for is
that of this season; of a single repeat (measured records) it is constant.
"""

import argparse

import numpy as np
import pandas as pd
from scipy.signal import lfilter
from scipy.stats import norm

from skthermo.studies.detectability._intervals import rate_of

RATES = (0.02, 0.3, 0.95)
CORRELATIONS = (0.0, 0.5, 0.8, 0.95)
SIZES = ((20, 365), (3, 365), (1, 365), (1, 2000))


def decisions(random, rate, correlation, n_repeats, n_records):
    """Decision function of records, and the rate at which it is negative."""
    shocks = random.standard_normal((n_repeats, n_records + 300))
    noise = lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], shocks, axis=1)[:, 300:]
    season = 0.5 * np.sin(2 * np.pi * np.arange(n_records) / n_records) if n_repeats > 1 else np.zeros(n_records)
    limits = norm.ppf(rate) + season
    return noise - limits, norm.cdf(limits).mean()


def coverage(rate, correlation, size, n_simulations, confidence):
    """Percentage of intervals that hold the rate, their mean width, and the share of the records that is effective."""
    random, found, truth = np.random.RandomState(0), [], 0.0
    for _ in range(n_simulations):
        values, truth = decisions(random, rate, correlation, *size)
        found.append(rate_of(values, confidence))
    held = np.mean([each.lowest <= truth <= each.highest for each in found])
    width = np.mean([each.highest - each.lowest for each in found])
    return 100 * held, 100 * width, 100 * np.mean([each.n_effective / each.n_records for each in found])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--simulations", type=int, default=500)
    parser.add_argument("--confidence", type=float, default=0.95)
    options = parser.parse_args()
    rows = {}
    for size in SIZES:
        for correlation in CORRELATIONS:
            for rate in RATES:
                found = coverage(rate, correlation, size, options.simulations, options.confidence)
                rows[f"{size[0]} x {size[1]}", correlation, rate] = found
    names = ["repeats x records", "correlation", "rate"]
    index = pd.MultiIndex.from_tuples(list(rows), names=names)
    table = pd.DataFrame(list(rows.values()), index=index, columns=["held, %", "width, points", "effective, %"])
    print(f"{options.confidence:.0%} intervals of {options.simulations} simulations each\n")
    print(table.unstack("rate").round(1).to_string(), end="\n\n")
    print(table["held, %"].agg(["min", "mean", "max"]).round(1).to_string())


if __name__ == "__main__":
    main()
