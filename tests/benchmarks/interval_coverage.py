"""What serial dependence of the records does to the intervals of predicted frequencies.

    OMP_NUM_THREADS=1 python tests/benchmarks/interval_coverage.py

The chain learns from a year of the truss and predicts 90 % intervals for the next. The noise of each mode is a
first-order autoregression, always with the same variance, whose correlation from day to day is varied.
"""

import numpy as np
import pandas as pd
from harness import arguments, autoregression, shown

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM

NOISE, YEAR, SHORT = 0.01, 365, 60


def held(correlation, seed):
    """Which frequencies of the second year are in their intervals, (n_days, n_modes)."""
    random = np.random.RandomState(seed)
    campaign = make_truss_campaign(n_years=2, noise=0.0, random_state=random)
    clean, T = campaign.clean_frequencies, campaign.temperatures
    F = clean * (1 + NOISE * autoregression(random, clean.shape, correlation))
    fem = DataInformedFEM(make_truss(), random_state=seed).fit(T[:YEAR], F[:YEAR])
    lowest, highest = fem.predict_interval(T[YEAR:])
    later = F[YEAR:]
    return ((later > lowest) & (later < highest)).to_numpy()


def coverages(rows, n_days):
    """Coverage of each whole period of some days by mode, (n_periods, n_modes), in percent."""
    periods = len(rows) // n_days
    return 100 * rows[: periods * n_days].reshape(periods, n_days, -1).mean(axis=1)


def row(correlation, repeats):
    years = [held(correlation, seed) for seed in range(repeats)]
    long, short = (np.concatenate([coverages(year, days) for year in years]) for days in (YEAR, SHORT))
    return {
        "inside, %": long.mean(),
        "one mode in a year, standard deviation": long.std(),
        "one mode in 60 days, standard deviation": short.std(),
        "one mode in 60 days, one in twenty below": np.quantile(short, 0.05),
    }


def main():
    options = arguments(__doc__, repeats=5, correlations=[0.0, 0.5, 0.9, 0.98])
    rows = {f"{correlation:g}": row(correlation, options.repeats) for correlation in options.correlations}
    title = f"Frequencies of a later year in their 90 % intervals; truss, 1 % noise, {options.repeats} repeats"
    shown(title, pd.DataFrame(rows).T.rename_axis("correlation from day to day"), 1)


if __name__ == "__main__":
    main()
