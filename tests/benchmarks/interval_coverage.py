"""What serial dependence of the records does to the intervals of predicted frequencies.

    OMP_NUM_THREADS=1 python tests/benchmarks/interval_coverage.py

The chain learns from a year of the truss and predicts 90 % intervals for the next. The noise of each mode is a
first-order autoregression, always with the same variance, whose correlation from day to day is varied.
"""

import numpy as np
import pandas as pd
from harness import arguments, autoregression

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM

NOISE, DAYS = 0.01, 365
CORRELATIONS = (0.0, 0.5, 0.9, 0.98)
PERIODS = {"later 60 days": 60, "later year": DAYS}


def held(correlation, seed):
    """Which frequencies of the second year are in their intervals, (n_days, n_modes)."""
    random = np.random.RandomState(seed)
    campaign = make_truss_campaign(n_years=2, noise=0.0, random_state=random)
    clean, T = campaign.clean_frequencies, campaign.temperatures
    F = clean * (1 + NOISE * autoregression(random, clean.shape, correlation))
    fem = DataInformedFEM(make_truss(), random_state=seed).fit(T[:DAYS], F[:DAYS])
    lowest, highest = fem.predict_interval(T[DAYS:])
    later = F[DAYS:]
    return ((later > lowest) & (later < highest)).to_numpy()


def coverages(rows, n_days):
    """Coverage of each whole period of some days by mode, (n_periods, n_modes), in percent."""
    periods = len(rows) // n_days
    return 100 * rows[: periods * n_days].reshape(periods, n_days, -1).mean(axis=1)


def table(correlations, repeats):
    """Coverage by correlation: its mean, and how much it varies between repeats and periods."""
    rows = {}
    for correlation in correlations:
        found = [held(correlation, seed) for seed in range(repeats)]
        for name, n_days in PERIODS.items():
            shares = np.concatenate([coverages(year, n_days) for year in found])
            by_period = shares.mean(axis=1)
            rows[correlation, name] = [shares.mean(), by_period.std(), shares.std(), np.quantile(shares, 0.05)]
    columns = ["mean", "deviation, all modes", "deviation, one mode", "one mode in twenty below"]
    frame = pd.DataFrame(rows, columns).T
    frame.index.names = ["correlation", "period"]
    return frame


def main():
    options = arguments(__doc__, repeats=30, correlations=list(CORRELATIONS))
    found = table(options.correlations, options.repeats)
    print(f"coverage of 90 % intervals in percent: mean of {options.repeats} repeats, standard deviation between")
    print(
        "repeats and periods, of all six modes together and of a single mode, and the 5 % quantile of a single mode\n"
    )
    print(found.round(1).to_string(), end="\n\n")
    for correlation in options.correlations:
        mean = found.loc[(correlation, "later year"), "mean"]
        print(f"mean coverage of a later year at correlation {correlation:g}, 85 to 95 %: {mean:.1f}")


if __name__ == "__main__":
    main()
